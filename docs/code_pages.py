"""Read and update the pages of diagnostic codes, such as `docs/codes/TC302.md`.

A page is written by hand, except for its last line, and the entries of `Code` are generated from the pages. Below the title, a comment
contains the name of the code and, for a code that can be a warning, the command that reports it: `<!-- Code.DENSITY, Stage.CHECK -->`. An
example is a sequence of files (each a line with the file name and a fenced block), and a `console` block with a command and its output. The
right example uses the files of the wrong example, except for files that it replaces. `REGENERATE=1 pytest tests/reporting/test_codes.py`
writes the output of the commands.
"""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from thingc.base.diagnostics import Code, Stage

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "docs" / "codes"
CODES = ROOT / "compiler" / "thingc" / "base" / "diagnostics.py"
CASES = ROOT / "tests" / "cases"
WIDTH = 140

_FILE = re.compile(r"^`([\w./]+)`(?: \(([\w-]+)\))?\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""A file: its name, its encoding if it is not UTF-8, and its text."""
_CONSOLE = re.compile(r"^```console\n\$ (thingc [^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LAST = re.compile(r"^`thingc explain .*\n\Z", re.MULTILINE)

_HEAD = re.compile(
    r"# (TC\d+): ([^\n]+)\n<!-- Code\.([A-Z]\w*)(?:, Stage\.(\w+))? -->\n\n(.*?)\n\n\*\*Fix\.\*\* ([^\n]+)\n", re.DOTALL,
)
"""The beginning of a page: its code, title, name, command, explanation and fix."""
_ENTRY = re.compile(r'^    [A-Z]\w* = \(\s*"(TC\d+)",(?: .*\)|.*\n(?:        .*\n)*    \))\n', re.MULTILINE)
"""An entry of `Code`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """An example: its files by name, the encodings of files that are not UTF-8, its command, and the output of the command."""

    files: dict[str, str]
    encodings: dict[str, str]
    command: str
    printed: str

    @property
    def document(self) -> str:
        """The document in the command, or `robot.yaml`."""
        return next((word for word in self.command.split() if word.endswith((".yaml", ".toml"))), "robot.yaml")


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """The hand-written parts of a page. Codes that no document can cause have no examples."""

    meaning: str
    examples: dict[str, Example]


def path_of(code: Code) -> Path:
    """Return the page of a code."""
    return PAGES / f"{code.code}.md"


def read_page(code: Code) -> Page:
    """Return the parts of the page of a code."""
    return parse_page(path_of(code).read_text(encoding="utf-8"))


def parse_page(text: str) -> Page:
    """Return the parts of a page, with the examples by `wrong` and `right`."""
    _, *sections = re.split(r"^## (Wrong|Right)\n", text, flags=re.MULTILINE)
    examples = {name.lower(): _example(name, section) for name, section in zip(sections[::2], sections[1::2], strict=True)}
    return Page(meaning=_head(text)[5].replace("\n", " "), examples=examples)


def _head(text: str) -> re.Match[str]:
    """Return the match of `_HEAD` at the beginning of a page."""
    found = _HEAD.match(text)
    assert found is not None, f"`{text[:40]}...` must begin with `# CODE: TITLE`, `<!-- Code.NAME -->`, an explanation and `**Fix.** ...`"
    return found


def _example(name: str, section: str) -> Example:
    """Return the example of a section of a page."""
    found = _FILE.findall(section)
    console = _CONSOLE.search(section)
    assert console is not None, f"`## {name}` has no console block with a line `$ thingc ...`"
    return Example(
        files={file: text for file, _, text in found}, encodings={file: encoding for file, encoding, _ in found if encoding},
        command=console[1], printed=console[2],
    )


def unpack(page: Page, side: str, folder: Path) -> None:
    """Write the files of an example to a new folder. Without a `thingc.toml`, use the one of `tests/cases` and the parts there."""
    examples = [page.examples["wrong"]] if side == "wrong" else [page.examples["wrong"], page.examples["right"]]
    folder.mkdir()
    if all("thingc.toml" not in example.files for example in examples):
        shutil.copy(CASES / "thingc.toml", folder)
        shutil.copytree(CASES / "parts", folder / "parts", ignore=shutil.ignore_patterns("__pycache__"))
    for example in examples:
        for name, text in example.files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding=example.encodings.get(name, "utf-8"))


def with_output(text: str, example: Example, printed: str) -> str:
    """Return the text of a page with another output of the command of an example."""
    before, after = (f"```console\n$ {example.command}\n{output}```\n" for output in (example.printed, printed))
    return text.replace(before, after, 1)


def current_page(code: Code) -> str:
    """Return the page of a code with its current last line."""
    text = path_of(code).read_text(encoding="utf-8")
    used = [name for name in ("boxes", "failing") if re.search(rf"\b{name}:[A-Z]", text)]
    files = " and ".join(f"[`{name}.py`](../../tests/cases/parts/{name}.py)" for name in used)
    parts = f" The example uses {files}." if used else ""
    return _LAST.sub(lambda _: f"`thingc explain {code.code}` prints this page.{parts} [All codes](../diagnostics.md)\n", text)


def current_codes() -> str:
    """Return the source of `Code` with the entries that the pages define. A new entry follows the entry with the next lower number."""
    entries = {path.stem: _entry(path.read_text(encoding="utf-8")) for path in sorted(PAGES.glob("TC*.md"))}
    wrong = [code for code, entry in entries.items() if f'"{code}"' not in entry]
    assert wrong == [], f"the titles of {wrong} in docs/codes contain other codes"
    names = {entry.split()[0] for entry in entries.values()}
    assert len(names) == len(entries), "two pages in docs/codes have the same `Code.NAME`"
    text = _ENTRY.sub(lambda found: entries.get(found[1], ""), CODES.read_text(encoding="utf-8"))
    for previous, code in pairwise(entries):
        if entries[code] not in text:
            text = text.replace(entries[previous], entries[previous] + entries[code])
    return text


def _entry(text: str) -> str:
    """Return the entry of `Code` that a page defines. Raises KeyError if `Stage` does not contain the command."""
    found = _head(text)
    code, title, fix = (json.dumps(text, ensure_ascii=False) for text in found.group(1, 2, 6))
    last = f"{fix}, Stage.{Stage[found[4]].name}" if found[4] else fix
    entry = f"    {found[3]} = ({code}, {title}, {last})\n"
    return entry if len(entry) <= WIDTH + 1 else f"    {found[3]} = (\n        {code}, {title},\n        {last},\n    )\n"
