"""For refused settings, plans report the same diagnostics as a compilation, with all texts, for several causes and robots."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import thingc
from families.documents import EVERYTHING, INERTIA, TOOL
from thingc.base.diagnostics import Code, Diagnostic, Note, Severity
from thingc.base.suggestions import Suggestion
from thingc.batch.families import NoModel
from thingc.batch.job import Job
from thingc.batch.plans.part_exchange import TracedParts
from thingc.batch.plans.refusals import DiagnosticsTemplate
from thingc.batch.plans.tape import Tape
from thingc.batch.plans.trace_compilation import NotTraceable, TraceResult
from thingc.batch.runner import Runner
from thingc.batch.variant import Variant
from thingc.driver import pipeline
from thingc.model.resolve.resolver import Settings

ROOT = Path(__file__).parents[2]
BOOM = re.findall("```yaml\n(.*?)```", (ROOT / "docs/learning.md").read_text(), re.DOTALL)[0]
BRIM = "\n".join([
    "thingc: assembly/1", "name: brim", "parameters: {wide: 100 mm, deep: {value: 60 mm, max: =wide}}", "components:",
    "  base: {part: box:Box, params: {length: =wide, width: =deep}, mass: 1 kg}",
    f"  weight: {{frame: true, mass: =1 kg * wide / deep, {INERTIA}}}",
    "joints: {turn: {type: revolute, parent: base.origin, child: weight.origin, limit: {lower: 0 deg, upper: =1 rad * deep / wide}}}",
    "poses: {home: {turn: 30 deg}}", "modes: {standing: {root: base, pose: home}}",
])
BOX = """\
from build123d import Box as Solid

from thingc import Length, Thing


class Box(Thing):
    def __init__(self, length: Length = 100, width: Length = 60):
        self.length, self.width = length, width
        assert length < 300

    def result(self):
        return Solid(self.length, self.width, 10)
"""

Draw = Callable[[random.Random], dict[str, Any]]


def boom(source: random.Random) -> dict[str, Any]:
    return {"length": source.uniform(0.05, 1.2), "load": source.choice([0.3, 0.6, 22.0, -0.2]) * source.uniform(0.8, 1.1)}


def limits(source: random.Random) -> dict[str, Any]:
    return {
        "joints.lift.limit.upper": source.uniform(-2.5, 1.5), "components.arm.inertia.ixx": source.uniform(0.0001, 0.02),
        "length": source.uniform(0.3, 1.0),
    }


def linkage(source: random.Random) -> dict[str, Any]:
    """Draw settings of a linkage. The rods of its loop can be too short, and a pose can be outside a limit."""
    return {
        "components.crank.mounts.pin.xyz.0": 0.1 * source.uniform(0.8, 1.2),
        "components.coupler.mounts.pin.xyz.0": source.choice([0.4, 0.15]) * source.uniform(0.95, 1.05),
        "poses.level.lift": source.uniform(0.9, 1.7),
    }


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("refusals")
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')
    (folder / "parts").mkdir()
    (folder / "parts" / "box.py").write_text(BOX)
    for name, text in {"boom": BOOM, "everything": EVERYTHING, "tool": TOOL, "brim": BRIM}.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder


def compiled(family: thingc.RobotFamily, one: dict[str, Any]) -> tuple[Diagnostic, ...]:
    """Return the diagnostics of a compilation, or nothing if it succeeds."""
    report = family._session.compile(family._reader.settings(family._reader.read(one)), (family.mode,)).report
    return tuple(report.sorted_diagnostics()) if report.failed else ()


@pytest.mark.parametrize(("name", "draw", "count", "causes", "codes"), [
    ("boom", boom, 120, 5, {"TC803"}), ("boom", limits, 120, 5, {"TC803", "TC506", "TC324", "TC601"}),
    ("everything", linkage, 9, 1, {"TC604", "TC809"}),
])
def test_diagnostics_equal_those_of_a_compilation(
    workspace: Path, name: str, draw: Draw, count: int, causes: int, codes: set[str],
) -> None:
    source = random.Random(11)
    many = [draw(source) for _ in range(count)]
    with thingc.family(workspace / f"{name}.yaml", verify=0) as family, thingc.family(workspace / f"{name}.yaml") as other:
        expected = [compiled(other, one) for one in many]
        refusals = family._refusals_of(family.mode)
        for one, problems in zip(many, expected, strict=True):
            found = family.evaluate(one)
            assert found.problems == problems if problems else found.results, one
        served = [problems for one, problems in zip(many, expected, strict=True) if refusals.problems(family._reader.read(one)) is not None]
        assert len(served) > 0.7 * sum(map(bool, expected)) and all(served)
        assert len(set(served)) > len(served) / 2 and len({tuple(p.code for p in one) for one in served}) >= min(causes, len(codes))
        assert len(refusals.causes) >= causes and codes <= {problem.code.code for one in expected for problem in one}
        models = list(family.models(many))
        assert [one.problems if isinstance(one, NoModel) else () for one in models] == expected


def test_known_cause_is_not_compiled_again(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with thingc.family(workspace / "boom.yaml", verify=0) as family:
        family.evaluate([{"length": 0.9 + k / 10} for k in range(1, 5)])
        monkeypatch.setattr(pipeline, "recompile", None)
        found = [family.evaluate({"length": 0.95}), family.model({"length": 1.25})]
        messages = [f"parameter `length` must be at most 900 mm, found `{size} mm`" for size in (950, 1250)]
        assert [one.problems[0].message for one in found] == messages
        with pytest.raises(TypeError):
            family.evaluate({"length": math.inf})  # which a text of the command line cannot be


def test_batch_rows_equal_those_of_a_compilation(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If a choice has a unit, its diagnostics quote it, so plans do not report them."""
    job = Job(
        assembly=str(workspace / "boom.yaml"), folder=None, store=None, part_timeout=None, modes=(), results_mode="standing", pose=None,
        reach=None, rules=(), dimensions={}, emit=("mjcf",), verify=0,
    )

    def task(size: int, **choices: str) -> Variant:
        return Variant(index=size, id=str(size), name=str(size), parameters={"length": f"{size} mm"}, choices=choices, values={})

    with Runner(job) as runner, Runner(job) as other:
        for size in range(910, 950, 10):
            runner.build(task(size))
        monkeypatch.setattr(runner.session, "compile", None)
        assert runner._build_variant(task(1234)) == other._build_by_passes(task(1234))
        assert runner._build_variant(task(1234))["code"] == "TC803"
        with pytest.raises(TypeError):
            runner._build_variant(task(1235, **{"joints.lift.limit.upper": "80 deg"}))
        assert runner.builds is not None
        settings = Settings(parameters={"length": "1240 mm"})
        monkeypatch.undo()
        assert runner.builds.build(settings) == ({}, other.builds.compile_build(settings)[1])  # type: ignore[union-attr]


def test_wrong_plan_is_discarded(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with thingc.family(workspace / "boom.yaml") as family:
        family.evaluate([{"length": 0.9 + k / 10} for k in range(1, 5)])
        refusals = family._refusals_of(family.mode)
        (cache,) = refusals.causes.values()
        assert cache.plans
        monkeypatch.setattr(cache.plans[0].template, "diagnostics", lambda outputs: ())
        assert family.evaluate({"length": 0.95}).problems == compiled(family, {"length": 0.95})
        assert not cache.plans and "different diagnostics" in str(cache.failure)


def test_numbers_that_parts_depend_on(workspace: Path) -> None:
    with thingc.family(workspace / "brim.yaml", verify=0) as family, thingc.family(workspace / "brim.yaml") as other:
        many = [{"wide": 0.1 + k / 1000, "deep": deep} for k in range(6) for deep in (0.04, 0.0995 + k / 1000, 0.2)]
        expected = [compiled(other, one) for one in many]
        assert [family.evaluate(one).problems for one in many] == expected and sum(map(bool, expected)) >= 12
        assert any(cache.plans for cache in family._refusals_of(family.mode).causes.values())


def test_failing_part_is_not_traced(workspace: Path) -> None:
    with thingc.family(workspace / "brim.yaml", verify=0) as family:
        found = [family.evaluate({"wide": 0.5 + k / 10, "deep": 0.09}) for k in range(5)]
        assert all("TC401" in {problem.code.code for problem in one.problems} for one in found)
        assert not family._refusals_of(family.mode).causes


def template(tape: Tape, *diagnostics: Diagnostic, parts: TracedParts | None = None) -> DiagnosticsTemplate:
    return DiagnosticsTemplate(TraceResult(result=(diagnostics, 0), tape=tape, names=("a",), parts=parts))


def test_every_text_of_a_diagnostic_has_slots() -> None:
    tape = Tape()
    tape.reporting = True
    number = tape.variable(0.5)
    made = template(tape, Diagnostic(
        code=Code.OUT_OF_RANGE, severity=Severity.ERROR, message=f"`{number:.2f}` and `{number * 2:.3g} m`", path=f"--set a={number}",
        help=f"write {number:g}", notes=(Note(message="here"), Note(message=f"`{number:z.1f}`")),
    ))
    (filled,) = made.diagnostics([0.25, 0.75, 0.125, 4.0, -0.04])
    assert (filled.message, filled.path, filled.help) == ("`0.25` and `0.75 m`", "--set a=0.125", "write 4")
    assert [note.message for note in filled.notes] == ["here", "`0.0`"]


def test_diagnostics_that_become_equal_are_reported_once() -> None:
    tape = Tape()
    tape.reporting = True
    both = [Diagnostic(code=Code.LIMIT, severity=Severity.ERROR, message=f"{tape.variable(v):.1f}") for v in (0.5, 0.7)]
    made = template(tape, *both)
    assert [one.message for one in made.diagnostics([0.51, 0.72])] == ["0.5", "0.7"]
    assert [one.message for one in made.diagnostics([0.51, 0.52])] == ["0.5"]


@pytest.mark.parametrize("message", [
    lambda number: f"it is {number!r}", lambda number: f"`{'x' * 100}{number:.3f}{'x' * 100}`",
    lambda number: Suggestion(f"it is {number:.3f}", fix=("a", f"{number:.3f}")),
])
def test_other_texts_with_numbers_are_compiled(message: Callable[[Any], str]) -> None:
    tape = Tape()
    tape.reporting = True
    from thingc.base.diagnostics import Report
    from thingc.base.source import line_of

    report = Report()
    report.add(Code.LIMIT, message(tape.variable(0.375)), line_of("a.yaml"))
    with pytest.raises(NotTraceable):
        template(tape, *report.diagnostics)
