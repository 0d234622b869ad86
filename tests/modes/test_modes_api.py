"""The modes API: data that a switch transfers, scenes with other objects, and error messages."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

import thingc
from graph.builder import assembly, box, component, joint, linked, mode, pose, rx, t, whole
from modes.switching_robots import Made, driven, emitted, same_motion, stir
from thingc.model.assembly.types import Adhesion, Assembly
from thingc.model.resolve.types import Drive
from thingc.modes import Modes, ModesError, RobotState, UnknownMode, WrongData


def crawler() -> Assembly:
    """Three boxes in a row with a magnet under each end; `knee` and `ankle` are driven."""
    drive = Drive(component=None, kind="position", kp=20.0, kv=0.1, effort=5.0)
    ends = {"a": t(0.1, 0, 0) @ rx(np.pi / 2), "b": t(-0.1, 0, 0) @ rx(np.pi / 2), "sole": rx(np.pi)}
    found = linked(
        assembly(
            "crawler", [component(name, f"p:{name}") for name in ("front", "body", "rear")],
            [joint("knee", "front.a", "body.b", drive=drive), joint("ankle", "body.a", "rear.b", drive=drive)],
            modes=[
                mode(name, whole(root), base, poses=("arched",))
                for name, root, base in (
                    ("crawl", "body", "free"), ("front", "front", "held"), ("rear", "rear", "held"), ("bolted", "front", "fixed"),
                )
            ],
            poses=[pose("arched", knee=0.4, ankle=-0.7)],
        ),
        *(box(f"p:{name}", mounts=ends) for name in ("front", "body", "rear")),
    )
    magnets = tuple(
        Adhesion(path=f"{name}/sole", occurrence=number, mount="sole", pose=found.occurrences[number].mounts["sole"].pose, force=300.0)
        for number, name in ((0, "front"), (2, "rear"))
    )
    return driven(replace(found, adhesions=magnets), front=("ankle",))


@pytest.fixture(scope="module")
def made() -> Made:
    return emitted(crawler())


def test_controls_are_transferred_by_name(made: Made) -> None:
    """`front` has no drive at the knee, so the addresses differ."""
    one, other = made.data("crawl"), made.data("front")
    assert [one.model.actuator(k).name for k in range(one.model.nu)] == ["knee", "ankle", "front/sole", "rear/sole"]
    assert [other.model.actuator(k).name for k in range(other.model.nu)] == ["ankle", "front/sole", "rear/sole"]
    one.ctrl[:] = [0.1, -0.2, 300.0, 120.0]
    one.time = 3.25
    switched = made.modes.switch(("crawl", one), ("front", other))
    assert other.ctrl.tolist() == [-0.2, 300.0, 120.0] and other.time == 3.25 and switched.uncommanded == ()
    back = made.data("crawl")
    back.ctrl[:] = 0.7
    switched = made.modes.switch(("front", other), ("crawl", back))
    assert back.ctrl.tolist() == [0.7, -0.2, 300.0, 120.0] and switched.uncommanded == ("knee",)


def with_activations(made: Made, name: str, *actuators: str) -> mujoco.MjData:
    """The model of a mode with drives that have an activation state."""
    spec = mujoco.MjSpec.from_string(made.xml[name])
    for actuator in actuators:
        spec.actuator(actuator).dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
        spec.actuator(actuator).dynprm[0] = 0.05
    return mujoco.MjData(spec.compile())


def test_activations_are_transferred_by_name(made: Made) -> None:
    one, other = with_activations(made, "crawl", "knee", "ankle", "rear/sole"), with_activations(made, "front", "ankle", "rear/sole")
    one.act[:] = [0.1, 0.2, 0.3]
    made.modes.switch(("crawl", one), ("front", other))
    assert other.act.tolist() == [0.2, 0.3]
    back = with_activations(made, "crawl", "knee", "ankle", "rear/sole")
    made.modes.switch(("front", other), ("crawl", back))
    assert back.act.tolist() == [0.0, 0.2, 0.3]


def test_missing_activations_are_unchanged(made: Made) -> None:
    one, other = with_activations(made, "crawl", "ankle"), made.data("front")
    one.act[:] = 0.2
    made.modes.switch(("crawl", one), ("front", other))
    back = with_activations(made, "crawl", "ankle")
    back.act[:] = 0.9
    made.modes.switch(("front", other), ("crawl", back))
    assert back.act.tolist() == [0.9]


UNEXPECTED = """
    <body name="ball" pos="1 2 3"><freejoint name="ball"/><geom size="0.1"/></body>
    <body name="puppet" mocap="true"><geom size="0.1"/></body>
"""


def scene_with_other_bodies(made: Made, name: str) -> mujoco.MjData:
    """The robot after a ball and a mocap body, which shift all its addresses."""
    text = re.sub("<keyframe>.*</keyframe>", "", made.xml[name], flags=re.DOTALL)
    return mujoco.MjData(mujoco.MjModel.from_xml_string(text.replace("<worldbody>", "<worldbody>" + UNEXPECTED)))


def test_scene_may_contain_other_bodies(made: Made) -> None:
    rng = np.random.default_rng(5)
    one, other = scene_with_other_bodies(made, "crawl"), scene_with_other_bodies(made, "front")
    assert one.model.joint("knee").qposadr[0] > 7 and one.model.joint("root").qposadr[0] == 7
    state = made.modes["crawl"].state("arched", base_pose=t(0.3, 0.2, 0.1) @ rx(0.4))
    made.modes.write(state, one)
    for data in (one, other):
        data.joint("ball").qpos, data.joint("ball").qvel = rng.normal(size=7), rng.normal(size=6)
        data.mocap_pos[:], data.mocap_quat[:] = 0.5, 0.5
    ball = other.joint("ball").qpos.copy(), other.joint("ball").qvel.copy()
    made.modes.switch(("crawl", one), ("front", other))
    assert (other.joint("ball").qpos == ball[0]).all() and (other.joint("ball").qvel == ball[1]).all()
    assert (other.mocap_pos[other.model.body("puppet").mocapid[0]] == 0.5).all()
    poses = made.modes["crawl"].poses(state)
    mujoco.mj_forward(other.model, other)
    for link, X in poses.items():
        np.testing.assert_allclose(other.body(link).xpos, X[:3, 3], atol=1e-12)
        np.testing.assert_allclose(other.body(link).xmat.reshape(3, 3), X[:3, :3], atol=1e-12)


def test_write_changes_only_the_motion(made: Made) -> None:
    data = made.data("front")
    data.time, data.ctrl[:], data.qacc_warmstart[:] = 1.5, 0.25, 3.0
    made.modes.write(made.modes["front"].state("arched", v={"knee": 0.5}), data)
    assert data.time == 1.5 and (data.ctrl == 0.25).all() and (data.qacc_warmstart == 3.0).all()
    assert data.joint("knee").qpos[0] == 0.4 and data.joint("knee").qvel[0] == 0.5 and data.joint("ankle").qpos[0] == -0.7


def test_solver_warmstart_is_transferred(made: Made) -> None:
    one, other = stir(np.random.default_rng(1), made.data("front")), made.data("crawl")
    mujoco.mj_step(one.model, one)
    other.qacc_warmstart[:] = 7.0
    made.modes.switch(("front", one), ("crawl", other))
    for name in ("knee", "ankle"):
        assert other.joint(name).qacc_warmstart[0] == one.joint(name).qacc_warmstart[0] != 0.0
    assert not other.joint("root").qacc_warmstart.any()


def test_states_work_without_simulation(made: Made) -> None:
    """From a named pose to the state of another mode and the poses of its links."""
    robot = made.modes
    start = robot["bolted"].state("arched", v={"knee": 0.3})
    crawl = robot.switch(start, "crawl").state
    one, other = made.data("bolted"), made.data("crawl")
    robot.write(start, one)
    robot.write(crawl, other)
    same_motion(one, other)
    assert crawl.mode == "crawl" and dict(crawl.q) == {"knee": 0.4, "ankle": -0.7}
    poses = robot["bolted"].poses(start)
    for link, X in robot["crawl"].poses(crawl).items():
        np.testing.assert_allclose(X, poses[link], atol=1e-12)
    assert np.array_equal(robot["crawl"].qvel(crawl), other.qvel)


def test_state_is_immutable(made: Made) -> None:
    state = made.modes["crawl"].state()
    with pytest.raises(ValueError):
        state.base_pose[0, 0] = 2.0
    with pytest.raises(TypeError):
        state.q["knee"] = 1.0  # type: ignore[index]
    with pytest.raises(AttributeError):
        state.mode = "front"  # type: ignore[misc]


def test_modes_is_a_mapping(made: Made) -> None:
    robot = made.modes
    assert list(robot) == ["crawl", "front", "rear", "bolted"] and "front" in robot and "hind" not in robot and len(robot) == 4
    assert repr(robot) == "Modes(crawl, front, rear, bolted)"
    mode = robot["front"]
    assert (mode.name, mode.root, mode.base, mode.root_link) == ("front", "front/origin", "held", "front")
    assert mode.gravity.tolist() == [0, 0, -9.81] and dict(mode.named) == {"arched": {"knee": 0.4, "ankle": -0.7}}
    assert [(joint.name, joint.kind, joint.reversed) for joint in robot["rear"].joints] == [
        ("ankle", "revolute", True), ("knee", "revolute", True),
    ]


def test_modes_load_from_folder_file_and_text(made: Made, tmp_path: Path) -> None:
    (tmp_path / "modes.json").write_bytes(made.described)
    for path in (tmp_path, str(tmp_path), tmp_path / "modes.json"):
        assert list(Modes.load(path)) == list(made.modes)
    assert list(Modes.parse(made.described.decode())) == list(made.modes)
    assert thingc.modes.Modes is Modes


WRONG: dict[str, tuple[Callable[[Made], object], type[Exception], str]] = {
    "an unknown mode": (lambda made: made.modes["frnt"], UnknownMode, "the robot has no mode `frnt`: did you mean `front`?"),
    "an unknown target": (
        lambda made: made.modes.switch(("crawl", made.data("crawl")), "walk"), UnknownMode,
        "the robot has no mode `walk`: known modes: `bolted`, `crawl`, `front`, `rear`",
    ),
    "data of another mode": (
        lambda made: made.modes.read("front", made.data("crawl")), WrongData,
        "expected data of mode `front` with a held base `front`, found data of another mode with the base `body`",
    ),
    "data of a mode that holds another link": (
        lambda made: made.modes.switch(("crawl", made.data("crawl")), ("front", made.data("rear"))), WrongData,
        "expected data of mode `front` with a held base `front`, found data of another mode with the base `rear`",
    ),
    "a base of another kind": (
        lambda made: made.modes.read("bolted", made.data("front")), WrongData,
        "expected data of mode `bolted` with a fixed base `front`, found data of another mode with the base `front`",
    ),
    "data of another robot": (
        lambda made: made.modes.read("front", mujoco.MjData(mujoco.MjModel.from_xml_string("<mujoco/>"))), WrongData,
        "the model of the data for mode `front` has no link `front`",
    ),
    "a base that moves": (
        lambda made: made.modes.switch(made.modes["crawl"].state(base_twist=[0.3, 0.4, 0, 0, 0, 0]), "front"), ModesError,
        "link `front` must not move in mode `front`, found 0.5 m/s and 0 rad/s: use "
        "on_motion=\"drop\" or on_motion=\"impact\"",
    ),
    "a base that is elsewhere": (
        lambda made: made.modes.switch(made.modes["front"].state(base_pose=t(0, 0, 0.25) @ rx(0.5)), "bolted"), ModesError,
        "link `front` is 0.25 m and 0.5 rad away from its fixed pose in mode `bolted` (tolerance: 1e-06): move the link, "
        "or use `base: held`",
    ),
    "an unknown choice": (
        lambda made: made.modes.switch(made.modes["front"].state(), "rear", on_motion="stop"), ModesError,  # type: ignore[arg-type]
        'expected on_motion "raise", "drop" or "impact", found `stop`',
    ),
    "an unknown pose": (
        lambda made: made.modes["front"].state("arch"), ModesError, "mode `front` has no pose `arch`: did you mean `arched`?",
    ),
    "an unknown joint": (
        lambda made: made.modes["front"].state(q={"kne": 1.0}), ModesError, "the robot has no joint `kne`: did you mean `knee`?",
    ),
    "a state of another mode": (
        lambda made: made.modes["front"].poses(made.modes["rear"].state()), ModesError,
        "expected a state of mode `front`, found a state of mode `rear`: call `switch` first",
    ),
    "a state without a joint": (
        lambda made: made.modes["front"].poses(dataclasses.replace(made.modes["front"].state(), v={"knee": 0.0})), ModesError,
        "the state has no `v` of joint `ankle`",
    ),
    "a twist of three numbers": (
        lambda made: made.modes["front"].state(base_twist=[1, 2, 3]), ModesError,
        "expected `base_twist` of shape (6,), found (3,)",
    ),
    "a number that is none": (
        lambda made: made.modes["front"].state(q={"knee": float("nan")}), ModesError, "`q` has numbers that are not finite",
    ),
    "no file": (
        lambda made: Modes.load("nowhere"), FileNotFoundError, "there is no `nowhere`: run `thingc build` to create it",
    ),
    "no JSON": (
        lambda made: Modes.parse("{"), ModesError,
        "`modes.json` is not a modes.json of thingc: Expecting property name enclosed in double quotes: line 1 column 2 (char 1)",
    ),
    "something else": (
        lambda made: Modes.parse("[1]"), ModesError,
        "`modes.json` is not a modes.json of thingc: 'list' object has no attribute 'items'",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_error_messages(made: Made, case: str) -> None:
    wrong, kind, text = WRONG[case]
    with pytest.raises(kind) as found:
        wrong(made)
    assert str(found.value) == text


def test_file_of_another_version_is_rejected(made: Made) -> None:
    described = json.loads(made.described)
    del described["crawl"]["links"][0]["mass"]
    with pytest.raises(ModesError) as found:
        Modes.parse(json.dumps(described))
    assert str(found.value) == "`modes.json` has no 'mass', which this version of thingc requires: build the robot again"
    described = json.loads(made.described)
    described["crawl"]["version"] = 1
    with pytest.raises(ModesError) as found:
        Modes.parse(json.dumps(described))
    assert str(found.value) == "mode `crawl` was written by another version of thingc: build the robot again"


def test_import_loads_only_numpy_and_msgspec() -> None:
    def loaded(module: str) -> set[str]:
        program = f"import sys, json, {module}; print(json.dumps(sorted({{n.partition('.')[0] for n in sys.modules}})))"
        return set(json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout))

    assert loaded("thingc.modes") - loaded("numpy, msgspec") - set(sys.stdlib_module_names) == {"thingc"}


def test_states_compare_by_identity(made: Made) -> None:
    state = made.modes["crawl"].state()
    assert isinstance(state, RobotState) and state == state and state != made.modes["crawl"].state()
