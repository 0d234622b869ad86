"""Implementation of `thingc build`, which compiles a document and writes the build folder.

Writes build/NAME/ (or DIR/NAME/). If the build fails, the folder stays unchanged. {targets}

  thingc build assemblies/arm.yaml
  thingc build assemblies/arm.yaml --mode bench --mode drawing --emit mjcf
  thingc build assemblies/arm.yaml --compat mjx
  thingc build assemblies/arm.yaml -p 'reach=120 mm' -o variants
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shlex
import sys
import textwrap
from collections import Counter
from collections.abc import Mapping
from functools import partial
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity, UserError, shown_path
from thingc.base.one_line_repr import format_count
from thingc.base.safe_text import quote_names
from thingc.documents.workspace import CONSUMERS, Workspace
from thingc.driver import build_document, pipeline, up_to_date
from thingc.driver.build_document import BuildRequest, BuildResult
from thingc.driver.environment import Environment, Options, store_of, with_environment
from thingc.driver.output import build_folder, has_leftovers, manifest_paths, verify
from thingc.geometry.store.local import Store
from thingc.targets.artifact import CARRIED
from thingc.targets.registry import TARGETS, parse_targets, targets, unknown
from thingc.tools.cli import console
from thingc.tools.workshop import RENDERED


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc build` to the parser."""
    about, _, examples = (parser.epilog or "").partition("\n\n")
    parser.epilog = f"{textwrap.fill(about.format(targets=describe_targets()), 120)}\n\n{examples}"
    console.add_document(parser)
    add_building(parser)
    parser.add_argument("--twice", action="store_true", help="build each part twice, and compare the results")
    console.add_format(parser, console.FINDINGS)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc build`, and return the exit code, which is 0 if the folder was written or is up to date."""
    try:
        console.require_document(arguments.document)
        options = console.options_of(arguments)
        targets, diagnostics = chosen_targets(arguments)
        answer = None
        if not diagnostics:
            options = replace(options, ahead=pipeline.modules_of_build(targets))
            prepare_rendering(targets)
            diagnostics, answer = _build(arguments, options, targets)
    except UserError as fault:
        diagnostics, answer = [fault.diagnostic], None
    result = answer or {"folder": "", "artifacts": [], "modelled": [], "reused": []}
    artifacts = [shown_path(os.path.join(result["folder"], path)) for path in result["artifacts"]]
    console.print_found(
        diagnostics, arguments.format, stream=sys.stderr, debug=arguments.debug, artifacts=artifacts, modelled=result["modelled"],
        reused=result["reused"],
    )
    if answer is not None and arguments.format != "json":
        print_summary({**answer, "losses": {target: count for target, count in answer["losses"].items() if target in targets}}, arguments)
    return console.exit_code(diagnostics)


def prepare_rendering(targets: tuple[str, ...]) -> None:
    """Prepare rendering for targets that contain pictures, and let MuJoCo load an OpenGL library for targets of other packages."""
    if RENDERED & {*targets}:
        from thingc.targets.render.picture import NoGraphics, ready

        with contextlib.suppress(NoGraphics):  # the target reports the loss
            ready()
    elif not TARGETS.keys() >= {*targets}:
        from thingc.targets.render.picture import allow_rendering

        allow_rendering()


def _build(arguments: argparse.Namespace, options: Options, targets: tuple[str, ...]) -> tuple[list[Diagnostic], Mapping[str, Any] | None]:
    """Build the robot, or reuse an earlier build if nothing has changed.

    Return the diagnostics, and the data for the JSON output, or None after errors. If only some targets are missing from an up-to-date
    build folder, this function builds the missing targets. Raises `UnknownChoice` and `OutputError`.
    """
    key = up_to_date.key_of("build", arguments.document, {
        "parameters": dict(options.parameters), "choices": dict(options.choices), "modes": arguments.mode,
        "compat": options.compat, "strict": arguments.strict,
        "output": os.path.abspath(arguments.output) if arguments.output else None, "deny_loss": arguments.deny_loss,
    })
    store = store_of(options)
    earlier = up_to_date.load(store, key) if not arguments.twice else None
    if earlier is not None and _is_complete(earlier[1], store):
        problems, answer = earlier
        if not set(targets) - set(answer["targets"]):
            parts = sorted({*answer["reused"], *answer["modelled"]})
            return problems, {**answer, "modelled": [], "reused": parts, "unchanged": True}
        targets = parse_targets([*targets, *answer["targets"]])  # the other outputs in the folder are up to date and do not change
    return with_environment(arguments.document, options, partial(_build_robot, wish_of(arguments, targets), key))


def wish_of(arguments: argparse.Namespace, targets: tuple[str, ...]) -> BuildRequest:
    """Convert the command-line arguments to a build request."""
    return BuildRequest(
        targets=targets, modes=arguments.mode, output=arguments.output, strict=arguments.strict,
        deny_loss=arguments.deny_loss, force=arguments.force, twice=getattr(arguments, "twice", False),
    )


def _build_robot(wish: BuildRequest, key: str, environment: Environment) -> tuple[list[Diagnostic], Mapping[str, Any] | None]:
    """Build the robot and write the build folder. Store the result in the cache under `key`."""
    built = build_document.build(environment, wish)
    diagnostics = list(built.diagnostics)
    if built.files is None:
        return diagnostics, None
    before = manifest_paths(build_folder(*built.place))
    folder = build_document.write(environment, built, wish, console.say_waiting)
    if removed := sorted(before - built.files.keys()):
        console.say(f"removed {format_count(len(removed), 'file')} of the previous build: {quote_names(removed, 4)}", stream=sys.stderr)
    manifest = up_to_date.state_of(os.path.join(folder, "manifest.json"))
    answer = {**answer_of(built, folder), "targets": wish.targets, "place": built.place, "manifest": manifest}
    up_to_date.save(environment.store, key, up_to_date.inputs(environment, built.compilation), diagnostics, answer)
    return diagnostics, {**answer, "twice": built.twice}


def answer_of(built: BuildResult, folder: str) -> dict[str, Any]:
    """Return the description of a build for the JSON output of the command."""
    losses_by_target = Counter(loss.target for loss in built.losses if loss.how != CARRIED)
    return {
        "folder": folder, "artifacts": sorted(built.files or ()), "modelled": built.compilation.modelled,
        "reused": built.compilation.reused, "losses": dict(losses_by_target),
    }


def _is_complete(answer: Mapping[str, Any], store: Store) -> bool:
    """Return whether the build folder of an earlier build is complete and unchanged."""
    folder = answer["folder"]
    if build_folder(*answer["place"]) != folder or has_leftovers(folder):
        return False
    return up_to_date.state_of(os.path.join(folder, "manifest.json")) == answer["manifest"] and verify(folder, store) is not None


def print_summary(answer: Mapping[str, Any], arguments: argparse.Namespace) -> None:
    """Print a summary of the build to standard error. The last line shows the folder and the number of files."""
    if answer.get("twice"):
        console.say(f"{format_count(answer['twice'], 'part')} built twice, with equal results", stream=sys.stderr)
    if losses_by_target := answer["losses"]:
        command = shlex.join(["thingc", "why", "--losses", arguments.document, *(f"--emit={name}" for name in arguments.emit),
                            *(f"--compat={name}" for name in arguments.compat)])
        counts = ", ".join(f"{count} in {target}" for target, count in losses_by_target.items())
        console.say(f"{format_count(sum(losses_by_target.values()), 'export loss')} ({counts}); to list: {command}", stream=sys.stderr)
    folder, files = shown_path(answer["folder"]), format_count(len(answer["artifacts"]), "file")
    if answer.get("unchanged"):
        console.say(f"{folder} is up to date ({files})", stream=sys.stderr)
    else:
        modelled, reused = len(answer["modelled"]), len(answer["reused"])
        console.say(f"Built {folder}: {files}; {format_count(modelled, 'part')} modelled, {reused} reused", stream=sys.stderr)


# --- options of several commands ------------------------------------------------------------------------------------------


def describe_targets() -> str:
    """Return the list of all targets, with descriptions, for the output of `--help`."""
    described = {name: f"{name} ({target.says})" for name, target in TARGETS.items()}
    default_targets, on_request = ([described[name] for name in TARGETS if TARGETS[name].unasked == kind] for kind in (True, False))
    more = [name for name in targets() if name not in TARGETS]
    return f"Targets: {', '.join(default_targets)}; and, only with --emit, {', '.join(on_request)}, {', '.join(more)}."


def add_emit(parser: argparse.ArgumentParser) -> None:
    """Add the option `--emit`, which selects the targets to build, to a parser."""
    unasked = [name for name, target in TARGETS.items() if target.unasked]
    parser.add_argument(
        "--emit", metavar="T", action="append", default=[],
        help=f"target to write, or `all` (may be repeated; default: the targets in thingc.toml, or {', '.join(unasked)})",
    )


def add_compat(parser: argparse.ArgumentParser) -> None:
    """Add the option `--compat`, which selects further programs that must be able to read the MuJoCo models, to a parser."""
    parser.add_argument(
        "--compat", metavar="C", action="append", default=[],
        help=f"make the MuJoCo models compatible with this program ({', '.join(CONSUMERS)}; may be repeated; "
        "default: the programs in thingc.toml)",
    )


def add_building(parser: argparse.ArgumentParser) -> None:
    """Add the options that control the content and the location of the build folder to a parser."""
    parser.add_argument("-o", "--output", metavar="DIR", help="create the output folder in DIR (default: the workspace's build folder)")
    parser.add_argument("--mode", metavar="M", action="append", default=[], help="mode to build (may be repeated; default: all modes)")
    add_emit(parser)
    add_compat(parser)
    parser.add_argument("--force", action="store_true", help="overwrite unknown or modified files in the output folder")
    parser.add_argument("--deny-loss", action="store_true", help="treat export losses as errors")


def chosen_targets(arguments: argparse.Namespace) -> tuple[tuple[str, ...], list[Diagnostic]]:
    """Return the targets to build, and errors about unknown targets in the settings of the workspace.

    Raises `WrongCommandLine` for errors in the options `--emit` and `--compat`.
    """
    for _, message, hint in unknown(arguments.emit):
        raise console.WrongCommandLine(message, hint)
    if arguments.emit and not parse_targets(arguments.emit):
        raise console.WrongCommandLine("`--emit` requires a target", "write, for example, --emit mjcf,urdf")
    if arguments.emit and arguments.compat and not {"mjcf", "mjz"} & {*parse_targets(arguments.emit)}:
        raise console.WrongCommandLine("`--compat` requires the target `mjcf`", "add `mjcf` to `--emit`")
    if arguments.emit:
        return parse_targets(arguments.emit), []
    workspace = Workspace.find(arguments.document, Report())
    if workspace is None:  # loading the document reports errors in the workspace settings
        return parse_targets(()), []
    return parse_targets(workspace.emit), [
        Diagnostic(code=Code.UNKNOWN_CHOICE, severity=Severity.ERROR, message=message, help=str(hint), span=workspace.span(("emit", index)))
        for index, message, hint in unknown(workspace.emit)
    ]
