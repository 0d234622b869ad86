"""Implementation of `thingc explain`, which explains a diagnostic code with a wrong and a right example.

Without CODE, the command lists all codes.

  thingc explain TC302
  thingc explain 302
"""

from __future__ import annotations

import argparse

from thingc.tools.cli import console
from thingc.tools.reporting.explain import as_page, find, sections, similar_codes


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc explain` to the parser."""
    parser.add_argument("code", metavar="CODE", nargs="?", help="a diagnostic code such as TC302 (default: list all codes)")
    console.add_format(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc explain`, and return the exit code, which is 0 if the code exists, else 2."""
    if arguments.code is None:
        _list(arguments.format)
        return 0
    code = find(arguments.code)
    if code is None:
        close = ", ".join(f"`{one['code']}` ({one['title']})" for one in similar_codes(arguments.code))
        help = f"similar codes: {close}" if close else "run `thingc explain` for a list of codes"
        raise console.WrongCommandLine(f"there is no code `{arguments.code}`", help)
    if arguments.format == "json":
        console.print_data({key: value for key, value in code.items() if key != "name"})
    else:
        console.say(*as_page(code).removesuffix("\n").split("\n"))
    return 0


def _list(form: str) -> None:
    if form == "json":
        listed = [{key: code[key] for key in ("code", "title", "cure")} for _, codes in sections() for code in codes]
        console.print_data({"codes": listed})
        return
    for title, codes in sections():
        console.say(title, *(f"  {code['code']}  {code['title']}" for code in codes), "")
