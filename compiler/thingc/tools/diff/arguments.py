"""Parse the command line of `thingc diff`, which specifies an old and a new state of a robot, and the documents to compare."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Literal

from thingc.base.diagnostics import UserError
from thingc.base.filesystem import listing
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import Hint, did_you_mean
from thingc.documents.load.paths import DOCUMENT_SUFFIXES
from thingc.geometry.lock.lock import LOCK_FILE
from thingc.targets.artifact import MANIFEST
from thingc.tools.affected.dependents import NotARepository
from thingc.tools.diff.revisions import Repository
from thingc.tools.importing.import_request import ENDINGS

SideKind = Literal["document", "build", "lock", "model", "revision", "checkout"]
CHECKOUT = "working tree"
_FILES = frozenset({"document", "model"})


REBUILD = "build the folder again, or compare documents"
"""Help text for a build folder that cannot be compared."""


class UnknownComparison(UserError):
    """Raised if an argument of `thingc diff` is neither a git revision nor a path that can be compared."""


class Side(FrozenStruct):
    """One side of a comparison: the old or the new state of a robot.

    `name` is the name of the side in reports. `place` is the path of a document, build folder or lock file, or the hash of a git commit.
    """

    kind: SideKind
    name: str
    place: str = ""


class ComparisonRequest(FrozenStruct):
    """The two sides of a comparison, and the documents to compare if both sides are states of a git repository.

    `documents` are the paths on the command line. If `documents` is empty, `thingc diff` compares all documents that the change affects.
    """

    old: Side
    new: Side
    documents: tuple[str, ...] = ()


def parse_sides(words: Sequence[str], documents: Sequence[str]) -> ComparisonRequest:
    """Parse the arguments of `thingc diff` or `thingc same`, and return the two sides and the documents to compare.

    `documents` are the command-line arguments after `--`. Raises `UnknownComparison` and `NotARepository`.
    """
    words = list(words)
    if len(words) > 2:
        raise UnknownComparison(f"expected two sides, found {len(words)} arguments", "write the documents to compare after `--`")
    if not words:
        words = ["HEAD"]
    sides = [side for word in words for side in _sides(word)]
    if len(sides) > 2:
        raise UnknownComparison(f"expected two sides, found `{' '.join(words)}`", "write `OLD..NEW`, or two arguments")
    if len(sides) == 1 and sides[0].kind in _FILES and not documents:
        return _make_request([_revision("HEAD"), sides[0]], ())
    if len(sides) == 1:
        if sides[0].kind != "revision":
            raise UnknownComparison(f"expected two sides, found only `{words[0]}`", "write two sides, the old side first")
        sides.append(Side(kind="checkout", name=CHECKOUT))
    return _make_request(sides, documents)


def _make_request(sides: Sequence[Side], documents: Sequence[str]) -> ComparisonRequest:
    old, new = sides
    kinds = {old.kind, new.kind}
    if documents and not kinds <= {"revision", "checkout"}:
        message = "documents after `--` can only be used with two revisions"
        raise UnknownComparison(message, "write `thingc diff OLD.yaml NEW.yaml`")
    if "revision" in kinds and len(kinds) == 2 and kinds & _FILES:  # compare the file in the revision with the file in the checkout
        document = next(side for side in sides if side.kind in _FILES).place
        checkout = Side(kind="checkout", name=CHECKOUT)
        old, new = (side if side.kind == "revision" else checkout for side in sides)
        return ComparisonRequest(old=old, new=new, documents=(document,))
    if "lock" in kinds and kinds != {"lock"} or "revision" in kinds and not kinds <= {"revision", "checkout"}:
        one, other = ("build folder" if side.kind == "build" else side.kind for side in sides)
        message = f"a {one} (`{old.name}`) cannot be compared with a {other} (`{new.name}`)"
        raise UnknownComparison(message, "compare two revisions, two lock files, or documents and build folders")
    return ComparisonRequest(old=old, new=new, documents=tuple(documents))


def _sides(word: str) -> list[Side]:
    """Parse one argument, and return the one or two sides of the comparison that the argument specifies.

    The arguments `main..HEAD` and `main...HEAD` specify two sides. Three dots select the merge base of `main` and HEAD as the old side.
    Every other argument specifies one side.
    """
    if os.path.isfile(word):
        if os.path.basename(word).endswith(LOCK_FILE):
            return [Side(kind="lock", name=word, place=os.path.abspath(word))]
        if word.lower().endswith((*DOCUMENT_SUFFIXES, *ENDINGS)):
            kind: SideKind = "document" if word.lower().endswith(DOCUMENT_SUFFIXES) else "model"
            return [Side(kind=kind, name=word, place=os.path.abspath(word))]
        message = f"`{word}` is not a document ({', '.join((*DOCUMENT_SUFFIXES, *ENDINGS))}), build folder or lock file"
        raise UnknownComparison(message, f"use a document, a build folder or `{LOCK_FILE}`")
    if os.path.isdir(word):
        if os.path.isfile(os.path.join(word, MANIFEST)):
            return [Side(kind="build", name=word.rstrip("/"), place=os.path.abspath(word))]
        inner = [name for name in listing(word) if os.path.isfile(os.path.join(word, name, MANIFEST))]
        hint = "use a build folder or a document"
        hint = f"did you mean `{os.path.join(word, inner[0])}`?" if inner else hint
        raise UnknownComparison(f"the folder `{word}` is not a build folder (no {MANIFEST})", hint)
    between = "..." if "..." in word else ".." if ".." in word else None
    if between is None or os.sep in word.partition(between)[2][:1]:
        return [_revision(word)]
    old, _, new = word.partition(between)
    ends = [_revision(old or "HEAD"), _revision(new or "HEAD")]
    if between == "..":
        return ends
    base = Repository.of(os.getcwd()).common(ends[0].place, ends[1].place)
    return [Side(kind="revision", name=f"{ends[0].name} ({base[:8]})", place=base), ends[1]]


def _revision(word: str) -> Side:
    hint: Hint
    try:
        repository = Repository.of(os.getcwd())
        if (commit := repository.commit(word)) is not None:
            return Side(kind="revision", name=word, place=commit)
        message = f"there is no revision, document or build folder `{word}`"
        hint = did_you_mean(word, [*repository.names(), "HEAD"], what="revisions")
    except NotARepository as fault:
        message = f"`{word}` is not a file, a folder or a revision: {fault}"
        hint = "use two documents, or run the command in a Git repository"
    if word.lower().endswith((*DOCUMENT_SUFFIXES, ".json")):
        folder = os.path.dirname(word)
        names = [os.path.join(folder, name) for name in listing(folder or ".") if name.lower().endswith(DOCUMENT_SUFFIXES)]
        message, hint = f"there is no document `{word}`", did_you_mean(word, names, what="documents")
    raise UnknownComparison(message, hint)
