"""`make bench-viewer`: how large the pages of `--emit html` are, how soon they show something, and what a picture costs their program.

Opened is from the browser's asking for the file to the first picture, in a Chromium that draws without a graphics card. A picture's
milliseconds are those of the page's program alone (medians), while a joint is moved and while the camera turns; what a graphics card
then does, a browser without one cannot tell.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE.parent), str(ROOT / "tests")]

from viewer.browser import address, chromium, opened  # noqa: E402
from wide import write_wide  # noqa: E402


@dataclass(frozen=True)
class Bounds:
    """What a page must reach: bytes, seconds until it shows something, and milliseconds of script for a picture."""

    size: float
    opened: float
    script: float


ROBOTS = {"arm": Bounds(1.5e6, 1.0, 4.0), "minchw": Bounds(2e6, 1.0, 4.0), "level0": Bounds(float("inf"), float("inf"), 12.0)}
"""The robots of the repository, and 1 000 occurrences in 20 documents."""

MOVED = """() => {
  const { viewer } = thingc, { path, lower, upper } = viewer.joints[0], spent = [];
  return new Promise((done) => {
    const step = (k) => {
      if (k > 0) spent.push(viewer.stage.spent);
      if (k === 40) return done(spent);
      const [low, high] = [Math.max(lower ?? -1, -1), Math.min(upper ?? 1, 1)];
      viewer.setCoordinate(path, low + ((high - low) * (k + 1)) / 41);
      requestAnimationFrame(() => requestAnimationFrame(() => step(k + 1)));
    };
    step(0);
  });
}"""
TURNED = """() => {
  const { stage } = thingc.viewer, spent = [];
  return new Promise((done) => {
    const step = (k) => {
      if (k > 0) spent.push(stage.spent);
      if (k === 40) return done(spent);
      stage.camera.position.applyAxisAngle(stage.camera.up, 0.02);
      stage.controls.update();
      stage.ask();
      requestAnimationFrame(() => requestAnimationFrame(() => step(k + 1)));
    };
    step(0);
  });
}"""


def build(document: Path, folder: Path) -> None:
    """The page of a document, in `folder`."""
    command = [str(Path(sys.executable).parent / "thingc"), "build", str(document), "--output", str(folder), "--emit", "html"]
    subprocess.run(command, check=True, capture_output=True, cwd=document.parent)


def measured(browser: Any, page: Path, runs: int) -> tuple[float, float, float, int]:
    """Seconds until a page shows something, milliseconds of script while a joint and while the camera moves, and draw calls."""
    times: list[float] = []
    for _ in range(runs):
        with opened(browser, address(page)) as shown:
            shown.wait_for_function("() => performance.getEntriesByName('drawn').length > 0")
            times.append(shown.evaluate("performance.getEntriesByName('drawn')[0].startTime") / 1000.0)
            if len(times) == runs:
                moved, turned = statistics.median(shown.evaluate(MOVED)), statistics.median(shown.evaluate(TURNED))
                calls = shown.evaluate("thingc.viewer.stage.calls")
    return statistics.median(times), moved, turned, calls


def main() -> int:
    """Print the table; exit code 1 when a bound is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=5, help="how often each page is opened; medians are printed")
    arguments = parser.parse_args()
    missed = 0
    print(f"{'':8} {'KB':>6} {'parts':>6} {'opened':>8} {'a joint moves':>14} {'the camera':>11} {'calls':>6}")
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        (Path(folder) / "thingc.toml").write_text('thingc = "workspace/1"\npackages = ["thingc_stock"]\n')
        documents = [ROOT / "assemblies/arm.yaml", ROOT / "assemblies/minchw/minchw.yaml", Path(folder) / write_wide(Path(folder))]
        for document, (name, bounds) in zip(documents, ROBOTS.items(), strict=True):
            build(document, Path(folder) / "pages")
            page = Path(folder) / f"pages/{name}/html/{name}.html"
            took, moved, turned, calls = measured(browser, page, arguments.n)
            size = page.stat().st_size
            good = size <= bounds.size and took <= bounds.opened and max(moved, turned) <= bounds.script
            missed += not good
            parts = page.read_text().count('"collides":')
            numbers = f"{size / 1000:6.0f} {parts:6} {took:6.2f} s {moved:11.2f} ms {turned:8.2f} ms {calls:6}"
            print(f"{name:8} {numbers}{'' if good else '  MISSED'}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
