"""Write the files that show the robot in RViz: `launch/display.launch.py` and `config/display.rviz`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib import resources

from thingc.model.robot.types import Robot
from thingc.targets.name_mangling import package_name, safe
from thingc.targets.ros.control import BROADCASTER, Controller
from thingc.targets.ros.joints import values
from thingc.targets.urdf.links import WORLD


def launch_file(robots: Sequence[Robot], by_mode: Mapping[str, Sequence[Controller]], heading: str) -> str:
    """Return the text of `display.launch.py`, the Python launch file for `ros2 launch`."""
    modes = "".join(_launch_entry(robot, [controller.name for controller in by_mode[robot.mode.name]]) for robot in robots)
    name = robots[0].assembly.name
    return _fill("display.launch", HEADING=heading, PACKAGE=package_name(name), ROBOT=name, MODES=modes, BROADCASTER=BROADCASTER)


def rviz_config(robot: Robot, heading: str) -> str:
    """Return the text of `display.rviz`, an RViz configuration that shows the robot on a grid, with its frames.

    The fixed frame is that of the mode of `robot`, unless RViz is started with the option `-f`.
    """
    return _fill("display.rviz", HEADING=heading, FRAME=_fixed_frame(robot))


def _fixed_frame(robot: Robot) -> str:
    """Return the fixed frame of RViz for a mode. The fixed frame is the root link of the URDF."""
    return safe(robot.assembly.links[robot.bodies[0].link].name) if robot.base == "free" else WORLD


def _fill(file: str, **words: str) -> str:
    """Return the text of a template file in which each `@WORD@` is replaced.

    All words are replaced in one pass, because the inserted strings may also contain such words.
    """
    template = (resources.files("thingc.targets.ros") / f"{file}.template").read_text(encoding="utf-8")
    return re.sub("@([A-Z]+)@", lambda word: words[word[1]], template)


def _launch_entry(robot: Robot, names: list[str]) -> str:
    """Return the entry of a mode in the launch file. The entry contains the fixed frame, the start values of joints [rad or m], and the
    controllers.
    """
    joints = "".join(f'            "{name}": {value + 0.0},\n' for name, value in values(robot, robot.start.q).items())
    start_values = f"{{\n{joints}        }}" if joints else "{}"
    quoted_names = ", ".join(f'"{name}"' for name in names)
    return f"""\
    "{robot.mode.name}": {{
        "frame": "{_fixed_frame(robot)}",
        "start": {start_values},
        "controllers": [{quoted_names}],
    }},
"""
