"""`keep: true`: the same robot with and without it in every mode and format, compared by MuJoCo trajectories, `thingc same` and readers
of other formats."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import Array, Built, compiled, pose_of
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.modes import Modes
from thingc.tools.same.mechanism import mechanism_of_assembly, mechanism_of_mode

BALL = "inertia: {ixx: 1e-3 kg*m^2, iyy: 2e-3 kg*m^2, izz: 1.5e-3 kg*m^2}"
FINGER = f"""\
thingc: assembly/1
name: finger
components:
  bone: {{frame: true, mass: 300 g, com: 0 20 10 mm, {BALL}, mounts: {{end: {{xyz: 0 0 80 mm, rpy: 0 30 0 deg}}}}}}
  pad: {{link: true, mass: 50 g, com: 1 2 3 mm, {BALL}, shapes: [{{box: 20 20 10 mm}}], attach: {{origin: bone.end}}, KEEP}}
links: {{pad: pad}}
mounts: {{base: bone.origin, touch: pad.origin}}
"""
HAND = f"""\
thingc: assembly/1
name: hand
components:
  arm: {{frame: true, mass: 1 kg, com: 0 0 100 mm, {BALL}, mounts: {{end: {{xyz: 0 10 200 mm, rpy: 20 0 40 deg}}}}}}
  sensor: {{link: true, mass: 200 g, com: 5 0 10 mm, {BALL}, shapes: [{{sphere: {{radius: 20 mm}}}}],
    mounts: {{out: {{xyz: 0 0 30 mm, rpy: 0 10 5 deg}}, side: {{xyz: 30 0 0 mm, rpy: 0 90 0 deg}}}}}}
  palm: {{frame: true, mass: 500 g, {BALL}, mounts: {{a: {{xyz: 0 50 40 mm, rpy: -20 0 0 deg}}, b: {{xyz: 0 -50 40 mm, rpy: 20 0 0 deg}}}}}}
  tip: {{frame: true, at: {{in: arm.end, xyz: 10 0 0 mm, rpy: 0 0 90 deg}}, KEEP}}
  left: {{assembly: finger.yaml}}
  right: {{assembly: finger.yaml, mirror: y}}
  tail: {{frame: true, mass: 100 g, {BALL}, mounts: {{far: {{xyz: 0 0 90 mm}}}}}}
  knob: {{frame: true, mass: 40 g, {BALL}, attach: {{origin: tail.far}}, KEEP}}
joints:
  elbow: {{type: fixed, parent: arm.end, child: sensor.origin, gap: 5 mm, turn: 30 deg, KEEP}}
  wrist: {{type: revolute, parent: sensor.out, child: palm.origin, limit: {{lower: -2 rad, upper: 2 rad}},
    dynamics: {{damping: 0.1 N*m*s/rad}}, drive: {{kind: position, kp: 3 N*m/rad}}}}
  open_left: {{type: revolute, parent: palm.a, child: left.base, limit: {{lower: -1 rad, upper: 1 rad}}}}
  open_right: {{type: ball, parent: palm.b, child: right.base}}
  wag: {{type: universal, parent: sensor.side, child: tail.origin}}
links: {{knob: knob}}
sensors:
  load: {{type: force, at: sensor.origin}}
poses:
  bent: {{wrist: 0.4 rad, open_left: 0.3 rad, wag: [0.2 rad, -0.5 rad]}}
modes:
  bench: {{root: arm, pose: bent}}
  by_sensor: {{root: sensor, pose: bent}}
  by_tip: {{root: tip, base: held, pose: bent}}
  by_pad: {{root: left.touch, pose: bent, base: free}}
  by_knob: {{root: knob, pose: bent, base: free}}
"""
KEPT = ["left/bone", "right/bone", "sensor", "tail", "tip"]
"""The additional links."""


def hand(folder: Path, keep: str) -> Built:
    folder.mkdir()
    documents = {"robot.yaml": HAND, "finger.yaml": FINGER}
    made = compiled(folder, {name: text.replace("KEEP", keep) for name, text in documents.items()})
    assert {code for code, *_ in made.said} <= {"TC522", "TC792"}, made.said  # round numbers for masses and inertias
    return made


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Built, Built]:
    folder = tmp_path_factory.mktemp("hand")
    return hand(folder / "plain", "keep: false"), hand(folder / "kept", "keep: true")


def bodies(data: mujoco.MjData, names: list[str]) -> Array:
    return np.array([[*data.body(name).xpos, *data.body(name).xmat] for name in names])


@pytest.mark.parametrize("mode", ["bench", "by_sensor", "by_tip", "by_pad", "by_knob"])
def test_trajectories_are_equal(both: tuple[Built, Built], mode: str) -> None:
    """Links of the plain robot are also links of the other one with equal frames, so free bases are integrated equally."""
    plain, kept = (built.model(mode) for built in both)
    assert kept.nbody == plain.nbody + len(KEPT) and (kept.nq, kept.nv) == (plain.nq, plain.nv)
    states = []
    for built, model in zip(both, (plain, kept), strict=True):
        modes, data = Modes.parse(built.text("modes.json")), mujoco.MjData(model)
        v = {joint.name: 0.8 - 0.3 * k for k, joint in enumerate(sorted(modes[mode].joints, key=lambda joint: joint.name))}
        modes.write(modes[mode].state("bent", v=v), data)
        for _ in range(200):
            mujoco.mj_step(model, data)
        states.append((data, modes.read(mode, data)))
    (one, state), (other, found) = states
    assert dict(found.q) == pytest.approx(dict(state.q), abs=1e-12)
    assert dict(found.v) == pytest.approx(dict(state.v), abs=1e-12) and max(map(abs, state.v.values())) > 0.1
    same = [plain.body(number).name for number in range(1, plain.nbody)]
    assert np.abs(bodies(one, same) - bodies(other, same)).max() < 1e-12


def test_mode_switches_are_equal(both: tuple[Built, Built]) -> None:
    """Poses, twists and mass matrices of the common links, after switches through all modes."""
    plain, kept = (Modes.parse(built.text("modes.json")) for built in both)
    rng = np.random.default_rng(1)
    joints = [joint.name for joint in plain["bench"].joints]
    q, v = ({name: float(rng.uniform(-0.9, 0.9)) for name in joints} for _ in range(2))
    one, other = (modes["by_pad"].state(q=q, v=v, base_twist=np.arange(6.0)) for modes in (plain, kept))
    for mode in ("by_knob", "by_pad", "by_knob"):
        one, other = (modes.switch(state, mode, on_motion="impact").state for modes, state in ((plain, one), (kept, other)))
        assert dict(other.q) == pytest.approx(dict(one.q), abs=1e-12)
        for found, wanted in ((kept[mode].poses(other), plain[mode].poses(one)), (kept[mode].twists(other), plain[mode].twists(one))):
            assert wanted.keys() <= found.keys() and len(found) == len(wanted) + len(KEPT)
            for link, value in wanted.items():
                assert found[link] == pytest.approx(value, abs=1e-12), link
        order = [joint.name for joint in plain[mode].joints]
        mine = [joint.name for joint in kept[mode].joints]
        rows = [*range(6), *(6 + mine.index(name) for name in order)]
        M = kept[mode].mass_matrix(other)[np.ix_(rows, rows)]
        assert pytest.approx(plain[mode].mass_matrix(one), abs=1e-12) == M


@pytest.mark.parametrize("mode", ["bench", "by_sensor", "by_pad"])
def test_modes_json_matches_mujoco(both: tuple[Built, Built], mode: str) -> None:
    _, kept = both
    modes = Modes.parse(kept.text("modes.json"))
    model = kept.model(mode)
    data = mujoco.MjData(model)
    state = modes[mode].state("bent")
    modes.write(state, data)
    mujoco.mj_forward(model, data)
    for link, X in modes[mode].poses(state).items():
        assert data.body(link).xpos == pytest.approx(X[:3, 3], abs=1e-12), link
        assert data.body(link).xmat.reshape(3, 3) == pytest.approx(X[:3, :3], abs=1e-12), link
    own = modes.inertias(mode, data)
    assert own.mass == pytest.approx([link.mass for link in modes[mode].links])


def test_force_sensor_measures_at_the_fixed_joint(both: tuple[Built, Built]) -> None:
    """The sensor measures the force that accelerates and carries all bodies beyond its fixed joint."""
    _, kept = both
    model = kept.model("bench")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    carried, J = model.body("sensor").id, np.zeros((3, model.nv))
    mujoco.mj_jacSubtreeCom(model, data, J, carried)
    mass = model.body_subtreemass[carried]
    assert mass == pytest.approx(0.2 + 0.5 + 2 * 0.35 + 0.14)
    force = data.site("sensor/origin").xmat.reshape(3, 3) @ data.sensor("load:force").data
    assert force == pytest.approx(mass * (J @ data.qacc + [0.0, 0.0, 9.81]), abs=1e-9)
    assert [loss.path for loss in kept.losses(None) + kept.losses("bench") if loss.path == "load"] == []


def test_mechanism_is_equal(both: tuple[Built, Built]) -> None:
    plain, kept = (built.compilation.assembly for built in both)
    assert plain is not None and kept is not None
    assert [link.name for link in kept.links if link.name not in {one.name for one in plain.links}] != []
    one, other = mechanism_of_assembly(plain), mechanism_of_assembly(kept)
    assert len(one.links) == len(other.links) == len(mechanism_of_mode("bench", Modes.parse(both[1].text("modes.json"))["bench"]).links)
    assert sum(link.properties.mass for link in one.links) == pytest.approx(sum(link.properties.mass for link in other.links))


def test_contacts_are_equal(both: tuple[Built, Built]) -> None:
    """In states with overlapping shapes, MuJoCo finds the same contacts."""
    rng, found = np.random.default_rng(5), 0
    for mode in ("bench", "by_pad"):
        models = [built.model(mode) for built in both]
        modes = [Modes.parse(built.text("modes.json"))[mode] for built in both]
        for _ in range(200):
            q = {joint.name: float(rng.uniform(-3, 3)) for joint in modes[0].joints}
            touching = []
            for model, own in zip(models, modes, strict=True):
                data = mujoco.MjData(model)
                Modes({mode: own}).write(own.state(q=q), data)
                mujoco.mj_forward(model, data)
                touching.append({frozenset(model.geom(int(geom)).name for geom in pair) for pair in data.contact.geom})
            assert touching[0] == touching[1]
            found += len(touching[0])
    assert found > 1


def test_other_formats_have_the_fixed_joints(tmp_path: Path) -> None:
    """MuJoCo loads the URDF file of every mode with the same poses. SDF and USD have a fixed joint for each separate link."""
    for name, text in (("robot.yaml", HAND), ("finger.yaml", FINGER), ("thingc.toml", 'thingc = "workspace/1"\n')):
        tmp_path.joinpath(name).write_text(text.replace("KEEP", "keep: true"))
    with Environment(str(tmp_path / "robot.yaml"), Options(store=str(tmp_path / "store"))) as environment:
        made = pipeline.build(environment, pipeline.compile(environment), ["mjcf", "urdf", "sdf", "usd"])
    files = {path: content for one in made.values() for path, content in one.files.items()}
    for mode in ("bench", "by_sensor", "by_tip", "by_pad", "by_knob"):
        mjcf, urdf = (
            mujoco.MjModel.from_xml_string(text.decode()) for path in (f"mjcf/hand_{mode}.xml", f"urdf/hand_{mode}.urdf")
            if isinstance(text := files[path], bytes)
        )
        data, other = mujoco.MjData(mjcf), mujoco.MjData(urdf)
        mujoco.mj_forward(mjcf, data)
        mujoco.mj_forward(urdf, other)
        names = [mjcf.body(number).name for number in range(1, mjcf.nbody)]
        links = {urdf.body(number).name for number in range(urdf.nbody)}
        frames = [f"{name.replace('/', '_')}_frame" for name in names]
        frames = [frame if frame in links else frame.removesuffix("_frame") for frame in frames]
        ours, theirs = ([pose_of(one.body(name)) for name in own] for one, own in ((data, names), (other, frames)))
        for X, Y in zip(ours, theirs, strict=True):
            assert np.linalg.inv(theirs[0]) @ Y == pytest.approx(np.linalg.inv(ours[0]) @ X, abs=1e-12)
    fixed = ["elbow", "tip_fixed", "left_pad_fixed", "right_pad_fixed", "knob_fixed"]
    patterns = {"sdf/hand_by_tip/model.sdf": '<joint name="{}" type="fixed">', "usd/hand_by_tip.usda": 'PhysicsFixedJoint "{}"'}
    for path, pattern in patterns.items():
        text = files[path]
        assert isinstance(text, bytes) and all(pattern.format(name).encode() in text for name in fixed)
