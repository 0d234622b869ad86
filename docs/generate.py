"""Write the generated pages and parts of pages: `python docs/generate.py`.

`docs/diagnostics.md` lists all codes. Their pages, such as `docs/codes/TC302.md`, are written by hand, except for the last line
(`code_pages.py`). From the pages come the entries of `Code` in `base/diagnostics.py`, and the texts for `thingc explain` in
`compiler/thingc/tools/reporting/examples.json`.

The text between `<!-- generated: ... -->` and `<!-- /generated -->` comes from the kinds in `documents/checks/` in
`docs/language/tests.md`, from the capabilities of the targets in `docs/formats.md`, from their declarations in `docs/outputs/index.md`, and
from the parsers of the command line in `docs/commands/`. The JSON Schemas in `schemas/` come from the document models.
"""

from __future__ import annotations

import argparse
import inspect
import json
import os
import re
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, get_type_hints

from code_pages import CODES, current_codes, current_page, parse_page, path_of
from key_tables import key_tables
from schema_files import schema_files

from thingc.base.diagnostics import Code
from thingc.base.joints.kinds import KINDS
from thingc.documents.checks import kinds
from thingc.targets.artifact import MANIFEST
from thingc.targets.capabilities import Capabilities, Cell, Companion, Supported, joint_cell
from thingc.targets.registry import JOINT_ORDER, TARGETS
from thingc.tools.cli.main import COMMANDS, parser_for

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
PAGE = DOCS / "diagnostics.md"
FORMATS = DOCS / "formats.md"
OUTPUTS = DOCS / "outputs" / "index.md"
TESTS = DOCS / "language" / "tests.md"
COMMAND_PAGES = DOCS / "commands"
EXAMPLES = ROOT / "compiler" / "thingc" / "tools" / "reporting" / "examples.json"

GROUPS = {
    "joints": "joints", "of_joints": "properties of joints", "drives": "drives", "loops": "loops: type of the joint that is cut",
    "bases": "bases other than `fixed`", "modes": "properties of modes", "links": "properties of links", "shapes": "collision shapes",
    "sensors": "sensors", "of_sensors": "properties of sensors",
}
FEATURES = {
    "of_joints.cone": "limit of the rotation (`cone`)", "of_joints.velocity": "velocity limit", "of_joints.friction": "dry friction",
    "of_joints.delay": "delay of a drive", "of_joints.effects": "torque-speed line, deadband and noise of a drive",
    "loops.hold": "`hold` of a mount", "loops.weld": "`fixed`", "loops.ball": "`ball`", "loops.hinge": "a hinge",
    "loops.slide": "a slide", "loops.screw": "a screw", "loops.universal": "`universal`",
    "loops.several": "other joints with several coordinates", "bases.start": "start pose of a `free` base",
    "modes.exclude": "excluded contacts", "modes.pairs": "contact pairs", "modes.groups": "contact groups",
    "modes.simulation": "other `simulation` settings", "modes.timestep": "time step",
    "links.frames": "mounts and frames", "links.rolling": "rolling friction", "links.weightless": "a link without mass that a joint moves",
    "links.weightless_base": "other links without mass", "links.point": "a link that is a point mass",
    "links.line": "a link of point masses in a line", "shapes.hull": "convex mesh", "shapes.mesh": "mesh that is not convex",
}
for kind in KINDS.values():
    if kind.moves:
        key = f"joints.{joint_cell(kind)}"
        FEATURES[key] = f"{FEATURES[key]}, {kind.name}" if key in FEATURES else kind.name
"""Names of features on the page, if they differ from the key; for joints, the kinds with this form of motion."""

HEAD = """\
# Diagnostics

This page lists the codes of all errors, warnings and notes. A diagnostic shows the location of the problem, the expected value and the
value that was found. The `help` line describes how to fix the problem.

```yaml
# wrong.yaml
thingc: assembly/1
name: wrong
materials: [assemblies/materials.yaml]
components:
  plate: {part: arm:BasePlate, params: {siz: 120 mm}}
  board: {frame: true, mass: 12 g, at: {in: plat.origin}}
```

```console
$ thingc check wrong.yaml
error[TC305]: `arm:BasePlate` has no parameter `siz`
   --> wrong.yaml:6:41
  6 |   plate: {part: arm:BasePlate, params: {siz: 120 mm}}
    |                                         ^^^
  note: `arm:BasePlate` is defined here
...
  help: did you mean `size`?

error[TC302]: this document has no component `plat`
   --> wrong.yaml:7:45
  7 |   board: {frame: true, mass: 12 g, at: {in: plat.origin}}
    |                                             ^^^^^^^^^^^
  help: did you mean `plate`?

2 errors
```

One run reports as many errors as possible. Names, parts and masses are checked only if a document is well-formed and has no invalid
keys or values (TC1xx, TC2xx). Errors stop a build. Warnings stop a build only with `--strict`. For diagnostics as JSON, GitHub
annotations or SARIF, see [output of commands](outputs/json.md).

Each code has a page with an incorrect and a correct example. To print the page, use `thingc explain TC302` or `thingc explain 302`. To
list all codes, use `thingc explain`.

Codes are never reused or renumbered.
"""


def sections() -> dict[str, str]:
    """Return the topic of each hundred codes (`TC1`: `reading files`), from the comments in the source of `Code`."""
    found = re.findall(r"# --- (TC\d)xx: ([^()\n-]+?)(?: \([^)]*\))? -+$", inspect.getsource(Code), re.MULTILINE)
    return dict(found)


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


def examples(pages: Mapping[Path, str]) -> str:
    """What `thingc explain` reads: the sections, and the explanations of all codes."""
    codes: list[dict[str, Any]] = []
    for code in sorted(Code, key=lambda code: code.code):
        page = parse_page(pages[path_of(code)])
        explanation = {"code": code.code, "name": code.name, "title": code.title, "meaning": page.meaning, "cure": code.cure}
        codes.append({**explanation, "wrong": None, "right": None})
        for side, example in page.examples.items():
            codes[-1][side] = {"files": example.files, "command": example.command, "said": example.printed.rstrip("\n")}
    return json.dumps({"sections": sections(), "codes": codes}, indent=1, ensure_ascii=False) + "\n"


def generated() -> dict[Path, str]:
    """Return all generated files with their text."""
    pages = {path_of(code): current_page(code) for code in Code}
    own = {CODES: current_codes(), PAGE: page(), EXAMPLES: examples(pages), TESTS: tests(), FORMATS: formats(), OUTPUTS: outputs()}
    return {**own, **pages, **command_pages(), **schema_files()}


def formats() -> str:
    """Return the page of the formats with their tables."""
    tables = {name: import_module(target.capabilities).CAPABILITIES for name, target in TARGETS.items() if target.capabilities is not None}
    rows, notes = [f"| | {' | '.join(tables)} |", "|---" * (1 + len(tables)) + "|"], Notes()
    for group in get_type_hints(Capabilities):
        rows.append(f"| **{GROUPS[group]}** |{' |' * len(tables)}")
        rows += [
            f"| {FEATURES.get(f'{group}.{name}', name)} | {' | '.join(_said(table[group][name], notes) for table in tables.values())} |"
            for name in next(iter(tables.values()))[group]
        ]
    listed = [f"{number}. {words}" for words, number in notes.items()]
    return _marked(_read(FORMATS), {"formats": "\n".join([*rows, "", "Notes:", "", *listed])})


class Notes(dict[str, int]):
    """Numbers of the notes below a table, by their text."""

    def cell(self, answer: str, words: str) -> str:
        """Return a cell with an explanation (it may begin with `,` or `:`): up to two words in the cell, more as a note."""
        if len(words.lstrip(":, ").split()) < 3:
            return f"{answer}{words}"
        note = f"{answer}{words}" if words.startswith(",") else words.lstrip(": ")
        return f"{answer} <sup>{self.setdefault(note, len(self) + 1)}</sup>"


def outputs() -> str:
    """Return the page of build outputs with the table of targets. A description is written by hand, or else comes from the registry."""
    text = _read(OUTPUTS)
    written = dict(re.findall(r"^\| `(\w+)` \| (?:yes|no) \| [^|]*\| (.*) \|$", text, re.MULTILINE))
    rows = ["| Target | Default | Files | Description |", "|---|---|---|---|"]
    for name, target in TARGETS.items():
        files = dict.fromkeys(re.sub(r"/.*", "/", pattern) for pattern in target.writes)
        default = "yes" if target.unasked else "no"
        rows.append(f"| `{name}` | {default} | {', '.join(f'`{file}`' for file in files)} | {written.get(name, target.says)} |")
    return _marked(text, {"targets": "\n".join(rows), "build folder": "\n".join(["```", *_build_folder(), "```"])})


def _build_folder() -> list[str]:
    """Return the picture of the build folder: files with equal descriptions share a row."""
    files: dict[str, list[str]] = {}
    shared = {JOINT_ORDER: "order of joints in each format", MANIFEST: "hashes, mass sources and losses"}
    for described in [*(target.files for target in TARGETS.values()), shared]:
        for path, words in described.items():
            files.setdefault(words, []).append(path)
    return [f"{'  '.join(paths):28}{words}" for words, paths in files.items()]


def _said(cell: Cell[Any], notes: Notes) -> str:
    """Return a cell of a table of capabilities, with its explanation as a note."""
    if isinstance(cell, Companion):
        return "-"
    if isinstance(cell, Supported):
        return notes.cell("yes", f": {_cell(cell.how)}" if cell.how else "")
    return notes.cell(f"*{cell.how}*", _cell(cell.words))


def tests() -> str:
    """Return the page of tests with the table of all kinds of tests, and the tables of their keys. A new kind gets a section."""
    text = _read(TESTS)
    rows = ["<!-- keys: TestSpec -->", "| Key | Type | Default | Description |", "|---|---|---|---|"]
    for kind in kinds().values():
        rows.append(f"| `{kind.name}` | mapping | | {_cell(kind.summary[0].lower() + kind.summary[1:].removesuffix('.'))} |")
        if f"<!-- generated: {kind.name} -->" not in text:
            text += f"\n## {kind.name.replace('_', ' ').capitalize()}\n\n{inspect.getdoc(kind.model)}\n\n"
            text += f"<!-- generated: {kind.name} -->\n<!-- /generated -->\n"
    tables = {kind.name: key_tables(kind.model) for kind in kinds().values()}
    return _marked(text, {"kinds of tests": "\n".join(rows), **tables})


def command_pages() -> dict[Path, str]:
    """Return the pages of the commands. They are written by hand, except for the usage and the options. A new command gets a page without
    text.
    """
    pages = {}
    for command, summary in COMMANDS.items():
        path = COMMAND_PAGES / f"{command}.md"
        empty = f"# thingc {command}\n\n{summary[0].upper()}{summary[1:]}.\n\n<!-- generated: options -->\n<!-- /generated -->\n"
        pages[path] = _marked(_read(path) if path.exists() else empty, {"options": _options(command)})
    return pages


def _options(command: str) -> str:
    """Return the usage line of a command and the tables of its arguments and options."""
    parser = parser_for(command)[1]
    assert parser is not None, command
    actions = [action for action in parser._actions if action.help != argparse.SUPPRESS and action.dest != "help"]
    arguments = [action for action in actions if not action.option_strings]
    options = [action for action in actions if action.option_strings]
    words = ["thingc", command, "[OPTIONS]", *map(_argument, arguments)]
    lines = ["```", " ".join(words), "```"]
    for name, rows in (("Argument", arguments), ("Option", options)):
        if rows:
            lines += ["", f"| {name} | Default | Description |", "|---|---|---|", *(_option(parser, action) for action in rows)]
    return "\n".join(lines)


def _words(action: argparse.Action) -> list[str]:
    """Return the choices of an argument or an option."""
    return str(action.metavar).strip("{}").split(",") if str(action.metavar).startswith("{") else list(action.choices or ())


def _metavar(action: argparse.Action) -> str:
    """Return the placeholder of the value of an argument or an option; empty for a flag."""
    if action.nargs == 0:
        return ""
    named = action.metavar and not _words(action)
    return str(action.metavar) if named else re.sub(".*_", "", action.dest).upper()


def _argument(action: argparse.Action) -> str:
    """Return an argument in the syntax of a usage line: `[DOC]...`."""
    name = _metavar(action)
    return {"?": f"[{name}]", "*": f"[{name}]...", "+": f"{name}..."}.get(str(action.nargs), name)


def _option(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    """Return the row of an argument or an option."""
    *short, last = action.option_strings or [""]
    names = (*short, f"{last} {_metavar(action)}".strip())
    text = parser._get_formatter()._expand_help(action)
    found = re.search(r" \((?:(.*?)[;,] )?default: (.*)\)$", text)
    default = found[2].strip("'") if found else "required" if action.required and action.nargs not in ("?", "*") else ""
    if found:
        text = text[: found.start()] + (f" ({found[1]})" if found[1] else "")
    words = ", ".join(f"`{word}`" for word in _words(action))
    text = re.sub(r"(?<![`\w-])(--[a-z][\w-]*)", r"`\1`", text) + (f": {words}" if words else "")
    default = f"`{default or action.default}`" if (default or action.default) in _words(action) else default
    return f"| {', '.join(f'`{_cell(name)}`' for name in names)} | {_cell(default)} | {_cell(text)} |"


def _marked(text: str, parts: Mapping[str, str]) -> str:
    """Return a page with the generated parts between their marks."""
    for name, part in parts.items():
        marked = re.compile(rf"(?s)(<!-- generated: {name} -->\n).*?(<!-- /generated -->)")
        text = marked.sub(lambda found, part=part: f"{found[1]}{part}\n{found[2]}", text)
    return text


def page() -> str:
    """Return the page of all codes."""
    lines = [HEAD]
    titles = sections()
    for hundred in sorted({code.code[:3] for code in Code}):
        lines += [f"## {hundred}xx: {titles[hundred]}", "", "| Code | Meaning | Fix |", "|---|---|---|"]
        for code in sorted((code for code in Code if code.code.startswith(hundred)), key=lambda code: code.code):
            link = f"[{code.code}](codes/{code.code}.md)"
            lines.append(f"| {link} | {_cell(code.title)} | {_cell(code.cure)} |")
        lines.append("")
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    codes = current_codes()
    if codes != _read(CODES):
        CODES.write_text(codes, encoding="utf-8", newline="\n")
        os.execv(sys.executable, [sys.executable, *sys.argv])  # with the new codes
    files = generated()
    for path, text in files.items():
        path.write_text(text, encoding="utf-8", newline="\n")
    print(f"{len(Code)} codes, {len(files)} files")
