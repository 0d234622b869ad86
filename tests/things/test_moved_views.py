"""Moved views, mounts and expectations, compared with written-out products of matrices."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import cos, radians, sin
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest
from build123d import (
    Axis,
    Box,
    BuildPart,
    Circle,
    Color,
    Edge,
    GridLocations,
    Location,
    Plane,
    Pos,
    RigidJoint,
    Rot,
    ShapeList,
    Vector,
    Vertex,
)

from thingc import MATE, MountPoint, Thing, TransformResolver
from thingc.geometry.things.inspection import ExpectedPart, expectations_of, mounts_of

Rows = list[list[float]]


def matrix(location: Location) -> Rows:
    """The 4 x 4 matrix of a build123d location, read from the kernel."""
    transformation = location.wrapped.Transformation()
    return [[transformation.Value(row, column) for column in range(1, 5)] for row in range(1, 4)] + [[0, 0, 0, 1]]


def chain(*factors: Rows) -> Rows:
    product = factors[0]
    for factor in factors[1:]:
        product = [[sum(row[k] * factor[k][column] for k in range(4)) for column in range(4)] for row in product]
    return product


def shift(x: float, y: float, z: float) -> Rows:
    return [[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, z], [0, 0, 0, 1]]


def turn_z(degrees: float) -> Rows:
    c, s = cos(radians(degrees)), sin(radians(degrees))
    return [[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


def turn_x(degrees: float) -> Rows:
    c, s = cos(radians(degrees)), sin(radians(degrees))
    return [[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]]


def inverse(rigid: Rows) -> Rows:
    turned = [[rigid[column][row] for column in range(3)] for row in range(3)]
    back = [-sum(turned[row][k] * rigid[k][3] for k in range(3)) for row in range(3)]
    return [[*turned[row], back[row]] for row in range(3)] + [[0, 0, 0, 1]]


def at(rigid: Rows, point: Iterable[float]) -> tuple[float, ...]:
    """Position of a point after a rigid motion."""
    vector = [*point, 1.0]
    return tuple(sum(row[k] * vector[k] for k in range(4)) for row in rigid[:3])


def approx_point(values: Iterable[float]) -> Any:
    return pytest.approx(tuple(values), abs=1e-9)


def approx_matrix(rows: Rows) -> Any:
    return [pytest.approx(row, abs=1e-9) for row in rows]


M = [[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]
VIEW = Pos(10, 20, 30) * Rot(0, 0, 90) * Rot(30, 0, 0)
X_VIEW = chain(shift(10, 20, 30), turn_z(90), turn_x(30))


class Spot(NamedTuple):
    place: Location
    size: float


@dataclass
class Hole:
    centre: Vector
    depth: float


class Screw(Thing):
    def __init__(self, length=5):
        super().__init__()
        self.body_hull = Pos(0, 0, -length / 2) * Box(3, 3, length)
        self.seat = MountPoint(Pos(0, 0, 1) * Rot(0, 90, 0))
        self.length = length


class Servo(Thing):
    def __init__(self, width=28):
        super().__init__()
        self.body = Pos(1, 2, 3) * Box(width, 46, 34)
        self.profile = Pos(4, 0, 0) * Circle(2)
        self.edge = Edge.make_line((0, 0, 0), (1, 2, 3))
        self.vertex = Vertex(1, 2, 3)
        self.point = Vector(1, 2, 3)
        self.plane = Plane(origin=(1, 2, 3), x_dir=(0, 1, 0), z_dir=(1, 0, 0))
        self.axis = Axis((1, 2, 3), (0, 0, 1))
        self.place = Pos(1, 2, 3) * Rot(0, 0, 45)
        self.rotor = MountPoint(Pos(0, 0, 17) * Rot(0, 0, 30), interface="x430-horn", tolerance=0.1)
        self.spots = [Pos(1, 0, 0), Pos(0, 1, 0)]
        self.named = {"left": Pos(1, 0, 0), "deep": {"tuple": (Vector(1, 2, 3), 4)}}
        self.faces = self.body.faces()
        self.grid = GridLocations(2, 2, 2, 1)
        self.spot = Spot(Pos(1, 2, 3), 7.5)
        self.hole = Hole(Vector(1, 2, 3), 7.5)
        self.namespace = SimpleNamespace(point=Vector(1, 2, 3))
        with BuildPart() as builder:
            Box(2, 2, 2)
        self.builder = builder
        self.box = self.body.bounding_box()
        self.colour = Color("red")
        self.label = "servo"
        self.count = 3
        self.screw_ref = Screw(8).move(Pos(0, 5, 0))
        self.screw_type = Screw
        self.plain = Screw
        self.screw_closure = lambda length: Screw(length).move(Pos(0, 0, 17))

    def screw_right(self, length):
        return Screw(length).move(Pos(width_of(self) / 2, 0, 0))

    @property
    def far_hole(self):
        return Pos(0, 0, -9) * Box(1, 1, 1)


def width_of(servo: Servo) -> float:
    return servo.p.width


class Bracket(Thing):
    def __init__(self):
        super().__init__()
        self.servo_ref = Servo().move(VIEW)


@pytest.fixture(scope="module")
def servo() -> Any:
    return Servo().move(VIEW)


def test_shapes_are_moved(servo: Any) -> None:
    assert type(servo) is TransformResolver
    assert type(servo.body) is type(Servo().body)
    assert tuple(servo.body.center()) == approx_point(at(X_VIEW, (1, 2, 3)))
    assert servo.body.volume == pytest.approx(28 * 46 * 34)
    corners = sorted(tuple(vertex) for vertex in servo.body.vertices())
    expected = sorted(at(X_VIEW, (1 + x, 2 + y, 3 + z)) for x in (-14, 14) for y in (-23, 23) for z in (-17, 17))
    for corner, by_hand in zip(corners, expected):
        assert corner == approx_point(by_hand)
    assert tuple(servo.profile.center()) == approx_point(at(X_VIEW, (4, 0, 0)))
    assert tuple(servo.edge.end_point()) == approx_point(at(X_VIEW, (1, 2, 3)))
    assert tuple(servo.vertex) == approx_point(at(X_VIEW, (1, 2, 3)))


def test_original_thing_is_not_moved(servo: Any) -> None:
    assert servo.body is not Servo().body
    servo.body.label = "moved"
    assert Servo().body.label == ""
    assert tuple(Servo().body.center()) == approx_point((1, 2, 3))
    assert servo.body.wrapped.IsPartner(Servo().body.wrapped)   # the topology is shared, not copied


def test_frames_points_and_axes_are_moved(servo: Any) -> None:
    assert tuple(servo.point) == approx_point(at(X_VIEW, (1, 2, 3)))
    assert matrix(servo.place) == approx_matrix(chain(X_VIEW, shift(1, 2, 3), turn_z(45)))
    origin = at(X_VIEW, (0, 0, 0))
    direction = [tip - base for tip, base in zip(at(X_VIEW, (0, 0, 1)), origin)]
    assert tuple(servo.axis.position) == approx_point(at(X_VIEW, (1, 2, 3)))
    assert tuple(servo.axis.direction) == approx_point(direction)
    plane = servo.plane
    assert tuple(plane.origin) == approx_point(at(X_VIEW, (1, 2, 3)))
    assert tuple(plane.x_dir) == approx_point(tip - base for tip, base in zip(at(X_VIEW, (0, 1, 0)), origin))
    assert tuple(plane.z_dir) == approx_point(tip - base for tip, base in zip(at(X_VIEW, (1, 0, 0)), origin))


def test_mount_is_moved_and_keeps_its_attributes(servo: Any) -> None:
    assert isinstance(servo.rotor, MountPoint)
    assert matrix(servo.rotor.location) == approx_matrix(chain(X_VIEW, shift(0, 0, 17), turn_z(30)))
    assert (servo.rotor.interface, servo.rotor.tolerance, servo.rotor.name) == ("x430-horn", 0.1, "rotor")
    assert matrix(servo.origin.location) == approx_matrix(X_VIEW)


def test_items_of_containers_are_moved(servo: Any) -> None:
    assert [tuple(spot.position) for spot in servo.spots] == [approx_point(at(X_VIEW, (1, 0, 0))), approx_point(at(X_VIEW, (0, 1, 0)))]
    assert tuple(servo.named["left"].position) == approx_point(at(X_VIEW, (1, 0, 0)))
    point, number = servo.named["deep"]["tuple"]
    assert tuple(point) == approx_point(at(X_VIEW, (1, 2, 3))) and number == 4
    assert isinstance(servo.faces, ShapeList)
    top = max(at(X_VIEW, centre)[2] for centre in ((1, 2, 20), (1, 2, -14), (1, 25, 3), (1, -21, 3), (15, 2, 3), (-13, 2, 3)))
    highest = servo.faces.sort_by(Axis.Z)[-1].center()
    assert pytest.approx(top) == highest.Z
    assert [tuple(spot.position) for spot in servo.grid] == [approx_point(at(X_VIEW, (-1, 0, 0))), approx_point(at(X_VIEW, (1, 0, 0)))]
    assert type(servo.spot) is Spot and servo.spot.size == 7.5
    assert tuple(servo.spot.place.position) == approx_point(at(X_VIEW, (1, 2, 3)))


def test_objects_containing_geometry_are_moved(servo: Any) -> None:
    assert tuple(servo.hole.centre) == approx_point(at(X_VIEW, (1, 2, 3))) and servo.hole.depth == 7.5
    assert tuple(servo.namespace.point) == approx_point(at(X_VIEW, (1, 2, 3)))
    assert tuple(servo.builder.part.center()) == approx_point(at(X_VIEW, (0, 0, 0)))


def test_bounding_box_encloses_the_moved_box(servo: Any) -> None:
    corners = [at(X_VIEW, (1 + x, 2 + y, 3 + z)) for x in (-14, 14) for y in (-23, 23) for z in (-17, 17)]
    assert tuple(servo.box.min) == pytest.approx(tuple(min(corner[k] for corner in corners) for k in range(3)), abs=1e-5)
    assert tuple(servo.box.max) == pytest.approx(tuple(max(corner[k] for corner in corners) for k in range(3)), abs=1e-5)


def test_non_geometric_attributes_are_unchanged(servo: Any) -> None:
    assert (servo.count, servo.label, servo.p.width) == (3, "servo", 28.0)
    assert servo.colour is Servo().colour
    assert servo.screw_type is not Screw and servo.screw_type(4).length == 4


def test_methods_run_in_the_frame_of_the_thing(servo: Any) -> None:
    """Results of methods, closures and properties are moved."""
    expected = at(chain(X_VIEW, shift(14, 0, 0)), (0, 0, -3))
    assert tuple(servo.screw_right(6).body_hull.center()) == approx_point(expected)
    assert tuple(servo.screw_closure(6).body_hull.center()) == approx_point(at(chain(X_VIEW, shift(0, 0, 17)), (0, 0, -3)))
    assert tuple(servo.far_hole.center()) == approx_point(at(X_VIEW, (0, 0, -9)))
    assert tuple(servo.screw_type(6).body_hull.center()) == approx_point(at(X_VIEW, (0, 0, -3)))
    assert servo.screw_right.__name__ == "screw_right"


def test_nested_views_compose() -> None:
    bracket = Bracket().move(Pos(100, 0, 0) * Rot(0, 0, 180))
    outside = chain(shift(100, 0, 0), turn_z(180), X_VIEW)
    assert tuple(bracket.servo_ref.body.center()) == approx_point(at(outside, (1, 2, 3)))
    assert tuple(bracket.servo_ref.screw_ref.body_hull.center()) == approx_point(at(chain(outside, shift(0, 5, 0)), (0, 0, -4)))
    screw = bracket.servo_ref.screw_right(6)
    assert tuple(screw.body_hull.center()) == approx_point(at(chain(outside, shift(14, 0, 0)), (0, 0, -3)))
    assert matrix(screw.seat.location)[0][3] == pytest.approx(at(chain(outside, shift(14, 0, 0)), (0, 0, 1))[0])


def test_moving_a_view_again_composes_the_motions() -> None:
    twice = Servo().move(Pos(1, 0, 0)).move(Rot(0, 0, 90))
    assert tuple(twice.body.center()) == approx_point(at(chain(turn_z(90), shift(1, 0, 0)), (1, 2, 3)))


def test_adjusting_a_view_keeps_its_pose(servo: Any) -> None:
    wider = servo.adjust(width__add=2)
    assert type(wider) is TransformResolver
    assert tuple(wider.body.center()) == approx_point(at(X_VIEW, (1, 2, 3)))
    assert wider.body.volume == pytest.approx(30 * 46 * 34)


def test_view_is_read_only_and_has_a_repr(servo: Any) -> None:
    with pytest.raises(AttributeError, match=r"^a moved view of Servo\(width=28.0\) is read-only: `body` cannot be assigned$"):
        servo.body = 3
    with pytest.raises(AttributeError, match="is read-only: `body` cannot be deleted$"):
        del servo.body
    with pytest.raises(AttributeError, match="rotr"):
        _ = servo.rotr
    assert repr(servo).startswith("<Servo(width=28.0) moved by Location")
    assert {"move", "rotor", "screw_right"} <= set(dir(servo))


def test_unmovable_objects_are_rejected() -> None:
    class Jointed(Thing):
        def __init__(self):
            self.body = Box(1, 1, 1)
            self.joint = RigidJoint("tip", self.body, Pos(0, 0, 1))

    with pytest.raises(TypeError, match="^a RigidJoint cannot be used through a moved view: use a Location or a Shape instead$"):
        _ = Jointed().move(VIEW).joint
    moved = Jointed().move(VIEW).body
    assert tuple(moved.joints["tip"].location.position) == approx_point(at(X_VIEW, (0, 0, 1)))
    with pytest.raises(TypeError, match=r"^move\(\) expects a Location, found 3$"):
        Jointed().move(3)  # type: ignore[arg-type]


def test_mate_equals_its_exact_matrix() -> None:
    assert matrix(MATE) == M
    assert matrix(MATE * MATE) == [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert matrix(Location((0, 0, 0), (180, 0, 90))) == approx_matrix(M)


class PenCap(Thing):
    def __init__(self, length=20):
        super().__init__()
        self.body = Pos(0, 0, length / 2) * Box(4, 6, length)
        self.seat = MountPoint(Pos(1, 2, length) * Rot(0, 0, 40))
        self.hip = [MountPoint(Pos(0, 0, 1)), MountPoint(Pos(0, 0, 2))]


SEAT = Pos(5, 6, 7) * Rot(25, 0, 0)
X_SEAT = chain(shift(5, 6, 7), turn_x(25))
X_CAP = chain(X_SEAT, M, inverse(chain(shift(1, 2, 20), turn_z(40))))


def test_align_mates_the_two_mounts() -> None:
    cap = MountPoint(SEAT).align(PenCap().seat)
    assert matrix(cap.origin.location) == approx_matrix(X_CAP)
    assert tuple(cap.body.center()) == approx_point(at(X_CAP, (0, 0, 10)))
    assert matrix(cap.seat.location) == approx_matrix(chain(X_SEAT, M))


def test_align_to_the_origin_of_a_thing() -> None:
    assert matrix(MountPoint(SEAT).align(PenCap().origin).origin.location) == approx_matrix(chain(X_SEAT, M))


def test_align_works_with_moved_views() -> None:
    elsewhere = PenCap().move(VIEW)
    assert matrix(MountPoint(SEAT).align(elsewhere.seat).origin.location) == approx_matrix(X_CAP)
    placed = elsewhere.seat.align(PenCap(30).seat)
    by_hand = chain(X_VIEW, shift(1, 2, 20), turn_z(40), M, inverse(chain(shift(1, 2, 30), turn_z(40))))
    assert matrix(placed.origin.location) == approx_matrix(by_hand)


def test_align_requires_a_mount_of_a_finished_thing() -> None:
    with pytest.raises(TypeError, match=r"^align\(\) expects a mount of another Thing, such as `PenCap\(\).seat`, found PenCap"):
        MountPoint(SEAT).align(PenCap())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="found a mount without a Thing$"):
        MountPoint(SEAT).align(MountPoint(SEAT))

    class Loop(Thing):
        def __init__(self):
            self.a, self.b = MountPoint(SEAT), MountPoint(SEAT)
            self.a.align(self.b)

    with pytest.raises(ValueError, match="found `b` of the same Thing$"):
        Loop()


class Hand(Thing):
    def __init__(self, early=True):
        super().__init__()
        free = MountPoint(SEAT)
        if early:
            self.cap_seat = free
            self.cap = free.align(PenCap(25).seat)
        else:
            self.cap = free.align(PenCap(25).seat)
            self.cap_seat = free
        self.legs = [MountPoint(Pos(x, 0, 0)) for x in range(2)]
        self.legs[1].align(PenCap().hip[1])
        self.servo_ref = Servo().move(VIEW)
        self.servo_ref.rotor.align(PenCap().seat)
        Servo().rotor.align(PenCap().seat)
        MountPoint(SEAT).align(PenCap().seat)


@pytest.mark.parametrize("early", [True, False])
def test_mount_records_the_expected_part(early: bool) -> None:
    """`align` on an own mount in `__init__` records an expectation; on other mounts it does not."""
    assert expectations_of(Hand(early)) == (
        ExpectedPart(mount="cap_seat", family=PenCap, parameters={"length": 25.0}, child_mount="seat"),
        ExpectedPart(mount="legs_1", family=PenCap, parameters={"length": 20.0}, child_mount="hip_1"),
    )
    assert expectations_of(Servo()) == ()


def test_finished_thing_records_no_expectations() -> None:
    Hand().legs[0].align(PenCap(31).seat)
    assert len(expectations_of(Hand())) == 2


def test_assigned_mount_of_another_thing_is_copied() -> None:
    """The copy has the pose in the new Thing, its own name and the attributes of the original."""
    class Brace(Thing):
        def __init__(self):
            self.servo_ref = Servo().move(VIEW)
            self.horn = self.servo_ref.rotor
            self.horn.align(PenCap().seat)
            self.again = self.horn

    brace = Brace()
    assert list(mounts_of(brace)) == ["horn", "again"]
    by_hand = chain(X_VIEW, shift(0, 0, 17), turn_z(30))
    for name, mount in mounts_of(brace).items():
        assert mount.name == name and getattr(brace, name) is mount
        assert matrix(mount.location) == approx_matrix(by_hand)
        assert (mount.interface, mount.tolerance) == ("x430-horn", 0.1)
    assert [expected.mount for expected in expectations_of(brace)] == ["horn"]
    assert Servo().rotor.name == "rotor" and mounts_of(Servo()) == {"rotor": Servo().rotor}
    placed = MountPoint(SEAT).align(brace.horn)
    assert matrix(placed.origin.location) == approx_matrix(chain(X_SEAT, M, inverse(by_hand)))


def test_lists_and_dicts_of_mounts_have_names() -> None:
    class Body(Thing):
        def __init__(self):
            self.hip = []
            for x in range(3):
                self.hip.append(MountPoint(Pos(x, 0, 0)))
            self.hip.insert(0, MountPoint(Pos(-1, 0, 0)))
            self.side = {"left": MountPoint(Pos(0, 1, 0)), "right": (MountPoint(Pos(0, -1, 0)),)}
            self._hidden = MountPoint(Pos(9, 9, 9))

    positions = {name: tuple(mount.location.position) for name, mount in mounts_of(Body()).items()}
    assert positions == {
        "hip_0": (-1, 0, 0), "hip_1": (0, 0, 0), "hip_2": (1, 0, 0), "hip_3": (2, 0, 0),
        "side_left": (0, 1, 0), "side_right_0": (0, -1, 0),
    }
    assert [mount.name for mount in Body().hip] == ["hip_0", "hip_1", "hip_2", "hip_3"]
    assert [mount.name for mount in Body().move(VIEW).hip] == ["hip_0", "hip_1", "hip_2", "hip_3"]


def test_invalid_mount_names_are_rejected() -> None:
    class Clash(Thing):
        def __init__(self, name: str):
            setattr(self, name, [MountPoint(Pos())])
            self.hip_0 = MountPoint(Pos())

    with pytest.raises(ValueError, match="^two mounts of `Clash` are named `hip_0`$"):
        Clash("hip")

    class Named(Thing):
        def __init__(self, name="root"):
            setattr(self, name, MountPoint(Pos()))

    with pytest.raises(ValueError, match="^`root` of `Named` cannot be a mount: the name is reserved$"):
        Named()
    with pytest.raises(ValueError, match="^`hüfte` of `Named` cannot be a mount: use letters, digits and _$"):
        Named("hüfte")


def test_mount_point_accepts_frames() -> None:
    plane = Plane(origin=(1, 2, 3), x_dir=(0, 1, 0), z_dir=(1, 0, 0))
    assert matrix(MountPoint(plane).location) == approx_matrix([[0, 0, 1, 1], [1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]])
    assert matrix(MountPoint(MountPoint(SEAT)).location) == approx_matrix(X_SEAT)
    place = Pos(1, 2, 3)
    mount = MountPoint(place)
    place.position = (9, 9, 9)
    mount.location.position = (8, 8, 8)
    assert tuple(mount.location.position) == (1, 2, 3)
    with pytest.raises(TypeError, match=r"^a MountPoint requires a Location, a Plane or another MountPoint, found \(1, 2, 3\)$"):
        MountPoint((1, 2, 3))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="^the tolerance of a MountPoint must be at least 0 mm and finite, found -1$"):
        MountPoint(place, tolerance=-1)
    with pytest.raises(AttributeError):
        mount.interface = "x"  # type: ignore[misc]
