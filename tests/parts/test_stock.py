"""Stock parts against what their makers publish, written here once more: sizes over everything, masses, drives, holes and mounts."""

from __future__ import annotations

import re
from importlib import import_module
from math import pi
from pathlib import Path

import pytest
from build123d import Vector

from thingc_stock import bearings, boards, bus_servos, cells, dynamixel, motors, profiles, servos, wheels

PUBLISHED = {  # size over everything, without ears and shaft where the maker counts so [mm]; mass [g]
    servos.SG90: ((11.8, 22.2, 31.0), 9), servos.MG90S: ((12.0, 22.5, 32.0), 13.4), servos.S3003: ((19.8, 40.4, 36.0), 37),
    servos.HS422: ((19.8, 40.6, 36.6), 45.5), servos.DS3218: ((20.0, 40.0, 40.5), 60),
    bus_servos.XL330: ((20.0, 34.0, 26.0), 18), bus_servos.STS3215: ((24.7, 45.2, 35.0), 55),
    motors.Nema17Short: ((42.3, 42.3, 34.0 + 24.0), 220), motors.Nema17: ((42.3, 42.3, 39.0 + 24.0), 280),
    motors.Nema17Long: ((42.3, 42.3, 48.0 + 24.0), 400),
    boards.RaspberryPi4: ((85.0, 56.0, None), 46), boards.RaspberryPiZero2: ((65.0, 30.0, None), 11),
    boards.ArduinoNano: ((45.0, 18.0, None), 7), boards.Esp32DevKitC: ((54.4, 27.9, None), 10),
    cells.Pack2S: ((66.0, 36.0, 18.0), 107),
}
DRIVES = {  # stall torque [kgf cm] and time for 60 deg [s] at the highest voltage
    servos.SG90: (1.8, 0.1), servos.MG90S: (2.2, 0.08), servos.S3003: (4.1, 0.19), servos.HS422: (4.1, 0.16), servos.DS3218: (21.5, 0.14),
    bus_servos.STS3215: (30.0, 0.222),
}
IN_RPM = {bus_servos.XL330: (0.52, 103.0, 288.35), dynamixel.XL430: (1.5, 61.0, 258.5)}  # N m, rpm, gear
MICRO = (servos.SG90, servos.MG90S)


def size_of(solid):
    return tuple(solid.bounding_box().size)


@pytest.mark.parametrize("part", PUBLISHED, ids=lambda part: part.__name__)
def test_size_and_mass(part):
    size, mass = PUBLISHED[part]
    thing = part()
    solid = thing.result()
    assert solid.is_valid and len(solid.solids()) == 1 and solid.volume > 0
    found = size_of(solid)
    if issubclass(part, servos.HobbyServo):  # the ears reach out, and the shaft out of the lid
        found = (found[0], size_of(thing.case_hull())[1], found[2] if part in MICRO else thing.top + thing.drawing.below)
    if issubclass(part, boards.Board):  # sockets reach over the edges, by 2 mm at most
        assert all(0.0 <= a - b <= 2.0 for a, b in zip(found, size[:2], strict=False))
        found = (*thing.layout.size, None)
    assert found[:2] == pytest.approx(size[:2], abs=1e-6) and (size[2] is None or found[2] == pytest.approx(size[2], abs=1e-6))
    assert thing.mass()[0] == pytest.approx(mass / 1000.0)


@pytest.mark.parametrize("part", DRIVES, ids=lambda part: part.__name__)
def test_drives(part):
    torque, seconds = DRIVES[part]
    assert part.actuator.stall_torque == pytest.approx(torque * 9.80665 / 100.0, rel=1e-9)
    assert part.actuator.no_load_speed == pytest.approx(pi / 3.0 / seconds, rel=1e-9)


@pytest.mark.parametrize("part", IN_RPM, ids=lambda part: part.__name__)
def test_drives_in_rpm(part):
    torque, speed, gear = IN_RPM[part]
    drive = part.actuator
    assert (drive.stall_torque, drive.gear_ratio) == (torque, gear)
    assert drive.no_load_speed == pytest.approx(speed * 2 * pi / 60)


def test_a_stepper_pulls_by_its_holding_torque():
    assert motors.Nema17.actuator.stall_torque == 0.45 and motors.Nema17.actuator.rotor_inertia == pytest.approx(54e-7)


@pytest.mark.parametrize("part", [part for part in PUBLISHED if issubclass(part, servos.HobbyServo)], ids=lambda part: part.__name__)
def test_a_hobby_servo_hangs_in_its_cut_out(part):
    """The pocket takes the case, the ears lie beside it, and the holes of ears and frame are in line."""
    servo = part()
    solid, pocket = servo.result(), servo.pocket(30.0)
    below = solid & pocket
    assert below.volume == pytest.approx((solid & servo.case_hull()).volume - (servo.case_hull() - pocket).volume, rel=0.02)
    for (x, y), mount in zip(servo.places, servo.ear, strict=True):
        assert not solid.is_inside(Vector(x, y, servo.drawing.ear / 2))
        assert tuple(mount.location.position) == pytest.approx((x, y, servo.drawing.ear))
        assert all(drill.is_inside(Vector(x, y, -1)) for drill in servo.screws(2.0, 5.0)[servo.places.index((x, y)):][:1])
    assert tuple(servo.rotor.location.position) == pytest.approx((0, 0, servo.drawing.above + servo.drawing.lid))
    assert tuple(servo.flange.location.z_axis.direction) == pytest.approx((0, 0, -1))


def test_the_holes_of_a_motor_and_its_hub():
    """NEMA ICS 16, size 17: four M3 holes 31 mm apart."""
    motor = motors.Nema17()
    solid = motor.result()
    corners = sorted(tuple(round(v, 6) for v in (m.location.position.X, m.location.position.Y)) for m in motor.hole)
    assert corners == [(-15.5, -15.5), (-15.5, 15.5), (15.5, -15.5), (15.5, 15.5)]
    for x, y in corners:
        assert not solid.is_inside(Vector(x, y, -4)) and solid.is_inside(Vector(x, y, -6))
    hub = motors.ShaftHub()
    assert size_of(hub.result()) == pytest.approx((22, 22, 12), abs=1e-6)
    placed = motor.rotor.align(hub.shaft)  # its collar stands on the shaft's flat
    assert tuple(placed.face.location.position) == pytest.approx((0, 0, 4 + 9 + 3))


@pytest.mark.parametrize(("name", "bore", "diameter", "width", "mass"), [
    ("608", 8, 22, 7, 12), ("623", 3, 10, 4, 1.5), ("MR105", 5, 10, 4, 1.3), ("6000", 10, 26, 8, 19),
])
def test_bearings(name, bore, diameter, width, mass):
    bearing = bearings.Bearing(name)
    solid = bearing.result()
    assert solid.is_valid and size_of(solid) == pytest.approx((diameter, diameter, width), abs=1e-6)
    assert not solid.is_inside(Vector(bore / 2 - 0.05, 0, 0)) and solid.is_inside(Vector(bore / 2 + 0.05, 0, 0))
    assert bearing.mass() == (mass / 1000.0, "vendor")
    assert bearing.mass()[0] == pytest.approx(solid.volume * 7.85e-6, rel=0.5)  # balls and air between the rings
    assert tuple(bearing.front.location.position) == pytest.approx((0, 0, width / 2))


def test_a_profile_of_any_length():
    for length in (50.0, 1000.0):
        profile = profiles.Profile2020(length=length)
        solid = profile.result()
        assert solid.is_valid and size_of(solid) == pytest.approx((20, 20, length), abs=1e-6)
        assert 0.40 <= solid.volume * 2.7e-6 / length * 1000.0 <= 0.50  # kg/m, as catalogues have it
        assert not solid.is_inside(Vector(0, 9.5, length / 2)) and solid.is_inside(Vector(8.5, 8.5, length / 2))
        assert tuple(profile.end.location.position) == pytest.approx((0, 0, length))
        assert tuple(profile.left_end.location.position) == pytest.approx((10, 0, length - 10))
        assert tuple(profile.left_end.location.z_axis.direction) == pytest.approx((1, 0, 0))


def test_a_tyre_fits_its_rim_and_a_ball_its_socket():
    rim, tyre = wheels.Rim(diameter=70, width=20), wheels.Tyre(diameter=70, width=20, thickness=6)
    assert rim.result().is_valid and size_of(tyre.result()) == pytest.approx((82, 82, 20), abs=0.1)
    placed = rim.tyre.align(tyre.seat)
    assert (placed.result() & rim.result()).volume < 0.05 * rim.result().volume  # the lips of the rim press into it
    socket, ball = wheels.CasterSocket(), wheels.CasterBall()
    rolling = socket.ball.align(ball.middle).result()
    assert not (socket.result() & rolling)
    assert pytest.approx(23.0) == rolling.bounding_box().max.Z


def test_boards_stand_on_posts_below_their_holes():
    board = boards.RaspberryPi4()
    assert sorted({round(p[0], 3) for p in board.places}) == [-39.0, 19.0]  # 3.5 mm from the edge, 58 mm on
    assert sorted({round(p[1], 3) for p in board.places}) == [-24.5, 24.5]
    assert [tuple(post.location.z_axis.direction) for post in board.post] == [pytest.approx((0, 0, -1))] * 4


@pytest.mark.parametrize("part", [servos.Horn, motors.ShaftHub, servos.SG90, bus_servos.XL330, bearings.Bearing, boards.RaspberryPi4],
                         ids=lambda part: part.__name__)
def test_collision_shapes_hold_the_part(part):
    """What simulators touch reaches as far as the part, to 20 % of its size."""
    thing = part()
    boxes = [piece.bounding_box() for piece in thing.collision()]
    own = thing.result().bounding_box()
    for axis in ("X", "Y", "Z"):
        low, high = min(getattr(b.min, axis) for b in boxes), max(getattr(b.max, axis) for b in boxes)
        extent = getattr(own.size, axis)
        assert abs(low - getattr(own.min, axis)) <= 0.2 * extent and abs(high - getattr(own.max, axis)) <= 0.2 * extent


def test_the_table_of_drives_in_the_docs():
    text = (Path(__file__).resolve().parents[2] / "docs/stock.md").read_text()
    row = r"^\| `(\S+):(\w+)` \| (.+?) \| (\S+) g \| (\S+) N\*m \| (\S+) rpm \|$"
    rows = re.findall(row, text.partition("<!-- drives -->")[2], re.MULTILINE)
    assert len(rows) == 13
    for module, name, what, mass, torque, speed in rows:
        part = getattr(import_module(module), name)
        drive = part.actuator
        assert what == f"{part.bom['supplier']} {part.bom['number']}"
        assert part().mass()[0] * 1000.0 == pytest.approx(float(mass), rel=1e-9)
        assert drive.stall_torque == pytest.approx(float(torque), rel=0.006)
        assert drive.no_load_speed * 60.0 / (2.0 * pi) == pytest.approx(float(speed), rel=0.006)
