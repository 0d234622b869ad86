"""A real browser with a page of a robot in it, from a file, as a person would open it."""

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
"""It draws without a graphics card: the robot by what stands in for one, the page around it in the plain way, which is quicker."""

OWN = ("file:", "blob:", "data:", "http://127.0.0.1")
"""Where a page may ask for something."""


@contextmanager
def chromium() -> Iterator[Any]:
    """The browser, as playwright steers it."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as steering:
        browser = steering.chromium.launch(executable_path=BROWSER, args=list(FLAGS))
        yield browser
        browser.close()


LATER = """globalThis.waiting = [];
  globalThis.frames_of_browser = globalThis.requestAnimationFrame.bind(globalThis);
  globalThis.requestAnimationFrame = (draw) => waiting.push(draw);"""
"""A page draws nothing until it is asked to: without a graphics card, a picture takes long, and most tests ask for numbers."""


@contextmanager
def opened(browser: Any, address: str, size: tuple[int, int] = (760, 480)) -> Iterator[Any]:
    """A page that has been read to its end, and shows its robot when it is `drawn`; nothing may go wrong in it, and nothing be asked of a
    network. Of a browser it has a process of its own; a context of one keeps that, and what was compiled in it, from page to page."""
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
    """Wait for a condition, which is otherwise asked whenever the page draws."""
    page.wait_for_function(condition, polling=50)


def address(path: Path, fragment: str = "") -> str:
    """Of a file."""
    return path.resolve().as_uri() + fragment


def drawn(page: Any) -> None:
    """Draw from now on, and wait until what has changed is in the picture."""
    page.evaluate("""() => { globalThis.requestAnimationFrame = frames_of_browser; waiting.splice(0).forEach(requestAnimationFrame);
      return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); }""")


def links(page: Any) -> dict[str, list[float]]:
    """Where the page has every link in the world: 16 numbers by rows."""
    found: dict[str, list[float]] = page.evaluate("thingc.viewer.links()")
    return found


def spot(page: Any, path: str) -> tuple[float, float]:
    """A point of the window at which the page shows the component of that path."""
    x, y = page.evaluate("""(path) => {
      const { viewer } = thingc, box = viewer.stage.canvas.getBoundingClientRect();
      for (let x = 20; x < box.width - 20; x += 6) for (let y = 20; y < box.height - 20; y += 6) {
        const hit = viewer.hit(box.left + x, box.top + y);
        if (hit !== null && viewer.robot.occurrences[hit.occurrence].path === path) return [box.left + x + 2, box.top + y + 2];
      }
      return null;
    }""", path)
    return x, y
