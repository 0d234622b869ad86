"""`make pictures`: the pictures that the README and the docs show, drawn by `thingc render`, `thingc hag` and a browser."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
PICTURES = ROOT / "docs" / "pictures"
WIDTH, HEIGHT = 640, 480

STRIPS: dict[str, tuple[str, list[list[str]]]] = {
    "arm_modes.png": ("assemblies/arm.yaml", [
        ["--mode", "bench", "--pose", "home", "--azimuth", "150", "--elevation", "-20"],
        ["--mode", "drawing", "--pose", "writing", "--azimuth", "120", "--elevation", "-18"],
        ["--mode", "adrift", "--pose", "stretched", "--azimuth", "120", "--elevation", "-18"],
    ]),
    "minchw_modes.png": ("assemblies/minchw/minchw.yaml", [
        ["--mode", "crawl", "--azimuth", "125"],
        ["--mode", "front_foot_wall", "--pose", "step_rear", "--azimuth", "55", "--elevation", "-8"],
        ["--mode", "rear_foot_ceiling", "--pose", "arched", "--azimuth", "125"],
    ]),
    "arm_frames.png": ("assemblies/arm.yaml", [["--mode", "drawing", "--joints", "--root", "--mounts-of", "hand.fixture"]]),
}
"""Pictures side by side: the document, and how each is taken."""


def thingc(*words: str) -> str:
    """Standard output of a command."""
    command = [sys.executable, "-m", "thingc", *words]
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def strip(document: str, shots: list[list[str]]) -> Image.Image:
    """The shots of a document, side by side."""
    whole = Image.new("RGB", (WIDTH * len(shots), HEIGHT))
    with tempfile.TemporaryDirectory() as folder:
        for index, shot in enumerate(shots):
            path = os.path.join(folder, f"{index}.png")
            thingc("render", document, *shot, "--size", f"{WIDTH}x{HEIGHT}", "-o", path)
            with Image.open(path) as picture:
                whole.paste(picture, (index * WIDTH, 0))
    return whole


def batch_page(path: Path) -> None:
    """The page of a batch in a browser, one of its variants chosen."""
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        print("no Chromium is installed: the picture of a batch's page stays as it is", file=sys.stderr)
        return
    with tempfile.TemporaryDirectory() as folder:
        thingc("batch", "assemblies/minchw/sizes.yaml", "-o", folder, "--pictures", "all")
        lines = (Path(folder) / "sizes" / "results.csv").read_text().splitlines()
        id = lines[9].split(",")[1]
        page = (Path(folder) / "sizes" / "index.html").as_uri()
        words = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1400,1000"]
        words += ["--virtual-time-budget=3000", f"--user-data-dir={folder}/profile", f"--screenshot={path}", f"{page}#{id}"]
        subprocess.run([browser, *words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with Image.open(path) as picture:
        picture.convert("RGB").save(path, optimize=True)


def main() -> int:
    """Draw every strip, the page of a batch, and the assembly graph of the arm."""
    PICTURES.mkdir(exist_ok=True)
    for name, (document, shots) in STRIPS.items():
        strip(document, shots).save(PICTURES / name, optimize=True)
    batch_page(PICTURES / "batch_page.png")
    (PICTURES / "arm_hag.svg").write_text(thingc("hag", "assemblies/arm.yaml", "--format", "svg"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
