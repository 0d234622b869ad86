"""Select and apply the unambiguous fixes of diagnostics.

A misspelled name can be wrong at its use or at its declaration. An edit changes the use only if the misspelling occurs once and the correct
spelling occurs at least twice. In all other cases, the fix is ambiguous and not applied.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

from thingc.base.diagnostics import Code, Diagnostic, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, Edit, MappingNode, ScalarNode, walk
from thingc.documents.load.text import Source

LANGUAGE_CODES = frozenset({
    Code.UNKNOWN_KEY, Code.UNKNOWN_CHOICE, Code.HEADER, Code.BAD_UNIT, Code.BAD_QUANTITY, Code.BAD_EXPRESSION, Code.WRONG_TYPE,
    Code.BAD_COLOR, Code.EXPRESSION_COMMA, Code.RAW_TARGET, Code.RAW_UNKNOWN, Code.LIBRARY, Code.PART_MISSING, Code.MISSING_FILE,
    Code.DIMENSION,
})
"""Codes of misspelled words that documents do not declare: keywords, units, Python names, file names, and expressions."""

DECLARING_KEYS = frozenset({
    "components", "joints", "links", "mounts", "parameters", "materials", "poses", "modes", "motions", "sensors", "tendons",
    "transmissions",
})
"""Keys of a document whose entries declare names."""

PASSES = 5
"""Maximum number of rounds in which fixes are applied. Several rounds may be needed, because fixing an error may reveal other errors."""


class TextEdit(FrozenStruct):
    """A text edit that replaces the characters from `start` to `end` (exclusive) of `file`.

    `line` and `column` (from 1) are the position of `start`.
    """

    file: str
    line: int
    column: int
    start: int
    end: int
    written: str
    replacement: str


class CheckResult(FrozenStruct):
    """The diagnostics of a check, and the documents that were read (empty if no document could be read)."""

    found: Sequence[Diagnostic]
    documents: Sequence[Document]


Check = Callable[[Mapping[str, bytes]], CheckResult]
"""A function that checks documents. Its argument maps absolute paths to file contents, which replace the contents on disk."""


def locate_edit(edit: Edit, text: str) -> tuple[int, int] | None:
    """Return the start and end index of the characters that an edit replaces in the text of its file.

    `text` does not contain a byte order mark. Return None if the text to replace does not occur exactly once at the position of the edit.
    """
    source = Source(edit.span.file, text)
    if not (0 < edit.span.line <= len(source.starts) and 0 < edit.span.end_line <= len(source.starts)):
        return None
    start, end = source.range(edit.span)
    segment = text[start:end]
    places = [match.start() for match in re.finditer(rf"(?<![^\W\d]){re.escape(edit.written)}(?!\w)", segment)]
    if len(places) != 1:
        return None
    return start + places[0], start + places[0] + len(edit.written)


def autofix(
    check: Check, contents: Mapping[str, bytes], allowed: Callable[[str], bool], read: Callable[[str], bytes | None]
) -> tuple[list[TextEdit], dict[str, bytes], Sequence[Diagnostic]]:
    """Apply the unambiguous fixes of diagnostics repeatedly, until no such fix remains.

    `contents` maps absolute paths to the contents of files that have already been changed. `allowed` is a function that returns whether a
    file may be changed, and `read` returns the bytes of a file on disk. An edit is discarded if the error at its position remains. The
    edits must reduce the number of errors in every changed file. If the number changes in several compiler passes, only the first of these
    passes counts. Return the edits in the order in which they were made, the contents of all changed files, and the remaining diagnostics.
    """
    before = check(contents)
    edits, texts, remaining = _autofix(check, before, contents, allowed, read, strict=False)
    # A fixed error may reveal other errors. If an edited file does not have fewer errors than before, each edit must reduce the errors.
    if any(_error_counts(remaining, edit.file) >= _error_counts(before.found, edit.file) for edit in edits):
        return _autofix(check, before, contents, allowed, read, strict=True)
    return edits, texts, remaining


def _autofix(
    check: Check, current: CheckResult, contents: Mapping[str, bytes], allowed: Callable[[str], bool], read: Callable[[str], bytes | None],
    *, strict: bool,
) -> tuple[list[TextEdit], dict[str, bytes], Sequence[Diagnostic]]:
    edits: list[TextEdit] = []
    texts = dict(contents)
    for _ in range(PASSES):
        chosen = safe_edits(current, texts, allowed, read)
        while chosen:
            edited = {**texts, **_apply_edits(chosen, texts, read)}
            result = check(edited)
            effective = _effective(chosen, current.found, result.found, strict=strict)
            if len(effective) == len(chosen):
                break
            chosen = effective
        if not chosen:
            break
        edits += chosen
        texts, current = edited, result
    return edits, texts, current.found


def safe_edits(
    current: CheckResult, texts: Mapping[str, bytes], allowed: Callable[[str], bool], read: Callable[[str], bytes | None]
) -> list[TextEdit]:
    """Return the unambiguous fixes of diagnostics that do not overlap each other. The arguments have the same meaning as for `autofix`."""
    counts, declared = _word_counts(current.documents)
    edits: list[TextEdit] = []
    decoded: dict[str, str | None] = {}
    for diagnostic in current.found:
        for edit in diagnostic.fixes:
            file = edit.span.file
            if file not in decoded:
                data = texts.get(file) or read(file) if allowed(file) else None
                decoded[file] = None if data is None else data.decode("utf-8-sig", errors="replace")
            text = decoded[file]
            place = locate_edit(edit, text) if text is not None else None
            if place is None or text is None or (diagnostic.code not in LANGUAGE_CODES and not _is_misspelling(edit, counts, declared)):
                continue
            at = Source(file, text).span(*place)
            text_edit = TextEdit(
                file=file, line=at.line, column=at.column, start=place[0], end=place[1], written=edit.written, replacement=edit.replacement,
            )
            if not any(other.file == file and other.start < place[1] and place[0] < other.end for other in edits):
                edits.append(text_edit)
    return edits


def _without_item_index(word: str) -> str:
    """Return the name of an entry with `repeat` from the name of one of its items, such as `leg` for `leg_0`."""
    return re.sub(r"_(?:\d+|\$\w+)$", "", word)


def _word_counts(documents: Iterable[Document]) -> tuple[Counter[str], set[str]]:
    """Count the occurrences of each name in the documents, and collect the names that the documents declare."""
    counts: Counter[str] = Counter()
    declared: set[str] = set()
    for document in documents:
        for path, node in walk(document.tree):
            if isinstance(node, MappingNode):
                for key in node.entries:
                    counts.update(_without_item_index(word) for word in re.findall(r"[A-Za-z_][\w$]*", key))
                if (len(path) == 1 and path[0] in DECLARING_KEYS) or (len(path) == 3 and path[::2] == ("components", "mounts")):
                    declared.update(node.entries)
            elif isinstance(node, ScalarNode) and isinstance(node.value, str) and path[-1:] not in (("description",), ("doc",)):
                counts.update(_without_item_index(word) for word in re.findall(r"[A-Za-z_][\w$]*", node.value))
    return counts, declared


def _is_misspelling(edit: Edit, counts: Counter[str], declared: set[str]) -> bool:
    """Return whether the text that an edit replaces is certainly a misspelled use of a name, and not the only correct spelling.

    `counts` contains the number of occurrences of each name, and `declared` the declared names. The replaced name must occur once. If the
    replacement is a declared name, it must occur at least twice.
    """
    written, replacement = (_without_item_index(word.rpartition(".")[2]) for word in (edit.written, edit.replacement))
    return counts[written] == 1 and (replacement not in declared or counts[replacement] >= 2)


def _apply_edits(chosen: Sequence[TextEdit], texts: Mapping[str, bytes], read: Callable[[str], bytes | None]) -> dict[str, bytes]:
    contents: dict[str, bytes] = {}
    for file in {text_edit.file for text_edit in chosen}:
        data = texts.get(file) or read(file)
        assert data is not None
        text = data.decode("utf-8-sig")
        for text_edit in sorted((edit for edit in chosen if edit.file == file), key=lambda edit: -edit.start):
            text = text[: text_edit.start] + text_edit.replacement + text[text_edit.end :]
        mark = b"\xef\xbb\xbf" if data.startswith(b"\xef\xbb\xbf") else b""
        contents[file] = mark + text.encode()
    return contents


def _error_counts(diagnostics: Sequence[Diagnostic], file: str) -> tuple[int, ...]:
    """Return the number of errors in a file for each compiler pass, in the order of the passes.

    Results are compared like tuples, so a reduction of errors in an early pass outweighs new errors in later passes.
    """
    passes = Counter(d.code.code[2] for d in diagnostics if d.severity is Severity.ERROR and d.span is not None and d.span.file == file)
    return tuple(passes[digit] for digit in "123456789")


def _effective(chosen: Sequence[TextEdit], before: Sequence[Diagnostic], after: Sequence[Diagnostic], *, strict: bool) -> list[TextEdit]:
    """Return the edits of `chosen` that removed the error at their position.

    With `strict`, the number of errors in the file must also have decreased.
    """
    errors = [d.span for d in after if d.severity is Severity.ERROR and d.span is not None]

    def fixes_error(edit: TextEdit) -> bool:
        others = [other for other in chosen if (other.file, other.line) == (edit.file, edit.line) and other.column < edit.column]
        start = edit.column + sum(len(other.replacement) - len(other.written) for other in others)
        end = start + len(edit.replacement)
        return not any(
            (span.file, span.line) == (edit.file, edit.line) and span.column < end
            and (span.end_line > span.line or span.end_column > start)
            for span in errors
        )

    return [one for one in chosen if fixes_error(one) and (not strict or _error_counts(after, one.file) < _error_counts(before, one.file))]
