"""Implementation of `thingc batch`, which builds every variant of a document of the format `variants/1`.

Writes build/NAME/ (or DIR/NAME/): a folder for each variant in variants/, shared meshes in assets/, the tables results.csv and
results.parquet, and the page index.html. To continue an interrupted batch, use --resume. More than 2000 variants are packed:
files in chunks/ contain 1024 variants each, and --unpack writes the folder of one variant.

  thingc batch leg_sweep.yaml --dry-run
  thingc batch leg_sweep.yaml
  thingc batch leg_sweep.yaml --limit 100 --emit mjcf -o /data/robots
  thingc batch leg_sweep.yaml --resume
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shlex
import sys
import time
from collections import Counter
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.diagnostics import shown_path
from thingc.base.one_line_repr import format_count
from thingc.batch.build_records import find_variant, in_order
from thingc.batch.folder import FOLDERS, PACKED, BatchFault, explain_os_error, lock_folder, read_description
from thingc.batch.page import show_again
from thingc.batch.pictures import ALL, MANY, MOST
from thingc.batch.planning import Plan, PlanError
from thingc.batch.progress import Interrupted, Progress, Summary
from thingc.batch.results import FamilyError, load
from thingc.batch.run_options import chosen_targets
from thingc.batch.variants_document import plan
from thingc.driver.environment import Options
from thingc.tools.cli import console
from thingc.tools.cli.build import prepare_rendering
from thingc.tools.cli.set import write
from thingc.tools.cli.signals import INTERRUPTED

if TYPE_CHECKING:
    from thingc.batch.dry_run import DryRun

VERIFY = {"some": 64, "all": 1, "none": 0}
"""The values of the option `--verify`. If models differ only in numbers, MuJoCo compiles only every n-th model."""
PAUSE = 30.0
"""Interval [s] between progress reports if standard error is not a terminal."""
STATUSES = {"built": "built", "kept_out": "excluded", "refused": "refused", "failed": "failed"}
"""The text for each status of a variant in messages."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc batch` to the parser."""
    add = parser.add_argument
    add("document", metavar="DOC", help="a variants document (YAML or TOML)")
    add("-o", "--output", metavar="DIR", help="create the output folder in DIR (default: the workspace's build folder)")
    add("--emit", metavar="T", action="append", default=[], help="target to write (may be repeated; default: the targets of the document)")
    add("--limit", metavar="N", type=console.positive, help="build only the first N variants")
    add("--resume", action="store_true", help="continue an interrupted batch")
    add("--retry", action="store_true", help="also retry failed variants (requires --resume)")
    add("--adopt", metavar="ID", help="write the values of a variant to the assembly document")
    add("--unpack", metavar="ID", help="extract the folder of one variant from a packed batch")
    add("--dry-run", action="store_true", help="show the variants without building them")
    add(
        "--layout", choices=(FOLDERS, PACKED),
        help="layout of the results (default: from the document, or packed for more than 2000 variants)",
    )
    add("--timeout", metavar="TIME", help="time limit for each variant (default: '10 min')")
    add("--cluster", metavar="ADDRESS", help="address of a Dask or Slurm cluster to build on")
    add("--ship", action="store_true", help="copy the workspace to the cluster, and the results back (requires --cluster)")
    add(
        "--pictures", metavar="N", type=_pictures,
        help="number of pictures on the HTML page, `none` or `all` (default: 48, or none for more than 200 variants)",
    )
    add("--page-only", action="store_true", help="update only the HTML page of an existing batch")
    add("--verify", choices=tuple(VERIFY), default="some", help="check some, all or none of the models with MuJoCo (default: some)")
    console.add_format(parser)
    console.add_geometry(parser, jobs="number of variants to build in parallel")


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc batch`, and return the exit code, which is 0 if every variant was built or excluded by a rule."""
    try:
        console.require_document(arguments.document)
        options = replace(console.options_of(arguments), progress=None)
        if arguments.ship and arguments.cluster is None:
            raise console.WrongCommandLine("--ship requires --cluster", "add --cluster tcp://HOST:8786")
        exclusive = ("--adopt", "--dry-run", "--page-only", "--unpack", "--resume")
        chosen = [option for option in exclusive if getattr(arguments, option[2:].replace("-", "_"))]
        if len(chosen) > 1:
            raise console.WrongCommandLine(f"{chosen[0]} cannot be combined with {chosen[1]}", "use only one of the two options")
        timeout = None if arguments.timeout is None else console.time_of("--timeout", arguments.timeout)
        targets = chosen_targets(arguments.emit)
        prepare_rendering(targets)
        if arguments.adopt is not None:
            return _adopt(arguments, options)
        if arguments.unpack is not None:
            return _unpack(arguments, options)
        if arguments.dry_run:
            return _forecast(arguments, options, targets)
        if arguments.page_only:
            return _page(arguments, options)
        summary = _build(arguments, options, targets, timeout)
    except PlanError as fault:
        return console.print_found(fault.diagnostics, arguments.format, stream=sys.stderr, debug=arguments.debug)
    except BatchFault as fault:
        console.say_in_place()
        return console.print_found([fault.diagnostic], arguments.format, stream=sys.stderr, debug=arguments.debug)
    except Interrupted as fault:
        console.say_in_place()
        done = f"{fault.done} of {format_count(fault.count, 'variant')} are done"
        console.say(f"interrupted ({done}); to continue, run: {_resume_command(arguments)}", stream=sys.stderr)
        return INTERRUPTED
    return _answer(arguments, summary)


def _resume_command(arguments: argparse.Namespace) -> str:
    """Return the command line with which the user can continue an interrupted batch with the same options."""
    pictures = {ALL: "all", 0: "none"}.get(arguments.pictures, arguments.pictures)
    settings = {
        "-o": arguments.output, "--limit": arguments.limit, "--layout": arguments.layout, "--timeout": arguments.timeout,
        "--cluster": arguments.cluster, "--pictures": pictures, "--verify": arguments.verify if arguments.verify != "some" else None,
        "--store": arguments.store, "--jobs": arguments.jobs or None, "--part-timeout": arguments.part_timeout,
    }
    words = ["thingc", "batch", arguments.document, *(word for target in arguments.emit for word in ("--emit", target))]
    words += [str(word) for option, value in settings.items() if value is not None for word in (option, value)]
    flags = {"--ship": arguments.ship, "--resume": True, "--retry": arguments.retry}
    return shlex.join([*words, *(flag for flag, is_set in flags.items() if is_set)])


def _build(arguments: argparse.Namespace, options: Options, targets: tuple[str, ...], timeout: float | None) -> Summary:
    from thingc.batch.batch import TIMEOUT, run
    from thingc.batch.cluster.connection import connect

    with contextlib.ExitStack() as leaving:
        cluster = None
        if arguments.cluster is not None:
            job_folder = os.path.abspath(os.path.join(arguments.output or ".", f".thingc-jobs-{os.getpid()}"))
            cluster = leaving.enter_context(connect(arguments.cluster, jobs=options.jobs, folder=job_folder))
        summary = run(
            arguments.document, output=arguments.output, executor=cluster, jobs=options.jobs, emit=targets, limit=arguments.limit,
            resume=arguments.resume, timeout=timeout or TIMEOUT, verify=VERIFY[arguments.verify], options=options,
            on_progress=_Show() if arguments.format == "text" else None, pictures=arguments.pictures,
            on_picture=_draw if arguments.format == "text" else None, ship=arguments.ship, retry=arguments.retry,
            layout=arguments.layout,
        )
    console.say_in_place()
    return summary


class _Show:
    """Displays the progress of a batch in one line of the terminal.

    If the output is not a terminal, a line is printed every `PAUSE` seconds.
    """

    def __init__(self) -> None:
        self.last_line = time.monotonic()

    def __call__(self, progress: Progress) -> None:
        """Update the displayed progress of the batch."""
        counts = ", ".join(f"{count} {STATUSES[status]}" for status, count in sorted(progress.counts.items())) or "none yet"
        left = progress.left
        estimate = f", {_time(left)} left" if left is not None else ""
        line = f"{progress.done} of {format_count(progress.count, 'variant')} ({counts}); {progress.rate:.3g} per second{estimate}"
        if sys.stderr.isatty():
            console.say_in_place(line)
        elif time.monotonic() - self.last_line >= PAUSE:
            self.last_line = time.monotonic()
            console.say(line, stream=sys.stderr)


def _draw(done: int, count: int) -> None:
    """Display how many pictures have been rendered, if standard error is a terminal."""
    console.say_in_place(f"{done} of {format_count(count, 'picture')}")


def _page(arguments: argparse.Namespace, options: Options) -> int:
    path, warning = show_again(
        arguments.document, output=arguments.output, pictures=arguments.pictures, jobs=options.jobs, options=options,
        on_picture=_draw if arguments.format == "text" else None,
    )
    console.say_in_place()
    diagnostics = [warning] if warning is not None else []
    console.print_found(diagnostics, arguments.format, stream=sys.stderr, debug=False, page=shown_path(path))
    if arguments.format == "text":
        console.say(shown_path(path), stream=sys.stderr)
    return 0


def _pictures(text: str) -> int:
    """Parse the value of the option `--pictures`. This function is an argparse type."""
    if text in ("none", "all"):
        return 0 if text == "none" else ALL
    try:
        return console.positive(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, `none` or `all`, found `{text}`") from None


def _time(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _answer(arguments: argparse.Namespace, summary: Summary) -> int:
    code = 1 if summary.statuses.get("refused") or summary.statuses.get("failed") else 0
    if arguments.format == "json":
        console.print_json(
            summary.notes, folder=shown_path(summary.folder), layout=summary.layout, count=summary.count, statuses=summary.statuses,
            modelled=summary.modelled, duplicates=summary.duplicates, losses=summary.losses,
        )
        return code
    console.print_text(summary.notes, stream=sys.stderr, debug=False)
    counts = ", ".join(f"{summary.statuses[status]} {spoken}" for status, spoken in STATUSES.items() if status in summary.statuses)
    earlier = f" ({summary.before} of them in earlier runs)" if summary.before else ""
    modelled = f"{format_count(summary.modelled, 'part')} modelled"
    lines = [f"{shown_path(summary.folder)}: {format_count(summary.count, 'variant')}{earlier}: {counts}; {modelled}"]
    lines += [f"{format_count(summary.duplicates, 'duplicate')} omitted"] if summary.duplicates else []
    if summary.lossy:
        number = format_count(sum(summary.losses.values()), "export loss")
        losses = ", ".join(f"{count} {kind}" for kind, count in summary.losses.items())
        lines.append(f"{format_count(summary.lossy, 'variant')} with {number} ({losses}): see the column `losses`")
    where = f" -o {shlex.quote(arguments.output)}" if arguments.output is not None else ""
    command = f"thingc batch {shlex.quote(arguments.document)}{where}"
    if summary.layout == PACKED:
        lines.append(f"to write the folder of one variant, run: {command} --unpack ID")
    if arguments.pictures is None and summary.count > MANY:
        command_for_pictures = f"{command} --page-only --pictures {MOST}"
        lines.append(f"to draw pictures on the page, run: {command_for_pictures}")
    lines += _complaints(summary.folder) if code else []
    console.say(*lines, stream=sys.stderr)
    return code


def _complaints(folder: str) -> list[str]:
    """Summarize the errors of the variants that were refused or failed.

    Each line contains a diagnostic code, the number of variants, and the first message.
    """
    lines = [line for line in in_order(folder) if line["status"] in ("refused", "failed")]
    counts = Counter(line["code"] for line in lines)
    first = {line["code"]: line for line in reversed(lines)}
    return [f"{code} ({counts[code]}), first `{line['name']}`: {line['message']}" for code, line in sorted(first.items())]


def _forecast(arguments: argparse.Namespace, options: Options, targets: tuple[str, ...]) -> int:
    from thingc.batch.dry_run import forecast

    planned = plan(arguments.document, options=options)
    planned = replace(planned, emit=targets or planned.emit)
    foreseen = forecast(planned, options, arguments.limit)
    if arguments.format == "json":
        console.print_json(
            planned.notes, count=foreseen.count, of=planned.count, duplicates=planned.written - planned.count,
            axes=[{"name": axis.key, "values": len(axis.values) or None} for axis in planned.axes], failing=foreseen.failing,
            looked_at=foreseen.looked_at, unsound=foreseen.unsound, parts=foreseen.parts, modelled=foreseen.parts - foreseen.known,
            reused=foreseen.known,
            first=[{"index": one.index, "id": one.id, "name": one.name, "parameters": one.parameters, "choices": one.choices}
                   for one in foreseen.first],
        )
        return 0
    console.print_text(list(planned.notes), stream=sys.stderr, debug=False)
    console.say(*_format_dry_run(planned, foreseen))
    return 0


def _unpack(arguments: argparse.Namespace, options: Options) -> int:
    """Write the build folder of one variant of the batch, and print the path of the folder."""
    planned = plan(arguments.document, options=options)
    folder = planned.folder_in(arguments.output)
    read_description(planned.relative, folder, "build the batch first, without --unpack")
    try:
        with lock_folder(folder):
            console.say(shown_path(load(folder)[arguments.unpack].unpack()))
    except FamilyError as fault:
        raise console.WrongCommandLine(str(fault), "use an identifier from results.csv") from fault
    except OSError as fault:
        raise explain_os_error(folder, fault) from fault
    return 0


def _adopt(arguments: argparse.Namespace, options: Options) -> int:
    """Write the parameter values of one variant to the assembly document, as `thingc set` does."""
    planned = plan(arguments.document, options=options)
    adopted = find_variant(planned, arguments.adopt, planned.folder_in(arguments.output))
    if adopted is None:
        help = "use an identifier from results.csv or `--dry-run`"
        raise console.WrongCommandLine(f"`{planned.name}` has no variant `{arguments.adopt}`", help)
    variant, rule = adopted
    if rule is not None:
        console.say(f"{variant.name} violates the rule `{rule}`", stream=sys.stderr)
    settings = {**variant.parameters, **variant.choices}
    if not settings:
        console.say(f"{planned.assembly_relative} already has the settings of {variant.id}")
        return 0
    return write(shown_path(planned.assembly), settings, options, arguments)


def _format_dry_run(planned: Plan, forecast: DryRun) -> list[str]:
    """Format the result of a dry run as lines of text."""
    all_of_them = format_count(planned.count, "variant")
    some = f"{forecast.count} of {all_of_them}" if forecast.count != planned.count else all_of_them
    lines = [f"{planned.name}: {some} of {planned.assembly_relative}; modes {', '.join(planned.modes)}; targets {', '.join(planned.emit)}"]
    for axis in planned.axes:
        if axis.range is not None:
            lines.append(f"  {axis.key}: {axis.range[0]} to {axis.range[1]}{', whole numbers' if axis.whole else ''}")
        else:
            shown = ", ".join(str(value).lower() if isinstance(value, bool) else str(value) for value in axis.values[:6])
            lines.append(f"  {axis.key}: {shown}{f' and {len(axis.values) - 6} more' if len(axis.values) > 6 else ''}")
    duplicates = planned.written - planned.count
    if duplicates:
        lines.append(f"{format_count(duplicates, 'duplicate')} omitted")
    lines.extend(f"{count} excluded by the rule `{rule}`" for rule, count in forecast.failing.items())
    if forecast.looked_at < forecast.left:
        lines.append(f"in a sample of {forecast.looked_at} of the {forecast.left} remaining variants:")
    for code, count in sorted(forecast.unsound.items()):
        name, wrong = forecast.examples[code]
        lines.append(f"{count} would be rejected: {code} ({wrong.code.title}), first `{name}`: {wrong.message}")
    lines.append(f"models {format_count(forecast.parts - forecast.known, 'part')}, reuses {forecast.known}")
    for one in forecast.first:
        settings = {**one.parameters, **one.choices}
        shown = ", ".join(f"{name}={text}" for name, text in settings.items()) or "settings of the assembly"
        lines.append(f"  {one.id} {one.name}: {shown}{' (excluded)' if one.failed else ''}")
    if forecast.count > len(forecast.first):
        lines.append("  ...")
    return lines
