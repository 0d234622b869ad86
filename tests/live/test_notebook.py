"""`Compiled.show()` embeds the page in a notebook."""

from __future__ import annotations

import html
import re
from pathlib import Path

import thingc
from live.documents import write


def test_show_embeds_the_page_in_an_iframe(tmp_path: Path, shared_store: str) -> None:
    write(tmp_path)
    robot = thingc.compile(str(tmp_path / "robot.yaml"), store=shared_store)
    frame = robot.show(height=321)._repr_html_()
    match = re.fullmatch(r'<iframe srcdoc="([^"]*)" sandbox="allow-scripts allow-downloads" style="([^"]*)" title="robot"></iframe>', frame)
    assert match is not None and "height: 321px" in match[2] and "allow-same-origin" not in frame
    page = html.unescape(match[1])
    assert page.startswith("<!doctype html>") and '"name":"robot"' in page and "thingc-live\" content" not in page
    thingc_build = tmp_path / "build/robot/html/robot.html"
    assert not thingc_build.exists(), "nothing is written"
