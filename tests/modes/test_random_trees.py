"""Random trees of joints of all kinds with several roots: poses by the formulas of the semantics, written out here, and masses and
gravity with one link held compared between MuJoCo models of all modes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loops.robots import MATE, Array, Built, compiled
from modes.switching_robots import assert_said, bodies, jacobian, mass_matrix
from thingc.base.joints.kinds import KINDS
from thingc.modes import Mode, Modes, RobotState

LINKS = 6
JOINED = 3
"""The tree whose links 1 and 2 have no mass: three joints with five coordinates on one body."""
FREE = 4
"""Index of the tree with free joints."""
LEAD = 0.012
OTHERS = ["continuous", "universal", "screw", "universal", "cylindrical", "planar", "revolute", "prismatic", "revolute"]
COORDINATES = {"revolute": "t", "continuous": "t", "prismatic": "s", "screw": "t", "cylindrical": "ts", "universal": "tt", "planar": "sst",
               "ball": "ttt", "free": "sssttt"}


@dataclass(frozen=True)
class Edge:
    """A joint of a random tree and its mounts in the links `parent` and `child`, which coincide if it has an `axis`.

    If `follows` is set, the last coordinate mimics it with `ratio` and a constant offset."""

    name: str
    kind: str
    parent: int
    child: int
    X_PA: Array
    X_CB: Array
    offset: Array
    follows: str | None
    axis: Array | None
    turn: float
    gap: float

    @property
    def coordinates(self) -> list[str]:
        count = len(COORDINATES[self.kind])
        return [self.name] if count == 1 else [f"{self.name}_{k}" for k in range(count)]

    @property
    def follower(self) -> str:
        return self.coordinates[-1]

    @property
    def ratio(self) -> float:
        return -0.7 if COORDINATES[self.kind][-1] == "t" else -0.07

    def across(self, q: dict[str, float]) -> Array:
        values = np.array([q[name] for name in self.coordinates]) + self.offset
        still = motion("cylindrical", np.array([self.turn, self.gap])) @ motion(self.kind, values)
        if self.axis is None:
            return self.X_PA @ still @ MATE @ np.linalg.inv(self.X_CB)
        onto = frame(Rotation.align_vectors([self.axis], [[0, 0, 1]])[0])
        return self.X_PA @ onto @ still @ np.linalg.inv(self.X_CB @ onto)


def frame(turn: Rotation, place: Array | tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = turn.as_matrix(), place
    return X


def motion(kind: str, q: Array) -> Array:
    """X_J by the table of joint kinds."""
    def about(axis: str, angle: float) -> Array:
        return frame(Rotation.from_euler(axis, angle))

    still = Rotation.identity()
    if kind in ("revolute", "continuous"):
        return about("z", q[0])
    if kind == "prismatic":
        return frame(still, (0, 0, q[0]))
    if kind == "screw":
        return about("z", q[0]) @ frame(still, (0, 0, LEAD * q[0] / math.tau))
    if kind == "cylindrical":
        return about("z", q[0]) @ frame(still, (0, 0, q[1]))
    if kind == "universal":
        return about("x", q[0]) @ about("y", q[1])
    if kind == "planar":
        return frame(still, (q[0], q[1], 0)) @ about("z", q[2])
    assert kind in ("ball", "free")
    return frame(Rotation.from_rotvec(q[-3:]), q[:-3] if kind == "free" else (0.0, 0.0, 0.0))


def random_tree(seed: int) -> tuple[str, list[Edge]]:
    """A document and its joints."""
    rng = np.random.default_rng(seed)
    joined = seed == JOINED
    kinds = [OTHERS[3 * seed], "ball", *OTHERS[3 * seed + 1 : 3 * seed + 3], "ball"] if seed < JOINED else [
        "universal", "prismatic", "cylindrical", "ball", "revolute",
    ] if joined else ["free", "revolute", "ball", "free", "universal"]
    text = [f"thingc: assembly/1\nname: tree_{seed}\ncomponents:"]
    edges: list[Edge] = []
    mounts: dict[int, list[str]] = {link: [] for link in range(LINKS)}

    def mount(link: int) -> tuple[str, Array]:
        place, turn = rng.uniform(-100, 100, 3).round(1), rng.uniform(-180, 180, 3).round(1)
        mounts[link].append(f"m{len(mounts[link])}: {{xyz: {list_of(place, 'mm')}, rpy: {list_of(turn, 'deg')}}}")
        return f"link_{link}.m{len(mounts[link]) - 1}", frame(Rotation.from_euler("xyz", turn, degrees=True), place / 1000)

    joints = []
    for child in range(1, LINKS):
        kind, parent = kinds[child - 1], child - 1 if joined else int(rng.integers(child))
        (here, X_PA), (there, X_CB) = mount(parent), mount(child)
        units = COORDINATES[kind]
        offset = np.zeros(len(units)) if kind in ("ball", "free") else rng.uniform(-0.05, 0.05, len(units)).round(3)
        turning = [
            name for edge in edges if edge.kind not in ("ball", "free")
            for name, unit in zip(edge.coordinates, COORDINATES[edge.kind], strict=True)
            if unit == "t" and not (edge.follows is not None and name == edge.follower)
        ]
        follows = turning[-1] if turning and kind not in ("ball", "free") else None
        axis = rng.uniform(-1, 1, 3).round(2) if kind not in ("ball", "free", "universal", "planar") else None
        turn, gap = (round(float(one), 2) for one in rng.uniform(-1, 1, 2))
        edge = Edge(f"j{child}", kind, parent, child, X_PA, X_CB, offset, follows, axis, turn, gap)
        edges.append(edge)
        written = [f"type: {kind}", f"parent: {here}", f"child: {there}", f"turn: {turn} rad", f"gap: {gap} m"]
        if axis is not None:
            written.append(f"axis: {axis.tolist()}")
        if kind == "ball":
            written.append("dynamics: {armature: 1e-5 kg*m^2}")
        elif kind != "free":
            values = [f"{value} {'rad' if unit == 't' else 'm'}" for value, unit in zip(offset, units, strict=True)]
            written.append(f"offset: {values[0] if len(values) == 1 else '[' + ', '.join(values) + ']'}")
        if kind in ("revolute", "prismatic"):
            written.append("limit: " + ("{lower: -9 rad, upper: 9 rad}" if kind == "revolute" else "{lower: -9 m, upper: 9 m}"))
        if kind == "screw":
            written.append(f"lead: {1000 * LEAD} mm")
        if follows is not None:
            leader = follows if "_" not in follows else '"' + follows.replace("_", "[") + ']"'
            said = "multiplier: -0.7, offset: 0.1 rad" if units[-1] == "t" else "multiplier: -70 mm/rad, offset: 100 mm"
            mimic = f"{{joint: {leader}, {said}}}"
            written.append(f"mimic: {mimic}" if len(units) == 1 else f"mimic: {{{len(units) - 1}: {mimic}}}")
        joints.append(f"  j{child}: {{{', '.join(written)}}}")
    for link in range(LINKS):
        centre, (a, b, c) = rng.uniform(-50, 50, 3).round(1), rng.uniform(1, 2, 3).round(2)
        weight = f"mass: {rng.uniform(0.2, 2):.2f} kg, com: {list_of(centre, 'mm')}, " \
            f"inertia: {{ixx: {a}e-3 kg*m^2, iyy: {b}e-3 kg*m^2, izz: {c}e-3 kg*m^2}}, "
        text.append(f"  link_{link}: {{frame: true, {'' if joined and link in (1, 2) else weight}mounts: {{{', '.join(mounts[link])}}}}}")
    roots = f"  first: {{root: link_0, base: held}}\n  last: {{root: link_{LINKS - 1}, base: held}}\n  " \
        f"loose: {{root: link_{3 if joined else 2}, base: free}}"
    return "\n".join([*text, "joints:", *joints, "modes:", roots]), edges


ELSEWHERE = frame(Rotation.from_rotvec([0.3, 1, 2]), (1, 2, 3))


def list_of(values: Array, unit: str) -> str:
    return "[" + ", ".join(f"{value} {unit}" for value in values) + "]"


@pytest.fixture(scope="module", params=range(FREE + 1))
def tree(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Built, list[Edge], int]:
    text, edges = random_tree(request.param)
    made = compiled(tmp_path_factory.mktemp("tree"), text)
    assert made.said == []
    return made, edges, request.param


def random_q(edges: list[Edge], rng: np.random.Generator) -> dict[str, float]:
    q: dict[str, float] = {}
    for edge in edges:
        size = 0.9 if edge.kind == "ball" else 0.2 if "s" in COORDINATES[edge.kind] else 1.5
        q |= {name: float(rng.uniform(-1, 1) * size) for name in edge.coordinates}
        if edge.follows is not None:
            q[edge.follower] = 0.1 + edge.ratio * q[edge.follows]
    return q


def at(built: Built, mode: Mode, state: RobotState) -> mujoco.MjData:
    model = built.model(mode.name)
    data = mujoco.MjData(model)
    Modes({mode.name: mode}).write(state, data)
    mujoco.mj_forward(model, data)
    return data


def test_every_kind_of_joint_occurs() -> None:
    assert {edge.kind for seed in range(FREE + 1) for edge in random_tree(seed)[1]} == KINDS.keys() - {"fixed"}


def test_poses_match_the_formulas(tree: tuple[Built, list[Edge], int]) -> None:
    built, edges, seed = tree
    modes = Modes.parse(built.text("modes.json"))
    q = random_q(edges, np.random.default_rng(seed))
    expected = {"link_0": np.eye(4)}
    for edge in edges:
        expected[f"link_{edge.child}"] = expected[f"link_{edge.parent}"] @ edge.across(q)
    crossed = set()
    for name, mode in modes.items():
        crossed |= {(joint.kind, joint.reversed) for joint in mode.joints}
        state = mode.state(q=q, v={path: 0.3 * k - 1.0 for k, path in enumerate(q)}, base_pose=ELSEWHERE)
        data = at(built, mode, state)
        found = {link: X for link, (X, _) in bodies(data).items()}
        assert (found.keys() == expected.keys() - {"link_1", "link_2"}) if seed == JOINED else (found.keys() == expected.keys())
        for link, X in found.items():
            assert np.linalg.inv(found["link_0"]) @ X == pytest.approx(expected[link], abs=1e-9)
        assert_said(mode, state, data)
        read = modes.read(name, data)
        assert read.q == pytest.approx(state.q, abs=1e-12) and read.v == pytest.approx(state.v, abs=1e-12)
    kind = "free" if seed == FREE else "ball"
    assert {(kind, True), (kind, False)} <= crossed


def test_velocities_match_finite_differences(tree: tuple[Built, list[Edge], int]) -> None:
    built, edges, seed = tree
    rng = np.random.default_rng(seed + 10)
    q, h = random_q(edges, rng), 1e-6
    v = {name: float(rng.uniform(-1, 1)) for name in q}

    def moved(t: float) -> dict[str, float]:
        there = {name: value + t * v[name] for name, value in q.items()}
        for edge in edges:
            if edge.kind in ("ball", "free"):  # its v is the child's angular velocity in its own axes
                turn, rate = (np.array([values[name] for name in edge.coordinates[-3:]]) for values in (q, v))
                turned = (Rotation.from_rotvec(turn) * Rotation.from_rotvec(t * rate)).as_rotvec()
                there |= dict(zip(edge.coordinates[-3:], map(float, turned), strict=True))
        return there

    for name, mode in Modes.parse(built.text("modes.json")).items():
        model = built.model(name)
        expected = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, expected, 2 * h, *(mode.qpos(mode.state(q=moved(t))) for t in (-h, h)))
        assert mode.qvel(mode.state(q=q, v=v)) == pytest.approx(expected, abs=1e-8)


def test_dynamics_with_a_held_link_are_equal_in_all_modes(tree: tuple[Built, list[Edge], int]) -> None:
    built, edges, seed = tree
    modes = Modes.parse(built.text("modes.json"))
    q = random_q(edges, np.random.default_rng(seed + 20))
    followers = {edge.follower: edge for edge in edges if edge.follows is not None}
    paths = [name for edge in edges for name in edge.coordinates if name not in followers]
    loose = modes["loose"]
    start = loose.state(q=q, base_pose=ELSEWHERE)
    data = at(built, loose, start)
    M, bias = mass_matrix(data), np.array(data.qfrc_bias)
    for name in ("first", "last"):
        held = modes[name]
        state = held.state(q=q, base_pose=loose.poses(start)[held.root_link])
        there = at(built, held, state)
        columns: dict[str, list[Array]] = {"held": [], "loose": []}
        J = jacobian(data, held.root_link)
        carried = np.array([loose.qvel(loose.state(q=q, base_pose=ELSEWHERE, base_twist=one)) for one in np.eye(6)]).T
        for path in paths:
            v = {path: 1.0} | {name: edge.ratio for name, edge in followers.items() if edge.follows == path}
            columns["held"].append(held.qvel(held.state(q=q, v=v, base_pose=state.base_pose)))
            alone = loose.qvel(loose.state(q=q, v=v, base_pose=ELSEWHERE))
            columns["loose"].append(alone - carried @ np.linalg.solve(J @ carried, J @ alone))  # so that the link stands still
        T, N = (np.array(columns[one]).T for one in ("held", "loose"))
        own = T.T @ mass_matrix(there) @ T
        assert own == pytest.approx(N.T @ M @ N, abs=1e-8 * np.abs(own).max())
        torque = T.T @ there.qfrc_bias
        assert torque == pytest.approx(N.T @ bias, abs=1e-8 * np.abs(torque).max())
