"""Implementation of `thingc new`, which creates a workspace with a small robot that can be built.

Creates the folder NAME with a robot of that name: parts, a document with modes and tests, settings for editors, Git and GitHub.
An existing folder must be empty except for `.git`. Use `.` for the working folder.

  thingc new rover                       {arm}
  thingc new rover --template legged     {legged}
  thingc new rover --template gripper    {gripper}
  thingc new robots/rover --template empty
  thingc new .                           create the files in the working folder, and name the robot after the folder
"""

from __future__ import annotations

import argparse
import os
import re
import shlex

from thingc.base.diagnostics import shown_path
from thingc.documents.load.paths import DOCUMENT_SUFFIXES
from thingc.documents.load.yaml_scalars import core_value
from thingc.driver.output import write_new
from thingc.tools.cli import console, signals
from thingc.tools.templates import TEMPLATES, files_of

RESERVED = {"world", "root", "origin", "scene"}
"""Names that a robot cannot have: the world, frames of the world, and the scene files of MuJoCo models."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc new` to the parser."""
    parser.epilog = (parser.epilog or "").format(**TEMPLATES)
    parser.add_argument("place", metavar="NAME", help="folder to create, named after the robot")
    parser.add_argument(
        "--template", type=console.one_of(list(TEMPLATES)), metavar="{" + ",".join(TEMPLATES) + "}", default=next(iter(TEMPLATES)),
        help="the example robot (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc new`, and return the exit code, which is 0 if the workspace was created."""
    try:
        name = robot_name(arguments.place)
        with signals.delay_signals():  # each file is written atomically, but without this, an interrupt could leave a lock file behind
            folder = write_new(arguments.place, files_of(arguments.template, name))
    except ValueError as fault:
        raise console.WrongCommandLine(f"invalid robot name: {fault}", f"write, for example, `thingc new {name}_robot`") from fault
    console.say(*_next_steps(arguments, folder, name))
    return 0


def robot_name(place: str) -> str:
    """Convert the name of a folder to a valid name for a robot. Raises `WrongCommandLine` if this is not possible.

    Hyphens, dots and spaces are replaced by `_`, and accents are removed.
    """
    is_working_folder = place != "" and os.path.normpath(place) == os.curdir
    word = os.path.basename(os.getcwd() if is_working_folder else os.path.normpath(place)) if place else ""
    if word in ("", os.pardir):
        raise console.WrongCommandLine(f"cannot create a folder `{place}`", "write, for example, `thingc new rover`")
    stem, ending = os.path.splitext(word)
    if ending.lower() in DOCUMENT_SUFFIXES and not is_working_folder:
        near = shlex.quote(os.path.join(os.path.dirname(place), stem.removesuffix(".thingc")))
        message = f"expected a folder, found the document name `{word}`"
        raise console.WrongCommandLine(message, f"write `thingc new {near}`")
    if word.startswith("-") and not is_working_folder:
        raise console.WrongCommandLine(f"`{word}` would be parsed as an option", "choose a name that starts with a letter")
    name = re.sub(r"[-. ]+", "_", _plain(word)).strip("_")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        near = re.sub(r"\W+", "_", f"robot_{name}", flags=re.ASCII).strip("_")
        message = f"`{word}` is not a valid name (expected a letter from a to z, then letters, digits and `_`)"
        raise console.WrongCommandLine(message, f"write, for example, `thingc new {near}`")
    if name.lower() in RESERVED or not isinstance(core_value(name), str):
        message = f"`{name}` is a reserved name in the files of a robot"
        raise console.WrongCommandLine(message, f"write, for example, `thingc new {name}_robot`")
    return name


def _plain(word: str) -> str:
    """Remove accents and other marks from letters: `über` becomes `uber`."""
    from unicodedata import combining, normalize

    return "".join(one for one in normalize("NFKD", word.replace("ß", "ss")) if not combining(one))


def _next_steps(arguments: argparse.Namespace, folder: str, name: str) -> list[str]:
    """Describe the new files, and suggest commands that the user can run next."""
    shown_folder, document = shown_path(folder), f"{name}.yaml"
    lines = [f"{name if shown_folder == os.curdir else shown_folder}: {TEMPLATES[arguments.template]}"]
    if name != os.path.basename(folder):
        lines.append(f"the robot is named `{name}`")
    steps = [
        *([] if shown_folder == os.curdir else [(f"cd {shlex.quote(shown_folder)}", "")]),
        (f"thingc check {document}", "report errors and warnings"),
        (f"thingc view {document}", "show the robot in your browser, updated after every save"),
        (f"thingc build {document}", f"write models, print files and a bill of materials to build/{name}/"),
        (f"thingc test {document}", "run its tests"),
        (f"thingc watch {document}", "build after every save"),
    ]
    width = max(len(command) for command, _ in steps)
    if os.path.exists(os.path.join(folder, "walk.py")):
        steps.insert(-2, ("python walk.py", "walk for ten seconds in MuJoCo"))
    else:
        with open(os.path.join(folder, document), encoding="utf-8") as stream:
            mode = re.search(r"^modes:\n  (\w+):", stream.read(), re.MULTILINE)
        scene = f"build/{name}/mjcf/scene_{mode[1] if mode else 'default'}.xml"
        steps.insert(-2, (f"python -m mujoco.viewer --mjcf={scene}", "simulate it"))
    return [*lines, "", *(f"  {command:{width}}   {what}".rstrip() for command, what in steps)]
