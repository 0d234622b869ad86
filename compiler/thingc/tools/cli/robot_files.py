"""Check robot files of other formats, such as URDF, without converting them, and define the options for reading these files."""

from __future__ import annotations

import argparse
import os
from functools import partial

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report
from thingc.base.source import line_of
from thingc.driver.environment import Options
from thingc.tools.cli import console
from thingc.tools.importing.import_request import ImportRequest


def configure(parser: argparse.ArgumentParser, *, meshes: bool = True) -> None:
    """Add the options for reading robot files to a parser. If `meshes` is false, the command reads no meshes."""
    add = parser.add_argument
    add(
        "--package", metavar="NAME=DIR", action="append", default=[],
        help="folder of a ROS package (may be repeated; default: search the parent folders, ROS_PACKAGE_PATH and AMENT_PREFIX_PATH)",
    )
    add("--arg", metavar="NAME=VALUE", action="append", default=[], help="set an argument of a xacro file (may be repeated)")
    add("--repair", metavar="inertia=HOW", type=_repair, help="repair impossible inertias (inertia=nearest or inertia=shapes)")
    if not meshes:
        parser.set_defaults(mesh_root=[], no_meshes=True)
        return
    add("--mesh-root", metavar="DIR", action="append", default=[], help="folder to search for missing meshes (may be repeated)")
    add("--no-meshes", action="store_true", help="omit meshes")


def import_request(arguments: argparse.Namespace) -> ImportRequest:
    """Convert the command-line arguments to options for reading robot files. Raises `WrongCommandLine` for an invalid value."""
    return ImportRequest(
        packages=dict(_pair("--package", word, "DIR with a folder", "my_robot=../my_robot") for word in arguments.package),
        arguments=dict(_pair("--arg", word, "VALUE", "prefix=left_") for word in arguments.arg), meshes=not arguments.no_meshes,
        mesh_roots=tuple(map(_folder, arguments.mesh_root)), repair=arguments.repair,
    )


def _repair(text: str) -> str:
    """Parse the value of the option `--repair`. This function is an argparse type."""
    target, _, method = text.partition("=")
    if target != "inertia" or method not in ("nearest", "shapes"):
        raise argparse.ArgumentTypeError(f"expected `inertia=nearest` or `inertia=shapes`, found `{text}`")
    return method


def _pair(option: str, word: str, value: str, example: str) -> tuple[str, str]:
    """Parse a value of the option `--package` or `--arg`, which is NAME=DIR or NAME=VALUE. Raises `WrongCommandLine`."""
    name, equals, text = word.partition("=")
    if not name or not equals or option == "--package" and not os.path.isdir(text):
        raise console.WrongCommandLine(f"{option}: expected NAME={value}, found `{word}`", f"write {option} {example}")
    return name, text


def _folder(word: str) -> str:
    """Return the absolute path of a folder. Raises `WrongCommandLine` if the folder does not exist."""
    if not os.path.isdir(word):
        raise console.WrongCommandLine(f"--mesh-root: expected a folder, found `{word}`", "write --mesh-root ../meshes")
    return os.path.abspath(word)


def check_robot(path: str, options: Options, source: ImportRequest, *, strict: bool) -> list[Diagnostic]:
    """Check a robot file without converting it. Return its diagnostics, including a note about each loss of an import."""
    from thingc.tools.importing.imported_document import imported_document

    report = Report()
    with imported_document(path, options, report, source) as document:
        if document is not None:
            document.compile(report)
            for note in document.imported.notes():
                report.say(note)
    return console.final(report, strict=strict)


def check_confined(path: str, options: Options, source: ImportRequest, *, strict: bool, seconds: float) -> list[Diagnostic]:
    """Check an untrusted robot file in a sandboxed process, without reading its meshes. A xacro file is not checked, because it is code."""
    from thingc.tools.cli.sandboxed_check import diagnose_confined

    if path.lower().endswith(".xacro"):
        report, message = Report(), "the xacro file was not checked"
        help = "check the URDF file that `xacro` creates, or omit `--no-code`"
        report.warn(Code.SOURCE_XML, message, line_of(os.path.abspath(path)), help=help)
        return console.final(report, strict=strict)
    if path.lower().endswith(".xml"):
        import mujoco  # noqa: F401  (the sandbox cannot load libraries)

    return diagnose_confined(path, partial(check_robot, path, options, replace(source, meshes=False), strict=strict), seconds)
