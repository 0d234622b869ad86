"""MJCF for other readers (`--compat`): unsupported features are reported, and features with an equivalent form are rewritten.

The gaps of the readers are listed here again from their sources; `make conformance` runs the readers themselves. MuJoCo decides which
geoms may touch: with a margin larger than the robot, it reports a contact for every pair it considers."""

from __future__ import annotations

import itertools
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from emit.test_sdf import EVERY
from mjcf.handmade import Made, Piece, Segment, at, box_part, cylinder_part, drive, matrix, raw
from thingc.base.diagnostics import Code
from thingc.documents.workspace import CONSUMERS as NAMES
from thingc.geometry.store.local import Store
from thingc.model.resolve.coordinates import Dynamics, Limit
from thingc.model.resolve.types import Overrides
from thingc.targets.artifact import Loss
from thingc.targets.mjcf import body_tree as tree, emit
from thingc.targets.mjcf.accepted_models import choose_geometry
from thingc.targets.mjcf.compat import CONSUMERS
from thingc.targets.mjcf.compat.contact_pairs import pairs
from thingc.targets.mjcf.compat.mjx import SIDES, UNSUPPORTED_PAIRS, prism
from thingc.targets.request import EmitRequest
from thingc.tools.cli.main import main


@pytest.fixture
def store(tmp_path: object) -> Store:
    return Store(f"{tmp_path}/store")


def robot(store: Store, *shapes: str, **said: object) -> Made:
    """A chain of links of 60 x 40 x 20 mm, or of cylinders, stacked and hinged about x, with drives and a pose."""
    segments = []
    for number, shape in enumerate(shapes):
        part = box_part(store, (-0.03, -0.02, -0.01), (0.03, 0.02, 0.01)) if shape != "cylinder" else cylinder_part(store, 0.02, 0.02)
        piece = Piece(f"arm/part_{number}", part, overrides=Overrides(collision=shape))  # type: ignore[arg-type]
        below = {"parent": number - 1, "joint": f"arm/turn_{number}", "axis": (1.0, 0.0, 0.0), "actuator": drive(kp=2.0, effort=1.0)}
        place = matrix((0.0, 0.0, 0.01 if not number else 0.03))
        segments.append(Segment(
            f"arm/link_{number}", [piece], pose=place, limit=Limit(lower=-1.0, upper=1.0), dynamics=Dynamics(friction=0.1, armature=0.01),
            **(below if number else {}),
        ))
    turns = {f"arm/turn_{number}": 0.1 * number for number in range(1, len(shapes))}
    return Made(segments, keyframes=(("rest", turns),), **said)  # type: ignore[arg-type]


def emit_models(made: Made, store: Store, compat: Sequence[str], *modes: tuple[str, str]) -> tuple[EmitRequest, emit.Models]:
    request = replace(made.request(store, *modes or (("bench", "fixed"),)), compat=tuple(compat))
    return request, emit.models(request)


def load_scene(request: EmitRequest, models: emit.Models, number: int = 0) -> mujoco.MjModel:
    """The scene of a mode, loaded by MuJoCo."""
    one = models.candidates[number]
    assets = {file: request.store.read(stored.sha256) for file, stored in models.assets.items()}
    return mujoco.MjModel.from_xml_string(one.scene.text, {**assets, one.file: one.model.text.encode()})


def lost(models: emit.Models) -> list[tuple[str, str, str]]:
    return [(one.path, one.what, one.how) for one in models.losses]


def test_documented_consumers_match_the_code(root: Path) -> None:
    """The documentation lists the same consumers as `CONSUMERS`, with the versions that were examined."""
    assert tuple(one.name for one in CONSUMERS) == NAMES
    rows = (root / "docs" / "outputs" / "mjcf.md").read_text().partition("<!-- compat -->\n")[2].partition("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("|").split(" | ")][:3] for row in rows]
    assert cells == [[f"`{one.name}`", one.label, one.version] for one in CONSUMERS]


def test_mjx_collision_gaps_match_its_source() -> None:
    """Supported pairs are those of `_COLLISION_FUNC` in mujoco-mjx 3.17.0, for the kinds of shapes that thingc writes."""
    there = """plane sphere, plane capsule, plane box, plane cylinder, plane mesh, sphere sphere, sphere capsule, sphere cylinder,
        sphere box, sphere mesh, capsule capsule, capsule box, capsule cylinder, capsule mesh,
        cylinder cylinder, box box, box mesh, mesh mesh"""
    known = {frozenset(pair.split()) for pair in there.split(",")}
    kinds = ("plane", "sphere", "capsule", "cylinder", "box", "mesh")
    every = {frozenset(pair) for pair in itertools.combinations_with_replacement(kinds, 2)} - {frozenset(["plane"])}
    assert every - known == {one for one in UNSUPPORTED_PAIRS if "ellipsoid" not in one}


@pytest.mark.parametrize("base", ["fixed", "free", "held"])
def test_candidate_pairs_match_mujoco(store: Store, base: str) -> None:
    """Pairs of geoms that may touch equal the contacts of MuJoCo with a margin of 10 m."""
    made = robot(store, "box", "cylinder", "box", "cylinder", "box", excluded=((1, 3),))
    stuck = Piece("arm/stuck", box_part(store, (0.04, 0, 0), (0.05, 0.01, 0.01)))
    made.segments.append(Segment("arm/stuck", [stuck], parent=2))  # without a joint: one with its parent
    request, models = emit_models(made, store, (), ("bench", base))
    ours = {
        frozenset(geom.element.get("name") if geom.element is not None else "floor" for geom in pair)
        for pair in pairs(tree.model(request.robots[0], choose_geometry(request.assembly, request.report)[0]))
    }
    model = load_scene(request, models)
    model.geom_margin[:] = 10.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    theirs = {frozenset(model.geom(int(geom)).name for geom in contact.geom) for contact in data.contact}
    assert theirs
    held = {frozenset(("floor", "arm/part_0:collision"))} if base == "held" else set()  # MuJoCo sees that neither moves, MJX does not
    assert ours == theirs | held


def test_mjx_replaces_cylinders_by_prisms(store: Store) -> None:
    """A cylinder that may touch a box, a mesh or another prism becomes a prism. One that touches only the floor, cylinders and its
    neighbours is kept."""
    what = f"the cylinder: a prism of {SIDES} sides in contacts of MJX"
    for shapes, prisms in (
        (("box", "box", "cylinder"), [2]), (("box", "cylinder", "box", "cylinder"), [1, 3]), (("box", "cylinder", "box"), []),
        (("cylinder", "cylinder", "cylinder", "cylinder"), []),
    ):
        request, models = emit_models(robot(store, *shapes), store, ["mjx"], ("bench", "free"))
        assert not request.report.diagnostics
        assert lost(models) == [(f"arm/part_{number}", what, "approximated") for number in prisms], shapes
        model = load_scene(request, models)
        for number, shape in enumerate(shapes):
            kind = "mesh" if number in prisms else shape
            assert model.geom(f"arm/part_{number}:collision").type == getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"), (shapes, number)


def test_prism_has_pose_and_size_of_the_cylinder(store: Store) -> None:
    made = robot(store, "box", "box", "cylinder")
    before, after = (emit_models(made, store, compat) for compat in ((), ("mjx",)))
    old, new = (load_scene(*one) for one in (before, after))
    assert new.nmesh == old.nmesh + 1
    data = [mujoco.MjData(one) for one in (old, new)]
    for one, state in zip((old, new), data, strict=True):
        mujoco.mj_resetDataKeyframe(one, state, 0)
        mujoco.mj_forward(one, state)
    assert data[0].geom("arm/part_2:collision").xpos == pytest.approx(data[1].geom("arm/part_2:collision").xpos, abs=1e-9)
    corners = np.array(prism(0.02, 0.01)).reshape(-1, 3)
    assert np.hypot(corners[:, 0], corners[:, 1]) == pytest.approx(0.02)
    assert sorted(set(corners[:, 2].tolist())) == [-0.01, 0.01]
    assert len(corners) == 2 * SIDES


def emit_with_magnet(store: Store, base: str, *, on: bool = True) -> tuple[EmitRequest, emit.Models]:
    made = robot(store, "hull", "box", "box", adhesions=(("arm/sole", "arm/part_0", 20.0),), control={"arm/sole": 20.0 if on else 0.0})
    return emit_models(made, store, ["mjx"], ("bench", base))


def test_mjx_adhesion_is_omitted_or_reported(store: Store) -> None:
    """An adhesion that is off, or on a body that never moves, is omitted from the model and its keyframes. One that carries the robot is
    reported as unsupported."""
    for base, on in (("fixed", True), ("held", True), ("free", False)):
        request, models = emit_with_magnet(store, base, on=on)
        assert not request.report.diagnostics
        assert ("arm/sole", "the adhesion: not supported by MJX", "omitted") in lost(models)
        model = load_scene(request, models)
        assert [model.actuator(number).name for number in range(model.nu)] == ["arm/turn_1", "arm/turn_2"]
        assert model.key_ctrl.tolist() == [[0.1, 0.2]]
        assert not model.geom_margin.any()
    request, models = emit_with_magnet(store, "free")
    (said,) = request.report.diagnostics
    assert (said.code, said.severity.value) == (Code.COMPAT, "warning")
    assert said.message == "MJX cannot load mode `bench`: the adhesion at `arm/sole` is not supported"
    assert said.span is not None and said.span.line == at(50)[0].line
    assert said.help == "exclude the mode with `--mode`, or use another root" and said.allow
    assert load_scene(request, models).nu == 3


@pytest.mark.parametrize(("compat", "path", "value", "message"), [
    ("mjx", "option solver", "PGS", "MJX cannot load mode `bench`: `solver: PGS` is not supported"),
    ("warp", "option solver", "PGS", "MuJoCo Warp cannot load mode `bench`: `solver: PGS` is not supported"),
    ("mjx", "option flag energy", "enable", "MJX cannot load mode `bench`: the enabled flag `energy` is not supported"),
    ("warp", "option flag midphase", "disable", "MuJoCo Warp cannot load mode `bench`: the disabled flag `midphase` is not supported"),
    ("mjx", "geom arm/part_2:collision margin", "0.001",
     "MJX cannot load mode `bench`: `margin` is not supported for contacts of meshes"),
    ("mjx", "geom arm/part_2:collision type", "ellipsoid",
     "MJX cannot load mode `bench`: contacts between ellipsoid and mesh are not supported"),
])
def test_unsupported_raw_attributes_are_reported(store: Store, compat: str, path: str, value: str, message: str) -> None:
    """A raw attribute that the reader does not support is reported at its line, and only if that reader is selected."""
    made = robot(store, "hull", "box", "box", raw=(raw(5, path, value), raw(6, "option viscosity", "0")))
    request, _ = emit_models(made, store, [compat])
    (said,) = request.report.diagnostics
    assert (said.code, said.message, said.span and said.span.line) == (Code.COMPAT, message, at(5)[0].line)
    silent, _ = emit_models(made, store, ())
    assert not silent.report.diagnostics


def test_mjx_integrator_and_fluid_limits_are_reported(store: Store) -> None:
    """The integrator `implicit` is replaced by `implicitfast`; `density` with `implicitfast` is reported."""
    made = robot(store, "box", "box", simulation={"integrator": "implicit"}, raw=(raw(5, "option density", "1.2"),))
    request, models = emit_models(made, store, ["mjx"])
    assert ("bench", "the integrator `implicit`: MJX uses `implicitfast`", "approximated") in lost(models)
    assert load_scene(request, models).opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert [one.message for one in request.report.diagnostics] == [
        "MJX cannot load mode `bench`: `density` is not supported with `implicitfast`",
    ]


def test_mjx_elliptic_cones_require_contacts(store: Store) -> None:
    """Without possible contacts, elliptic cones are omitted, which changes nothing. If only the floor of the scene is touched, a
    diagnostic reports that MJX cannot load the model alone."""
    why = "elliptic cones are not supported without contacts"
    refused = f"MJX cannot load mode `bench`: {why}"
    for shapes, base, said, elliptic in (
        (("none", "none"), "fixed", [], False), (("box", "box"), "fixed", [], True), (("box", "box"), "free", [refused], True),
    ):
        request, models = emit_models(robot(store, *shapes, simulation={"cone": "elliptic"}), store, ["mjx"], ("bench", base))
        assert [one.message for one in request.report.diagnostics] == said, shapes
        model = load_scene(request, models)
        assert (model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC) == elliptic
        assert [one for one in lost(models) if "cone" in one[1]] == []
        silent, plain = emit_models(robot(store, *shapes, simulation={"cone": "elliptic"}), store, [], ("bench", base))
        assert not silent.report.diagnostics and load_scene(silent, plain).opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC


def test_pymjcf_names_use_dots(store: Store) -> None:
    """`/` in names becomes `.`; everything else in the load_scene model is equal."""
    made = robot(store, "box", "cylinder", "hull")
    (_, before), (request, after) = (emit_models(made, store, compat) for compat in ((), ("pymjcf",)))
    assert [one for one in lost(after) if one not in lost(before)] == [
        ("arm", "`/` in names: replaced by `.` for PyMJCF", "approximated"),
    ]
    old, new = load_scene(request, before), load_scene(request, after)
    for kind, count in (("body", "nbody"), ("joint", "njnt"), ("geom", "ngeom"), ("actuator", "nu"), ("site", "nsite")):
        names = [[getattr(one, kind)(number).name for number in range(getattr(one, count))] for one in (old, new)]
        assert [name.replace("/", ".") for name in names[0]] == names[1], kind
        assert not any("/" in name for name in names[1])
    assert new.geom_pos.tolist() == old.geom_pos.tolist()


def test_pymjcf_diagnostics_use_document_paths(store: Store) -> None:
    """A diagnostic about a start contact contains the path of the document, not the name in the file."""
    made = robot(store, "box", "box", "box")
    made.segments[2].pose = matrix((0.0, 0.0, -0.02))  # back in the first
    request, _ = emit_models(made, store, ["pymjcf"])
    assert [one.code for one in request.report.diagnostics] == [Code.START_CONTACT]
    assert "`arm/part_0`" in request.report.diagnostics[0].message


def test_unsupported_drake_features_are_losses(store: Store) -> None:
    """Friction, held bases, adhesion, keyframes and command ranges are export losses for Drake. Except for command ranges, the text of
    the models is unchanged."""
    made = robot(store, "box", "box", adhesions=(("arm/sole", "arm/part_0", 20.0),), control={"arm/sole": 20.0})
    (_, before), (request, after) = (emit_models(made, store, compat, ("bench", "held")) for compat in ((), ("drake",)))
    assert not request.report.diagnostics
    commands = re.compile(r'(<(?:position|velocity) [^>]*) ctrlrange="[^"]*"')
    texts = [[[commands.sub(r"\1", text) for text in one.texts] for one in made.candidates] for made in (after, before)]
    assert texts[0] == texts[1]
    more: list[Loss] = [one for one in after.losses if one not in before.losses]
    assert {(one.path, one.what) for one in more} == {
        ("arm/turn_1", "the dry friction: not supported by Drake"), ("arm/link_0", "the motion at run time: not supported by Drake"),
        ("arm/sole", "the adhesion: not supported by Drake"), ("rest", "the keyframe: not supported by Drake"),
        ("arm/turn_1", "the command range: Drake would limit the force instead"),
    }


def test_drake_models_have_no_position_ctrlrange(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    """Drake reads `ctrlrange` of every drive as its effort limit: that would be 1 N m for a joint with a range of 1 rad."""
    mass = "mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}"
    drives = {"bend": "position, kp: 5 N*m/rad", "spin": "velocity, kv: 1 N*m*s/rad", "push": "motor"}
    joints = [
        f"  {name}: {{type: revolute, parent: c{k}.origin, child: c{k + 1}.origin, drive: {{kind: {kind}}}, "
        f"limit: {{lower: -1 rad, upper: 1 rad, effort: 4 N*m, velocity: 3 rad/s}}}}"
        for k, (name, kind) in enumerate(drives.items())
    ]
    lines = ["thingc: assembly/1", "name: arm", "components:", *(f"  c{k}: {{frame: true, {mass}}}" for k in range(4)), "joints:", *joints]
    (tmp_path / "arm.yaml").write_text("\n".join(lines))
    assert main(["build", str(tmp_path / "arm.yaml"), "--emit", "mjcf", "-o", str(tmp_path), "--compat", "drake"]) == 0
    section = ElementTree.parse(tmp_path / "arm" / "mjcf" / "arm_default.xml").find("actuator")
    assert section is not None
    assert {one.get("name"): (one.get("ctrlrange"), one.get("forcerange")) for one in section} == {
        "bend": (None, "-4 4"), "spin": (None, "-4 4"), "push": ("-4 4", None),
    }
    capsys.readouterr()
    assert main(["why", "--losses", str(tmp_path / "arm.yaml"), "--emit", "mjcf", "--compat", "drake"]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if "command range" in line]
    assert [line.partition(": ")[2] for line in said] == [
        "mjcf: bend, spin: the command range: Drake would limit the force instead (omitted)",
    ]


def test_drake_bodies_with_several_joints_are_not_rotated(tmp_path: Path) -> None:
    """Drake reads the axes of all joints of a body except the last in the parent's frame. An extra rotated body avoids this without
    changing the kinematics."""
    (tmp_path / "every.yaml").write_text(EVERY)
    built = {}
    for name, words in (("plain", []), ("drake", ["--compat", "drake"])):
        assert main(["build", str(tmp_path / "every.yaml"), "--emit", "mjcf", "-o", str(tmp_path / name), *words]) == 0
        built[name] = tmp_path / name / "every" / "mjcf"
    several = 0
    for file in sorted(built["plain"].glob("every_*.xml")):
        other = built["drake"] / file.name
        for body in ElementTree.parse(other).iter("body"):
            joints = body.findall("joint")
            several += len(joints) > 1
            assert len(joints) < 2 or "quat" not in body.attrib
        model, same = mujoco.MjModel.from_xml_path(str(file)), mujoco.MjModel.from_xml_path(str(other))
        names = [[one.joint(k).name for k in range(one.njnt)] for one in (model, same)]
        assert same.nbody > model.nbody and names[0] == names[1]
        data, found = mujoco.MjData(model), mujoco.MjData(same)
        data.qpos += np.random.default_rng(6).uniform(-0.5, 0.5, model.nq)
        found.qpos[:] = data.qpos
        mujoco.mj_forward(model, data)
        mujoco.mj_forward(same, found)
        for k in range(1, model.nbody):
            link = model.body(k).name
            assert found.body(link).xpos == pytest.approx(data.body(link).xpos, abs=1e-12)
            assert found.body(link).xmat == pytest.approx(data.body(link).xmat, abs=1e-12)
        assert found.qfrc_bias == pytest.approx(data.qfrc_bias, abs=1e-10)
    assert several >= 5


def test_compat_models_do_not_modify_shared_elements(store: Store) -> None:
    """Elements are shared between the trees of several modes. Emitting for another reader must not change them."""
    made = robot(store, "box", "cylinder", "box", "cylinder")
    request = made.request(store, ("bench", "fixed"), ("adrift", "free"))
    plain = [one.texts for one in emit.models(request).candidates]
    emit.models(replace(request, compat=NAMES, made={}))
    assert [one.texts for one in emit.models(replace(request, made={})).candidates] == plain


@pytest.mark.parametrize(("base", "lost"), [("held", True), ("fixed", False), ("free", False)])
def test_mjx_held_base_is_a_loss(store: Store, base: str, lost: bool) -> None:
    """MJX places the children of a mocap body at the body's pose in the model."""
    _, models = emit_models(robot(store, "box", "box"), store, ["mjx"], ("bench", base))
    assert [(loss.path, loss.what.partition(":")[0]) for loss in models.losses if "mocap" in loss.what] == [
        ("bench", "the motion of the base"),
    ] * lost
