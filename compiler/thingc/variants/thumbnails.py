"""`python -m thingc.variants.thumbnails`: small pictures of variants, all by one camera, in a process of its own.

Drawing needs a graphics library that is chosen when MuJoCo is imported, and that may crash: neither is the driver's. Lines of JSON
on standard input, `{"measure": [model, ...], "pose": ...}` and then `{"draw": [[model, picture], ...], "points": [...], ...}`; answers
on standard output: the points that a camera has to see, then a line for each picture. When its input ends, it ends.
"""

from __future__ import annotations

import json
import os
import sys
from typing import TYPE_CHECKING, Any

from thingc.render import NoGraphics, Shot, ready
from thingc.variants.places import NEW

if TYPE_CHECKING:
    from thingc.render.camera import Array

SIZE = (240, 180)
"""Width and height [px]."""
LAMPS = (8, 8)
"""Of the soft box and of the dome: enough for so small a picture."""
SHADOW = 1024
"""Side of a shadow map [px]."""


def read(path: str) -> tuple[str, dict[str, bytes]]:
    """A model's XML and its meshes, by the names that it has for them. Raises `OSError`."""
    with open(path, encoding="utf-8") as stream:
        xml = stream.read()
    folder = os.path.join(os.path.dirname(path), "assets")
    assets: dict[str, bytes] = {}
    for name in sorted(os.listdir(folder)) if os.path.isdir(folder) else ():
        with open(os.path.join(folder, name), "rb") as mesh:
            assets[name] = mesh.read()
    return xml, assets


def pose_of(model: Any, pose: str | None) -> str | None:
    """The keyframe to show: the one named if the model has it, else its first; None where it has none."""
    names = [model.key(k).name for k in range(model.nkey)]
    return pose if pose in names else next(iter(names), None)


def corners(points: Array, gravity: tuple[float, float, float]) -> list[list[float]]:
    """The few of points (n, 3) [m] that decide where a camera stands that sees them all: those that touch its picture's edges, the
    nearest, the lowest, and the two most distant along each axis of the world."""
    import numpy as np

    from thingc.render.picture import camera_of

    camera = camera_of(points, gravity, Shot(size=SIZE))
    x, y, z = camera.axes @ points.T
    t = camera.tangent
    edges = (x + t * camera.aspect * z, t * camera.aspect * z - x, y + t * z, t * z - y, z, *points.T, *-points.T)
    chosen = sorted({int(np.argmax(values)) for values in edges})
    return [[float(value) for value in points[index]] for index in chosen]


def measure(path: str, pose: str | None) -> tuple[list[list[float]], tuple[float, float, float]]:
    """Corner points [m] of a model in its pose (none where nothing of it is to be seen), and its gravity [m/s^2]."""
    import mujoco

    from thingc.render.picture import points_of, posed

    model = mujoco.MjModel.from_xml_string(*read(path))
    gravity = (float(model.opt.gravity[0]), float(model.opt.gravity[1]), float(model.opt.gravity[2]))
    points = points_of(model, posed(model, pose_of(model, pose)))
    return (corners(points, gravity) if len(points) else []), gravity


def draw(path: str, pose: str | None, points: Array, gravity: tuple[float, float, float]) -> bytes:
    """A PNG of a model, by the camera that sees all `points` (n, 3) [m]."""
    import numpy as np

    from thingc.render import studio
    from thingc.render.picture import camera_of, encoded, posed

    xml, assets = read(path)
    low, high = points.min(axis=0), points.max(axis=0)
    spec = studio.spec_of(xml, assets, SIZE, min(0.0, float(low[2])), shadow=SHADOW)
    model = spec.compile()
    data = posed(model, pose_of(model, pose))
    extent = 0.75 * float(np.linalg.norm(high - low))
    camera = camera_of(points, gravity, Shot(size=SIZE))
    return encoded(studio.photographed(model, data, camera, SIZE, (low + high) / 2.0, extent, counts=LAMPS))


def main() -> None:
    """Answer the lines of standard input on standard output until it ends."""
    answers = os.dup(1)
    os.dup2(2, 1)  # whatever libraries print goes to standard error
    os.environ.setdefault("MUJOCO_GL", "egl")

    def answer(found: Any) -> None:
        try:
            os.write(answers, json.dumps(found).encode() + b"\n")
        except BrokenPipeError:
            os._exit(0)

    asked = json.loads(sys.stdin.readline() or "null")
    if asked is None:
        return
    measured = []
    for path in asked["measure"]:
        try:
            measured.append(measure(path, asked["pose"]))
        except (OSError, ValueError):  # gone, or no model for MuJoCo
            measured.append(([], (0.0, 0.0, 0.0)))
    answer(measured)
    asked = json.loads(sys.stdin.readline() or "null")
    if asked is None:
        return
    try:
        ready()
    except NoGraphics as fault:
        answer({"fault": fault.message, "hint": fault.hint})
        return
    import numpy as np

    points, gravity = np.array(asked["points"]), tuple(asked["gravity"])
    for path, picture in asked["draw"]:
        data = draw(path, asked["pose"], points, gravity)
        aside = os.path.join(os.path.dirname(picture), f"{NEW}{os.path.basename(picture)}-{os.getpid()}")
        with open(aside, "wb") as stream:
            stream.write(data)
        os.replace(aside, picture)
        answer({"drawn": picture})


if __name__ == "__main__":
    main()
