"""Accessibility of the page: rules of axe-core, contrast of all texts, keyboard access to all controls; in light, dark and 400 px wide."""

from __future__ import annotations

from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe

from viewer.browser import address, drawn, needed, opened
from viewer.conftest import Pages

pytestmark = [needed, pytest.mark.slow]

LOOKS = {"wide": ((1200, 800), ("light", "dark")), "narrow": ((400, 800), ("light",))}
"""The size of the window, and the themes."""

TABS = ("Joints", "Parts", "BOM", "Display", "Measure")

EVERYTHING = """() => { const { viewer } = thingc;
  viewer.setOptions({ colouring: "torque margin" }); viewer.toggle("names"); viewer.choose([2]); viewer.showMessage("a message"); }"""
"""Show everything that can be drawn over the 3D view."""

CONTRASTS = """() => {
  const parsed = (text) => { const own = /rgba?\\(([^)]*)\\)/.exec(text)[1].split(/[ ,/]+/).map(Number);
    return [...own.slice(0, 3), own[3] ?? 1]; };
  const over = (top, below) => [0, 1, 2].map((k) => top[3] * top[k] + (1 - top[3]) * below[k]);
  const light = (color) => color.slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, k) => sum + [0.2126, 0.7152, 0.0722][k] * c, 0);
  const contrast = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
  // what may lie below an element: of a picture, anything that a robot may be coloured
  const grounds = (node) => {
    if (node === null) return [[255, 255, 255]];
    const { backgroundColor, backgroundImage } = getComputedStyle(node), own = parsed(backgroundColor);
    if (own[3] === 1 && backgroundImage === "none") return [own];
    if (node.id === "labels" || node.id === "view")
      return [...backgroundImage.matchAll(/rgba?\\([^)]*\\)/g)].map(([one]) => parsed(one)).concat([[0, 0, 0], [255, 255, 255]]);
    return grounds(node.parentElement).map((below) => over(own, below));
  };
  const poor = [], seen = new Set();
  for (const node of document.body.querySelectorAll("*")) {
    const words = node.matches("input") ? node.value
      : [...node.childNodes].filter((child) => child.nodeType === 3).map((child) => child.data).join("").trim();
    if (words === "" || node.matches("script, noscript") || !node.checkVisibility() || node.matches(":disabled")) continue;
    const color = parsed(getComputedStyle(node).color);
    for (const ground of grounds(node)) {
      const found = contrast(over(color, ground), ground);
      seen.add(`${color} on ${ground}`);
      if (found >= 4.5) continue;
      poor.push(`${words.slice(0, 30)} (${node.tagName} ${node.className}): ${found.toFixed(2)}, ${color} on ${ground.map(Math.round)}`);
    }
  }
  return [poor, seen.size];
}"""
"""Return the texts whose contrast with any possible background is below 4.5 (WCAG 2.2, 1.4.3), and the number of colour pairs."""

FOCUS = """() => { const node = document.activeElement, { outlineStyle, outlineWidth, outlineColor } = getComputedStyle(node);
  const all = [...document.querySelectorAll("button, input, select, a[href], canvas, [tabindex]")];
  const box = node.getBoundingClientRect(), at = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  return { number: all.indexOf(node), name: node.getAttribute("aria-label") ?? node.textContent ?? "",
    shown: at !== null && (node.contains(at) || at.contains(node)),
    ring: outlineStyle !== "none" && parseFloat(outlineWidth) >= 2 && outlineColor !== "rgba(0, 0, 0, 0)" }; }"""

EXPECTED = """() => { const all = [...document.querySelectorAll("button, input, select, a[href], canvas, [tabindex]")];
  return all.flatMap((node, number) => (node.tabIndex >= 0 && node.checkVisibility() && !node.disabled ? [number] : [])); }"""


RINGS = f"""() => {{ const all = [...document.querySelectorAll("button, input, select, a[href], canvas, [tabindex]")];
  return ({EXPECTED})().map((number) => all[number]).filter((node) => {{ node.focus(); return !({FOCUS})().ring; }})
    .map((node) => `no ring: ${{node.outerHTML.slice(0, 120)}}`); }}"""


@pytest.mark.parametrize("look", LOOKS)
def test_page_is_accessible(browser: Any, pages: Pages, look: str) -> None:
    """No serious violation of axe-core, no text with low contrast, and Tab reaches every control, which then shows its focus. Only
    colours depend on the theme."""
    size, themes = LOOKS[look]
    axe, poor, pairs = Axe(), [], 0
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home&theme=light"), size) as page:
        for theme in themes:
            page.evaluate(f"thingc.viewer.setOptions({{ theme: '{theme}' }})")
            for tab in TABS:
                page.get_by_role("tab", name=tab).click()
                page.evaluate(EVERYTHING)
                drawn(page)
                pale, seen = page.evaluate(CONTRASTS)
                poor += [*pale, *(broken(axe, page, tab) + keyed(page, tab) if theme == "light" else ringless(page))]
                pairs += seen
            page.get_by_role("button", name="Mouse and keyboard shortcuts").click()
            poor += page.evaluate(CONTRASTS)[0]
            page.keyboard.press("Escape")
    assert poor == [] and pairs > 30 * len(themes)


def broken(axe: Axe, page: Any, tab: str) -> list[str]:
    """Return the serious violations of axe-core rules."""
    options = {"resultTypes": ["violations"], "rules": {"color-contrast": {"enabled": False}}}  # `CONTRASTS` checks more texts
    found = axe.run(page, options=options).response["violations"]
    return [f"{tab}: {one['id']}: {one['nodes'][0]['html']}" for one in found if one["impact"] in ("serious", "critical")]


def ringless(page: Any) -> list[str]:
    """Return the controls without a visible focus indicator."""
    page.keyboard.press("Tab")  # after a click, nothing shows it
    found: list[str] = page.evaluate(RINGS)
    return found


def keyed(page: Any, tab: str) -> list[str]:
    """Return the controls that Tab does not reach from the top of the page, and those without a visible focus indicator."""
    page.evaluate("document.activeElement.blur()")
    page.evaluate("getSelection().collapse(document.body, 0)")
    wanted, met, faults = set(page.evaluate(EXPECTED)), set(), []
    for _ in range(2 * len(wanted) + 4):
        page.keyboard.press("Tab")
        found = page.evaluate(FOCUS)
        if found["number"] in met:
            break
        met.add(found["number"])
        if found["number"] >= 0 and not (found["ring"] and found["shown"]):
            faults.append(f"{tab}: {found}")
    return faults + [f"{tab}: not reached: {page.evaluate(NAMED, number)}" for number in sorted(wanted - met)]


NAMED = """(number) =>
  [...document.querySelectorAll("button, input, select, a[href], canvas, [tabindex]")][number].outerHTML.slice(0, 120)"""
