"""Draw `docs/pictures/mate.svg`: two mounts about to mate, and the parent axis of each child axis.

The axes are read from `thingc.base.pose.MATE` and drawn in an isometric view from +x +y +z.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

from thingc.base.pose import MATE, Vector

PICTURE = Path(__file__).resolve().parent / "pictures" / "mate.svg"
SCALE, LEFT, GROUND = 92.0, 232.0, 330.0
LIFT = 1.9
"""Distance of the child's mount above the parent's mount."""
COLORS = {"x": "#c62828", "y": "#2e7d32", "z": "#1565c0"}
BASIS: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def point(x: float, y: float, z: float) -> tuple[float, float]:
    """Project a point in the frame of the parent mount to the page: x points to the lower left, y to the lower right, z up."""
    across, down = (y - x) * math.cos(math.pi / 6), (x + y) * math.sin(math.pi / 6) - z
    return round(LEFT + SCALE * across, 1), round(GROUND + SCALE * down, 1)


def polygon(corners: list[Vector], fill: str, opacity: float, stroke: str) -> str:
    """Return a filled face."""
    points = " ".join(f"{u},{v}" for u, v in (point(*corner) for corner in corners))
    return f'<polygon points="{points}" fill="{fill}" fill-opacity="{opacity}" stroke="{stroke}" stroke-linejoin="round"/>'


def block(half: float, low: float, high: float, fills: tuple[str, str, str], opacity: float, stroke: str) -> list[str]:
    """Return the three visible faces of a box: +x, +y and the top."""
    h = half
    return [
        polygon([(h, -h, low), (h, h, low), (h, h, high), (h, -h, high)], fills[0], opacity, stroke),
        polygon([(-h, h, low), (h, h, low), (h, h, high), (-h, h, high)], fills[1], opacity, stroke),
        polygon([(-h, -h, high), (h, -h, high), (h, h, high), (-h, h, high)], fills[2], opacity, stroke),
    ]


def axis(origin: Vector, direction: Vector, length: float, color: str, label: str, side: tuple[float, float]) -> list[str]:
    """Return an arrow with a label at its tip: a letter with an index."""
    tip = tuple(o + length * d for o, d in zip(origin, direction, strict=True))
    (u0, v0), (u1, v1) = point(*origin), point(*tip)  # type: ignore[arg-type]
    angle = math.atan2(v1 - v0, u1 - u0)
    head = " ".join(
        f"{u1 + 17 * math.cos(angle + turn):.1f},{v1 + 17 * math.sin(angle + turn):.1f}" if turn else f"{u1},{v1}"
        for turn in (0.0, math.pi - 0.36, math.pi + 0.36)
    )
    u2, v2 = u1 - 12 * math.cos(angle), v1 - 12 * math.sin(angle)
    return [
        f'<line x1="{u0}" y1="{v0}" x2="{u2:.1f}" y2="{v2:.1f}" stroke="{color}" stroke-width="3.5" stroke-linecap="round"/>',
        f'<polygon points="{head}" fill="{color}"/>',
        f'<text x="{u1 + side[0]:.1f}" y="{v1 + side[1]:.1f}" class="axis" style="fill: {color}">{label[0]}'
        f'<tspan dy="5" font-size="14">{label[1:]}</tspan></text>',
    ]


def along(child: str) -> str:
    """Return the parent axis of a child axis, such as `-y`, from the matrix."""
    column = "xyz".index(child)
    row = next(k for k in range(3) if abs(MATE.rotation[k][column]) == 1.0)
    return ("-" if MATE.rotation[row][column] < 0.0 else "+") + "xyz"[row]


def picture() -> str:
    """Return the SVG document."""
    below, above = (0.0, 0.0, 0.0), (0.0, 0.0, LIFT)
    parts = block(1.0, -0.42, 0.0, ("#c9ccd1", "#b4b8bf", "#e4e6e9"), 1.0, "#7c828b")
    parts += axis(below, BASIS["x"], 1.55, COLORS["x"], "xA", (-30.0, 10.0))
    parts += axis(below, BASIS["y"], 1.55, COLORS["y"], "yA", (10.0, 10.0))
    (u0, v0), (u1, v1) = point(*below), point(*above)
    parts.append(f'<line x1="{u0}" y1="{v0}" x2="{u1}" y2="{v1}" stroke="#9aa0a8" stroke-width="1.5" stroke-dasharray="5 5"/>')
    parts += axis(below, BASIS["z"], 0.72, COLORS["z"], "zA", (12.0, 14.0))
    parts.append(f'<circle cx="{u0}" cy="{v0}" r="5" fill="#20242a"/>')
    parts += block(0.5, LIFT, LIFT + 0.75, ("#f2c48b", "#e8b06b", "#f9dfbd"), 0.5, "#b07a33")
    hidden = [(0.5, -0.5, LIFT), (-0.5, -0.5, LIFT), (-0.5, 0.5, LIFT)]
    ends = " ".join(f"{u},{v}" for u, v in (point(*corner) for corner in hidden))
    parts.append(f'<polyline points="{ends}" fill="none" stroke="#b07a33" stroke-dasharray="3 4"/>')
    sides = {"x": (-32.0, 2.0), "y": (8.0, 2.0), "z": (12.0, 2.0)}
    for name in "xyz":
        column = "xyz".index(name)
        direction = (MATE.rotation[0][column], MATE.rotation[1][column], MATE.rotation[2][column])
        parts += axis(above, direction, 0.72 if name == "z" else 1.35, COLORS[name], f"{name}B", sides[name])
    parts.append(f'<circle cx="{u1}" cy="{v1}" r="5" fill="#20242a"/>')
    parts += [
        f'<text x="{LEFT + 62}" y="{v1 - 84:.1f}" class="name">child</text>',
        f'<text x="{LEFT + 62}" y="{v0 + 118:.1f}" class="name">parent</text>',
    ]
    x, y = 490, 130
    parts.append(f'<text x="{x}" y="{y}" class="head">When B has met A</text>')
    for row, name in enumerate("xyz"):
        target = along(name)
        shown = target.replace("-", "\N{MINUS SIGN}")
        parts.append(
            f'<text x="{x + 14}" y="{y + 34 + 28 * row}" class="row">'
            f'<tspan style="fill: {COLORS[name]}">{name}</tspan> of B lies along '
            f'<tspan style="fill: {COLORS[target[1]]}">{shown}</tspan> of A</text>'
        )
    parts.append(f'<text x="{x}" y="{y + 176}" class="row">M =</text>')
    for k, line in enumerate(MATE.rotation):
        for j, entry in enumerate(line):
            shown = f"{int(entry)}".replace("-", "\N{MINUS SIGN}")
            parts.append(f'<text x="{x + 82 + 36 * j}" y="{y + 148 + 28 * k}" class="number">{shown}</text>')
    for edge, turn in ((x + 46, 8), (x + 168, -8)):
        outline = f"M {edge + turn} {y + 128} H {edge} V {y + 212} H {edge + turn}"
        parts.append(f'<path d="{outline}" fill="none" stroke="#20242a" stroke-width="1.6"/>')
    return "\n".join([
        '<svg xmlns="http://www.w3.org/2000/svg" width="760" height="480" viewBox="0 0 760 480">',
        "<title>Two mounts about to mate</title>",
        "<style>text { font-family: Helvetica, Arial, sans-serif; fill: #20242a } .axis { font-size: 22px; font-weight: bold } "
        ".name { font-size: 17px } .head { font-size: 19px; font-weight: bold } .row { font-size: 18px } "
        ".row tspan { font-weight: bold } "
        ".number { font-size: 18px; text-anchor: end }</style>",
        '<rect width="760" height="480" fill="#ffffff"/>',
        *parts,
        "</svg>",
    ]) + "\n"


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8", newline="\n")
    print(PICTURE.relative_to(Path.cwd()) if PICTURE.is_relative_to(Path.cwd()) else PICTURE, file=sys.stdout)
