"""Nested assemblies with `as: lump`: one body with the mass properties and mounts that MuJoCo computes for the moving assembly."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import thingc
from loops.robots import Built, at_key, compiled, equality_residual, pose_of
from thingc.base.diagnostics import Report
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.model.resolve.resolver import Settings
from thingc.tools.diff.take_snapshot import take_snapshot

LINK = "inertia: {ixx: 4.1e-5 kg*m^2, iyy: 5.3e-5 kg*m^2, izz: 2.7e-5 kg*m^2, ixy: 4e-6 kg*m^2}"
CRANK = f"link: true, mass: 90.7 g, com: 2 1 30 mm, {LINK}, shapes: [{{box: 10 20 60 mm, at: {{xyz: 0 0 30 mm}}}}]"
GRIPPER = f"""\
thingc: assembly/1
name: gripper
parameters: {{opening: 30 deg, rear: 1 mm}}
simulation: {{timestep: 1 ms}}
components:
  palm:
    {{link: true, mass: 431 g, com: [3 mm, =rear, 20 mm], {LINK}, shapes: [{{box: 60 40 40 mm, at: {{xyz: 0 0 20 mm}}}}],
      mounts: {{back: {{rpy: 180 0 0 deg}}, left: {{xyz: 25 0 40 mm}}, right: {{xyz: -25 0 40 mm}}}}}}
  left: {{{CRANK}, mounts: {{foot: {{}}, tip: {{xyz: 0 0 60 mm}}}}}}
  right: {{{CRANK}, mounts: {{foot: {{}}, tip: {{xyz: 0 0 60 mm}}}}}}
  bar: {{link: true, mass: 53 g, {LINK}, shapes: [{{box: 50 5 5 mm}}], mounts: {{a: {{xyz: 25 0 0 mm}}, b: {{xyz: -25 0 0 mm}}}}}}
joints:
  left: {{type: continuous, parent: palm.left, child: left.foot, axis: [0, 1, 0], drive: {{kind: motor, effort: 1 N*m}}}}
  right: {{type: continuous, parent: palm.right, child: right.foot, axis: [0, 1, 0]}}
  bar: {{type: continuous, parent: left.tip, child: bar.a, axis: [0, 1, 0]}}
  loop: {{type: continuous, parent: bar.b, child: right.tip, axis: [0, 1, 0], loop: true}}
mounts: {{back: palm.back, tip: bar.b, home: bar.origin}}
poses: {{open: {{left: =opening}}, closed: {{left: -10 deg, bar: 10 deg, right: -10 deg}}}}
modes: {{bench: {{root: palm, pose: open}}}}
"""
HOST = """\
thingc: assembly/1
name: host
parameters: {opening: 30 deg, rear: 1 mm}
components:
  base:
    {link: true, mass: 10 kg, shapes: [{box: 300 200 100 mm}],
     mounts: {top: {xyz: 0 0 50 mm}, side: {xyz: 150 0 0 mm, rpy: 0 90 0 deg}, back: {xyz: -150 0 0 mm, rpy: 0 -90 0 deg}}}
  hand: {assembly: gripper.yaml, as: lump, parameters: {opening: =opening, rear: =rear}}
  other: {assembly: gripper.yaml, as: lump, pose: closed, mirror: x}
  third: {assembly: gripper.yaml, as: lump, pose: closed, attach: {back: base.back}}
joints:
  wrist: {type: continuous, parent: base.top, child: hand.back}
  hinge: {type: continuous, parent: base.side, child: other.home, axis: [0, 1, 0]}
poses: {home: {wrist: 20 deg, hand: open, other: closed, third: closed}}
modes: {bench: {root: base, base: free, pose: home}, tip: {root: hand.tip, pose: home}}
"""
FULL = HOST.replace("as: lump, pose: closed, ", "").replace("as: lump, ", "")
MEMBERS = ("palm", "left", "right", "bar")


@pytest.fixture(scope="module")
def lumped(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return compiled(tmp_path_factory.mktemp("lumped"), {"host.yaml": HOST, "gripper.yaml": GRIPPER})


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return compiled(tmp_path_factory.mktemp("full"), {"host.yaml": FULL, "gripper.yaml": GRIPPER})


def composite(model: mujoco.MjModel, data: mujoco.MjData, bodies: list[str]) -> tuple[float, Any, Any]:
    """Mass, centre and inertia about the centre of several bodies in the frame of the first, from MuJoCo's poses of each body."""
    ids, frame = [model.body(name).id for name in bodies], pose_of(data.body(bodies[0]))
    mass = sum(model.body_mass[b] for b in ids)
    centre = sum(model.body_mass[b] * data.xipos[b] for b in ids) / mass
    inertia = np.zeros((3, 3))
    for b in ids:
        axes, arm = data.ximat[b].reshape(3, 3), data.xipos[b] - centre
        inertia += axes @ np.diag(model.body_inertia[b]) @ axes.T + model.body_mass[b] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    turned = frame[:3, :3].T
    return mass, turned @ (centre - frame[:3, 3]), turned @ inertia @ turned.T


@pytest.mark.parametrize("mode", ["bench", "tip"])
@pytest.mark.parametrize("hand", ["hand", "other", "third"])
def test_mass_centre_inertia_and_mounts_are_those_of_the_frozen_assembly(lumped: Built, full: Built, hand: str, mode: str) -> None:
    one, many = lumped.model(mode), full.model(mode)
    assert one.njnt == (3 if mode == "bench" else 2) and many.njnt == one.njnt + 9
    rigid, moving = at_key(one, "home"), at_key(many, "home")
    assert equality_residual(moving) < 1e-9
    body = "base" if hand == "third" else f"{hand}/palm"  # the third hand is attached to the base
    members = [body, *(f"{hand}/{name}" for name in MEMBERS[1:])]
    for got, expected in zip(composite(one, rigid, [body]), composite(many, moving, members)):
        assert np.allclose(got, expected, rtol=0.0, atol=1e-12)
    for site in ("back", "tip", "home"):
        poses = [np.linalg.inv(pose_of(data.body(body))) @ pose_of(data.site(f"{hand}/{site}")) for data in (rigid, moving)]
        assert np.allclose(*poses, rtol=0.0, atol=1e-12)
    poses = [np.linalg.inv(pose_of(data.body("base"))) @ pose_of(data.body(body)) for data in (rigid, moving)]
    assert np.allclose(*poses, rtol=0.0, atol=1e-12), "`other` is placed by a mount on its bar"


def test_boxes_enclose_the_parts_of_each_link(lumped: Built, full: Built) -> None:
    one, many = lumped.model("bench"), full.model("bench")
    rigid, moving = at_key(one, "home"), at_key(many, "home")
    drawn = [g for g in range(one.ngeom) if one.geom(g).name.startswith("hand/") and one.geom_contype[g]]
    assert len(drawn) == len(MEMBERS)
    for name in MEMBERS:  # the only shape of each link is a box, so the boxes are equal
        geom = next(g for g in range(many.ngeom) if many.geom_bodyid[g] == many.body(f"hand/{name}").id)
        near = min(drawn, key=lambda g: float(np.abs(rigid.geom_xpos[g] - moving.geom_xpos[geom]).max()))
        assert np.allclose(rigid.geom_xpos[near], moving.geom_xpos[geom], atol=1e-12)
        assert np.allclose(rigid.geom_xmat[near], moving.geom_xmat[geom], atol=1e-12)
        assert np.allclose(one.geom_size[near], many.geom_size[geom], atol=1e-12)


def test_names_inside_a_lump_are_unknown_except_mounts_and_poses(lumped: Built, tmp_path: Path) -> None:
    assert not [one for one in lumped.said if one[0] not in ("TC522", "TC611")]  # poses of lumps are ignored, as is `simulation`
    wrong = HOST.replace("{root: hand.tip, ", "{root: hand.tap, ") + "links: {palm: hand.palm}\n"
    said = compiled(tmp_path, {"host.yaml": wrong, "gripper.yaml": GRIPPER}).said
    assert ("TC302", "`hand` in `hand.palm` is an assembly and has no components") in [one[:2] for one in said]


@pytest.mark.parametrize(("old", "new", "message"), [
    ("pose: closed", "pose: shut", "`other` (`gripper.yaml`) has no pose `shut`"),
    ("as: lump, pose: closed", "pose: closed", "`pose` can only be used with `as: lump`"),
    ("as: lump, pose: closed", "as: lump, mode: bench", "`as: lump` can only be used with `assembly`, and without `mode`"),
    ("{link: true, mass: 10 kg", "{as: lump, link: true, mass: 10 kg", "`as: lump` can only be used with `assembly`, and without `mode`"),
])
def test_wrong_lumps_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    said = compiled(tmp_path, {"host.yaml": HOST.replace(old, new), "gripper.yaml": GRIPPER}).said
    assert message in [one[1] for one in said]


ARM = """\
thingc: assembly/1
name: arm
components:
  post: {link: true, mass: 1 kg, shapes: [{box: 20 30 100 mm}], mounts: {foot: {xyz: 0 0 -50 mm}, top: {xyz: 5 7 50 mm}}}
  hand: {assembly: gripper.yaml, INNER mirror: x, attach: {back: post.top}}
mounts: {foot: post.foot, tip: hand.tip}
poses: {folded: {hand: closed}}
"""
STAND = """\
thingc: assembly/1
name: stand
components:
  base: {link: true, mass: 10 kg, shapes: [{box: 300 200 100 mm}], mounts: {top: {xyz: 0 20 50 mm}}}
  arm: {assembly: arm.yaml, OUTER mirror: x, attach: {foot: base.top}}
poses: {p: {arm.hand: closed}}
modes: {bench: {root: base, base: free, pose: p}}
"""


@pytest.mark.parametrize(("inner", "outer"), [
    ("as: lump, pose: closed,", ""), ("as: lump, pose: closed,", "as: lump,"), ("", "as: lump, pose: folded,"),
])
def test_mirror_images_of_lumps_and_lumps_in_lumps_are_rigid(tmp_path: Path, inner: str, outer: str) -> None:
    models = []
    for name, keys in (("rigid", (inner, outer)), ("moving", ("", ""))):
        tmp_path.joinpath(name).mkdir()
        documents = {"stand.yaml": STAND.replace("OUTER", keys[1]), "arm.yaml": ARM.replace("INNER", keys[0]), "gripper.yaml": GRIPPER}
        built = compiled(tmp_path / name, documents)
        assert [one[0] for one in built.said] == ([] if name == "rigid" else ["TC532"])  # `simulation` of lumps is not used
        model = built.model("bench")
        data = at_key(model, "p")
        bodies = [model.body(body).name for body in range(1, model.nbody)]
        models.append((model.njnt, *composite(model, data, bodies), data.site("arm/tip").xpos))
    assert (models[0][0], models[1][0]) == (1, 4)
    for got, expected in zip(models[0][1:], models[1][1:], strict=True):
        assert np.allclose(got, expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("inner", ["", "as: lump,"])
def test_poses_can_set_joints_below_lumps(tmp_path: Path, inner: str) -> None:
    outer = "" if inner else "as: lump,"
    keys = ("arm.hand: closed", "arm.hand.left: 3 deg", "'arm.*': 3 deg", "arm.hand: none", "art.hand: closed", "art.hand.left: 3 deg")
    stand = STAND.replace("OUTER", outer).replace("pose: p", "pose: p0").replace("p: {arm.hand: closed}", ", ".join(
        f"p{number}: {{{key}}}" for number, key in enumerate(keys)
    ))
    said = compiled(tmp_path, {"stand.yaml": stand, "arm.yaml": ARM.replace("INNER", inner), "gripper.yaml": GRIPPER}).said
    assert [one[:2] for one in said] == [
        ("TC304", "there is no joint or nested assembly `art.hand`"), ("TC304", "there is no joint `art.hand.left`"),
    ]


def test_assembly_graph_distinguishes_lumps_from_the_moving_assembly(tmp_path: Path, lumped: Built) -> None:
    mixed = HOST.replace("third: {assembly: gripper.yaml, as: lump, pose: closed, ", "third: {assembly: gripper.yaml, ")
    built = compiled(tmp_path, {"host.yaml": mixed, "gripper.yaml": GRIPPER})
    for one, hands in ((built, {"hand": ["palm"], "third": [*MEMBERS]}), (lumped, {"hand": ["palm"], "third": ["palm"]})):
        assert one.compilation.assembly is not None
        edges = one.compilation.assembly.hag.edges
        nodes = {edge.component: edge.child for edge in edges if edge.parent == "host"}
        assert nodes["hand"] == "gripper" and nodes["third"].startswith("gripper [")
        for hand, members in hands.items():
            assert [edge.component for edge in edges if edge.parent == nodes[hand]] == members

def test_diff_shows_the_mass_of_a_lump_instead_of_the_text_of_its_base(lumped: Built, full: Built) -> None:
    masses = [take_snapshot(one.compilation).things["component", "hand/palm"].facts["mass.value"] for one in (full, lumped)]
    assert [(one.value, one.written) for one in masses] == [(0.431, "431 g"), (pytest.approx(0.6654, rel=1e-12), None)]


def test_lump_without_mass_adds_only_mounts(tmp_path: Path) -> None:
    arm = "thingc: assembly/1\nname: arm\ncomponents: {post: {frame: true, mounts: {foot: {}}}}\nmounts: {foot: post.foot}\n"
    stand = STAND.replace("OUTER mirror: x", "as: lump").replace("p: {arm.hand: closed}", "p: {}")
    built = compiled(tmp_path, {"stand.yaml": stand, "arm.yaml": arm})
    assert not built.said and built.model("bench").body("base").mass == 10.0
    assert np.allclose(at_key(built.model("bench"), "p").site("arm/foot").xpos, [0.0, 0.02, 0.05])


def test_bill_of_materials_lists_a_lump_as_one_part(lumped: Built) -> None:
    from thingc.targets.bom.emit import items

    assert lumped.compilation.assembly is not None
    rows = {row.definition: row for row in items(lumped.compilation.assembly)}
    mass = pytest.approx(0.431 + 2 * 0.0907 + 0.053, rel=1e-14)
    assert {name: (row.quantity, row.mass) for name, row in rows.items() if name.startswith("gripper")} == {
        "gripper": (2, mass), "gripper(mirror=x)": (1, mass),
    }


def test_variants_equal_compilations(tmp_path: Path) -> None:
    compiled(tmp_path, {"host.yaml": HOST, "gripper.yaml": GRIPPER})
    path, store = str(tmp_path / "host.yaml"), str(tmp_path / "store")
    with thingc.family(path, store=store, verify=0) as family:
        for opening in (0.1, 0.5):
            values = {"opening": opening, "rear": 0.002 + opening / 100}
            one, other = family.model(values), thingc.compile(path, parameters=values, store=store).modes["bench"].model()
            for name in ("body_mass", "body_ipos", "body_inertia", "site_pos", "site_quat", "geom_pos", "geom_size"):
                assert np.array_equal(getattr(one, name), getattr(other, name)), name


# --- parts from the lock file ----------------------------------------------------------------------------------------

BLOCK = """\
from build123d import Box, Location
from thingc import Length, MountPoint, Thing


class Block(Thing):
    def __init__(self, edge: Length = 10) -> None:
        super().__init__(material="steel")
        self.body = Box(edge, edge, edge)
        self.top = MountPoint(Location((0, 0, edge / 2)))

    def result(self) -> Box:
        return self.body
"""
STACK = """\
thingc: assembly/1
name: stack
parameters: {edge: 10 mm}
materials: {steel: {density: 7850 kg/m^3}}
components:
  low: {part: blocks:Block, params: {edge: =edge}}
  high: {part: blocks:Block}
joints: {lift: {type: prismatic, parent: low.top, child: high.origin, axis: [0, 0, 1], limit: {lower: 0, upper: 50 mm}}}
mounts: {top: high.top}
poses: {up: {lift: 20 mm}}
"""
CART = """\
thingc: assembly/1
name: cart
components:
  base: {link: true, mass: 1 kg, shapes: [{box: 100 100 20 mm}], mounts: {top: {xyz: 0 0 10 mm}}}
  stack: {assembly: stack.yaml, as: lump, pose: up, at: {in: base.top}}
"""


@pytest.fixture
def cart(tmp_path: Path) -> Path:
    """A workspace whose lock file was written without building a part. The volume in it is not that of the part."""
    from thingc.documents.workspace import Workspace
    from thingc.geometry.key.part_code import PartCode
    from thingc.geometry.lock.lock import hash_of

    for name, text in {"thingc.toml": 'thingc = "workspace/1"\n', "stack.yaml": STACK, "cart.yaml": CART}.items():
        tmp_path.joinpath(name).write_text(text)
    tmp_path.joinpath("parts").mkdir()
    tmp_path.joinpath("parts/blocks.py").write_text(BLOCK)
    workspace = Workspace.find(str(tmp_path / "cart.yaml"), Report())
    assert workspace is not None
    parts, moment = PartCode(workspace, None), 3e-11
    code = parts.code("blocks:Block")
    record = {
        "material": "steel", "color": None, "volume": 2e-6, "area": 6e-4, "centre": [0.001, 0.0, 0.0],
        "inertia": [moment, 0, 0, 0, moment, 0, 0, 0, moment], "box": [-0.005] * 3 + [0.005] * 3,
        "mounts": {"top": {"pose": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0.005]}},
    }
    thing = {
        "code": hash_of("blocks:Block", code, parts), "kind": "thing", "doc": "", "material": "steel", "actuator": False,
        "parameters": {"edge": {"kind": "length", "unit": "m", "default": 0.01}}, "records": {"blocks:Block": record},
    }
    lock = {"thingc": "lock/1", "things": {"blocks:Block": thing}, "files": {}, "others": []}
    tmp_path.joinpath("parts.lock.json").write_text(json.dumps(lock))
    return tmp_path


def said(folder: Path, **options: Any) -> tuple[pipeline.Compilation, list[tuple[str, str]]]:
    with Environment(str(folder / "cart.yaml"), Options(store=str(folder / "store"), **options)) as environment:
        compilation = pipeline.compile(environment)
        assert not environment.options.code or environment.geometry._calls.workers is None, "no worker process was started"
        return compilation, [(d.code.code, d.message) for d in compilation.report.sorted_diagnostics()]


@pytest.mark.parametrize("code", [True, False])
def test_parts_of_a_lump_come_from_the_lock_file(cart: Path, code: bool) -> None:
    compilation, diagnostics = said(cart, code=code)
    assert not diagnostics and not compilation.decisions and compilation.assembly is not None
    one = 7850 * 2e-6
    body = next(part.properties for part in compilation.assembly.occurrences if part.path == "stack/low")
    assert body.mass == pytest.approx(2 * one, rel=1e-14) and body.centre == pytest.approx((0.001, 0.0, 0.0125), abs=1e-15)
    assert body.inertia[0][0] == pytest.approx(2 * (7850 * 3e-11 + one * 0.0125**2), rel=1e-12)
    assert body.inertia[2][2] == pytest.approx(2 * 7850 * 3e-11, rel=1e-12)
    assert compilation.assembly.occurrences[1].mounts["top"].pose.translation == pytest.approx((0.0, 0.0, 0.03), abs=1e-15)


def test_lock_command_lists_parts_of_lumps(cart: Path) -> None:
    with Environment(str(cart / "cart.yaml"), Options(code=False)) as environment:
        sources = pipeline.read(environment)
        assert sources is not None
        model = pipeline.model(environment, sources, Settings(), Report())
    assert model is not None and model.part_definitions() == ()
    assert [part.text for part in model.part_definitions(lumps=True)] == ["blocks:Block"]


def test_missing_and_outdated_lock_files_are_reported(cart: Path) -> None:
    lock, source = cart / "parts.lock.json", cart / "parts/blocks.py"
    text = lock.read_text()
    cart.joinpath("cart.yaml").write_text(CART.replace("pose: up", "parameters: {edge: 12 mm}"))
    assert said(cart)[1] == [("TC343", "`parts.lock.json` is out of date for 1 part of the lump `stack`")]
    cart.joinpath("cart.yaml").write_text(CART)
    source.write_text(BLOCK.replace("edge / 2", "edge / 3"))
    assert said(cart)[1] == [("TC341", "part `blocks:Block`: the code has changed since `parts.lock.json` was written")]
    source.write_text(BLOCK)
    lock.unlink()
    assert [one[0] for one in said(cart)[1]] == ["TC340"]
    lock.write_text(text[:-1])
    assert said(cart)[1][0][0] == "TC342"


ROD = """\
thingc: assembly/1
name: rod
components:
  one: {frame: true, mass: 1 kg, mounts: {hinge: {}}}
  two: {frame: true, mass: 2 kg, SECOND at: {in: one.origin, xyz: 0 0 100 mm}}
mounts: {hinge: one.hinge}
"""
HOLDER = """\
thingc: assembly/1
name: holder
components:
  base: {link: true, mass: 10 kg, shapes: [{box: 300 200 100 mm}]}
  rod: {assembly: rod.yaml, as: lump, PLACE}
modes: {bench: {root: base}}
JOINT
"""
HINGE = "joints: {hinge: {type: continuous, parent: base.origin, child: rod.hinge, axis: [0, 1, 0]}}"
INERTIA = "inertia: {ixx: 1e-4 kg*m^2, iyy: 1e-4 kg*m^2, izz: 1e-4 kg*m^2},"


@pytest.mark.parametrize(("place", "joint", "second", "fault"), [
    ("parameters: {}", HINGE, "", True), ("parameters: {}", HINGE, INERTIA, False), ("attach: {hinge: base.origin}", "", "", False),
])
def test_point_masses_on_a_line_need_an_inertia_only_if_they_move(tmp_path: Path, place: str, joint: str, second: str, fault: bool) -> None:
    documents = {"holder.yaml": HOLDER.replace("PLACE", place).replace("JOINT", joint), "rod.yaml": ROD.replace("SECOND", second)}
    said = [one for one in compiled(tmp_path, documents).said if one[0] != "TC522"]
    help = "add a mass to a component with geometry, or add `inertia:` to a component of the lump `rod`"
    moments = "the principal moments (0, 0.00666667, 0.00666667 kg m^2) are not all positive"
    message = f"the inertia of the moving link `rod/one` is not physical: {moments}"
    assert [one[:3] for one in said] == ([("TC506", message, help)] if fault else [])
