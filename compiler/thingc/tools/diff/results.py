"""The result of `thingc diff`: the changes in all compared documents, and the JSON format of the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from msgspec import convert, to_builtins

from thingc.base.diagnostics import shown_path
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.source import Span
from thingc.driver.up_to_date import from_plain, to_plain
from thingc.tools.diff.checkouts import BrokenSide, DocumentPair
from thingc.tools.diff.comparison import Comparison
from thingc.tools.diff.snapshot import Change, How
from thingc.tools.importing.import_request import select_robot_files


class DiffResult(OneLineStruct):
    """The result of comparing the documents of two sides, such as two git commits. The sides have the names `old` and `new`.

    `documents` maps the name of each compared document to its comparison. `alone` are changes of kind `file`: documents that exist only on
    one side, and changed robot files that were not compared, because the option `--no-code` does not allow it.
    """

    old: str
    new: str
    documents: tuple[tuple[str, Comparison], ...]
    alone: tuple[Change, ...] = ()

    @property
    def changes(self) -> tuple[Change, ...]:
        """All changes in the compared documents, including the explained ones, after the changes of whole documents."""
        return (*self.alone, *(change for _, comparison in self.documents for change in (*comparison.changes, *comparison.explained)))


def compare_documents(
    old: str, new: str, pairs: Sequence[DocumentPair], compare: Callable[[DocumentPair], Comparison], *, code: bool,
) -> DiffResult:
    """Compare all documents of two sides, and return the result. If `code` is false, omit robot files. Raises `BrokenSide`."""
    documents, alone = list[tuple[str, Comparison]](), list[Change]()
    for both in pairs:
        how: How = "added" if both.old is None else "removed" if both.new is None else "changed"
        if how == "changed" and (code or not select_robot_files([both.name])):
            documents.append((both.name, compare(both)))
        else:
            alone.append(Change(what="file", change=how, path=both.name))
    return DiffResult(old=old, new=new, documents=tuple(documents), alone=tuple(sorted(alone, key=lambda one: one.change)))


def as_json(answer: DiffResult) -> dict[str, object]:
    """Convert the result to a JSON object with the keys `old`, `new` and `changes`. Values are in SI units.

    If several documents were compared, each change has the key `document`. `same_mechanism` contains the documents whose robot is the same
    mechanism with other frames, joint zeros or signs, and `explained` contains the changes that this explains.
    """
    several = len(answer.documents) > 1
    changes, explained = [_entry(change) for change in answer.alone], list[dict[str, object]]()
    for name, comparison in answer.documents:
        for entries, found in ((changes, comparison.changes), (explained, comparison.explained)):
            entries += [{**_entry(change), **({"document": name} if several else {})} for change in found]
    same = {name: comparison.mechanism for name, comparison in answer.documents if comparison.mechanism}
    own: dict[str, object] = {"same_mechanism": same, "explained": explained} if same else {}
    return {"old": answer.old, "new": answer.new, **own, "changes": changes}


def _entry(change: Change) -> dict[str, object]:
    span = change.span
    return {
        "what": change.what, "change": change.change, "path": change.path, "new_path": change.new_path, "field": change.field,
        "old": change.old, "new": change.new, "because": list(change.because),
        "file": None if span is None else shown_path(span.file), "line": None if span is None else span.line,
    }


def pack(compare: Callable[[], Comparison]) -> list[Any]:
    """Compare one document, and convert the result, or the errors of one side, to plain JSON values, for transfer between processes.

    Pictures are omitted.
    """
    try:
        answer = compare()
    except BrokenSide as broken:
        return [[to_plain(d) for d in broken.diagnostics], dict(broken.texts)]
    return [answer.name, to_builtins(answer.changes), list(answer.unknown), answer.mechanism, to_builtins(answer.explained)]


def unpack(values: list[Any]) -> Comparison:
    """Convert the JSON values that `pack` returns to the result of comparing one document. Raises `BrokenSide`."""
    if len(values) == 2:
        raise BrokenSide([from_plain(one) for one in values[0]], values[1])
    name, changes, unknown, mechanism, explained = values
    lists = (tuple(map(_change, one)) for one in (changes, explained))
    return Comparison(name=name, changes=next(lists), unknown=tuple(unknown), mechanism=mechanism, explained=next(lists))


def _change(values: dict[str, Any]) -> Change:
    fields = {key: _tuples(value) for key, value in values.items() if key != "span"}
    return Change(**fields, span=convert(values["span"], Span | None))


def _tuples(value: Any) -> Any:
    return tuple(_tuples(one) for one in value) if isinstance(value, list) else value
