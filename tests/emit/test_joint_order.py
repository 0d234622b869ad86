"""`joint_order.json`: joint orders and indices, compared with MuJoCo models, URDF and USD files and ROS parameters of the same build."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from pxr import Usd, UsdPhysics
from ruamel.yaml import YAML

from emit.test_called import ARM, PAIR, PULLEY
from emit.test_sdf import EVERY
from loops.test_loop_joints import FOURBAR
from thingc.tools.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
MOVES = {"revolute", "continuous", "prismatic"}
SEEDS = range(8)


def random_document(seed: int, *, balls: bool) -> str:
    """A random tree from the conformance benchmark, with its kinds of joints, mimics and bases."""
    sys.path.insert(0, str(ROOT / "benchmarks" / "conformance"))
    try:
        from robots import document  # type: ignore[import-not-found]
    finally:
        sys.path.pop(0)
    return str(document(seed, balls=balls))


def plain_document(seed: int) -> str:
    """A random tree of hinges and slides with drives of each kind and sensors. Every format has each of its joints as one joint."""
    rng = np.random.default_rng(seed)
    count, weight = int(rng.integers(4, 12)), "mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}"
    names = [f"{chr(97 + int(letter))}{k}" for k, letter in enumerate(rng.integers(0, 26, count))]
    lines = ["thingc: assembly/1", f"name: plain_{seed}", "components:"]
    frames = (f"{{xyz: {20 * k} 30 -40 mm, rpy: 10 {7 * k} 30 deg}}" for k in range(count))
    lines += [f"  c{k}: {{frame: true, {weight}, mounts: {{a: {frame}}}}}" for k, frame in enumerate(frames)]
    lines.append("joints:")
    for k in range(1, count):
        kind = rng.choice(("continuous", "prismatic"))
        bounds = ", limit: {lower: -1 m, upper: 1 m}" if kind == "prismatic" else ""
        ends, unit = f"parent: c{int(rng.integers(0, k))}.a, child: c{k}.origin", "N/m" if kind == "prismatic" else "N*m/rad"
        drives = ("", "kind: motor", f"kind: position, kp: 5 {unit}", f"kind: velocity, kv: 2 {unit.replace('/', '*s/')}")
        drive = drives[int(rng.integers(0, 4))]
        lines.append(f"  {names[k]}: {{type: {kind}, {ends}{bounds}{drive and f', drive: {{{drive}}}'}}}")
    lines += ["sensors:", f"  s: {{type: imu, at: c{count - 1}.a}}", f"  {names[1]}: {{type: joint}}", "  t: {type: clock}"]
    lines += ["modes:", *(f"  {base}: {{root: c{int(rng.integers(0, count))}, base: {base}}}" for base in ("fixed", "free", "held"))]
    return "\n".join(lines) + "\n"


BODY = "frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}"
CARRIED = f"""\
thingc: assembly/1
name: carried
components: {{a: {{{BODY}}}, b: {{{BODY}}}, c: {{{BODY}}}, ball: {{{BODY}}}}}
joints:
  two: {{type: continuous, parent: a.origin, child: b.origin}}
  one: {{type: continuous, parent: a.origin, child: c.origin}}
  grasp: {{type: free, parent: c.origin, child: ball.origin}}
modes: {{arm: {{root: b, base: fixed}}, object: {{root: ball, base: free}}}}
"""
"""A robot with an object, which is the root of a mode: the articulation begins at the link of the robot that holds the object."""


class Folder:
    """A build folder and the readers of its files."""

    def __init__(self, base: Path, store: str, files: dict[str, str], *words: str) -> None:
        for name, text in {"thingc.toml": 'thingc = "workspace/1"\n', **files}.items():
            (base / name).write_text(text)
        document = list(files)[-1]
        assert main(["build", str(base / document), "--emit", "mjcf,urdf,ros,usd", "-o", str(base / "out"), "--store", store, *words]) == 0
        (self.path,) = (base / "out").iterdir()
        self.name = self.path.name
        self.content = (self.path / "joint_order.json").read_bytes()
        self.modes: dict[str, Any] = json.loads(self.content)

    def mujoco(self, mode: str) -> Any:
        return mujoco.MjModel.from_xml_path(str(self.path / "mjcf" / f"{self.name}_{mode}.xml"))

    def urdf(self, mode: str) -> list[str]:
        root = ElementTree.parse(self.path / "urdf" / f"{self.name}_{mode}.urdf").getroot()
        return [joint.attrib["name"] for joint in root.findall("joint") if joint.attrib["type"] in MOVES]

    def usd(self, mode: str) -> list[str] | None:
        """Degrees of freedom in the order of the PhysX cache, or None if an articulation joint has a translation besides other axes.

        Links are visited level by level; the children of one parent follow the order of their joints in the stage."""
        stage = Usd.Stage.Open(str(self.path / "usd" / f"{self.name}_{mode}.usda"))
        (base,) = (prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI))
        below: dict[Any, list[tuple[Any, Any]]] = {}
        for prim in stage.Traverse():
            joint = UsdPhysics.Joint(prim)
            if joint and not joint.GetExcludeFromArticulationAttr().Get():
                (parent,), (child,) = joint.GetBody0Rel().GetTargets(), joint.GetBody1Rel().GetTargets()
                below.setdefault(parent, []).append((prim, child))
        names: list[str] = []
        level = [base.GetPath()]
        while level:
            step = [one for link in level for one in below.get(link, ())]
            for prim, _ in step:
                free = [
                    axis for axis in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")
                    if (limit := UsdPhysics.LimitAPI.Get(prim, axis)) and limit.GetLowAttr().Get() <= limit.GetHighAttr().Get()
                ]
                if any(axis.startswith("trans") for axis in free):
                    return None
                if prim.IsA(UsdPhysics.SphericalJoint):
                    free = ["rotX", "rotY", "rotZ"]
                names += [f"{prim.GetName()}:{'XYZ'.index(axis[-1])}" for axis in free] or [prim.GetName()]
            level = [child for _, child in step]
        return names

    def commands(self) -> dict[str, list[str]]:
        """The joints of each controller."""
        (path,) = self.path.glob("ros/*/config/controllers.yaml")
        every = {name: one["ros__parameters"] for name, one in YAML().load(path.read_text()).items()}
        return {name: one["joints"] for name, one in every.items() if "joints" in one}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> dict[str, Folder]:
    """Builds of random trees, of every kind of joint, of nested documents with `names:`, and of a loop."""
    documents = {f"random_{seed}": {"robot.yaml": random_document(seed, balls=seed % 2 == 1)} for seed in SEEDS}
    documents |= {f"plain_{seed}": {"robot.yaml": plain_document(seed)} for seed in SEEDS}
    documents |= {"every": {"robot.yaml": EVERY}, "fourbar": {"robot.yaml": FOURBAR}, "carried": {"robot.yaml": CARRIED}}
    documents["pair"] = {"arm.yaml": ARM.replace("joints:\n", PULLEY + "joints:\n", 1), "robot.yaml": PAIR}
    return {name: Folder(tmp_path_factory.mktemp(name), shared_store, files) for name, files in documents.items()}


def every_mode(built: dict[str, Folder]) -> list[tuple[Folder, str, dict[str, Any]]]:
    return [(folder, mode, order) for folder in built.values() for mode, order in folder.modes.items()]


def test_mujoco_order_matches_the_model(built: dict[str, Folder]) -> None:
    """Names, addresses and sizes of joints, actuators and sensors equal those of the compiled MuJoCo model."""
    for folder, mode, order in every_mode(built):
        model = folder.mujoco(mode)
        assert order["joints"]["mujoco"] == [model.joint(k).name for k in range(model.njnt)]
        assert order["addresses"] == {"qpos": model.jnt_qposadr.tolist(), "qvel": model.jnt_dofadr.tolist()}
        assert order["actuators"]["mujoco"] == [model.actuator(k).name for k in range(model.nu)]
        single = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
        moved = [
            int(target) if kind == int(mujoco.mjtTrn.mjTRN_JOINT) and int(model.jnt_type[target]) in single else None
            for kind, target in zip(model.actuator_trntype, model.actuator_trnid[:, 0], strict=True)
        ]
        assert order["actuators"]["joints"] == moved
        assert order["sensors"] == {
            "mujoco": [model.sensor(k).name for k in range(model.nsensor)], "addresses": model.sensor_adr.tolist(),
            "sizes": model.sensor_dim.tolist(),
        }


def test_urdf_ros_and_isaac_orders_match_the_files(built: dict[str, Folder]) -> None:
    """Joint orders equal those of the URDF, `joint_states`, the articulation in USD, and the ROS controllers."""
    missing = 0
    for folder, mode, order in every_mode(built):
        urdf = folder.urdf(mode)
        assert order["joints"]["urdf"] == urdf
        assert order["joints"]["joint_states"] == sorted(urdf, key=str.encode)
        assert order["joints"].get("isaac") == folder.usd(mode)
        missing += "isaac" not in order["joints"]
        for one in order["actuators"]["ros"]:
            assert order["actuators"]["ros"][one]["joints"] == folder.commands()[one]
    assert 0 < missing < len(every_mode(built)) // 2


def test_isaac_order_matches_robot_doctor(built: dict[str, Folder]) -> None:
    """The order for Isaac Lab equals the order that isaaclab-robot-doctor reports for the USD file."""
    pytest.importorskip("isaaclab_robot_doctor", reason="isaaclab-robot-doctor is not installed: pip install isaaclab-robot-doctor")
    from isaaclab_robot_doctor.checks import CHECKS
    from isaaclab_robot_doctor.loader import load_robot

    for seed in SEEDS:
        folder = built[f"plain_{seed}"]
        for mode, order in folder.modes.items():
            model = load_robot(folder.path / "usd" / f"{folder.name}_{mode}.usda")
            (found,) = (one.message for check in CHECKS for one in check(model) if one.id == "order.joints")
            assert found.partition(": ")[2].partition(" - ")[0].split(", ") == order["joints"]["isaac"]


def test_indices_map_to_the_joint_of_the_same_name(built: dict[str, Folder]) -> None:
    """A value per coordinate of the document arrives at the joint with the same name for every pair of orders."""
    for folder, mode, order in every_mode(built):
        if folder.name == "pair":
            continue
        names = order["joints"]["document"]
        values = np.arange(len(names), dtype=float)
        expected = {name.replace(".", "_").replace("[", "_").replace("]", ""): value for name, value in zip(names, values, strict=True)}
        expected |= {f"root_{k}": -1.0 - k for k in range(3)}  # a planar base, of which the document has no joint
        for one, there in order["indices"].items():
            source = [expected.get(name.replace("/", "_"), np.nan) for name in order["joints"][one]] if one != "document" else values
            for other, indices in there.items():
                assert len(indices) == len(order["joints"][other])
                for name, index in zip(order["joints"][other], indices, strict=True):
                    if index is not None:
                        wanted = expected[name.replace(".", "_").replace("[", "_").replace("]", "").replace("/", "_")]
                        assert source[index] == wanted, (mode, one, other, name)
        for one in order["actuators"]["ros"].values():
            actuated = [order["joints"]["mujoco"][order["actuators"]["joints"][ctrl]] for ctrl in one["ctrl"]]
            assert [name.replace("/", "_") for name in actuated] == one["joints"]


def test_indices_are_complete_for_plain_robots(built: dict[str, Folder]) -> None:
    """For robots of hinges and slides, each map is a permutation. Only the free joint of MuJoCo has no index."""
    for seed in SEEDS:
        for order in built[f"plain_{seed}"].modes.values():
            count, free = len(order["joints"]["document"]), "root" in order["joints"]["mujoco"]
            for one, there in order["indices"].items():
                for other, indices in there.items():
                    first = int(one == "mujoco" and free)
                    assert sorted(index for index in indices if index is not None) == list(range(first, first + count))
                    assert indices.count(None) == (free if other == "mujoco" else 0)


def test_urdf_order_reproduces_mujoco_link_poses(built: dict[str, Folder]) -> None:
    """MuJoCo loads the URDF. Positions permuted by the indices give the same link poses as in the MJCF model."""
    rng = np.random.default_rng(7)
    for seed in SEEDS:
        folder = built[f"plain_{seed}"]
        for mode, order in folder.modes.items():
            model, other = folder.mujoco(mode), mujoco.MjModel.from_xml_path(str(folder.path / "urdf" / f"{folder.name}_{mode}.urdf"))
            one, two = mujoco.MjData(model), mujoco.MjData(other)
            values = rng.uniform(-0.9, 0.9, model.njnt)
            for address, value, name in zip(order["addresses"]["qpos"], values, order["joints"]["mujoco"], strict=True):
                if name != "root":
                    one.qpos[address] = value
            for name, value in zip(order["joints"]["urdf"], values[order["indices"]["mujoco"]["urdf"]], strict=True):
                two.joint(name).qpos = value
            mujoco.mj_kinematics(model, one)
            mujoco.mj_kinematics(other, two)
            bodies = {other.body(k).name for k in range(other.nbody)}
            links = [model.body(k).name for k in range(1, model.nbody)]
            named = [f"{link}_frame" if f"{link}_frame" in bodies else link for link in links]
            first = {0: one.body(links[0]), 1: two.body(named[0])}
            for link, name in zip(links, named, strict=True):
                away = [
                    root.xmat.reshape(3, 3).T @ (body.xpos - root.xpos)
                    for root, body in ((first[0], one.body(link)), (first[1], two.body(name)))
                ]
                assert away[0] == pytest.approx(away[1], abs=1e-9)


def test_orders_use_the_names_of_each_format(built: dict[str, Folder]) -> None:
    """With `names:`, each order contains the joint names of its format, and the indices still match."""
    for order in built["pair"].modes.values():
        assert {*order["joints"]["document"]} == {"left.elbow", "left.follower", "right.elbow", "right.follower"}
        assert {*order["joints"]["mujoco"]} == {"left/2", "left/follower", "right/2", "right/follower"}
        assert {*order["joints"]["isaac"]} == {"left_elbow", "left_follower", "right_elbow", "right_follower"}
        of_document = [order["joints"]["document"][index].replace(".", "_") for index in order["indices"]["document"]["isaac"]]
        assert of_document == order["joints"]["isaac"]
        names = [order["joints"]["mujoco"][index] for index in order["indices"]["mujoco"]["isaac"]]
        of_mujoco = [name.replace("2", "elbow").replace("/", "_") for name in names]
        assert of_mujoco == order["joints"]["isaac"]


def test_cut_joint_of_a_loop_has_no_index(built: dict[str, Folder]) -> None:
    """The joint where a loop is cut appears only in the document order; its index is null elsewhere."""
    for order in built["fourbar"].modes.values():
        (cut,) = {*order["joints"]["document"]} - {*order["joints"]["mujoco"]}
        place = order["joints"]["document"].index(cut)
        assert all(there["document"][place] is None for one, there in order["indices"].items() if one != "document")


@pytest.mark.parametrize("target", ["urdf", "usd", "sdf", "mjz"])
def test_file_does_not_depend_on_emitted_targets(tmp_path: Path, shared_store: str, built: dict[str, Folder], target: str) -> None:
    """Every robot target writes the same `joint_order.json`. A build with only the bill of materials does not write it."""
    folder = built["every"]
    (tmp_path / "robot.yaml").write_text(EVERY)
    assert main(["build", str(tmp_path / "robot.yaml"), "--emit", target, "-o", str(tmp_path / "out"), "--store", shared_store]) == 0
    assert (tmp_path / "out" / "every" / "joint_order.json").read_bytes() == folder.content
    assert main(["build", str(tmp_path / "robot.yaml"), "--emit", "bom", "-o", str(tmp_path / "bom"), "--store", shared_store]) == 0
    assert not (tmp_path / "bom" / "every" / "joint_order.json").exists()


RAW = """thingc: assembly/1
name: r
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  arm: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
joints: {j: {type: continuous, parent: base.origin, child: arm.origin, drive: {kind: motor}}}
sensors: {t: {type: clock}, g: {type: gyro, at: arm.origin}}
modes: {m: {root: base}}
raw:
  mjcf:
    order: {sensor: ["g:gyro", last]}
    add:
      actuator: [{general: {name: extra, joint: j}}, {motor: {name: inside, jointinparent: j}}]
      sensor: [{user: {name: own, dim: 5}}, {jointpos: {name: last, joint: j}}]
"""


def test_raw_elements_are_included(tmp_path: Path, shared_store: str) -> None:
    """Actuators and sensors from `raw` are listed in the model's order. A size or address that is unknown is null."""
    folder = Folder(tmp_path, shared_store, {"robot.yaml": RAW})
    model, order = folder.mujoco("m"), folder.modes["m"]
    assert order["actuators"]["mujoco"] == [model.actuator(k).name for k in range(model.nu)] == ["j", "extra", "inside"]
    assert order["actuators"]["joints"] == model.actuator_trnid[:, 0].tolist() == [0, 0, 0]
    names = [model.sensor(k).name for k in range(model.nsensor)]
    assert order["sensors"]["mujoco"] == names and len(names) == 4
    for name, address, size in zip(names, order["sensors"]["addresses"], order["sensors"]["sizes"], strict=True):
        if address is not None:
            assert address == model.sensor(name).adr[0]
        if size is not None:
            assert size == model.sensor(name).dim[0]
    assert order["sensors"]["sizes"][names.index("own")] is None and order["sensors"]["addresses"][names.index("own")] is not None


def test_sensor_sizes_match_mujoco() -> None:
    """Each sensor element of the size table is compiled in its own MuJoCo model."""
    from thingc.targets.joint_order import SENSOR_SIZES

    objects = {
        **dict.fromkeys(("accelerometer", "velocimeter", "gyro", "force", "torque", "magnetometer", "rangefinder"), 'site="s"'),
        "touch": 'site="s"', "ballangvel": 'joint="b"', "ballquat": 'joint="b"', "clock": "", "e_potential": "", "e_kinetic": "",
        "camprojection": 'site="s" camera="c"', "insidesite": 'objtype="site" objname="s" site="s"',
        **dict.fromkeys(("distance", "normal", "fromto"), 'geom1="g" geom2="h"'),
    }
    for tag, size in SENSOR_SIZES.items():
        words = objects.get(tag)
        if words is None:
            words = 'objtype="site" objname="s"' if tag.startswith("frame") else 'body="a"' if tag.startswith("subtree") else None
        if words is None:
            kind = next(kind for kind in ("jointactuator", "joint", "tendonactuator", "tendon", "actuator") if tag.startswith(kind))
            words = {"jointactuator": 'joint="j"', "tendonactuator": 'tendon="t"'}.get(kind) or f'{kind}="{kind[0]}"'
        text = f"""<mujoco><worldbody><camera name="c" resolution="9 9"/><geom name="h" size="1" pos="9 0 0"/>
          <body name="a"><joint name="j" range="0 1" limited="true"/><geom name="g" size="1"/><site name="s"/>
          <body><joint name="b" type="ball"/><geom size="1"/></body></body></worldbody>
          <tendon><fixed name="t" range="0 1" limited="true"><joint joint="j" coef="1"/></fixed></tendon>
          <actuator><motor name="a" joint="j"/></actuator><sensor><{tag} name="x" {words}/></sensor></mujoco>"""
        assert mujoco.MjModel.from_xml_string(text).sensor("x").dim[0] == size, tag
