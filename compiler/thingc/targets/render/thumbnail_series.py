"""Small pictures of many robots, all by one camera, so that sizes compare: first what it has to see of each, then each picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from thingc.targets.render.picture import Shot, camera_of, encoded, points_of, posed

if TYPE_CHECKING:
    from thingc.targets.render.camera import Array

SIZE = (240, 180)
"""Width and height [px]."""
LAMPS = (8, 8)
"""Of the soft box and of the dome: enough for so small a picture."""
SHADOW = 1024
"""Side of a shadow map [px]."""

Point = Sequence[float]
"""x, y and z [m] in the world."""


def extent(xml: str, assets: dict[str, bytes], pose: str | None) -> tuple[list[list[float]], tuple[float, float, float]]:
    """Corner points [m] of the MuJoCo model `xml` with its meshes (none where nothing of it is to be seen), and its gravity [m/s^2].

    It is in the keyframe `pose` if it has that, else in its first. Raises `ValueError` for what is no model.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml, assets)
    gravity = (float(model.opt.gravity[0]), float(model.opt.gravity[1]), float(model.opt.gravity[2]))
    points = points_of(model, posed(model, _pose_of(model, pose)))
    return (_corners(points, gravity) if len(points) else []), gravity


def body_poses(xml: str, assets: dict[str, bytes], pose: str | None) -> dict[str, tuple[list[float], list[float]]]:
    """Where the bodies of a MuJoCo model stand in the world, by name: position [m] and quaternion (w, x, y, z), in the pose that `extent`
    takes."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml, assets)
    data = posed(model, _pose_of(model, pose))
    return {model.body(k).name: (data.xpos[k].tolist(), data.xquat[k].tolist()) for k in range(model.nbody)}


def small_picture(
    xml: str, assets: dict[str, bytes], pose: str | None, points: Sequence[Point], gravity: Point, size: tuple[int, int] = SIZE,
) -> bytes:
    """A PNG of a model, `size` [px], in the pose that `extent` takes, by the camera that sees all `points`. Call `ready` first."""
    import numpy as np

    from thingc.targets.render import studio

    seen = np.array(points)
    low, high = seen.min(axis=0), seen.max(axis=0)
    spec = studio.spec_of(xml, assets, size, float(low[2]), shadow=SHADOW)
    model = spec.compile()
    data = posed(model, _pose_of(model, pose))
    length = 0.75 * float(np.linalg.norm(high - low))
    camera = camera_of(seen, (gravity[0], gravity[1], gravity[2]), Shot(size=size))
    return encoded(studio.photographed(model, data, camera, size, (low + high) / 2.0, length, counts=LAMPS))


def _pose_of(model: Any, pose: str | None) -> str | None:
    """The keyframe to show: the one named if the model has it, else its first; None where it has none."""
    names = [model.key(k).name for k in range(model.nkey)]
    return pose if pose in names else next(iter(names), None)


def _corners(points: Array, gravity: tuple[float, float, float]) -> list[list[float]]:
    """The few of points (n, 3) [m] that decide where a camera stands that sees them all: those that touch its picture's edges, the
    nearest, the lowest, and the two most distant along each axis of the world."""
    import numpy as np

    camera = camera_of(points, gravity, Shot(size=SIZE))
    x, y, z = camera.axes @ points.T
    t = camera.tangent
    edges = (x + t * camera.aspect * z, t * camera.aspect * z - x, y + t * z, t * z - y, z, *points.T, *-points.T)
    chosen = sorted({int(np.argmax(values)) for values in edges})
    return [[float(value) for value in points[index]] for index in chosen]
