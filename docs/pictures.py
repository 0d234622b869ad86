"""`make pictures`: the pictures that the README shows, rendered headless from what thingc builds."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # before mujoco is imported, which chooses its renderer then

import mujoco
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
PICTURES = ROOT / "docs" / "pictures"
WIDTH, HEIGHT = 640, 480


def render(
    scene: Path, pose: str, look_at: tuple[float, float, float], distance: float, azimuth: float, elevation: float
) -> Image.Image:
    """A scene in one of its keyframes, seen by a free camera (metres, degrees)."""
    model = mujoco.MjModel.from_xml_path(str(scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = look_at
    camera.distance, camera.azimuth, camera.elevation = distance, azimuth, elevation
    options = mujoco.MjvOption()
    options.sitegroup[:] = 0
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera, options)
        return Image.fromarray(renderer.render())


def main() -> int:
    """Build the arm and draw each mode; one picture with the three side by side."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "thingc", "build", "assemblies/arm.yaml", "-o", folder], cwd=ROOT, check=True)
        mjcf = Path(folder) / "arm" / "mjcf"
        pictures = [
            render(mjcf / "scene_bench.xml", "home", (0.08, 0.05, 0.06), 0.55, 150.0, -20.0),
            render(mjcf / "scene_drawing.xml", "writing", (0.08, 0.0, 0.06), 0.62, 120.0, -15.0),
            render(mjcf / "scene_adrift.xml", "stretched", (0.1, 0.0, 0.33), 0.75, 120.0, -15.0),
        ]
        whole = Image.new("RGB", (WIDTH * len(pictures), HEIGHT))
        for index, picture in enumerate(pictures):
            whole.paste(picture, (index * WIDTH, 0))
        whole.save(PICTURES / "arm_modes.png", optimize=True)
        shutil.copy(Path(folder) / "arm" / "hag.svg", PICTURES / "arm_hag.svg")
    return 0


if __name__ == "__main__":
    sys.exit(main())
