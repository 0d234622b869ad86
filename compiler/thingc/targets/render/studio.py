"""Render pictures in studio light. A picture is the average of many renderings, each lit by one distant lamp.

The renderer of MuJoCo only supports lamps with hard shadows. However, a large soft box and a bright dome can be approximated by many single
lamps, and the mean of their pictures has soft shadows. Between the renderings, the camera is shifted by a fraction of a pixel, which also
smooths the edges. The mean must be computed in linear light. Therefore, colours are first converted to linear values, and the result is
encoded for screens.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import sum_of

Array = NDArray[np.float64]

NEAR_FRACTION = 0.3
"""Distance of the near plane, relative to the distance of the nearest point."""


class Camera(FrozenStruct, eq=False):
    """A pinhole camera at `position` (3,) [m].

    The rows of `axes` (3, 3) are the right, the up and the backward direction of the camera. `tangent` is the tangent of half of the
    vertical field of view. `aspect` is the width divided by the height, and `near` [m] is the distance of the near plane.
    """

    position: Array
    axes: Array
    tangent: float
    aspect: float
    near: float

    def project(self, points: Array) -> Array:
        """Project points `(n, 3)` [m] to the picture `(n, 2)`: x to the right and y up, both from -1 to 1 inside the picture."""
        x, y, back = self.axes @ (points - self.position).T
        return np.stack([x / (-back * self.tangent * self.aspect), y / (-back * self.tangent)], axis=1)


def directions(azimuth: float, elevation: float, upright: Array) -> Array:
    """Return the axes of a camera that looks along `azimuth` and `elevation` [rad].

    The rows of the result (3, 3) are the right, the up and the backward direction of the camera. The rows of `upright` (3, 3) are the
    directions of azimuth 0 and azimuth 90 degrees, and the upward direction. As in the viewer of MuJoCo, a camera with a negative elevation
    looks down, and the horizon is horizontal.
    """
    c, s = math.cos(elevation), math.sin(elevation)
    forward = np.array([c * math.cos(azimuth), c * math.sin(azimuth), s]) @ upright
    up = np.array([-s * math.cos(azimuth), -s * math.sin(azimuth), c]) @ upright
    return np.array([np.cross(forward, up), up, -forward])


def upright(gravity: Array) -> Array:
    """Return the directions to which azimuths and elevations refer, as rows (3, 3).

    `gravity` (3,) is in the world frame. The floor of the world is the plane z = 0. For a floor, the directions are x, y and z. If the
    plane z = 0 is a wall, the camera looks straight at the wall at azimuth 0. If there is no gravity, z is the upward direction.
    """
    size = float(np.linalg.norm(gravity))
    up = -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    first = np.array([1.0, 0.0, 0.0]) if abs(up[2]) > 0.5 else np.array([0.0, 0.0, -1.0])
    first = first - (first @ up) * up
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first), up])


def fit_camera(points: Array, axes: Array, angle: float, aspect: float, margin: float) -> Camera:
    """Return the camera that is as near as possible and sees all points (n, 3). The axes of the camera and its vertical field of view [rad]
    are given.

    `margin` is the width of the free border, as a fraction of half of the picture. In one direction of the picture, the points reach both
    borders. In the other direction, the points are centred.

    Let (x, y, z) be a point along the camera axes, (X, Y, Z) the position of the camera, and t the tangent of half of the angle. The point
    is to the right of the left edge if x - X >= -t (Z - z), and to the left of the right edge if x - X <= t (Z - z). It follows that t Z +
    X >= max(x + t z) = A and t Z - X >= max(t z - x) = B. The smallest Z is (A + B) / 2t. The upper and the lower edge give the same
    conditions for y.
    """
    tangent = math.tan(angle / 2.0) * (1.0 - margin)
    x, y, z = axes @ points.T
    centre, distance = [], []
    for coordinates, t in ((x, tangent * aspect), (y, tangent)):
        A, B = float(np.max(coordinates + t * z)), float(np.max(t * z - coordinates))
        centre.append((A - B) / 2.0)
        distance.append((A + B) / (2.0 * t))
    position = np.array([*centre, max(distance)])
    near = NEAR_FRACTION * float(position[2] - np.max(z))
    return Camera(position=position @ axes, axes=axes, tangent=math.tan(angle / 2.0), aspect=aspect, near=near)



class Quality(FrozenStruct):
    """The quality of shadows: the numbers of lamps that approximate the soft box and the dome of the studio, and the size of a lamp's
    shadow map [px]. Each lamp takes about 50 ms at 1280 x 960 pixels without a graphics card.
    """

    lamps: tuple[int, int]
    shadow: int


FINE, COARSE = Quality(lamps=(32, 36), shadow=2048), Quality(lamps=(8, 8), shadow=1024)

KEY_ANGLE = math.radians(9.0)
"""Radius of the soft box, as an angle seen from the robot."""

KEY_AZIMUTH, KEY_ELEVATION = math.radians(-48.0), math.radians(50.0)
"""Direction of the soft box as seen from the camera. The soft box is behind the camera, to the left, and above the floor."""

KEY_SHARE = 0.52
"""Fraction of the light on the floor that comes from the soft box."""

BOUNCE = 0.2
"""Brightness of the light that the floor reflects onto the robot, relative to the brightness of a lamp."""

FLOOR = 0.78
"""Brightness of the lit floor in the picture (linear, 1 is white)."""

VIGNETTE = 0.16
"""Strength of the darkening in the corners of the picture."""

HORIZON = 0.15
"""Height of the lower edge of the dome, as the sine of its elevation angle."""

GLOSS = 0.4
"""Fraction of a lamp's light that a material's `specular` reflects."""

GAMMA = 2.2
"""Gamma value with which the colours in models are encoded."""

BEYOND = 0.5
"""Brightness of the background beyond the edge of the floor, when a single lamp is on."""

BACKDROP = "backdrop"
GLASS_DEPTH, GLASS_OPACITY = 0.5e-3, 0.4
"""Depth [m] below the floor at which parts of a robot make the floor transparent, and the opacity of a transparent floor."""


def model_of(xml: str, assets: dict[str, bytes], size: tuple[int, int], lowest: float, quality: Quality) -> Any:
    """Compile a model with the floor, lights and background of the render studio (an `mujoco.MjModel`).

    The studio has two lamps, and the floor of the scene at z = 0. The floor is transparent if the lowest point of the robot, `lowest` [m],
    is below the floor.
    """
    spec = mujoco.MjSpec.from_string(xml, assets=assets)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    spec.visual.quality.shadowsize, spec.visual.quality.offsamples = quality.shadow, 0
    spec.visual.headlight.active = 0
    spec.visual.map.shadowclip = 1.0
    spec.add_texture(
        name=BACKDROP, type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT, rgb1=[BEYOND] * 3,
        rgb2=[BEYOND] * 3, width=8, height=8,
    )
    spec.add_material(name=BACKDROP, rgba=[1.0, 1.0, 1.0, 1.0 if lowest > -GLASS_DEPTH else GLASS_OPACITY], specular=0.0, shininess=0.0)
    spec.worldbody.add_geom(
        name=BACKDROP, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05], material=BACKDROP,
        contype=0, conaffinity=0,
    )
    for down in (-1.0, 1.0):
        spec.worldbody.add_light(type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[0.0, 0.0, down], castshadow=down < 0.0)
    return spec.compile()


def lamps(camera: Camera, normal: Array, counts: tuple[int, int]) -> list[tuple[Array, float]]:
    """Return the light direction (3,) and the weight of each lamp.

    All lamps together illuminate a floor with the normal vector `normal` with the brightness 1.

    `counts` contains the numbers of lamps in the soft box and in the dome.
    """
    key, dome = counts
    side = camera.axes[0] - (camera.axes[0] @ normal) * normal
    side /= np.linalg.norm(side)
    frame = np.array([side, np.cross(normal, side), normal])  # right, away from the camera, up
    azimuth = KEY_AZIMUTH - math.pi / 2.0
    middle = np.array([
        math.cos(KEY_ELEVATION) * math.cos(azimuth), math.cos(KEY_ELEVATION) * math.sin(azimuth), math.sin(KEY_ELEVATION),
    ]) @ frame
    sideways = np.cross(middle, normal)
    sideways /= np.linalg.norm(sideways)
    box = np.array([sideways, np.cross(sideways, middle), middle])
    weighted: list[tuple[Array, float]] = []
    for number in range(key):
        radius, turn = math.sqrt((number + 0.5) / key) * math.tan(KEY_ANGLE), _golden_angle(number)
        direction = np.array([radius * math.cos(turn), radius * math.sin(turn), 1.0]) @ box
        weighted.append((direction / np.linalg.norm(direction), KEY_SHARE))
    for number in range(dome):
        height, turn = HORIZON + (1.0 - HORIZON) * (number + 0.5) / dome, _golden_angle(number)
        horizontal = math.sqrt(1.0 - height * height)
        weighted.append((np.array([horizontal * math.cos(turn), horizontal * math.sin(turn), height]) @ frame, 1.0 - KEY_SHARE))
    floor_light = {share: sum_of(float(toward @ normal) for toward, weight in weighted if weight == share) for _, share in weighted}
    return [(-toward, share / floor_light[share]) for toward, share in weighted]


def _golden_angle(number: int) -> float:
    """Return the angle [rad] of a seed in a sunflower head (Vogel, 1979). Such angles distribute lamps evenly."""
    return number * math.pi * (3.0 - math.sqrt(5.0))


def render(
    model: Any, data: Any, camera: Camera, size: tuple[int, int], centre: Array, extent: float, quality: Quality,
) -> NDArray[np.uint8]:
    """Render the state `data` of a model in studio light, as an array (height, width, 3).

    Shadows are computed up to the distance `extent` [m] from `centre` (3,).
    """
    width, height = size
    normal = np.array([0.0, 0.0, 1.0])
    model.stat.extent, model.stat.center[:] = extent, centre
    model.mat_rgba[:, :3] **= GAMMA
    plain = model.geom_matid < 0  # for other geoms MuJoCo uses the material's colour, unless the geom's colour is changed
    model.geom_rgba[plain, :3] **= GAMMA
    options = mujoco.MjvOption()
    options.sitegroup[:] = 0
    total = np.zeros((height, width, 3), dtype=np.float32)
    with mujoco.Renderer(model, height, width, max_geom=model.ngeom + 100) as renderer:
        renderer.update_scene(data, scene_option=options)
        scene = renderer.scene
        for flag in (mujoco.mjtRndFlag.mjRND_REFLECTION, mujoco.mjtRndFlag.mjRND_HAZE, mujoco.mjtRndFlag.mjRND_FOG):
            scene.flags[flag] = 0
        buffer = np.empty((height, width, 3), dtype=np.uint8)
        for number, (direction, weight) in enumerate(lamps(camera, normal, quality.lamps)):
            _light(scene, direction, normal, centre, extent)
            _set_camera(scene, camera, number, size)
            total += np.float32(weight / 255.0) * renderer.render(out=buffer)
    return develop(total.astype(np.float64))


def develop(light: Array) -> NDArray[np.uint8]:
    """Convert light (height, width, 3) to an sRGB picture with darker corners and soft highlights. The light of the lit floor is 1."""
    height, width = light.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    corner = ((2.0 * (x + 0.5) / width - 1.0) ** 2 + (2.0 * (y + 0.5) / height - 1.0) ** 2) / 2.0
    shaded = light * FLOOR * (1.0 - VIGNETTE * corner)[..., None]
    knee = 0.8  # above this value, the brightness approaches white smoothly
    excess = np.maximum(shaded - knee, 0.0)
    shaded = np.minimum(shaded, knee) + (1.0 - knee) * (1.0 - np.exp(-excess / (1.0 - knee)))
    encoded = np.where(shaded <= 0.0031308, 12.92 * shaded, 1.055 * np.maximum(shaded, 0.0031308) ** (1.0 / 2.4) - 0.055)
    image: NDArray[np.uint8] = np.rint(255.0 * np.clip(encoded, 0.0, 1.0)).astype(np.uint8)
    return image


def _light(scene: Any, direction: Array, normal: Array, centre: Array, extent: float) -> None:
    for light, to, strength in ((scene.lights[0], direction, 1.0), (scene.lights[1], normal, BOUNCE)):
        light.dir[:], light.pos[:] = to, centre - extent * to
        light.ambient[:], light.diffuse[:], light.specular[:] = 0.0, strength, GLOSS * strength


def _set_camera(scene: Any, camera: Camera, number: int, size: tuple[int, int]) -> None:
    """Set the camera of a MuJoCo scene. For each picture, the camera is shifted by a different fraction of a pixel (R2 sequence)."""
    x, y = (0.5 + 0.7548776662466927 * number) % 1.0 - 0.5, (0.5 + 0.5698402909980532 * number) % 1.0 - 0.5
    half = camera.near * camera.tangent
    pixel = 2.0 * half / size[1]
    for view in (scene.camera[0], scene.camera[1]):
        view.pos[:], view.forward[:], view.up[:] = camera.position, -camera.axes[2], camera.axes[1]
        view.frustum_center = x * pixel
        view.frustum_bottom, view.frustum_top = -half + y * pixel, half + y * pixel
        view.frustum_width = half * camera.aspect
        view.frustum_near, view.frustum_far = camera.near, 1000.0 * camera.near
        view.orthographic = 0
