"""Record an animation of MInchW in a tunnel. The camera follows the robot. The root of the model is orange, and a bar shows the pull
margin.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

WIDTH, HEIGHT = 520, 420
ROOT, HOLDING, LOOSE, BRACKET = (0.95, 0.42, 0.08, 1.0), (0.98, 0.75, 0.45, 1.0), (0.60, 0.62, 0.66, 1.0), (0.82, 0.81, 0.79, 1.0)
"""Colours [rgba] of the foot that is the root, of other active magnets, of inactive magnets, and of other feet."""

STEEL, LINE = [0.66, 0.70, 0.76, 1], [0.45, 0.49, 0.55, 1]
NEAR, FAR, THICK, OPEN = -0.08, 0.16, 0.012, -0.45
"""The plates extend from y = `NEAR` to y = `FAR` [m] and begin at x = `OPEN` [m]. The plates are `THICK` [m] thick."""

FULL = 300.0
"""Pull margin [N] at which the bar of the film is full."""


def decorate_tunnel(spec: mujoco.MjSpec, length: float, height: float) -> None:
    """Add steel plates with a line every 100 mm: a floor, a wall at x = `length` [m] and a ceiling at z = `height` [m]. Also add a light to
    the model.
    """
    look = {"contype": 0, "conaffinity": 0, "group": 2, "type": mujoco.mjtGeom.mjGEOM_BOX}
    y, half = (NEAR + FAR) / 2, (FAR - NEAR) / 2
    along, t = (length - OPEN) / 2 + THICK, THICK / 2
    for name, z in (("floor", -t), ("ceiling", height + t)):
        spec.worldbody.add_geom(
            name=f"plate_{name}", size=[along, half, t - 5e-4], pos=[OPEN + along, y, z], rgba=STEEL, **look
        )
        for k in range(int((length - OPEN) / 0.1) + 1):
            spec.worldbody.add_geom(name=f"{name}_{k}", size=[0.001, half, t], pos=[length - 0.1 * k - 1e-3, y, z], rgba=LINE, **look)
    spec.worldbody.add_geom(
        name="plate_wall", size=[t - 5e-4, half, height / 2], pos=[length + t, y, height / 2], rgba=[0.60, 0.63, 0.69, 1], **look
    )
    for k in range(1, int(height / 0.1) + 1):
        spec.worldbody.add_geom(name=f"wall_{k}", size=[t, half, 0.001], pos=[length + t, y, 0.1 * k], rgba=LINE, **look)
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT, width=16, height=16,
        rgb1=[0.95, 0.96, 0.97], rgb2=[0.95, 0.96, 0.97],
    )
    spec.worldbody.add_light(  # from the open side, where no plate blocks the light
        name="sun", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=[length - 1.0, -2.0, height / 2 + 0.6], dir=[0.35, 0.9, -0.22],
        diffuse=[0.34] * 3, specular=[0.1] * 3,
    )
    spec.visual.headlight.ambient[:], spec.visual.headlight.diffuse[:] = 0.45, 0.24
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 2 * WIDTH, 2 * HEIGHT
    spec.visual.quality.shadowsize = 4096


class FollowingFilm:
    """Records frames of a climbing robot at a fixed interval of simulated time [s]. An instance is a callback that runs after every
    simulation step.
    """

    def __init__(self, every: float) -> None:
        self.every = every
        self.frames: list[Image.Image] = []
        self.renderers: dict[int, mujoco.Renderer] = {}
        self.least, self.ever = np.inf, np.inf
        self.at: np.ndarray | None = None

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData, margin: float) -> None:
        """Record a frame if `every` [s] of simulated time has passed since the last frame. The bar shows the smallest margin since the last
        frame, and a mark shows the smallest margin so far.
        """
        self.least, self.ever = min(self.least, margin), min(self.ever, margin)
        if data.time < len(self.frames) * self.every:
            return
        picture, root = self.picture(model, data)
        down = data.site(f"{root}/sole").xmat.reshape(3, 3)[:, 2]
        on = "floor" if down[2] < -0.5 else "ceiling" if down[2] > 0.5 else "wall"
        self.frames.append(self._labelled(picture, f"root: {root} foot, on the {on}"))
        self.least = np.inf

    def picture(self, model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Image.Image, str]:
        """Return a picture of the robot with coloured feet, and the name of the foot that is the root."""
        root = next(foot for foot in ("front", "rear") if model.body(f"{foot}/foot").mocapid[0] >= 0)
        if id(model) not in self.renderers:
            self.renderers[id(model)] = mujoco.Renderer(model, 2 * HEIGHT, 2 * WIDTH)
        for foot in ("front", "rear"):
            holds = data.actuator(f"{foot}/sole").ctrl[0] > 0.0
            for part, colour in (
                ("magnet", ROOT if foot == root else HOLDING if holds else LOOSE), ("foot", ROOT if foot == root else BRACKET)
            ):
                model.geom(f"{foot}/{part}").matid[:] = -1
                model.geom(f"{foot}/{part}").rgba[:] = colour
        renderer = self.renderers[id(model)]
        options = mujoco.MjvOption()
        options.sitegroup[:] = 0
        options.geomgroup[:] = [0, 0, 1, 0, 0, 0]
        renderer.update_scene(data, self.camera(data), options)
        return Image.fromarray(renderer.render()).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS), root

    def close(self) -> None:
        """Close the MuJoCo renderers."""
        for renderer in self.renderers.values():
            renderer.close()

    def save(self, path: Path, milliseconds: int, quality: int = 55) -> None:
        """Save the frames as a looping animated WebP."""
        path.parent.mkdir(parents=True, exist_ok=True)
        first, *rest = self.frames
        first.save(path, save_all=True, append_images=rest, duration=milliseconds, loop=0, quality=quality, method=4)

    def camera(self, data: mujoco.MjData) -> mujoco.MjvCamera:
        """Return a camera on the open side of the tunnel, which smoothly follows the midpoint of the robot."""
        middle = np.array(data.subtree_com[0])
        self.at = middle if self.at is None else self.at + 0.12 * (middle - self.at)
        camera = mujoco.MjvCamera()
        camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = self.at, 0.98, 70.0, -8.0
        return camera

    def _labelled(self, picture: Image.Image, root: str) -> Image.Image:
        draw, font = ImageDraw.Draw(picture), ImageFont.load_default(15)
        ink, rim, x, y, wide, high = (40, 42, 48), (150, 152, 158), 150, HEIGHT - 26, WIDTH - 250, 12
        draw.rectangle((0, 0, WIDTH, 36), fill=(250, 250, 251))
        draw.rectangle((0, HEIGHT - 40, WIDTH, HEIGHT), fill=(250, 250, 251))
        draw.text((12, 10), root, fill=tuple(round(255 * 0.85 * c) for c in ROOT[:3]), font=font)
        draw.text((12, y - 4), "pull margin", fill=ink, font=font)
        draw.text((x + wide + 12, y - 4), f"{self.least:.0f} N", fill=ink, font=font)
        draw.rectangle((x, y, x + wide, y + high), fill=(228, 230, 234), outline=rim)
        part = float(np.clip(self.least / FULL, 0.0, 1.0))
        fill = (round(210 - 170 * part), round(70 + 90 * part), 70)  # red to green
        draw.rectangle((x + 1, y + 1, x + 1 + round(part * (wide - 2)), y + high - 1), fill=fill)
        mark = x + 1 + round(float(np.clip(self.ever / FULL, 0.0, 1.0)) * (wide - 2))
        draw.line((mark, y - 3, mark, y + high + 3), fill=ink, width=2)
        return picture
