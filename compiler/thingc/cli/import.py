"""`thingc import`: a robot of another format as a workspace."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from typing import TYPE_CHECKING

from thingc.brief import counted
from thingc.cli import common
from thingc.diagnostics import Report, shown_path
from thingc.output import OutputError, write_new

if TYPE_CHECKING:
    from thingc.importing import Imported

EPILOG = """\
Writes a document of the robot, which is yours from then on, and `import.json`: what everything was called, and what a document cannot say
of it, with the line of the source.

  thingc import robot.urdf                       into a folder of the robot's name
  thingc import robot.urdf -o robots/arm
  thingc import robot.urdf --repair inertia=nearest
  thingc import robot.urdf --root left_sole      with a mode that is rooted at that link
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `import`."""
    parser.epilog = EPILOG
    parser.add_argument("file", metavar="FILE", help="a robot: .urdf")
    parser.add_argument("-o", "--output", metavar="DIR", help="the folder that is made (default: called like the robot)")
    parser.add_argument(
        "--package", metavar="NAME=DIR", action="append", default=[],
        help="where `package://NAME/...` is (may be repeated; else folders above the file, ROS_PACKAGE_PATH and AMENT_PREFIX_PATH)",
    )
    parser.add_argument("--no-meshes", action="store_true", help="leave meshes out, each of which is listed then")
    parser.add_argument("--check", action="store_true", help="write nothing: say what would be kept, repaired and lost")
    parser.add_argument(
        "--repair", metavar="inertia=HOW", type=_repair,
        help="change links that cannot move: inertia=nearest (to the nearest inertia that a solid has), or inertia=shapes",
    )
    parser.add_argument(
        "--root", metavar="LINK", action="append", default=[], help="a link that gets a mode of its own, rooted at it (may be repeated)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0 where the document is written, 1 where the file is at fault, 2 for a wrong command line."""
    from thingc.importing import import_robot

    report = Report()
    try:
        packages = dict(_package(word) for word in arguments.package)
    except common.WrongCommandLine as fault:
        common.print_text([fault.diagnostic], stream=sys.stderr, debug=False)
        return common.USAGE
    imported = import_robot(
        arguments.file, report, roots=arguments.root, repair=arguments.repair, packages=packages, meshes=not arguments.no_meshes,
    )
    if imported is not None and arguments.check:
        common.say(*_would(arguments, imported))
    elif imported is not None:
        try:
            folder = write_new(arguments.output or imported.name, imported.files, lambda _: None)
            common.say(*_told(arguments, imported, folder))
        except OutputError as fault:
            fault.diagnose(report)
    common.print_text(report.ordered(), stream=sys.stderr, debug=False)
    return common.exit_code(report.diagnostics)


def _repair(text: str) -> str:
    """How inertias are repaired, as argparse wants it checked."""
    what, _, how = text.partition("=")
    if what != "inertia" or how not in ("nearest", "shapes"):
        raise argparse.ArgumentTypeError(f"expected `inertia=nearest` or `inertia=shapes`, found `{text}`")
    return how


def _package(word: str) -> tuple[str, str]:
    """`NAME=DIR`. Raises `WrongCommandLine`."""
    name, _, folder = word.partition("=")
    if not name or not os.path.isdir(folder):
        raise common.WrongCommandLine(f"--package: expected NAME=DIR with a folder, found `{word}`", "write --package my_robot=../my_robot")
    return name, folder


def _would(arguments: argparse.Namespace, imported: Imported) -> list[str]:
    """What would become of the robot: what is kept, what was repaired, and every loss at its line."""
    source = os.path.basename(arguments.file)
    said = [f"{_read(arguments, imported)} would be kept"]
    said += [f"{source}:{one.link.where.line}: repaired: the weight of link `{one.link.name}` ({one.how})" for one in imported.repaired]
    return said + [f"{source}:{one.where.line}: lost: {one.what}: {one.why}" for one in imported.losses]


def _read(arguments: argparse.Namespace, imported: Imported) -> str:
    robot = imported.robot
    joints = [joint for one in robot.hangings for joint in one.joints]
    meshes = len([name for name in imported.files if name.startswith("meshes/")])
    things = [counted(len(robot.links), "link"), counted(len(joints), "joint")]
    if meshes:
        things.append(f"{meshes} {'mesh' if meshes == 1 else 'meshes'}")
    return f"{', '.join(things[:-1])} and {things[-1]} of {os.path.basename(arguments.file)}"


def _told(arguments: argparse.Namespace, imported: Imported, folder: str) -> list[str]:
    """What was read, what became of it, and what to type next."""
    robot, here = imported.robot, shown_path(folder)
    said = [f"{here}: {_read(arguments, imported)}"]
    if imported.renamed:
        are = "is another" if len(imported.renamed) == 1 else "are others"
        said.append(f"{counted(len(imported.renamed), 'name')} {are} now: see import.json")
    if imported.repaired:
        names = ", ".join(f"`{one.link.name}`" for one in imported.repaired[:6])
        more = f" and {len(imported.repaired) - 6} more" if len(imported.repaired) > 6 else ""
        said.append(f"repaired: {names}{more}; old and new numbers are in import.json")
    if imported.losses:
        said.append(f"not in the document: {len(imported.losses)}, listed in {os.path.join(here, 'import.json')}")
    document = shlex.quote(os.path.join(here, f"{imported.name}.yaml"))
    steps = [
        (f"thingc check {document}", "is it right?"), (f"thingc view {document}", "the robot in your browser; it follows every save"),
        (f"thingc build {document} --emit mjcf,urdf", "models of every mode"),
    ]
    if not arguments.root:
        end = next((link.name for link in reversed(robot.links) if link.name != robot.root), None)
        if end is not None:
            said.append("another root: `--root LINK`, or a line under `modes:` in the document")
    width = max(len(command) for command, _ in steps)
    return [*said, "", *(f"  {command:{width}}   {what}" for command, what in steps)]
