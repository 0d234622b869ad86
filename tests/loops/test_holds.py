"""`hold`: a further mount held to the world, from the document to MuJoCo, compared with written-out matrices."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loops.robots import (
    BALL,
    FRONT_SOLE,
    HOME,
    JOINTS,
    LIMIT,
    MATE,
    X_FRONT,
    Array,
    Built,
    apart,
    at_key,
    compiled,
    equality_residual,
    inchworm,
    placed,
    pose_of,
    rear_sole,
    shift,
    turn,
    worm_links,
)
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import compile
from thingc.tools.cli import info

EXACT = 1e-9
"""Upper bound of the residual of a closure [m] and [rad]."""


def written(X: Array) -> str:
    """Format a pose as in a document."""
    x, y, z = X[:3, 3].tolist()
    roll, pitch, yaw = Rotation.from_matrix(X[:3, :3]).as_euler("xyz").tolist()  # lower case: extrinsic
    return f"{{xyz: [{x!r} m, {y!r} m, {z!r} m], rpy: [{roll!r} rad, {pitch!r} rad, {yaw!r} rad]}}"


AWAY = shift(0.006, -0.008, 0.0) @ rear_sole(HOME) @ turn("x", np.radians(3.0))
"""The rear sole 1 cm and 3 deg from its pose in `arched`."""

MODES = f"""\
  front: {{root: front.sole, base: held, pose: arched}}
  rear: {{root: rear.sole, base: fixed}}
  bridge: {{extends: front, hold: {{rear.sole: {written(AWAY @ MATE)}}}}}
  stay: {{extends: front, hold: {{rear.sole: here}}}}
  pinned: {{extends: front, hold: {{rear.sole: {{at: here, carries: force}}}}}}
  reached: {{extends: front, hold: {{rear.sole: {{xyz: {written(AWAY @ MATE).split("xyz: ")[1].split(", rpy")[0]}, carries: force}}}}}}
  dangling: {{root: body, base: free, at: {{xyz: 0 0 300 mm}}, hold: {{front.sole: {{xyz: 0 0 500 mm, carries: force}}}}}}
  hanging: {{root: body, base: free, at: {{xyz: 0 0 300 mm}}, hold: {{front.sole: {written(MATE @ MATE)}}}}}
"""
POSES = """\
  lifted: {knee_f: 20 deg, hip_f: 10 deg}
  straight: {ankle_f: 0, knee_f: 0, hip_f: 0, hip_r: 0, knee_r: 0, ankle_r: 0}
"""


@pytest.fixture(scope="module")
def worm(tmp_path_factory: pytest.TempPathFactory) -> Built:
    found = compiled(tmp_path_factory.mktemp("worm"), inchworm(modes=MODES, poses=POSES))
    assert found.said == []
    return found


def test_target_is_one_centimetre_and_three_degrees_away() -> None:
    distance, angle = apart(rear_sole(HOME), AWAY)
    assert (distance, np.degrees(angle)) == pytest.approx((0.01, 3.0), abs=1e-12)


def test_closure_is_solved_at_build_time(worm: Built) -> None:
    """The chain of matrices at q of the keyframe puts the sole at the hold."""
    frame = worm.robot("bridge").keyframes[0]
    assert frame.name == "arched"
    distance, angle = apart(rear_sole(frame.q), AWAY)
    assert distance < EXACT and angle < EXACT
    assert frame.residual is not None and max(frame.residual) < EXACT
    assert all(abs(frame.q[joint]) <= LIMIT for joint in JOINTS)
    # It is the solution next to the pose, not another one: a step of 1 cm and 3 deg.
    assert max(abs(frame.q[joint] - HOME[joint]) for joint in JOINTS) < 0.25


@pytest.mark.parametrize("mode", ["bridge", "stay", "hanging"])
def test_equality_is_satisfied_at_every_keyframe(worm: Built, mode: str) -> None:
    model = worm.model(mode)
    assert model.nkey >= 1
    for key in range(model.nkey):
        data = at_key(model, model.key(key).name)
        assert (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY).sum() == 6
        assert equality_residual(data) < EXACT


def test_weld_anchor_is_at_the_link_pose(worm: Built) -> None:
    """The anchor body is at the world pose of the link by MuJoCo's kinematics, independent of qpos0."""
    model = worm.model("bridge")
    equality = model.equality("rear/sole:hold")
    assert int(equality.type[0]) == mujoco.mjtEq.mjEQ_WELD
    assert [model.body(int(equality.obj1id[0])).name, model.body(int(equality.obj2id[0])).name] == ["rear/sole:held", "rear"]
    assert list(equality.data[:10]) == [0.0] * 6 + [1.0, 0.0, 0.0, 0.0]
    for data in (at_key(model, "arched"), start := mujoco.MjData(model)):
        if data is start:  # as a reset without a keyframe has it
            mujoco.mj_forward(model, data)
        assert data.body("rear/sole:held").xpos == pytest.approx(at_key(model, "arched").body("rear").xpos, abs=EXACT)
        assert data.body("rear/sole:held").xmat == pytest.approx(at_key(model, "arched").body("rear").xmat, abs=EXACT)
    data = at_key(model, "arched")
    assert pose_of(data.site("rear/sole")) == pytest.approx(AWAY, abs=EXACT)


def test_here_means_the_pose_of_the_mode(worm: Built) -> None:
    frames = {frame.name: frame for frame in worm.robot("stay").keyframes}
    assert frames["arched"].q == HOME and frames["arched"].moved == {}
    assert np.array(worm.modes["stay"]["holds"]["rear/sole"]["X_WM"]) == pytest.approx(rear_sole(HOME), abs=1e-14)
    for frame in frames.values():
        distance, angle = apart(rear_sole(frame.q), rear_sole(HOME))
        assert distance < EXACT and angle < EXACT


def test_unclosed_poses_are_losses_without_keyframes(worm: Built) -> None:
    for mode in ("bridge", "stay"):
        robot = worm.robot(mode)
        closed, lost = {frame.name for frame in robot.keyframes}, {one.name for one in robot.unclosed}
        assert closed | lost == {"arched", "lifted", "straight"} and not closed & lost
        omitted = {loss.path: loss for loss in worm.losses(mode) if loss.how == "omitted"}
        assert set(omitted) == lost
        assert set(worm.modes[mode]["poses"]) == closed
        assert [worm.model(mode).key(k).name for k in range(worm.model(mode).nkey)] == [f.name for f in robot.keyframes]


# --- a hold that carries force alone ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["pinned", "reached", "dangling"])
def test_force_only_hold_fixes_a_point(worm: Built, mode: str) -> None:
    """With `carries: force` the equality has three rows, and the point is at its place in every keyframe."""
    model, robot = worm.model(mode), worm.robot(mode)
    assert robot.keyframes[0].name == "arched" and (mode == "pinned" or len(robot.keyframes) > 1)
    for frame in robot.keyframes:
        data = at_key(model, frame.name)
        assert (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY).sum() == 3
        assert equality_residual(data) < EXACT
    place = np.array(worm.modes[mode]["holds"]["front/sole" if mode == "dangling" else "rear/sole"]["X_WM"])[:3, 3]
    expected = {"pinned": rear_sole(HOME)[:3, 3], "reached": AWAY[:3, 3], "dangling": (0.0, 0.0, 0.5)}[mode]
    assert place == pytest.approx(expected, abs=1e-12)


def test_force_only_hold_allows_more_poses_than_a_clamp(worm: Built) -> None:
    """At the same place, the clamp (`bridge`) cannot reach `lifted`, but the point hold (`reached`) can, with a tilted sole."""
    assert "lifted" in {one.name for one in worm.robot("bridge").unclosed}
    soles = {frame.name: rear_sole(frame.q) for frame in worm.robot("reached").keyframes}
    distance, angle = apart(soles["lifted"], AWAY)
    assert distance < EXACT and np.degrees(angle) > 5.0


def test_link_rotates_about_a_force_only_hold(worm: Built) -> None:
    """With gravity compensated, a link that spins about its sole keeps rotating, and the point stays."""
    model = worm.model("dangling")
    data = at_key(model, "arched")
    start = np.array(data.site("front/sole").xpos)
    linear = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, linear, None, model.site("front/sole").id)
    spin = np.array([0.4, -0.2, 0.3])
    data.qvel[3:6] = spin
    data.qvel[:3] = -linear[:, 3:6] @ spin
    for _ in range(100):
        data.qfrc_applied[:] = data.qfrc_bias
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    assert np.abs(data.site("front/sole").xpos - start).max() < 1e-4
    assert np.linalg.norm(data.body("front").cvel[:3]) > 0.1


def test_hold_type_is_in_modes_json_and_info(worm: Built) -> None:
    carries = {mode: next(iter(worm.modes[mode]["holds"].values()))["carries"] for mode in ("stay", "pinned", "dangling")}
    assert carries == {"stay": "force and torque", "pinned": "force", "dangling": "force"}
    assembly = worm.compilation.assembly
    assert assembly is not None
    text = "\n".join(info.as_text(assembly, worm.compilation.robots))
    assert "\n  rear is held at rear/sole, free to rotate\n" in text.partition("mode pinned:")[2].partition("\nmode ")[0]


def test_changed_pose_values_are_a_loss(worm: Built) -> None:
    (loss,) = [loss for loss in worm.losses("bridge") if loss.path == "arched"]
    q = worm.robot("bridge").keyframes[0].q
    joint = max(JOINTS, key=lambda one: abs(q[one] - HOME[one]))
    far = np.degrees(abs(q[joint] - HOME[joint]))
    assert loss.how == "approximated"
    assert loss.what == f"the values: the loops close with `{joint}` and 5 more changed by at most {far:.3g} deg"
    assert [loss.path for loss in worm.losses("front")] == []


def test_named_joints_are_kept_if_others_suffice(tmp_path: Path) -> None:
    """The target is the pose with another ankle angle. The pose names all joints except the ankle, so only the ankle moves."""
    named = {joint: q for joint, q in HOME.items() if joint != "ankle_r"}
    poses = "  bent: {" + ", ".join(f"{joint}: {q!r} rad" for joint, q in named.items()) + "}\n"
    held = rear_sole({**HOME, "ankle_r": 0.4})
    found = compiled(tmp_path, inchworm(
        poses=poses, modes=f"  m: {{root: front.sole, pose: bent, poses: [], hold: {{rear.sole: {written(held @ MATE)}}}}}\n",
    ))
    assert found.said == []
    (frame,) = found.robot("m").keyframes
    assert {joint: frame.q[joint] for joint in named} == named
    assert frame.q["ankle_r"] == pytest.approx(0.4, abs=1e-9)
    far = np.degrees(0.4)
    assert [(loss.path, loss.what, loss.how) for loss in found.losses("m")] == [
        ("bent", f"the values: the loops close with `ankle_r` changed by at most {far:.3g} deg", "approximated")
    ]


def test_pose_that_closes_only_far_away_is_a_loss(worm: Built) -> None:
    """From `straight`, Newton's method converges to the arch. A keyframe with that name would be wrong."""
    (loss,) = [loss for loss in worm.losses("stay") if loss.path == "straight"]
    assert (loss.what, loss.how) == (
        "the keyframe: the loops close only with `knee_f` and 5 more changed by at most 75 deg", "omitted",
    )
    assert "straight" not in worm.modes["stay"]["poses"]


def test_mode_that_does_not_close_at_its_start_is_an_error(tmp_path: Path) -> None:
    found = compiled(tmp_path, inchworm(
        poses=POSES, modes=f"  m: {{root: front.sole, pose: lifted, hold: {{rear.sole: {written(AWAY @ MATE)}}}}}\n",
    ))
    assert found.said == [(
        "TC604", "the held mount `rear/sole` moves in mode `m` from pose `lifted` (smallest error: 26.8 mm and 23.4 deg)",
        "start from the pose `arched`, in which the loops close", 23,
    )]


def test_free_base_moves_to_the_hold_and_joints_stay(worm: Built) -> None:
    robot = worm.robot("hanging")
    assert [frame.name for frame in robot.keyframes] == ["arched", "lifted", "straight"]
    for frame in robot.keyframes:
        assert frame.moved == {} and frame.base is not None
        links = worm_links(frame.q, np.eye(4))
        X_body_front = np.linalg.inv(links["body"]) @ links["front"]
        sole = np.array(frame.base.rows()) @ X_body_front @ FRONT_SOLE
        assert apart(sole, MATE) == pytest.approx((0.0, 0.0), abs=EXACT)
    assert robot.keyframes[0].q == HOME
    model = worm.model("hanging")
    data = at_key(model, "arched")
    assert pose_of(data.site("front/sole")) == pytest.approx(MATE, abs=EXACT)


def test_modes_json_contains_holds(worm: Built) -> None:
    described = worm.modes
    assert described["front"]["holds"] == {} and "residuals" not in described["front"]
    (path, hold), = described["bridge"]["holds"].items()
    assert (path, hold["link"]) == ("rear/sole", "rear")
    assert np.array(hold["X_WM"]) == pytest.approx(AWAY, abs=1e-12)
    links = worm_links(described["bridge"]["poses"]["arched"], X_FRONT)
    assert links["rear"] @ np.array(hold["X_LM"]) == pytest.approx(AWAY, abs=EXACT)
    assert all(value < EXACT for value in described["bridge"]["residuals"]["arched"])


def test_held_link_excludes_floor_contacts(worm: Built) -> None:
    """Other excluded pairs are the same in every mode."""
    def pairs(mode: str, scene: bool = False) -> set[frozenset[str]]:
        model = worm.scene(mode) if scene else worm.model(mode)
        return {
            frozenset(model.body(int(signature) >> bits & 0xFFFF).name for bits in (16, 0))
            for signature in model.exclude_signature
        }

    neighbours = pairs("front")
    assert len(neighbours) == 6
    assert all(pairs(mode) == neighbours for mode in ("rear", "bridge", "pinned", "hanging"))
    assert pairs("rear", scene=True) == neighbours
    assert pairs("bridge", scene=True) == pairs("pinned", scene=True) == neighbours | {frozenset(("floor", "rear"))}
    assert pairs("hanging", scene=True) == neighbours | {frozenset(("floor", "front"))}


@pytest.mark.parametrize("mode", ["bridge", "stay"])
def test_hold_is_static_with_gravity_compensated(worm: Built, mode: str) -> None:
    """From the keyframe, with bias forces cancelled, nothing moves: the equality exerts no force."""
    model = worm.model(mode)
    data = at_key(model, "arched")
    start = data.qpos.copy()
    for _ in range(500):
        data.qfrc_applied[:] = data.qfrc_bias
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos - start).max() < EXACT
    assert np.abs(data.qvel).max() < EXACT


def test_hold_carries_the_weight_of_the_robot(worm: Built) -> None:
    """With 1.1 kg on the hold and the drives, MuJoCo's soft constraint deviates by micrometres."""
    model = worm.model("bridge")
    data = at_key(model, "arched")
    for _ in range(1000):
        mujoco.mj_step(model, data)
    distance, angle = apart(pose_of(data.site("rear/sole")), AWAY)
    assert np.abs(data.qvel).max() < 1e-3
    assert distance < 5e-6 and angle < 5e-5


def test_info_shows_holds_and_closing_errors(worm: Built) -> None:
    assembly = worm.compilation.assembly
    assert assembly is not None
    text = "\n".join(info.as_text(assembly, worm.compilation.robots))
    bridge = text.partition("mode bridge:")[2].partition("\nmode ")[0]
    assert "\n  rear is held at rear/sole\n" in bridge
    (closes,) = re.findall(r"^  pose arched closes with an error of (\S+) m and (\S+) rad$", bridge, re.MULTILINE)
    assert all(float(value) < EXACT for value in closes)
    assert "\n  pose straight does not close: no keyframe" in bridge
    assert "held at" not in text.partition("mode front:")[2].partition("\nmode ")[0]


# --- a lever: what can be reached is plain ------------------------------------------------------------------------------

LEVER = f"""\
thingc: assembly/1
name: lever
components:
  post: {{frame: true, mass: 1 kg, {BALL}}}
  arm: {{frame: true, mass: 1 kg, {BALL}, mounts: {{hub: {{rpy: 180 0 0 deg}}, tip: {{xyz: 200 0 0 mm}}}}}}
joints:
  hinge: {{type: revolute, parent: post.origin, child: arm.hub, limit: {{lower: -60 deg, upper: 60 deg}}}}
poses:
  up: {{hinge: 30 deg}}
  down: {{hinge: -30 deg}}
modes:
"""
HUB = placed((0, 0, 0), (np.pi, 0, 0))
TIP = placed((0.2, 0, 0))


def tip_at(q: float) -> Array:
    return turn("z", q) @ MATE @ np.linalg.inv(HUB) @ TIP


def test_unreachable_hold_reports_the_remaining_error(tmp_path: Path) -> None:
    """The lever can point at the hold but is 100 mm too short."""
    beyond = tip_at(np.radians(20.0)) @ shift(0.1, 0, 0)
    mode = f"  m:\n    root: post\n    pose: up\n    hold:\n      arm.tip: {written(beyond @ MATE)}\n"
    found = compiled(tmp_path, LEVER + mode)
    assert found.said == [(
        "TC604", "the held mount `arm/tip` moves in mode `m` (smallest error: 100 mm and 0 deg)",
        "move the mount under `hold`, or widen the limits of the joints", 16,
    )]


def test_limits_are_respected_when_closing(tmp_path: Path) -> None:
    """The hold is at 75 deg, 15 deg beyond the limit. The best solution is at the limit, a chord of 2 * 200 mm * sin(7.5 deg) away."""
    held = tip_at(np.radians(75.0))
    found = compiled(tmp_path, LEVER + f"  m: {{root: post, pose: up, hold: {{arm.tip: {written(held @ MATE)}}}}}\n")
    chord = 400 * np.sin(np.radians(7.5))
    assert [line[1] for line in found.said] == [
        f"the held mount `arm/tip` moves in mode `m` (smallest error: {chord:.3g} mm and 15 deg)"
    ]


def test_every_pose_closes_at_the_hold(tmp_path: Path) -> None:
    held = tip_at(np.radians(30.0))
    text = LEVER.replace("lower: -60 deg", "lower: 25 deg").replace("down: {hinge: -30 deg}", "down: {hinge: 40 deg}")
    found = compiled(tmp_path, text + f"  m: {{root: post, pose: down, hold: {{arm.tip: {written(held @ MATE)}}}}}\n")
    assert found.said == []
    assert {frame.name: frame.q["hinge"] for frame in found.robot("m").keyframes} == {
        "down": pytest.approx(np.radians(30.0), abs=1e-9), "up": pytest.approx(np.radians(30.0), abs=1e-9),
    }


@pytest.mark.parametrize(("away", "kept"), [(29, True), (31, False)])
def test_pose_that_moves_over_30_deg_has_no_keyframe(away: int, kept: bool, tmp_path: Path) -> None:
    """The mode's own pose (30 deg) keeps its keyframe, however far it moves."""
    text = LEVER.replace("down: {hinge: -30 deg}", f"down: {{hinge: {away - 10} deg}}")
    found = compiled(tmp_path, text + f"  m: {{root: post, pose: up, hold: {{arm.tip: {written(tip_at(np.radians(-10.0)) @ MATE)}}}}}\n")
    assert [frame.name for frame in found.robot("m").keyframes] == (["up", "down"] if kept else ["up"])
    assert all(frame.q["hinge"] == pytest.approx(np.radians(-10.0), abs=1e-9) for frame in found.robot("m").keyframes)


def test_component_hold_uses_its_origin_without_mate(tmp_path: Path) -> None:
    held = turn("z", 0.3) @ MATE @ np.linalg.inv(HUB)
    found = compiled(tmp_path, LEVER + f"  m: {{root: post, pose: up, hold: {{arm: {written(held)}}}}}\n")
    assert found.said == []
    assert found.robot("m").keyframes[0].q["hinge"] == pytest.approx(0.3, abs=1e-9)
    assert set(found.modes["m"]["holds"]) == {"arm/origin"}


def test_hold_on_the_root_is_an_error(tmp_path: Path) -> None:
    found = compiled(tmp_path, LEVER + "  m: {root: arm.tip, hold: {arm.hub: here, post: here}}\n")
    assert found.said == [(
        "TC603", "mode `m` cannot hold `arm/hub`, a mount of the root link `arm`",
        "list a mount of another link under `hold`, or remove the mount", 12,
    )]


def test_hold_of_one_mount_by_two_names_is_an_error(tmp_path: Path) -> None:
    found = compiled(
        tmp_path, LEVER + "  m: {root: post, hold: {arm.tip: here, end: here}}\nmounts: {end: arm.tip}\n",
    )
    assert found.said == [("TC603", "`arm/tip` is listed twice under `hold` of mode `m`", "remove one of the two entries from `hold`", 12)]


@pytest.mark.parametrize(
    ("hold", "said"),
    [
        ("{arm.tpi: here}", ("TC303", "frame `arm` has no mount `tpi`", "did you mean `tip`?", 12)),
        ("{arn.tip: here}", ("TC302", "this document has no component `arn`", "did you mean `arm`?", 12)),
        ("{arm.tip: there}", ("TC204", "expected `here`, found the string `there`", "did you mean `here`?", 12)),
        ("{arm.tip: {xyz: 0 0 3 kg}}", ("TC207", None, None, 12)),
        ("{arm.tip: {}}", ("TC212", "an entry of `hold` requires `at: here`, or `xyz` and `rpy`", "write, for example, `at: here`", 12)),
        ("{arm.tip: {carries: force}}",
         ("TC212", "an entry of `hold` requires `at: here`, or `xyz` and `rpy`", "write, for example, `at: here`", 12)),
        ("{arm.tip: {at: here, xyz: 0 0 0}}",
         ("TC212", "an entry of `hold` cannot have both `at` and `xyz`", "remove `at` or `xyz`", 12)),
        ("{arm.tip: {xyz: 0 0 0, rpy: 0 0 90 deg, carries: force}}",
         ("TC212", "`rpy` has no effect with `carries: force`", "remove `rpy`", 12)),
        ("{arm.tip: {at: here, carries: torque}}", ("TC204", None, None, 12)),
    ],
)
def test_invalid_holds_are_reported(tmp_path: Path, hold: str, said: tuple[str, str | None, str | None, int]) -> None:
    found = compiled(tmp_path, LEVER + f"  m: {{root: post, hold: {hold}}}\n")
    assert len(found.said) == 1
    for got, expected in zip(found.said[0], said):
        assert expected is None or got == expected


def test_holds_are_merged_with_extended_modes(tmp_path: Path) -> None:
    links = worm_links(HOME, np.eye(4))
    moved = shift(0.004, 0, 0.002) @ np.linalg.inv(links["body"]) @ links["front"] @ FRONT_SOLE
    found = compiled(tmp_path, inchworm(modes=(
        "  a: {root: body, base: free, pose: arched, poses: [arched], hold: {front.sole: here}}\n"
        "  b: {extends: a, hold: {rear.sole: here}}\n"
        f"  c: {{extends: b, hold: {{front.sole: {written(moved @ MATE)}}}}}\n"
    )))
    assert found.said == []
    assert {name: list(mode["holds"]) for name, mode in found.modes.items()} == {
        "a": ["front/sole"], "b": ["front/sole", "rear/sole"], "c": ["front/sole", "rear/sole"],
    }
    assert np.array(found.modes["c"]["holds"]["front/sole"]["X_WM"]) == pytest.approx(moved, abs=1e-12)
    for mode in "abc":
        assert equality_residual(at_key(found.model(mode), "arched")) < EXACT


def test_exported_mount_at_an_origin_is_mated(tmp_path: Path) -> None:
    """As a root and as a hold, the exported mount `hand.tip` is mated, although it is at the origin of `hand.cap`, which is placed
    without a mate."""
    weight = "{frame: true, mass: 100 g, inertia: {ixx: 9 kg*mm^2, iyy: 9 kg*mm^2, izz: 9 kg*mm^2}}"
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "inner.yaml").write_text(
        f"thingc: assembly/1\nname: inner\ncomponents:\n  cap: {weight}\nmounts: {{tip: cap.origin}}\n",
    )
    (tmp_path / "top.yaml").write_text(
        f"thingc: assembly/1\nname: top\ncomponents:\n  hand: {{assembly: inner.yaml}}\n  arm: {weight}\n"
        "joints:\n  wrist: {type: ball, parent: hand.tip, child: arm.origin}\n"
        "modes:\n  laid: {root: hand.cap, base: fixed}\n  mated: {root: hand.tip, base: fixed}\n"
        "  laid_hold: {root: arm, base: fixed, hold: {hand.cap: {xyz: 0 0 0}}}\n"
        "  mated_hold: {root: arm, base: fixed, hold: {hand.tip: {xyz: 0 0 0}}}\n",
    )
    with Environment(str(tmp_path / "top.yaml"), Options()) as environment:
        compilation = compile(environment)
    assert not compilation.report.failed
    laid, mated, laid_hold, mated_hold = compilation.robots
    for pose, expected in (
        (laid.bodies[0].X_PL, np.eye(4)), (mated.bodies[0].X_PL, MATE),
        (laid_hold.closures[0].X_PA, np.eye(4)), (mated_hold.closures[0].X_PA, MATE),
    ):
        assert np.array(pose.rotation) == pytest.approx(expected[:3, :3], abs=1e-12)
