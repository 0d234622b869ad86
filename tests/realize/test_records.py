"""Part records against analytic results: volumes, areas, centres and inertias of bodies with closed-form integrals."""

from __future__ import annotations

import io
import math
import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from realize.conftest import Place, part
from thingc.base.pose import Pose
from thingc.base.primitives import Primitive
from thingc.geometry.client import Workers
from thingc.geometry.record import Mesh, PartFailure, PartRecord, PartSchema
from thingc.geometry.record_json import blobs_of, from_json, record_from_json, record_to_json, to_json

PARTS = """
    from typing import Literal
    from build123d import *
    from thingc import Actuator, Angle, Count, Length, MountPoint, Ratio, Thing

    class Block(Thing):
        '''A block.

        Args:
            width: along x
        '''
        bom = {"make": "buy", "number": "B-1"}
        actuator = Actuator(kind="position", stall_torque=(4.1, "vendor"), gear_ratio=10, rotor_inertia=2e-6, kp=3)

        def __init__(self, width: Length = 30, depth: Length = 20, height: Length = 10, tilt: Angle = 0):
            super().__init__(material="petg", color="#102030")
            self.body = Pos(5, 0, 0) * Rot(0, 0, tilt) * Box(width, depth, height)
            self.top = MountPoint(Location((5, 0, height / 2), (0, 90, 0)), interface="m3", tolerance=0.2)
            self.holes = [MountPoint(Location((x, 0, 0))) for x in (1, 2)]
            self.outline = Rectangle(width, depth)

        def result(self):
            return self.body

    class Rod(Thing):
        def __init__(self, radius: Length = 7, height: Length = 13):
            super().__init__()
            self.body = Cylinder(radius, height)

        def result(self):
            return self.body

        def mass(self):
            return (0.082, "measured")

        def centre(self):
            return (0, 0, 1.5)

        def collision(self):
            return [Pos(0, 0, -3) * Box(4, 4, 6), Sphere(3), Cone(3, 1, 5)]

        def visual(self):
            return Box(1, 1, 1)

    class Drilled(Thing):
        def __init__(self):
            super().__init__()
            self.body = fillet(Box(40, 30, 12).edges(), 2) - [Pos(x, 0, 0) * Cylinder(2, 20) for x in (-12, -4, 4, 12)]

        def result(self):
            return self.body

    class Pair(Thing):
        def __init__(self):
            super().__init__()
            self.left = Box(10, 10, 10)
            self.right = Pos(10, 10, 0) * Box(10, 10, 10)     # touches along an edge

        def result(self):
            return [self.left, self.right]

    class Crossed(Thing):
        def result(self):
            return Cylinder(7, 13) - Rot(90, 0, 0) * Cylinder(3, 30)

    class Slotted(Thing):
        def result(self):
            slot = Box(20, 6, 9) + Pos(10, 0, 0) * Cylinder(3, 9) + Pos(-10, 0, 0) * Cylinder(3, 9)
            oval = extrude(Ellipse(8, 4), 9, both=True)
            return Pos(700, -300, 200) * Rot(0, 0, 30) * (Box(60, 40, 5) - Pos(-15, 5, 0) * slot - Pos(15, -5, 0) * oval)

    class InsideOut(Thing):
        def result(self):
            ring = Cylinder(7, 13) - Cylinder(3, 13)
            return Solid(ring.solid().wrapped.Reversed())

    class Far(Thing):
        def result(self):
            return Pos(1000, 2000, -3000) * Rot(10, 20, 30) * Box(1, 2, 3)

    class Hollow(Thing):
        def result(self):
            return Sphere(10) - Sphere(6)

    class Angle_(Thing):
        def result(self):
            return Box(30, 10, 10) + Pos(10, 0, 10) * Box(10, 10, 30)

    class FrameOnly(Thing):
        def __init__(self):
            super().__init__()
            self.here = MountPoint(Location((1, 2, 3)))

    class Seated(Thing):
        def __init__(self):
            super().__init__()
            self.seat = MountPoint(Location((0, 0, 5)))
            self.block = self.seat.align(Block(width=31).top)

        def result(self):
            return Box(10, 10, 10)

    def washer(outer: float = 10, thin: bool = False) -> Part:
        '''A washer.'''
        return Cylinder(outer, 1) - Cylinder(3, 1)

    class Typed(Thing):
        def __init__(
            self, kind: Literal["a", "b"] = "b", teeth: Count = 12, twist: int = -3, fill: Ratio = 0.5, angle: Angle = 35,
            text: str = "x",
        ):
            super().__init__()

        def result(self):
            return None

    class Pieces(Thing):
        '''Blocks of 8, 1 and 1 cm^3, put together in one of many ways.'''

        def __init__(self, how: str = "plus"):
            super().__init__(material="petg")
            large, near, far = Box(20, 20, 20), Pos(15, 0, 0) * Box(10, 10, 10), Pos(50, 0, 0) * Box(10, 10, 10)
            self.body = {
                "plus": lambda: large + far, "moved": lambda: Pos(1, 2, 3) * (large + far), "three": lambda: large + near + far,
                "cut": lambda: large - Box(2, 50, 50), "fuse": lambda: large.fuse(far), "builder": lambda: self.built(),
                "edge": lambda: large + Pos(15, 15, 0) * Box(10, 10, 10), "joined": lambda: large + near,
                "list": lambda: [large, far], "compound": lambda: Compound([large, far]),
                "children": lambda: Compound(children=[large, far]), "sum": lambda: sum([far, large], Part()),
            }[how]()

        def built(self):
            with BuildPart() as block:
                Box(20, 20, 20)
                with Locations((50, 0, 0)):
                    Box(10, 10, 10)
            return block.part

        def result(self):
            return self.body

    class Base(Thing):
        '''What others are derived from.'''

    class Forgot(Thing):
        def result(self):
            Box(1, 1, 1)

    class Without(Base):
        def result(self):
            return None

    def posts() -> Compound:
        return Box(20, 20, 20) + Pos(50, 0, 0) * Box(10, 10, 10)
"""


APART = ("plus", "moved", "three", "cut", "fuse", "builder", "sum")
TOGETHER = ("edge", "joined", "list", "compound", "children")


@pytest.fixture(scope="module")
def records(module_place: Any, define: Any) -> dict[str, Any]:
    """Return the records of all parts of this module, modelled once."""
    module_place.write("parts/shapes.py", PARTS)
    wanted = {
        "block": define("shapes:Block", width=0.03, depth=0.02, height=0.01, tilt=0.0),
        "tilted": define("shapes:Block", width=0.03, depth=0.02, height=0.01, tilt=0.5235987755982988),
        "rod": define("shapes:Rod", radius=0.007, height=0.013),
        "drilled": define("shapes:Drilled"), "pair": define("shapes:Pair"), "hollow": define("shapes:Hollow"),
        "crossed": define("shapes:Crossed"), "slotted": define("shapes:Slotted"),
        "inside out": define("shapes:InsideOut"), "far": define("shapes:Far"),
        "frame": define("shapes:FrameOnly"), "seated": define("shapes:Seated"),
        "washer": define("shapes:washer", outer=10.0, thin=False), "library": define("shapes:Sphere", radius=5.0),
        "convex": define("shapes:Angle_"), "posts": define("shapes:posts"),
        **{how: define("shapes:Pieces", how=how) for how in (*APART, *TOGETHER)},
    }
    with module_place.service() as service:
        found = service.realize(list(wanted.values()), convex={"shapes:Angle_": (0,)})
    return {name: found[definition.text] for name, definition in wanted.items()}


def close(found: Any, expected: Any, scale: float, precision: float = 1e-12) -> None:
    np.testing.assert_allclose(np.array(found), np.array(expected), rtol=precision, atol=precision * scale)


@pytest.mark.parametrize("how", (*APART, "posts"))
def test_disjoint_solids_are_detected(records: dict[str, PartRecord], how: str) -> None:
    expected = {"cut": (3.6e-6, 3.6e-6), "three": (9e-6, 1e-6)}.get(how, (8e-6, 1e-6))
    assert records[how].apart == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("how", (*TOGETHER, "block", "drilled", "hollow", "library"))
def test_touching_or_intended_solids_are_not_reported(records: dict[str, PartRecord], how: str) -> None:
    assert records[how].apart == ()


def test_thing_without_result_is_an_error(module_place: Any, records: dict[str, PartRecord]) -> None:
    with module_place.service() as service:
        found = service.describe(["shapes:Base", "shapes:Forgot", "shapes:Without"])
    assert isinstance(found["shapes:Without"], PartSchema)
    for name, words, line in (
        ("shapes:Base", "`shapes:Base` has no `result()`, which must return its geometry", "class Base(Thing):"),
        ("shapes:Forgot", "`shapes:Forgot` has a `result()` without a `return` statement", "def result(self):"),
    ):
        failure = found[name]
        assert isinstance(failure, PartFailure) and failure.file is not None and failure.line is not None
        assert (failure.kind, failure.message) == ("resultless", words)
        assert Path(failure.file).read_text().splitlines()[failure.line - 1].strip() == line


def test_record_of_a_block(records: dict[str, PartRecord]) -> None:
    a, b, c = 0.03, 0.02, 0.01
    record = records["block"]
    close(record.volume, a * b * c, 0)
    close(record.area, 2 * (a * b + b * c + c * a), 0)
    close(record.centre, (0.005, 0, 0), a)
    v = a * b * c / 12
    close(record.inertia, np.diag([v * (b * b + c * c), v * (a * a + c * c), v * (a * a + b * b)]), v * a * a)
    close(record.box, ((-0.01, -0.01, -0.005), (0.02, 0.01, 0.005)), a)
    assert record.material == "petg"
    assert record.color == "#102030"
    assert record.bom == {"make": "buy", "number": "B-1"}
    assert record.actuator is not None
    assert record.actuator.armature == pytest.approx(2e-4, rel=1e-15)
    assert record.actuator.sources == {"stall_torque": "vendor"}
    assert list(record.mounts) == ["top", "holes_0", "holes_1"]
    assert record.mounts["top"].pose == Pose(rotation=((0, 0, 1), (0, 1, 0), (-1, 0, 0)), translation=(0.005, 0, 0.005))
    assert (record.mounts["top"].interface, record.mounts["top"].tolerance) == ("m3", 0.0002)
    assert record.references == ("body", "outline")
    assert record.code is not None
    assert record.code[0].endswith("parts/shapes.py")
    assert record.code[1] == 1 + PARTS.splitlines()[1:].index("    class Block(Thing):") + 1


def test_small_block_far_from_origin_keeps_precision(records: dict[str, PartRecord]) -> None:
    record, v = records["far"], 6e-9
    close(record.volume, v, 0)
    close(record.centre, (1.0, 2.0, -3.0), 0, 1e-14)
    close(np.linalg.eigvalsh(record.inertia), (v * 5e-6 / 12, v * 10e-6 / 12, v * 13e-6 / 12), 0)


def test_rotated_block_has_rotated_inertia(records: dict[str, PartRecord]) -> None:
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    close(records["tilted"].inertia, turn @ np.array(records["block"].inertia) @ turn.T, 3e-10)


def test_distant_plate_with_slot_and_ellipse(records: dict[str, PartRecord]) -> None:
    """Planar faces bounded by lines, arcs and an ellipse: area, first and second moments of three figures. Along an ellipse the kernel
    stops when the volume is accurate to 1e-11; the centre is then accurate to 1e-8, the inertia to 1e-6."""
    record, r, t = records["slotted"], 3.0, 5.0
    half, arm = math.pi * r * r / 2, 10 + 4 * r / (3 * math.pi)  # of a half disc: its area, and how far its centre is from the slot's
    slot_area = 120 + 2 * half
    slot_xx = 20 * 6**3 / 12 + math.pi * r**4 / 4
    slot_yy = 6 * 20**3 / 12 + 2 * (math.pi * r**4 / 8 - half * (4 * r / (3 * math.pi)) ** 2 + half * arm**2)
    figures = [  # sign, area, centre, second moments about x and y through the centre
        (1, 2400.0, (0, 0), 60 * 40**3 / 12, 40 * 60**3 / 12), (-1, slot_area, (-15, 5), slot_xx, slot_yy),
        (-1, 32 * math.pi, (15, -5), math.pi / 4 * 8 * 4**3, math.pi / 4 * 8**3 * 4),
    ]
    area = sum(sign * a for sign, a, *_ in figures)
    x, y = (sum(sign * a * centre[k] for sign, a, centre, *_ in figures) / area for k in (0, 1))
    xx, yy, xy = (
        sum(sign * one for sign, one in zip((f[0] for f in figures), ones, strict=True))
        for ones in (
            [ix + a * (c[1] - y) ** 2 for _, a, c, ix, _ in figures], [iy + a * (c[0] - x) ** 2 for _, a, c, _, iy in figures],
            [a * (c[0] - x) * (c[1] - y) for _, a, c, *_ in figures],
        )
    )
    close(record.volume, area * t * 1e-9, 0, 5e-11)
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    close(record.centre, (turn @ (x, y, 0) + (700, -300, 200)) * 1e-3, 0, 3e-9)
    flat = area * t**3 / 12
    inertia = np.array([[xx * t + flat, -xy * t, 0], [-xy * t, yy * t + flat, 0], [0, 0, (xx + yy) * t]])
    close(record.inertia, turn @ inertia @ turn.T * 1e-15, inertia.max() * 1e-15, 5e-6)
    from scipy.special import ellipe

    borders = 200 + (40 + 2 * math.pi * r) + 4 * 8 * ellipe(1 - (4 / 8) ** 2)
    close(record.area, (2 * area + borders * t) * 1e-6, 0, 1e-5)


def test_inverted_solid_has_the_same_mass_properties(records: dict[str, PartRecord]) -> None:
    record, area, h = records["inside out"], math.pi * (49 - 9) * 1e-6, 0.013
    close(record.volume, area * h, 0)
    close(record.centre, (0, 0, 0), h)
    along, across = (49 + 9) * 1e-6 / 2, (49 + 9) * 1e-6 / 4 + h * h / 12
    close(record.inertia, np.diag([across, across, along]) * area * h, area * h * along)
    assert record.meshes["mesh"].closed


def test_record_of_a_rod(records: dict[str, PartRecord]) -> None:
    r, h = 0.007, 0.013
    record = records["rod"]
    v = math.pi * r * r * h
    close(record.volume, v, 0)
    close(record.area, 2 * math.pi * r * (r + h), 0)
    close(record.centre, (0, 0, 0), r)
    across = v * (3 * r * r + h * h) / 12
    close(record.inertia, np.diag([across, across, v * r * r / 2]), across)
    assert record.mass is not None
    assert (record.mass.value, record.mass.source) == (0.082, "measured")
    assert record.com is not None
    assert record.com.value == (0.0, 0.0, 0.0015)
    cylinder = record.fits["cylinder"]
    np.testing.assert_allclose(cylinder.size, (r, h / 2), rtol=1e-9)
    np.testing.assert_allclose(record.fits["sphere"].size, [math.hypot(r, h / 2)], rtol=1e-9)


def test_record_of_a_hollow_sphere(records: dict[str, PartRecord]) -> None:
    outer, inner = 0.010, 0.006
    record = records["hollow"]
    close(record.volume, 4 / 3 * math.pi * (outer**3 - inner**3), 0)
    close(record.area, 4 * math.pi * (outer**2 + inner**2), 0)
    close(record.inertia, np.eye(3) * 8 / 15 * math.pi * (outer**5 - inner**5), 1e-10)


def test_volume_of_a_rod_with_a_cross_hole(records: dict[str, PartRecord]) -> None:
    """The hole is the integral, over the section of the smaller cylinder, of the chord through the larger one."""
    from scipy.integrate import quad

    hole, _ = quad(lambda t: 2 * math.sqrt(49 - 9 * math.sin(t) ** 2) * 18 * math.cos(t) ** 2, -math.pi / 2, math.pi / 2)
    # the kernel's curve of intersection is good to 1e-7 mm
    assert records["crossed"].volume == pytest.approx((math.pi * 49 * 13 - hole) * 1e-9, rel=1e-9)


def test_record_of_two_touching_solids(records: dict[str, PartRecord]) -> None:
    record = records["pair"]
    close(record.volume, 2e-6, 0)
    close(record.centre, (0.005, 0.005, 0), 0.01)
    assert record.meshes["print"].closed


def test_functions_and_library_classes_are_parts(records: dict[str, PartRecord]) -> None:
    close(records["washer"].volume, math.pi * (10**2 - 3**2) * 1e-9, 0)
    close(records["library"].volume, 4 / 3 * math.pi * 125e-9, 0)
    assert records["washer"].code is not None
    assert records["washer"].code[0].endswith("parts/shapes.py")


def test_record_of_a_part_without_geometry(records: dict[str, PartRecord]) -> None:
    record = records["frame"]
    assert (record.volume, record.area, record.box, record.brep, record.meshes, record.fits) == (0.0, 0.0, None, None, {}, {})
    assert record.mounts["here"].pose.translation == (0.001, 0.002, 0.003)


def test_expected_parts_are_definition_texts(records: dict[str, PartRecord]) -> None:
    (expected,) = records["seated"].expectations
    assert (expected.mount, expected.text, expected.child_mount) == ("seat", "shapes:Block(width=0.031)", "top")


def read_stl(data: bytes) -> np.ndarray[Any, Any]:
    """Return the corners of every triangle of an STL file, without the code under test."""
    (count,) = struct.unpack_from("<I", data, 80)
    assert len(data) == 84 + 50 * count
    return np.array([struct.unpack_from("<12fH", data, 84 + 50 * i)[3:12] for i in range(count)]).reshape(-1, 3, 3)


def read_obj(data: bytes) -> np.ndarray[Any, Any]:
    """Return the corners of every triangle of an OBJ file that contains only vertices followed by triangles."""
    lines = [line.split() for line in data.decode().splitlines()]
    points = np.array([[float(word) for word in words] for kind, *words in lines if kind == "v"])
    faces = [[int(word) - 1 for word in words] for kind, *words in lines if kind == "f"]
    assert [kind for kind, *_ in lines] == ["v"] * len(points) + ["f"] * len(faces)
    return points[faces]


def enclosed(corners: np.ndarray[Any, Any]) -> float:
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


@pytest.mark.parametrize("name", ["block", "rod", "drilled", "pair", "hollow", "washer"])
def test_meshes_are_closed_and_face_outwards(name: str, records: dict[str, PartRecord], module_place: Any) -> None:
    record = records[name]
    for kind, scale in (("print", 1e-3), ("mesh", 1.0), ("hull", 1.0)):
        mesh = record.meshes[kind]
        data = module_place.store.read(mesh.sha256)
        assert len(data) == mesh.size
        corners = (read_stl if kind == "print" else read_obj)(data)
        assert len(corners) == mesh.faces
        assert mesh.closed
        assert not mesh.flat
        edges: Counter[tuple[bytes, bytes]] = Counter()
        for triangle in corners:
            points = [point.tobytes() for point in triangle]
            assert len(set(points)) == 3
            edges.update(zip(points, points[1:] + points[:1], strict=True))
        assert all(edges[other, one] == count for (one, other), count in edges.items())
        volume = enclosed(corners) * scale**3
        if kind == "hull":
            assert volume >= record.volume * (1 - 1e-2)
        else:
            assert volume == pytest.approx(record.volume, rel=0.02)
            assert volume > 0


def test_hull_of_a_drilled_block_fills_the_holes(records: dict[str, PartRecord], module_place: Any) -> None:
    record = records["drilled"]
    hull = enclosed(read_obj(module_place.store.read(record.meshes["hull"].sha256)))
    holes = 4 * math.pi * 0.002**2 * 0.012
    assert hull == pytest.approx(record.volume + holes, rel=0.01)


def test_visual_and_collision_meshes(records: dict[str, PartRecord], module_place: Any) -> None:
    record = records["rod"]
    lines = module_place.store.read(record.meshes["visual"].sha256).decode().splitlines()
    vertices = np.array([[float(word) for word in line.split()[1:]] for line in lines if line.startswith("v ")])
    assert vertices.shape == (8, 3)
    np.testing.assert_allclose(np.abs(vertices), 0.0005)
    assert sum(line.startswith("f ") for line in lines) == 12
    box, ball, cone = record.pieces
    assert box == Primitive(shape="box", size=(0.002, 0.002, 0.003), pose=Pose(translation=(0.0, 0.0, -0.003)))
    assert ball == Primitive(shape="sphere", size=(0.003,), pose=Pose())
    assert isinstance(cone, Mesh)
    assert enclosed(read_obj(module_place.store.read(cone.sha256))) == pytest.approx(math.pi * 5 / 3 * 13e-9, rel=0.03)


def test_record_lists_all_blobs_it_needs(records: dict[str, PartRecord]) -> None:
    """The record is valid only while the meshes of its pieces are in the store."""
    record = records["rod"]
    meshes = [mesh for mesh in (*record.meshes.values(), *record.pieces) if isinstance(mesh, Mesh)]
    assert len(meshes) == 6
    assert set(blobs_of(record_to_json(record, "/ws"))) == {(record.brep, None), *((mesh.sha256, mesh.size) for mesh in meshes)}


def test_convex_pieces_are_made_only_on_request(records: dict[str, PartRecord], module_place: Any, define: Any) -> None:
    assert records["block"].convex == {}
    pieces = [enclosed(read_obj(module_place.store.read(piece.sha256))) for piece in records["convex"].convex[0]]
    assert len(pieces) == 2
    assert sum(pieces) == pytest.approx(5e-6, rel=0.01)
    assert [piece.closed for piece in records["convex"].convex[0]] == [True, True]
    with module_place.service(workers=Workers(1)) as service:  # they are kept by the mesh: no worker is needed
        again = service.realize([define("shapes:Angle_")], convex={"shapes:Angle_": (0,)})
        assert {text: one.reused for text, one in service.decisions.items()} == {"shapes:Angle_": True}
    assert again["shapes:Angle_"] == records["convex"]


@pytest.mark.parametrize("name", ["block", "tilted", "rod", "drilled", "hollow"])
def test_fits_enclose_the_mesh(name: str, records: dict[str, PartRecord], module_place: Any) -> None:
    record = records[name]
    points = read_obj(module_place.store.read(record.meshes["mesh"].sha256)).reshape(-1, 3)
    for fit in record.fits.values():
        rotation, origin = np.array(fit.pose.rotation), np.array(fit.pose.translation)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
        local = (points - origin) @ rotation
        room = 1e-7
        if fit.shape == "box":
            assert (np.abs(local) <= np.array(fit.size) + room).all()
        elif fit.shape == "sphere":
            assert (np.linalg.norm(local, axis=1) <= fit.size[0] + room).all()
        else:
            radius, half = fit.size
            beyond = np.maximum(np.abs(local[:, 2]) - half, 0)
            across = np.hypot(local[:, 0], local[:, 1])
            reach = np.hypot(across, beyond) if fit.shape == "capsule" else across + beyond * 1e9
            assert (reach <= radius + room).all() if fit.shape == "capsule" else (across <= radius + room).all()


def test_fitted_box_follows_the_rotation(records: dict[str, PartRecord]) -> None:
    assert sorted(records["tilted"].fits["box"].size) == pytest.approx([0.005, 0.01, 0.015], rel=1e-6)


def test_schemas_of_parts(module_place: Any, records: dict[str, PartRecord]) -> None:
    with module_place.service() as service:
        found = service.describe([f"shapes:{name}" for name in ("Block", "washer", "Typed", "Sphere", "Blocc")])
    block = found["shapes:Block"]
    assert isinstance(block, PartSchema)
    assert [(p.name, p.kind, p.default, p.required) for p in block.parameters] == [
        ("width", "length", 0.03, False), ("depth", "length", 0.02, False), ("height", "length", 0.01, False),
        ("tilt", "angle", 0.0, False),
    ]
    assert block.parameters[0].doc == "along x"
    assert (block.kind, block.material, block.actuator) == ("thing", "petg", True)
    assert block.doc.startswith("A block.")
    washer = found["shapes:washer"]
    assert isinstance(washer, PartSchema)
    assert [(p.name, p.kind, p.default) for p in washer.parameters] == [("outer", "number", 10.0), ("thin", "flag", False)]
    assert washer.kind == "function"
    typed = found["shapes:Typed"]
    assert isinstance(typed, PartSchema)
    kinds = {p.name: (p.kind, p.default) for p in typed.parameters}
    assert kinds["kind"] == ("choice", "b")
    assert kinds["teeth"] == ("count", 12) and kinds["twist"] == ("integer", -3)
    assert kinds["angle"] == ("angle", 0.6108652381980153)  # 35 deg, rounded once
    assert isinstance(found["shapes:Sphere"], PartSchema)
    assert found["shapes:Sphere"].kind == "shape"
    missing = found["shapes:Blocc"]
    assert isinstance(missing, PartFailure)
    assert (missing.kind, missing.message) == ("missing", "the module `shapes` has no `Blocc`")
    assert "shapes:Block" in missing.candidates


def test_records_round_trip_through_json(records: dict[str, PartRecord]) -> None:
    import json

    from msgspec.structs import replace

    for record in records.values():
        value = json.loads(json.dumps(record_to_json(record, "/ws")))
        assert record_from_json(value, "/ws") == replace(record, convex={})
    failure = PartFailure(subject="a:B", kind="raised", message="ValueError: x", file="/ws/parts/a.py", line=3, candidates=("C",))
    assert to_json(failure, "/ws")["file"] == "parts/a.py"
    assert from_json(to_json(failure, "/ws"), "/ws", PartFailure) == failure


def test_repeated_runs_give_identical_records(records: dict[str, PartRecord], module_place: Any, tmp_path: Any, define: Any) -> None:
    from thingc.geometry.store.local import Store

    store, module_place.store = module_place.store, Store(str(tmp_path / "other"))
    try:
        with module_place.service() as service:
            again = service.realize([define("shapes:Drilled"), define("shapes:Rod", radius=0.007, height=0.013)])
    finally:
        module_place.store = store
    assert again["shapes:Drilled"] == records["drilled"]
    assert again["shapes:Rod(height=0.013, radius=0.007)"] == records["rod"]


def test_corners_are_free_of_noise(place: Place) -> None:
    """When a boolean operation merges two corners, the kernel keeps the one with the lower address: 0 in one run, 2e-31 in the next."""
    place.write("parts/noisy.py", """\
        from build123d import Plane, Solid
        from thingc import Thing

        class Noisy(Thing):
            def result(self):
                return Solid.make_box(10, 20, 30, Plane((0, 2e-31, 5 + 4e-13)))
    """)
    definition = part("noisy:Noisy")
    with place.service() as service:
        record = service.realize([definition])[definition.text]
    assert isinstance(record, PartRecord)
    mesh = trimesh.load(io.BytesIO(place.store.read(record.meshes["print"].sha256)), file_type="stl")
    assert sorted(map(tuple, mesh.vertices)) == [(x, y, z) for x in (0.0, 10.0) for y in (0.0, 20.0) for z in (5.0, 35.0)]


@pytest.mark.parametrize(("offset", "words"), [
    (5.0, ("the 2 solids overlap by 500 mm^3; fuse the solids (`a + b`)",)),
    (9.9, ()), (10.0, ()),
])
def test_overlapping_solids_are_reported(place: Place, offset: float, words: tuple[str, ...]) -> None:
    place.write("parts/twins.py", f"""\
        from build123d import Box, Pos
        from thingc import Thing

        class Twins(Thing):
            def result(self):
                return [Box(10, 10, 10), Pos({offset}, 0, 0) * Box(10, 10, 10)]
    """)
    definition = part("twins:Twins")
    with place.service() as service:
        record = service.realize([definition])[definition.text]
    assert isinstance(record, PartRecord) and tuple(one.message for one in record.warnings) == words
    assert record.volume == pytest.approx(2e-6)
