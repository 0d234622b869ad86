"""Implementation of `thingc set`, which sets the values at given paths of a document, and preserves comments and layout.

A path has the same form as in the option --set of other commands. For a parameter of the document, write its name, or parameters.NAME.
If the document would have errors, nothing is written.

  thingc set assemblies/arm.yaml 'joints.elbow.limit.upper=90 deg' 'reach=120 mm'
  thingc set robot.yaml components.foot.part=feet:Wide
  thingc set robot.yaml 'components.plate.mass=82 g' --diff      show the change, write nothing
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from thingc.base.diagnostic_output import OPTIONS
from thingc.base.diagnostics import Diagnostic, shown_path
from thingc.driver.edit_document import EditResult, parameter_name, write_values
from thingc.driver.environment import Options
from thingc.tools.cli import console


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc set` to the parser."""
    parser.set_defaults(stdout_errors=True)
    parser.add_argument("document", metavar="DOC", help="an assembly document (YAML or TOML)")
    parser.add_argument("value", metavar="PATH=VALUE", nargs="+", help="path or parameter, and its new value")
    console.add_no_code(parser)
    console.add_editing(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc set`, and return the exit code, which is 0 if the values were written (with `--diff`: can be written)."""
    console.require_document(arguments.document)
    options, values = replace(console.options_of(arguments), code=not arguments.no_code), settings(arguments.value)
    for keys in (path.split(".") for path in values):
        if keys[0] == "joints" and keys[2:] == ["zero"]:
            help = f"to move the zero of the joint, use `thingc rezero {arguments.document} '{keys[1]}={values['.'.join(keys)]}'`"
            raise console.WrongCommandLine("a joint has no key `zero`", help)
    return write(arguments.document, values, options, arguments, diff=arguments.diff)


def settings(words: Sequence[str]) -> dict[str, str]:
    """Convert the arguments `PATH=VALUE` to a mapping from paths to values. Raises `WrongCommandLine` for an invalid argument."""
    for first, word in enumerate(words[1:]):
        if "=" not in word and "=" in words[first]:  # the shell split the value
            value = " ".join([words[first], *itertools.takewhile(lambda one: "=" not in one, words[first + 1 :])])
            raise console.WrongCommandLine(f"expected PATH=VALUE, found `{word}`", f"quote a value that contains spaces: '{value}'")
    return console.paths(words, "PATH=VALUE", "'joints.elbow.limit.upper=90 deg'", "`{}` is set twice", parameter_name)


def write(document: str, values: Mapping[str, str], options: Options, arguments: argparse.Namespace, *, diff: bool = False) -> int:
    """Write new values to a document, unless the changed document has errors. Return the exit code.

    `values` maps paths or names of parameters to values as strings. `arguments` must have the attributes `format` and `debug`, and can have
    the attribute `strict`.
    """
    typed = {parameter_name(path): f"{path}={text}" for path, text in values.items()}
    outcome = write_values(document, values, options, strict=getattr(arguments, "strict", False), dry=diff)
    return report_edit(replace(outcome, found=tuple(_as_typed(one, typed) for one in outcome.found)), arguments, diff=diff)


def report_edit(outcome: EditResult, arguments: argparse.Namespace, *, diff: bool) -> int:
    """Print the diagnostics and the changes of documents, and return the exit code. With `diff`, print the difference of the texts."""
    wrong = console.exit_code(outcome.found)
    if arguments.format == "text" and diff and not wrong:
        for document, text in outcome.changed:
            console.say_diff(shown_path(document.path), document.text, text)
        return wrong
    if arguments.format == "text":
        for path, old, new in outcome.done:
            console.say(f"{path}: {'' if old is None else old + ' -> '}{new}")
        if outcome.done and outcome.found:
            console.say("")
    texts = {one.path: text for one, text in outcome.changed} if wrong else None
    changes = [{"path": path, "before": old, "after": new} for path, old, new in outcome.done]
    return console.print_found(outcome.found, arguments.format, stream=sys.stdout, debug=arguments.debug, texts=texts, set=changes)


def _as_typed(diagnostic: Diagnostic, typed: Mapping[str, str]) -> Diagnostic:
    """Replace the option `-p` or `--set` in the location of a diagnostic by the argument on the command line."""
    option = next((option for option in OPTIONS if diagnostic.path is not None and diagnostic.path.startswith(option)), None)
    if option is None or diagnostic.path is None:
        return diagnostic
    path = diagnostic.path.removeprefix(option).partition("=")[0]
    return replace(diagnostic, path=f"set {typed.get(path, path)}")
