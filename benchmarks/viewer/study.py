"""`make bench-viewer`: measure the web pages that `--emit html` writes. The results are the size, the time to the first picture, and the
script time per picture.

The column "opened" contains the time from the request of the page to the first picture, in a Chromium without a graphics card. The columns
in milliseconds contain the median script time per picture, while a joint moves and while the camera turns. The time of a graphics card is
not included.

The column "saved" contains the time from a save to the second frame of the browser with the result, while `thingc view` shows the robot.
The time in which workers modelled parts is subtracted (see `Save` in `benchmarks/run.py`).
"""

from __future__ import annotations

import argparse
import http.client
import json
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE.parent), str(ROOT / "tests")]

from run import Save, Workspace, saves  # noqa: E402
from viewer.browser import address, chromium, opened  # noqa: E402
from wide import write_wide  # noqa: E402


@dataclass(frozen=True)
class Bounds:
    """Upper bounds for a page: size [bytes], time to the first picture [s], and script time per picture [ms]."""

    size: float
    opened: float
    script: float


ROBOTS = {"arm": Bounds(1.5e6, 1.0, 4.0), "minchw": Bounds(2e6, 1.0, 4.0), "level0": Bounds(float("inf"), float("inf"), 12.0)}
"""Bounds for the pages of both robots, and for a robot with 1 000 occurrences in 20 documents."""

SAVED = 0.3
"""Upper bound of the time [s] from a save until the page has drawn the result. This time does not include the modelling of parts."""

REDRAWN = """() => {
  const { viewer } = thingc, before = viewer.robot;
  thingc.redrawn = new Promise((done) => {
    const look = () => viewer.robot === before ? requestAnimationFrame(look)
      : requestAnimationFrame(() => requestAnimationFrame(() => done((performance.timeOrigin + performance.now()) / 1000)));
    look();
  });
}"""
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
    """Build the web page of a document in `folder`."""
    command = [str(Path(sys.executable).parent / "thingc"), "build", str(document), "--output", str(folder), "--emit", "html"]
    subprocess.run(command, check=True, capture_output=True, cwd=document.parent)


def measured(browser: Any, page: Path, runs: int) -> tuple[float, float, float, int]:
    """Measure a page. Return the time to the first picture [s], the script times [ms] while a joint moves and while the camera turns, and
    the number of draw calls.
    """
    times: list[float] = []
    for _ in range(runs):
        with opened(browser, address(page)) as shown:
            shown.wait_for_function("() => performance.getEntriesByName('drawn').length > 0")
            times.append(shown.evaluate("performance.getEntriesByName('drawn')[0].startTime") / 1000.0)
            if len(times) == runs:
                moved, turned = statistics.median(shown.evaluate(MOVED)), statistics.median(shown.evaluate(TURNED))
                calls = shown.evaluate("thingc.viewer.stage.calls")
    return statistics.median(times), moved, turned, calls


def redrawn(browser: Any, workspace: Workspace, saved: Save, times: int) -> tuple[list[float], list[float]]:
    """Return two lists of times [s], one item per save: the time until the page has drawn the result, and the time in which workers
    modelled parts.
    """
    command = [str(Path(sys.executable).parent / "thingc"), "view", saved.document, "--no-open"]
    seconds: list[float] = []
    kernel: list[float] = []
    with subprocess.Popen(
        command, cwd=workspace.folder, env=workspace.environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    ) as process:
        assert process.stdout is not None
        shown = next((line.strip() for line in process.stdout if line.startswith("http://")), "")
        url = urlsplit(shown)
        connection = http.client.HTTPConnection(url.hostname or "", url.port, timeout=60.0)
        connection.request("GET", f"{url.path}events")
        news = connection.getresponse()
        told = (json.loads(line.removeprefix(b"data: ")) for line in news if line.startswith(b"data: "))
        next(told)
        with opened(browser, shown) as page:
            time.sleep(4.0)  # wait until the CAD kernel is loaded
            for turn in range(times + 1):
                time.sleep(0.3 + 0.007 * turn)
                page.evaluate(REDRAWN)
                saved.save()
                start = time.time()
                seconds.append(page.evaluate("thingc.redrawn") - start)
                kernel.append(next(told)["kernel"])
        connection.close()
        process.terminate()
    return seconds[1:], kernel[1:]


def after_saves(browser: Any, runs: int) -> int:
    """Print the times from saves to drawn pictures. Return the number of times that exceed the bound."""
    missed = 0
    print(f"{'':28} {'saved':>8} {'must':>7}")
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace(Path(folder))
        for saved in saves(workspace):
            seconds, kernel = redrawn(browser, workspace, saved, 2 * runs)
            beyond = statistics.median(one - other for one, other in zip(seconds, kernel, strict=True))
            modelling = statistics.median(kernel)
            missed += beyond > SAVED
            more = f"  beyond the kernel's {modelling:.2f} s" if modelling else ""
            print(f"{saved.name.replace('watch', 'view'):28} {beyond:6.2f} s {SAVED:5.1f} s{more}{'' if beyond <= SAVED else '  MISSED'}")
    return missed


def main() -> int:
    """Print the table of results. Return 1 if a bound is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=5, help="number of times each page is opened; medians are printed")
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
        missed += after_saves(browser, arguments.n)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
