"""Draw the figures of `docs/concepts/`: `python docs/concept_pictures.py` writes

- `pictures/joint.svg`: the frames between a parent and a child of a joint, computed with `thingc.base.pose` and `thingc.base.joints`;
- `pictures/roots.svg`: one robot at one q with two roots, and its two trees;
- `pictures/closure.svg`: a four-bar linkage that a mode cuts, before and after its loop is closed.
"""

from __future__ import annotations

import math
from pathlib import Path

from thingc.base.joints.kinds import KINDS
from thingc.base.joints.twist import pose_after
from thingc.base.pose import MATE, Pose, Vector, make_pose, make_translation, rotate, turned_z

PICTURES = Path(__file__).resolve().parent / "pictures"
INK, GREY, LIGHT, ORANGE = "#20242a", "#7c828b", "#d6d9de", "#e8792b"
COLORS = ("#c62828", "#2e7d32", "#1565c0")
STYLE = (
    "text { font-family: Helvetica, Arial, sans-serif; fill: #20242a; font-size: 17px } .head { font-size: 19px; font-weight: bold } "
    ".small { font-size: 15px } .math { font-style: italic }"
)

Point = tuple[float, float]


def page(title: str, size: tuple[int, int], parts: list[str]) -> str:
    """Return an SVG document with a white background."""
    width, height = size
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">',
        f"<title>{title}</title>", f"<style>{STYLE}</style>", f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        *parts, "</svg>", "",
    ])


def text(at: Point, words: str, style: str = "", anchor: str = "start", fill: str = INK) -> str:
    """Return text at a point."""
    return f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" class="{style}" text-anchor="{anchor}" style="fill: {fill}">{words}</text>'


def line(a: Point, b: Point, color: str = INK, width: float = 2.0, dashes: str = "") -> str:
    """Return a straight line."""
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
    return f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke="{color}" stroke-width="{width}" ' \
        f'stroke-linecap="round"{dashed}/>'


def head(tip: Point, angle: float, color: str, size: float = 12.0) -> str:
    """Return an arrowhead with a direction [rad, clockwise on the page]."""
    back = (angle + math.pi - 0.4, angle + math.pi + 0.4)
    corners = [tip, *((tip[0] + size * math.cos(way), tip[1] + size * math.sin(way)) for way in back)]
    return f'<polygon points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in corners)}" fill="{color}"/>'


def arrow(a: Point, b: Point, color: str = INK, width: float = 2.5, dashes: str = "") -> list[str]:
    """Return a line with an arrowhead at `b`."""
    angle = math.atan2(b[1] - a[1], b[0] - a[0])
    return [line(a, (b[0] - 8 * math.cos(angle), b[1] - 8 * math.sin(angle)), color, width, dashes), head(b, angle, color)]


def path(points: list[Point], color: str, width: float = 2.0) -> str:
    """Return a line through points."""
    return f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}" fill="none" stroke="{color}" stroke-width="{width}"/>'


def dot(at: Point, radius: float = 6.0, fill: str = "#ffffff", stroke: str = INK) -> str:
    """Return a round joint."""
    return f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="{radius}" fill="{fill}" stroke="{stroke}" stroke-width="2.5"/>'


# --- the frames of a joint -----------------------------------------------------------------------------------------


def seen(point: Vector) -> Point:
    """Project a point to the page: x points to the lower left, y to the lower right, z up."""
    x, y, z = point
    return 200 + 100 * (y - x) * math.cos(math.pi / 6), 330 + 100 * ((x + y) * math.sin(math.pi / 6) - z)


def frame(pose: Pose, name: str, side: Point, size: float = 0.55) -> list[str]:
    """Return three arrows and a name."""
    origin = seen(pose.translation)
    parts = []
    for axis, color in enumerate(COLORS):
        unit: Vector = (float(axis == 0), float(axis == 1), float(axis == 2))
        direction = rotate(pose.rotation, unit)
        tip = seen(tuple(p + size * d for p, d in zip(pose.translation, direction, strict=True)))  # type: ignore[arg-type]
        parts += arrow(origin, tip, color)
    return [*parts, dot(origin, 4.0, INK), text((origin[0] + side[0], origin[1] + side[1]), name, "math")]


def joint() -> str:
    """Return the picture of the frames P, A, the moved A, B and C, of which `X_PC` is composed."""
    q = math.radians(55)
    parent = make_pose((0.0, -0.7, 0.0), (0.0, 0.0, 0.3))
    mount = make_translation(0.3, 0.9, 0.35)
    gap = mount @ turned_z(0.0) @ make_translation(0.0, 0.0, 0.9)
    turned = gap @ pose_after(KINDS["revolute"].twists, (q,))
    met = turned @ MATE
    child = met @ make_pose((-0.5, 0.2, -1.3), (0.2, 0.1, 0.4))
    parts = [line(seen(a.translation), seen(b.translation), GREY, 1.5, "5 5") for a, b in ((parent, mount), (mount, gap), (met, child))]
    parts += frame(parent, "P", (-26, 6)) + frame(mount, "A", (10, 22)) + frame(child, "C", (12, -6))
    x_before = rotate(gap.rotation, (1.0, 0.0, 0.0))
    start = seen(tuple(p + 0.75 * d for p, d in zip(gap.translation, x_before, strict=True)))  # type: ignore[arg-type]
    parts.append(line(seen(gap.translation), start, LIGHT, 2.5))
    arc = [gap @ turned_z(k * q / 24) @ make_translation(0.68, 0.0, 0.0) for k in range(25)]
    points = [seen(pose.translation) for pose in arc]
    (u, v), (u_before, v_before) = points[-1], points[-4]
    parts += [path(points[:-2], ORANGE, 3.0), head(points[-1], math.atan2(v - v_before, u - u_before), ORANGE)]
    parts += frame(turned, "", (0, 0))
    at = seen(turned.translation)
    parts.append(text((at[0] + 14, at[1] + 22), "A moved by q; B is this by M", "small"))
    parts.append(text((points[12][0] - 22, points[12][1] + 18), "q", "math", fill=ORANGE))
    x, y = 510.0, 120.0
    rows = (
        ("X_PA", "the mount on the parent, from P to A"), ("Rz(turn) Tz(gap)", "constants of the joint, along z of A"),
        ("X_J(q + offset)", "the twist: here a turn about z, seen from A"), ("M", "face to face: z of B is opposed"),
        ("inv(X_CB)", "from the child's mount back to C"),
    )
    parts.append(text((x, y - 34), "X_PC, read from the parent on", "head"))
    for row, (formula, says) in enumerate(rows):
        parts += [text((x, y + 46 * row), formula, "math"), text((x + 14, y + 46 * row + 20), says, "small", fill=GREY)]
    return page("The frames between a parent and a child", (840, 400), parts)


# --- two roots -----------------------------------------------------------------------------------------------------


def chain(start: Point, heading: float, lengths: tuple[float, ...], turns: tuple[float, ...]) -> list[Point]:
    """Return the points of a planar chain. Each link has a length, and an angle relative to the previous link [rad, counterclockwise]."""
    points, angle = [start], heading
    for length, turn in zip(lengths, (0.0, *turns), strict=True):
        angle += turn
        x, y = points[-1]
        points.append((x + length * math.cos(angle), y - length * math.sin(angle)))
    return points


def robot(points: list[Point], names: tuple[str, ...], root: int) -> list[str]:
    """Return a chain of links with its joints. The root is orange."""
    parts = []
    for k, (a, b) in enumerate(zip(points, points[1:], strict=False)):
        parts.append(line(a, b, ORANGE if k == root else "#4a6a8a", 13.0))
        middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
        across = math.atan2(b[0] - a[0], a[1] - b[1])
        beside, below = math.cos(across), math.sin(across)
        parts.append(text((middle[0] + (16 + 14 * abs(beside)) * beside, middle[1] + 22 * below + 5), names[k], "small", "middle"))
    return [*parts, *(dot(point) for point in points[1:-1])]


def ground(at: Point) -> list[str]:
    """Return hatched ground below a point."""
    x, y = at
    return [line((x - 60, y), (x + 60, y), GREY, 2.5), *(line((x + k, y), (x + k - 12, y + 12), GREY, 1.5) for k in range(-48, 61, 18))]


def tree(x: float, names: list[str], joints: list[str]) -> list[str]:
    """Return a tree without branches from the root downwards, with a joint at each edge."""
    parts: list[str] = []
    for k, name in enumerate(names):
        y = 400 + 56 * k
        if k:
            parts += [*arrow((x, y - 42), (x, y - 17)), text((x + 12, y - 24), joints[k - 1], "small", fill=GREY)]
        parts.append(text((x, y), name, "head" if k == 0 else "", "middle", ORANGE if k == 0 else INK))
    return parts


def roots() -> str:
    """Return the picture of one state with the root at either end."""
    lengths, names = (90.0, 130.0, 120.0), ("base", "arm", "hand")
    turns = (-0.75, -1.15)
    standing = chain((130.0, 310.0), math.pi / 2, lengths, turns)
    # The same chain from its other end, with the hand upright on the ground.
    backward = chain((640.0, 310.0), math.pi / 2, lengths[::-1], tuple(-turn for turn in turns[::-1]))
    parts = [*ground(standing[0]), *robot(standing, names, 0), *ground(backward[0]), *robot(backward[::-1], names, 2)]
    for points, side, anchor in ((standing, -10.0, "end"), (backward[::-1], 10.0, "start")):
        parts += [text((points[k][0] + side, points[k][1] - 14), name, "math", anchor) for k, name in ((1, "q1"), (2, "q2"))]
    parts += [text((40, 40), "mode bench: root base", "head"), text((480, 40), "mode held: root hand", "head")]
    parts += tree(130.0, ["base", "arm", "hand"], ["q1", "q2"]) + tree(640.0, ["hand", "arm", "base"], ["q2, reversed", "q1, reversed"])
    parts.append(text((390, 460), "the same q1 and q2", "small", "middle", GREY))
    return page("One robot at one q, with two roots", (790, 540), parts)


# --- a loop --------------------------------------------------------------------------------------------------------


def linkage(x: float, crank: float, rod: float, rocker: float) -> tuple[list[Point], list[Point]]:
    """Return a four-bar linkage that is cut at the end of its rod: ground, crank and rod from the left, ground and rocker from the right
    [rad].
    """
    left = chain((x, 250.0), crank, (90.0, 200.0), (rod - crank,))
    return left, chain((x + 190.0, 250.0), rocker, (120.0,), ())


def closing(crank: float) -> tuple[float, float]:
    """Return the angles of rod and rocker for which their ends meet, by Newton's method from an initial guess."""
    rod, rocker = 0.35, 1.35
    for _ in range(30):
        gap_x = 90 * math.cos(crank) + 200 * math.cos(rod) - 190 - 120 * math.cos(rocker)
        gap_y = 90 * math.sin(crank) + 200 * math.sin(rod) - 120 * math.sin(rocker)
        a, b, c, d = -200 * math.sin(rod), 120 * math.sin(rocker), 200 * math.cos(rod), -120 * math.cos(rocker)
        determinant = a * d - b * c
        rod -= (d * gap_x - b * gap_y) / determinant
        rocker -= (a * gap_y - c * gap_x) / determinant
    return rod, rocker


def closure() -> str:
    """Return the picture of the linkage, open at the angles of the pose, and closed by the joints that the pose does not set."""
    crank = math.radians(110)
    parts = []
    for x, angles, says in (
        (80.0, (0.35, 1.35), "the tree, with the pose's crank"), (470.0, closing(crank), "closed: rod and rocker have moved"),
    ):
        left, right = linkage(x, crank, *angles)
        parts += [*ground(left[0]), *ground(right[0]), text((x - 40, 40), says, "head")]
        parts += [line(left[0], left[1], ORANGE, 11.0), line(left[1], left[2], "#4a6a8a", 11.0), line(right[0], right[1], "#4a6a8a", 11.0)]
        parts += [dot(point) for point in (left[0], left[1], right[0])]
        if math.dist(left[2], right[1]) > 1.0:
            parts.append(line(left[2], right[1], "#c62828", 2.0, "5 5"))
            middle = (left[2][0] + right[1][0]) / 2, (left[2][1] + right[1][1]) / 2
            parts.append(text((middle[0] + 14, middle[1] - 8), "left open", "small", fill="#c62828"))
            parts += [dot(left[2], 6.0, "#ffffff", "#c62828"), dot(right[1], 6.0, "#ffffff", "#c62828")]
        else:
            parts.append(dot(left[2], 6.0, "#c62828"))
            parts.append(text((left[2][0], left[2][1] - 18), "the joint that is cut", "small", "middle", fill="#c62828"))
        parts += [
            text((left[0][0] - 34, left[0][1] - 40), "crank", "small", "end"), text((left[1][0] + 100, left[1][1] + 2), "rod", "small"),
            text((right[0][0] + 34, right[0][1] - 40), "rocker", "small"),
        ]
    says = "the cut joint's frame, told through the rod and through the rocker, has to be one"
    parts.append(text((395, 310), says, "small", "middle", GREY))
    return page("A loop, open and closed", (790, 330), parts)


DRAWN = {"joint.svg": joint, "roots.svg": roots, "closure.svg": closure}

if __name__ == "__main__":
    for name, draw in DRAWN.items():
        (PICTURES / name).write_text(draw(), encoding="utf-8", newline="\n")
        print(f"docs/pictures/{name}")
