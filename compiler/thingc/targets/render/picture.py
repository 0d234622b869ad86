"""Render a model in a pose to a picture file, or render a series of small pictures with the same camera."""

from __future__ import annotations

import math
import os
import sys
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from thingc.base.diagnostics import Code, UserError
from thingc.base.frozen_struct import FrozenStruct

if TYPE_CHECKING:
    from thingc.targets.render.frames import Mark
    from thingc.targets.render.studio import Array

ANGLE = 18.0
"""Vertical field of view [deg]. The angle is small, so that parallel edges also look parallel in the picture."""

MARGIN = 0.12
"""Width of the free border around the robot, as a fraction of half of the picture."""

AZIMUTH, ELEVATION = 140.0, -22.0
"""Default direction of the camera [deg], for a robot on a floor or without gravity."""

WALL_AZIMUTH, CEILING_ELEVATION = 40.0, 16.0
"""Direction of the camera [deg] if the floor of the world is a wall or a ceiling. For a wall, the camera looks along the wall. For a
ceiling, the camera looks up at the ceiling.
"""


SIZE = (240, 180)
"""Default width and height of a small picture [px]."""

FEW_PIXELS = 320 * 240
"""Largest number of pixels of a picture with coarse shadows."""


class NoGraphics(UserError):
    """Raised if this machine cannot render pictures."""

    code = Code.NO_GRAPHICS


class Shot(FrozenStruct):
    """The view of a picture: its size and the direction of the camera.

    `size` is (width, height) in pixels. `azimuth` and `elevation` [deg] are the viewing direction of the camera. For an angle that is None,
    a suitable value is selected. The camera looks along y if the azimuth is 90, and straight down if the elevation is -90.
    """

    size: tuple[int, int] = (1280, 960)
    azimuth: float | None = None
    elevation: float | None = None


def allow_rendering() -> None:
    """Let MuJoCo load its default rendering backend, unless the user selects another one. The command line disables rendering by default,
    because loading an OpenGL library takes time.
    """
    if os.environ.get("MUJOCO_GL") == "disable":
        del os.environ["MUJOCO_GL"]


def ready() -> None:
    """Prepare rendering without a display. Call this function before importing MuJoCo, because MuJoCo selects its rendering backend when it
    is imported.

    If the environment variable `MUJOCO_GL` is not set, or is set to `disable`, it is set to `egl`, or on macOS and Windows to the usual
    backend of MuJoCo. Raises `NoGraphics` if this backend is not available.
    """
    allow_rendering()
    backend = os.environ.setdefault("MUJOCO_GL", "egl" if sys.platform == "linux" else "on")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GLFW warns if there is no screen
            import mujoco
            from mujoco import gl_context

            context = getattr(gl_context, "GLContext", None)
            if context is not None and context.__module__ == "mujoco.glfw" and not _has_screen():
                backend = "glfw"  # also if MuJoCo was imported before the variable was set
                raise RuntimeError("GLFW requires a screen")  # MuJoCo aborts a process without a screen that has loaded an OpenGL library
            with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8):
                pass
    except Exception as fault:  # the loaders of OpenGL raise ImportError, AttributeError, RuntimeError or their own
        absent = isinstance(fault, (AttributeError, ImportError, OSError))  # PyOpenGL: None in place of the library
        reason = "the library is missing" if absent else " ".join(str(fault).split()).partition(",")[0] or type(fault).__name__
        raise NoGraphics(f"cannot render with MUJOCO_GL={backend}: {reason}", _hint(backend)) from fault


def _has_screen() -> bool:
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _hint(backend: str) -> str:
    if backend == "egl":
        return "install EGL (Debian, Ubuntu: apt install libegl1)"
    if backend == "osmesa":
        return "install OSMesa (Debian, Ubuntu: apt install libosmesa6), or set MUJOCO_GL=egl"
    if sys.platform != "linux":
        return "set MUJOCO_GL=on, and run the command in a session with a screen"
    return "set MUJOCO_GL=egl before MuJoCo is imported"


def picture(
    xml: str, assets: dict[str, bytes], *, pose: str | None, gravity: tuple[float, float, float], shot: Shot, marks: Sequence[Mark] = (),
) -> bytes:
    """Render the MuJoCo model `xml` as a PNG picture, with `marks` drawn over it.

    `pose` is the name of a keyframe of the model. If `pose` is None, all coordinates are 0. `gravity` [m/s^2] determines which way is up.
    The same call returns the same picture on the same machine. Call the function `ready` before this function.
    """
    import mujoco
    import numpy as np

    from thingc.targets.render import frames, studio

    unlit = mujoco.MjModel.from_xml_string(xml, assets)
    points = points_of(unlit, pose_model(unlit, pose))
    quality = studio.COARSE if math.prod(shot.size) <= FEW_PIXELS else studio.FINE
    model = studio.model_of(xml, assets, shot.size, float(points[:, 2].min()) if len(points) else 0.0, quality)
    data = pose_model(model, pose)
    if not len(points):
        points = np.array([[-0.1, -0.1, 0.0], [0.1, 0.1, 0.1]])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    extent = 1.5 * float(np.linalg.norm(points - centre, axis=1).max())
    camera = camera_of(points, gravity, shot)
    if not marks:
        return encode_png(studio.render(model, data, camera, shot.size, centre, extent, quality))
    length = frames.length_of(points, camera)
    strokes = [stroke for mark in marks for stroke in frames.arrows_of(mark, data, length)]
    camera = camera_of(np.concatenate([points, *strokes]), gravity, shot)
    image = studio.render(model, data, camera, shot.size, centre, extent, quality)
    return encode_png(frames.draw_marks(image, marks, data, camera, length))


def camera_of(points: Array, gravity: tuple[float, float, float], shot: Shot) -> Any:
    """Return the camera that is as near as possible and shows all points (n, 3) [m]. A shot specifies the viewing direction and the aspect
    ratio of the camera.
    """
    import numpy as np

    from thingc.targets.render.studio import directions, fit_camera, upright

    frame = upright(np.array(gravity))
    azimuth = WALL_AZIMUTH if abs(frame[2, 2]) < 0.5 else AZIMUTH
    elevation = CEILING_ELEVATION if frame[2, 2] < -0.5 else ELEVATION
    azimuth = azimuth if shot.azimuth is None else shot.azimuth
    elevation = elevation if shot.elevation is None else shot.elevation
    axes = directions(np.radians(azimuth), np.radians(elevation), frame)
    return fit_camera(points, axes, np.radians(ANGLE), shot.size[0] / shot.size[1], MARGIN)


def pose_model(model: Any, pose: str | None) -> Any:
    """Return the simulation state (`mujoco.MjData`) of a model in the pose of a keyframe. The function has called `mj_forward` for this
    state.
    """
    import mujoco

    data = mujoco.MjData(model)
    if pose is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
    mujoco.mj_forward(model, data)
    return data


def points_of(model: Any, data: Any) -> Array:
    """Return points (n, 3) [m] in the world that have the same convex hull as all visible geoms.

    The points are the vertices of meshes, and the corners of the bounding boxes of other shapes.
    """
    import numpy as np

    points = [np.zeros((0, 3))]
    for geom in np.flatnonzero(model.geom_group <= 2):
        mesh = int(model.geom_dataid[geom])
        if mesh >= 0:
            start = int(model.mesh_vertadr[mesh])
            local = model.mesh_vert[start : start + int(model.mesh_vertnum[mesh])].astype(float)
        else:
            middle, half = model.geom_aabb[geom][:3], model.geom_aabb[geom][3:]
            local = middle + half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        points.append(local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.concatenate(points)


def encode_png(image: Any) -> bytes:
    """Encode an image as PNG. The image is an array (height, width, 3) of bytes."""
    import io

    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="png", optimize=True)
    return stream.getvalue()



Point = Sequence[float]
"""The coordinates x, y and z of a point [m] in the world."""


def extent(xml: str, assets: dict[str, bytes], pose: str | None) -> tuple[list[list[float]], tuple[float, float, float]]:
    """Return the corner points [m] and the gravity [m/s^2] of a MuJoCo model. `xml` is the text of the model.

    There are no points if no geom is visible. The model is in the keyframe `pose` if this keyframe exists. A model without this keyframe is
    in its first keyframe. Raises `ValueError` if `xml` is not a valid model.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml, assets)
    gravity = (float(model.opt.gravity[0]), float(model.opt.gravity[1]), float(model.opt.gravity[2]))
    points = points_of(model, pose_model(model, _pose_of(model, pose)))
    return (_corners(points, gravity) if len(points) else []), gravity


def body_poses(xml: str, assets: dict[str, bytes], pose: str | None) -> dict[str, tuple[list[float], list[float]]]:
    """Return the position [m] and quaternion (w, x, y, z) of each body in the world, by name. The model is in the same pose as in
    `extent`.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml, assets)
    data = pose_model(model, _pose_of(model, pose))
    return {model.body(k).name: (data.xpos[k].tolist(), data.xquat[k].tolist()) for k in range(model.nbody)}


def small_picture(
    xml: str, assets: dict[str, bytes], pose: str | None, points: Sequence[Point], gravity: Point, size: tuple[int, int] = SIZE,
) -> bytes:
    """Render a small PNG picture of a model in the same pose as in `extent`, with all `points` in view.

    `size` is the width and the height of the picture in pixels. Call the function `ready` before this function.
    """
    import numpy as np

    from thingc.targets.render import studio

    visible = np.array(points)
    low, high = visible.min(axis=0), visible.max(axis=0)
    model = studio.model_of(xml, assets, size, float(low[2]), studio.COARSE)
    data = pose_model(model, _pose_of(model, pose))
    length = 0.75 * float(np.linalg.norm(high - low))
    camera = camera_of(visible, (gravity[0], gravity[1], gravity[2]), Shot(size=size))
    return encode_png(studio.render(model, data, camera, size, (low + high) / 2.0, length, studio.COARSE))


def _pose_of(model: Any, pose: str | None) -> str | None:
    """Return the name of the keyframe to show. The result is `pose` if this keyframe exists, or else the first keyframe. Return None for a
    model without keyframes.
    """
    names = [model.key(k).name for k in range(model.nkey)]
    return pose if pose in names else next(iter(names), None)


def _corners(points: Array, gravity: tuple[float, float, float]) -> list[list[float]]:
    """Return the points of the array (n, 3) that determine the position of a camera with all points in view.

    The result consists of the points at the edges of the picture, the nearest point, the lowest point, and the two extreme points along
    each world axis.
    """
    import numpy as np

    camera = camera_of(points, gravity, Shot(size=SIZE))
    x, y, z = camera.axes @ points.T
    t = camera.tangent
    edges = (x + t * camera.aspect * z, t * camera.aspect * z - x, y + t * z, t * z - y, z, *points.T, *-points.T)
    chosen = sorted({int(np.argmax(values)) for values in edges})
    return [[float(value) for value in points[index]] for index in chosen]
