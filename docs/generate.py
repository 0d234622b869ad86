"""Writes the pages of the diagnostics, what `thingc explain` shows of them, the kinds of tests in `language/tests.md`, and the table of
`formats.md`: `python docs/generate.py`.

From the closed set of codes, the sentences of `docs/codes/meanings.toml` and the examples of `tests/cases/codes` it makes
`docs/diagnostics.md`, a page `docs/codes/TC302.md` for every code, and `compiler/thingc/tools/reporting/examples.json`.

The wrong example of a code is a case: `TC302.yaml` with what is said of it in `TC302.txt`. The right one is `TC302.right.yaml`.
Where an example needs a workspace of its own they are `TC120/wrong/robot.yaml` and `TC120/right/robot.yaml`.

The text between `<!-- generated: ... -->` and `<!-- /generated -->` comes from the files of `documents/checks/` in
`docs/language/tests.md`, from the capabilities of the targets in `docs/formats.md`, and from the parsers of the command line in
`docs/commands/`.
"""

from __future__ import annotations

import argparse
import inspect
import json
import re
import shlex
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, get_type_hints

from thingc.base.diagnostics import Code
from thingc.base.joints.kinds import KINDS
from thingc.documents.checks import kinds
from thingc.targets.capabilities import Capabilities, Cell, Companion, Supported, joint_cell
from thingc.targets.registry import TARGETS
from thingc.tools.cli.main import COMMANDS, parser_for

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
PAGE = DOCS / "diagnostics.md"
FORMATS = DOCS / "formats.md"
TESTS = DOCS / "language" / "tests.md"
COMMAND_PAGES = DOCS / "commands"
MEANINGS = DOCS / "codes" / "meanings.toml"
CASES = ROOT / "tests" / "cases" / "codes"
EXAMPLES = ROOT / "compiler" / "thingc" / "tools" / "reporting" / "examples.json"
SUFFIXES = ("yaml", "toml")

GROUPS = {
    "joints": "joints", "of_joints": "properties of joints", "drives": "drives", "loops": "loops, by the joint that is cut",
    "bases": "bases, besides `fixed`", "modes": "properties of modes", "links": "properties of links", "shapes": "collision shapes",
    "sensors": "sensors", "of_sensors": "properties of sensors",
}
FEATURES = {
    "of_joints.cone": "`limit: {cone: ...}`", "of_joints.velocity": "velocity limit", "of_joints.friction": "dry friction",
    "loops.hold": "`hold` of a mount", "loops.weld": "`fixed`", "loops.ball": "`ball`", "loops.hinge": "a hinge",
    "loops.slide": "a slide", "loops.screw": "a screw", "loops.universal": "`universal`",
    "loops.several": "several coordinates", "bases.start": "start pose of a `free` base",
    "modes.exclude": "excluded contacts", "modes.simulation": "other `simulation`", "modes.timestep": "time step",
    "links.frames": "mounts and frames", "links.rolling": "rolling friction", "links.weightless": "no mass, moved by a joint",
    "links.weightless_base": "no mass, others", "links.point": "a point mass", "links.line": "point masses in a line",
    "shapes.hull": "convex mesh", "shapes.mesh": "any mesh",
}
for kind in KINDS.values():
    if kind.moves:
        key = f"joints.{joint_cell(kind)}"
        FEATURES[key] = f"{FEATURES[key]}, {kind.name}" if key in FEATURES else kind.name
"""Names of features on the page, if they differ from the key; for joints, the kinds with this form of motion."""

HEAD = """\
# Diagnostics

Everything that thingc can say is wrong. A message names the place, what was expected and what was found; its `help` says what to
type next.

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
  note: `arm:BasePlate` is written here
...
  help: did you mean `size`?

error[TC302]: this document has no component `plat`
   --> wrong.yaml:7:45
  7 |   board: {frame: true, mass: 12 g, at: {in: plat.origin}}
    |                                             ^^^^^^^^^^^
  help: did you mean `plate`?

2 errors
```

Several faults are said in one run. A document that is not well-formed, or whose keys and values are wrong (TC1xx, TC2xx), is
mended first: names, parts and masses are looked at when it is right. Errors end a build. Warnings do not, unless `--strict` is
given. How all this looks in JSON, as annotations of GitHub and in SARIF is in [outputs](outputs/json.md).

Each code has a page with a wrong and a right example; `thingc explain TC302` prints it (`thingc explain 302` does, too), and
`thingc explain` lists all codes.

Codes are never used twice and never renumbered.
"""


def sections() -> dict[str, str]:
    """What each hundred is about (`TC1`: `reading files`), from the comments in the source of `Code`."""
    found = re.findall(r"# --- (TC\d)xx: ([^()\n-]+?)(?: \([^)]*\))? -+$", inspect.getsource(Code), re.MULTILINE)
    return dict(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """A document, the files it needs by name (itself first), the command that was run on it, and what that printed."""

    files: dict[str, str]
    command: str
    said: str


def example(code: Code, side: str) -> Example | None:
    """The `wrong` or the `right` example of a code, or None where `tests/cases/codes` has none."""
    stem = code.code if side == "wrong" else f"{code.code}.right"
    names = (*(f"{stem}.{suffix}" for suffix in SUFFIXES), f"{code.code}/{side}/robot.yaml")
    document = next((path for name in names for path in CASES.glob(f"*/{name}")), None)
    if document is None or not document.with_suffix(".txt").exists():
        return None
    text = _read(document)
    files = {document.name: text}
    for path in sorted(document.parent.iterdir()):
        own = document.parent.name == side and path.suffix in (".py", ".toml")
        if own or (path.name.startswith("_") and path.name in text):
            files[path.name] = _read(path)
    first = re.match(r"# \$ (thingc .*)", text)
    said = document.with_suffix(".txt").read_text(encoding="utf-8")
    return Example(
        files=files, command=first.group(1) if first else f"thingc check {document.name}",
        said=re.sub(r"exit \d+\n$", "", said).rstrip("\n"),
    )


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


@cache
def meanings() -> Mapping[str, str]:
    """What each code means, by code."""
    return {code: str(text) for code, text in tomllib.loads(MEANINGS.read_text(encoding="utf-8")).items()}


def code_page(code: Code, meaning: str | None) -> str:
    """The page of one code."""
    lines = [f"# {code.code}: {code.title}", ""]
    lines += [meaning, ""] if meaning else []
    lines += [f"**Cure.** {code.cure}", ""]
    wrong, right = example(code, "wrong"), example(code, "right")
    if wrong is not None:
        lines += ["## Wrong", "", *_files(wrong), "```console", f"$ {wrong.command}", wrong.said, "```", ""]
    if right is not None:
        lines += ["## Right", "", *_files(right)]
        if not _is_plain(right.command):
            lines += ["```console", f"$ {right.command}", right.said, "```", ""]
    texts = "".join(text for one in (wrong, right) if one is not None for text in one.files.values())
    parts = sorted({module for module in ("boxes", "failing") if f"{module}:" in texts})
    if parts:
        named = " and ".join(f"[`{module}`](../../tests/cases/parts/{module}.py)" for module in parts)
        lines += [f"The parts come from {named}, small parts for examples.", ""]
    lines += [f"`thingc explain {code.code}` prints this page. [All codes](../diagnostics.md)", ""]
    return "\n".join(lines)


def _is_plain(command: str) -> bool:
    """Whether a command is nothing but the check of one document."""
    return len(shlex.split(command)) == 3 and command.startswith("thingc check ")


def _files(one: Example) -> list[str]:
    lines = []
    for name, text in one.files.items():
        language = {"py": "python", "toml": "toml"}.get(name.rpartition(".")[2], "yaml")
        lines += [f"`{name}`", "", f"```{language}", text.rstrip("\n"), "```", ""]
    return lines


def examples() -> str:
    """What `thingc explain` reads: the sections, and by code the meaning and the two examples."""
    told = meanings()
    codes = {}
    for code in sorted(Code, key=lambda code: code.code):
        sides = {side: example(code, side) for side in ("wrong", "right")}
        codes[code.code] = {"meaning": told.get(code.code), **{side: asdict(one) if one else None for side, one in sides.items()}}
    return json.dumps({"sections": sections(), "codes": codes}, indent=1, ensure_ascii=False) + "\n"


def generated() -> dict[Path, str]:
    """Every file that is made here, with its text."""
    told = meanings()
    pages = {DOCS / "codes" / f"{code.code}.md": code_page(code, told.get(code.code)) for code in Code}
    return {PAGE: page(), EXAMPLES: examples(), TESTS: tests(), FORMATS: formats(), **pages, **command_pages()}


def formats() -> str:
    """The page of the formats, with their tables."""
    tables = {name: import_module(target.capabilities).CAPABILITIES for name, target in TARGETS.items() if target.capabilities is not None}
    rows = [f"| | {' | '.join(tables)} |", "|---" * (1 + len(tables)) + "|"]
    for group in get_type_hints(Capabilities):
        rows.append(f"| **{GROUPS[group]}** |{' |' * len(tables)}")
        rows += [
            f"| {FEATURES.get(f'{group}.{name}', name)} | {' | '.join(_said(table[group][name]) for table in tables.values())} |"
            for name in next(iter(tables.values()))[group]
        ]
    return _marked(_read(FORMATS), {"formats": "\n".join(rows)})


def _said(cell: Cell[Any]) -> str:
    """A cell of a table of capabilities, for people."""
    if isinstance(cell, Companion):
        return "-"
    if isinstance(cell, Supported):
        return f"yes: {_cell(cell.how)}" if cell.how else "yes"
    return f"*{cell.how}*{_cell(cell.words)}"


def tests() -> str:
    """The page of tests, with the texts of all kinds of tests."""
    rows = ["<!-- keys: TestSpec -->", "| Key | Type | Default | Description |", "|---|---|---|---|"]
    for kind in kinds().values():
        rows.append(f"| `{kind.name}` | mapping | | {_cell(kind.summary[0].lower() + kind.summary[1:].removesuffix('.'))} |")
    parts = {"kinds of tests": "\n".join(rows), "pages of tests": "\n\n".join(kind.page.strip("\n") for kind in kinds().values())}
    return _marked(_read(TESTS), parts)


def command_pages() -> dict[Path, str]:
    """Return the page of each command: written by hand, except for the usage and the options. A new command gets a page without text."""
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
    """Return the words between which an argument or an option chooses."""
    return str(action.metavar).strip("{}").split(",") if str(action.metavar).startswith("{") else list(action.choices or ())


def _metavar(action: argparse.Action) -> str:
    """Return the placeholder of the value of an argument or an option; empty for a flag."""
    if action.nargs == 0:
        return ""
    named = action.metavar and not _words(action)
    return str(action.metavar) if named else re.sub(".*_", "", action.dest).upper()


def _argument(action: argparse.Action) -> str:
    """Return an argument as in a usage line: `[DOC]...`."""
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
    """A page with the parts that are made here between their marks."""
    for name, part in parts.items():
        marked = re.compile(rf"(?s)(<!-- generated: {name} -->\n).*?(<!-- /generated -->)")
        text = marked.sub(lambda found, part=part: f"{found[1]}{part}\n{found[2]}", text)
    return text


def page() -> str:
    """The whole page."""
    lines = [HEAD]
    titles = sections()
    for hundred in sorted({code.code[:3] for code in Code}):
        lines += [f"## {hundred}xx: {titles[hundred]}", "", "| code | | cure |", "|---|---|---|"]
        for code in sorted((code for code in Code if code.code.startswith(hundred)), key=lambda code: code.code):
            link = f"[{code.code}](codes/{code.code}.md)"
            lines.append(f"| {link} | {_cell(code.title)} | {_cell(code.cure)} |")
        lines.append("")
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    files = generated()
    for stale in set((DOCS / "codes").glob("TC*.md")) - set(files):
        stale.unlink()
    for path, text in files.items():
        path.write_text(text, encoding="utf-8", newline="\n")
    print(f"{len(Code)} codes, {len(files)} files")
