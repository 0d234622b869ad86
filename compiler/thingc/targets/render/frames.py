"""Draw frames and joint axes over a picture. Frames and axes are drawn as arrows with names, and projected by the camera of the picture.

The arrows are drawn on top of the robot, so that frames inside parts are visible.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import sum_of
from thingc.base.pose import Pose

if TYPE_CHECKING:
    from thingc.targets.render.studio import Camera  # which imports MuJoCo: `picture.ready` must be called first

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

RED, GREEN, BLUE = (206, 32, 41), (22, 138, 52), (28, 84, 214)
"""Colours of the axes x, y and z."""
JOINT, INK = (214, 98, 0), (24, 28, 36)

LENGTH = 0.075
"""Length of a frame axis, relative to the height of the visible scene."""
SUPERSAMPLING = 3
"""Supersampling factor that makes lines smooth."""
ARC = math.radians(280.0)
"""Angle of the curved arrow around the axis of a rotating joint."""


class Stroke(FrozenStruct):
    """An arrow along points (n, 3) in its own frame. A frame axis has the length 1."""

    colour: Colour
    points: Array


class Mark(FrozenStruct):
    """A frame or a joint axis that is drawn. `pose` is relative to the MuJoCo body `body`.

    `strokes` contains the arrows, and `ink` is the colour of the text `label`. The text is near the first point of the first arrow, or near
    its last point (`place` is 0 or -1).
    """

    label: str
    body: str
    pose: Pose
    strokes: tuple[Stroke, ...]
    ink: Colour
    place: int = 0


def frame_mark(label: str, body: str, pose: Pose, size: float = 1.0) -> Mark:
    """Return a frame with one arrow for each axis x, y and z, with z last. `size` is a factor of the usual length of the axes."""
    strokes = tuple(Stroke(colour=c, points=np.array([np.zeros(3), end])) for c, end in zip((RED, GREEN, BLUE), size * np.eye(3)))
    return Mark(label=label, body=body, pose=pose, strokes=strokes, ink=INK)


def joint_mark(label: str, body: str, pose: Pose, *, slides: bool) -> Mark:
    """Return the axis of a joint, which is the z axis of `pose`, and an arrow around the axis if the joint rotates.

    The arrow shows the direction of motion when the coordinate increases.
    """
    line = Stroke(colour=JOINT, points=np.array([[0.0, 0.0, -1.2], [0.0, 0.0, 1.6]]))
    angles = np.linspace(0.0, ARC, 48)
    ring = Stroke(colour=JOINT, points=np.stack([0.5 * np.cos(angles), 0.5 * np.sin(angles), np.full_like(angles, 0.75)], axis=1))
    return Mark(label=label, body=body, pose=pose, strokes=(line,) if slides else (line, ring), ink=JOINT, place=-1)


def length_of(points: Array, camera: Camera) -> float:
    """Return the length [m] with which the axes of frames are drawn, if the camera shows points (n, 3)."""
    up = points @ camera.axes[1]
    across = points @ camera.axes[0]
    return LENGTH * max(float(np.ptp(up)), float(np.ptp(across)) / camera.aspect)


def arrows_of(mark: Mark, data: Any, length: float) -> list[Array]:
    """Return the arrows of a frame or a joint axis as points (n, 3) [m] in the world."""
    body = data.body(mark.body)
    body_rotation = body.xmat.reshape(3, 3)
    rotation, origin = body_rotation @ np.array(mark.pose.rotation), body.xpos + body_rotation @ np.array(mark.pose.translation)
    return [origin + (length * stroke.points) @ rotation.T for stroke in mark.strokes]


def draw_marks(image: Any, marks: Sequence[Mark], data: Any, camera: Camera, length: float) -> Any:
    """Draw frames and joint axes on an image, in the order of `marks`. The image is an array (height, width, 3) of bytes."""
    height, width = image.shape[:2]
    scale = SUPERSAMPLING * max(1.0, height / 720.0)
    sheet = Image.new("RGBA", (width * SUPERSAMPLING, height * SUPERSAMPLING), (255, 255, 255, 0))
    pen = ImageDraw.Draw(sheet)
    half = np.array([sheet.width, sheet.height]) / 2.0
    lines = [
        [(stroke.colour, half + camera.project(points) * half * (1.0, -1.0)) for stroke, points in zip(mark.strokes, curves)]
        for mark, curves in ((mark, arrows_of(mark, data, length)) for mark in marks)
    ]
    for colour, widening in ((None, 2.0 * scale), (True, 0.0)):
        for strokes in lines:
            for arrow_colour, points in strokes:
                _arrow(pen, points, arrow_colour if colour else (255, 255, 255), 2.2 * scale + widening, scale)
    font = ImageFont.load_default(size=13.0 * scale)
    occupied = [_box(points, 2.0 * scale) for strokes in lines for _, line in strokes for points in _pieces(line)]
    for mark, strokes in zip(marks, lines):
        origin = strokes[0][1][mark.place]
        text = pen.textbbox((0.0, 0.0), mark.label, font=font)
        box = _place_label(origin, (text[2] + 4.0 * scale, text[3] + 2.0 * scale), occupied, (sheet.width, sheet.height), scale)
        occupied.append(box)
        middle = np.array([(box[0] + box[2]) / 2.0, (box[1] + box[3]) / 2.0])
        near = np.clip(origin, box[:2], box[2:])
        if float(np.linalg.norm(near - origin)) > 9.0 * scale:
            pen.line([tuple(origin), tuple(near)], fill=(*mark.ink, 150), width=round(0.8 * scale))
        pen.text(
            tuple(middle), mark.label, font=font, fill=mark.ink, anchor="mm", stroke_width=round(1.6 * scale), stroke_fill=(255, 255, 255),
        )
    small = sheet.resize((width, height), Image.Resampling.BOX)
    line = Image.alpha_composite(Image.fromarray(image).convert("RGBA"), small)
    return np.asarray(line.convert("RGB"))


def _arrow(pen: Any, points: Array, colour: Colour, width: float, scale: float) -> None:
    """Draw a line with an arrowhead, or a dot if the line points at the camera."""
    end = points[-1]
    distant = [point for point in points[:-1] if float(np.linalg.norm(point - end)) > 4.0 * scale]
    if not distant:
        pen.ellipse([*(end - width), *(end + width)], fill=colour)
        return
    along = (end - distant[-1]) / np.linalg.norm(end - distant[-1])
    across = np.array([-along[1], along[0]])
    head = 4.0 * scale + width
    base = end - head * along
    shaft = [tuple(point) for point in points[:-1]] + [tuple(base)]
    pen.line(shaft, fill=colour, width=round(width), joint="curve")
    half_width = 0.45 * head * across
    pen.polygon([tuple(end + 0.3 * head * along), tuple(base + half_width), tuple(base - half_width)], fill=colour)


Box = tuple[float, float, float, float]


def _pieces(points: Array) -> Iterator[Array]:
    """Split a line into short pieces, so that the bounding box of each piece contains little more than the line."""
    for start, end in zip(points, points[1:]):
        steps = np.linspace(0.0, 1.0, 7 if len(points) == 2 else 2)[:, None]
        positions = start + steps * (end - start)
        yield from (positions[k : k + 2] for k in range(len(positions) - 1))


def _box(points: Array, margin: float) -> Box:
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _place_label(origin: Array, size: tuple[float, float], occupied: Sequence[Box], sheet: tuple[int, int], scale: float) -> Box:
    """Return a rectangle for a label, near the point `origin` of the picture, that does not overlap the `occupied` rectangles.

    If no rectangle is free, return the rectangle that overlaps the least. `size` and `sheet` are the width and height of the label and of
    the picture [px].
    """
    best: tuple[float, Box] | None = None
    boxes = np.array(occupied)
    for ring in range(1, 12):
        for turn in range(16):
            angle = math.radians(-30.0 + 22.5 * turn)
            direction = np.array([math.cos(angle), math.sin(angle)])
            middle = origin + direction * (10.0 * scale * ring + np.abs(direction) * size / 2.0)
            box = (*(middle - np.array(size) / 2.0).tolist(), *(middle + np.array(size) / 2.0).tolist())
            outside = max(0.0, -box[0], -box[1], box[2] - sheet[0], box[3] - sheet[1])
            covered = _overlap_area(box, boxes) + 1e3 * outside
            if covered == 0.0:
                return box
            if best is None or covered < best[0]:
                best = (covered, box)
    assert best is not None
    return best[1]


def _overlap_area(box: Box, boxes: Array) -> float:
    """Return the total area of the overlaps between a box and other boxes (n, 4)."""
    across = np.minimum(box[2], boxes[:, 2]) - np.maximum(box[0], boxes[:, 0])
    down = np.minimum(box[3], boxes[:, 3]) - np.maximum(box[1], boxes[:, 1])
    return sum_of((across * down)[(across > 0.0) & (down > 0.0)].tolist())
