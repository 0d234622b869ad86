"""Solids that are exactly a primitive, and solids that are only close to one. The oracles are the dimensions that they were built with,
the kernel's inside/outside test, and rays of MuJoCo against rays of the kernel."""

from __future__ import annotations

import importlib.util
import itertools
import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
from build123d import (
    Align,
    Axis,
    Box,
    Compound,
    Cone,
    Cylinder,
    Edge,
    Face,
    Location,
    Plane,
    Pos,
    Rot,
    Shape,
    Solid,
    Sphere,
    Torus,
    Wire,
    chamfer,
    fillet,
    mirror,
)
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.TopAbs import TopAbs_IN, TopAbs_OUT

from thingc.base.primitives import Primitive
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.geometry.worker.kernel.integrals import solids_of
from thingc.geometry.worker.kernel.primitives import primitive_of

STRAIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ANYWHERE = [
    Location(), Location((3, -7, 11), (10, 20, 30)), Location((-400, 90, 1), (90, 0, 45)), Location((0.1, 0.2, 0.3), (0, 180, 0)),
    Location((5000, -8000, 100), (-77, 3, 160)),
]


def solid(shape: Any) -> Any:
    """Return the only solid of a shape."""
    (found,) = solids_of(shape.wrapped)
    return found


def found(shape: Any) -> Primitive | None:
    return primitive_of(solid(shape))


def uncleaned(one: Any, other: Any) -> Shape[Any]:
    """Fuse two solids without removing the edges between them."""
    return Compound(BRepAlgoAPI_Fuse(solid(one), solid(other)).Shape())


def revolved(*edges: Edge) -> Solid:
    return Solid.revolve(Face(Wire(edges)), 360, Axis.Z)


def two_arcs(height: float) -> Solid:
    there = Edge.make_three_point_arc((-5, 0, 0), (0, 5, 0), (5, 0, 0))
    back = Edge.make_three_point_arc((5, 0, 0), (0, -5, 0), (-5, 0, 0))
    return Solid.extrude(Face(Wire([there, back])), (0, 0, height))


def half() -> Any:
    """Return half a cylinder, centred."""
    return Cylinder(5, 6, arc_size=180, align=None)


def pill() -> Any:
    return Cylinder(3, 10) + Pos(0, 0, 5) * Sphere(3) + Pos(0, 0, -5) * Sphere(3)


def turned_pill() -> Solid:
    c = 3 * math.sqrt(0.5)
    return revolved(
        Edge.make_line((0, 0, -8), (0, 0, 8)), Edge.make_three_point_arc((0, 0, 8), (c, 0, 5 + c), (3, 0, 5)),
        Edge.make_line((3, 0, 5), (3, 0, -5)), Edge.make_three_point_arc((3, 0, -5), (c, 0, -5 - c), (0, 0, -8)),
    )


EXACTLY: dict[str, tuple[Callable[[], Any], str, tuple[float, ...]]] = {
    "box": (lambda: Box(10, 20, 30), "box", (5, 10, 15)),
    "thin box": (lambda: Box(100, 200, 0.05), "box", (0.025, 50, 100)),
    "cube": (lambda: Box(7, 7, 7), "box", (3.5, 3.5, 3.5)),
    "box of two halves": (lambda: uncleaned(Pos(-5, 0, 0) * Box(10, 8, 6), Pos(5, 0, 0) * Box(10, 8, 6)), "box", (3, 4, 10)),
    "box cut out of a box": (lambda: Box(10, 20, 30) - Pos(0, 0, 10) * Box(10, 20, 10), "box", (5, 10, 10)),
    "extruded rectangle": (
        lambda: Solid.extrude(Face(Wire.make_polygon([(0, 0, 0), (4, 0, 0), (4, 2, 0), (0, 2, 0)])), (0, 0, 9)), "box", (1, 2, 4.5)
    ),
    "mirrored box": (lambda: mirror(Pos(1, 2, 3) * Rot(10, 20, 30) * Box(1, 2, 3), Plane.YZ), "box", (0.5, 1, 1.5)),
    "scaled box": (lambda: Box(1, 2, 3).scale(4.0), "box", (2, 4, 6)),
    "cylinder": (lambda: Cylinder(5, 20), "cylinder", (5, 10)),
    "disc": (lambda: Cylinder(50, 0.1), "cylinder", (50, 0.05)),
    "two half circles": (lambda: two_arcs(8), "cylinder", (5, 4)),
    "revolved rectangle": (
        lambda: revolved(*Wire.make_polygon([(0, 0, 0), (4, 0, 0), (4, 0, 6), (0, 0, 6)]).edges()), "cylinder", (4, 3)
    ),
    "cylinder of two": (lambda: uncleaned(Cylinder(5, 6), Pos(0, 0, 5) * Cylinder(5, 4)), "cylinder", (5, 5)),
    "cylinder of two halves": (
        lambda: uncleaned(half(), Rot(0, 0, 180) * half()), "cylinder", (5, 3)
    ),
    "mirrored cylinder": (lambda: mirror(Pos(1, 2, 3) * Rot(10, 20, 30) * Cylinder(1, 4), Plane.XZ), "cylinder", (1, 2)),
    "sphere": (lambda: Sphere(4), "sphere", (4,)),
    "two parts of a sphere": (lambda: uncleaned(*(Sphere(4, a, b, align=None) for a, b in ((-90, 20), (20, 90)))), "sphere", (4,)),
    "capsule": (pill, "capsule", (3, 5)),
    "turned capsule": (turned_pill, "capsule", (3, 5)),
}


def box_edged(size: float) -> Any:
    box = Box(100, 80, 60)
    return chamfer(box.edges().sort_by(Axis.Z)[0], size)


def skew(degrees: float) -> Any:
    """Return a prism over a parallelogram."""
    x = 40 * math.tan(math.radians(degrees))
    return Solid.extrude(Face(Wire.make_polygon([(0, 0, 0), (50, 0, 0), (50 + x, 40, 0), (x, 40, 0)])), (0, 0, 9))


def waist() -> Any:
    """Return a cylinder minus two spheres of its radius on its axis."""
    return Cylinder(3, 10) - Pos(0, 0, 5) * Sphere(3) - Pos(0, 0, -5) * Sphere(3)


NOT: dict[str, Callable[[], Any]] = {
    "tiny chamfer": lambda: box_edged(0.001),
    "tiny fillet": lambda: fillet(Box(100, 80, 60).edges().sort_by(Axis.Z)[0], 0.01),
    "hole": lambda: Box(10, 10, 10) - Cylinder(1, 20),
    "blind square hole": lambda: Box(10, 10, 10) - Pos(0, 0, 4) * Box(2, 2, 4),
    "closed hollow": lambda: Box(10, 10, 10) - Box(4, 4, 4),
    "L": lambda: Box(30, 10, 10) + Pos(10, 0, 10) * Box(10, 10, 30),
    "corner missing": lambda: Box(10, 10, 10) - Pos(4, 4, 4) * Box(4, 4, 4),
    "wedge": lambda: Solid.make_wedge(10, 10, 10, 2, 2, 8, 8),
    "hexagonal prism": lambda: Solid.extrude(Face(Wire.make_polygon(
        [(math.cos(k * math.pi / 3), math.sin(k * math.pi / 3), 0) for k in range(6)])), (0, 0, 3)),
    "prism that leans": lambda: skew(20),
    "prism that leans a little": lambda: skew(1e-4),
    "half cylinder": lambda: Cylinder(5, 10, arc_size=180),
    "quarter cylinder": lambda: Cylinder(5, 10, arc_size=90),
    "oblique cylinder": lambda: Cylinder(5, 30) - Pos(0, 0, 20) * Rot(10, 0, 0) * Box(40, 40, 20),
    "nearly square cut": lambda: Cylinder(5, 30) - Pos(0, 0, 20) * Rot(1e-4, 0, 0) * Box(40, 40, 20),
    "both ends oblique": lambda: Cylinder(5, 40) & Rot(10, 0, 0) * Box(40, 40, 20),
    "two side by side": lambda: Cylinder(5, 10) + Pos(4, 0, 0) * Cylinder(5, 10),
    "two across": lambda: Cylinder(5, 20) & Rot(90, 0, 0) * Cylinder(5, 20) & Box(20, 20, 6),
    "elliptic": lambda: Solid.extrude(Face(Wire([Edge.make_ellipse(5, 4)])), (0, 0, 3)),
    "pipe": lambda: Cylinder(5, 10) - Cylinder(3, 10),
    "drilled from one side": lambda: Cylinder(5, 10) - Pos(0, 0, 3) * Cylinder(2, 4),
    "stepped": lambda: Cylinder(5, 10) + Pos(0, 0, 6) * Cylinder(5.001, 2),
    "slot": lambda: Cylinder(5, 10) - Pos(4, 0, 0) * Box(4, 1, 4),
    "chamfered cylinder": lambda: chamfer(Cylinder(5, 10).edges().sort_by(Axis.Z)[-1], 0.01),
    "frustum": lambda: Cone(5, 4.999, 10),
    "half sphere": lambda: Sphere(5, arc_size1=0),
    "hollow sphere": lambda: Sphere(5) - Sphere(4),
    "lens": lambda: Sphere(5) & Pos(0, 0, 2) * Sphere(5),
    "two spheres": lambda: Sphere(5) + Pos(0, 0, 2) * Sphere(5),
    "torus": lambda: Torus(5, 1),
    "bullet": lambda: Cylinder(3, 10) + Pos(0, 0, 5) * Sphere(3),
    "domed": lambda: Cylinder(3, 20) & Pos(0, 0, 1) * Sphere(8) & Pos(0, 0, -1) * Sphere(8),
    "crooked capsule": lambda: Cylinder(3, 10) + Pos(0, 0, 5) * Sphere(3) + Pos(0.01, 0, -5) * Sphere(3),
    "waist": waist,
}


@pytest.mark.parametrize("where", range(len(ANYWHERE)))
@pytest.mark.parametrize("name", EXACTLY)
def test_exact_primitives_are_recognized(name: str, where: int) -> None:
    make, shape, size = EXACTLY[name]
    primitive = found(ANYWHERE[where] * make())
    assert primitive is not None and primitive.shape == shape
    sizes = sorted(primitive.size) if shape == "box" else primitive.size
    np.testing.assert_allclose(sizes, np.array(size) / 1000, rtol=1e-9)
    r = np.array(primitive.pose.rotation)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(r) == pytest.approx(1.0)


@pytest.mark.parametrize("name", NOT)
def test_near_primitives_are_not_recognized(name: str) -> None:
    for where in ANYWHERE[:2]:
        assert found(where * make_not(name)) is None


def make_not(name: str) -> Any:
    shape = NOT[name]()
    assert len(solids_of(shape.wrapped)) == 1 and shape.volume > 0  # the case is what it says
    return shape


def on(primitive: Primitive, factor: float, source: np.random.Generator, count: int) -> np.ndarray:
    """Return points (count, 3) [mm] on the surface of a primitive scaled by `factor`, in the part's frame."""
    size = np.array(primitive.size) * factor
    if primitive.shape == "box":
        local = source.uniform(-1, 1, (count, 3))
        axes = source.integers(0, 3, count)
        local[range(count), axes] = np.sign(local[range(count), axes])
        local *= size
    elif primitive.shape == "cylinder":
        angle, z, within = source.uniform(0, 2 * np.pi, count), source.uniform(-1, 1, count), np.sqrt(source.uniform(0, 1, count))
        ends = source.uniform(0, 1, count) < 0.5
        z[ends], within[~ends] = np.sign(z[ends]), 1.0
        local = np.column_stack([size[0] * within * np.cos(angle), size[0] * within * np.sin(angle), size[1] * z])
    else:
        local = source.normal(size=(count, 3))
        local *= size[0] / np.linalg.norm(local, axis=1)[:, None]
        if primitive.shape == "capsule":  # halves of a ball and the straight part between them
            straight = source.uniform(0, 1, count) < 0.5
            local[straight, :2] *= size[0] / np.linalg.norm(local[straight, :2], axis=1)[:, None]
            local[straight, 2] = source.uniform(-1, 1, int(straight.sum())) * size[1]
            local[~straight, 2] += np.sign(local[~straight, 2]) * size[1]
    return 1000 * (local @ np.array(primitive.pose.rotation).T + primitive.pose.translation)


@pytest.mark.parametrize("name", EXACTLY)
def test_scaled_primitive_is_inside_or_outside_the_solid(name: str) -> None:
    """The kernel classifies points of a smaller primitive as inside the solid, and points of a larger one as outside."""
    source = np.random.default_rng(5)
    for where in ANYWHERE[1:3]:
        exact = solid(where * EXACTLY[name][0]())
        primitive = primitive_of(exact)
        assert primitive is not None
        classifier = BRepClass3d_SolidClassifier(exact)
        for factor, expected in ((1 - 1e-5, TopAbs_IN), (1 + 1e-5, TopAbs_OUT)):
            for point in on(primitive, factor, source, 40):
                classifier.Perform(gp_Pnt(*point), 1e-9)
                assert classifier.State() == expected


def test_axis_aligned_box_has_identity_rotation() -> None:
    """This holds exactly, for every construction and all side lengths."""
    seen = set()
    for angles in itertools.product((0, 90, 180, 270), repeat=3):
        primitive = found(Pos(1, 2, 3) * Rot(*angles) * Box(10, 20, 30))
        assert primitive is not None
        assert primitive.pose.rotation == STRAIGHT and primitive.pose.translation == (0.001, 0.002, 0.003)
        seen.add(primitive.size)
    assert seen == set(itertools.permutations((0.005, 0.01, 0.015)))


def test_box_rotation_is_the_smallest_possible() -> None:
    for angles in itertools.product((0, 90, 180, 270), repeat=3):
        primitive = found(Rot(0, 0, 20) * Rot(*angles) * Box(10, 20, 30))
        assert primitive is not None
        c, s = math.cos(math.radians(20)), math.sin(math.radians(20))
        np.testing.assert_allclose(primitive.pose.rotation, [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-15)
        assert primitive.pose.rotation[2] == (0.0, 0.0, 1.0)


def test_cylinder_direction_is_canonical() -> None:
    """The axis points up; if horizontal, to +y; if along x, to +x. The rotation is the shortest one, whichever end comes first."""
    expected = {
        (0, 0, 1): STRAIGHT,
        (0, 1, 0): ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
        (1, 0, 0): ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)),
    }
    for axis, rotation in expected.items():
        for sign in (1, -1):
            for around in (0, 37, 90):
                plane = Plane((0, 0, 0), z_dir=tuple(sign * c for c in axis))
                primitive = found(plane.location * Rot(0, 0, around) * Cylinder(3, 10))
                assert primitive == Primitive(shape="cylinder", size=(0.003, 0.005), pose=primitive.pose)  # type: ignore[union-attr]
                assert primitive.pose.rotation == rotation and primitive.pose.translation == (0.0, 0.0, 0.0)
    one, other = (found(Rot(20, 30, 0) * Rot(turn, 0, 0) * Cylinder(3, 10)) for turn in (0, 180))
    assert one is not None and other is not None and one.size == other.size
    np.testing.assert_allclose(one.pose.rotation, other.pose.rotation, atol=1e-15)


def test_lengths_are_exact_decimals() -> None:
    """2.5 mm is 0.0025 m, not 0.002499999999999999, even if the kernel has added and subtracted."""
    primitive = found(Pos(0, 0, 14.35) * Box(38.7, 5, 34, align=(Align.CENTER, Align.MIN, Align.CENTER)))
    assert primitive is not None
    assert primitive.size == (19.35 / 1000, 0.0025, 0.017)
    assert primitive.pose.translation == (0.0, 0.0025, 14.35 / 1000)


def test_reversed_solid_is_the_same_primitive() -> None:
    for name in ("box", "cylinder", "sphere", "capsule"):
        exact = solid(EXACTLY[name][0]())
        assert primitive_of(exact.Reversed()) == primitive_of(exact) is not None


def test_volume_and_area_match_the_kernel() -> None:
    for make, shape, _ in EXACTLY.values():
        primitive = found(make())
        assert primitive is not None and primitive.shape == shape
        assert primitive.volume == pytest.approx(make().volume * 1e-9, rel=1e-8)
        assert primitive.area == pytest.approx(make().area * 1e-6, rel=1e-8)


# --- to MuJoCo --------------------------------------------------------------------------------------------------------

PARTS = """
    from build123d import *
    from thingc import Length, MountPoint, Thing


    class Bench(Thing):
        def __init__(self, leg: Length = 30):
            super().__init__()
            self.top = MountPoint(Location((5, 0, 10), (0, 30, 50)))
            self.leg = leg

        def result(self):
            return Box(60, 60, 20)

        def collision(self):
            return [
                Pos(-20, 0, 40) * chamfer(Box(20, 20, 10).edges(), 1), Pos(3, -20, self.leg) * Rot(10, 20, 30) * Box(10, 20, 30),
                Pos(0, 25, 5) * Rot(0, 70, 15) * Cylinder(4, 25), Pos(20, 20, 30) * Sphere(6),
                Pos(20, -20, 60) * Rot(40, 0, 9) * (Cylinder(3, 10) + Pos(0, 0, 5) * Sphere(3) + Pos(0, 0, -5) * Sphere(3)),
                Pos(0, 0, -10) * Box(50, 40, 5), Pos(40, 0, 0) * Cylinder(5, 10, arc_size=180),
            ]
"""
DOCUMENT = """
    thingc: assembly/1
    name: room
    materials: {wood: {density: 700 kg/m^3}}
    defaults: {component: {collision: part, material: wood}}
    components:
      low: {part: benches:Bench}
      high: {part: benches:Bench, attach: {origin: low.top}}
      hidden: {part: benches:Bench, params: {leg: 50 mm}, visual: false}
    joints:
      turn: {type: revolute, parent: high.top, child: hidden.origin, limit: {lower: -1 rad, upper: 1 rad}}
    modes: {standing: {root: low, base: fixed}}
"""


def emitted(place: Any) -> tuple[str, dict[str, bytes]]:
    """Return the XML of the model and its assets."""
    with Environment(str(place.root / "room.yaml"), Options(store=str(place.root.parent / "store"))) as environment:
        compilation = pipeline.compile(environment)
        assert not compilation.report.failed, compilation.report.diagnostics
        files = pipeline.build(environment, compilation, ["mjcf"])["mjcf"].files
    read = {
        name: data if isinstance(data, bytes) else place.store.read(data.sha256) for name, data in files.items()
    }
    assets = {name.rpartition("/")[2]: data for name, data in read.items() if "/assets/" in name}
    return read["mjcf/room_standing.xml"].decode(), assets


def test_rays_hit_geoms_where_they_hit_the_solids(place: Any) -> None:
    """MuJoCo's rays against its primitives are compared with the kernel's rays against the B-rep of `collision()`, over random lines."""
    place.write("parts/benches.py", PARTS)
    place.write("thingc.toml", 'thingc = "workspace/1"\nparts = ["parts"]\n')
    place.write("room.yaml", DOCUMENT)
    text, assets = emitted(place)
    assert emitted(place) == (text, assets)
    model = mujoco.MjModel.from_xml_string(text, assets)
    data = mujoco.MjData(model)
    data.joint("turn").qpos[:] = 0.7
    mujoco.mj_forward(model, data)
    kinds = mujoco.mjtGeom
    expected = [
        kinds.mjGEOM_MESH, kinds.mjGEOM_BOX, kinds.mjGEOM_CYLINDER, kinds.mjGEOM_SPHERE, kinds.mjGEOM_CAPSULE, kinds.mjGEOM_BOX,
        kinds.mjGEOM_MESH,
    ]
    names = {path: [f"{path}:collision{f'_{k}' if k else ''}" for k in range(7)] for path in ("low", "high", "hidden")}
    for own in names.values():
        assert [model.geom(name).type[0] for name in own] == expected
    stem = {path: model.mesh(int(model.geom(own[0]).dataid[0])).name.removesuffix("_part_0") for path, own in names.items()}
    assert stem["low"] == stem["high"] != stem["hidden"]
    for path, own in names.items():  # a mesh is called by the place of its piece among all of them
        assert model.mesh(int(model.geom(own[6]).dataid[0])).name == f"{stem[path]}_part_6"
    assert sorted(assets) == sorted(
        [f"{stem['low']}.obj", *(f"{stem[path]}_part_{k}.obj" for path in ("low", "hidden") for k in (0, 6))]
    )
    source = np.random.default_rng(11)
    specification = importlib.util.spec_from_file_location("benches_here", place.root / "parts" / "benches.py")
    assert specification is not None and specification.loader is not None
    benches = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(benches)
    hits = 0
    for path, leg in (("low", 30), ("high", 30), ("hidden", 50)):
        X_WP = frame_of_mesh(model, data, names[path][0])
        for name, piece in list(zip(names[path], benches.Bench(leg).collision(), strict=True))[1:6]:
            geom = model.geom(name).id
            intersector = IntCurvesFace_ShapeIntersector()
            intersector.Load(solid(piece), 1e-9)
            for _ in range(60):
                way = source.normal(size=3)
                way /= np.linalg.norm(way)
                start = data.geom_xpos[geom] + source.normal(size=3) * 0.004 - 0.2 * way
                local, direction = np.linalg.inv(X_WP) @ [*start, 1.0], X_WP[:3, :3].T @ way
                intersector.Perform(gp_Lin(gp_Pnt(*(1000 * local[:3])), gp_Dir(*direction)), 0.0, 1000.0)
                kernel = min((intersector.WParameter(k) for k in range(1, intersector.NbPnt() + 1)), default=-1000.0)
                distance = mujoco.mju_rayGeom(
                    data.geom_xpos[geom], data.geom_xmat[geom], model.geom_size[geom], start, way, int(model.geom_type[geom]), None
                )
                assert distance == pytest.approx(kernel / 1000, abs=1e-9), name
                hits += distance >= 0
    assert hits > 600


def frame_of_mesh(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> np.ndarray:
    """Return the frame (4, 4) in the world in which a mesh was written: that of its part."""
    geom, mesh = model.geom(name), model.mesh(int(model.geom(name).dataid[0]))
    turned = np.empty(9)
    mujoco.mju_quat2Mat(turned, model.mesh_quat[mesh.id])
    own, placed = np.eye(4), np.eye(4)
    own[:3, :3], own[:3, 3] = turned.reshape(3, 3), model.mesh_pos[mesh.id]
    placed[:3, :3], placed[:3, 3] = data.geom_xmat[geom.id].reshape(3, 3), data.geom_xpos[geom.id]
    return np.asarray(placed @ np.linalg.inv(own))
