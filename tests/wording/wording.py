"""Find phrases in docs, messages and docstrings that are not plain English.

    .venv/bin/python tests/wording/wording.py [FILE...]

prints the findings in these files, or in all, one on a line.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]

BANNED = {
    "`is no`: write `is not a`, or `there is no`": r"(?<!there )(?<!There )\b(is|are|was|were) no (?!longer|more|less|fewer|other)\w",
    "leading `Of`: begin with the subject": r"(?:^|(?<=[.:;] ))Of (?!course)\w+",
    "`said`, `told`, `kept`, `asked`: write `reported`, `shown`, `cached`, `stored`, `requested`":
        r"\b(is|are|was|were|be|been|being)( (all|also|both|never|not|only|still|then))? (said|told|kept|asked)\b",
    "`what it says`, `what a part has`: name the thing":
        r"\b[Ww]hat (it|they|of|(the|a|an|each|every) [\w-]+) (says?|tells?|knows?|wants?|has|have|takes?)\b",
    "`nobody`, `whoever`, `whence`: name the user, the program or the source": r"\b([Nn]obody|[Ww]hoever|[Ww]hence)\b",
    "`None where`, `where there is`: write `if`":
        r"\b(None|none) where\b|\bwhere there (is|are)\b|\bwhere (it|they) (has|have) (one|none|it)\b",
    "`all else`, `for what it is`": r"\ball else\b|\bfor what it is\b|\bis to be had\b",
    "`mend`: write `fix`": r"\bmend(s|ed|ing)?\b",
    "`told apart`: write `distinguished`": r"\b(told|tell|tells) apart\b",
    "`stands in`: write `is in`": r"\b(it|they|which|that|file|document|name|key) stands?\b",
    "`says`, `tells`, `knows`, `wants` of a thing: write `reports`, `shows`, `specifies`, `requires`":
        r"\b(file|document|page|model|mode|joint|part|table|lock|record|robot|schema|message|compiler|thingc|MuJoCo|it)"
        r" (says|tells|knows|wants)\b",
}
"""Patterns, each with the suggested replacement."""

PYTHON = ("compiler/thingc", "parts", "examples", "benchmarks", "docs", "gate")
"""Folders whose docstrings and messages are checked."""

OTHERS = (
    "viewer/src/**/*.ts", "compiler/thingc/**/*.js", "compiler/thingc/**/*.html", "compiler/thingc/tools/templates/**/*.yaml", "gate/*.sh",
    "action.yml", ".pre-commit-hooks.yaml", "editors/vscode/package.json", "editors/vscode/src/*.ts",
)
"""Files in other languages."""

LONGEST = 30
"""The largest number of words of a sentence in the docs."""


class Text(NamedTuple):
    """A text for readers: its area, its file with the line, and the words."""

    area: str
    place: str
    words: str


class Finding(NamedTuple):
    """A place that a rule rejects."""

    area: str
    place: str
    rule: str
    words: str


def pages() -> list[Path]:
    """Return the pages that are written by people. Pages of diagnostic codes are generated from messages."""
    named = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "SECURITY.md")]
    docs = [page for page in (ROOT / "docs").rglob("*.md") if page.parent.name != "codes" and page.name != "diagnostics.md"]
    return sorted(page for page in (*named, *docs) if page.exists())


def prose(page: Path) -> Iterator[Text]:
    """Return the paragraphs, list items and table cells of a page, without code, pictures and the targets of links."""
    area, fenced, begin = page.relative_to(ROOT).as_posix(), False, 0
    lines = _without_options(page.read_text()).splitlines()
    paragraph: list[str] = []
    for number, line in enumerate((*lines, ""), 1):
        fence = line.lstrip().startswith(("```", "~~~"))
        item = re.match(r"\s*([-*] |\d+\. |\||#|<!--|$)", line)
        if (fence or fenced or item) and paragraph:
            yield Text(area, f"{area}:{begin}", " ".join(paragraph))
            paragraph = []
        fenced ^= fence
        if fence or fenced or not line.strip():
            continue
        if line.startswith("|"):
            yield from (Text(area, f"{area}:{number}", _plain(cell)) for cell in line.strip("|").split("|"))
        elif not line.startswith("<"):
            begin = begin if paragraph else number
            paragraph.append(_plain(line))


def _without_options(text: str) -> str:
    """Return a page with empty lines in place of the options of a command. Their texts are counted as messages in the code."""
    options = r"(?s)<!-- generated: options -->.*?<!-- /generated -->"
    return re.sub(options, lambda found: "\n" * found[0].count("\n"), text)


def _plain(line: str) -> str:
    line = re.sub(r"!\[[^\]]*\]\([^)]*\)|\]\([^)]*\)|<[^>]*>", " ", line)
    return re.sub(r"`[^`]*`", "`code`", line).strip().lstrip("-*#0123456789. [")


def code(path: Path) -> Iterator[Text]:
    """Return the docstrings of a module, and its other texts with at least three words, which are messages and helps."""
    tree = ast.parse(path.read_text())
    place = path.relative_to(ROOT).as_posix()
    room = place.removeprefix("compiler/thingc/").partition("/")[0].removesuffix(".py")
    docs: set[int] = set()
    nodes: list[ast.AST] = [tree]
    for node in nodes:  # an expression comes before its constant; `ast.walk` takes twice as long
        if isinstance(node, ast.Expr):
            docs.add(id(node.value))
        if not isinstance(node, ast.Constant):
            for value in vars(node).values():
                if isinstance(value, ast.AST):
                    nodes.append(value)
                elif isinstance(value, list):
                    nodes += [inner for inner in value if isinstance(inner, ast.AST)]
        elif isinstance(node.value, str) and len(node.value.split()) >= 3:
            kind = "docstrings" if id(node) in docs else "messages"
            yield Text(f"{room} {kind}", f"{place}:{node.lineno}", " ".join(node.value.split()))


def lines(path: Path) -> Iterator[Text]:
    """Return the lines of a file in another language. The rules do not match code, so code is not distinguished from comments and
    strings."""
    place = path.relative_to(ROOT).as_posix()
    yield from (Text(place, f"{place}:{number}", line.strip()) for number, line in enumerate(path.read_text().splitlines(), 1))


def texts() -> Iterator[Text]:
    """Return all texts to which the rules apply."""
    for page in pages():
        yield from prose(page)
    for folder in PYTHON:
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield from code(path)
    for pattern in OTHERS:
        for path in sorted(ROOT.glob(pattern)):
            yield from lines(path)


def findings(text: Text) -> Iterator[Finding]:
    """Return the findings of the rules in a text."""
    for rule, pattern in BANNED.items():
        yield from (Finding(text.area, text.place, rule, found[0]) for found in re.finditer(pattern, text.words))
    if text.area.endswith(".md"):
        for sentence in re.split(r"(?<=[.!?:;])\s", text.words):
            if (count := len(sentence.split())) > LONGEST:
                yield Finding(text.area, text.place, f"a sentence of more than {LONGEST} words", f"{count} words: {sentence[:60]} ...")


def main() -> None:
    chosen = [Path(name).resolve().relative_to(ROOT).as_posix() for name in sys.argv[1:]]
    for text in texts():
        for one in findings(text) if not chosen or text.place.rpartition(":")[0] in chosen else ():
            print(f"{one.place}: {one.words!r}: {one.rule}")


if __name__ == "__main__":
    main()
