"""Rules of many settings are evaluated together, with the verdicts and diagnostics of each setting alone."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

import thingc
from families.documents import WORKSPACE
from thingc.batch.families import evaluation

BOOM = """\
thingc: assembly/1
name: boom
parameters:
  load: {value: 200 g, min: 50 g, max: 1 kg}
  length: {value: 200 mm, min: 0 mm, max: 1 m}
  turns: 3
  slim: false
  share: =length / (turns - 2)
components:
  base: {frame: true, mass: 0.3 kg, inertia: {ixx: 0.0002 kg*m^2, iyy: 0.0003 kg*m^2, izz: 0.0004 kg*m^2}}
  arm:
    frame: true
    mass: =load
    com: [=length / 2, 0, 10 mm]
    inertia: {ixx: 0.0012 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.003 kg*m^2}
joints: {hip: {type: continuous, parent: base.origin, child: arm.origin, axis: [0, -1, 0]}}
"""
RULES = """\
thingc: variants/1
name: booms
assembly: boom.yaml
keep: [load * length < 0.4 kg*m, mass - load < 2 * load, centre.x < 200 mm, "load / length < 8 kg/m", length * length < 0.9 m * 0.9 m]
parameters: {load: [60 g, 70 g]}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in {**WORKSPACE, "boom.yaml": BOOM, "booms.yaml": RULES}.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def drawn(source: random.Random) -> dict[str, Any]:
    """Draw settings. Some are refused, and for some a rule divides by zero."""
    length = 0.0 if source.random() < 0.1 else source.uniform(0.0, 1.05)
    settings: dict[str, Any] = {"load": source.uniform(0.04, 1.02), "length": length}
    if source.random() < 0.1:
        settings["turns"] = source.choice([2.0, 3.0, 4.0])
    if source.random() < 0.1:
        settings["slim"] = True
    if source.random() < 0.1:
        settings["length"] = f"=load * {source.uniform(0.1, 1.0)} m/kg"
    return settings


def expected(settings: dict[str, Any]) -> str | None:
    """Return the first rule that is violated. Every rule can be evaluated for these numbers."""
    load, length = settings["load"], settings["length"]
    centre = load * length / 2 / (0.3 + load)
    holds = {
        "load * length < 0.4 kg*m": load * length < 0.4, "mass - load < 2 * load": 2 * load > 0.3, "centre.x < 200 mm": centre < 0.2,
        "load / length < 8 kg/m": length > 0.0 and load / length < 8, "length * length < 0.9 m * 0.9 m": length * length < 0.9 * 0.9,
    }
    return next((rule for rule, kept in holds.items() if not kept), None)


def test_verdicts_equal_those_of_single_settings(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source, alone = random.Random(3), []
    many = [drawn(source) for _ in range(600)]
    judge = evaluation.Evaluation._find_violation
    monkeypatch.setattr(evaluation.Evaluation, "_find_violation", lambda self, *given: alone.append(given) or judge(self, *given))
    with thingc.family(folder / "booms.yaml", verify=0) as together, thingc.family(folder / "booms.yaml", verify=0) as single:
        found = together.evaluate(many)
        assert 0 < len(alone) < 250  # most verdicts need no evaluation of their own
        for settings, one in zip(many, found, strict=True):
            other = single.evaluate(settings)
            assert (one.broken, one.problems, one.results) == (other.broken, other.problems, other.results), settings
            if one.sound and set(settings) == {"load", "length"} and isinstance(settings["length"], float):
                assert one.broken == expected(settings), settings
        assert len({one.broken for one in found}) == 6 and any(not one.results for one in found)
        assert any(one.results and not one.sound for one in found)  # a rule divided by zero


def test_numbers_equal_those_of_single_settings(folder: Path) -> None:
    source = random.Random(4)
    many = [{**drawn(source), **({"length": float("inf")} if k % 40 == 0 else {})} for k in range(400)]
    with thingc.family(folder / "booms.yaml", verify=0) as family:
        found = family.numbers(many)
        assert found == [family.numbers(settings) for settings in many]
        for settings, numbers in zip(many, found, strict=True):
            length, turns = numbers["length"], settings.get("turns", 3.0)
            assert numbers["load"] == settings["load"] and numbers.get("slim") == (1.0 if settings.get("slim") else None)
            if length <= 1.0 and turns != 2.0:
                assert numbers.get("share", 0.2) == length / (turns - 2)
        assert len({tuple(one) for one in found}) > 4
