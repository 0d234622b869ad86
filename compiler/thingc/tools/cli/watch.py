"""Implementation of `thingc watch`, which builds a document after every save, until Ctrl-C.

Watches all inputs of the build: documents, part modules and the files that they read, materials, thingc.toml. If a save has errors,
they are reported and the last successful build remains. The CAD kernel is loaded once.

  thingc watch assemblies/arm.yaml
  thingc watch assemblies/arm.yaml --mode bench --emit mjcf
  thingc watch assemblies/arm.yaml --format json      print a line of JSON for each build
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence

from msgspec.structs import replace

from thingc.base.diagnostic_output import as_json
from thingc.base.diagnostics import Diagnostic, shown_path
from thingc.base.one_line_repr import format_count
from thingc.base.safe_text import json_text
from thingc.driver import pipeline
from thingc.driver.build_document import BuildRequest
from thingc.tools.cli import console, signals
from thingc.tools.cli.build import add_building, answer_of, chosen_targets, prepare_rendering, print_summary, wish_of
from thingc.tools.live.rebuild_loop import Rebuild, RebuildLoop


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc watch` to the parser."""
    console.add_document(parser)
    add_building(parser)
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc watch`, and return the exit code: 0 after Ctrl-C, 2 if there is nothing to watch."""
    try:
        live = live_of(arguments)
    except console.WrongCommandLine as fault:
        if arguments.format == "json":
            _say_line({"diagnostics": as_json([fault.diagnostic])})
            return console.USAGE
        return console.print_text([fault.diagnostic], stream=sys.stderr, debug=arguments.debug)
    return until_interrupted(live, Lines(arguments).say if arguments.format == "text" else say_json)


def live_of(arguments: argparse.Namespace) -> RebuildLoop:
    """Create a rebuild loop from the command-line arguments. Raises `WrongCommandLine` for an invalid argument."""
    console.require_document(arguments.document)
    options = console.options_of(arguments)
    targets, _ = chosen_targets(arguments)
    options = replace(options, ahead=pipeline.modules_of_build(targets))
    prepare_rendering(targets)

    def wish() -> BuildRequest | Sequence[Diagnostic]:
        targets, wrong = chosen_targets(arguments)
        return wrong or wish_of(arguments, targets)

    return RebuildLoop(arguments.document, options, wish, console.of_exception, console.say_waiting)


def until_interrupted(live: RebuildLoop, hear: Callable[[Rebuild], None]) -> int:
    """Run rebuilds until Ctrl-C or SIGTERM, and then stop the worker processes. Return the exit code."""
    signals.install_handlers(ignored=True)
    with contextlib.suppress(KeyboardInterrupt), live:
        for rebuild in live.rounds(threading.Event()):
            hear(rebuild)
            if hopeless(rebuild):
                return console.USAGE
    console.say_in_place()
    return 0


def hopeless(rebuild: Rebuild) -> bool:
    """Return whether the first rebuild failed because of an error in the command line, which the user cannot fix by saving a file."""
    return rebuild.number == 1 and console.exit_code(rebuild.diagnostics) == console.USAGE


def say_json(rebuild: Rebuild) -> None:
    """Print the result of a rebuild as one line of JSON. The object contains the keys of `thingc build --format json` and further keys."""
    folder, files = rebuild.folder or "", (rebuild.built and rebuild.built.files) or ()
    _say_line({
        "diagnostics": as_json(rebuild.diagnostics),
        "artifacts": [shown_path(os.path.join(folder, path)) for path in sorted(files)] if folder else [],
        "modelled": sorted(rebuild.modelled),
        "reused": [text for text in rebuild.built.compilation.reused if text not in rebuild.modelled] if rebuild.built else [],
        "round": rebuild.number, "good": rebuild.good, "saved": [shown_path(path) for path in rebuild.saved],
        "changed": [shown_path(os.path.join(folder, path)) for path in rebuild.changed],
        "seconds": round(rebuild.seconds, 4), "kernel": round(rebuild.kernel, 4),
    })


def _say_line(value: Mapping[str, object]) -> None:
    import json

    console.write_raw(json_text(json.dumps(value, ensure_ascii=False)) + "\n")
    sys.stdout.flush()


class Lines:
    """Prints new diagnostics and a one-line summary of each rebuild to standard error.

    `of` is the name of the document if it is not the document on the command line.
    """

    def __init__(self, arguments: argparse.Namespace, doing: str = "watching", of: str | None = None) -> None:
        self._doing = doing
        self._of = of
        self._arguments = arguments
        self._said: tuple[Diagnostic, ...] = ()
        self._built = False

    def say(self, rebuild: Rebuild) -> None:
        """Print the new diagnostics of a rebuild, and a one-line summary."""
        console.say_in_place()
        known = rebuild.good and rebuild.diagnostics == self._said
        if not known:
            console.print_text(rebuild.diagnostics, stream=sys.stderr, debug=self._arguments.debug)
        self._said = rebuild.diagnostics
        if rebuild.number > 1:
            saved = _enumerate([shown_path(path) for path in rebuild.saved])
            outcome = _outcome(rebuild) if self._built or not rebuild.good else f"built in {rebuild.seconds:.2f} s"
            stand = f"; {format_count(len(rebuild.diagnostics), 'warning')} unchanged" if known and rebuild.diagnostics else ""
            of = f"{self._of}, " if self._of is not None else ""
            console.say(f"{time.strftime('%H:%M:%S')} {saved}: {of}{outcome}{stand}", stream=sys.stderr)
        if rebuild.built is not None and rebuild.folder is not None and not self._built:
            print_summary(answer_of(rebuild.built, rebuild.folder), self._arguments)
        self._built = self._built or rebuild.good
        if rebuild.number == 1 and self._of is None and not hopeless(rebuild):
            console.say(f"{'' if rebuild.good else 'nothing built yet; '}{self._doing}; press Ctrl-C to stop", stream=sys.stderr)


def _outcome(rebuild: Rebuild) -> str:
    """Describe the result of a rebuild, for example which files were written."""
    if rebuild.built is None or not rebuild.good:
        return f"not built ({rebuild.seconds:.2f} s); {'the last successful build remains' if rebuild.kept else 'no successful build yet'}"
    modelled = sorted(rebuild.modelled.values())
    phrases = ["errors fixed"] if rebuild.recovered else []
    phrases += [f"modelled {_enumerate(modelled)}"] if modelled else []
    if rebuild.folder is not None:
        changed = f"{format_count(len(rebuild.changed), 'file')} changed ({_enumerate(rebuild.changed)})"
        phrases.append(changed if rebuild.changed else "no file changed")
    return f"{'; '.join(phrases) or 'compiled'} in {rebuild.seconds:.2f} s"


def _enumerate(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 3 else f"{', '.join(names[:2])} and {len(names) - 2} more"
