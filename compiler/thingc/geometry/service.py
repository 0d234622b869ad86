"""The geometry service, which provides parts to the passes: from the store if possible, otherwise by building them in workers.

If no part has to be built, the service does not start a process and does not import large packages.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from importlib.util import find_spec
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec import convert, to_builtins
from msgspec.structs import replace

from thingc.documents.workspace import Workspace
from thingc.geometry.build_reasons import BuildReason, unchanged_reason, why
from thingc.geometry.features import Features
from thingc.geometry.key.build_key import BuildKey, schema_key
from thingc.geometry.key.file_states import state_of
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.modules import Module
from thingc.geometry.key.part_code import PartCode
from thingc.geometry.key.result_cache import CachedResult, Results
from thingc.geometry.key.versions import versions_of
from thingc.geometry.lock.lock import LOCK_FILE, Lock
from thingc.geometry.lock.reader import LockAnswers
from thingc.geometry.part_requests import Likely, PartRequest, PartRequests
from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import (
    NO_PIECES,
    AssemblyFailed,
    Mesh,
    PartDefinition,
    PartFailure,
    PartRecord,
    PartSchema,
    Placed,
    StoredFile,
    WantedPieces,
)
from thingc.geometry.record_cache import ConvexAnswers, KeptRecords
from thingc.geometry.record_json import from_json, record_from_json, with_left
from thingc.geometry.store.build_locks import BuildLocks
from thingc.geometry.store.local import Store, StoreUnusable
from thingc.geometry.store.slice_cache import MeshWork, SliceCache, lacking

if TYPE_CHECKING:
    from thingc.geometry.client import Workers

ASSEMBLE = "thingc.geometry.worker.kernel.step_assembly:assemble"
FEATURES = "thingc.geometry.worker.kernel.feature_search:features_of"
PATIENCE = 150.0
"""Time [s] to wait for another process that builds the same part, in addition to the timeout of the part. The other process may also have
to load the CAD kernel.
"""

RECENT = 512
"""Maximum number of part records that a service caches in memory, by definition and convex decompositions. Each record is cached with the
reason that a later `realize` gives for reusing it. If the cache is full, the oldest record is removed.
"""

Progress = Callable[[str, int, int], None]
Result = TypeVar("Result")
Printed = Callable[[str, Sequence[str]], None]


class GeometryService:
    """Provides the part schemas, part records and STEP files of one workspace. On exit, this context manager ends its workers.

    At most `jobs` parts are built at the same time. Each part may take at most `timeout` [s]. `on_progress(what, done, total)` is called
    for each part, and `on_printed(part, lines)` with the lines that a part printed.

    After `realize`, `wanted` contains the requested definitions. `modelled` and `reused` contain the definition texts of parts that were
    built or reused, and `decisions` contains the reasons. `inputs` contains the absolute paths of all files and folders that the answers
    depend on, including paths that do not exist. `reads` contains the states of the files that an answer depends on, by subject and path.
    Answers from a lock file have no entry in `reads`. `part_code` contains the source code of the parts that have been requested so far.

    Pass `workers` to share the workers of a long-lived process. The service does not end shared workers. The function `lock` reads the lock
    file of the workspace when it is first needed. Use `lock` for callers that do not use meshes. The lock file provides parts that are not
    in the store, and `broken` contains the errors in the lock file. `seed` is the Python hash seed of the service's own workers. Use a
    separate store for each seed, because keys do not contain the seed.

    Raises `StoreUnusable` if the service has to write to the store and the store is not writable.
    """

    def __init__(
        self, workspace: Workspace, store: Store, jobs: int, timeout: float, on_progress: Progress | None = None,
        workers: Workers | None = None, lock: Callable[[], Lock | None] | None = None, seed: int = 0,
        on_printed: Printed | None = None,
    ) -> None:
        self.workspace = workspace
        self.store = store
        self.timeout = timeout
        self.decisions: dict[str, BuildReason] = {}
        self.wanted: tuple[PartDefinition, ...] = ()
        self._jobs = jobs
        self._seed = seed
        self._on_progress = on_progress
        self._on_printed = on_printed
        self._workers, self._lent = workers, workers is not None
        self.part_code = PartCode(workspace, store)
        self._results = Results(store, workspace.root)
        self._kept = KeptRecords(workspace, store, self.part_code, self._results)
        self._requests = PartRequests(workspace, store, timeout, self.part_code, self._results)
        self._build_locks = BuildLocks(store)
        mesh_work = MeshWork(store, timeout, self._run, self._crash_failure)
        self._slices = SliceCache(mesh_work, lambda: self.part_code.versions(None))
        self._convex = ConvexAnswers(mesh_work, lambda: versions_of(["coacd", "manifold3d"], self.part_code.file_of, store))
        self._recent: dict[tuple[PartDefinition, tuple[int, ...]], tuple[PartRecord, str]] = {}
        self._expected: dict[str, CachedResult] = {}
        self._locked = LockAnswers(lock, workspace, self.part_code)
        self.unknown: list[str] = []
        self.reads: dict[str, dict[str, str]] = {}
        self.broken = self._locked.broken

    def __enter__(self) -> GeometryService:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def modelled(self) -> list[str]:
        """Definition texts of the parts that the last `realize` built, in the order in which they were finished."""
        return [text for text, decision in self.decisions.items() if not decision.reused]

    @property
    def reused(self) -> list[str]:
        """Definition texts of the parts whose records the last `realize` found in the store."""
        return [text for text, decision in self.decisions.items() if decision.reused]

    @property
    def inputs(self) -> frozenset[str]:
        """Absolute paths of the files and folders that the results depend on, in folders and packages that are tracked by content."""
        return frozenset(self.part_code.probed | self._results.consulted | self._locked.consulted)

    def warm(self) -> None:
        """Start the worker without waiting, so that it loads the kernel while the caller continues."""
        self._worker_pool().warm()

    def anticipate(self) -> bool:
        """Start to load the CAD kernel if there was no previous run in this workspace, or if a file that parts depend on has changed since
        then.

        Return whether the method started to load the kernel. Call this method before reading documents, because loading the kernel takes
        longest. If the workspace has a lock file, the kernel is not loaded.
        """
        if needed := not self._locked.there and self._results.files_changed():
            self.warm()
        return needed

    def expect(self, last: GeometryService, saved: Collection[str] = ()) -> None:
        """Begin to build the parts of the service `last` whose code has changed, because these parts will probably be requested.

        `saved` contains the absolute paths of changed files. Workers build these parts while the classes are described. `realize` uses a
        result if the part still has the same parameters as in `last`, with the current default values.
        """
        begun = 0
        self._worker_pool().prepare([path for path in saved if path.endswith(".py")])
        self._requests.slicings = dict(last._requests.slicings)
        for definition in last.wanted:
            prepared = self._requests.prepare(definition, last._requests.given_parameters(definition))
            if isinstance(prepared, PartFailure):
                continue
            kept = self._kept.find(definition, prepared.build_key, prepared.code)
            if kept is not None:
                self._expected[prepared.build_key.key] = kept
            elif begun < self._jobs:
                self._worker_pool().begin([self._requests.modelling(definition, prepared)])
                begun += 1

    def close(self) -> None:
        """End the workers, unless they are shared."""
        if self._workers is not None and not self._lent:
            self._workers.close()
            self._workers = None

    def catalogue(self) -> list[str]:
        """Return `module:Class` of every public class in the part folders and in the allowed packages tracked by content."""
        from thingc.geometry.key.catalogue import classes_in_reach

        return classes_in_reach(self.part_code.sources, self.workspace.packages)

    def code(self, reference: str) -> CodeIngredients | None:
        """Return the source code of a part that `describe` has described, or None for a part of an installed package."""
        code = self.part_code.code(reference)
        return code if isinstance(code, CodeIngredients) else None

    def hiding(self, reference: str) -> tuple[Module, ...]:
        """Return the modules that hide other modules of the same name, among the modules on which the part `module:Class` depends."""
        return self.part_code.hiding(reference)

    def in_part_folders(self, reference: str) -> bool:
        """Return whether `module:Class` is in a part folder of the workspace."""
        return self.part_code.sources.finder.find(reference.partition(":")[0]).workspace

    def state(self, path: str) -> str:
        """Return the state of a file or folder of the workspace (see `reads`)."""
        return self._results.state(path, "file:")

    def not_python(self) -> list[PartFailure]:
        """Return a failure for each module in the part folders and tracked packages that is not valid Python."""
        from thingc.geometry.key.catalogue import not_python

        return not_python(self.part_code.sources, self.workspace.packages)

    # --- describe ------------------------------------------------------------------------------------------------

    def describe(self, references: Sequence[str], meanwhile: Callable[[], object] | None = None) -> dict[str, PartSchema | PartFailure]:
        """Return the schema or failure of each part `module:Class`, by reference.

        The method calls `meanwhile` after the requests to the workers are sent and before their answers are read.
        """
        answers: dict[str, PartSchema | PartFailure] = {}
        tasks: dict[str, list[PartRequest]] = {}
        for reference in dict.fromkeys(references):
            code = self.part_code.code(reference)
            if isinstance(code, PartFailure):
                answers[reference] = code
                continue
            build_key = schema_key(reference, code, self.part_code.versions(code, reference))
            kept = self._results.find("schema", build_key.key)
            if kept is not None:
                answers[reference] = self._schema(reference, kept.value, code)
                self.reads[reference] = dict(kept.reads)
                continue
            locked = self._locked.schema(reference)
            if locked is not None:
                answers[reference] = locked
                continue
            request = {"op": "describe", "references": [reference], **self._requests.around(code)}
            task = PartRequest(subject=reference, build_key=build_key, code=code, request=request)
            tasks.setdefault(reference.partition(":")[0], []).append(task)
        groups = list(tasks.values())  # one child process per module, so that shared code of the classes in a file is loaded once
        if meanwhile is not None:
            self._worker_pool().begin(self._describing(groups))
            meanwhile()
        self._describe_in_workers(groups, answers)
        return answers

    def _describing(self, groups: list[list[PartRequest]]) -> Iterator[dict[str, Any]]:
        for index, group in enumerate(groups):
            references = [task.subject for task in group]
            placed = [one for one in references if (code := self.code(one)) is not None and code.place is not None]
            yield {**group[0].request, "references": references, "placed": placed, "group": index}

    def _describe_in_workers(self, groups: list[list[PartRequest]], described: dict[str, PartSchema | PartFailure]) -> None:
        if not groups:
            return
        alone: list[list[PartRequest]] = []
        for request, answer in self._run(list(self._describing(groups))):
            group = groups[request["group"]]
            if "failed" in answer:
                if len(group) > 1:  # a class ended the process: describe each class in its own process
                    alone.extend([task] for task in group)
                else:
                    self._show_printed(group[0].subject, answer)
                    described[group[0].subject] = self._crash_failure(group[0].subject, answer)
                continue
            given = answer["answer"]
            failed = [task.subject for task in group if "failure" in given["answers"][task.subject]]
            if failed:  # the output of other classes is shown when their parts are built
                self._show_printed(failed[0], answer)
            for task in group:
                value = given["answers"][task.subject]
                # the classes of a module are described together, so files that one class reads count for all classes
                self._results.keep("schema", task.build_key, value, given["reads"])
                self.reads[task.subject] = dict(given["reads"])
                described[task.subject] = self._schema(task.subject, value, self.part_code.code(task.subject))
        self._describe_in_workers(alone, described)

    def _schema(self, reference: str, value: Any, code: CodeIngredients | None | PartFailure) -> PartSchema | PartFailure:
        if "failure" in value:
            return self.part_code.with_namesakes(from_json(value["failure"], self.workspace.root, PartFailure))
        schema = from_json(value["schema"], self.workspace.root, PartSchema)
        if isinstance(code, CodeIngredients) and code.place is not None:  # new comments change line numbers without a rebuild
            schema = replace(schema, file=code.place[0], line=code.place[1])
        self._requests.schemas[reference] = schema
        return schema

    # --- realize -------------------------------------------------------------------------------------------------

    def realize(
        self, definitions: Sequence[PartDefinition], convex: WantedPieces = NO_PIECES, likely: Likely = None, *, locked: bool = True,
    ) -> dict[str, PartRecord | PartFailure]:
        """Build or load parts, and return the record or failure of each part definition by its text.

        The records contain meshes unless `locked` is True. The records also contain the convex pieces in
        `convex`.
        """
        self.decisions = {}
        self.wanted = tuple(definitions)
        answers: dict[str, PartRecord | PartFailure] = {}
        unmade: list[tuple[PartDefinition, PartRequest]] = []
        unique = {definition.text: definition for definition in definitions}
        build_keys: dict[str, BuildKey] = {}
        for text, definition in unique.items():
            recent = self._recent.get((definition, convex.get(text, ())))
            if recent is not None and (locked or recent[0].meshes):
                answers[text], reason = recent
                self._decide(text, True, reason)
                continue
            prepared = self._requests.prepare(definition)
            if isinstance(prepared, PartFailure):
                answers[text] = prepared
                continue
            build_key, code = prepared.build_key, prepared.code
            build_keys[text] = build_key
            kept = self._expected.get(build_key.key) or self._kept.find(definition, build_key, code)
            if kept is not None:
                self._decide(text, True, unchanged_reason(kept.reason))
                answers[text] = self._record(kept.value, code)
                self.reads[text] = dict(kept.reads)
            elif locked and (held := self._locked.record(definition)) is not None:
                self._decide(text, True, f"{LOCK_FILE} contains it")
                answers[text] = held
                del build_keys[text]  # no part was built; `thingc why` reports the last build
            else:
                unmade.append((definition, prepared))
        tasks = self._tasks(unmade, likely)
        if self._workers is not None:
            self._workers.forget([task.request for task in tasks])
        with closing(self._build_locks):
            self._model(tasks, unique, answers)
        self._results.remember(
            (definition.reference, text, build_keys[text])
            for text, definition in unique.items() if text in build_keys and isinstance(answers[text], PartRecord)
        )
        if build_keys:
            self._results.note_files({**self.part_code.files(), **self._results.met})
        places = {text: (unique[text], convex.get(text, ())) for text in answers}
        new = {text: record for text, record in answers.items() if places[text] not in self._recent}
        self._convex.add(new, convex)
        self._keep_recent({places[text]: record for text, record in new.items()})
        answers |= new
        return {text: answers[text] for text in unique}

    def _keep_recent(self, answers: Mapping[tuple[PartDefinition, tuple[int, ...]], PartRecord | PartFailure]) -> None:
        for place, record in answers.items():
            if isinstance(record, PartRecord) and (decision := self.decisions.get(place[0].text)) is not None:
                self._recent[place] = record, decision.reason if decision.reused else unchanged_reason(decision.reason)
        while len(self._recent) > RECENT:
            del self._recent[next(iter(self._recent))]

    def decompose(self, meshes: Collection[tuple[str, int]]) -> Mapping[tuple[str, int], tuple[Mesh, ...] | PartFailure]:
        """Decompose meshes in the store into convex pieces, and return the pieces or the failure of each mesh."""
        return self._convex.pieces(meshes)

    def _tasks(self, parts: Sequence[tuple[PartDefinition, PartRequest]], likely: Likely) -> list[PartRequest]:
        """Return the requests that build parts, in the order in which workers process them.

        Parts that will be sliced come first, because they take longest.
        """
        self._requests.suppose([definition for definition, _ in parts], likely)
        tasks = [
            replace(
                prepared, request=self._requests.modelling(definition, prepared),
                reason=why(definition, prepared.build_key, self._results),
            )
            for definition, prepared in parts
        ]
        return sorted(tasks, key=lambda task: not task.request["slicings"])

    def _model(
        self, tasks: Sequence[PartRequest], definitions: Mapping[str, PartDefinition], answers: dict[str, PartRecord | PartFailure],
    ) -> None:
        """Build the parts of these tasks in worker processes, and add their records or failures to `answers`.

        If another process is building a part, wait for its result.
        """
        by_text = {task.subject: task for task in tasks}
        elsewhere: list[PartRequest] = []

        def reuse(task: PartRequest) -> bool:
            """Return whether another process has built the part since the request was created."""
            kept = self._kept.find_record(task.build_key.key)
            if kept is not None:
                self._decide(task.subject, True, unchanged_reason(kept.reason))
                self.reads[task.subject] = dict(kept.reads)
                answers[task.subject] = self._record(kept.value, task.code)
                self._build_locks.give_back(task.build_key.key)
            return kept is not None

        def own() -> Iterator[dict[str, Any]]:
            for task in tasks:
                if self._workers is not None and not self._workers.there:  # there are no workers, so do not wait for other processes
                    yield task.request
                elif not self._build_locks.take(task.build_key.key):
                    elsewhere.append(task)
                elif not reuse(task):
                    yield task.request

        def take_in(said: Iterable[tuple[dict[str, Any], dict[str, Any]]]) -> None:
            for request, answer in said:
                task = by_text[request["definition"]["text"]]
                answers[task.subject] = self._store_result(task, definitions[task.subject], answer)
                self._build_locks.give_back(task.build_key.key)

        take_in(self._run([task.request for task in tasks], "modelling", own()))
        for task in elsewhere:
            if task.subject not in answers:
                self._build_locks.wait(task.build_key.key, self.timeout + PATIENCE)
                if not reuse(task):
                    take_in(self._run([task.request]))

    def _store_result(self, task: PartRequest, definition: PartDefinition, answer: dict[str, Any]) -> PartRecord | PartFailure:
        """Store the record or failure that a worker created for a part definition, and return it."""
        self._decide(task.subject, False, task.reason)
        self._show_printed(definition.label, answer)
        if "failed" in answer:
            broken = self._crash_failure(task.subject, answer)
            if definition.kind == "file" and broken.kind == "crashed" and broken.message.startswith("killed by"):
                return replace(broken, kind="invalid", message=f"the file is damaged, or the CAD kernel cannot read it ({broken.message})")
            return broken
        given = with_left(answer["answer"], answer.get("left", ()))
        reads, ran, slices = given.pop("reads"), given.pop("ran", None), given.pop("slices", ())
        self._results.keep("record", task.build_key, given, reads, task.reason)
        if not answer.get("left"):
            self._kept.note_ran(definition, task.build_key, task.code, ran, reads)
        self.reads[task.subject] = dict(reads)
        record = self._record(given, task.code)
        self._slices.keep(record, slices)
        return record

    def in_store(self, definition: PartDefinition) -> bool:
        """Return whether the store contains the record of a part definition."""
        prepared = self._requests.prepare(definition)
        return not isinstance(prepared, PartFailure) and self._kept.find(definition, prepared.build_key, prepared.code) is not None

    def _record(self, value: Any, code: CodeIngredients | None) -> PartRecord | PartFailure:
        if "failure" in value:
            return from_json(value["failure"], self.workspace.root, PartFailure)
        record = record_from_json(value["record"], self.workspace.root)
        return replace(record, code=code.place) if code is not None and code.place is not None else record

    def _decide(self, text: str, reused: bool, reason: str) -> None:
        self.decisions[text] = BuildReason(text=text, reused=reused, reason=reason)

    def slice(
        self, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
        wanted: Mapping[str, Collection[Slicing]],
    ) -> dict[str, PartRecord | PartFailure]:
        """Slice parts for printing, and return their records with the resulting slices, keyed by definition text.

        `wanted` contains the slicings to compute for each definition text. `records` contains the part records before slicing.
        """
        modelled = [definition for definition in definitions if definition.text in lacking(records, wanted)]  # records from the lock
        if modelled:
            decisions = self.decisions
            records = {**records, **self.realize(modelled, locked=False)}
            self.decisions = {**decisions, **self.decisions}
        self._requests.expect_slicings(definitions, {text: [(one, False) for one in slicings] for text, slicings in wanted.items()})
        return self._slices.add_slices(records, wanted)

    # --- assemble ------------------------------------------------------------------------------------------------

    def assemble(self, name: str, instances: Sequence[Placed]) -> StoredFile:
        """Write the STEP file of an assembly, or return it from the cache if all placements and colours are equal.

        Raises `AssemblyFailed` if the kernel cannot write the file.
        """
        listed = to_builtins(instances)
        key = repr([name, sorted(self.part_code.versions(None).items()), listed])
        kept = self.store.get_json("step", key)
        if kept is not None and self.store.has(kept["sha256"], kept["size"]):
            return convert(kept, StoredFile)
        made = self._answer(name, {"op": "call", "function": ASSEMBLE, "arguments": [name, listed]})
        self.store.put_json("step", key, made)
        return convert(made, StoredFile)

    def features(self, breps: Collection[str]) -> dict[str, Features]:
        """Return the cylinders and planar faces of B-reps in the store by their digests. Raises `AssemblyFailed` as `search` does."""
        return self.search(FEATURES, breps, Features)

    def search(self, function: str, breps: Collection[str], kind: type[Result]) -> dict[str, Result]:
        """Call a function `module:name` in the worker with each B-rep, and return its results by the digests of the B-reps in the store.

        Results are cached until the versions of the kernel or of the module change. Raises `AssemblyFailed` if the kernel cannot read a
        B-rep.
        """
        module = find_spec(function.partition(":")[0])
        versions = [*sorted(self.part_code.versions(None).items()), state_of(module.origin) if module and module.origin else ""]
        keys = {brep: repr([function, brep, versions]) for brep in sorted(breps)}
        found = {brep: kept for brep, key in keys.items() if (kept := self.store.get_json("searches", key)) is not None}
        missing = [brep for brep in keys if brep not in found]
        if missing:
            for brep, made in self._answer(function, {"op": "search", "function": function, "breps": missing})["found"].items():
                self.store.put_json("searches", keys[brep], made)
                found[brep] = made
        return {brep: convert(made, kind) for brep, made in found.items()}

    def _answer(self, what: str, request: dict[str, Any]) -> dict[str, Any]:
        """Send a request that only requires OCP to a running worker, or to a new process if no worker is running.

        `what` names the request in the error. Raises `AssemblyFailed` if the worker has no answer.
        """
        request = {**request, "store": self.store.root, "timeout": self.timeout}
        if self._workers is not None and self._workers.running:
            (_, answer), *_ = list(self._run([request]))
        else:
            from thingc.geometry.client import once

            self.store.check()
            answer = once(["--once"], request)
        if "answer" not in answer:
            raise AssemblyFailed(what, answer.get("words") or answer["failed"], answer.get("detail", ""))
        return answer["answer"]  # type: ignore[no-any-return]

    # --- workers -----------------------------------------------------------------------------------

    def _worker_pool(self) -> Workers:
        if self._workers is None:
            from thingc.geometry.client import Workers

            self.store.check()
            self._workers = Workers(self._jobs, seed=self._seed)
        return self._workers

    def _run(self, requests: Sequence[dict[str, Any]], what: str = "", wanted: Iterator[dict[str, Any]] | None = None) -> Any:
        """Send requests to the worker processes, and yield each request with its answer as the answer arrives.

        If no worker starts, every request fails. `wanted` yields the requests that are still needed when they are about to be sent.
        """
        chosen = iter(requests) if wanted is None else wanted
        first = next(chosen, None)
        if first is None:
            return
        from thingc.geometry.client import WorkerBroken

        done = 0
        self._progress(what, done, len(requests))
        answered: set[int] = set()
        try:
            for request, answer in self._worker_pool().run(chain((first,), chosen)):
                done += 1
                answered.add(id(request))
                self._progress(what, done, len(requests))
                if answer.get("failed") == "unusable":
                    raise StoreUnusable(self.store.root, answer["words"])
                yield request, answer
        except WorkerBroken as fault:
            failed = {"failed": "crashed", "words": str(fault), "detail": fault.detail}
            for request in requests:
                if id(request) not in answered:
                    yield request, failed

    def _progress(self, what: str, done: int, total: int) -> None:
        if self._on_progress is not None and what:
            self._on_progress(what, done, total)

    def _show_printed(self, part: str, answer: Mapping[str, Any]) -> None:
        if self._on_printed is not None and "printed" in answer:
            self._on_printed(part, answer["printed"])

    def _crash_failure(self, subject: str, answer: dict[str, Any]) -> PartFailure:
        """Create the failure of a part whose worker process ended or failed while it built the part. The failure is not cached, so that the
        next run builds the part again.
        """
        from thingc.geometry.client import failure_of

        return failure_of(subject, answer, self.timeout, self.workspace)
