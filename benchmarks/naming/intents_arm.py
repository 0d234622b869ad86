"""Intended geometry of the mounts and screws of the arm's parts.

Dimensions of the servo XM430, from its drawing [mm]: The case is 28.5 x 46.5 x 34. The output axis is 11.25 below the top and 35.25 above
the bottom. The face of the horn is 19 from the middle of the depth. The holes in the sides are 4 and 28 below the axis, and 6 to either
side of the middle. The holes in the bottom are 8 to either side, and 6 before and behind the middle. The horn has 8 holes on a circle with
a diameter of 16.
"""

from __future__ import annotations

from typing import Any

from features import Feature
from intents import AWAY, CLEARANCE, DOWN, LEFT, NEAR, RIGHT, TAP, UP, Intent, at_mouth, circle, hole, mount, plane, screw

M3_HEAD = 5.68
M25_HEAD = 4.68


def base_plate(size: float, thickness: float, wall: float) -> list[Intent]:
    corner, t, side = size / 2 - 8, thickness, 14.35 + wall
    rows = [
        mount("servo_seat", (-12, 0, t), UP),
        mount("bottom", (0, 0, 0), DOWN, plane((corner - 4, corner - 4, 0), DOWN)),
    ]
    for k, (sx, sy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        at = (sx * corner, sy * corner, t)
        rows.append(mount(f"table_{k}", at, UP, at_mouth(at, UP, CLEARANCE["M4"]), plane((at[0] - 4 * sx, at[1], t), UP)))
    for k, (s, x, z) in enumerate((s, x, z) for s in (-1, 1) for x in (-4, -28) for z in (6, -6)):
        at, out = (x, s * side, t + 17 + z), (NEAR, AWAY)[s > 0]
        rows.append(mount(f"servo_screw_{k}", at, out, at_mouth(at, out, CLEARANCE["M2.5"]), plane((x + 2, at[1], at[2]), out)))
    for k in range(8):
        s, x, z = (-1, 1)[k // 4], (-4, -28)[k % 4 // 2], (6, -6)[k % 2]
        at, out = (x, s * 14.25, t + 17 + z), (NEAR, AWAY)[s > 0]

        def held(thing: Any, k: int = k) -> Any:
            return (*thing.servo.screws_left, *thing.servo.screws_right)[k](0)

        rows.append(screw(f"servo.screws_{'left' if s < 0 else 'right'}[{k % 4}]", held, at, out,
                          hole((x, s * (side - 1), at[2]), out, CLEARANCE["M2.5"])))
    return rows


def yaw_pitch_bracket(thickness: float, wall: float) -> list[Intent]:
    t, side = thickness, 14.35 + wall
    rows = [
        mount("yaw_seat", (0, 0, 0), DOWN, plane((5.5, 0, 0), DOWN)),
        mount("shoulder_seat", (0, 0, t), UP, plane((5, 0, t), UP)),
        mount("board", (-side, 0, (t + 7.25 + M25_HEAD) / 2), LEFT),
    ]
    for k, (s, y) in enumerate((s, y) for s in (-1, 1) for y in (6, -6)):
        at, out = (s * side, y, t + 7.25), (LEFT, RIGHT)[s > 0]
        rows.append(mount(f"servo_screw_{k}", at, out, at_mouth(at, out, CLEARANCE["M2.5"]), plane((at[0], y, at[2] - 2), out)))
    rows += [
        screw(f"yaw_servo.screws_horn[{k}]", lambda thing, k=k: thing.yaw_servo.screws_horn[k](0), (y, -x, 0), UP,
              at_mouth((y, -x, 0), DOWN, CLEARANCE["M2"]))
        for k, x, y in circle(8, 16)
    ]
    return rows


def rotor_brace(length: float, thickness: float) -> list[Intent]:
    end = length - 35.25
    rows = [
        mount("rotor_seat", (0, 0, 19), DOWN, plane((0, -5.5, 19), DOWN)),
        mount("servo_seat", (0, end, 0), AWAY, plane((0, end, 6), AWAY)),
    ]
    rows += _horn("turning_servo", thickness)
    for name, x in (("screw_bottom_left_front", 8), ("screw_bottom_right_front", -8)):
        rows.append(screw(f"next_servo.{name}", lambda thing, name=name: getattr(thing.next_servo, name)(0), (x, end, 6), NEAR,
                          at_mouth((x, end, 6), AWAY, CLEARANCE["M2.5"])))
    return rows


def omega_cap(pen_diameter: float, thickness: float, width: float) -> list[Intent]:
    radius, t = pen_diameter / 2 + 0.1, thickness
    spot, foot, axis = radius + t + M3_HEAD / 2 + 0.4, radius + t / 2, pen_diameter / 2 + 0.05
    rows = [
        mount("seat", (0, 0, 0), DOWN, plane((foot, 0, 0), DOWN, (-foot, 0, 0))),
        mount("pen", (0, 0, axis), UP, hole((0, 0, axis), AWAY, 2 * radius)),
    ]
    for k, s in enumerate((1, -1)):
        at = (s * spot, 0, t)
        rows.append(mount(f"screw_{k}", at, UP, at_mouth(at, UP, CLEARANCE["M3"]), plane((s * (spot + 2.5), 0, t), UP)))
    return rows


def hand(pen_diameter: float, clearance: float, thickness: float, front: float) -> list[Intent]:
    end, spot = clearance + front, pen_diameter / 2 + 0.1 + 3 + M3_HEAD / 2 + 0.4
    rows = [
        mount("rotor_seat", (0, 0, 19), DOWN, plane((0, -5.5, 19), DOWN)),
        mount("cap_seat", (0, end, 0), AWAY),
    ]
    rows += _horn("servo", thickness)
    for k, z in enumerate((-spot, spot)):
        rows.append(screw(f"cap.fixing({k})", lambda thing, k=k: thing.cap.fixing(k, 5), (0, end + 3, z), AWAY,
                          at_mouth((0, end, z), AWAY, TAP["M3"])))
    return rows


def pen_dummy(length: float, diameter: float) -> list[Intent]:
    top = 0.6 * length
    return [
        mount("grip", (0, 0, 0), NEAR, Feature(kind="shaft", on=(0, 0, 0), axis=UP, diameter=diameter)),
        mount("tip", (0, 0, top), UP, Feature(kind="apex", on=(0, 0, top), axis=UP)),
    ]


def _horn(servo: str, thickness: float) -> list[Intent]:
    """Return the intended geometry of the screws into the horn of a servo, in the frame of the part. `thickness` [mm] is the thickness of
    the part at the horn.
    """
    return [
        screw(f"{servo}.screws_horn[{k}]", lambda thing, k=k: getattr(thing, servo).screws_horn[k](thickness),
              (x, y, 19 + thickness), UP, at_mouth((x, y, 19), DOWN, CLEARANCE["M2"]))
        for k, x, y in circle(8, 16)
    ]
