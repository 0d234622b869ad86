"""Read models and worlds of SDF with libsdformat, the reader of Gazebo: `python ask_libsdformat.py REQUESTS ANSWERS`. Warnings of
libsdformat count as errors.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

HERE = Path(__file__).resolve().parent
PACKAGE = "sdformat12"


def program(folder):
    """Compile the C++ program that calls libsdformat into a folder, and return the path of the program."""
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", PACKAGE], check=True, capture_output=True, text=True).stdout
    subprocess.run(["g++", "-std=c++17", str(HERE / "read_sdf.cc"), "-o", str(folder / "read_sdf"), *shlex.split(flags)], check=True)
    return folder / "read_sdf"


def minor(version):
    """Return the minor version as a number, such as 11 for `1.11`."""
    return int(version.partition(".")[2])


def answering(reader):
    """Return a function that sends a request to the reader and returns its answer."""
    def answer(asked):
        file = Path(asked["file"])
        mode = file.parent.name.removeprefix(f"{file.parents[2].name}_")
        world = file.parents[1] / f"world_{mode}.sdf"
        said = subprocess.run([reader, file, world], check=True, capture_output=True, text=True).stdout
        known, model, around = map(json.loads, said.splitlines())
        written = ElementTree.parse(file).getroot().attrib["version"]
        for one in (model, around):
            if "cannot" in one and minor(written) > minor(known):
                raise ValueError(f"SDFormat {written} is newer than the supported version {known}")
            if "cannot" in one:
                raise ValueError(one["cannot"])
        return model

    return answer


if __name__ == "__main__":
    from asking import serve

    version = subprocess.run(["pkg-config", "--modversion", PACKAGE], check=True, capture_output=True, text=True).stdout.strip()
    serve(answering(program(Path(sys.argv[2]).resolve().parent)), version, sys.argv)
