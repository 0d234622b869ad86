"""Interface declarations against the geometry of the solids: parts of known dimensions, rotated, mirrored and off by a few micrometres."""

from __future__ import annotations

import math

import pytest

from realize.conftest import Place, part
from thingc.geometry.lock.json_format import read_record, record_values
from thingc.geometry.record import PartFailure, PartRecord

PLATE = """
    from build123d import *
    from thingc import Bolts, Bore, Boss, MountPoint, Shank, Thing

    class Plate(Thing):
        '''Three holes of 3.2 mm on a circle of 20 mm, from 25 deg, 5 mm deep; a bore of 6.1 mm; a shaft of 8 x 12 mm below.'''

        def __init__(self, circle: float = 20, start: float = 25, depth: float = 5, hole: float = 3.2, bore: float = 6.1,
                     boss: float = 8, length: float = 12, tilt: bool = False):
            super().__init__(material="petg")
            place = Location((7, -3, 11), (20, 50, 70)) if tilt else Location()
            body = Box(40, 40, 10) - Cylinder(3.05, 30)
            for k in range(3):
                a = 25 + 120 * k
                body -= Pos(0, 0, 5) * Rot(0, 0, a) * Pos(10, 0, -2.5) * Cylinder(1.6, 5)
            body += Pos(12, -12, -11) * chamfer(Cylinder(4, 12).edges().group_by(Axis.Z)[0], 0.5)
            self.body = place * body
            bolts = Bolts("M3", 3, circle, start, depth=depth, hole=hole)
            self.face = MountPoint(place * Location((0, 0, 5)), interface=["face", bolts, Bore(bore)])
            self.shaft = MountPoint(place * Location((12, -12, -5), (180, 0, 0)), interface=Boss(boss, length=length))
            self.plain = MountPoint(place * Location((0, 0, 5)), interface="a name")

        def result(self):
            return self.body
"""


def built(place: Place, mirror: str | None = None, **parameters: object) -> PartRecord:
    place.write("parts/plates.py", PLATE)
    wanted = part("plates:Plate", **parameters)  # type: ignore[arg-type]
    wanted = wanted if mirror is None else wanted.mirror_image(mirror)
    with place.service() as service:
        record = service.realize([wanted])[wanted.text]
    assert not isinstance(record, PartFailure), record.message
    return record


def contradictions(record: PartRecord) -> list[str]:
    return [words for mount in record.mounts.values() for words in mount.contradictions]


@pytest.mark.parametrize("mirror", [None, "x", "y", "z"])
@pytest.mark.parametrize("tilt", [False, True])
def test_correct_declaration_is_accepted(place: Place, tilt: bool, mirror: str | None) -> None:
    record = built(place, mirror, tilt=tilt)
    assert contradictions(record) == []
    bolts, bore = record.mounts["face"].features
    assert bolts.start == pytest.approx(math.radians(25 if mirror is None else -25))  # type: ignore[union-attr]
    assert (bolts.circle, bolts.depth, bore.diameter) == pytest.approx((0.02, 0.005, 0.0061), abs=1e-15)  # type: ignore[union-attr]
    assert record.mounts["face"].interface == "face"
    assert record.mounts["plain"].features == ()


@pytest.mark.parametrize("tilt", [False, True])
@pytest.mark.parametrize(("parameter", "value", "words"), [
    ("start", 90, "no hole at 0, 10 mm (closest hole: -8.19152, 5.73576 mm"),
    ("circle", 20.003, "on 20.003 mm`: no hole at 9.06444, 4.22682 mm (closest hole: 9.06308, 4.22618 mm, on a circle"),
    ("start", 25.1, "closest hole: 9.06308, 4.22618 mm"),  # 10 mm at 25 deg
    ("depth", 5.002, "expected a depth of 5.002 mm at 9.06308, 4.22618 mm, found 5 mm"),
    ("hole", 3.202, "has a diameter of 3.2 mm"), ("hole", 3.198, "has a diameter of 3.2 mm"),
    ("bore", 6.102, "`bore 6.102 mm`: the hole at 0, 0 mm has a diameter of 6.1 mm"), ("bore", 6.098, "has a diameter of 6.1 mm"),
    ("boss", 8.002, "`boss 8.002 mm`: found a diameter of 8 mm"),
    ("length", 12.002, "`boss 8 mm`: expected a length of 12.002 mm, found 12 mm"),
])
def test_difference_of_two_micrometres_is_reported(place: Place, parameter: str, value: float, words: str, tilt: bool) -> None:
    (found,) = contradictions(built(place, tilt=tilt, **{parameter: value}))
    assert words in found


@pytest.mark.parametrize(("parameter", "value"), [
    ("circle", 20.0009), ("depth", 5.0009), ("depth", 3.0), ("hole", 3.2009), ("bore", 6.1009), ("boss", 7.9991), ("length", 11.9991),
])
def test_difference_below_one_micrometre_is_accepted(place: Place, parameter: str, value: float) -> None:
    assert contradictions(built(place, **{parameter: value})) == []


def test_lock_file_contains_features(place: Place) -> None:
    record = built(place, bore=6.2)
    read = read_record("plates:Plate", record_values(record), "parts", None)
    assert {name: (mount.features, mount.contradictions) for name, mount in read.mounts.items()} == {
        name: (mount.features, mount.contradictions) for name, mount in record.mounts.items()
    }


@pytest.mark.parametrize(("declared", "words"), [
    ("Bolts('M3', 4)", "`count` and `start` require `circle`"),
    ("Bolts('', 1)", "- at `$[0].thread`"),
    ("Shank('M0', 3)", "- at `$[0].thread`"),
    ("Bolts('M3', start=3)", "`start` require `circle`"),
    ("Bolts('M3', 4, 2)", "holes of 3 mm overlap at a distance of 1.41421 mm"),
    ("Bolts('M2', at=((1, 1), (2, 1)))", "holes of 2 mm overlap at a distance of 1 mm"),
    ("Bolts('M10', hole=7.49)", "a hole of 7.49 mm is too small for the thread M10"),
    ("Bore(6, (6, 8))", "`clearance` must be a range [smallest, largest] below the `diameter`"),
    ("Bolts('M3', 0, 5)", "Expected `int` >= 1"),
    ("Bore(-1)", "Expected `float` > 0.0 - at `$[0].diameter`"),
    ("Connector('USB-C', 'male')", "Invalid enum value 'male'"),
    ("['a', 'b']", "must be a string, a feature such as"),
    ("3", "must be a string, a feature such as"),
])
def test_invalid_declaration_fails_the_part(place: Place, declared: str, words: str) -> None:
    place.write("parts/wrong.py", f"""
        from build123d import Box, Location
        from thingc import Bolts, Bore, Connector, MountPoint, Shank, Thing

        class Wrong(Thing):
            def __init__(self):
                self.face = MountPoint(Location(), {declared})

            def result(self):
                return Box(1, 1, 1)
    """)
    with place.service() as service:
        failure = service.realize([part("wrong:Wrong")])["wrong:Wrong"]
    assert isinstance(failure, PartFailure)
    assert words in failure.message
