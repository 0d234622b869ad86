"""Mirror images against the same part modelled with negated coordinates, and against signs that no rotation can change."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from msgspec.structs import replace

from realize.conftest import Place, file_part, part
from thingc.base.primitives import Primitive
from thingc.geometry.lock.json_format import read_record, record_values
from thingc.geometry.record import PartFailure, PartRecord
from thingc.geometry.record_json import record_from_json, record_to_json
from thingc.geometry.store.meshes import arrays, exact_arrays
from thingc.geometry.worker.kernel.meshing import Triangles

LEG = """
    from build123d import *
    from thingc import Actuator, Length, MountPoint, Thing

    OUTLINE = [(-30, -8), (34, -8), (34, 5), (10, 9), (-30, 6)]
    LETTER = [(0, 0), (0, 6), (4, 6), (4, 5), (1, 5), (1, 3.5), (3, 3.5), (3, 2.5), (1, 2.5), (1, 0)]       # an F

    class Leg(Thing):
        '''`x`, `y`, `z`: -1 negates that coordinate of every point.'''
        bom = {"make": "print", "number": "L-1", "supplier": "us"}
        actuator = Actuator(kind="motor", stall_torque=2)

        def __init__(self, length: Length = 7, x: int = 1, y: int = 1, z: int = 1):
            super().__init__(material="petg", color="#102030")
            self.signs = (x, y, z)
            self.print = {"up": (x * 0.48, y * 0.64, z * 0.6)}
            points = [(x * u, y * v) for u, v in OUTLINE]
            letter = [(x * (u + 2), y * (v - 3)) for u, v in LETTER]
            plate = extrude(make_face(Polyline(*points, close=True)), z * length, dir=(0, 0, 1))
            text = extrude(make_face(Polyline(*letter, close=True)), z * length, dir=(0, 0, 1))
            bore = Pos(x * -20, y * 2, 0) * Cylinder(2.5, 60)
            peg = Pos(x * 25, y * -3, z * 9) * Cylinder(1.5, 8)
            self.body = plate + peg - Pos(0, 0, z * 6) * text - bore
            self.hip = MountPoint(Location(Plane(
                origin=(x * -30, y * 1, z * 3), x_dir=(0, y * 0.6, z * 0.8), z_dir=(x * -1, 0, 0))), interface="hip", tolerance=0.1)
            self.foot = MountPoint(Location(Plane(
                origin=(x * 34, y * -2, z * 4), x_dir=(x * 0.48, y * 0.6, z * -0.64), z_dir=(x * 0.8, 0, z * 0.6))))

        def result(self):
            return self.body

        def visual(self):
            x, y, z = self.signs
            return Pos(x * 3, y * 2, z * 1) * Box(4, 2, 1)

        def collision(self):
            x, y, z = self.signs
            rod = Pos(x * 10, y * -4, z * 6) * Rot(y * z * 20, x * z * 30, x * y * 10) * Cylinder(2, 9)
            return [Pos(x * 3, y * 2, z * 5) * Sphere(2), rod]

        def mass(self):
            return (0.05, "measured")

        def centre(self):
            x, y, z = self.signs
            return (x * 1.5, y * -2.5, z * 3.5)

        def matrix_of_inertia(self):
            x, y, z = self.signs
            return ((4e-6, x * y * 1e-6, x * z * 2e-7), (x * y * 1e-6, 5e-6, y * z * -3e-7), (x * z * 2e-7, y * z * -3e-7, 6e-6))

    class Spring(Thing):
        '''A wire that winds three times about z: left and right differ though every turn is whole.'''

        def __init__(self):
            super().__init__(material="petg")
            path = Helix(pitch=6, height=18, radius=8)
            self.body = sweep(Plane(origin=path @ 0, z_dir=path % 0) * Circle(1), path)

        def result(self):
            return self.body

    class Screw(Thing):
        bom = {"make": "buy", "number": "M3"}

        def __init__(self):
            super().__init__(material="petg")
            self.body = Cylinder(1.5, 20) + Pos(0, 0, 11) * Cylinder(3, 2)
            self.tip = MountPoint(Location((0, 0, -10), (180, 0, 0)))

        def result(self):
            return self.body

    class Sided(Screw):
        '''The same, with a mount at one side of the head.'''

        def __init__(self):
            super().__init__()
            self.side = MountPoint(Location((3, 0, 11), (0, 90, 0)))
"""

SIGNS = {"x": (-1, 1, 1), "y": (1, -1, 1), "z": (1, 1, -1)}


@pytest.fixture(scope="module")
def records(module_place: Place) -> dict[str, PartRecord]:
    """Return the records of all parts of these tests, modelled together, by definition text."""
    module_place.write("parts/leg.py", LEG)
    plain = part("leg:Leg")
    wanted = [plain, *(plain.mirror_image(axis) for axis in "xyz"), *(part("leg:Leg", **{axis: -1}) for axis in "xyz")]
    wanted += [part(f"leg:{name}").mirror_image(axis) for name in ("Spring", "Screw", "Sided") for axis in "xz"]
    answers = module_place.service().realize(wanted)
    assert [answer for answer in answers.values() if isinstance(answer, PartFailure)] == []
    return {text: answer for text, answer in answers.items() if isinstance(answer, PartRecord)}


def triangles(place: Place, record: PartRecord, name: str) -> Triangles:
    data = place.store.read(record.meshes[name].sha256)
    return Triangles(*exact_arrays(data)) if name == "slicing" else Triangles(*arrays(data))


def handedness(mesh: Triangles) -> float:
    """Return the integral of x y z over the solid, about its centre [mm^6]. A mirror image along x, y or z changes its sign; half a turn
    about one of these axes, the only rotation that could be mistaken for a mirror image, does not.

    Over a tetrahedron of volume V the integral of a product of three barycentric coordinates is 6 V p! q! r! / 6!, where p, q, r are the
    powers of the coordinates."""
    corners = mesh.vertices[mesh.faces]
    volumes = np.linalg.det(corners) / 6.0
    corners = corners - (volumes[:, None] * corners.sum(axis=1) / 4.0).sum(axis=0) / volumes.sum()
    volumes = np.linalg.det(corners) / 6.0
    total = 0.0
    for one in itertools.product(range(3), repeat=3):
        often = math.prod(math.factorial(one.count(k)) for k in range(3))
        total += often / 120.0 * float((volumes * math.prod(corners[:, k, axis] for axis, k in enumerate(one))).sum())
    return total


@pytest.mark.parametrize("axis", "xyz")
def test_image_equals_part_with_negated_coordinates(records: dict[str, PartRecord], axis: str) -> None:
    image, written = records[f"leg:Leg(mirror={axis})"], records[f"leg:Leg({axis}=-1)"]
    assert image.volume == pytest.approx(written.volume, rel=1e-9)
    assert image.area == pytest.approx(written.area, rel=1e-9)
    assert image.centre == pytest.approx(written.centre, rel=1e-9)
    np.testing.assert_allclose(image.inertia, written.inertia, rtol=0.0, atol=1e-9 * written.inertia[2][2])
    assert image.box is not None and written.box is not None
    np.testing.assert_allclose(image.box, written.box, rtol=0.0, atol=1e-12)
    assert list(image.mounts) == list(written.mounts) == ["hip", "foot"]
    for name, mount in image.mounts.items():
        other = written.mounts[name]
        assert replace(mount, pose=other.pose) == other
        np.testing.assert_allclose(mount.pose.rotation, other.pose.rotation, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(mount.pose.translation, other.pose.translation, rtol=0.0, atol=1e-12)
        assert np.linalg.det(np.array(mount.pose.rotation)) == pytest.approx(1.0)
    for one, other in ((image.com, written.com), (image.matrix, written.matrix)):
        assert one is not None and other is not None and one.source == other.source
        np.testing.assert_allclose(one.value, other.value, rtol=1e-12, atol=0.0)
    assert (image.up, image.mass, image.material, image.color, image.actuator) == (
        written.up, written.mass, written.material, written.color, written.actuator,
    )
    assert written.up is not None and not image.own_image


@pytest.mark.parametrize("axis", "xyz")
def test_meshes_pieces_and_fits_are_mirrored(records: dict[str, PartRecord], module_place: Place, axis: str) -> None:
    image, written = records[f"leg:Leg(mirror={axis})"], records[f"leg:Leg({axis}=-1)"]
    drawn = [module_place.store.read(record.meshes["visual"].sha256).decode().splitlines() for record in (image, written)]
    one, other = (sorted(line for line in lines if line.startswith("v ")) for lines in drawn)
    assert one == other
    for piece, same in zip(image.pieces, written.pieces, strict=True):
        assert isinstance(piece, Primitive) and isinstance(same, Primitive) and piece.shape == same.shape
        assert piece.size == pytest.approx(same.size)
        np.testing.assert_allclose(piece.pose.translation, same.pose.translation, atol=1e-9)
        np.testing.assert_allclose(  # a cylinder may be turned about its own axis
            np.array(piece.pose.rotation)[:, 2], np.array(same.pose.rotation)[:, 2], atol=1e-9,
        )
    for shape, fit in image.fits.items():
        assert fit.volume == pytest.approx(written.fits[shape].volume, rel=1e-6), shape
        hull = triangles(module_place, image, "hull").vertices
        local = (hull - np.array(fit.pose.translation)) @ np.array(fit.pose.rotation)
        assert _inside(fit, local).all(), shape


def _inside(fit: Primitive, points: np.ndarray) -> np.ndarray:
    slack = 1e-6
    if fit.shape == "box":
        return (np.abs(points) <= np.array(fit.size) + slack).all(axis=1)
    if fit.shape == "sphere":
        return np.linalg.norm(points, axis=1) <= fit.size[0] + slack
    radius, half = fit.size
    if fit.shape == "cylinder":
        return (np.hypot(points[:, 0], points[:, 1]) <= radius + slack) & (np.abs(points[:, 2]) <= half + slack)
    points = points - np.clip(points[:, 2:], -half, half) * np.array([0.0, 0.0, 1.0])
    return np.linalg.norm(points, axis=1) <= radius + slack


@pytest.mark.parametrize("axis", "xyz")
def test_slicing_meshes_are_mirrored(records: dict[str, PartRecord], module_place: Place, axis: str) -> None:
    plain = triangles(module_place, records["leg:Leg"], "slicing")
    image = triangles(module_place, records[f"leg:Leg(mirror={axis})"], "slicing")
    assert abs(handedness(plain)) > 100.0  # mm^6: far from a part that is symmetrical
    assert handedness(image) == pytest.approx(-handedness(plain), rel=1e-3)
    assert image.closed and image.volume > 0.0
    signs = np.array(SIGNS[axis])
    np.testing.assert_allclose(image.vertices.min(axis=0), np.minimum(*(signs * corner for corner in _box(plain))), atol=1e-4)


def _box(mesh: Triangles) -> tuple[np.ndarray, np.ndarray]:
    return mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)


def test_image_does_not_inherit_the_order_number(records: dict[str, PartRecord]) -> None:
    assert records["leg:Leg"].bom == {"make": "print", "number": "L-1", "supplier": "us"}
    assert records["leg:Leg(mirror=y)"].bom == {"make": "print", "supplier": "us"}


def test_symmetric_parts_are_their_own_images(records: dict[str, PartRecord]) -> None:
    own = {text for text, record in records.items() if record.own_image}
    # the head of a screw makes its ends differ; a mount at one side is somewhere else in the image
    assert own == {"leg:Screw(mirror=x)"}


def test_texts_and_file_names_of_images_are_distinct() -> None:
    longer = replace(part("leg:Leg", length=0.1), label="leg:Leg(length=100 mm)")
    assert longer.mirror_image("y").text == "leg:Leg(length=0.1, mirror=y)"
    assert longer.mirror_image("y").label == "leg:Leg(length=100 mm, mirror=y)"
    assert part("leg:Leg").mirror_image("y").text == part("leg:Leg").mirror_image("y").label == "leg:Leg(mirror=y)"
    assert part("leg:Leg").mirror_image("y").stem == "leg.Leg-mirror_y"
    assert longer.mirror_image("y").stem == f"{longer.stem}-mirror_y"
    file = replace(file_part("parts/foot.stl"), label="parts/foot.stl in m")
    assert (file.mirror_image("x").text, file.mirror_image("x").label) == ("parts/foot.stl(mirror=x)", "parts/foot.stl in m, mirror=x")
    # a parameter of the name is no mirror: its texts are quoted
    given = part("leg:Leg", mirror="y")
    named = [given, part("leg:Leg", mirror=0.1), part("leg:Leg").mirror_image("y"), given.mirror_image("y")]
    assert len({one.text for one in named}) == len({one.stem for one in named}) == 4


def test_records_of_images_are_cached(records: dict[str, PartRecord], module_place: Place) -> None:
    image = part("leg:Screw").mirror_image("x")
    service = module_place.service()
    assert service.realize([image]) == {image.text: records[image.text]}
    assert service.decisions[image.text].reused
    kept = record_from_json(record_to_json(records[image.text], str(module_place.root)), str(module_place.root))
    assert kept.own_image
    assert read_record(image.text, record_values(records[image.text]), "", None).own_image


def test_file_parts_are_mirrored(module_place: Place, records: dict[str, PartRecord]) -> None:
    record = records["leg:Leg"]
    (module_place.root / "leg.stl").write_bytes(module_place.store.read(record.meshes["print"].sha256))
    plain = replace(file_part("leg.stl"), parameters=())
    found = module_place.service().realize([plain, plain.mirror_image("y")])
    one, image = found[plain.text], found[plain.mirror_image("y").text]
    assert isinstance(one, PartRecord) and isinstance(image, PartRecord)
    x, y, z = one.centre
    assert image.centre == pytest.approx((x, -y, z), rel=1e-9)
    assert image.volume == pytest.approx(one.volume, rel=1e-9)
    hands = [handedness(triangles(module_place, made, "slicing")) for made in (one, image)]
    assert hands[1] == pytest.approx(-hands[0], rel=1e-6)
