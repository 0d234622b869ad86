"""Implementation of `thingc render`, which renders a picture of a robot in a mode and a pose, without a display.

The robot fills the picture. The floor is the plane z = 0 of the world, shown as a wall if gravity in the mode is parallel to it.
MuJoCo draws the picture with EGL, which requires neither a screen nor a graphics card.

  thingc render assemblies/arm.yaml                                   first mode in its start pose: arm_bench_home.png
  thingc render assemblies/arm.yaml --mode drawing --pose writing -o writing.png
  thingc render assemblies/arm.yaml --position 'elbow=90 deg'         with the elbow in another position than in the pose
  thingc render assemblies/arm.yaml --joints --root                   with joint axes, and the frame of the root
  thingc render assemblies/arm.yaml --mounts-of hand                  with the mounts of the hand: x red, y green, z blue
  thingc render assemblies/arm.yaml --azimuth 90 --elevation -10 --size 1920x1080
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report, shown_path
from thingc.base.filesystem import write_whole
from thingc.base.suggestions import did_you_mean
from thingc.base.units import ANGLE, LENGTH, UnitError, check_dimension, parse_quantity
from thingc.driver import pipeline
from thingc.driver.environment import Environment
from thingc.driver.pipeline import Compilation, UnknownChoice
from thingc.driver.testing.poses import pose_robot
from thingc.model.assembly.kinematics import joints_of
from thingc.model.robot.types import Robot
from thingc.targets.render.picture import Shot, picture, ready
from thingc.tools.cli import console

if TYPE_CHECKING:
    from thingc.model.assembly.types import Assembly, JointEdge
    from thingc.targets.render.frames import Mark


COLLISION = "1 0.3 0.1 0.4"
"""Colour of collision shapes, as red, green, blue and opacity."""

SHOT = Shot()
"""Default size and view of a picture."""

MOVED = "position"
"""Name of the pose that is shown with `--position`."""

LARGEST = 8192
"""Maximum width and height of a picture [px]."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc render` to the parser."""
    console.add_document(parser)
    add = parser.add_argument
    add("--mode", metavar="M", help="mode to show (default: the first mode)")
    add("--pose", metavar="P", help="pose to show (default: the pose of the mode)")
    add("--position", metavar="JOINT=POSITION", action="append", default=[], help="position of a joint in the picture (may be repeated)")
    add("-o", "--output", metavar="PNG", help="output file (default: NAME_MODE_POSE.png in the working folder)")
    add("--size", metavar="WxH", type=_size, default=SHOT.size, help="size in pixels (default: 1280x960)")
    add("--azimuth", metavar="DEG", type=_degrees(360.0), help="horizontal view direction (default: 140; 40 in a scene with a wall)")
    add("--elevation", metavar="DEG", type=_degrees(90.0), help="vertical view angle (default: -22; 16 in a scene with a ceiling)")
    add("--mounts", action="store_true", help="draw attached, exported and added mounts")
    add("--mounts-of", metavar="COMPONENT", action="append", default=[], help="draw all mounts of this component (may be repeated)")
    add("--joints", action="store_true", help="draw joint axes")
    add("--collision", action="store_true", help="draw collision shapes")
    add("--root", action="store_true", help="draw the root frame")
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc render`, and return the exit code, which is 0 if the picture was written. Diagnostics are printed to standard error."""
    check_output(arguments.output)
    process = partial(_render, arguments)
    diagnostics, _ = console.compile_document(arguments, process, arguments.mode, compat=())  # pictures need only MuJoCo
    return console.print_found(diagnostics, arguments.format, stream=sys.stderr, debug=arguments.debug)


def check_output(path: str | None) -> None:
    """Raise `WrongCommandLine` unless the path is a .png file in an existing folder."""
    if path is None:
        return
    if not path.lower().endswith(".png"):
        raise console.WrongCommandLine(f"-o: expected a .png file, found `{path}`", "write, for example, -o arm.png")
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder):
        raise console.WrongCommandLine(f"-o: there is no folder `{folder}`", "create the folder, or choose another folder", Code.OUTPUT)


def _render(arguments: argparse.Namespace, environment: Environment, compilation: Compilation, assembly: Assembly) -> None:
    """Render the picture, and write it to a file. Raises `UnknownChoice`, `NoGraphics` and `WrongCommandLine`."""
    robot = compilation.robots[0]
    pose = _pose(robot, arguments.pose, environment.document)
    if arguments.position:
        robot, pose = _robot_at(assembly, robot, pose, arguments.position, compilation.report), MOVED
    marks = _marks(robot, arguments, next((frame.q for frame in robot.keyframes if frame.name == pose), {}))
    named = "_".join(word for word in (robot.name, robot.mode.name, pose) if word is not None)
    shot = Shot(size=arguments.size, azimuth=arguments.azimuth, elevation=arguments.elevation)
    draw(environment, compilation, robot, pose, arguments.output or f"{named}.png", shot=shot, marks=marks, collision=arguments.collision)


def draw(
    environment: Environment, compilation: Compilation, robot: Robot, pose: str | None, path: str, *, shot: Shot = SHOT,
    marks: Sequence[Mark] = (), collision: bool = False,
) -> None:
    """Draw a robot in the keyframe `pose` to the PNG file `path`, unless its MuJoCo model has errors.

    If `collision` is True, the collision shapes are drawn over the parts. Raises `NoGraphics` and `WrongCommandLine`.
    """
    ready()
    artifacts = pipeline.build(environment, replace(compilation, robots=(robot,)), ["mjcf"])["mjcf"]
    if compilation.report.failed:
        return
    read = artifacts.contents(environment.store)
    prefix, assembly = "mjcf/assets/", robot.assembly
    model = read[f"mjcf/{robot.name}_{robot.mode.name}.xml"].decode()
    png = picture(
        with_collision(model) if collision else model,
        {path.removeprefix(prefix): data for path, data in read.items() if path.startswith(prefix)},
        pose=pose if assembly.names is None or pose is None else assembly.names.poses.get(pose, pose),
        gravity=robot.gravity, marks=marks, shot=shot,
    )
    with console.writing(path, "choose another file with -o"):
        write_whole(path, png)
    posed = f", pose {pose}" if pose is not None else ""
    console.say(f"{shown_path(os.path.abspath(path))}: mode {robot.mode.name}{posed}", stream=sys.stderr)


def with_collision(model: str) -> str:
    """Return the text of a MuJoCo model in which the collision shapes are visible and transparent."""
    root = ElementTree.fromstring(model)
    for geom in root.iterfind(".//default[@class='collision']/geom"):
        geom.attrib |= {"group": "1", "rgba": COLLISION}
    return ElementTree.tostring(root, encoding="unicode")


def _marks(robot: Robot, arguments: argparse.Namespace, q: Mapping[str, float]) -> list[Mark]:
    """Return the coordinate frames and joint axes to draw over the picture at the joint coordinates `q`.

    Duplicates are removed. Raises `UnknownChoice`.
    """
    if not (arguments.mounts or arguments.mounts_of or arguments.joints or arguments.root):
        return []
    from thingc.tools.cli import render_overlay

    marks = [
        *(render_overlay.root(robot) if arguments.root else ()), *(render_overlay.joints(robot, q) if arguments.joints else ()),
        *(render_overlay.mounts(robot, q) if arguments.mounts else ()), *render_overlay.mounts_of(robot, q, arguments.mounts_of),
    ]
    return list({(mark.label, mark.body, mark.pose, mark.ink): mark for mark in marks}.values())


def _pose(robot: Robot, requested: str | None, document: str) -> str | None:
    """Return the name of the keyframe to render, or None if the robot has no keyframes. Raises `UnknownChoice` for an unknown keyframe.

    A keyframe on the command line has precedence over the keyframe of the mode. The default is the first keyframe.
    """
    known = [frame.name for frame in robot.keyframes]
    if requested is None:
        return known[0] if known else None
    if requested not in known:
        message = f"mode `{robot.mode.name}` of `{shown_path(document)}` has no pose `{requested}`"
        raise UnknownChoice(message, did_you_mean(requested, known, what="poses"))
    return requested


def _robot_at(assembly: Assembly, robot: Robot, pose: str | None, settings: Sequence[str], report: Report) -> Robot:
    """Return a robot with the keyframe `MOVED`: the keyframe `pose`, with other positions of some joints, and with closed loops.

    Positions outside the limits of joints are warnings.

    Raises `WrongCommandLine` for an invalid position, and `UnknownChoice` for an unknown joint.
    """
    joints: dict[str, JointEdge] = {joint.name: joint for joint in joints_of(assembly)}
    form, values = "--position JOINT=POSITION", {}
    for name, text in console.paths(settings, form, "--position 'elbow=90 deg'", "--position sets `{}` twice").items():
        joint = joints.get(name)
        if joint is None:
            raise UnknownChoice(f"`{assembly.name}` has no joint `{name}`", did_you_mean(name, joints, what="joints"))
        if joint.mimic is not None:
            raise UnknownChoice(f"joint `{name}` mimics `{joint.mimic.joint}`", f"set `{joint.mimic.joint}`")
        expected = (ANGLE if joint.twist.turns else LENGTH,)
        try:
            values[joint.path] = check_dimension(parse_quantity(text, expected), expected, text).value
        except UnitError as fault:
            raise console.WrongCommandLine(f"--position: {fault}", fault.help or "write, for example, 'elbow=90 deg'") from fault
    named = next((one for one in assembly.poses if one.name == pose), None) or assembly.start_pose(robot.mode)
    moved = pose_robot(assembly, robot.mode, [replace(named, name=MOVED, values={**named.values, **values})])
    if moved is None or not moved.keyframes:
        raise UnknownChoice(f"the loops of mode `{robot.mode.name}` do not close in this position", "change the position of another joint")
    for joint in joints.values():
        q = moved.keyframes[0].q[joint.path]
        if not joint.limit.contains(q):
            found = f"({joint.twist.format(q)}) is outside its limits ({joint.limit.format(joint.twist)})"
            message = f"the position of joint `{joint.name}` in the picture {found}"
            report.warn(Code.POSE_LIMITS, message, joint.origin, help="choose a position within the limits, or widen the limits")
    return moved


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", text)
    width, height = (int(match[1]), int(match[2])) if match else (0, 0)
    if not (16 <= width <= LARGEST and 16 <= height <= LARGEST):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT from 16x16 to {LARGEST}x{LARGEST}, found `{text}`")
    return width, height


def _degrees(bound: float) -> Callable[[str], float]:
    """Return an argparse type that accepts angles in degrees from -`bound` to `bound`."""
    expected = f"degrees from {-bound:g} to {bound:g}"
    return console.number_in(-bound, bound, expected, lambda text: float(text.removesuffix("deg").strip()))
