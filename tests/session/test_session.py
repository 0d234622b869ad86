"""For any settings in any order, a session gives the same files and diagnostics as separate compilations."""

from __future__ import annotations

import random
import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path

import pytest

from conformance.harness import ROOT
from thingc.base.diagnostics import Code, Diagnostic, Report
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation, UnknownChoice
from thingc.driver.session import Session
from thingc.model.resolve.resolver import Settings
from thingc.targets.artifact import Loss, StoredArtifact

TARGETS = ("mjcf", "mjz", "stl", "bom", "hag")

PARTS = """
    from build123d import Box, Pos, Rot
    from thingc import Length, MountPoint, Thing

    class Block(Thing):
        def __init__(self, width: Length = 30):
            super().__init__(material="oak")
            assert width < 45, f"{width:g} mm is too wide"
            self.body = Box(width, 20, 10)
            self.top = MountPoint(Pos(0, 0, 5))
            self.side = MountPoint(Pos(width / 2, 0, 0) * Rot(0, 90, 0))

        def result(self):
            return self.body
"""

RIG = """
    thingc: assembly/1
    name: rig
    parameters:
      mass: 100 g
      swing: {value: 40 deg, max: 170 deg}
      count: 2
      width: {value: 30 mm, min: 10 mm}
      damping: 0.1 N*m*s/rad
      reach: =width * 2
      turn: 10 deg
      timestep: 2 ms
      stiff: 3 N*m
      inner: 20 g
    materials:
      oak: {density: 700 kg/m^3, friction: {slide: 0.4}}
    defaults: {component: {collision: box}, joint: {dynamics: {damping: =damping}}}
    components:
      base: {part: "blocks:Block", params: {width: =width}}
      post:
        repeat: {count: =count, as: i}
        frame: true
        mass: =mass / (i + 1)
        inertia: {ixx: 1e-4 kg*m^2, iyy: 1e-4 kg*m^2, izz: 1e-4 kg*m^2}
        at: {in: base.top, xyz: [0, "=i * 20 mm", 0]}
      arm: {part: "blocks:Block"}
      left: {assembly: finger.yaml, parameters: {mass: =inner}, attach: {seat: arm.side}}
      right: {assembly: finger.yaml, parameters: {mass: =2 * inner, swing: =swing}}
    joints:
      yaw:
        type: revolute
        parent: base.top
        child: arm.top
        turn: =turn
        limit: {lower: -10 deg, upper: =swing, effort: 2 N*m, velocity: 3 rad/s}
        drive: {kind: position, kp: 20 N*m/rad}
      slide:
        type: prismatic
        parent: base.side
        child: right.seat
        limit: {lower: 0, upper: =reach}
    poses:
      home: {yaw: =swing / 2, "*.finger": 5 deg}
      far: {yaw: 40 deg, slide: 20 mm}
    modes:
      bench: {root: base, pose: home}
      held: {root: arm.side, base: held, at: {rpy: [0, 0, "=turn"]}, gravity: wall}
      free: {root: right, base: free, simulation: {timestep: =timestep / 2}}
    mounts: {tip: left.end}
    simulation: {timestep: =timestep}
    raw:
      mjcf: {geom: {arm: {group: 4}}, joint: {yaw: {armature: 0.5}, left.finger: {margin: 0.01}}}
"""

FINGER = """
    thingc: assembly/1
    name: finger
    parameters: {mass: 10 g, swing: 30 deg}
    components:
      palm:
        frame: true
        mass: 5 g
        inertia: {ixx: 1e-5 kg*m^2, iyy: 1e-5 kg*m^2, izz: 1e-5 kg*m^2}
        mounts: {seat: {}, knuckle: {xyz: 0 0 9 mm}}
      tip:
        frame: true
        mass: =mass
        inertia: {ixx: 1e-5 kg*m^2, iyy: 1e-5 kg*m^2, izz: 1e-5 kg*m^2}
        mounts: {hinge: {}}
    joints:
      finger:
        type: revolute
        parent: palm.knuckle
        child: tip.hinge
        limit: {lower: 0, upper: =swing, effort: 1 N*m}
    mounts: {seat: palm.seat, end: tip.origin}
"""

VALUES = {
    "mass": ("100 g", "0.2 kg", "-1 g", "3 mm", "1e300 kg"),
    "swing": ("40 deg", "20 deg", "0.5 rad", "-20 deg", "200 deg", "=turn * 4"),
    "count": ("2", "1", "3", "0", "2.5"),
    "width": ("30 mm", "40 mm", "50 mm", "5 mm", "three"),
    "damping": ("0.1 N*m*s/rad", "0", "-0 N*m*s/rad", "2 N*m*s/rad"),
    "turn": ("10 deg", "0 deg", "-0 deg", "90 deg"),
    "timestep": ("2 ms", "1 ms", "0"),
    "inner": ("20 g", "10 g", "0", "1e-17 g"),
    "nothing": ("1",),
}
"""Values for each parameter of the rig: valid values, and values that fail in each compiler pass."""


def outcome(
    environment: Environment, compilation: Compilation, targets: Sequence[str],
) -> tuple[list[Diagnostic], dict[str, object], list[Loss], dict[str, object]]:
    """Return all results of a compilation: diagnostics, files, losses, and the decisions about parts."""
    files: dict[str, object] = {}
    losses: list[Loss] = []
    if not compilation.report.failed:
        emitted = pipeline.emit if compilation.repeated else pipeline.build
        for artifacts in emitted(environment, compilation, targets).values():
            losses += artifacts.losses
            files |= {
                path: environment.store.read(content.sha256) if isinstance(content, StoredArtifact) else content
                for path, content in artifacts.files.items()
            }
    decisions: dict[str, object] = {text: decision.reused for text, decision in compilation.decisions.items()}
    return compilation.report.diagnostics, files, losses, decisions


def by_itself(document: Path, store: str, settings: Settings, targets: Sequence[str]) -> tuple[object, ...]:
    """Return the results of a compilation that shares nothing with another one."""
    with Environment(str(document), Options(store=store, parameters=settings.parameters, choices=settings.choices)) as environment:
        compilation = pipeline.compile(environment)
        return outcome(environment, compilation, targets)


def check(document: Path, store: str, many: Sequence[Settings], targets: Sequence[str] = TARGETS) -> int:
    """Compile all settings in one session, then each of them separately. Return the number of settings without errors."""
    sound = 0
    with Session(str(document), Options(store=store)) as session:
        for settings in many:
            found = outcome(session.environment, session.compile(settings), targets)
            alone = by_itself(document, store, settings, targets)
            # Where the floor is and what lies in what is looked at by single builds alone (see `pipeline.recompile`): thousands of
            # variants would be wrong alike.
            assert found[0] == [one for one in alone[0] if one.code not in (Code.START_BELOW, Code.OVERLAP)], settings
            assert found[1].keys() == alone[1].keys(), settings  # type: ignore[attr-defined]
            for path, content in found[1].items():
                assert content == alone[1][path], (settings, path)  # type: ignore[index]
            assert found[2] == alone[2], settings
            assert found[3].keys() == alone[3].keys(), settings  # type: ignore[attr-defined]
            sound += bool(found[1])
    return sound


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A workspace with a robot whose parameters affect every section of its document."""
    tmp_path.joinpath("thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')
    tmp_path.joinpath("parts").mkdir()
    for name, text in {"parts/blocks.py": PARTS, "rig.yaml": RIG, "finger.yaml": FINGER}.items():
        tmp_path.joinpath(name).write_text(textwrap.dedent(text))
    return tmp_path / "rig.yaml"


def test_random_parameters_of_a_whole_document(rig: Path, shared_store: str) -> None:
    """The parameters are random, valid and invalid, so that each variant can follow any other one."""
    choose = random.Random(5)
    many = [Settings()]
    for _ in range(25):
        names = choose.sample(sorted(VALUES), choose.choice((1, 1, 2, 3)))
        many.append(Settings(parameters={
            name: VALUES[name][0 if choose.random() < 0.3 else choose.randrange(len(VALUES[name]))] for name in names
        }))
    sound = check(rig, shared_store, many)
    assert 6 < sound < 23, "the sweep has good and bad variants"


def test_each_value_after_each_other_value(rig: Path, shared_store: str) -> None:
    """One parameter at a time takes all of its values and returns to the first one. Cached results of earlier values must have no
    effect."""
    for name in ("swing", "width", "turn", "inner"):
        texts = VALUES[name]
        assert check(rig, shared_store, [Settings(parameters={name: text}) for text in (*texts, *reversed(texts))], ("mjcf",))


def test_arm(shared_store: str) -> None:
    many = [
        Settings(parameters=parameters) for parameters in (
            {}, {"pen_diameter": "10 mm"}, {"reach": "120 mm"}, {"reach": "60 mm", "brace_thickness": "5 mm"}, {"reach": "20 mm"},
            {"reach": "120 mm", "pen_diameter": "10 mm"}, {"pen": "10 mm"}, {},
        )
    ]
    assert check(ROOT / "assemblies" / "arm.yaml", shared_store, many) == 6


def test_minchw(shared_store: str) -> None:
    """Loops are closed again for each setting. Both legs of the robot are instances of one document with different parameters."""
    many = [
        Settings(parameters=parameters) for parameters in (
            {}, {"leg_length": "80 mm"}, {"rear_leg": "80 mm"}, {"leg_length": "10 mm"}, {},
        )
    ]
    assert check(ROOT / "assemblies" / "minchw" / "minchw.yaml", shared_store, many, ("mjcf", "bom", "hag")) == 4


def test_errors_in_documents_are_reported_by_every_compilation(rig: Path, shared_store: str) -> None:
    rig.write_text(rig.read_text().replace("swing: {value: 40 deg, max: 170 deg}", "swing: {value: 40 deg, mix: 170 deg}"))
    with Session(str(rig), Options(store=shared_store)) as session:
        assert [d.code.code for d in session.report.diagnostics] == ["TC201"]
    assert check(rig, shared_store, [Settings(), Settings(parameters={"mass": "3 mm"}), Settings()]) == 0


def test_missing_document(tmp_path: Path, shared_store: str) -> None:
    assert check(tmp_path / "nothing.yaml", shared_store, [Settings(), Settings()]) == 0


def test_documents_are_resolved_before_parts_are_built(rig: Path, tmp_path: Path) -> None:
    """`pipeline.model` runs with any settings and an empty store."""
    with Session(str(rig), Options(store=str(tmp_path / "store"), jobs=1)) as session:
        assert session.sources is not None
        for width, message in (("40 mm", None), ("5 mm", "parameter `width` must be at least 10 mm, found `5 mm`"), ("40 mm", None)):
            report = Report()
            model = pipeline.model(session.environment, session.sources, Settings(parameters={"width": width}), report)
            assert [one.message for one in report.diagnostics] == ([] if message is None else [message])
            assert message is not None or model is not None and "blocks:Block(width=0.04)" in {
                one.text for one in model.part_definitions()
            }
        assert session.environment.geometry.decisions == {}


def test_each_compilation_chooses_modes(rig: Path, shared_store: str) -> None:
    with Session(str(rig), Options(store=shared_store, parameters={"mass": "300 g"})) as session:
        one = session.compile(Settings(), ["held"])
        other = session.compile(Settings(parameters={"mass": "200 g"}))
        assert [robot.mode.name for robot in one.robots] == ["held"]
        assert [robot.mode.name for robot in other.robots] == ["bench", "held", "free"]
        assert one.assembly is not None and other.assembly is not None
        assert one.assembly.properties.mass - other.assembly.properties.mass == pytest.approx(0.15), "the options' own hold first"
        with pytest.raises(UnknownChoice):
            session.compile(Settings(), ["flying"])


def test_variant_without_new_geometry_builds_no_part(rig: Path, shared_store: str) -> None:
    with Session(str(rig), Options(store=shared_store)) as session:
        session.compile(Settings())
        for text in ("110 g", "120 g"):
            assert session.compile(Settings(parameters={"mass": text})).modelled == []
        wide = session.compile(Settings(parameters={"width": "31.25 mm"}))
        again = session.compile(Settings(parameters={"width": "31.25 mm"}))
        assert wide.modelled == ["blocks:Block(width=0.03125)"] and again.modelled == []
        assert wide.modelled == ["blocks:Block(width=0.03125)"], "what was said of one compilation stays"


def test_session_reads_documents_once(rig: Path, shared_store: str, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    with Session(str(rig), Options(store=shared_store)) as session:
        first = outcome(session.environment, session.compile(Settings()), TARGETS)
        shutil.copytree(rig.parent, copy, ignore=shutil.ignore_patterns("copy"))
        rig.write_text("thingc: assembly/1\nname: other\n")
        assert outcome(session.environment, session.compile(Settings()), TARGETS)[1] == first[1]


def test_chosen_documents_determine_the_suppressed_warnings(tmp_path: Path, shared_store: str) -> None:
    tool = "thingc: assembly/1\nname: tool\ncomponents: {tip: {frame: true}}\nallow: {TC522: %s}\n"
    robot = "thingc: assembly/1\nname: robot\ncomponents: {base: {frame: true}, tool: {assembly: one.yaml, at: {in: base.origin}}}\n"
    documents = {"one.yaml": tool % "one", "two.yaml": tool % "two", "robot.yaml": robot}
    for name, text in {"thingc.toml": 'thingc = "workspace/1"\n', **documents}.items():
        (tmp_path / name).write_text(text)
    with Environment(str(tmp_path / "robot.yaml"), Options(store=shared_store)) as environment:
        sources = pipeline.read(environment)
        assert sources is not None
        for choices, expected in (({}, {"one"}), ({"components.tool.assembly": "two.yaml"}, {"one", "two"})):
            report = Report()
            pipeline.choose(environment, sources, choices, report, None)
            assert {allowance.reason for allowance in report.allowances} == expected
