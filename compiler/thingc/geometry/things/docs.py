"""What a docstring says of each argument: Google (`Args:`), numpy (`Parameters`) and reST (`:param x:`) style."""

from __future__ import annotations

import inspect
import re

_GOOGLE = re.compile(r"\*{0,2}(\w+)\s*(?:\([^)]*\))?\s*:\s*(.*)$")
_NUMPY = re.compile(r"\*{0,2}(\w+)\s*(?::.*)?$")
_REST = re.compile(r":param\s+(?:[^:]*\s)?(\w+)\s*:\s*(.*)$")


def argument_docs(docstring: str | None) -> dict[str, str]:
    """The text about each argument, by name, as one line; empty where the docstring has no such section."""
    if not docstring:
        return {}
    lines = inspect.cleandoc(docstring).split("\n")
    texts: dict[str, list[str]] = {}
    for start, line in enumerate(lines):
        if line.strip() in ("Args:", "Arguments:", "Parameters:"):
            _indented(lines[start + 1:], texts)
        elif line.strip() == "Parameters" and start + 1 < len(lines) and re.fullmatch(r"-{3,}", lines[start + 1].strip()):
            _numpy(lines[start + 2:], texts)
    _fields(lines, texts)
    return {name: " ".join(" ".join(words).split()) for name, words in texts.items()}


def _indented(lines: list[str], texts: dict[str, list[str]]) -> None:
    """A Google section: entries at one indent, their continuation deeper; ends where the indent does."""
    indent: int | None = None
    entry: list[str] | None = None
    for line in lines:
        if not line.strip():
            continue
        depth = len(line) - len(line.lstrip())
        if indent is None:
            indent = depth
        if depth < indent or depth == 0:
            return
        match = _GOOGLE.match(line.strip()) if depth == indent else None
        if match:
            entry = texts.setdefault(match.group(1), [])
            entry.append(match.group(2))
        elif entry is not None:
            entry.append(line.strip())


def _numpy(lines: list[str], texts: dict[str, list[str]]) -> None:
    """A numpy section: names at the margin, their text indented; ends at the next underlined heading."""
    entries: list[list[str]] = []
    for number, line in enumerate(lines):
        if not line.strip():
            continue
        if line[0].isspace():
            for entry in entries:
                entry.append(line.strip())
            continue
        following = lines[number + 1].strip() if number + 1 < len(lines) else ""
        if re.fullmatch(r"-{3,}", following):
            return
        names = line.split(":", 1)[0]
        entries = [texts.setdefault(name.strip().lstrip("*"), []) for name in names.split(",") if _NUMPY.match(name.strip())]


def _fields(lines: list[str], texts: dict[str, list[str]]) -> None:
    """reST fields: `:param x: text`, continued by indented lines."""
    entry: list[str] | None = None
    for line in lines:
        match = _REST.match(line.strip())
        if match:
            entry = texts.setdefault(match.group(1), [])
            entry.append(match.group(2))
        elif line.strip().startswith(":") or not line.strip() or not line[0].isspace():
            entry = None
        elif entry is not None:
            entry.append(line.strip())
