"""A real browser that opens the page of a robot from a file."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
needed = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed (Debian, Ubuntu: apt install chromium)")

FLAGS = (
    "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing",
    "--disable-background-networking",
)
"""Render without a graphics card: WebGL with SwiftShader, and the page itself without GPU compositing, which is faster."""

OWN = ("file:", "blob:", "data:", "http://127.0.0.1")
"""Allowed request origins of a page."""


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield the browser, controlled by playwright."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as steering:
        browser = steering.chromium.launch(executable_path=BROWSER, args=list(FLAGS))
        yield browser
        browser.close()


LATER = """globalThis.waiting = [];
  globalThis.frames_of_browser = globalThis.requestAnimationFrame.bind(globalThis);
  globalThis.requestAnimationFrame = (draw) => waiting.push(draw);"""
"""The page draws nothing until `drawn` is called: rendering without a graphics card is slow, and most tests only check numbers."""


@contextmanager
def opened(browser: Any, address: str, size: tuple[int, int] = (760, 480)) -> Iterator[Any]:
    """Yield a completely loaded page, which renders once `drawn` is called. Errors in the page and network requests fail the test. Each
    browser has its own process; a context keeps it, and code compiled in it, from page to page."""
    page = browser.new_page()
    page.add_init_script(LATER)
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.emulate_media(reduced_motion="reduce")
    faults: list[str] = []
    page.on("pageerror", lambda fault: faults.append(str(fault)))
    page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
    page.on("request", lambda asked: faults.append(asked.url) if not asked.url.startswith(OWN) else None)
    page.goto(address)
    until(page, "() => globalThis.thingc?.ready")
    yield page
    assert faults == []
    page.close()


def until(page: Any, condition: str) -> None:
    """Wait for a condition by polling; by default it is evaluated with each drawn frame."""
    page.wait_for_function(condition, polling=50)


def address(path: Path, fragment: str = "") -> str:
    """Return the address of a file."""
    return path.resolve().as_uri() + fragment


def drawn(page: Any) -> None:
    """Draw from now on, and wait until changes are rendered."""
    page.evaluate("""() => { globalThis.requestAnimationFrame = frames_of_browser; waiting.splice(0).forEach(requestAnimationFrame);
      return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); }""")


def links(page: Any) -> dict[str, list[float]]:
    """Return the world pose of every link in the page: 16 numbers by rows."""
    found: dict[str, list[float]] = page.evaluate("thingc.viewer.links()")
    return found


def spot(page: Any, path: str) -> tuple[float, float]:
    """Return a point of the window where the page shows the component with this path."""
    x, y = page.evaluate("""(path) => {
      const { viewer } = thingc, { stage } = viewer, index = viewer.robot.occurrences.findIndex((one) => one.path === path);
      const box = stage.canvas.getBoundingClientRect(), centre = viewer.robot.occurrences[index].centre;
      const [{ x, y }] = stage.project([stage.camera.position.clone().fromArray(centre).applyMatrix4(viewer.drawn[index])]);
      // the component is not always visible at its centre: search on a spiral around it
      for (let k = 0; k < 2000; k += 1) {
        const [left, top] = [Math.cos(2.4 * k), Math.sin(2.4 * k)].map((side, axis) => Math.round([x, y][axis] + 3 * Math.sqrt(k) * side));
        const hit = viewer.hit(box.left + left, box.top + top);
        if (hit !== null && hit.occurrence === index) return [box.left + left, box.top + top];
      }
      return null;
    }""", path)
    return x, y
