"""GLB files read by other programs: trimesh reads the scene and pygltflib the structure. MuJoCo and numpy give the expected poses."""

from __future__ import annotations

import hashlib
import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pygltflib
import pytest
import trimesh
from msgspec.structs import replace

from emit import small_robot
from emit.small_robot import LIFT, X_BRACE_J, X_J_BRACKET, X_J_PALM, X_PLATE_J, X_SERVO_BRACE, YAW, assembly, box_obj, links, request
from graph.builder import assembly as document, box, component, coordinates_of, kept, linked, mimic, mode, pose, ref, rx, ry, rz, t
from thingc.base.diagnostics import Code, Report
from thingc.base.pose import NO_POSE, Pose
from thingc.base.primitives import Primitive
from thingc.geometry.store.local import Store
from thingc.model.resolve.types import Overrides
from thingc.model.robot.kinematic_tree import root
from thingc.model.robot.types import Closure
from thingc.targets.artifact import Artifacts, Loss
from thingc.targets.glb.emit import _tessellate, emit
from thingc.targets.mjcf import emit as mjcf
from thingc.targets.registry import parse_targets
from thingc.targets.request import EmitRequest

Array = Any
Y_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=float)
"""Rotation from z-up to y-up: x stays, z becomes y, and y becomes -z."""


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(str(tmp_path / "store"))


def scene_of(made: Artifacts, name: str) -> Any:
    """The scene of a file, read by trimesh."""
    data = made.files[f"glb/{name}.glb"]
    assert isinstance(data, bytes)
    return trimesh.load_scene(io.BytesIO(data), file_type="glb")


def tree_of(made: Artifacts, name: str) -> pygltflib.GLTF2:
    data = made.files[f"glb/{name}.glb"]
    assert isinstance(data, bytes)
    return pygltflib.GLTF2.load_from_bytes(data)


def at(scene: Any, node: str) -> Array:
    """World pose of a node in glTF."""
    return np.array(scene.graph.get(node)[0])


def rows(pose: Pose) -> Array:
    return np.array(pose.rows())


# --- the small robot, by hand -----------------------------------------------------------------------------------------


def test_scene_is_in_the_start_pose_of_the_mode(store: Store) -> None:
    """Volume, centre and bounds of the scene equal those of boxes placed with numpy according to the joints of the document."""
    whole_robot = assembly(store)
    asked = request(replace(whole_robot, modes=tuple(replace(m, pose="start") for m in whole_robot.modes)), store)
    made = emit(asked)
    assert (list(made.files), made.losses) == ([f"glb/arm_{name}.glb" for name in ("adrift", "bench", "drawing")], ())
    yaw, lift = -0.5 + (YAW.offset or 0.0), 0.02 + (LIFT.offset or 0.0)
    servo = rows(X_PLATE_J) @ rz(yaw) @ rows(X_J_BRACKET)
    palm = servo @ rows(X_SERVO_BRACE) @ rows(X_BRACE_J) @ t(0, 0, lift) @ rows(X_J_PALM)
    in_plate = {"base": np.eye(4), "servo_a": servo, "palm": palm}
    for robot, first in zip(asked.robots, ("base", "palm", "servo_a"), strict=True):
        world = Y_UP @ rows(robot.mode.at) @ np.linalg.inv(in_plate[first])
        corners, volume, moment = [], 0.0, np.zeros(3)
        for link in links():
            for member, in_link in zip(link.members, link.poses, strict=True):
                record = whole_robot.occurrences[member].record
                if record is None or record.box is None:
                    continue
                place, size = world @ in_plate[link.name] @ rows(in_link), np.array(record.box[1]) - np.array(record.box[0])
                corners += [(place @ [*(size * [k & 1, k >> 1 & 1, k >> 2]), 1.0])[:3] for k in range(8)]
                volume += float(np.prod(size))
                moment += np.prod(size) * (place @ [*(size / 2), 1.0])[:3]
        scene = scene_of(made, f"arm_{robot.mode.name}")
        assert scene.volume == pytest.approx(volume, rel=1e-6)
        np.testing.assert_allclose(scene.to_mesh().center_mass, moment / volume, atol=1e-7)
        np.testing.assert_allclose(scene.bounds, [np.min(corners, axis=0), np.max(corners, axis=0)], atol=1e-7)


def test_meshes_are_shared_between_nodes(store: Store) -> None:
    """Nine drawn parts have six definitions, and each distinct mesh is stored once. Two braces with different colours share their
    buffers. Each link, coordinate and part has a node."""
    robot = assembly(store)
    things = [replace(one, color="#dc143c80") if one.path == "brace_b" else one for one in robot.occurrences]
    tree = tree_of(emit(request(replace(robot, occurrences=tuple(things)), store)), "arm_bench")
    names = [node.name for node in tree.nodes]
    assert names == [
        "arm_bench:world", "base", "plate:visual", "yaw:joint", "servo_a", "servo_a:visual", "brace_a:visual", "hand/lift:joint", "palm",
        "hand/palm:visual", "servo_b:visual", "brace_b:visual", "hand/cap:visual", "motor:visual",
    ]
    parents = {names[child]: node.name for node in tree.nodes for child in node.children or ()}
    assert [parents.get(name) for name in ("arm_bench:world", "base", "yaw:joint", "servo_a", "hand/lift:joint", "palm", "motor:visual")] \
        == [None, "arm_bench:world", "base", "yaw:joint", "servo_a", "hand/lift:joint", "palm"]
    assert tree.scenes[0].nodes == [0] and tree.asset.version == "2.0" and tree.asset.generator == "thingc"
    shown = {node.name: tree.meshes[node.mesh] for node in tree.nodes if node.mesh is not None}
    brace = "arm:Brace(length=0.12)"
    assert [mesh.name for mesh in tree.meshes] == ["arm:Plate", "stock:XM430", brace, "arm:Palm", brace, "arm:Cap", "cad/motor.step"]
    assert shown["servo_a:visual"] is shown["servo_b:visual"]
    one, other = (shown[f"brace_{k}:visual"].primitives[0] for k in "ab")
    assert (one.attributes.POSITION, one.indices) == (other.attributes.POSITION, other.indices) and one.material != other.material
    assert {(a.type, a.count) for a in tree.accessors} == {("VEC3", 8), ("SCALAR", 36)} and len(tree.accessors) <= 12
    joints = {node.name: node.extras for node in tree.nodes if node.name.endswith(":joint")}
    assert joints == {
        "yaw:joint": {"kind": "revolute", "q": 0.0, "lower": -2.0, "upper": 2.0},
        "hand/lift:joint": {"kind": "prismatic", "q": 0.0, "lower": 0.0, "upper": 0.05},
    }


def test_colours_are_linear_with_mjcf_names(store: Store) -> None:
    """Colours follow the definition of the sRGB transfer function: 0xe6 = 230 becomes 0.7913, 0xbc = 188 becomes 0.5029, 0x0a = 10
    becomes 0.0030. Materials have the names used in MJCF."""
    robot = assembly(store)
    things = [replace(one, color="#bc0ae680") if one.path == "plate" else one for one in robot.occurrences]
    shell = robot.occurrences[5].record
    assert shell is not None
    open_ = replace(shell, meshes={"visual": replace(shell.meshes["visual"], closed=False)})
    things[5] = replace(robot.occurrences[5], record=open_)
    things[6] = replace(robot.occurrences[6], color=None)
    tree = tree_of(emit(request(replace(robot, occurrences=tuple(things)), store)), "arm_bench")
    materials = {one.name: one for one in tree.materials}
    assert list(materials) == ["petg_bc0ae680", "color_e6e6fa", "petg_e6e6fa", "petg_e6e6fa:open", "color"]
    plate, light = materials["petg_bc0ae680"], materials["petg_e6e6fa"]
    assert plate.pbrMetallicRoughness.baseColorFactor == pytest.approx([0.5029, 0.0030, 0.7913, 128 / 255], abs=5e-5)
    assert light.pbrMetallicRoughness.baseColorFactor == pytest.approx([0.7913, 0.7913, 0.9560, 1.0], abs=5e-5)
    assert light.pbrMetallicRoughness.metallicFactor == 0.0
    assert [one.alphaMode for one in (plate, light)] == ["BLEND", "OPAQUE"]
    assert [one.doubleSided for one in (light, materials["petg_e6e6fa:open"])] == [False, True]


def test_hidden_parts_have_no_mesh(store: Store) -> None:
    """Parts with `visual: false` have no node with a mesh."""
    robot = assembly(store)
    hidden = replace(robot, occurrences=tuple(
        replace(one, overrides=Overrides(visual=False)) if one.path != "plate" else one for one in robot.occurrences
    ))
    tree = tree_of(emit(request(hidden, store)), "arm_bench")
    assert [node.name for node in tree.nodes if node.mesh is not None] == ["plate:visual"]


def test_robot_without_visuals_has_no_file(store: Store) -> None:
    """A robot without visual geometry produces no file and one export loss."""
    robot = assembly(store)
    bare = replace(robot, occurrences=tuple(replace(one, record=None) for one in robot.occurrences))
    whole = Loss(
        target="glb", mode=None, path="arm", what="the robot has no visual geometry", how="omitted", origin=robot.definition.origin,
    )
    assert emit(request(bare, store)) == Artifacts(files={}, losses=(whole,))


def test_output_is_deterministic_across_processes(store: Store) -> None:
    """Another process with another hash seed writes identical bytes."""
    script = (
        "import hashlib, sys; from thingc.geometry.store.local import Store; from emit.small_robot import assembly, request;"
        "from thingc.targets.glb.emit import emit; s = Store(sys.argv[1]);"
        "print(*(hashlib.sha256(f).hexdigest() for f in emit(request(assembly(s), s)).files.values()))"
    )
    here = " ".join(hashlib.sha256(data).hexdigest() for data in emit(request(assembly(store), store)).files.values())  # type: ignore[arg-type]
    environment = {"PYTHONHASHSEED": "1", "PYTHONPATH": str(Path(small_robot.__file__).parents[1])}
    words = [sys.executable, "-c", script, store.root]
    assert subprocess.run(words, env=environment, check=True, capture_output=True, text=True).stdout.strip() == here


# --- every kind of joint, as MuJoCo has it ----------------------------------------------------------------------------

KINDS = ("revolute", "prismatic", "universal", "ball", "cylindrical", "planar", "screw")
TURN, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


def chain(store: Store) -> EmitRequest:
    """Boxes connected by a joint of every kind at general orientations, with modes rooted at either end and in the middle that start in
    a pose."""
    mesh = kept(store, box_obj(0.1, 0.06, 0.04), 8, 12)
    rng = np.random.default_rng(7)

    def frame() -> Array:
        return t(*rng.uniform(-0.2, 0.2, 3)) @ rz(rng.uniform(-3, 3)) @ ry(rng.uniform(-1, 1)) @ rx(rng.uniform(-3, 3))

    records = [box(f"p:B{k}", mounts={"a": frame(), "b": frame()}) for k in range(len(KINDS) + 1)]
    records = [replace(record, meshes={"visual": mesh}) for record in records]
    things = [component(f"c{k}", record.text) for k, record in enumerate(records)]
    joints = [
        one for k, kind in enumerate(KINDS)
        for one in coordinates_of(f"j{k}", f"c{k}.a", f"c{k + 1}.b", kind, offset=0.2 * (kind == "revolute"))
    ]
    values = {one.name.path: 0.2 + 0.07 * k for k, one in enumerate(joints)}
    modes = [
        mode(f"m{k}", ref(f"c{k}.a"), base, at=frame(), pose="start", poses=("start",))
        for k, base in ((0, "fixed"), (3, "free"), (7, "held"))
    ]
    model = document("chain", things, joints, poses=[pose("start", **values)], modes=modes)
    untouched = replace(model, components=tuple(replace(one, overrides=Overrides(collision="none")) for one in model.components))
    found = linked(untouched, *records, but={Code.FAR})
    return EmitRequest(
        assembly=found, robots=tuple(root(found, one, Report()) for one in found.modes), store=store,  # type: ignore[arg-type]
        geometry=None, workspace=None, report=Report(), verify=False,  # type: ignore[arg-type]
    )


def data_at_start(asked: EmitRequest, name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The MuJoCo model of a mode, with data in the start pose."""
    files = mjcf.emit(asked).files
    assets = {path.rpartition("/")[2]: asked.store.read(file.sha256) for path, file in files.items() if "/assets/" in path}  # type: ignore[union-attr]
    model = mujoco.MjModel.from_xml_string(files[f"mjcf/chain_{name}.xml"].decode(), assets)  # type: ignore[union-attr]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def pose_of(data: mujoco.MjData, body: str) -> Array:
    """World pose of a body in MuJoCo."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = data.body(body).xmat.reshape(3, 3), data.body(body).xpos
    return found


@pytest.mark.parametrize("name", ["m0", "m3", "m7"])
def test_link_poses_match_mujoco(store: Store, name: str) -> None:
    """Node poses of links equal body poses of the MJCF model in the start pose, in modes with three roots."""
    asked = chain(store)
    scene, (model, data) = scene_of(emit(asked), f"chain_{name}"), data_at_start(asked, name)
    for number in range(1, model.nbody):
        link = model.body(number).name
        np.testing.assert_allclose(at(scene, link), Y_UP @ pose_of(data, link), atol=1e-9)


@pytest.mark.parametrize("name", ["m0", "m3", "m7"])
def test_moving_a_joint_node_matches_mujoco(store: Store, name: str) -> None:
    """Rotating a joint node about its z axis, or shifting it along z, moves the same links as MuJoCo's joint by the same amount."""
    asked = chain(store)
    made, (model, data) = emit(asked), data_at_start(asked, name)
    tried = 0
    for number in range(model.njnt):
        path, kind, address = model.joint(number).name, model.jnt_type[number], model.jnt_qposadr[number]
        if kind not in (TURN, SLIDE) or path.startswith("j6"):
            continue
        moved, scene = mujoco.MjData(model), scene_of(made, f"chain_{name}")
        moved.qpos[:], moved.mocap_pos[:], moved.mocap_quat[:] = data.qpos, data.mocap_pos, data.mocap_quat
        moved.qpos[address] += 0.3
        mujoco.mj_forward(model, moved)
        node, parent = f"{path}:joint", scene.graph.transforms.parents[f"{path}:joint"]
        by = rz(0.3) if kind == TURN else t(0, 0, 0.3)
        scene.graph.update(frame_to=node, frame_from=parent, matrix=scene.graph.get(node, parent)[0] @ by)
        for body in range(1, model.nbody):
            link = model.body(body).name
            np.testing.assert_allclose(at(scene, link), Y_UP @ pose_of(moved, link), atol=1e-9)
        tried += 1
    assert tried == 9


def test_ball_joint_is_one_node_at_its_centre(store: Store) -> None:
    """A ball joint is one node, and its origin is the anchor of MuJoCo's joint."""
    asked = chain(store)
    tree = tree_of(emit(asked), "chain_m0")
    joints = {node.name: node.extras for node in tree.nodes if node.name.endswith(":joint")}
    assert list(joints) == [
        "j0:joint", "j1:joint", "j2_0:joint", "j2_1:joint", "j3:joint", "j4_0:joint", "j4_1:joint", "j5_0:joint", "j5_1:joint",
        "j5_2:joint", "j6:joint",
    ]
    assert joints["j3:joint"] == {"kind": "ball", "q": [asked.assembly.poses[0].values[f"j3_{k}"] for k in range(3)]}
    scene, (_, data) = scene_of(emit(asked), "chain_m0"), data_at_start(asked, "m0")
    np.testing.assert_allclose(at(scene, "j3:joint")[:3, 3], (Y_UP[:3, :3] @ data.joint("j3").xanchor), atol=1e-9)


def test_couplings_between_joints_are_losses(store: Store) -> None:
    """Threads of screws, loops, holds and mimics are export losses, because glTF nodes cannot follow other nodes."""
    asked = chain(store)
    screw, closed = asked.robots[0].bodies[-1].joints[0], asked.robots[1]
    loop = Closure(path="close", hold=False, parent=0, child=1, X_PA=Pose(), X_CB=Pose(), joints=(), twists=(), origin=screw.origin)
    held = replace(loop, path="c3/b", hold=True, parent=None)
    follower = asked.robots[2].bodies[-1]
    joint = replace(follower.joints[0], mimic=mimic("j1", 2.0))
    third = replace(asked.robots[2], bodies=(*asked.robots[2].bodies[:-1], replace(follower, joints=(joint,))))
    robots = (asked.robots[0], replace(closed, closures=(held, loop)), third)
    lost = (
        (None, "j6", "the thread: glTF cannot couple the rotation and the translation of a node"),
        ("m3", "c3/b", "the hold of the mount: rotating the nodes of joints moves the held mount"),
        ("m3", "close", "the loop through the joint: rotating the nodes of joints opens the loop"),
        (None, joint.path, "the mimic of `j1`: the node of the joint does not follow the other joint"),
    )
    assert emit(replace(asked, robots=robots)).losses == tuple(
        Loss(target="glb", mode=mode, path=path, what=what, how="omitted", origin=screw.origin) for mode, path, what in lost
    )


# --- asked for --------------------------------------------------------------------------------------------------------


def test_glb_is_not_a_default_target() -> None:
    """A build writes GLB only if `--emit` includes it."""
    assert "glb" not in parse_targets([]) and parse_targets(["glb"]) == ("glb",)


def test_primitive_meshes_have_correct_volume() -> None:
    """Tessellated primitives have the analytic volume within 5 % and the right size. The volume is positive, so triangles face outwards."""
    for shape, size, volume, half in (
        ("box", (0.01, 0.02, 0.03), 8 * 0.01 * 0.02 * 0.03, (0.01, 0.02, 0.03)),
        ("sphere", (0.04,), 4 / 3 * np.pi * 0.04**3, (0.04, 0.04, 0.04)),
        ("ellipsoid", (0.01, 0.02, 0.03), 4 / 3 * np.pi * 0.01 * 0.02 * 0.03, (0.01, 0.02, 0.03)),
        ("cylinder", (0.05, 0.06), np.pi * 0.05**2 * 0.12, (0.05, 0.05, 0.06)),
        ("capsule", (0.05, 0.06), np.pi * 0.05**2 * 0.12 + 4 / 3 * np.pi * 0.05**3, (0.05, 0.05, 0.11)),
    ):
        made = _tessellate(Primitive(shape=shape, size=size, pose=NO_POSE))  # type: ignore[arg-type]
        assert made.volume == pytest.approx(volume, rel=0.05), shape
        np.testing.assert_allclose(made.bounds, [np.negative(half), half], rtol=0.02, err_msg=shape)
