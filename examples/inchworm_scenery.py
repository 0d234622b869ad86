"""Create the scenery of films, a steel beam on a floor, on a wall or under a ceiling, and record animations of a robot on the beam."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image, ImageDraw

HEIGHT = 300
WIDTHS = {"floor": 280, "wall": 200, "ceiling": 280}
COLORS = 64
HOLDING, LOOSE = (0.93, 0.42, 0.13, 1.0), (0.72, 0.74, 0.78, 1.0)
"""Colours [rgba] of a magnet that is switched on, and of a magnet that is switched off."""


def decorate(spec: mujoco.MjSpec, place: str) -> None:
    """Add a beam under the plane z = 0, its support, a light and the camera `aside`. The vertical direction is z on the floor, x on a wall,
    and -z under a ceiling.
    """
    world = spec.worldbody
    wall = place == "wall"
    look = {"contype": 0, "conaffinity": 0, "group": 2}
    for name, z, thick, half in (("flange", -0.005, 0.005, 0.05), ("web", -0.05, 0.04, 0.004), ("base", -0.095, 0.005, 0.05)):
        world.add_geom(
            name=f"beam_{name}", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.48, half, thick], pos=[0.3, 0, z - 0.0005],
            rgba=[0.42, 0.47, 0.53, 1], **look,
        )
    for k in range(10):
        world.add_geom(
            name=f"mark_{k}", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.001, 0.05, 0.0002], pos=[-0.15 + 0.1 * k, 0, -0.0004],
            rgba=[0.2, 0.23, 0.28, 1], **look,
        )
    ground = {"size": [0.002, 3, 3], "pos": [-0.182, 0, 0]} if wall else {"size": [3, 3, 0.002], "pos": [0.3, 0, -0.103]}
    world.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_BOX, rgba=[0.80, 0.81, 0.82, 1], **ground, **look)
    if wall:
        world.add_geom(
            name="wall", type=mujoco.mjtGeom.mjGEOM_BOX, size=[3, 3, 0.002], pos=[2.8, 0, -0.103], rgba=[0.88, 0.86, 0.82, 1], **look
        )
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT, width=16, height=16,
        rgb1=[0.94, 0.95, 0.97], rgb2=[0.94, 0.95, 0.97],
    )
    up = {"floor": np.array([0.0, 0, 1]), "wall": np.array([1.0, 0, 0]), "ceiling": np.array([0.0, 0, -1])}[place]
    # If the beam is not below the robot, the light comes from the side of the beam.
    out = np.array([0, 0, {"floor": 0.0, "wall": 1.0, "ceiling": 4.0}[place]])
    world.add_light(
        name="sun", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=2 * up + out, dir=-up - 0.6 * out + np.array([0, 0.35, 0]),
        diffuse=[0.55] * 3, specular=[0.1] * 3,
    )
    spec.visual.headlight.ambient[:], spec.visual.headlight.diffuse[:] = 0.4, 0.3
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 2 * max(WIDTHS.values()), 2 * HEIGHT
    spec.visual.quality.shadowsize = 4096
    to = np.array([0.28, 0, 0.0]) if wall else np.array([0.3, 0, 0.03])
    at = to + (np.array([0.2, -1.2, 1.15]) if wall else np.array([-0.3, -1.5, 0.5]))
    back = (at - to) / np.linalg.norm(at - to)
    right = np.cross(up, back) / np.linalg.norm(np.cross(up, back))
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.column_stack([right, np.cross(back, right), back]).flatten())
    world.add_camera(name="aside", pos=at, quat=quaternion, fovy=32.0)


class Film:
    """Records frames of a walking robot at a fixed interval of simulated time. An instance is a callback that runs after every simulation
    step.
    """

    def __init__(self, where: str, every: float) -> None:
        self.where, self.every = where, every
        self.frames: list[Image.Image] = []
        self.renderers: dict[int, mujoco.Renderer] = {}

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData, margin: float) -> None:
        """Record a frame if `every` [s] of simulated time has passed since the last frame."""
        if data.time < len(self.frames) * self.every:
            return
        if id(model) not in self.renderers:
            self.renderers[id(model)] = mujoco.Renderer(model, 2 * HEIGHT, 2 * WIDTHS[self.where])
        for foot in ("front", "rear"):
            magnet = model.geom(f"{foot}/magnet")
            magnet.matid[:] = -1
            magnet.rgba[:] = HOLDING if data.actuator(f"{foot}/sole").ctrl[0] > 0.0 else LOOSE
        options = mujoco.MjvOption()
        options.sitegroup[:] = 0
        options.geomgroup[:] = [0, 0, 1, 0, 0, 0]
        renderer = self.renderers[id(model)]
        renderer.update_scene(data, "aside", options)
        picture = Image.fromarray(renderer.render())
        self.frames.append(picture.resize((WIDTHS[self.where], HEIGHT), Image.Resampling.LANCZOS))

    def close(self) -> None:
        """Close the MuJoCo renderers."""
        for renderer in self.renderers.values():
            renderer.close()


def save(films: list[Film], path: Path, milliseconds: int) -> None:
    """Save the films side by side as a looping GIF. All frames share one palette, so that static areas are compressed well."""
    width = sum(WIDTHS[film.where] for film in films)
    whole = []
    for pictures in zip(*(film.frames for film in films), strict=True):
        frame, x = Image.new("RGB", (width, HEIGHT)), 0
        for film, picture in zip(films, pictures, strict=True):
            frame.paste(picture, (x, 0))
            ImageDraw.Draw(frame).text((x + 8, 6), film.where, fill=(60, 60, 66))
            x += WIDTHS[film.where]
        whole.append(frame)
    strip = Image.new("RGB", (width, 4 * HEIGHT + 40), tuple(round(255 * c) for c in HOLDING[:3]))  # a rare colour to preserve
    for k in range(4):
        strip.paste(whole[k * (len(whole) - 1) // 3], (0, k * HEIGHT))
    palette = strip.quantize(COLORS, method=Image.Quantize.MEDIANCUT)
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in whole]
    path.parent.mkdir(parents=True, exist_ok=True)
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=milliseconds, loop=0, optimize=False)
