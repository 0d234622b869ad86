"""`thingc new`: a workspace that builds at once, with a robot to change."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import sys

from thingc.base.diagnostics import Report, shown_path
from thingc.documents.load.paths import DOCUMENT_SUFFIXES
from thingc.documents.load.yaml_scalars import core_value
from thingc.driver.output import OutputError, write_new
from thingc.tools.cli import console, signals
from thingc.tools.templates import TEMPLATES, files_of

EPILOG = """\
Makes the folder NAME with a robot of that name: parts, a document with two modes and tests, settings for editors, git and GitHub.
Nothing is asked. A folder that is there already must be empty but for `.git`; `.` is the one that you are in.

  thingc new rover                       {arm}
  thingc new rover --template legged     {legged}
  thingc new rover --template gripper    {gripper}
  thingc new robots/rover --template empty
  thingc new .                           in this folder, of which the robot has its name
""".format(**TEMPLATES)
RESERVED = {"world", "root", "origin", "scene"}
"""What something else is called in the files of a robot: the world, its frames, and scenes around MuJoCo models."""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `new`."""
    parser.epilog = EPILOG
    parser.add_argument("place", metavar="NAME", help="the folder that is made; its last word is the robot's name")
    parser.add_argument(
        "--template", type=console.one_of(list(TEMPLATES)), metavar="{" + ",".join(TEMPLATES) + "}", default=next(iter(TEMPLATES)),
        help="the robot to begin with (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0 where the workspace is there."""
    report = Report()
    try:
        name = robot_name(arguments.place)
        files = files_of(arguments.template, name)
        with signals.held():  # for an instant; nothing would be half there, but the lock might stay
            folder = write_new(arguments.place, files)
    except ValueError as fault:
        hint = f"write for example `thingc new {name}_robot`"
        raise console.WrongCommandLine(f"a robot cannot be called so: {fault}", hint) from fault
    except OutputError as fault:
        fault.diagnose(report)
        return console.print_text(report.diagnostics, stream=sys.stderr, debug=False)
    console.say(*_next_steps(arguments, folder, name))
    return 0


def robot_name(place: str) -> str:
    """The name of the robot in a folder: its last word, with `_` for hyphens, dots and spaces, and letters without their accents. Raises
    `WrongCommandLine`."""
    here = place != "" and os.path.normpath(place) == os.curdir
    word = os.path.basename(os.getcwd() if here else os.path.normpath(place)) if place else ""
    if word in ("", os.pardir):
        raise console.WrongCommandLine(f"`{place}` names no folder that could be made", "write for example `thingc new rover`")
    stem, ending = os.path.splitext(word)
    if ending.lower() in DOCUMENT_SUFFIXES and not here:
        near = shlex.quote(os.path.join(os.path.dirname(place), stem))
        message = f"`{word}` is what a document is called, and a folder is made"
        raise console.WrongCommandLine(message, f"write `thingc new {near}`: its document lies in it")
    if word.startswith("-") and not here:
        raise console.WrongCommandLine(f"`{word}` is taken for an option wherever it is typed", "choose a name that begins with a letter")
    name = re.sub(r"[-. ]+", "_", _plain(word)).strip("_")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        near = re.sub(r"\W+", "_", f"robot_{name}", flags=re.ASCII).strip("_")
        message = f"`{word}` is no name for a robot: a letter (a to z), then letters, digits and `_`"
        raise console.WrongCommandLine(message, f"write for example `thingc new {near}`")
    if name.lower() in RESERVED or not isinstance(core_value(name), str):
        message = f"a robot cannot be called `{name}`: its files mean something else by that"
        raise console.WrongCommandLine(message, f"write for example `thingc new {name}_robot`")
    return name


def _plain(word: str) -> str:
    """A word with letters from a to z in place of those that are such with something added: `uber` for `über`."""
    from unicodedata import combining, normalize

    return "".join(one for one in normalize("NFKD", word.replace("ß", "ss")) if not combining(one))


def _next_steps(arguments: argparse.Namespace, folder: str, name: str) -> list[str]:
    """What was made, and what to type next."""
    here, document = shown_path(folder), f"{name}.yaml"
    said = [f"{name if here == os.curdir else here}: {TEMPLATES[arguments.template]}"]
    if name != os.path.basename(folder):
        said.append(f"the robot is called `{name}`: names are letters, digits and `_`")
    steps = [
        *([] if here == os.curdir else [(f"cd {shlex.quote(here)}", "")]),
        (f"thingc check {document}", "is it right?"),
        (f"thingc view {document}", "the robot in your browser; it follows every save"),
        (f"thingc build {document}", f"models, meshes, print files, bill of materials in build/{name}/"),
        (f"thingc test {document}", "what has to stay true of it"),
        (f"thingc watch {document}", "builds again on every save"),
    ]
    width = max(len(command) for command, _ in steps)
    if os.path.exists(os.path.join(folder, "walk.py")):
        steps.insert(-2, ("python walk.py", "ten seconds of walking in MuJoCo"))
    else:
        with open(os.path.join(folder, document), encoding="utf-8") as stream:
            mode = re.search(r"^modes:\n  (\w+):", stream.read(), re.MULTILINE)
        scene = f"build/{name}/mjcf/scene_{mode[1] if mode else 'default'}.xml"
        steps.insert(-2, (f"python -m mujoco.viewer --mjcf={scene}", "steps it"))
    return [*said, "", *(f"  {command:{width}}   {what}".rstrip() for command, what in steps)]
