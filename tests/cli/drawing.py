"""Run as a separate process, because MuJoCo selects its renderer at import: `drawing.py JOBS.json`.

Each job is a model, a pose and a shot. Its results are the picture that thingc renders with very few lamps, and MuJoCo's own
segmentation of the robot, from a camera fixed in the model at the pose of thingc's camera."""

from __future__ import annotations

import functools
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from thingc.targets.render.picture import Shot, picture, ready

ready()

import mujoco

from thingc.targets.render import studio
from thingc.targets.render.picture import camera_of, points_of, pose_model

LAMPS = studio.lamps


def few(count: int, camera: Any, normal: Any, counts: tuple[int, int]) -> Any:
    """Return fewer lamps than a picture normally has."""
    return LAMPS(camera, normal, (count, count))


def segmented(xml: str, assets: dict[str, bytes], job: dict[str, Any], shot: Shot) -> np.ndarray:
    """Return the mask (height, width) of the pixels that show the robot."""
    bare = mujoco.MjModel.from_xml_string(xml, assets)
    camera = camera_of(points_of(bare, pose_model(bare, job["pose"])), tuple(job["gravity"]), shot)
    spec = mujoco.MjSpec.from_string(xml, assets=assets)
    width, height = shot.size
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, camera.axes.T.flatten())
    spec.worldbody.add_camera(
        name="eye", pos=camera.position, quat=quaternion, fovy=math.degrees(2 * math.atan(camera.tangent)),
    )
    model = spec.compile()
    data = pose_model(model, job["pose"])
    options = mujoco.MjvOption()
    options.sitegroup[:] = 0
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, camera="eye", scene_option=options)
        found: np.ndarray = renderer.render()[:, :, 0] >= 0
    return found


def main() -> None:
    """Run all jobs of the file; pictures and masks are written next to it."""
    jobs = Path(sys.argv[1])
    for job in json.loads(jobs.read_text()):
        studio.lamps = functools.partial(few, job.get("lamps", 1))
        xml = Path(job["xml"]).read_text()
        assets = {path.name: path.read_bytes() for path in Path(job["assets"]).iterdir()}
        shot = Shot(size=tuple(job["size"]), azimuth=job.get("azimuth"), elevation=job.get("elevation"))
        png = picture(xml, assets, pose=job["pose"], gravity=tuple(job["gravity"]), shot=shot)
        (jobs.parent / f"{job['name']}.png").write_bytes(png)
        np.save(jobs.parent / f"{job['name']}.npy", segmented(xml, assets, job, shot))


if __name__ == "__main__":
    main()
