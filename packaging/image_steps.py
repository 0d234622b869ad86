"""Run the steps of `packaging/Dockerfile` in a new Debian system, and build a robot in it (`make image-steps`).

The script is for machines without Docker. debootstrap creates the system of the image `FROM` in a folder, and chroot runs the steps there.
The script requires root, and a wheel in `dist/`.

    python packaging/image_steps.py [--mirror URL] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CHECKS = ("thingc --version", "thingc new rover", "thingc build rover/rover.yaml", "thingc render rover/rover.yaml", "git --version")
"""Commands to run in the finished image."""
NETWORK = {"/etc/resolv.conf": "etc/resolv.conf", "/etc/ssl/certs/ca-certificates.crt": "root/certificates.crt"}
"""Files of this machine that the steps need to reach package registries, with their places in the image."""


def steps(text: str) -> Iterator[tuple[str, str]]:
    """Return the instructions of a Dockerfile with their arguments."""
    joined = re.sub(r"\\\n", " ", re.sub(r"^#.*\n", "", text, flags=re.MULTILINE))
    for line in filter(str.strip, joined.splitlines()):
        instruction, _, arguments = line.strip().partition(" ")
        yield instruction, " ".join(arguments.split())


class Image:
    """A root file system, and the variables and the working folder that instructions have set."""

    def __init__(self, root: Path, mirror: str) -> None:
        self.root, self.mirror = root, mirror
        self.variables = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root"}
        self.folder = "/"
        self.entry: list[str] = []

    def run(self, command: str) -> None:
        """Run a shell command in the image. Raises `CalledProcessError` if it fails."""
        network = {name: text for name, text in os.environ.items() if name.lower().endswith("_proxy")}
        network["PIP_CERT"] = "/root/certificates.crt"
        script = f"cd {self.folder} && {command}"
        subprocess.run(["chroot", self.root, "/bin/sh", "-c", script], env=network | self.variables, check=True)

    def perform(self, instruction: str, arguments: str) -> None:
        """Perform one instruction."""
        match instruction:
            case "FROM":
                suite = arguments.removeprefix("debian:").removesuffix("-slim")
                subprocess.run(["debootstrap", "--variant=minbase", suite, self.root, self.mirror], check=True, stdout=subprocess.DEVNULL)
                for path, place in NETWORK.items():
                    shutil.copy(path, self.root / place)
            case "RUN":
                self.run(arguments)
            case "COPY":
                *sources, target = arguments.split()
                for path in [path for source in sources for path in sorted(ROOT.glob(source))]:
                    place = self.root / target[1:] / (path.name if target.endswith("/") else "")
                    place.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copytree(path, place) if path.is_dir() else shutil.copy(path, place)
            case "ENV":
                self.variables |= dict(word.split("=", 1) for word in arguments.split())
            case "WORKDIR":
                self.folder = arguments
                (self.root / arguments[1:]).mkdir(parents=True, exist_ok=True)
            case "ENTRYPOINT":
                self.entry = json.loads(arguments)
            case _:
                raise ValueError(f"unknown instruction {instruction}")


def main() -> int:
    """Run all steps, then the checks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mirror", default="http://deb.debian.org/debian", help="the mirror of Debian (default: %(default)s)")
    parser.add_argument("--keep", help="create the system in this folder, and do not remove it")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        image = Image(Path(options.keep or folder).resolve(), options.mirror)
        for instruction, arguments in steps((ROOT / "packaging" / "Dockerfile").read_text(encoding="utf-8")):
            print(f"{instruction} {arguments}", flush=True)
            image.perform(instruction, arguments)
        assert image.entry == ["thingc"]
        for check in CHECKS:
            print(f"CHECK {check}", flush=True)
            image.run(check)
    print("all steps succeeded")
    return 0


if __name__ == "__main__":
    sys.exit(main())
