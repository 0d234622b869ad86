"""Read URDF with yourdfpy, and compute kinematics, including mimics: `python ask_yourdfpy.py REQUESTS ANSWERS`."""

from __future__ import annotations

import sys
from importlib.metadata import version

import yourdfpy


def answer(asked):
    robot = yourdfpy.URDF.load(asked["file"])
    if not robot.validate():
        raise ValueError("; ".join(map(str, robot.errors)))
    leading = [asked["joints"].index(name) for name in robot.actuated_joint_names]
    poses = []
    for values in asked["q"]:
        robot.update_cfg([values[k] for k in leading])
        poses.append([robot.get_transform(name).tolist() for name in asked["frames"]])
    limits = [robot.joint_map[name].limit if robot.joint_map[name].type != "continuous" else None for name in asked["joints"]]
    mass = sum(link.inertial.mass for link in robot.robot.links if link.inertial is not None)
    follows = [robot.joint_map[name].mimic for name in asked["joints"]]
    mimics = [None if one is None else [one.joint, one.multiplier, one.offset] for one in follows]
    efforts = [robot.joint_map[name].limit.effort for name in asked["joints"]]
    ranges = [None if one is None else [one.lower, one.upper] for one in limits]
    return {"frames": poses, "mass": mass, "mimic": mimics, "effort": efforts, "range": ranges}


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("yourdfpy"), sys.argv)
