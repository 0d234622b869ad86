"""Certified clearance over joint ranges: random mechanisms with known distances, thin parts, mimics, loops, and invalid bounds."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from testing.rig import HEAD, PARALLELOGRAM, SLIDERS, Workspace, two_links
from thingc.base.pose import Pose, along
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.model.resolve.types import JointRange
from thingc.model.robot.types import Keyframe
from thingc.model.solids.clearance import BoundedSolid, SolidPair, SolidPlace, Sweep, body_of, prove
from thingc.model.solids.contact_cells import JointSide, joint_bounds, prove_pairs
from thingc.model.solids.shapes import Solid, solid_of

Array = NDArray[np.float64]

EACH = 25
"""Number of mechanisms per document."""


class Mechanism:
    """A ball on a hinge or a slide, and a fixed shape next to it. Lengths in metres."""

    def __init__(self, source: np.random.Generator) -> None:
        self.turns = bool(source.random() < 0.7)
        self.shape = str(source.choice(["sphere", "box", "cylinder"]))
        self.size = source.uniform(0.005, 0.04, 3)
        self.place, self.turn = source.uniform(-0.1, 0.1, 3), Rotation.random(rng=source)
        self.joint, self.axis = source.uniform(-0.05, 0.05, 3), Rotation.random(rng=source)
        self.offset, self.radius = source.uniform(-0.1, 0.1, 3), float(source.uniform(0.002, 0.02))
        self.low, self.high = sorted((source.uniform(-3.0, 3.0, 2) if self.turns else source.uniform(-0.2, 0.2, 2)).tolist())

    def gap(self, q: Array) -> Array:
        """Return the distance of the ball from the shape at joint positions: a formula for each shape, negative if they overlap."""
        z = np.outer(q, [0.0, 0.0, 1.0])
        moved = Rotation.from_rotvec(z).apply(self.offset) if self.turns else self.offset + z
        p = self.turn.inv().apply(self.joint + self.axis.apply(moved) - self.place)
        if self.shape == "sphere":
            out = np.linalg.norm(p, axis=1) - self.size[0]
        else:
            beyond = np.abs(p) - self.size if self.shape == "box" else np.stack(
                [np.hypot(p[:, 0], p[:, 1]) - self.size[0], np.abs(p[:, 2]) - self.size[1]], axis=1,
            )
            out = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
        return np.asarray(out - self.radius)

    def least(self) -> float:
        """Return the smallest distance over the range, from nested grids around the best point."""
        low, high = self.low, self.high
        for _ in range(4):
            q = np.linspace(low, high, 2001)
            best, step = q[np.argmin(self.gap(q))], (high - low) / 2000
            low, high = max(self.low, best - 2 * step), min(self.high, best + 2 * step)
        return float(self.gap(np.array([best]))[0])

    def written(self, name: str) -> tuple[str, str, str]:
        """Return the text of its components, its mount on the ground, and its joint. Mated mounts face each other, with x and y swapped."""
        radius, length, _ = (float(value) for value in self.size)
        shape = {
            "sphere": f"sphere: {{radius: {radius!r} m}}", "box": f"box: {vector(2.0 * self.size)}",
            "cylinder": f"cylinder: {{radius: {radius!r} m, length: {2.0 * length!r} m}}",
        }[self.shape]
        unit, kind = ("rad", "revolute") if self.turns else ("m", "prismatic")
        limit = f"{{lower: {self.low!r} {unit}, upper: {self.high!r} {unit}}}"
        return (
            f"  {name}: {{link: true, mass: 1 g, shapes: [{{{shape}}}], at: {{in: ground.origin, {pose(self.place, self.turn)}}}}}\n"
            f"  {name}_ball: {{link: true, mass: 1 g, "
            f"shapes: [{{sphere: {{radius: {self.radius!r} m}}, at: {{xyz: {vector(-self.offset[[1, 0, 2]])}}}}}]}}\n",
            f"{name}: {{{pose(self.joint, self.axis)}}}",
            f"  {name}: {{type: {kind}, parent: ground.{name}, child: {name}_ball.origin, limit: {limit}}}\n",
        )


def vector(values: Array, unit: str = "m") -> str:
    return f"[{', '.join(f'{float(value)!r} {unit}' for value in values)}]"


def pose(place: Array, turn: Rotation) -> str:
    return f"xyz: {vector(place)}, rpy: {vector(turn.as_euler('xyz'), 'rad')}"


def sweeps(folder: Path, mechanisms: list[Mechanism]) -> Iterator[tuple[Sweep, SolidPair, Mechanism]]:
    """Yield the range of each mechanism with its two parts, from one document with all of them."""
    texts = [one.written(f"m{number}") for number, one in enumerate(mechanisms)]
    document = folder / "many.yaml"
    document.write_text(
        "thingc: assembly/1\nname: many\ncomponents:\n"
        f"  ground: {{frame: true, mounts: {{{', '.join(mount for _, mount, _ in texts)}}}}}\n" + "".join(parts for parts, _, _ in texts)
        + "joints:\n" + "".join(joint for _, _, joint in texts) + "modes: {bench: {root: ground}}\n"
    )
    with Environment(str(document), Options()) as environment:
        compilation = pipeline.compile(environment)
        assert compilation.assembly is not None, compilation.report.diagnostics
        robot, store = compilation.robots[0], environment.store
    parts = {one.path: one for one in robot.assembly.occurrences}
    bodies = {path: body_of(one, solid, 0.0) for path, one in parts.items() if (solid := solid_of(store, one.solids)) is not None}
    q = {joint.path: 0.0 for body in robot.bodies for joint in body.joints}
    for number, one in enumerate(mechanisms):
        ends = (JointRange(joint=f"m{number}", lower=one.low, upper=one.high),)
        shape, ball = f"m{number}", f"m{number}_ball"
        solids = bodies[shape], bodies[ball]
        pair = SolidPair(parts[shape].index, parts[ball].index, solids[0].error + solids[1].error, deep=1e-5, bodies=solids)
        yield Sweep(robot, Keyframe(name="zero", q=q, origin=()), ends), pair, one


Mechanisms = list[tuple[Sweep, SolidPair, Mechanism]]


@pytest.fixture(scope="module")
def thousand(tmp_path_factory: pytest.TempPathFactory) -> Mechanisms:
    source = np.random.default_rng(37)
    folder = tmp_path_factory.mktemp("mechanisms")
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    return [each for _ in range(1000 // EACH) for each in sweeps(folder, [Mechanism(source) for _ in range(EACH)])]


def fresh(pair: SolidPair, required: float) -> SolidPair:
    return replace(pair, clearance=required)


def test_verdicts_for_random_mechanisms(thousand: Mechanisms) -> None:
    """The ball touches, or the required clearance is barely met or barely missed. Facets of a cylinder deviate by at most 0.1 % of its
    radius."""
    source, counts = np.random.default_rng(38), {"clear": 0, "touches": 0, "undecided": 0}
    for sweep, pair, mechanism in thousand:
        least, off = mechanism.least(), 2e-3 * mechanism.size.max() * (mechanism.shape == "cylinder") + 3e-5
        required = max(least, 0.0) * float(source.choice([0.0, 0.9, 1.1]))
        one = fresh(pair, required)
        prove(sweep, [one])
        counts[one.verdict] += 1
        if least < required or (required == 0.0 and least < 0.0):
            assert one.verdict != "clear", (least, required)
        if least < required - off or (required == 0.0 and least < -2e-3):
            assert one.verdict == "touches", (least, required)
        if least > required + off:
            assert one.verdict == "clear", (least, required)
    assert counts["clear"] > 300 and counts["touches"] > 200 and counts["undecided"] < 50, counts


def test_wrong_speed_bound_gives_wrong_verdicts(thousand: Mechanisms, monkeypatch: pytest.MonkeyPatch) -> None:
    """With half the speed bound, some touching pairs are reported as clear, so the other tests would detect such an error."""
    def halved(*arguments: Any) -> tuple[Array, Array]:
        gaps, paths = right(*arguments)
        return gaps, 0.5 * paths

    right = SolidPlace.bounds
    monkeypatch.setattr(SolidPlace, "bounds", halved)
    wrong = 0
    for sweep, pair, mechanism in thousand[:300]:
        if (least := mechanism.least()) > 0.0:
            one = fresh(pair, 1.01 * least)
            prove(sweep, [one])
            wrong += one.verdict == "clear"
    assert wrong > 20


VANE = HEAD + """\
components:
  ground: {frame: true, mounts: {hinge: {}, far: {xyz: 0 0 50 mm}}}
  pin: {part: rig_parts:Block, params: {x: 0.5 mm, y: 0.5 mm, z: 10 mm}, at: {in: ground.origin, xyz: 31.234 17.1 0 mm}}
  hub: {part: rig_parts:Block, params: {x: 4 mm, y: 4 mm, z: 2 mm}}
  vane: {part: rig_parts:Block, params: {x: 40 mm, y: 0.2 mm, z: 2 mm}, at: {in: hub.origin, xyz: 20 0 0 mm}}
joints:
  turn: {type: TYPE, parent: ground.hinge, child: hub.originLIMIT}
modes: {bench: {root: ground}}
"""


def collisions(answer: dict[str, Any]) -> list[str]:
    return [found["message"] for found in answer["diagnostics"] if found["code"] == "TC655"]


def vane(kind: str = "revolute", limit: str = ", limit: {lower: -170 deg, upper: 170 deg}") -> str:
    return VANE.replace("TYPE", kind).replace("LIMIT", limit)


@pytest.mark.parametrize("text", [vane(), vane("continuous", "")])
def test_thin_vane_passing_a_pin_is_found(rig: Workspace, text: str) -> None:
    """Between two of 200 samples the vane moves by 1 mm. At 0 it points along -y: they meet at 90 deg + atan(17.1 / 31.234) = 118.7 deg."""
    tests = "  sampled: {no_collision: {joints: all, samples: 200}}\n  proved: {no_collision: {joints: all, certify: true}}\n"
    answer = rig.test(text, tests)
    assert [result["passed"] for result in answer["tests"]] == [True, False]
    (message,) = collisions(answer)
    assert "`pin` and `vane` overlap" in message and abs(float(message.rpartition("turn = ")[2].removesuffix(" deg")) - 118.7) < 1.0
    assert answer["by_name"]["proved"]["measured"]["certificate"]["touches"] == ["pin and vane"]


def test_range_that_avoids_the_pin_is_clear(rig: Workspace) -> None:
    answer = rig.test(vane(), "  proved: {no_collision: {joints: {turn: [-170 deg, 117.6 deg]}, certify: true}}\n")
    assert answer["code"] == 0 and answer["by_name"]["proved"]["measured"]["certificate"]["proved"] == ["pin and hub", "pin and vane"]


def test_two_joints_are_certified_in_all_combinations(rig: Workspace) -> None:
    """Blocks of 20 mm on one rail: more than 20 mm apart everywhere, or overlapping somewhere."""
    answer = rig.test(SLIDERS, (
        "  clear: {no_collision: {joints: {one: [-200 mm, -1 mm], two: [20 mm, 200 mm]}, certify: true, clearance: 0.9 mm}}\n"
        "  close: {no_collision: {joints: {one: [-200 mm, -1 mm], two: [20 mm, 200 mm]}, certify: true, clearance: 1.1 mm}}\n"
        "  meet: {no_collision: {joints: [one, two], certify: true}}\n"
    ))
    assert [result["passed"] for result in answer["tests"]] == [True, False, False]
    assert answer["by_name"]["clear"]["measured"]["certificate"]["proved"] == ["left and right"]


def test_exact_contact_is_undecided(rig: Workspace) -> None:
    """Blocks are planar, so their meshes are exact: contact is undecided only if it is exact, too."""
    test = "  near: {no_collision: {joints: {one: [-50 mm, 0 mm]}, pose: touching, certify: true}}\n"
    answer = rig.test(SLIDERS, test)
    assert answer["code"] == 0 and [(d["code"], d["severity"]) for d in answer["diagnostics"]] == [("TC663", "warning")]
    assert answer["by_name"]["near"]["measured"]["certificate"]["undecided"] == ["left and right"]
    assert rig.test(SLIDERS + 'allow: {TC610: "they lie in the floor"}\n', test, "--strict")["code"] == 1
    allowed = test.replace("certify: true", "certify: true, allow: [{pair: [left, right], reason: a stop}]")
    assert rig.test(SLIDERS, allowed)["diagnostics"] == []


def test_mimic_joints_are_followed(rig: Workspace) -> None:
    """`right` mirrors `left`: they meet in the middle, 10 mm from the zero of each."""
    text = SLIDERS.replace("limit: {lower: -200 mm, upper: 200 mm}}\nposes", "limit: {lower: -200 mm, upper: 200 mm}, "
                           "mimic: {joint: one, multiplier: -1}}\nposes").partition("poses:")[0] + "modes: {bench: {root: ground}}\n"
    answer = rig.test(text, (
        "  apart: {no_collision: {joints: {one: [-200 mm, -10.01 mm]}, certify: true}}\n"
        "  meet: {no_collision: {joints: {one: [-200 mm, -9 mm]}, certify: true}}\n"
    ))
    assert [result["passed"] for result in answer["tests"]] == [True, False]


def test_pairs_with_many_joints_are_sampled(rig: Workspace) -> None:
    """Three blocks on a chain of slides: the middle pairs are certified; the end pairs are sampled, and contacts are found by descent."""
    text = HEAD + "components:\n  ground: {frame: true, mounts: {x: {rpy: 0 90 0 deg}}}\n" + "".join(
        f"  {name}: {{part: rig_parts:Block, params: {{x: 1 mm, y: 1 mm, z: 1 mm}}}}\n" for name in "abcd"
    ) + "  post: {part: rig_parts:Block, params: {x: 1 mm}, at: {in: ground.origin, xyz: 77.7 0 0 mm}}\njoints:\n" + "".join(
        f"  {name}: {{type: prismatic, parent: {parent}, child: {name}.left, limit: {{lower: 20 mm, upper: 40 mm}}}}\n"
        for name, parent in zip("abcd", ("ground.x", "a.right", "b.right", "c.right"), strict=True)
    ) + "modes: {bench: {root: ground}}\nposes: {apart: {a: 20 mm, b: 20 mm, c: 20 mm, d: 20 mm}}\n"
    answer = rig.test(text, "  all: {no_collision: {joints: all, certify: true, samples: 5, pose: apart}}\n")
    certificate = answer["by_name"]["all"]["measured"]["certificate"]
    assert {"a and b", "b and c", "a and c", "a and post"} <= {*certificate["proved"]}
    assert "c and post" in certificate["touches"] and "a and d" in certificate["sampled"]


def test_closed_loops_are_followed(rig: Workspace) -> None:
    """A block is in the way of the coupler of a parallelogram, which reaches it at a crank angle of 40 deg, 74.3 mm lower."""
    stop = "  stop: {part: rig_parts:Block, params: {x: 4 mm, y: 4 mm, z: 2 mm}, at: {in: ground.origin, xyz: 190 0 HEIGHT mm}}\n"
    text = PARALLELOGRAM.replace("DRIVE", "").replace("  rocker: {part", f"{stop}  rocker: {{part", 1)
    for height, passes in ((-74, False), (-76, True)):
        answer = rig.test(text.replace("HEIGHT", str(height)), "  turn: {no_collision: {joints: {crank: [0, 40 deg]}, certify: true}}\n")
        found = answer["by_name"]["turn"]
        touches = found["measured"]["certificate"]["touches"]
        assert ("coupler and stop" in touches) is not passes, (height, touches, found["said"])


def test_invalid_options_are_reported(rig: Workspace) -> None:
    for tests, said in (
        ("  a: {no_collision: {certify: true}}\n", "`certify` requires `joints`"),
        ("  a: {no_collision: {certify: true, joints: [oen]}}\n", "there is no joint `oen`"),
        ("  a: {no_collision: {certify: true, joints: []}}\n", "joints"),
    ):
        rig.write(SLIDERS, tests)
        code, out, err = rig.run(str(rig.folder / "rig.yaml"))
        assert code == 1 and said in out + err and (out + err).count("error[") == 1, out + err


def test_certifying_one_joint_is_fast(rig: Workspace) -> None:
    rig.test(two_links(), "  warm: {no_collision: {}}\n")
    started = time.process_time()
    answer = rig.test(two_links(), "  turn: {no_collision: {joints: [elbow], certify: true}}\n")
    assert answer["by_name"]["turn"]["seconds"] > 0.0 and time.process_time() - started < 4.0


def test_vane_that_touches_its_own_hinge_part_is_found(rig: Workspace) -> None:
    """The pin belongs to the plate on which the vane slides. Both touch in all positions, so the remaining surfaces are compared in
    rings."""
    (rig.folder / "parts" / "vane_parts.py").write_text("""
from build123d import Align, Box, Location, Pos

from thingc import MountPoint, Thing


class Base(Thing):
    def __init__(self):
        super().__init__(material="stuff")
        self.body = Pos(0, 0, -5) * Box(100, 100, 10) + Pos(31.234, 17.1, 5) * Box(0.5, 0.5, 10)
        self.hinge = MountPoint(Location((0, 0, 0)))

    def result(self):
        return self.body


class Rotor(Thing):
    def __init__(self):
        super().__init__(material="stuff")
        self.body = Pos(0, 0, 4) * Box(8, 8, 8) + Pos(20, 0, 6) * Box(40, 0.2, 4)
        self.hub = MountPoint(Location((0, 0, 0), (180, 0, 0)))

    def result(self):
        return self.body
""")
    text = HEAD + (
        "components: {base: {part: vane_parts:Base}, rotor: {part: vane_parts:Rotor}}\n"
        "joints: {turn: {type: revolute, parent: base.hinge, child: rotor.hub, limit: {lower: -170 deg, upper: 170 deg}}}\n"
    )
    tests = (
        "  all: {no_collision: {joints: all, certify: true}}\n"
        "  half: {no_collision: {joints: {turn: [-170 deg, 117 deg]}, certify: true}}\n"
        "  other: {no_collision: {joints: {turn: [120 deg, 170 deg]}, certify: true}}\n"
    )
    answer = rig.test(text, tests)
    assert [result["passed"] for result in answer["tests"]] == [False, True, True], answer["diagnostics"]
    assert "turn = 11" in collisions(answer)[0] and answer["by_name"]["half"]["measured"]["certificate"]["contact"]


def solid(whole: Manifold) -> Solid:
    return Solid(whole, ((whole, 0.0),))


def plate_and_hub(folder: Path, kind: str, end: float) -> tuple[Sweep, list[int], list[Pose]]:
    """Return the sweep of a joint `move` from -end to end [rad or m], and the indices of a plate on the ground and of a hub, which moves.
    The poses are those of the ground in the frames of both parts at the position 0."""
    unit, ball = "rad" if kind == "revolute" else "m", "{link: true, mass: 1 g, shapes: [{sphere: {radius: 1 mm}}]"
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (document := folder / "cells.yaml").write_text(
        "thingc: assembly/1\nname: cells\ncomponents:\n  ground: {frame: true, mounts: {hinge: {}}}\n"
        f"  plate: {ball}, at: {{in: ground.origin, xyz: 5 -7 3 mm}}}}\n  hub: {ball}}}\njoints:\n"
        f"  move: {{type: {kind}, parent: ground.hinge, child: hub.origin, limit: {{lower: -{end} {unit}, upper: {end} {unit}}}}}\n"
        "modes: {bench: {root: ground}}\n"
    )
    with Environment(str(document), Options()) as environment:
        compilation = pipeline.compile(environment)
        assert compilation.assembly is not None, compilation.report.diagnostics
        robot = compilation.robots[0]
    paths = [one.path for one in robot.assembly.occurrences]
    indices = [paths.index(name) for name in ("plate", "hub")]
    sweep = Sweep(robot, Keyframe(name="zero", q={"move": 0.0}, origin=()), (JointRange(joint="move", lower=-end, upper=end),))
    assert (place := sweep.place([0.0])) is not None
    return sweep, indices, [place.at(index).inverse() for index in indices]


def test_parts_that_come_into_contact_are_compared_in_cells(tmp_path: Path) -> None:
    """The arm of the hub slides onto a pad of the same height, 1.5 rad from the middle of the range. Without cells, hundreds of positions
    would be compared, because the arm may enter the pad by less than the distance by which it moves."""
    sweep, indices, poses = plate_and_hub(tmp_path, "revolute", 2.0)
    block = Manifold.cube((4, 4, 1)).translate((8, -2, 0)).scale([1e-3] * 3)
    pad, arm = block.translate((0, 0, -1e-3)).rotate((0, 0, 86)), solid(block)
    for height, verdict in ((0.0, "contact"), (1e-5, "touches"), (-1e-4, "clear")):
        bodies = BoundedSolid(solid(pad.translate((0.0, 0.0, height))).at(poses[0]), 0.0), BoundedSolid(arm.at(poses[1]), 0.0)
        pair = SolidPair(*indices, joined=True, deep=5e-6, bodies=bodies)
        prove_pairs(sweep, [pair])
        assert (pair.verdict, pair.apart) == (verdict, True) and (pair.seen < 30 or verdict != "contact")
    # A second pad is under the arm in the middle of the range. The gap of 3e-6 m is smaller than the errors of the surfaces.
    near, high = block.translate((0.0, 0.0, -1e-3 - 3e-6)), pad.translate((0.0, 0.0, 3e-6))
    for pads, verdict in ((near, "clear"), (near + high, "contact")):
        bodies = BoundedSolid(solid(pads).at(poses[0]), 1e-5), BoundedSolid(arm.at(poses[1]), 0.0)
        pair = SolidPair(*indices, error=1e-5, joined=True, deep=5e-6, bodies=bodies)
        prove_pairs(sweep, [pair])
        assert (pair.verdict, pair.seen) == (verdict, 1)


def test_contact_on_slanted_faces_is_compared_in_cells(tmp_path: Path) -> None:
    """A wedge slides in a groove, so the bounds of both overlap in the cells around their faces. A deeper wedge cuts into the groove."""
    sweep, indices, poses = plate_and_hub(tmp_path, "prismatic", 0.01)
    wedge = Manifold.hull_points(np.array([(x, y, z) for x, y in ((0, 0), (9, 4), (-7, 4)) for z in (0, 5)], dtype=np.float64))
    groove = Manifold.cube((20, 6, 40)).translate((-10, -2, -15)) - wedge.scale((1.0, 1.0, 9.0)).translate((0, 0, -20))
    for deeper, verdict in ((0.0, "contact"), (0.1, "touches")):
        whole = [solid(each.scale([1e-3] * 3)) for each in (groove, wedge.translate((0.0, -deeper, 0.0)))]
        plate, hub = (BoundedSolid(one.at(pose), 0.0) for one, pose in zip(whole, poses, strict=True))
        pair = SolidPair(*indices, joined=True, deep=1e-5, bodies=(plate, hub))
        prove_pairs(sweep, [pair])
        assert pair.verdict == verdict


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_parts_in_contact_at_a_joint_are_compared_in_cells(kind: str, tmp_path: Path) -> None:
    """A plate and a hub touch in all positions, and each carries a random box away from the contact. The oracle is the volume of the
    intersection in a grid of positions, and in the position that is reported."""
    turns = kind == "revolute"
    end = 2.0 if turns else 0.02
    sweep, indices, poses = plate_and_hub(tmp_path, kind, end)
    places = [place for q in np.linspace(-end, end, 81).tolist() if (place := sweep.place([q])) is not None]
    source, counts = np.random.default_rng(39), {"touches": 0, "contact": 0}
    for _ in range(6 if turns else 12):
        solids = []
        # The plate is below z = 0, and the hub above. For a slide, both are turned, so that the normal of the contact is x.
        # Two posts that do not collide make all cells higher, so that cells of the first level contain contacts and boxes.
        for corner, size, post in (((-20, -20, -2), (40, 40, 2), -19.5), ((-15, -15, 0), (30, 30, 1), -0.5)):
            box = source.uniform([1.0, 1.0, 1.0], [20.0, 20.0, 3.0])
            at = [*source.uniform(-20.0, 20.0, 2) - box[:2] / 2.0, source.uniform(1.2, 4.0)]
            made = Manifold.cube(size).translate(corner) + Manifold.cube((1, 1, 12)).translate((post, post, 0))
            made += Manifold.cube(box.tolist()).translate(at)
            solids.append(solid(made.rotate((0.0, 0.0 if turns else 90.0, 0.0)).scale([1e-3] * 3)))
        plate, hub = (BoundedSolid(one.at(pose), 0.0) for one, pose in zip(solids, poses, strict=True))
        pair = SolidPair(*indices, joined=True, deep=1e-5, bodies=(plate, hub))
        most = max(place.overlap(pair)[0] for place in places)
        prove_pairs(sweep, [pair])
        counts[pair.verdict] += 1
        if pair.verdict == "touches":
            assert (place := sweep.place([pair.q["move"]])) is not None and place.overlap(pair)[0] > 1e-13
        else:
            assert pair.verdict == "contact" and most < 1e-9, most
    assert min(counts.values()) > 0, counts


def test_bounds_contain_all_points_of_triangles() -> None:
    """Triangles are sampled densely. The axis passes through some of them, and the others come close to it inside of an edge or at a
    corner."""
    source = np.random.default_rng(40)
    weights = source.dirichlet([0.4] * 3, 20_000)
    axis = 0
    for _ in range(60):
        corners = source.uniform(-1.0, 1.0, (1, 3, 3))
        points = weights @ corners[0]
        radii = np.hypot(points[:, 0], points[:, 1])
        low, high = (bounds[0] for bounds in joint_bounds(corners, turns=True))
        assert low[0] - 1e-12 <= radii.min() < low[0] + 0.02 and radii.max() - 1e-12 <= high[0] < radii.max() + 0.02
        axis += low[0] == 0.0
        assert np.allclose([low[1], high[1]], [corners[:, :, 2].min(), corners[:, :, 2].max()])
        low, high = (bounds[0] for bounds in joint_bounds(corners, turns=False))
        assert np.allclose([low, high], [corners.min(axis=(0, 1))[:2], corners.max(axis=(0, 1))[:2]])
    assert 5 < axis < 40


@pytest.mark.parametrize("turns", [True, False])
def test_bounds_in_cells_contain_all_points_of_solids(turns: bool) -> None:
    """The solid is a union of boxes and of a hollow cylinder, and its points are sampled in these shapes. Some cells are completely inside
    of the solid, so that no triangle is in them."""
    source = np.random.default_rng(41)
    tube = Manifold.cylinder(1.0, 3.0, -1.0, 96) - Manifold.cylinder(3.0, 1.0, -1.0, 96, True)
    radii, angles = np.sqrt(source.uniform(1.01, 8.9, 5_000)), source.uniform(0.0, 2.0 * np.pi, 5_000)
    points = [np.stack([radii * np.cos(angles), radii * np.sin(angles), source.uniform(0.0, 1.0, 5_000)], axis=1)]
    for corner, size in zip(source.uniform(-4.0, 2.0, (3, 3)), source.uniform(0.5, 3.0, (3, 3)), strict=True):
        tube += Manifold.cube(size.tolist()).translate(corner.tolist())
        points.append(corner + size * source.uniform(0.0, 1.0, (5_000, 3)))
    pose = along((0.48, -0.6, 0.64), (1.0, -2.0, 3.0))
    side = JointSide(BoundedSolid(solid(tube).at(pose), 0.0), pose, turns)
    x, y, z = np.concatenate(points).T
    coordinates = np.stack([np.hypot(x, y), z] if turns else [x, y], axis=1)
    filled = empty = 0
    for low in source.uniform([0.0, -3.0], [4.0, 3.0], (300, 2)):
        cell = np.stack([low, low + source.uniform(0.02, 1.0, 2)])
        inside = coordinates[((coordinates >= cell[0]) & (coordinates <= cell[1])).all(axis=1)]
        first, last = side.bounds_in(((cell[0, 0], cell[1, 0]), (cell[0, 1], cell[1, 1])))
        assert (inside >= first - 1e-9).all() and (inside <= last + 1e-9).all()
        filled += bool((first == cell[0]).all() and (last == cell[1]).all())
        empty += bool((first == np.inf).any())
    assert 20 < filled < 280 and (empty > 20 or not turns), (filled, empty)
