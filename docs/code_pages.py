"""Read and update the pages of diagnostic codes, such as `docs/codes/TC302.md`.

The explanation and the examples of a page are written by hand. An example is a sequence of files (each a line with the file name and a
fenced block), and a `console` block with a command and its output. The right example uses the files of the wrong example, except for files
that it replaces. The title, the fix and the last line are generated from `Code`. `REGENERATE=1 pytest tests/reporting/test_codes.py` writes
the output of the commands.
"""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from thingc.base.diagnostics import Code

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "docs" / "codes"
CASES = ROOT / "tests" / "cases"

_FILE = re.compile(r"^`([\w./]+)`(?: \(([\w-]+)\))?\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""A file: its name, its encoding if it is not UTF-8, and its text."""
_CONSOLE = re.compile(r"^```console\n\$ (thingc [^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LAST = re.compile(r"^`thingc explain .*\n\Z", re.MULTILINE)

NEW = """\
# CODE

Write one or two sentences here: what the code means, or when it is reported.

**Fix.**

## Wrong

`CODE.yaml`

```yaml
thingc: assembly/1
```

```console
$ thingc check CODE.yaml
```

## Right

`CODE.right.yaml`

```yaml
thingc: assembly/1
```

```console
$ thingc check CODE.right.yaml
```

`thingc explain CODE` prints this page.
"""


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
    head, *sections = re.split(r"^## (Wrong|Right)\n", text, flags=re.MULTILINE)
    meaning = " ".join(head.partition("\n**")[0].split("\n")[1:]).strip()
    examples = {name.lower(): _example(name, section) for name, section in zip(sections[::2], sections[1::2], strict=True)}
    return Page(meaning=meaning, examples=examples)


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
    """Return the page of a code with the current title and fix of `Code`, and the last line. A new code gets a template."""
    path = path_of(code)
    text = path.read_text(encoding="utf-8") if path.exists() else NEW.replace("CODE", code.code)
    used = [name for name in ("boxes", "failing") if re.search(rf"\b{name}:[A-Z]", text)]
    files = " and ".join(f"[`{name}.py`](../../tests/cases/parts/{name}.py)" for name in used)
    parts = f" The example uses {files}." if used else ""
    last = f"`thingc explain {code.code}` prints this page.{parts} [All codes](../diagnostics.md)\n"
    text = re.sub(r"\A# .*", lambda _: f"# {code.code}: {code.title}", text)
    text = re.sub(r"^\*\*Fix\.\*\*.*$", lambda _: f"**Fix.** {code.cure}", text, count=1, flags=re.MULTILINE)
    return _LAST.sub(lambda _: last, text)
