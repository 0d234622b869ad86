"""`scene_<mode>.xml`: the robot on a floor under a light, as the scenes of the MuJoCo Menagerie are made."""

from __future__ import annotations

import math

from thingc.emit.mjcf_xml import Element, number, numbers
from thingc.pose import NO_POSE, Pose, Vector
from thingc.robot.types import Robot

FLOOR = "floor"


def scene(robot: Robot, model: Element, file: str) -> Element:
    """The scene of a mode around `file`, which lies beside it; `model` is what that file holds.

    What is stated before the `include` a raw attribute may override. The floor is z = 0 of the world, where a mode's root
    is mated, so on a wall or a ceiling the plane is that wall or ceiling.
    """
    root = Element(tag="mujoco", attributes={"model": f"{robot.assembly.name}_{robot.mode.name} scene"}, origin=robot.mode.origin)
    box = bounds(robot)
    if box is not None:
        low, high = box
        centre = [round((low[k] + high[k]) / 2.0, 3) for k in range(3)]
        extent = float(f"{max(math.dist(low, high), 1e-3):.3g}")
        root.add("statistic", {"center": numbers(centre), "extent": number(extent)})
    visual = root.add("visual")
    visual.add("headlight", {"diffuse": "0.6 0.6 0.6", "ambient": "0.3 0.3 0.3", "specular": "0 0 0"})
    visual.add("rgba", {"haze": "0.15 0.25 0.35 1"})
    visual.add("global", {"azimuth": "120", "elevation": "-20", "offwidth": "1920", "offheight": "1080"})
    root.add("include", {"file": file})
    asset = root.add("asset")
    asset.add("texture", {
        "type": "skybox", "builtin": "gradient", "rgb1": "0.3 0.5 0.7", "rgb2": "0 0 0", "width": "128", "height": "768",
    })
    asset.add("texture", {
        "type": "2d", "name": "groundplane", "builtin": "checker", "mark": "edge", "rgb1": "0.2 0.3 0.4", "rgb2": "0.1 0.2 0.3",
        "markrgb": "0.8 0.8 0.8", "width": "300", "height": "300",
    })
    asset.add("material", {
        "name": "groundplane", "texture": "groundplane", "texuniform": "true", "texrepeat": "5 5", "reflectance": "0.2",
    })
    world = root.add("worldbody")
    world.add("light", {"pos": "0 0 1.5", "dir": "0 0 -1", "directional": "true"})
    world.add("geom", {"name": floor_name(model), "size": "0 0 0.05", "type": "plane", "material": "groundplane"})
    return root


def floor_name(model: Element) -> str:
    """`floor`, unless a component has the name: then `scene:floor`, which none can have."""
    taken = any(element.tag == "geom" and element.attributes.get("name") == FLOOR for element in model.walk())
    return f"scene:{FLOOR}" if taken else FLOOR


def bounds(robot: Robot) -> tuple[Vector, Vector] | None:
    """The box [m] around the robot in the world at q = 0, from its parts' boxes; None without geometry."""
    low, high = [math.inf] * 3, [-math.inf] * 3
    poses: list[Pose] = []
    for body in robot.bodies:
        at = (NO_POSE if body.parent is None else poses[body.parent]) @ body.X_PL
        poses.append(at)
        link = robot.assembly.links[body.link]
        for member, pose in zip(link.members, link.poses, strict=True):
            record = robot.assembly.occurrences[member].record
            if record is None or record.box is None:
                continue
            placed = at @ pose
            for corner in range(8):
                x, y, z = (record.box[corner >> k & 1][k] for k in range(3))
                point = placed.apply((x, y, z))
                low = [min(a, b) for a, b in zip(low, point, strict=True)]
                high = [max(a, b) for a, b in zip(high, point, strict=True)]
    if low[0] > high[0]:
        return None
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
