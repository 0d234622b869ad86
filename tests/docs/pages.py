"""The pages of the documentation as what they say: fenced blocks, tables, links; and a page as a workspace on disk."""

from __future__ import annotations

import atexit
import contextlib
import io
import json
import math
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from thingc.tools.cli.main import main
from xla_flags import XLA_FLAGS

ROOT = Path(__file__).resolve().parents[2]
LANGUAGE = ROOT / "docs" / "language"
TUTORIALS = ROOT / "docs" / "tutorials"
OUTPUTS = ROOT / "docs" / "outputs"
COMMAND_PAGES = ROOT / "docs" / "commands"
NAMES = ("", "concepts", "language", "outputs", "commands", "import", "studies", "howto", "from", "tutorials")
FOLDERS = tuple(ROOT / "docs" / name for name in NAMES)
PAGES = (*(page for folder in FOLDERS for page in sorted(folder.glob("*.md"))), ROOT / "README.md", ROOT / "CONTRIBUTING.md")
DECISIONS = ROOT / "docs" / "decisions"
WITH_LINKS = (*PAGES, *sorted(DECISIONS.glob("*.md")), ROOT / "ARCHITECTURE.md")

_FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"(?:# ([\w/.]+\.(?:yaml|toml|py))|<!-- ([\w/]+\.(?:urdf|xml)) -->)$")
_PROGRESS = re.compile(r"^((modelling|decomposing|slicing) parts: .*|\d+ of \d+ variants \(.*\); .* a second.*)\n", re.MULTILINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A fenced block: its language, its text, the file that its first line names (`# parts/toy.py`), and its line in the page."""

    language: str
    text: str
    file: str | None
    line: int


def blocks(page: Path) -> list[Block]:
    text = page.read_text()
    found = []
    for match in _FENCE.finditer(text):
        first = match.group(2).partition("\n")[0]
        named = _FILE.match(first)
        line = text.count("\n", 0, match.start()) + 1
        found.append(Block(language=match.group(1), text=match.group(2), file=named[1] or named[2] if named else None, line=line))
    return found


def documents(page: Path) -> list[Block]:
    """The blocks that are documents: their first line but comments is the `thingc` key."""
    return [
        block for block in blocks(page)
        if block.language in ("yaml", "toml") and re.match(r"(#[^\n]*\n)*\s*thingc\s*[:=]", block.text)
    ]


def meant_to_be_wrong(block: Block) -> bool:
    """A document that shows what is said of a wrong one; the page shows the command that says it."""
    return block.file is not None and block.file.startswith("wrong")


def without_fences(page: Path) -> str:
    return _FENCE.sub("", page.read_text())


def paragraphs(page: Path) -> list[str]:
    """The paragraphs and list items outside fences and tables, each on one line."""
    text = re.sub(r"(?<=[^\n])\n +(?=[^\s\-\d])|(?<=[^\n|])\n(?=[^\s|#\-<`\d])", " ", without_fences(page))
    return text.split("\n")


def table(page: Path, marker: str) -> list[list[str]]:
    """Return the rows (without the heading) of the table that follows the comment `<!-- marker -->` on a page.

    For a folder, exactly one of its pages must have the table.
    """
    text = page.read_text() if page.is_file() else "\n".join(one.read_text() for one in sorted(page.glob("*.md")))
    comment = f"<!-- {marker} -->\n"
    assert text.count(comment) == 1, f"{page.name} has {text.count(comment)} x {comment!r}"
    lines = text.partition(comment)[2].split("\n")
    rows = []
    for line in lines[2:]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line.strip("|"))])
    return rows


def anchors(page: Path) -> set[str]:
    """The anchors of the headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", without_fences(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def unpack(page: Path, folder: Path) -> Path:
    """Write the files that a page shows before it leaves to a folder, beside copies of the repository's documents and of its `arm.py`.

    The pages of the language share their files: a document on one page may use a part or a document that another page shows. A tutorial
    starts in an empty folder.
    """
    if page.parent != TUTORIALS:
        _copy_workspace(page, folder)
    for shown in sorted(LANGUAGE.glob("*.md")) if page.parent == LANGUAGE else [page]:
        for block in blocks(shown):
            if block.file is not None and block.line < leaves(shown):
                (folder / block.file).parent.mkdir(parents=True, exist_ok=True)
                (folder / block.file).write_text(block.text)
    return folder


def _copy_workspace(page: Path, folder: Path) -> None:
    shutil.copytree(ROOT / "assemblies", folder / "assemblies")
    if any(" gallery/" in command for command, _ in commands(page)):
        shutil.copytree(ROOT / "gallery", folder / "gallery", ignore=shutil.ignore_patterns("build", "__pycache__"))
    (folder / "parts").mkdir()
    shutil.copy(ROOT / "parts" / "arm.py", folder / "parts")
    shutil.copy(ROOT / "thingc.toml", folder)


def commands(page: Path) -> list[tuple[str, str]]:
    """What `console` blocks type after `$ `, each with the output that they show."""
    return [one for block in blocks(page) for one in typed(block)]


def typed(block: Block) -> list[tuple[str, str]]:
    """The same of one block, which may be of another language."""
    if block.language != "console":
        return []
    pieces = (piece.partition("\n") for piece in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:])
    return [(command, output) for command, _, output in pieces]


def leaves(page: Path) -> float:
    """The line of the block with the first `cd`: files that are shown below lie where it leads."""
    return next((block.line for block in blocks(page) if any(command.startswith("cd ") for command, _ in typed(block))), math.inf)


def run(command: str) -> str:
    """What a `thingc` or `python FILE` command prints here, standard output first, without progress; `cd FOLDER` goes there."""
    words = shlex.split(command, comments=True)
    if words[0] == "python" and "import jax" in Path(words[1]).read_text():  # it starts threads, and other tests fork
        return _run_with_jax(command)
    return run_here(words)


@cache
def _jax_process() -> subprocess.Popen[str]:
    """A process that runs all scripts that use JAX, which takes seconds to import."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "docs.jax_scripts"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "XLA_FLAGS": XLA_FLAGS, "PYTHONPATH": str(ROOT / "tests")},
    )
    atexit.register(process.communicate)
    return process


def _run_with_jax(command: str) -> str:
    process = _jax_process()
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(json.dumps([os.getcwd(), command]) + "\n")
    process.stdin.flush()
    return str(json.loads(process.stdout.readline()))


def run_here(words: Sequence[str]) -> str:
    """The same in this process, of the words of a command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        if words[0] == "thingc":
            main(words[1:])
        elif words[0] == "cd":
            os.chdir(words[1])
        else:
            assert words[0] == "python", words
            before, modules = sys.path[:], set(sys.modules)
            try:
                sys.path.insert(0, os.getcwd())
                runpy.run_path(os.path.abspath(words[1]), run_name="__main__")
            finally:
                sys.path[:] = before
                for name in set(sys.modules) - modules:
                    if (getattr(sys.modules[name], "__file__", None) or "").startswith(os.getcwd() + os.sep):
                        del sys.modules[name]
    return out.getvalue() + _PROGRESS.sub("", err.getvalue())


def shows(shown: str, printed: str) -> bool:
    """Whether a page shows what was printed; a line `...` stands for any lines, and `...` in a line for any text."""
    pattern = re.escape(shown.strip("\n"))
    pattern = re.sub(r"(^|(?<=\n))\\\.\\\.\\\.($|(?=\\?\n))", "(?s:.*)", pattern).replace(r"\.\.\.", ".*")
    pattern = re.sub(r"^\(\?s:\.\*\)\\\n", r"(?s:.*\n)?", pattern)
    return re.fullmatch(pattern, "\n".join(line.rstrip() for line in printed.strip("\n").split("\n"))) is not None
