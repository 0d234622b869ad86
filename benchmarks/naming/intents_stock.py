"""Intended geometry of the mounts of bought parts, taken from the drawings of the parts [mm]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from features import Feature
from intents import AWAY, CLEARANCE, DOWN, LEFT, NEAR, RIGHT, UP, Intent, at_mouth, circle, hole, mount, plane, screw


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """Dimensions in the published drawing of an X-series servo [mm]. They are the distances of the faces from the output axis and from the
    middle of the depth, and the positions of the holes.
    """

    side: float
    top: float
    bottom: float
    front: float
    horn: float
    idler: float
    sides_y: tuple[float, float]
    sides_z: float
    front_hole: tuple[float, float]
    top_hole: tuple[float, float]
    bottom_hole: tuple[float, float]
    circle: float
    horn_thread: float
    ring: float


XM430 = Drawn(
    side=14.25, top=11.25, bottom=-35.25, front=17, horn=19, idler=-19, sides_y=(-4, -28), sides_z=6, front_hole=(11, -8),
    top_hole=(8, 6), bottom_hole=(8, 6), circle=16, horn_thread=2, ring=5.5,
)
XM540 = Drawn(
    side=16.75, top=13.75, bottom=-44.75, front=22, horn=24.6, idler=-24.5, sides_y=(-6, -38), sides_z=8, front_hole=(13.5, -10.5),
    top_hole=(10, 8), bottom_hole=(10, 8), circle=22, horn_thread=2.5, ring=7,
)


def xm430(idler: bool) -> list[Intent]:
    return _servo(XM430, idler)


def xm540(idler: bool) -> list[Intent]:
    return _servo(XM540, idler)


def _servo(d: Drawn, idler: bool) -> list[Intent]:
    middle, behind = (d.top + d.bottom) / 2, d.idler if idler else -d.front
    face = plane((0, d.ring, d.horn), UP)
    rows = [
        mount("front", (0, middle, d.front), UP), mount("back", (0, middle, -d.front), DOWN),
        mount("left", (d.side, middle, 0), RIGHT), mount("right", (-d.side, middle, 0), LEFT),
        mount("top", (0, d.top, 0), AWAY), mount("bottom", (0, d.bottom, 0), NEAR),
        mount("rotor", (0, 0, d.horn), UP, face), mount("horn", (0, 0, d.horn), UP, face),
        mount("idler", (0, 0, behind), DOWN, plane((0, d.ring, behind), DOWN)),
    ]
    mouths = {}
    for s, side, out in ((1, "left", RIGHT), (-1, "right", LEFT)):
        for y, end in zip(d.sides_y, ("top", "bottom")):
            for z, where in ((d.sides_z, "front"), (-d.sides_z, "rear")):
                mouths[f"screw_{side}_{end}_{where}"] = (s * d.side, y, z), out
    for s, side in ((1, "left"), (-1, "right")):
        mouths[f"screw_front_{side}"] = (s * d.front_hole[0], d.front_hole[1], d.front), UP
        mouths[f"screw_top_{side}"] = (s * d.top_hole[0], d.top, d.top_hole[1]), AWAY
        for t, where in ((1, "front"), (-1, "rear")):
            mouths[f"screw_bottom_{side}_{where}"] = (s * d.bottom_hole[0], d.bottom, t * d.bottom_hole[1]), NEAR
    for name, (at, out) in mouths.items():
        rows.append(screw(name, lambda thing, name=name: getattr(thing, name)(0), at, out, at_mouth(at, out, 2.5)))
    for side, z, out in (("horn", d.horn, UP), ("idler", d.idler, DOWN)):
        for k, x, y in circle(8, d.circle):
            if side == "horn" or idler:
                rows.append(screw(f"screws_{side}[{k}]", lambda thing, side=side, k=k: getattr(thing, f"screws_{side}")[k](0),
                                  (x, y, z), out, at_mouth((x, y, z), out, d.horn_thread)))
    return rows


def cell(diameter: float, length: float) -> list[Intent]:
    return [
        mount("plus", (0, 0, length / 2), UP), mount("minus", (0, 0, -length / 2), DOWN),
        mount("side", (0, -diameter / 2, 0), NEAR, Feature(kind="shaft", on=(0, 0, 0), axis=UP, diameter=diameter)),
    ]


def cell_tray(cells: int, wall: float, contact: float) -> list[Intent]:
    across = [(k - (cells - 1) / 2) * 19.2 for k in range(cells)]
    rows = [mount("base", (0, 0, 0), DOWN)]
    rows += [mount(f"bay_{k}", (0, y, wall), UP, hole((0, y, wall + 9.4), RIGHT, 18.8)) for k, y in enumerate(across)]
    reach = 0.3 * (65 + 2 * (contact + wall))
    for k, (x, y) in enumerate(((-reach, across[0] + 9.6), (reach, across[-1] - 9.6))):
        at = (x, y, wall)
        rows.append(mount(f"screw_{k}", at, UP, at_mouth(at, UP, CLEARANCE["M2.5"]), plane((x + 2, y, wall), UP)))
    return rows


def magnet(diameter: float, height: float, pole: float) -> list[Intent]:
    rows = [mount("sole", (0, 0, 0), DOWN), mount("back", (0, 0, height), UP)]
    for k, x in enumerate((0.4 * diameter, -0.4 * diameter)):
        at = (x, 0, height)
        rows.append(screw(f"screws_back[{k}]", lambda thing, k=k: thing.screws_back[k](0), at, UP, at_mouth(at, UP, 3)))
    return rows


def cap_screw(size: Any, length: float, fit: str) -> list[Intent]:
    thread = float(size[1:])
    # ISO 4762: the height of the head equals the thread diameter, and its width is at least 1.5 times the thread diameter.
    return [
        mount("seat", (0, 0, 0), DOWN, plane((0.6 * thread, 0, 0), DOWN)),
        mount("tip", (0, 0, -length), DOWN),
        mount("drive", (0, 0, thread), UP, plane((0.75 * thread, 0, thread), UP)),
    ]
