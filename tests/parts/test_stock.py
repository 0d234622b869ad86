"""Stock parts, compared with the data in their docstrings, which are repeated here: sizes, masses, drives with sources, and holes."""

from __future__ import annotations

import csv
import re
from importlib import import_module
from importlib.resources import files
from math import pi
from pathlib import Path

import pytest
import yaml
from build123d import Vector

from thingc_stock import bearings, boards, bus_servos, cells, dynamixel, motors, profiles, servos, wheels

SIZED = {  # size over everything, without ears and shaft where it is counted so [mm]; mass [g] and its source
    servos.SG90: ((11.8, 22.2, 31.0), 9, "vendor"), servos.MG90S: ((12.0, 22.5, 32.0), 13.4, "vendor"),
    servos.S3003: ((19.8, 40.4, 36.0), 37.2, "vendor"), servos.HS422: ((19.8, 40.6, 36.6), 45.5, "estimated"),
    servos.DS3218: ((20.0, 40.0, 40.5), 60, "estimated"),
    bus_servos.XL330: ((20.0, 34.0, 26.0), 18, "vendor"), bus_servos.STS3215: ((24.8, 45.4, 18.7 + 17.7), 55, "estimated"),
    motors.Nema17Short: ((42.3, 42.3, 34.0 + 24.0), 230, "vendor"), motors.Nema17: ((42.3, 42.3, 39.0 + 24.0), 280, "vendor"),
    motors.Nema17Long: ((42.3, 42.3, 48.0 + 24.0), 390, "vendor"),
    boards.RaspberryPi4: ((85.0, 56.0, None), 46, "measured"), boards.RaspberryPiZero2: ((65.0, 30.0, None), 11, "estimated"),
    boards.ArduinoNano: ((45.0, 18.0, None), 7, "vendor"), boards.Esp32DevKitC: ((54.4, 27.9, None), 10, "estimated"),
    cells.Pack2S: ((66.0, 36.0, 18.0), 107, "vendor"),
}
DRIVES = {  # stall torque [kgf cm] and time for 60 deg [s] at the highest voltage, and their source
    servos.SG90: (1.8, 0.1, "vendor"), servos.MG90S: (2.2, 0.08, "vendor"), servos.S3003: (4.1, 0.19, "vendor"),
    servos.HS422: (4.1, 0.16, "estimated"), servos.DS3218: (21.5, 0.14, "estimated"),
}
IN_RPM = {  # N m, rpm, gear
    bus_servos.XL330: (0.52, 103.0, 288.4), bus_servos.STS3215: (30.0 * 0.0980665, 45.0, 345.0), dynamixel.XL430: (1.5, 61.0, 258.5),
}
GRADES = {  # materials whose comments name a grade of bd_materials
    "pla": "PLA.GENERIC", "petg": "PETG.GENERIC", "abs": "ABS.GENERIC", "asa": "Asa.GENERIC", "nylon": "Nylon.PA12", "pc": "PC.GENERIC",
    "tpu": "TPU.SHORE_95A", "resin": "Standard.GENERIC", "aluminium": "Alu.G6061_T6", "steel": "MildSteel.G1018_COLD_DRAWN",
    "stainless": "Stainless.G304_ANNEALED", "brass": "Brass.C360_HALF_HARD", "bronze": "Bronze.C51000_PHOSPHOR",
    "copper": "Copper.C110_ANNEALED", "titanium": "Titanium.GR5_ANNEALED", "acrylic": "PMMA.GENERIC", "pom": "POM.GENERIC",
    "ptfe": "PTFE.GENERIC", "mdf": "EngineeredWood.MDF", "oak": "Hardwood.OAK", "carbon": "CFRP.PLATE", "fr4": "FR4.GENERIC",
    "glass": "SodaLime.GENERIC", "rubber": "Rubber.GENERIC",
}
MICRO = (servos.SG90, servos.MG90S)


def size_of(solid):
    return tuple(solid.bounding_box().size)


@pytest.mark.parametrize("part", SIZED, ids=lambda part: part.__name__)
def test_size_and_mass(part):
    size, mass, source = SIZED[part]
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
    assert thing.mass() == (pytest.approx(mass / 1000.0), source)


@pytest.mark.parametrize("part", DRIVES, ids=lambda part: part.__name__)
def test_drives(part):
    torque, seconds, source = DRIVES[part]
    assert part.actuator.stall_torque == pytest.approx(torque * 9.80665 / 100.0, rel=1e-9)
    assert part.actuator.no_load_speed == pytest.approx(pi / 3.0 / seconds, rel=1e-9)
    assert {part.actuator.sources[name] for name in ("stall_torque", "no_load_speed")} == {source}


@pytest.mark.parametrize("part", IN_RPM, ids=lambda part: part.__name__)
def test_drives_in_rpm(part):
    torque, speed, gear = IN_RPM[part]
    drive = part.actuator
    assert (drive.stall_torque, drive.gear_ratio) == (pytest.approx(torque), gear)
    assert {drive.sources[name] for name in ("stall_torque", "no_load_speed", "gear_ratio")} == {"vendor"}
    assert drive.no_load_speed == pytest.approx(speed * 2 * pi / 60)


def test_stepper_uses_its_holding_torque():
    for part, torque, inertia, source in (
        (motors.Nema17Short, 0.26, 38e-7, "vendor"), (motors.Nema17, 0.45, 54e-7, "estimated"), (motors.Nema17Long, 0.59, 82e-7, "vendor"),
    ):
        assert (part.actuator.stall_torque, part.actuator.rotor_inertia) == (torque, pytest.approx(inertia))
        assert part.actuator.sources["rotor_inertia"] == source


@pytest.mark.parametrize("part", [part for part in SIZED if issubclass(part, servos.HobbyServo)], ids=lambda part: part.__name__)
def test_hobby_servo_fits_its_cut_out(part):
    """The pocket contains the case, the ears are beside it, and the holes of ears and frame are aligned."""
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


def test_holes_of_a_motor_and_its_hub():
    """Size 17: four M3 holes at a distance of 31 mm."""
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


def test_horn_of_a_bus_servo_is_placed_as_in_its_model():
    servo = bus_servos.STS3215()
    threads = [hole(0.0).thread_hull.center() for hole in servo.screws_horn]
    assert [(round(at.X, 6), round(at.Y, 6)) for at in threads] == [(7, 0), (0, 7), (-7, 0), (0, -7)]  # a circle of 14 mm
    assert pytest.approx((18.7, -17.7)) == (servo.rotor.location.position.Z, servo.idler.location.position.Z)
    assert pytest.approx(10.2) == servo.top.location.position.Y


def bearings_of_bd_warehouse():
    """Return bore, outer diameter, width [mm] and mass [kg] by designation, from bd_warehouse."""
    found = {}
    for table in ("single_row_deep_groove", "single_row_capped_deep_groove"):
        text = files("bd_warehouse").joinpath("data", f"{table}_ball_bearing_parameters.csv").read_text(encoding="utf-8")
        for row in csv.DictReader(text.splitlines()):
            if row["SKT:Designation"]:
                name = row["SKT:Designation"].split()[-1].removeprefix("E2.")
                found[name] = tuple(float(row[f"SKT:{key}"]) for key in ("d", "D", "B", "mass"))
    return found


def test_bearings_equal_those_of_bd_warehouse():
    known = bearings_of_bd_warehouse()
    there = {"688": "628/8-2Z", "61800": "61800", "6000": "6000"}
    for name, sizes in bearings.BEARINGS.items():
        entry = known.get(there.get(name, f"{name}-2Z"))
        assert (sizes.source == "estimated") is (entry is None) is (name in ("MR105", "6001"))
        if entry:
            assert (sizes.bore, sizes.diameter, sizes.width, sizes.mass) == entry


@pytest.mark.parametrize("name", ["608", "623", "MR105", "6000"])
def test_bearings(name):
    sizes = bearings.BEARINGS[name]
    bearing = bearings.Bearing(name)
    solid = bearing.result()
    assert solid.is_valid and size_of(solid) == pytest.approx((sizes.diameter, sizes.diameter, sizes.width), abs=1e-6)
    assert not solid.is_inside(Vector(sizes.bore / 2 - 0.05, 0, 0)) and solid.is_inside(Vector(sizes.bore / 2 + 0.05, 0, 0))
    assert bearing.mass() == (sizes.mass, sizes.source)
    assert bearing.mass()[0] == pytest.approx(solid.volume * 7.85e-6, rel=0.5)  # balls and air between the rings
    assert tuple(bearing.front.location.position) == pytest.approx((0, 0, sizes.width / 2))


def test_densities_match_the_grades_in_comments():
    grades = {
        str(grade): one.density
        for module in ("metals", "plastics", "resins", "wood", "glass")
        for table in vars(import_module(f"bd_materials.materials.{module}")).values() if isinstance(table, dict)
        for grade, one in table.items() if hasattr(one, "density")
    }
    text = (Path(__file__).resolve().parents[2] / "parts/thingc_stock/materials.yaml").read_text(encoding="utf-8")
    densities = {name: one["density"] for name, one in yaml.safe_load(text)["materials"].items()}
    for name, grade in GRADES.items():
        assert densities[name] == f"{grades[grade]:g} kg/m^3", name
        assert re.search(rf"^  {name}:.*# {re.escape(grade)}\b", text, re.MULTILINE), f"the comment of {name} names {grade}"
    assert set(re.findall(r"# ([A-Z]\w+\.[A-Z]\w+)", text)) == set(GRADES.values())


def test_profile_of_any_length():
    for length in (50.0, 1000.0):
        profile = profiles.Profile2020(length=length)
        solid = profile.result()
        assert solid.is_valid and size_of(solid) == pytest.approx((20, 20, length), abs=1e-6)
        assert 0.40 <= solid.volume * 2.7e-6 / length * 1000.0 <= 0.50  # kg/m, about what one weighs
        assert not solid.is_inside(Vector(0, 9.5, length / 2)) and solid.is_inside(Vector(8.5, 8.5, length / 2))
        assert tuple(profile.end.location.position) == pytest.approx((0, 0, length))
        assert tuple(profile.left_end.location.position) == pytest.approx((10, 0, length - 10))
        assert tuple(profile.left_end.location.z_axis.direction) == pytest.approx((1, 0, 0))


def test_tyre_fits_rim_and_ball_fits_socket():
    rim, tyre = wheels.Rim(diameter=70, width=20), wheels.Tyre(diameter=70, width=20, thickness=6)
    assert rim.result().is_valid and size_of(tyre.result()) == pytest.approx((82, 82, 20), abs=0.1)
    placed = rim.tyre.align(tyre.seat)
    assert (placed.result() & rim.result()).volume < 0.05 * rim.result().volume  # the lips of the rim press into it
    socket, ball = wheels.CasterSocket(), wheels.CasterBall()
    rolling = socket.ball.align(ball.middle).result()
    assert not (socket.result() & rolling)
    assert pytest.approx(23.0) == rolling.bounding_box().max.Z


def test_posts_are_below_the_holes_of_boards():
    board = boards.RaspberryPi4()
    assert sorted({round(p[0], 3) for p in board.places}) == [-39.0, 19.0]  # 3.5 mm from the edge, 58 mm on
    assert sorted({round(p[1], 3) for p in board.places}) == [-24.5, 24.5]
    assert [tuple(post.location.z_axis.direction) for post in board.post] == [pytest.approx((0, 0, -1))] * 4


@pytest.mark.parametrize("part", [servos.Horn, motors.ShaftHub, servos.SG90, bus_servos.XL330, bearings.Bearing, boards.RaspberryPi4],
                         ids=lambda part: part.__name__)
def test_collision_shapes_contain_the_part(part):
    """The collision shapes have the extent of the part, within 20 % of its size."""
    thing = part()
    boxes = [piece.bounding_box() for piece in thing.collision()]
    own = thing.result().bounding_box()
    for axis in ("X", "Y", "Z"):
        low, high = min(getattr(b.min, axis) for b in boxes), max(getattr(b.max, axis) for b in boxes)
        extent = getattr(own.size, axis)
        assert abs(low - getattr(own.min, axis)) <= 0.2 * extent and abs(high - getattr(own.max, axis)) <= 0.2 * extent


def test_table_of_drives_in_the_docs():
    text = (Path(__file__).resolve().parents[2] / "docs/stock.md").read_text()
    row = r"^\| `(\S+):(\w+)` \| (.+?) \| (\S+) g \| (\S+) N\*m \| (\S+) rpm \| (\w+), (\w+) \|$"
    rows = re.findall(row, text.partition("<!-- drives -->")[2], re.MULTILINE)
    assert len(rows) == 13
    for module, name, what, mass, torque, speed, *sources in rows:
        part = getattr(import_module(module), name)
        drive = part.actuator
        assert what == f"{part.bom['supplier']} {part.bom['number']}"
        assert part().mass()[0] * 1000.0 == pytest.approx(float(mass), rel=1e-9)
        assert drive.stall_torque == pytest.approx(float(torque), rel=0.006)
        assert drive.no_load_speed * 60.0 / (2.0 * pi) == pytest.approx(float(speed), rel=0.006)
        assert sources == [part().mass()[1], drive.sources["stall_torque"]]
