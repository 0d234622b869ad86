"""Write the documents of an old and a new git revision to temporary folders, compile the documents there, and compare the results."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import TypeVar

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Report, Severity
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.source import Span
from thingc.base.suggestions import did_you_mean
from thingc.driver.environment import Options
from thingc.tools.affected.dependents import affected_documents, changed_paths
from thingc.tools.diff.arguments import ComparisonRequest, SideKind, UnknownComparison
from thingc.tools.diff.build_folder_snapshot import outline, snapshot_of_build, snapshot_of_lock
from thingc.tools.diff.cached_snapshots import BrokenDocument, Subject
from thingc.tools.diff.comparison import Comparison, compare
from thingc.tools.diff.revisions import Repository, Revision
from thingc.tools.diff.snapshot import Change, Snapshot
from thingc.tools.diff.surface_distance import SurfaceDistances
from thingc.tools.importing.import_request import ENDINGS, ImportRequest, changed_robots, select_robot_files

T = TypeVar("T")
SourceOf = Callable[[Span], "Span | None"]
"""A function that maps a location in a compiled document to a location in a file of the user."""


class Checkout(OneLineStruct):
    """The absolute path of a document, build folder or lock file on one side of a comparison.

    If the files are from a git revision, `revision` is the name of the revision, else None.
    """

    path: str
    revision: Revision | None = None
    kind: SideKind = "document"

    def home(self, file: str) -> str:
        """Return the path in the user's working tree that corresponds to the path of a file in this checkout."""
        if self.revision is None:
            return file
        inside = os.path.relpath(file, self.revision.root)
        return file if inside.startswith("..") else os.path.join(self.revision.repository.top, inside)


class DocumentPair(OneLineStruct):
    """The old and the new version of a document. `name` is the path of the document on the command line.

    `old` or `new` is None if the document does not exist on this side of the comparison.
    """

    name: str
    old: Checkout | None
    new: Checkout | None


class BrokenSide(BrokenDocument):
    """Raised if one side of a comparison cannot be compiled.

    `texts` contains the contents of the files in which the errors are. The file names in `diagnostics` contain the name of the side.
    """

    def __init__(self, diagnostics: Sequence[Diagnostic], texts: Mapping[str, str]) -> None:
        super().__init__(diagnostics)
        self.texts = texts


def laid_out(request: ComparisonRequest, stack: ExitStack, *, code: bool) -> list[DocumentPair]:
    """Return the pairs of old and new documents to compare. The files are in folders that are deleted when the exit stack `stack` closes.

    If `code` is false, the comparison does not run part code. Raises `UnknownComparison` and `NotARepository`.
    """
    if not code and ("model" in (request.old.kind, request.new.kind) or any(one.lower().endswith(ENDINGS) for one in request.documents)):
        raise UnknownComparison("--no-code cannot compare robot files of other formats", "omit --no-code")
    if request.old.kind in ("document", "build", "lock", "model"):
        old, new = (Checkout(path=side.place, kind=side.kind) for side in (request.old, request.new))
        return [DocumentPair(name=request.new.name, old=old, new=new)]
    cwd = os.getcwd()
    repository = Repository.of(cwd, trusted=code)
    states = [
        None if side.kind == "checkout" else stack.enter_context(Revision(repository, side.name, side.place))
        for side in (request.old, request.new)
    ]
    if request.documents:
        paths = [repository.path(document) for document in request.documents]
        for document, path in zip(request.documents, paths, strict=True):
            if not any(_has(repository, state, path) for state in states):
                known = [one for state in states if state is not None for one in state.documents(repository.path("."))]
                message = f"there is no document `{document}` in {request.old.name} or {request.new.name}"
                raise UnknownComparison(message, did_you_mean(path, known, what="documents") if known else "use a document")
    else:
        paths = _affected_documents(repository, request, states, cwd)
    for state in states:
        if state is not None:
            state.lay_out(paths)
    return [
        DocumentPair(
            name=os.path.relpath(os.path.join(repository.top, path)),
            old=_find_checkout(repository, states[0], path), new=_find_checkout(repository, states[1], path),
        )
        for path in paths
    ]


def _has(repository: Repository, state: Revision | None, path: str) -> bool:
    return os.path.isfile(os.path.join(repository.top, path)) if state is None else state.has(path)


def _find_checkout(repository: Repository, state: Revision | None, path: str) -> Checkout | None:
    if not _has(repository, state, path):
        return None
    kind: SideKind = "model" if path.lower().endswith(ENDINGS) else "document"
    return Checkout(path=os.path.join(repository.top, path) if state is None else state.file(path), revision=state, kind=kind)


def _affected_documents(repository: Repository, request: ComparisonRequest, states: Sequence[Revision | None], cwd: str) -> list[str]:
    """Return the documents below the working folder that depend on a changed file, and the changed robot files of other formats.

    Nested documents without modes, and files that only other robot files include, are omitted.
    """
    changed = changed_paths(cwd, request.old.place, *filter(None, [request.new.place]), trusted=repository.trusted)
    if not changed:
        return []
    folder = repository.path(os.path.join(cwd, "document")).rpartition("/")[0]
    documents: dict[str, None] = {}
    robots = select_robot_files(changed)
    for state in states:
        top = repository.top if state is None else state.root
        if state is not None:
            state.lay_out(state.documents(folder or "."))
            state.write(robots)
        documents |= {path: None for path in robots if changed_robots([os.path.join(top, path)])}
        below = os.path.join(top, *folder.split("/")) if folder else top
        if os.path.isdir(below):
            roots = affected_documents([os.path.join(top, path) for path in changed], below, None).roots
            inside = (os.path.relpath(os.path.realpath(path), os.path.realpath(top)) for path in roots)
            documents |= dict.fromkeys(path.replace(os.sep, "/") for path in inside)
    return sorted(documents)


def compare_versions(
    both: DocumentPair, options: Options, source: ImportRequest, *, tests: bool, names: tuple[str, str], draw: bool = False,
) -> Comparison:
    """Compare the old and the new version of a document.

    `source` contains the options for reading robot files of other formats. If `tests` is true, compare test results. If `draw` is true,
    render pictures of the changes. Source locations refer to files in the user's checkout. Raises `BrokenSide` and `UnknownComparison`.
    """
    assert both.old is not None and both.new is not None, "both sides of the comparison are required"
    with ExitStack() as stack:
        sides: list[Subject | Snapshot] = []
        homes: list[SourceOf] = []
        for checkout, name in ((both.old, names[0]), (both.new, names[1])):
            side: Subject | Snapshot
            home: SourceOf | None = None
            try:
                if checkout.kind == "model":
                    side, home = read_completely(checkout, options, partial(_robot_file, checkout, options, source, stack))
                elif checkout.kind == "document":
                    side = stack.enter_context(subject(checkout, options))
                else:
                    side = snapshot_of_build(checkout.path) if checkout.kind == "build" else snapshot_of_lock(checkout.path)
            except BrokenDocument as broken:
                raise broken_side(checkout, name, broken) from broken
            sides.append(side)
            homes.append(partial(_at_home, checkout, home))
        old, new = sides
        answer = _compare_robots(old, new, options, tests=tests)
        if answer.changes and isinstance(old, Subject) and isinstance(new, Subject):
            answer = _without_explained(old, new, answer, options, tests=tests)
            if draw and options.code:
                from thingc.tools.diff.pictures import pictures

                answer = replace(answer, pictures=pictures(old.model(), new.model(), answer.changes))
        return replace(answer, changes=tuple(_with_home(change, homes[::-1]) for change in answer.changes))


def _compare_robots(old: Subject | Snapshot, new: Subject | Snapshot, options: Options, *, tests: bool) -> Comparison:
    """Compare two versions of a robot.

    If one version is a build folder or a lock file, compare only the information that both versions contain.
    """
    if not isinstance(old, Subject) or not isinstance(new, Subject):
        before, after = (outline(one.snapshot) if isinstance(one, Subject) else one for one in (old, new))
        return compare(before, after)
    if not options.code:
        return compare(old.snapshot, new.snapshot)
    farthest = SurfaceDistances(new.store).farthest
    comparison = compare(old.snapshot, new.snapshot, farthest)
    return compare(old.snapshot_with_tests(), new.snapshot_with_tests(), farthest) if tests and comparison.changes else comparison


def _without_explained(old: Subject, new: Subject, answer: Comparison, options: Options, *, tests: bool) -> Comparison:
    """If two robots are the same mechanism, except for masses, separate the changes that other frames, joint zeros or signs explain."""
    from thingc.tools.diff.alignment import Alignment
    from thingc.tools.same.comparison import OF_LINKS, match_mechanisms
    from thingc.tools.same.mechanism import mechanism_of_assembly, to_pose
    from thingc.tools.same.text_report import summary, zeros_of

    if old.snapshot.whole is None or new.snapshot.whole is None:
        return answer
    one, other = (mechanism_of_assembly(side.assembly) for side in (old, new))
    result, found = match_mechanisms(one, other, explain=any(change.what in ("joint", "mount", "mate") for change in answer.changes))
    if found is None or any(difference.what not in OF_LINKS for difference in result.differences):
        return answer
    matched = ((one.links[number].name, other.links[link.other].name, to_pose(link.T)) for number, link in found.links.items())
    known = [{link.name for link in side.snapshot.links} for side in (old, new)]
    links = next(link for link in matched if link[0] in known[0] and link[1] in known[1])  # others are between coordinates of a joint
    before, after = (side.snapshot_with_tests() if tests and options.code else side.snapshot for side in (old, new))
    converted = Alignment(before, after, (old.assembly, new.assembly), {joint.one: joint for joint in result.joints}, links).snapshot()
    rest = compare(converted, after, *([SurfaceDistances(new.store).farthest] if options.code else []))
    if len(rest.changes) >= len(answer.changes):
        return replace(answer, mechanism=summary(result) if result.same and zeros_of(result) else "")
    left = {(change.what, change.path, change.field, change.change) for change in rest.changes}
    explained = tuple(one for one in answer.changes if (one.what, one.path, one.field, one.change) not in left)
    return replace(rest, mechanism=summary(result), explained=explained)


def subject(checkout: Checkout, options: Options) -> Subject:
    """Compile a document of one side of the comparison. Raises `BrokenDocument`."""
    return read_completely(checkout, options, lambda: Subject(checkout.path, options))


def read_completely(checkout: Checkout, options: Options, read: Callable[[], T]) -> T:
    """Call `read`. If it fails for a file of a git revision, write all files of the revision and call it again. Raises `BrokenDocument`."""
    try:
        return read()
    except BrokenDocument:
        if checkout.revision is None or not options.code or not checkout.revision.everything():
            raise
    return read()


def _robot_file(checkout: Checkout, options: Options, source: ImportRequest, stack: ExitStack) -> tuple[Subject, SourceOf]:
    """Compile a robot file of another format, and return a function that maps spans to this file. Raises `BrokenDocument`."""
    from thingc.tools.importing.imported_document import imported_document

    report = Report()
    document = stack.enter_context(imported_document(checkout.path, options, report, source))
    if document is None:
        raise BrokenDocument([one for one in report.sorted_diagnostics() if one.severity is Severity.ERROR])
    robot = stack.enter_context(Subject(document.path, document.options))
    return robot, partial(document.source_span, root=robot.document)


def _at_home(checkout: Checkout, source: SourceOf | None, span: Span) -> Span | None:
    found = span if source is None else source(span)
    return found and replace(found, file=checkout.home(found.file))


def _with_home(change: Change, homes: Sequence[SourceOf]) -> Change:
    """Move the location of a change to a file of the user."""
    span = change.span
    moved = (home(span) for home in homes) if span is not None else ()
    return replace(change, span=next((one for one in moved if one != span), span))


def broken_side(checkout: Checkout, name: str, broken: BrokenDocument) -> BrokenSide:
    """Return an exception with the errors of one side of a comparison, in which the name of the side is added to the file names.

    The name of a file in a revision has the syntax of git, such as `main:arm.yaml`.
    """
    texts: dict[str, str] = {}

    def name_span(span: Span | None) -> Span | None:
        if span is None or checkout.revision is None or checkout.home(span.file) == span.file:
            return span
        called = f"{name}:{os.path.relpath(span.file, checkout.revision.root)}"
        if called not in texts:
            with open(span.file, encoding="utf-8", errors="replace") as stream:
                texts[called] = stream.read()
        return replace(span, file=called)

    diagnostics = [
        replace(d, span=name_span(d.span), notes=tuple(replace(note, span=name_span(note.span)) for note in d.notes), fixes=())
        for d in broken.diagnostics
    ]
    return BrokenSide(diagnostics, texts)
