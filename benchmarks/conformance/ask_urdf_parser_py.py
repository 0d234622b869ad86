"""Parse URDF with urdf_parser_py, which Python tools of ROS use: `python ask_urdf_parser_py.py REQUESTS ANSWERS`. The package does not
compute kinematics.
"""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path

from urdf_parser_py.urdf import URDF
from urdf_parser_py.xml_reflection import core

KNOWN = ("mujoco", "ros2_control")
"""Tags of other programs that the files contain on purpose, and that urdf_parser_py does not recognise."""


def answer(asked):
    messages = []
    core.on_error = messages.append
    robot = URDF.from_xml_string(Path(asked["file"]).read_bytes())
    messages = [one for one in messages if not any(one.startswith(f'Unknown tag "{tag}" ') for tag in KNOWN)]
    missing = sorted(set(asked["frames"]) - robot.link_map.keys())
    if messages or missing:
        raise ValueError("; ".join([*messages, *(f"no link {name}" for name in missing)]))
    joints = [robot.joint_map[name] for name in asked["joints"]]
    if not joints:
        return {}
    return {
        "mass": sum(link.inertial.mass for link in robot.links if link.inertial is not None),
        "effort": [one.limit.effort for one in joints],
        "range": [[one.limit.lower, one.limit.upper] if one.type != "continuous" else None for one in joints],
        "mimic": [
            None if one.mimic is None else [one.mimic.joint, one.mimic.multiplier, one.mimic.offset] for one in joints
        ],
    }


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("urdf_parser_py"), sys.argv)
