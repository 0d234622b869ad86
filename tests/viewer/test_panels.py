"""Panels of the page: visibility of parts, motions between poses, and the bill of materials."""

from __future__ import annotations

import csv
import json
import math
from base64 import b64encode
from pathlib import Path
from typing import Any

import pytest

from thingc.targets.bom.emit import COLUMNS
from viewer.browser import address, drawn, needed, opened, spot, until
from viewer.conftest import Pages
from viewer.test_browser import picture
from viewer.test_configurations import FOUR_BAR, gap, page_of, q_of
from viewer.test_page import element

pytestmark = [needed, pytest.mark.slow]

VISIBLE = """() => { const { stage, robot } = thingc.viewer, box = stage.canvas.getBoundingClientRect(), found = new Set();
  for (let x = 5; x < box.width; x += 12) for (let y = 5; y < box.height; y += 12) {
    const hit = thingc.viewer.hit(box.left + x, box.top + y);
    if (hit !== null) found.add(robot.occurrences[hit.occurrence].path);
  }
  return [...found]; }"""
"""Return the paths of the components that a click can select."""


def test_parts_are_hidden_isolated_and_made_transparent(browser: Any, pages: Pages) -> None:
    """With keys and with the buttons of the card. A URL restores it."""
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home&theme=light")) as page:
        drawn(page)
        bar, at = page.locator("#visibility"), spot(page, "hand/pen")
        page.mouse.click(*at)
        page.keyboard.press("h")
        assert bar.inner_text().startswith("1 hidden") and "hand/pen" not in page.evaluate(VISIBLE)
        page.keyboard.press("a")
        assert bar.is_hidden() and "hand/pen" in page.evaluate(VISIBLE)
        before = picture(page)
        page.mouse.click(*at)
        page.get_by_role("button", name="Transparent").click()
        page.get_by_role("button", name="Clear the selection").click()
        drawn(page)
        assert bar.inner_text().startswith("1 transparent") and abs(picture(page) - before).max() > 30
        page.mouse.click(*at)
        page.get_by_role("button", name="Isolate").click()
        assert page.evaluate(VISIBLE) == ["hand/pen"]
        page.get_by_role("tab", name="Parts").click()
        assert page.locator("#panel-tree .hidden", has_text="plate").count() > 0
        until(page, "() => location.hash.includes('hidden=') && location.hash.includes('transparent=')")
        fragment = page.evaluate("location.hash")
    with opened(browser, address(pages.arm / "html/arm.html", fragment)) as page:
        assert page.evaluate(VISIBLE) == ["hand/pen"] and "1 transparent" in page.locator("#visibility").inner_text()
        page.get_by_role("button", name="Show all").click()
        assert len(page.evaluate(VISIBLE)) > 5


def test_motion_is_played_between_two_poses(browser: Any, tmp_path: Path) -> None:
    """On a four-bar: the drive is interpolated and the loop stays closed. Space pauses, and a slider ends the motion."""
    with page_of(browser, tmp_path, FOUR_BAR, "#mode=bench") as page:
        page.get_by_label("From pose").select_option("at_20")
        page.get_by_label("To pose").select_option("at_200")
        for part in (0.25, 0.5, 0.75):
            page.get_by_role("slider", name="Position in the motion").fill(str(part))
            assert math.degrees(q_of(page)["drive"]) == pytest.approx(20.0 + 180.0 * part, abs=1e-6) and gap(page) < 1e-3
        page.evaluate("() => { globalThis.seen = []; thingc.viewer.listen(() => { const { pose } = thingc.viewer;"
                      " if (pose !== null && pose.name !== seen.at(-1)) seen.push(pose.name); }); }")
        page.get_by_label("Duration").select_option("1 s")
        page.get_by_label("back and forth").check()
        drawn(page)
        page.locator("#canvas").focus()
        page.keyboard.press(" ")
        until(page, "() => seen.length >= 2")
        assert page.evaluate("seen.slice(0, 2)") == ["at_200", "at_20"] and page.locator("#play").inner_text() == "Pause"
        page.keyboard.press(" ")
        assert page.locator("#play").inner_text() == "Play" and gap(page) < 1e-3
        stopped = q_of(page)
        drawn(page)
        assert q_of(page) == stopped
        page.evaluate("thingc.viewer.setCoordinate('drive', 1.0)")
        assert page.get_by_role("slider", name="Position in the motion").input_value() == "0"


def test_motion_of_the_document_is_played(browser: Any, tmp_path: Path) -> None:
    """On a four-bar, with minimum jerk from rest to rest, and with the loop closed on the way."""
    motions = "motions: {turn: [{pose: at_20, time: 1 s}, {pose: at_200, time: 2 s}, {pose: at_20, time: 4 s}]}\nmodes:\n"
    with page_of(browser, tmp_path, FOUR_BAR.replace("modes:\n", motions), "#mode=bench") as page:
        assert page.get_by_label("Motion", exact=True).input_value() == "turn" and not page.get_by_label("From pose").is_visible()
        slider = page.get_by_role("slider", name="Position in the motion")
        for part in (0.1, 0.25, 0.335, 0.5, 0.9):
            slider.fill(str(part))
            time = 1.0 + 3.0 * float(slider.input_value())
            s = time - 1.0 if time < 2.0 else (4.0 - time) / 2.0
            angle = 20.0 + 180.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
            assert math.degrees(q_of(page)["drive"]) == pytest.approx(angle, abs=1e-6) and gap(page) < 1e-3
        page.get_by_label("Motion", exact=True).select_option("between two poses")
        assert page.get_by_label("From pose").is_visible() and slider.input_value() == "0"


def test_bom_has_totals_and_is_exported(browser: Any, pages: Pages) -> None:
    bom = json.loads(element((pages.arm / "html/arm.html").read_text(), "thingc-robot"))["bom"]
    image = "data:image/svg+xml;base64," + b64encode(b'<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>').decode()
    bom[0] |= {"cost": "10.50 EUR", "total": f"{10.5 * bom[0]['quantity']} EUR", "name": '=1+1, "x"', "image": image}
    bom[1] |= {"cost": "2 EUR", "total": f"{2 * bom[1]['quantity']} EUR", "link": "https://example.com/a"}
    bom[2] |= {"link": "javascript:alert(1)"}
    pieces, mass = sum(row["quantity"] for row in bom), sum(row["quantity"] * row["mass"] for row in bom)
    cost = 10.5 * bom[0]["quantity"] + 2.0 * bom[1]["quantity"]
    with opened(browser, address(pages.arm / "html/arm.html")) as page:
        page.evaluate("(bom) => thingc.viewer.load({ ...thingc.viewer.robot, bom }, thingc.viewer.geometries)", bom)
        page.get_by_role("tab", name="BOM").click()
        assert page.locator("tfoot").inner_text().split() == ["Total", str(pieces), f"{1000.0 * mass:.2f}", "g"]
        text = page.locator("#panel-bom").inner_text()
        assert f"Total cost: {cost:.2f} EUR ({pieces - bom[0]['quantity'] - bom[1]['quantity']} pieces without a cost)" in text
        assert [link.get_attribute("href") for link in page.locator("#panel-bom a").all()] == ["https://example.com/a"]
        assert page.locator("#panel-bom img").evaluate("async (image) => { await image.decode(); return image.naturalWidth; }") == 9
        with page.expect_download() as waiting:
            page.get_by_role("button", name="Export CSV").click()
        assert waiting.value.suggested_filename == "arm_bom.csv"
        rows = list(csv.DictReader(Path(waiting.value.path()).read_text().splitlines()))
    assert tuple(rows[0]) == COLUMNS
    assert rows[0]["name"] == '\'=1+1, "x"' and [row["definition"] for row in rows] == [row["definition"] for row in bom]
    assert [(int(row["quantity"]), float(row["mass"]), row["cost"]) for row in rows] == [
        (row["quantity"], row["mass"], row["cost"] or "") for row in bom
    ]
