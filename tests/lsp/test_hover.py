"""Hover text and inlay hints."""

from __future__ import annotations

from pathlib import Path

import pytest

from live.documents import ROBOT, write
from lsp.documents import Documents
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.hover import hover
from thingc.tools.lsp.positions import TextPlace
from thingc.tools.lsp.shown_values import hints

CHANGED = ROBOT.replace("count: 2", "count: 2\n  half: =reach / 2")
WHOLE = {"start": {"line": 0, "character": 0}, "end": {"line": 999, "character": 0}}


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def documents(shared_store: str) -> Documents:
    return Documents(shared_store)


@pytest.fixture(scope="module")
def analysis(robot: Path, documents: Documents) -> Analysis:
    return documents.analysis(robot, CHANGED)


def said(analysis: Analysis, text: str, marked: str) -> str:
    """Return the hover text at `│` in a piece of text that occurs once."""
    found = marked.replace("│", "")
    assert text.count(found) == 1, found
    before = text[: text.index(found) + marked.index("│")]
    answer = hover(analysis, text, TextPlace(line=before.count("\n") + 1, column=len(before) - before.rfind("\n")), {})
    return "" if answer is None else str(answer["contents"]["value"])


@pytest.mark.parametrize(("marked", "words"), [
    ("par│ameters:\n", "Parameters, by name, whose values a variant or a parent assembly can set."),
    ("re│ach: {value", "**reach** = 120 mm; at least `50 mm`"),
    ("half: =re│ach / 2", "`=reach / 2` = **60 mm**\n\n**reach** = 120 mm; at least `50 mm`"),
    ("120│ deg}", "`120 deg` = 2.0944 rad"),
    ("mass: 1 k│g", "The mass, which replaces the mass from the part and its material."),
    ("child: finger_$i.s│eat",
     "**finger_0.seat**: Exported by `finger.yaml`: `bone.seat`.\n\nAt (0, 0, 0) mm, z along +z of `finger_0.bone`."),
    ("=(i + 1) * 5│0 g", "`=(i + 1) * 50 g` = **50 g ... 100 g**"),
    ("ba│se: {frame: true", "**base**: A frame: a component without geometry.\n\nMass 1 kg (stated).\n\nThe base; link `base`."),
    ("fin│ger:\n", "**finger**: `finger.yaml`\n\n2 copies, `finger_0` to `finger_1`.\n\nMass 60 g (stated), 2 parts."),
    ("parent: base.to│p, child", "**base.top**: Added to `base`.\n\nAt (0, 0, 0) mm, z along +z of its component."),
    ("palm.se│at", "**palm.seat**: Exported by `palm.yaml`: `plate.seat`.\n\nAt (0, 0, 0) mm, z along +z of `palm.plate`."),
    ("li│ft: {type", "**lift**: Fixed, from `base.top` to `palm.seat`."),
    ("out: {ya│w_0", "**yaw_0**: Revolute, from `base.top` to `finger_0.seat`; -90 deg to 120 deg.\n\n"
     "Turns about z of the parent mount.\n\nNot driven."),
    ("ou│t: {yaw_0", "**out**: yaw_0 30 deg; all other joints at 0.\n\nModes that start in this pose: `bench`."),
    ("pose: o│ut", "**out**: yaw_0 30 deg; all other joints at 0.\n\nModes that start in this pose: `bench`."),
    ("be│nch: {root", "**bench**: `base` is the root, fixed to the world; starts in pose `out`."),
    ("# a com│ment", ""),
])
def test_hover_text(analysis: Analysis, marked: str, words: str) -> None:
    assert said(analysis, CHANGED + "# a comment", marked) == words


def test_hover_explains_diagnostic_codes(documents: Documents, robot: Path) -> None:
    text = CHANGED.replace("palm: {assembly: palm.yaml}", "palm: {assembly: palm.yaml, allow: {TC519: so}}")
    assert said(documents.analysis(robot, text), text, "TC5│19").startswith("**TC519**: actuator that does not drive a joint\n\nFix: ")


def test_inlay_hints_in_the_requested_range(analysis: Analysis) -> None:
    place = TextPlace(line=1, column=1)
    assert [one["label"] for one in hints(analysis, CHANGED, place, {"range": WHOLE})] == ["= 60 mm", "= 2", "= 50 g ... 100 g", "= 2"]
    first = hints(analysis, CHANGED, place, {"range": {"start": {"line": 5, "character": 0}, "end": {"line": 5, "character": 0}}})
    assert first == [{"position": {"line": 5, "character": 18}, "label": "= 60 mm", "kind": 1, "paddingLeft": True}]


def test_broken_text_keeps_hovers_on_unchanged_lines(robot: Path, shared_store: str) -> None:
    documents = Documents(shared_store)
    documents.analysis(robot, CHANGED)
    broken = CHANGED.replace("reach / 2", "reach / 4").replace("count: =count, as: i}\n    assembly", "count: =count, as: i\n    assembly")
    analysis = documents.analysis(robot, broken)
    assert not analysis.well_formed
    assert said(analysis, broken, "pose: o│ut").startswith("**out**: yaw_0 30 deg")
    labels = [one["label"] for one in hints(analysis, broken, TextPlace(line=1, column=1), {"range": WHOLE})]
    assert labels == ["= 50 g ... 100 g", "= 2"]  # not of the two lines that have changed
