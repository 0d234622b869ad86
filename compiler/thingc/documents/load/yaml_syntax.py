"""Explain the errors of the YAML parser.

An explanation contains the position of the cause, and the text that the user probably intended.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.units import shorten
from thingc.documents.load.text import Source


class SyntaxFault(FrozenStruct, kw_only=False):
    """A syntax error: its message, its range in the text, a hint, and an optional second position with its own message."""

    message: str
    start: int
    end: int
    help: str | None = None
    note: tuple[str, int] | None = None


_LONGEST_KEY = 200
"""Maximum length of a key in a text search. Text searches for longer keys are slow in large documents."""
_QUOTED = re.compile(r"""(?:^|(?<=[\s\[{,:]))(?:"(?:\\.|[^"\\])*"|'(?:''|[^'])*'|\#[^\n\r]*)""", re.MULTILINE | re.DOTALL)
"""Regular expression of a quoted string or a comment."""
_NO_SPACE = re.compile(r"\s*(?:-\s+)*(?P<key>[A-Za-z_][\w.*$-]*):(?P<value>[^\s:#].*)")


def explain(source: Source, *, problem: str, at: int, context: str, began: int) -> SyntaxFault:
    """Explain the error message `problem` of libyaml or PyYAML at the index `at` of the text.

    `context` describes the construct that the parser was reading, and `began` is the start index of this construct.
    """
    text = source.text
    tab = _find_tab(source, at)
    if tab is not None:
        return SyntaxFault("expected spaces in the indentation, found a tab", tab, tab + 1, help="replace the tab with spaces")
    for match in _QUOTED.finditer(text, 0, at):
        start, end = match.start(), match.end() - 1
        if source.line_at(start) < source.line_at(end) == source.line_at(at):
            return SyntaxFault(
                "the quoted string is not closed on the same line", start, start + 1, help=f"add `{text[start]}` at the end of the string",
                note=(f"the next `{text[start]}` closes the string here", end),
            )
    if "quoted scalar" in context and ("end of stream" in problem or "document indicator" in problem or "separator" in problem):
        quote = text[began : began + 1]
        return SyntaxFault("the quoted string is not closed", began, began + 1, help=f"add `{quote}` at the end of the string")
    if "escape" in problem or "hexdecimal" in problem or "hexadecimal" in problem:
        return SyntaxFault("an unknown escape in double quotes", at, at + 1, help="write `\\\\` for a backslash, or use single quotes")
    unspaced = _find_missing_space(source, at)
    if unspaced is not None:
        key, value, start = unspaced
        return SyntaxFault(
            f"a space is missing after `{key}:`", start, start + len(key) + 1 + len(value), help=f"write `{shorten(f'{key}: {value}')}`",
        )
    if text[at : at + 1] == ":" and text[:at].rstrip(" ")[-1:] in ("", "\n", "\r", "{", ","):
        return SyntaxFault("a key is missing before the `:`", at, at + 1)
    if "flow mapping" in context or "flow sequence" in context or "flow node" in context:
        return _explain_flow(source, at, began, "flow mapping" in context)
    return _explain_value(source, problem, at, began) or _explain_layout(source, problem, context, at, began)


def _explain_value(source: Source, problem: str, at: int, began: int) -> SyntaxFault | None:
    """Explain an error in an unquoted key or value, such as a second `:` or a character that is not allowed.

    Return None for other errors.
    """
    text = source.text
    if "mapping values are not allowed" in problem:
        return SyntaxFault(
            "the value contains a second `:`", at, at + 1,
            help="put the value in quotes, or start a nested mapping on a new line",
        )
    if "could not find expected ':'" in problem:
        line = source.line_at(began)
        line_text = source.line(line).strip()
        start = source.starts[line] + len(source.line(line)) - len(source.line(line).lstrip())
        return SyntaxFault(
            f"expected `key: value`, found `{shorten(line_text)}`", start, start + max(1, len(line_text)),
            help="write a colon and a space after the key",
        )
    if "cannot start any token" in problem:
        character = text[at : at + 1]
        return SyntaxFault(f"a value cannot start with `{character}`", at, at + 1, help="put the value in quotes")
    if "alphabetic or numeric" in problem:
        return SyntaxFault(
            f"a value cannot start with `{text[began : began + 1]}`", began, began + 1,
            help='put a name that starts with `*` or `&` in quotes: `"*_knee"`',
        )
    return None


def _explain_layout(source: Source, problem: str, context: str, at: int, began: int) -> SyntaxFault:
    """Explain an indentation error. For any error that no function explains, return the message of the parser."""
    at = min(at, max(0, len(source.text) - 1))
    end = at + max(1, len(re.match(r"[^\s:,{}\[\]]*", source.text[at:]).group()))  # type: ignore[union-attr]
    if "sequence entries are not allowed" in problem:
        return SyntaxFault("a list item `-` is not allowed here", at, at + 1, help="start the list on the line after its key")
    if "block mapping" in context or "expected key" in problem:
        deeper = _deeper_line_above(source, at)
        if deeper is not None:
            line_start, columns = deeper
            return SyntaxFault(
                "the indentation does not match the mapping above", at, end,
                help=f"start the line in column {' or '.join(map(str, columns))}",
                note=(f"the line above starts in column {columns[0]}", line_start),
            )
        line_above = _shallower_line_above(source, at)
        if line_above is not None:
            return SyntaxFault(
                "unexpected indentation after a key with a value", at, end, help="start the line in the same column as the line above",
                note=("the line above starts here", line_above),
            )
        return SyntaxFault(
            "the indentation does not match the mapping above", at, end,
            help="start all keys of a mapping in the same column, or put the whole string in quotes",
            note=("the mapping starts here", began),
        )
    if "block collection" in context or "block sequence" in context:
        return SyntaxFault(
            "the indentation does not match the list above", at, end,
            help="write the `-` of all items of a list in the same column",
            note=("the list starts here", began),
        )
    if "document start" in problem:
        return SyntaxFault("expected the end of the document, found more text", at, end, help="start all keys of the document in column 1")
    if "block scalar" in context:
        return SyntaxFault("text after `|` or `>` must start on the next line", at, end, help="write the text on the next line")
    return SyntaxFault(f"not well-formed YAML: {problem}", at, end)


def _deeper_line_above(source: Source, at: int) -> tuple[int, list[int]] | None:
    """Return the start of the line above a wrongly indented line, and the columns (from 1) in which the wrong line could begin.

    The columns are those of the enclosing mappings. Return None if the wrong line is not indented less than the line above.
    """
    indentation = at - source.starts[source.line_at(at)]
    above_start: int | None = None
    columns: list[int] = []
    for start, indent, _ in _lines_above(source, at):
        if columns and indent + 1 >= columns[-1]:
            continue
        if above_start is None:
            if indent <= indentation:
                return None
            above_start = start
        columns.append(indent + 1)
        if indent < indentation:
            break
    return None if above_start is None else (above_start, columns)


def _shallower_line_above(source: Source, at: int) -> int | None:
    """Return the start of the line above the line at `at` if it is indented less and contains a key and a value. Otherwise, return None."""
    indentation = at - source.starts[source.line_at(at)]
    start, indent, line = next(_lines_above(source, at), (0, indentation, ""))
    return start if indent < indentation and re.match(r"\s*[\w.$*-]+: +[^\s#]", line) else None


def _lines_above(source: Source, at: int) -> Iterator[tuple[int, int, str]]:
    """Yield the lines above the line that begins at `at`, beginning with the nearest line. Empty lines and comments are skipped.

    Each item contains the index of the first non-blank character, the width of the indentation, and the line. Yield nothing if other text
    precedes `at` on the same line.
    """
    number = source.line_at(at)
    if source.line(number)[: at - source.starts[number]].strip():
        return
    for above in range(number - 1, -1, -1):
        line = source.line(above)
        indent = len(line) - len(line.lstrip())
        if line.strip() and not line.lstrip().startswith("#"):
            yield source.starts[above] + indent, indent, line


def _explain_flow(source: Source, at: int, began: int, mapping: bool) -> SyntaxFault:
    """Explain a missing `,` or a missing closing bracket in a value that begins with `{` or `[`."""
    opened, closing = ("{", "}") if mapping else ("[", "]")
    if source.text[began : began + 1] not in "{[":
        began = max(source.text.rfind("{", 0, at), source.text.rfind("[", 0, at), 0)
        opened = source.text[began : began + 1]
        closing = "}" if opened == "{" else "]"
    character = source.text[at : at + 1]
    line = source.line(source.line_at(began))
    comment = re.search(r"(?<=[\s])#\w+", line[began - source.starts[source.line_at(began)] :])
    if comment is not None and source.line_at(at) != source.line_at(began):
        start = began + comment.start()
        return SyntaxFault(
            f"the `{opened}` is not closed before the comment (`#`)", start, start + len(comment.group()),
            help=f'put the value in quotes: `"{comment.group()}"`',
        )
    if at >= len(source.text.rstrip()) or source.line_at(at) != source.line_at(began) or character in "}]":
        return SyntaxFault(
            f"the `{opened}` is not closed with `{closing}`", began, began + 1, help=f"add `{closing}`",
            note=("found this text instead", min(at, max(0, len(source.text) - 1))),
        )
    preceding = source.text[max(began, at - _LONGEST_KEY) : at]
    key = re.search(r"[{\[,]\s*([\w.$*-]+) +$", preceding) if character in "{[" else None
    second_key = re.search(r":.*\s([\w.$*-]+)$", preceding) if character == ":" else None
    help = "put a string that contains a comma, a colon or quotes in quotes"
    if second_key is not None:
        help = f"add a comma before `{second_key[1]}`"
    if key is not None:
        help = f"write a colon and a space after the key: `{key[1]}: {character}`"
    return SyntaxFault(
        f"expected `,` or `{closing}`, found `{character}`", at, at + 1, help=help, note=(f"inside the `{opened}` opened here", began),
    )


def _find_tab(source: Source, at: int) -> int | None:
    """Return the index of a tab in the indentation of the line with the error, or of the preceding line."""
    line = source.line_at(min(at, len(source.text)))
    for number in (line, line - 1):
        if number >= 0:
            line_text = source.line(number)
            indentation = line_text[: len(line_text) - len(line_text.lstrip())]
            if "\t" in indentation:
                return source.starts[number] + indentation.index("\t")
    return None


def _find_missing_space(source: Source, at: int) -> tuple[str, str, int] | None:
    """Find a `key:value` without a space after the colon, on the line of the error or on the two lines above.

    Return the key, the value and their position.
    """
    line = source.line_at(min(at, len(source.text)))
    for number in range(line, max(-1, line - 3), -1):
        match = _NO_SPACE.fullmatch(source.line(number))
        if match is not None:
            return match.group("key"), match.group("value").rstrip(), source.starts[number] + match.start("key")
    return None
