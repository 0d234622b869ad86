"""Robots on their feet: least squares within friction cones, compared with balances computed from MuJoCo's Jacobians and with MuJoCo
simulations of the robot on its floor.

The hexapod of `hexapod/` has 1.3 kg; in `tripod` three of its legs stand."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copytree
from typing import Any

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace
from scipy.optimize import linprog, minimize

from statics.test_statics import at_rest, oracle
from thingc.batch.measurements import measure
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.model.assembly.kinematics import joints_of
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot
from thingc.model.statics.efforts import static_efforts
from thingc.model.statics.support import lifted_feet, stance
from thingc.model.statics.types import Efforts
from thingc.modes import Modes
from thingc.tools.cli import info
from thingc.tools.cli.main import main

FOLDER = Path(__file__).parent / "hexapod"
LIMIT = 1.5
THREE = [f"leg_{k}/sole" for k in (0, 2, 4)]
Array = Any


class Hexapod:
    """The compiled document: its robots and their MuJoCo models."""

    def __init__(self, document: Path, store: str) -> None:
        with Environment(str(document), Options(store=store)) as environment:
            compilation = pipeline.compile(environment)
            self.said = [(d.code.code, d.message) for d in compilation.report.sorted_diagnostics()]
            self.compilation = compilation
            self.files: dict[str, bytes] = {}
            if not compilation.report.failed:
                for path, one in pipeline.build(environment, compilation, ["mjcf"])["mjcf"].files.items():
                    self.files[path] = one if isinstance(one, bytes) else environment.store.read(one.sha256)

    def robot(self, mode: str) -> Robot:
        return next(robot for robot in self.compilation.robots if robot.mode.name == mode)

    def scene(self, mode: str) -> mujoco.MjModel:
        beside = {os.path.basename(path): data for path, data in self.files.items()}
        return mujoco.MjModel.from_xml_string(self.files[f"mjcf/scene_{mode}.xml"].decode(), beside)

    def efforts(self, mode: str, *, friction: float | None = None, pose: str | None = None) -> Efforts:
        """Static efforts of a mode; `friction` replaces that of its feet."""
        robot = self.robot(mode)
        if friction is not None:
            robot = replace(robot, mode=replace(robot.mode, feet=tuple(replace(f, friction=friction) for f in robot.mode.feet)))
        frame = next(frame for frame in robot.keyframes if pose in (None, frame.name))
        return static_efforts(robot, frame.q, body_poses(robot, frame.q, frame.base))


@contextmanager
def changed(folder: Path, store: str, *changes: tuple[str, str], file: str = "hexapod.yaml") -> Iterator[Path]:
    """A copy of the workspace with texts of a document replaced."""
    copytree(FOLDER, folder, dirs_exist_ok=True)
    text = (folder / file).read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    (folder / file).write_text(text)
    yield folder / "hexapod.yaml"


@pytest.fixture(scope="module")
def hexapod(shared_store: str) -> Hexapod:
    found = Hexapod(FOLDER / "hexapod.yaml", shared_store)
    assert found.said == []
    return found


class Balance:
    """A keyframe in MuJoCo: gravity forces on base and joints, and Jacobians of the feet."""

    def __init__(self, model: mujoco.MjModel, pose: str, feet: list[str]) -> None:
        self.data = data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
        mujoco.mj_forward(model, data)
        self.soles = np.array([data.site(foot).xpos for foot in feet])
        self.paths = [model.joint(model.actuator_trnid[k, 0]).name for k in range(model.nu)]
        self.dofs = [int(model.joint(path).dofadr[0]) for path in self.paths]
        blocks = []
        for foot in feet:
            linear = np.zeros((3, model.nv))
            mujoco.mj_jacSite(model, data, linear, None, model.site(foot).id)
            blocks.append(linear)
        self.J = np.vstack(blocks)
        self.wanted = at_rest(model, data)
        self.weight = float(model.body_subtreemass[0]) * 9.81
        self.centre = np.array(data.subtree_com[0])

    def efforts(self, forces: Array) -> dict[str, float]:
        """Efforts of the drives with these forces (3 n) on the feet. The base must be in balance."""
        left = self.wanted - self.J.T @ np.asarray(forces).ravel()
        assert np.abs(left[:6]).max() < 1e-6 * self.weight
        return dict(zip(self.paths, left[self.dofs].tolist(), strict=True))

    def least(self, edges: Array) -> dict[str, float]:
        """Efforts with the smallest sum of squares over all forces that are sums of these cone edges (k x 3) at every foot, found with
        sequential quadratic programming in SciPy."""
        G = np.kron(np.eye(len(self.soles)), edges.T) * self.weight
        even = self.J.T @ G
        base, base_due = even[:6], self.wanted[:6]
        legs, legs_due = even[self.dofs], self.wanted[self.dofs]
        start = linprog(np.zeros(G.shape[1]), A_eq=base, b_eq=base_due, bounds=(0, None)).x
        found = minimize(
            lambda x: float(np.sum((legs_due - legs @ x) ** 2)), start, jac=lambda x: -2.0 * legs.T @ (legs_due - legs @ x),
            bounds=[(0.0, None)] * len(start), constraints={"type": "eq", "fun": lambda x: base @ x - base_due, "jac": lambda x: base},
            method="SLSQP", options={"ftol": 1e-15, "maxiter": 1000},
        )
        return self.efforts(G @ found.x)


def cone(friction: float, count: int) -> Array:
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.stack([friction * np.cos(angles), friction * np.sin(angles), np.ones(count)], axis=1)


def least_margin(efforts: dict[str, float]) -> float:
    return LIMIT / max(abs(value) for value in efforts.values())


# --- a tripod ----------------------------------------------------------------------------------------------------------------


def test_efforts_do_not_depend_on_the_place_of_the_robot(hexapod: Hexapod) -> None:
    robot = hexapod.robot("three")
    frame = robot.keyframes[0]
    here = frame.base or robot.bodies[0].X_PL
    x, y, z = here.translation
    there = replace(here, translation=(x + 0.3, y - 0.2, z))
    first, second = (static_efforts(robot, frame.q, body_poses(robot, frame.q, base)) for base in (here, there))
    assert second.by_joint == pytest.approx(first.by_joint, rel=1e-6, abs=1e-9) and second.unheld == pytest.approx(first.unheld, abs=1e-9)


def test_frictionless_tripod_matches_force_balance(hexapod: Hexapod) -> None:
    """Three forces whose sum is the weight, and whose moments are those of the weight at the centre of mass."""
    balance = Balance(hexapod.scene("three"), "tripod", THREE)
    x, y = balance.soles[:, 0], balance.soles[:, 1]
    vertical = np.linalg.solve(np.array([np.ones(3), x, y]), balance.weight * np.array([1.0, balance.centre[0], balance.centre[1]]))
    assert (vertical > 1.0).all()
    expected = balance.efforts(np.stack([np.zeros(3), np.zeros(3), vertical], axis=1))
    found = hexapod.efforts("three", friction=0.0)
    assert found.by_joint == pytest.approx(expected, abs=1e-9) and found.choices == 0 and found.unheld < 1e-9
    assert found.least_margin == pytest.approx(least_margin(expected), rel=1e-9)
    assert hexapod.efforts("slippery").by_joint == pytest.approx(expected, abs=1e-9)  # the mode that says so


def test_tripod_inside_cones_is_plain_least_squares(hexapod: Hexapod) -> None:
    """At 0.8 no foot is at its cone, so nine unknown forces satisfy six equations with least efforts."""
    balance = Balance(hexapod.scene("three"), "tripod", THREE)
    A, B = balance.J[:, :6].T, balance.J[:, balance.dofs].T
    particular = np.linalg.lstsq(A, balance.wanted[:6], rcond=None)[0]
    free = np.linalg.svd(A)[2][6:].T
    forces = particular + free @ np.linalg.lstsq(B @ free, balance.wanted[balance.dofs] - B @ particular, rcond=None)[0]
    f = forces.reshape(3, 3)
    assert (np.hypot(f[:, 0], f[:, 1]) < 0.7 * f[:, 2]).all(), "no foot slips, or is near to it"
    found = hexapod.efforts("three")
    assert found.by_joint == pytest.approx(balance.efforts(forces), abs=1e-8) and found.choices == 3
    assert found.least_margin == pytest.approx(least_margin(balance.efforts(forces)), rel=1e-7)


@pytest.mark.parametrize(("mode", "pose", "friction"), [("three", "tripod", 0.02), ("three", "tripod", 0.1), ("six", "stand", 0.2)])
def test_efforts_at_friction_cones_match_scipy(hexapod: Hexapod, mode: str, pose: str, friction: float) -> None:
    feet = THREE if mode == "three" else [f"leg_{k}/sole" for k in range(6)]
    balance = Balance(hexapod.scene(mode), pose, feet)
    found = hexapod.efforts(mode, friction=friction)
    expected = balance.least(cone(friction, 16))
    size = sum(value * value for value in expected.values())
    assert found.unheld < 1e-9 and found.fall is None
    assert sum(value * value for value in found.by_joint.values()) == pytest.approx(size, rel=1e-6)
    assert found.by_joint == pytest.approx(expected, abs=2e-4)


def test_efforts_decrease_with_friction_and_holds(hexapod: Hexapod) -> None:
    """The sum of squares decreases: without friction, with little, with more, with point contacts that may pull, with clamps."""
    def size(found: Efforts) -> float:
        return sum(value * value for value in found.by_joint.values())

    sizes = [size(hexapod.efforts("three", friction=mu)) for mu in (0.0, 0.05, 0.1, 0.2, 0.8)]
    sizes += [size(hexapod.efforts("points")), size(hexapod.efforts("clamps"))]
    assert all(a >= b * (1.0 - 1e-9) for a, b in zip(sizes, sizes[1:])) and sizes[0] > 1.5 * sizes[4] > 10.0 * sizes[-1]
    assert sizes[4] == pytest.approx(sizes[5], rel=1e-7)  # no foot would pull, and none is at its cone


@pytest.mark.parametrize(("mode", "rows"), [("points", 9), ("clamps", 18)])
def test_floating_base_on_holds_matches_mujoco(hexapod: Hexapod, mode: str, rows: int) -> None:
    model = hexapod.scene(mode)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("tripod").id)
    mujoco.mj_forward(model, data)
    assert (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY).sum() == rows
    expected, left, choices = oracle(model, data, dict.fromkeys((joint.path for joint in joints_of(hexapod.robot(mode).assembly)), LIMIT))
    found = hexapod.efforts(mode)
    assert found.by_joint == pytest.approx(expected, rel=1e-5, abs=1e-7) and found.choices == choices and left < 1e-6
    assert found.unheld < 1e-8 and found.fall is None


# --- what a simulation shows -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def simulated(hexapod: Hexapod) -> dict[str, float]:
    """Smallest margin of the position drives at rest on MuJoCo's floor, by mode."""
    found = {}
    for mode, pose in (("six", "stand"), ("three", "tripod")):
        model = hexapod.scene(mode)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
        for _ in range(3000):
            mujoco.mj_step(model, data)
        assert np.abs(data.qvel).max() < 1e-4
        assert data.ncon == len(hexapod.robot(mode).mode.feet)
        found[mode] = LIMIT / float(np.abs(data.actuator_force).max())
    return found


def test_simulated_margin_is_within_the_static_bounds(hexapod: Hexapod, simulated: dict[str, float]) -> None:
    """A robot placed on the floor has nearly no lateral forces. A controller could do better. Clamps give a much larger margin."""
    for mode, margin in simulated.items():
        upright, least = hexapod.efforts(mode, friction=0.0).least_margin, hexapod.efforts(mode).least_margin
        assert upright is not None and least is not None
        assert 0.9 * upright < margin < least
    clamped, least = hexapod.efforts("clamps").least_margin, hexapod.efforts("three").least_margin
    assert clamped is not None and least is not None
    assert simulated["three"] == pytest.approx(hexapod.efforts("slippery").least_margin, rel=0.02)
    assert 1.3 * simulated["three"] < least and clamped > 10.0 * simulated["three"]


def test_documented_margins_match(hexapod: Hexapod, simulated: dict[str, float]) -> None:
    """The table in docs/language/tests.md shows these values to three digits."""
    text = (Path(__file__).parents[2] / "docs/language/tests.md").read_text().partition("<!-- hexapod -->\n")[2].partition("\n\n")[0]
    said = [float(row.split("|")[2]) for row in text.split("\n")[2:]]
    modes = ("three", "slippery", None, "points", "clamps")
    found = [simulated["three"] if mode is None else hexapod.efforts(mode).least_margin or 0.0 for mode in modes]
    assert said == [float(f"{value:.3g}") for value in found]
    document = (FOLDER / "leg.yaml").read_text()
    assert "effort: 1.5 N*m" in document and round(float(hexapod.scene("three").body_subtreemass[0]), 1) == 1.3


# --- falling over ------------------------------------------------------------------------------------------------------------


def distance_outside(soles: Array, centre: Array) -> float:
    """Distance of a point outside a triangle, by its distances from the lines of the sides (nearest to the middle of a side)."""
    middle = soles[:, :2].mean(axis=0)
    worst = -np.inf
    for k in range(3):
        a, b = soles[k, :2], soles[(k + 1) % 3, :2]
        normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
        normal *= np.sign(normal @ (a - middle))
        worst = max(worst, float(normal @ (centre[:2] - a)))
    return worst


HEAVY = ("body: {part: hexapod:Body}", "body: {part: hexapod:Body, mass: 3 kg, com: 100 -70 10 mm}")
"""The mass is far on the side of leg_3, which is in the air."""


@pytest.fixture(scope="module")
def heavy(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Hexapod:
    with changed(tmp_path_factory.mktemp("heavy"), shared_store, HEAVY) as document:
        found = Hexapod(document, shared_store)
    assert found.said == []
    return found


def test_tipping_distance_is_computed(heavy: Hexapod) -> None:
    """The distance of the centre of mass from the support triangle equals the geometric one, and in the simulation the robot tips over."""
    balance = Balance(heavy.scene("three"), "tripod", THREE)
    expected = distance_outside(balance.soles, balance.centre)
    found = heavy.efforts("three")
    assert found.fall is not None and found.fall.how == "tips" and found.fall.outside == pytest.approx(expected, rel=1e-9)
    assert 0.001 < expected < 0.1
    assert hexapod_tilts(heavy.scene("three"), "tripod") > np.radians(5.0)


def hexapod_tilts(model: mujoco.MjModel, pose: str) -> float:
    """Tilt of the body after one second on the floor [rad]."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    return float(np.arccos(data.body("body").xmat[8]))


def test_stable_robot_does_not_tilt(hexapod: Hexapod) -> None:
    assert hexapod_tilts(hexapod.scene("three"), "tripod") < np.radians(1.0)
    assert hexapod.efforts("three").fall is None


def test_document_test_reports_tipping(tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    with changed(tmp_path / "w", shared_store, HEAVY, ("mode: all, min: 2", "mode: three, pose: [tripod, stand], min: 2")) as document:
        assert main(["test", str(document), "--store", shared_store, "--format", "json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert {one["said"] for one in answer["tests"]} == {"falls over"}
    balance = Balance(Hexapod(tmp_path / "w" / "hexapod.yaml", shared_store).scene("three"), "tripod", THREE)
    far = distance_outside(balance.soles, balance.centre)
    second, first = answer["diagnostics"]
    assert first["code"] == second["code"] == "TC660" and "(mode `three`, pose `stand`)" in second["message"]
    words = re.fullmatch(
        r"test `stands` \(mode `three`, pose `tripod`\): the centre of mass is (\S+) mm outside the "
        r"support polygon", first["message"],
    )
    assert words is not None and float(words[1]) == pytest.approx(1000.0 * far, rel=1e-3)


def test_feet_in_the_air_are_reported(hexapod: Hexapod, tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The mode has six feet, but the pose lifts three of them."""
    robot = hexapod.robot("six")
    frame = next(frame for frame in robot.keyframes if frame.name == "tripod")
    high = lifted_feet(stance(robot, frame.q, body_poses(robot, frame.q, frame.base)).feet)
    data = Balance(hexapod.scene("six"), "tripod", [f"leg_{k}/sole" for k in range(6)])
    assert high == pytest.approx({f"leg_{k}/sole": data.soles[k, 2] - data.soles[0, 2] for k in (1, 3, 5)}, abs=1e-12)
    with changed(tmp_path / "w", shared_store, ("mode: all, min: 2", "mode: six, pose: tripod, min: 2")) as document:
        assert main(["test", str(document), "--store", shared_store, "--format", "json"]) == 1
    (said,) = json.loads(capsys.readouterr().out)["diagnostics"]
    assert said["code"] == "TC661" and "`leg_1.sole` by 38.7 mm, `leg_3.sole` by 38.7 mm, `leg_5.sole` by 38.7 mm" in said["message"]


def test_adhesive_feet_on_ceiling_and_wall(tmp_path: Path, shared_store: str) -> None:
    """On a ceiling, each foot must carry the force that it carries upright, with the opposite sign."""
    modes = "".join(
        f"  {place}_{force}: {{extends: three, gravity: {place}, contacts: {{adhesion: {{"
        + ", ".join(f"leg_{k}.sole: {force} N" for k in (0, 2, 4)) + "}}}\n"
        for place, force in (("ceiling", 2), ("ceiling", 7), ("wall", 3), ("wall", 40))
    )
    modes += "  hung: {extends: three, gravity: ceiling}\n"
    with changed(tmp_path / "w", shared_store, ("simulation:", f"{modes}simulation:")) as document:
        found = Hexapod(document, shared_store)
    assert found.said == []
    balance = Balance(found.scene("three"), "tripod", THREE)
    x, y = balance.soles[:, 0], balance.soles[:, 1]
    shares = np.linalg.solve(np.array([np.ones(3), x, y]), balance.weight * np.array([1.0, balance.centre[0], balance.centre[1]]))
    assert 2.0 < shares.max() < 7.0
    assert [found.efforts(mode).fall and found.efforts(mode).fall.how for mode in ("hung", "ceiling_2", "ceiling_7")] == [  # type: ignore[union-attr]
        "pulls", "pulls", None,
    ]
    upright, hung = found.efforts("three", friction=0.0), found.efforts("ceiling_7", friction=0.0)
    assert hung.by_joint == pytest.approx({path: -value for path, value in upright.by_joint.items()}, abs=1e-9)
    wall = {force: found.efforts(f"wall_{force}") for force in (3, 40)}
    assert wall[3].fall is not None and wall[3].fall.how == "slides" and wall[40].fall is None and wall[40].unheld < 1e-8


def test_leg_without_drive_cannot_hold_the_pose(tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    changes = (
        ("standing_on: [\"leg_[024].sole\"]}", "standing_on: [\"leg_[024].sole\"], actuators: [\"hip_*\", \"*.lift\"]}"),
        ("drive: \"*\", mode: all, min: 2", "drive: \"hip_*\", mode: three, min: 2"),
    )
    with changed(tmp_path / "w", shared_store, *changes) as document:
        assert main(["test", str(document), "--store", shared_store, "--format", "json"]) == 1
    (said,) = json.loads(capsys.readouterr().out)["diagnostics"]
    assert said["code"] == "TC656" and "no drive prevents the motion of joint `leg_" in said["message"]


# --- what else knows of it ---------------------------------------------------------------------------------------------------


def test_batch_margin_is_equal_or_missing_if_falling(hexapod: Hexapod, heavy: Hexapod) -> None:
    assert measure(hexapod.robot("three"), None, None)["torque_margin"] == hexapod.efforts("three").least_margin
    assert measure(heavy.robot("three"), None, None)["torque_margin"] is None
    assert "torque_margin" not in measure(hexapod.robot("six"), "tripod", None)  # three of the six are in the air


def test_feet_are_in_modes_json_sites_and_info(hexapod: Hexapod) -> None:
    described = json.loads(hexapod.files["modes.json"])
    assert described["three"]["standing_on"] == THREE and "standing_on" not in described["clamps"]
    assert Modes.parse(hexapod.files["modes.json"])["three"].standing_on == tuple(THREE)
    for mode in ("six", "clamps"):  # the same sites in every mode
        model = hexapod.scene(mode)
        assert all(model.site(f"leg_{k}/sole") for k in range(6))
    assembly = hexapod.compilation.assembly
    assert assembly is not None
    text = "\n".join(info.as_text(assembly, hexapod.compilation.robots))
    assert "\n  stands on leg_4/sole (friction 0.8)\n" in text and "\n  stands on leg_4/sole (friction 0)\n" in text


def test_foot_friction_matches_mujoco_contacts(hexapod: Hexapod, tmp_path: Path, shared_store: str) -> None:
    """Friction of a contact between a sole and the floor. Without one in the material, MuJoCo combines its two defaults."""
    with changed(tmp_path / "w", shared_store, (", friction: {slide: 0.8}", ""), file="materials.yaml") as document:
        plain = Hexapod(document, shared_store)
    for found, expected in ((hexapod, 0.8), (plain, 1.0)):
        model = found.scene("three")
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("tripod").id)
        for _ in range(50):
            mujoco.mj_step(model, data)
        assert data.ncon == 3 and data.contact.friction[:, 0] == pytest.approx(expected)
        assert [foot.friction for foot in found.robot("three").mode.feet] == [expected] * 3


@pytest.mark.parametrize(
    ("mode", "said"),
    [
        ("{extends: three, base: held}", ("TC608", "`standing_on` of mode `m` cannot be used with `base: held`")),
        ("{extends: three, standing_on: [leg_0.sole, \"leg_*.sole\"], hold: {left: here}}",
         ("TC608", "`leg_0/sole` is in both `hold` and `standing_on` of mode `m`")),
        ("{extends: three, hold: {leg_2.sole: here}}", ("TC608", "`leg_2/sole` is in both `hold` and `standing_on` of mode `m`")),
        ("{extends: three, standing_on: [\"leg_[6-9].sole\"]}", ("TC309", "pattern `leg_[6-9].sole` matches no mount")),
        ("{extends: three, standing_on: [leg_0.soul]}", ("TC303", "assembly `leg_0` (`leg.yaml`) exports no mount `soul`")),
        ("{extends: three, standing_on: {mounts: [leg_0.sole], friction: -1}}", ("TC315", None)),
        ("{extends: three, standing_on: {mounts: []}}", ("TC214", None)),
    ],
)
def test_invalid_standing_on_is_reported(mode: str, said: tuple[str, str | None], tmp_path: Path, shared_store: str) -> None:
    changes = (("simulation:", f"  m: {mode}\nmounts: {{left: leg_0.sole}}\nsimulation:"),)
    with changed(tmp_path / "w", shared_store, *changes) as document:
        found = Hexapod(document, shared_store)
    assert len(found.said) == 1 and found.said[0][0] == said[0], found.said
    assert said[1] is None or found.said[0][1] == said[1]
