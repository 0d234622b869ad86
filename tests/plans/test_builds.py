"""Builds by plans are equal to builds by all compiler passes."""

from __future__ import annotations

import builtins
import json
import math
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace

from families.documents import EVERYTHING, INERTIA, TOOL
from thingc.base import numeric
from thingc.base.numeric import Recorded
from thingc.base.pose import make_translation
from thingc.batch.measurements import measure
from thingc.batch.plans import build_templates
from thingc.batch.plans.build_templates import Builds
from thingc.batch.plans.tape import Tape
from thingc.driver.environment import Options
from thingc.driver.session import Session
from thingc.driver.settings import SettingsReader
from thingc.geometry.record import Placed
from thingc.model.resolve import assembly
from thingc.model.resolve.resolver import Settings
from thingc.targets.artifact import MANIFEST
from thingc.targets.registry import TARGETS

PAIR = f"""\
thingc: assembly/1
name: pair
parameters: {{one: 10 g, other: 20 g}}
components:
  base: {{frame: true, mass: 1 kg, {INERTIA}, mounts: {{side: {{xyz: 0 100 0 mm}}}}}}
  one: {{assembly: knob.yaml, parameters: {{mass: =one}}, at: {{in: base.origin}}}}
  other: {{assembly: knob.yaml, parameters: {{mass: =other}}, at: {{in: base.origin}}}}
  arm: {{frame: true, mass: 1 kg, {INERTIA}}}
joints: {{turn: {{type: continuous, parent: base.side, child: arm.origin}}}}
modes: {{standing: {{root: base}}}}
"""

SWING = f"""\
thingc: assembly/1
name: swing
components:
  base: {{link: true, mass: 1 kg, {INERTIA}, shapes: [{{box: 100 100 100 mm}}]}}
  arm: {{link: true, mass: 1 kg, {INERTIA}, shapes: [{{box: 400 20 20 mm}}]}}
joints: {{turn: {{type: revolute, parent: base.origin, child: arm.origin, limit: {{lower: -3 rad, upper: 3 rad}}}}}}
poses: {{home: {{turn: 1 deg}}}}
modes: {{standing: {{root: base, pose: home}}}}
"""

KNOB = "thingc: assembly/1\nname: knob\nparameters: {mass: 1 g}\ncomponents: {knob: {frame: true, mass: =mass}}\n"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("builds")
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    for name, text in {"everything": EVERYTHING, "tool": TOOL, "pair": PAIR, "swing": SWING, "knob": KNOB}.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build_templates, "PATIENCE", 2)


@pytest.fixture(scope="module")
def session(workspace: Path) -> Iterator[Session]:
    with Session(str(workspace / "everything.yaml"), Options()) as session:
        yield session


def made(session: Session, **named: Any) -> Builds:
    assert session.sources is not None
    usual = {"modes": ("standing", "hanging", "loose"), "targets": ("mjcf", "bom"), "verify": 0}
    return Builds(session, SettingsReader(session.sources), **{**usual, **named})


def given(k: int) -> Settings:
    return Settings(
        parameters={"load": f"{100 + 7 * k} g", "length": f"{250 + 3 * k} mm"},
        choices={"joints.lift.limit.upper": f"{70 + k} deg", "joints.lift.limit.velocity": f"{5 + k / 7} rad/s"},
    )


def test_planning_does_not_patch_python(session: Session) -> None:
    def functions() -> tuple[Any, ...]:
        return builtins.min, builtins.max, builtins.sum, math.sin, math.isfinite, math.fsum, numeric.hypot, assembly.substitute

    known, recorded = functions(), []

    def measured(compilation: Any) -> dict[str, Any]:
        assert functions() == known
        recorded.extend(one for body in compilation.robots[0].bodies for one in body.joints if isinstance(one.limit.upper, Recorded))
        return {}

    builds = made(session, measured=measured)
    assert [builds.build_by_plan(given(k)) is not None for k in range(3)] == [False, True, True] and recorded


def test_builds_equal_those_by_passes(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    own = made(
        session, measured=lambda compilation: {"mass": compilation.robots[0].assembly.links[1].properties.mass, "name": "x"},
        targets=tuple(name for name, target in TARGETS.items() if target.numbers_in_text),
    )
    assert own.build_by_plan(given(0)) is None
    assert own.build_by_plan(given(1)) is not None  # the second that no plan is of
    monkeypatch.setattr(Session, "compile", None)
    planned = {k: own.build_by_plan(given(k)) for k in range(2, 8)}
    monkeypatch.undo()
    for k, build in planned.items():
        whole, _ = own.compile_build(given(k))
        assert build is not None and whole is not None
        files = whole.files()
        assert {path for path, content in build.files().items() if content != files[path]} == set() and [*build.files()] == [*files]
        assert (build.results, build.problems, build.losses, build.parts) == (whole.results, whole.problems, whole.losses, whole.parts)
        assert f'"what": "the velocity limit of {5 + k / 7:.6g} rad/s"' in bytes(files[MANIFEST]).decode()  # type: ignore[arg-type]
    masses = [build.results["mass"] for build in planned.values() if build is not None]
    assert len(set(masses)) == 6 and all(type(mass) is float for mass in masses)


def test_robot_file_depends_only_on_its_values() -> None:
    """Numbers on a tape are not sent to the CAD kernel."""
    tape = Tape()
    placed = [Placed(path=name, definition="d", brep="b", pose=make_translation(0.0, 0.0, 1.0), color=None) for name in ("a", "b")]
    kernel = build_templates._Kernel(SimpleNamespace(assemble=lambda name, instances: (name, instances)))
    assert kernel.assemble("whole", placed) == ("whole", placed)
    length = tape.variable(3.0)
    moved = replace(placed[0], pose=replace(placed[0].pose, translation=(0.0, length, 0.0)))
    kernel = build_templates._Kernel(None)
    assert kernel.assemble("whole", [moved, placed[1]])().size == 0 and tape.pinned == [length]


def test_pieces_of_equal_mass_are_one_row(workspace: Path) -> None:
    with Session(str(workspace / "pair.yaml"), Options()) as session:
        own = made(session, modes=())
        for k in range(3):
            build = own.build_by_plan(Settings(parameters={"one": f"{10 + k} g", "other": f"{20 + k} g"}))
        assert build is not None and json.loads(build.files()["bom.json"])[1]["quantity"] == 1  # type: ignore[arg-type]
        alike = Settings(parameters={"one": "15 g", "other": "15 g"})
        assert own.build_by_plan(alike) is None
        build, _ = own.compile_build(alike)
        assert build is not None
        assert [row["quantity"] for row in json.loads(build.files()["bom.json"])] == [1, 2, 1]  # type: ignore[arg-type]


def test_plan_finds_the_farthest_part(workspace: Path) -> None:
    """A thin arm of 400 mm turns in a cube of 100 mm. The test checks the bounding box. At 0, the arm is along y, because mated mounts
    swap x and y."""
    with Session(str(workspace / "swing.yaml"), Options()) as session:
        own = made(session, modes=(), measured=lambda compilation: measure(compilation.robots[0], None, None))
        angles = [2, 5, 30, 60, 88, -10, -80]
        builds = [own.build_by_plan(Settings(choices={"poses.home.turn": f"{angle} deg"})) for angle in angles]
    assert builds[0] is None and all(builds[1:])
    for angle, build in zip(angles[1:], builds[1:], strict=True):
        sine, cosine = abs(math.sin(math.radians(angle))), math.cos(math.radians(angle))
        sides = (max(0.1, 0.4 * sine + 0.02 * cosine), max(0.1, 0.4 * cosine + 0.02 * sine), 0.1)
        assert build is not None and [build.results[f"box.{axis}"] for axis in "xyz"] == pytest.approx(sides, rel=1e-12)


def test_other_settings_use_all_passes(session: Session) -> None:
    own = made(session)
    for k in range(2):
        own.build_by_plan(given(k))
    assert own.build_by_plan(Settings(parameters={"load": "30 kg"}, choices={})) is None
    assert own.build_by_plan(Settings(parameters={**given(3).parameters, "load": "30 kg"}, choices=given(3).choices)) is None
    build, problems = own.compile_build(Settings(parameters={"load": "30 kg"}))
    assert build is None and "must be at most 20 kg" in problems[0].message
    assert made(session, targets=("mjcf", "hag")).build_by_plan(given(0)) is None


def test_plan_with_wrong_files_is_discarded(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    own = made(session, verify=3)
    assert [own.build_by_plan(given(k)) is not None for k in range(4)] == [False, True, True, True]
    monkeypatch.setattr(build_templates._Template, "files", lambda self, numbers, settings: {MANIFEST: b"{}"})
    assert own.build_by_plan(given(4)) is None  # the first after three others: time to look
    (cache,) = own.caches.values()
    assert cache.plans == [] and (cache.failure or "").startswith("a plan gave different files for {'joints.lift.limit.upper': 1.29")
    monkeypatch.undo()
    assert own.build_by_plan(given(5)) is None


def test_plan_is_created_when_it_saves_time(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build_templates, "PATIENCE", 4)
    own = made(session)
    assert [own.build_by_plan(given(k)) is not None for k in range(5)] == [False, False, False, True, True]


def test_infinite_numbers_in_files_are_rejected(session: Session) -> None:
    """One infinite number is enough. A result can be infinite, for example a torque margin."""
    own = made(session, measured=lambda compilation: {"mass": compilation.robots[0].assembly.links[1].properties.mass})
    assert [own.build_by_plan(given(k)) is not None for k in range(2)] == [False, True]
    (cache,) = own.caches.values()
    template, count = cache.plans[0].template, len(cache.plans[0].template.outputs)
    assert count > 10
    built = [template.build([math.inf if k == odd else 1.0 for k in range(count)], given(0)) is not None for odd in range(count)]
    assert built == [False] * (count - 1) + [True]
