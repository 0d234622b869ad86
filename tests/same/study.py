"""`make same`: disguised robots that must be recognised, and robots with one small physical change that must not be.

For each robot, disguises are written as MJCF or URDF, with another root, names, frames, joint zeros and signs, and with split bodies.
`thingc same` must find them equal. MuJoCo checks the map: in random configurations, the distances between centres of mass and joint axes
must be equal to 1e-9 m. The same number of disguises get one physical change of 1e-4, and must be found different.

The robots are the examples, the gallery and the fixtures of imports, or all robots below the folder of `--robots`.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from msgspec.structs import replace

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from same.changes import KINDS, changed
from same.disguises import BALL, Disguise, Graph, disguised, mjcf, read, urdf
from thingc.base.diagnostics import Report
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.tools.diff.cached_snapshots import BrokenDocument
from thingc.tools.diff.checkouts import Checkout
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import ENDINGS, import_robot
from thingc.tools.same.comparison import MechanismComparison, compare_mechanisms
from thingc.tools.same.mechanism import Mechanism
from thingc.tools.same.sides import read_side

ROOT = Path(__file__).resolve().parents[2]
EXACT = 1e-9
"""Largest difference of distances [m]."""
SOURCE = ImportRequest(meshes=False, repair="nearest")
"""How robot files are read. Inertias that are not physical are repaired, so that the study can use these robots."""
GALLERY = sorted(path for path in ROOT.glob("gallery/*/*.yaml") if path.stem == path.parent.name)
OWN = (ROOT / "assemblies/arm.yaml", ROOT / "assemblies/minchw/minchw.yaml", *GALLERY)


@dataclass
class Subject:
    """A robot: the mechanism of its file, and its graph, mechanism and MuJoCo model as read from an MJCF model of it."""

    name: str
    original: Mechanism
    graph: Graph
    written: Mechanism
    model: mujoco.MjModel


def mechanism(path: Path) -> Mechanism:
    """Read a mechanism as `thingc same` reads it."""
    return read_side(Checkout(path=str(path), kind="model" if path.suffix in ENDINGS else "document"), Options(), SOURCE)


def subject(path: Path, folder: Path) -> Subject:
    """Read a robot. Raises ValueError with a reason if the study cannot use it."""
    document, texts = path, {}
    if path.suffix in ENDINGS:
        imported = import_robot(str(path), Report(), SOURCE)
        if imported is None:
            raise ValueError("it cannot be imported")
        document = folder / "robot.yaml"
        texts = {str(document): imported.files[imported.document]}
    with Environment(str(document), Options(texts=texts)) as environment:
        compilation = pipeline.compile(environment)
        if not compilation.robots:
            raise ValueError("it does not compile")
        holds = [any(closure.hold for closure in robot.closures) for robot in compilation.robots]
        compilation = replace(compilation, robots=compilation.robots[holds.index(False) :][:1] if False in holds else ())
        if not compilation.robots:
            raise ValueError("every mode holds a mount")
        files = pipeline.emit(environment, compilation, ["mjcf"], verify=0)["mjcf"].contents(environment.store)
    robot = compilation.robots[0]
    text = files[f"mjcf/{robot.name}_{robot.mode.name}.xml"].decode()
    spec = mujoco.MjSpec.from_string(without_shapes(text))
    graph = plain(read(spec.compile()))
    if not list(graph.axes()):
        raise ValueError("it has no joints")
    children = {edge.child for edge in graph.edges}
    root = next(name for name in graph.bodies if name not in children)
    source = folder / "written.xml"
    source.write_text(mjcf(graph, root, free=False))
    original, written = mechanism(path), mechanism(source)
    if not compare_mechanisms(original, written).same:
        print(f"{path.name}: its MJCF model is another mechanism, which is used in its place", flush=True)
        original = written
    return Subject(path.stem, original, graph, written, mujoco.MjModel.from_xml_path(str(source)))


def without_shapes(text: str) -> str:
    """Return an MJCF model with its bodies, joints and equalities only."""
    import xml.etree.ElementTree as tree

    root = tree.fromstring(text)
    for section in ("asset", "actuator", "sensor", "keyframe", "contact", "tendon", "default", "custom", "size", "visual", "statistic"):
        for found in root.findall(section):
            root.remove(found)
    for parent in list(root.iter()):
        parent.attrib.pop("class", None)
        parent.attrib.pop("childclass", None)
        for child in list(parent):
            if child.tag in ("geom", "camera", "light", "flag") or child.tag == "body" and child.get("mocap") == "true":
                parent.remove(child)
    return tree.tostring(root, encoding="unicode")


def plain(graph: Graph) -> Graph:
    """Return the robot with names that every format accepts."""
    bodies = {name: f"body{n}" for n, name in enumerate(graph.bodies)}
    joints = {axis.name: f"joint{n}" for n, axis in enumerate(graph.axes())}
    for body in graph.bodies.values():
        body.name = bodies[body.name]
    for edge in graph.edges:
        edge.parent, edge.child = bodies[edge.parent], bodies[edge.child]
        for axis in edge.axes:
            axis.name = joints[axis.name]
            axis.follows = None if axis.follows is None else (joints[axis.follows[0]], axis.follows[1])
    graph.connects = [(bodies[a], p, bodies[b], q) for a, p, b, q in graph.connects]
    graph.bodies = {body.name: body for body in graph.bodies.values()}
    return graph


def write(disguise: Disguise, folder: Path, draw: random.Random) -> tuple[Path, mujoco.MjModel]:
    """Write a disguise as MJCF or URDF, and return the path and its MuJoCo model."""
    text = mjcf(disguise.graph, disguise.root, free=draw.random() < 0.5)
    model = mujoco.MjModel.from_xml_string(text)
    other = urdf(disguise.graph, disguise.root) if draw.random() < 0.5 else None
    path = folder / ("disguise.xml" if other is None else "disguise.urdf")
    path.write_text(text if other is None else other)
    return path, model


def readable(graph: Graph, place: Path, draw: random.Random) -> tuple[Disguise, Path, mujoco.MjModel, Mechanism]:
    """Return a disguise that can be imported, and what `write` and `mechanism` return.

    An import fails if a coupled joint starts outside of its limits.
    """
    for _ in range(20):
        disguise = disguised(graph, draw)
        path, model = write(disguise, place, draw)
        with contextlib.suppress(BrokenDocument):
            return disguise, path, model, mechanism(path)
    raise AssertionError("no disguise can be imported")


def distances(model: mujoco.MjModel, q: dict[str, float], bodies: list[list[str]], joints: list[str]) -> np.ndarray:
    """Return the distances between the centres of mass of links, and of these centres to the axes of joints, in MuJoCo."""
    data = mujoco.MjData(model)
    for name, value in q.items():
        data.qpos[model.jnt_qposadr[model.joint(name).id]] = value
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    centres = []
    for parts in bodies:
        ids = [model.body(name).id for name in parts]
        masses = model.body_mass[ids]
        centres.append(masses @ data.xipos[ids] / masses.sum())
    points = np.array(centres).reshape(-1, 3)
    apart = [np.linalg.norm(points[:, None] - points[None], axis=2).ravel()]
    for name in joints:
        number = model.joint(name).id
        away, axis = points - data.xanchor[number], data.xaxis[number]
        if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_HINGE:
            apart.append(np.linalg.norm(np.cross(away, axis), axis=1))
        elif model.jnt_type[number] == mujoco.mjtJoint.mjJNT_BALL:
            apart.append(np.linalg.norm(away, axis=1))
    return np.concatenate(apart)


def apart(robot: Subject, disguise: Disguise, model: mujoco.MjModel, found: MechanismComparison, draw: random.Random) -> float:
    """Return the largest difference of distances [m] between a robot and its disguise, with the map that was found."""
    other = disguise.graph
    pairs = [(one.one, one.other) for one in found.links if one.one in robot.graph.bodies and robot.graph.bodies[one.one].mass > 0.0]
    ours = [[one] for one, _ in pairs]
    theirs = [[b, *(part.name for part in other.bodies.values() if part.fixed is not None and part.fixed[0] == b)] for _, b in pairs]
    theirs = [whole(other, names[0]) for names in theirs]
    kinds = {axis.name: axis for axis in robot.graph.axes()}
    joints = [one for one in found.joints if one.one in kinds]
    worst = 0.0
    for _ in range(4):
        q = {one.one: draw.uniform(*(kinds[one.one].range or (-1.0, 1.0))) for one in joints if kinds[one.one].kind != BALL}
        there = {one.other: one.sign * q[one.one] + one.zero for one in joints if one.one in q}
        a = distances(robot.model, q, ours, [one.one for one in joints])
        b = distances(model, there, theirs, [one.other for one in joints])
        worst = max(worst, float(abs(a - b).max(initial=0.0)))
    return worst


def whole(graph: Graph, name: str) -> list[str]:
    """Return the names of all bodies that are fixed to a body."""
    own = graph.bodies[name]
    head = own.fixed[0] if own.fixed is not None else name
    return [head, *(part.name for part in graph.bodies.values() if part.fixed is not None and part.fixed[0] == head)]


def true_map(disguise: Disguise, found: MechanismComparison) -> bool:
    """Return whether the map is the true one. Zeros that nothing determines are not compared."""
    for one in found.joints:
        if one.one in disguise.joints:
            name, sign, zero = disguise.joints[one.one]
            turns = 2.0 * np.pi if one.kind == "rotation" else 1e300
            off = abs(np.remainder(one.zero - zero + turns / 2.0, turns) - turns / 2.0)
            if one.other != name or one.kind != "ball" and (one.sign != sign or one.determined and off > 1e-6):
                return False
    return True


def robots(folder: str | None) -> Iterator[Path]:
    """Yield the files of robots: of the repository, or below a folder."""
    if folder is None:
        yield from OWN
        yield from sorted((ROOT / "tests/importing/robots").glob("*.[ux]*"))
        return
    for path in sorted(Path(folder).rglob("*")):
        if path.suffix in (".urdf", ".xml", ".sdf") and not path.stem.startswith("scene"):
            yield path


def subjects(folder: str | None, place: Path) -> list[Subject]:
    """Read all robots that the study can use, and print why it cannot use the others."""
    found = []
    for n, path in enumerate(robots(folder)):
        here = place / str(n)
        here.mkdir()
        try:
            found.append(subject(path, here))
        except BrokenDocument as broken:
            print(f"not used: {path.name}: {broken.diagnostics[0].message}", flush=True)
        except ValueError as fault:
            print(f"not used: {path.name}: {fault}", flush=True)
    return found


class Tally:
    """Counts results, and prints every wrong one."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.worst = 0.0
        self.slowest = (0.0, "")

    def disguise(self, robot: Subject, place: Path, draw: random.Random) -> None:
        """Try one disguise."""
        disguise, path, model, other = readable(robot.graph, place, draw)
        verdict, found = compare_mechanisms(robot.original, other), compare_mechanisms(robot.written, other)
        if not (verdict.same and found.same):
            self.counts["not recognised"] += 1
            print(f"not recognised: {robot.name} {path.suffix} {verdict.same} {found.same} {verdict.differences[:3]}", flush=True)
            return
        distance = apart(robot, disguise, model, found, draw)
        self.worst = max(self.worst, distance)
        right = true_map(disguise, found)
        self.counts["recognised"] += 1
        self.counts["with the true map" if right else "with another of several maps" if found.maps > 1 else "with a wrong map"] += 1
        self.counts["map not exact"] += distance > EXACT
        if distance > EXACT or not right and found.maps == 1:
            print(f"wrong map: {robot.name} {path.suffix}: {distance:.2g} m, {found.joints}", flush=True)

    def change(self, robot: Subject, place: Path, draw: random.Random, kind: str) -> bool:
        """Try one physical change of this kind, in a disguise. Return whether the robot has such a change."""
        new = changed(robot.graph, draw, kind)
        if new is None:
            return False
        _, path, _, other = readable(new, place, draw)
        began = time.process_time()
        found = compare_mechanisms(robot.written, other)
        self.slowest = max(self.slowest, (time.process_time() - began, robot.name))
        self.counts["false equals" if found.same else "found different"] += 1
        self.counts["explained by a map"] += not found.same and bool(found.links)
        self.counts["explained by one difference"] += not found.same and len(found.differences) == 1 and bool(found.links)
        if found.same:
            print(f"false equal: {robot.name} {kind} {path.suffix}", flush=True)
        return True


def main() -> int:
    """Run the study, and return 1 if a robot was not recognised or a change was not found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--number", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robots", default=None)
    arguments = parser.parse_args()
    draw, tally, began = random.Random(arguments.seed), Tally(), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        found = subjects(arguments.robots or None, place)
        for n, robot in zip(range(arguments.number), itertools.cycle(found)):
            tally.disguise(robot, place, draw)
            if n % 100 == 99:
                print(f"{n + 1} disguises, {time.monotonic() - began:.0f} s", flush=True)
        done = 0
        for robot in itertools.cycle(found):
            done += tally.change(robot, place, draw, draw.choice(KINDS))
            if done % 100 == 99:
                print(f"{done + 1} changes, {time.monotonic() - began:.0f} s", flush=True)
            if done >= arguments.number:
                break
    print(f"{len(found)} robots, {arguments.number} disguises and changes each, {time.monotonic() - began:.0f} s")
    for name, count in sorted(tally.counts.items()):
        print(f"{count:6} {name}")
    print(f"largest difference of distances with the map: {tally.worst:.2g} m")
    print(f"slowest explanation of a change: {tally.slowest[0]:.2f} s of CPU time ({tally.slowest[1]})")
    bad = ("not recognised", "with a wrong map", "map not exact", "false equals")
    return int(any(tally.counts[name] for name in bad))


if __name__ == "__main__":
    sys.exit(main())
