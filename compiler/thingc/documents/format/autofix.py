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

LANGUAGE = frozenset({
    Code.UNKNOWN_KEY, Code.UNKNOWN_CHOICE, Code.HEADER, Code.BAD_UNIT, Code.BAD_QUANTITY, Code.BAD_EXPRESSION, Code.WRONG_TYPE,
    Code.BAD_COLOR, Code.EXPRESSION_COMMA, Code.RAW_TARGET, Code.RAW_UNKNOWN, Code.LIBRARY, Code.PART_MISSING, Code.MISSING_FILE,
    Code.DIMENSION,
})
"""Codes of misspelled words that documents do not declare: keywords, units, Python names, file names, and expressions."""

GIVING = frozenset({
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


Look = Callable[[Mapping[str, bytes]], CheckResult]
"""A function that checks documents. The argument maps absolute paths to file contents that replace the contents on disk."""


def locate_edit(edit: Edit, text: str) -> tuple[int, int] | None:
    """Return the start and end index of the characters that an edit replaces in the text of its file.

    `text` does not contain a byte order mark. Return None if the text to replace does not occur exactly once at the position of the edit.
    """
    source = Source(edit.span.file, text)
    if not (0 < edit.span.line <= len(source.starts) and 0 < edit.span.end_line <= len(source.starts)):
        return None
    start, end = source.range(edit.span)
    stretch = text[start:end]
    places = [match.start() for match in re.finditer(rf"(?<![^\W\d]){re.escape(edit.written)}(?!\w)", stretch)]
    if len(places) != 1:
        return None
    return start + places[0], start + places[0] + len(edit.written)


def autofix(
    look: Look, contents: Mapping[str, bytes], allowed: Callable[[str], bool], read: Callable[[str], bytes | None]
) -> tuple[list[TextEdit], dict[str, bytes], Sequence[Diagnostic]]:
    """Apply the unambiguous fixes of diagnostics repeatedly, until no such fix remains.

    `contents` maps absolute paths to the contents of files that have already been changed. `allowed` is a function that returns whether a
    file may be changed, and `read` returns the bytes of a file on disk. Return the edits in the order made, the contents of all changed
    files, and the remaining diagnostics. An edit is discarded if the error at its position remains. The edits must reduce the number of
    errors in every changed file. If the number changes in several compiler passes, the first of these passes counts.
    """
    before = look(contents)
    done, texts, left = _autofix(look, before, contents, allowed, read, strict=False)
    # A fixed error may reveal other errors. If an edited file does not have fewer errors than before, each edit must reduce the errors.
    if any(_faults(left, one.file) >= _faults(before.found, one.file) for one in done):
        return _autofix(look, before, contents, allowed, read, strict=True)
    return done, texts, left


def _autofix(
    look: Look, now: CheckResult, contents: Mapping[str, bytes], allowed: Callable[[str], bool], read: Callable[[str], bytes | None],
    *, strict: bool,
) -> tuple[list[TextEdit], dict[str, bytes], Sequence[Diagnostic]]:
    done: list[TextEdit] = []
    texts = dict(contents)
    for _ in range(PASSES):
        chosen = safe_edits(now, texts, allowed, read)
        while chosen:
            fresh = {**texts, **_apply_edits(chosen, texts, read)}
            then = look(fresh)
            kept = _better(chosen, now.found, then.found, strict=strict)
            if len(kept) == len(chosen):
                break
            chosen = kept
        if not chosen:
            break
        done += chosen
        texts, now = fresh, then
    return done, texts, now.found


def safe_edits(
    now: CheckResult, texts: Mapping[str, bytes], allowed: Callable[[str], bool], read: Callable[[str], bytes | None]
) -> list[TextEdit]:
    """Return the unambiguous fixes of diagnostics that do not overlap each other. The arguments have the same meaning as for `autofix`."""
    words, given = _word_counts(now.documents)
    edits: list[TextEdit] = []
    decoded: dict[str, str | None] = {}
    for diagnostic in now.found:
        for edit in diagnostic.fixes:
            file = edit.span.file
            if file not in decoded:
                data = texts.get(file) or read(file) if allowed(file) else None
                decoded[file] = None if data is None else data.decode("utf-8-sig", errors="replace")
            text = decoded[file]
            place = locate_edit(edit, text) if text is not None else None
            if place is None or text is None or (diagnostic.code not in LANGUAGE and not _told_apart(edit, words, given)):
                continue
            at = Source(file, text).span(*place)
            text_edit = TextEdit(
                file=file, line=at.line, column=at.column, start=place[0], end=place[1], written=edit.written, replacement=edit.replacement,
            )
            if any(other.file == file and other.start < place[1] and place[0] < other.end for other in edits):
                continue
            if text_edit not in edits:
                edits.append(text_edit)
    return edits


def _base(word: str) -> str:
    """Return the name of an entry with `repeat` from the name of one of its items, such as `leg` for `leg_0`."""
    return re.sub(r"_(?:\d+|\$\w+)$", "", word)


def _word_counts(documents: Iterable[Document]) -> tuple[Counter[str], set[str]]:
    """Count the occurrences of each name in the documents, and collect the names that the documents declare."""
    words: Counter[str] = Counter()
    given: set[str] = set()
    for document in documents:
        for path, node in walk(document.tree):
            if isinstance(node, MappingNode):
                for key in node.entries:
                    words.update(_base(word) for word in re.findall(r"[A-Za-z_][\w$]*", key))
                if (len(path) == 1 and path[0] in GIVING) or (len(path) == 3 and path[::2] == ("components", "mounts")):
                    given.update(node.entries)
            elif isinstance(node, ScalarNode) and isinstance(node.value, str) and path[-1:] not in (("description",), ("doc",)):
                words.update(_base(word) for word in re.findall(r"[A-Za-z_][\w$]*", node.value))
    return words, given


def _told_apart(edit: Edit, words: Counter[str], given: set[str]) -> bool:
    """Return whether an edit certainly replaces a misspelling, and not a correctly spelled name.

    Return False if the replacement is a declared name that is not used elsewhere.
    """
    written, meant = (_base(word.rpartition(".")[2]) for word in (edit.written, edit.replacement))
    if words[written] != 1:
        return False
    return meant not in given or words[meant] >= 2


def _apply_edits(chosen: Sequence[TextEdit], texts: Mapping[str, bytes], read: Callable[[str], bytes | None]) -> dict[str, bytes]:
    fresh: dict[str, bytes] = {}
    for file in {text_edit.file for text_edit in chosen}:
        data = texts.get(file) or read(file)
        assert data is not None
        text = data.decode("utf-8-sig")
        for text_edit in sorted((one for one in chosen if one.file == file), key=lambda one: -one.start):
            text = text[: text_edit.start] + text_edit.replacement + text[text_edit.end :]
        mark = b"\xef\xbb\xbf" if data.startswith(b"\xef\xbb\xbf") else b""
        fresh[file] = mark + text.encode()
    return fresh


def _faults(diagnostics: Sequence[Diagnostic], file: str) -> tuple[int, ...]:
    """Return the number of errors in a file for each compiler pass, in the order of the passes.

    Results are compared like tuples, so a reduction of errors in an early pass outweighs new errors in later passes.
    """
    passes = Counter(d.code.code[2] for d in diagnostics if d.severity is Severity.ERROR and d.span is not None and d.span.file == file)
    return tuple(passes[digit] for digit in "123456789")


def _better(chosen: Sequence[TextEdit], before: Sequence[Diagnostic], after: Sequence[Diagnostic], *, strict: bool) -> list[TextEdit]:
    """Return the edits after which the error at the position of the edit no longer exists.

    With `strict`, the number of errors in the file must also have decreased.
    """
    errors = [d.span for d in after if d.severity is Severity.ERROR and d.span is not None]

    def fixes_error(one: TextEdit) -> bool:
        above = [other for other in chosen if (other.file, other.line) == (one.file, one.line) and other.column < one.column]
        start = one.column + sum(len(other.replacement) - len(other.written) for other in above)
        end = start + len(one.replacement)
        return not any(
            (span.file, span.line) == (one.file, one.line) and span.column < end
            and (span.end_line > span.line or span.end_column > start)
            for span in errors
        )

    return [one for one in chosen if fixes_error(one) and (not strict or _faults(after, one.file) < _faults(before, one.file))]
