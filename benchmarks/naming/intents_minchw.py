"""Intended geometry of the mounts and screws of MInchW's printed parts.

Dimensions of the servo XM430 are listed in `intents_arm.py`. Dimensions of the servo XM540, from its drawing [mm]: The output axis is 13.75
below the top and 44.75 above the bottom. The case is 33.5 wide. The face of the horn is 24.6 from the middle of the depth. The holes in the
bottom are 10 to either side, and 8 before and behind the middle. The horn has 8 holes on a circle with a diameter of 22.

The tray for three cells is 74 x 60.6. The tops of the cells are at a height of 19.9, and the two screws are at (22.2, 9.6) and on the
opposite side. The magnet has a diameter of 50, with holes 20 to either side. The head of an M2.5 screw is 4.68 wide and 2.5 high.
"""

from __future__ import annotations

from math import hypot
from typing import Any

from intents import CLEARANCE, DOWN, LEFT, RIGHT, TAP, UP, Intent, at_mouth, circle, hole, mount, plane, screw

SWING_430 = hypot(28.5 / 2, 11.25)
SWING_540 = hypot(33.5 / 2, 13.75)
HEAD = 4.68


def chassis(length: float, wall: float) -> list[Intent]:
    front, height, half = 42 + wall, wall + 40.3, 30.4 + wall
    rear, middle, axis = front - length, front - length / 2, 21.5 + wall
    rows = [
        mount("belly", (0, 0, 0), DOWN),
        mount("tray_seat", (0, 0, wall), UP),
        mount("rim", (middle, 0, height), UP, plane((middle, half - wall / 2, height), UP)),
        mount("front_seat", (front, 0, axis), RIGHT),
        mount("rear_seat", (rear, 0, axis), LEFT),
        mount("board", (rear + wall + 2, 0, height / 2), RIGHT),
        mount("imu", (front - wall - 2, 0, wall), UP, plane((0, 0, wall), UP)),
    ]
    names = ("screw_bottom_left_front", "screw_bottom_left_rear", "screw_bottom_right_front", "screw_bottom_right_rear")
    for servo, x, out, left in (("front_servo", front, RIGHT, -8), ("rear_servo", rear, LEFT, 8)):
        for k, name in enumerate(names):
            at = (x, (left, -left)[k // 2], axis + (6, -6)[k % 2])

            def held(thing: Any, servo: str = servo, name: str = name) -> Any:
                return getattr(getattr(thing, servo), name)(0)

            rows.append(screw(f"{servo}.{name}", held, at, (LEFT, RIGHT)[out is LEFT], at_mouth(at, out, CLEARANCE["M2.5"])))
    for k, s in enumerate((-1, 1)):
        x, y = s * 22.2, s * 9.6
        rows.append(screw(f"tray.fixing({k})", lambda thing, k=k: thing.tray.fixing(k, 3), (x, y, wall + 1.5), UP,
                          at_mouth((x, y, wall), UP, TAP["M2.5"])))
    for k, (s, t) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        at = (middle + s * (length - wall - 2) / 2, t * (half - 12), height)
        rows.append(screw(f"cover_screws[{k}]", lambda thing, k=k: thing.cover_screws(0)[k], at, UP, at_mouth(at, UP, TAP["M2.5"])))
    return rows


def cover(length: float, wall: float) -> list[Intent]:
    cells, half = length / 2 - 42 - wall, 30.4 + wall
    rows = [
        mount("seat", (0, 0, 0), DOWN),
        mount("tray_seat", (cells, 0, 0), DOWN),
        mount("lens", (length / 2, 0, wall + 6), RIGHT, hole((length / 2 - 4, 0, wall + 6), RIGHT, 7.2)),
    ]
    for k, (s, t) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        x, y = s * (length - wall - 2) / 2, t * (half - 12)
        rows.append(mount(f"screw_{k}", (x, y, wall), UP, at_mouth((x, y, wall), UP, CLEARANCE["M2.5"]),
                          plane((x, y + 3 * t, wall), UP)))
    for k, s in enumerate((-1, 1)):
        x, y = cells + s * 22.2, -s * 9.6
        rows.append(screw(f"tray.fixing({k})", lambda thing, k=k: thing.tray.fixing(k, 3), (x, y, -1.5), DOWN,
                          at_mouth((x, y, 0), DOWN, TAP["M2.5"])))
    return rows


def hip_bracket(thickness: float) -> list[Intent]:
    back = SWING_430 + 0.5 + thickness
    rows = [
        mount("yaw_seat", (0, 0, 19), DOWN, plane((0, 5.5, 19), DOWN)),
        mount("knee_seat", (back, 0, 0), RIGHT),
    ]
    for side, z, up in (("horn", 19, UP), ("idler", -19, DOWN)):
        for k, x, y in circle(8, 16):
            if k % 2 == 0:
                at = (y, -x, z)
                rows.append(screw(f"yaw_servo.screws_{side}[{k}]",
                                  lambda thing, side=side, k=k: getattr(thing.yaw_servo, f"screws_{side}")[k](0), at, up,
                                  at_mouth(at, (DOWN, UP)[up is DOWN], CLEARANCE["M2"])))
    for k, (z, y) in enumerate(((10, 8), (10, -8), (-10, 8), (-10, -8))):
        rows.append(screw(f"knee_servo.screws_bottom[{k}]", lambda thing, k=k: thing.knee_servo.screws_bottom[k](0),
                          (back, y, z), LEFT, at_mouth((back, y, z), RIGHT, CLEARANCE["M2.5"])))
    return rows


def thigh_brace(length: float, thickness: float) -> list[Intent]:
    middle = SWING_540 + 0.5 + (HEAD + 4) / 2
    seat = (HEAD, middle, 6)
    rows = [
        mount("knee_seat", (0, 0, 24.6), DOWN, plane((0, -7, 24.6), DOWN)),
        mount("ankle_seat", (0, length, 24.6), DOWN, plane((0, length + 7, 24.6), DOWN)),
        mount("web", (0, middle, 0), DOWN),
        mount("screw_0", seat, UP, at_mouth(seat, UP, CLEARANCE["M2.5"]), plane((HEAD + 2, middle, 6), UP)),
    ]
    for servo in ("knee_servo", "ankle_servo"):
        for k, x, y in circle(8, 22):
            if k % 2 == 0:
                at = (x, y, 24.6) if servo == "knee_servo" else (y, length - x, 24.6)
                rows.append(screw(f"{servo}.screws_horn[{k}]",
                                  lambda thing, servo=servo, k=k: getattr(thing, servo).screws_horn[k](0), at, UP,
                                  at_mouth(at, DOWN, CLEARANCE["M2.5"])))
    return rows


def foot(thickness: float, rim: float) -> list[Intent]:
    high, low = -44.75, -44.75 - thickness
    rows = [
        mount("servo_seat", (0, 0, high), UP),
        mount("magnet_seat", (0, 0, low), DOWN),
    ]
    for k, x in enumerate((20, -20)):
        at = (x, 0, high)
        rows.append(mount(f"magnet_screw_{k}", at, UP, at_mouth(at, UP, CLEARANCE["M3"]), plane((0, 0, high), UP)))
    for k, (x, y) in enumerate(((-10, 8), (-10, -8), (10, 8), (10, -8))):
        rows.append(screw(f"ankle_servo.screws_bottom[{k}]", lambda thing, k=k: thing.ankle_servo.screws_bottom[k](0),
                          (x, y, high), DOWN, at_mouth((x, y, high), UP, CLEARANCE["M2.5"])))
    return rows


