"""The study of random designs: some designs, and that the study detects crashes, errors without a rule, and modes that differ."""

from __future__ import annotations

import copy
import dataclasses
import runpy
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

import thingc
from thingc.base.diagnostics import Code, Diagnostic, Note, Severity

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "benchmarks" / "designs"
SEED, NUMBERS = 11, (2, 3)
"""Some of these designs build, and some are refused."""


@pytest.fixture(scope="module", autouse=True)
def on_path():
    sys.path.insert(0, str(FOLDER))
    yield
    sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace for edited documents."""
    from drawing import workspace

    base = tmp_path_factory.mktemp("designs")
    workspace(base)
    return base


def test_designs_depend_only_on_number_and_seed():
    from drawing import design, ranges

    assert design(5, 7) == design(5, 7) and len({str(design(n, s)) for n in range(50) for s in (7, 8)}) == 100
    declared = ranges()
    assert declared == {
        "leg_length": (64, 140), "front_leg": (64, 140), "rear_leg": (64, 140), "body_length": (90, 220), "wall": (2.5, 6),
    }
    for number in range(200):
        one = design(number, 7)
        assert {"leg_length", "body_length", "wall"} <= set(one.parameters) <= set(declared)
        astray = {n for n, text in one.parameters.items() if not declared[n][0] <= float(text.removesuffix(" mm")) <= declared[n][1]}
        assert len(astray) == sum(rule in (("TC803", n) for n in declared) or rule == ("TC315", "leg_length") for rule in one.broken)


def test_edits_fit_the_documents(folder: Path):
    """Each edit alone, and together with the others. `write` raises an error if an edit does not fit."""
    import random

    from drawing import EDITS, Design, write

    edits = [draw(random.Random(3))[0] for draw in EDITS]
    assert len({edit.name for edit in edits}) == len(EDITS)
    for some in (edits, *([edit] for edit in edits)):
        write(Design(number=0, parameters={}, edits=tuple(some), broken=()), folder)
    with pytest.raises(ValueError, match="stands 0 times in leg.yaml"):
        again = Design(number=0, parameters={}, edits=tuple(edit for edit in edits if edit.file == "leg.yaml") * 2, broken=())
        write(again, folder)


@pytest.mark.slow
def test_some_designs_build_or_are_refused_by_a_rule(tmp_path: Path, shared_store: str):
    study = runpy.run_path(str(FOLDER / "study.py"))
    verdicts = study["run"](NUMBERS, SEED, tmp_path, Path(shared_store))
    assert [(v.design.number, v.outcome, v.faults) for v in verdicts if v.faults or v.outcome == "crashed"] == []
    outcomes = {v.outcome for v in verdicts}
    assert outcomes == {"built", "refused"}
    for verdict in verdicts:
        assert (verdict.outcome == "built") == (verdict.modes == 12) == (not study["codes_of"](verdict))
        assert verdict.outcome == "refused" or not verdict.design.broken
    page = study["written"](verdicts, SEED, 12.0)
    assert f"| **all** | {len(NUMBERS)} |" in page and "| crashed | 0 |" in page


def test_different_modes_are_a_fault(folder: Path, shared_store: str):
    import verdicts
    from drawing import Design, write

    design = Design(number=0, parameters={"front_leg": "80 mm"}, edits=(), broken=())
    document = write(design, folder)
    compiled = thingc.compile(str(document), parameters=design.parameters, modes=["crawl", "front_foot", "bridge"], store=shared_store)
    models = {name: mode.model() for name, mode in compiled.modes.items()}
    assert verdicts.compared(models, 0) == []
    for field in ("body_mass", "body_pos", "dof_armature"):
        spoilt = {**models, "bridge": copy.copy(models["bridge"])}
        row = -1 if field.startswith("dof_") else spoilt["bridge"].body("rear/foot").id  # the last body is the anchor of the hold
        getattr(spoilt["bridge"], field)[row] *= 1 + 1e-6
        assert verdicts.compared(spoilt, 0), field


def test_errors_without_a_rule_are_a_fault(folder: Path, shared_store: str):
    import verdicts
    from drawing import Design, Edit, write

    bound = ("TC803", "wall")
    for parameters, broken, edits, outcome, words in (
        ({"wall": "7 mm"}, (bound,), (), "refused", ""),
        ({"wall": "7 mm"}, (), (), "refused", "nothing is out of range: TC803 parameter `wall`"),
        ({"wall": "7 mm"}, (("TC315", "mass"), bound), (), "refused", "TC315 `mass` was not reported"),
        ({"wall": "7 mm"}, (("TC803", "body_length"),), (), "refused", "TC803 `body_length` was not reported"),
        ({}, (), (Edit(name="", file="leg.yaml", old="ankle_servo.bottom", new="ankle_servos.bottom"),), "refused", ""),
    ):
        design = Design(number=0, parameters=parameters, edits=edits, broken=broken)
        verdict = verdicts.judged(design, write(design, folder), Path(shared_store))
        assert verdict.outcome == outcome and (words in verdict.faults[0] if words else verdict.faults == ())
    mute = Diagnostic(code=Code.UNCLOSED, severity=Severity.ERROR, message="")
    assert verdicts.unnamed(Design(number=0, parameters={}, edits=(), broken=()), [mute]) == ["no words or place: TC604 "]
    for code, message, named in (
        (Code.PART_RAISED, "`foot` raised an exception: AssertionError: too short", True),
        (Code.PART_RAISED, "`foot` raised an exception: StdFail_NotDone", False),
        (Code.PART_INVALID, "`foot` is not valid", False),
        (Code.MJCF_REFUSED, "mass and inertia", False),
    ):
        said = replace(mute, code=code, message=message, notes=(Note(message="here"),))
        faults = verdicts.unnamed(dataclasses.replace(design, broken=()), [said])
        assert faults == ([] if named else [f"no rule is named: {code.code} {message}"])


def test_crashed_parts_and_exceptions_are_crashes(tmp_path: Path, shared_store: str):
    import verdicts
    from drawing import Design, workspace, write

    workspace(tmp_path)
    design = Design(number=0, parameters={}, edits=(), broken=())
    document = write(design, tmp_path)
    leg = tmp_path / "parts" / "minchw" / "leg.py"
    text = leg.read_text()
    assert text.count("        self.sole = ") == 1
    leg.write_text(text.replace("        self.sole = ", "        __import__('os').abort()\n        self.sole = "))
    verdict = verdicts.judged(design, document, Path(shared_store))
    assert verdict.outcome == "crashed" and {d.code for d in verdict.diagnostics} == {Code.PART_CRASHED}
    verdict = verdicts.judged(dataclasses.replace(design, parameters=[1]), document, Path(shared_store))
    assert verdict.outcome == "crashed" and "Traceback" in verdict.faults[0]


def test_page_equals_the_output():
    study = runpy.run_path(str(FOLDER / "study.py"))
    page = study["PAGE"].read_text(encoding="utf-8")
    head, _, tables = page.partition("## Outcomes\n")
    count, seed = study["COUNT"], study["SEED"]
    like = study["written"]([], seed, 0.0).partition("## Outcomes\n")[0]
    like = like.replace("generates 0 designs", f"generates {count} designs")
    assert head == like.replace(study["command"](0, seed), study["command"](count, seed))
    assert f"| **all** | {count} |" in tables
    for outcome in ("built, with a fault", "refused, with a fault", "crashed"):
        assert f"| {outcome} | 0 |" in tables
