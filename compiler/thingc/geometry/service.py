"""The geometry service, which provides parts to the passes: from the store if possible, otherwise by building them in workers.

If no part has to be built, the service does not start a process and does not import large packages.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec import convert, to_builtins
from msgspec.structs import replace

from thingc.base.progress import Progress
from thingc.documents.workspace import Workspace
from thingc.geometry.build_reasons import BuildReason, unchanged_reason
from thingc.geometry.features import Features
from thingc.geometry.key.build_key import schema_key
from thingc.geometry.key.file_states import state_of
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.modules import Module
from thingc.geometry.key.part_code import PartCode
from thingc.geometry.key.result_cache import CachedResult, Results
from thingc.geometry.key.versions import versions_of
from thingc.geometry.lock.lock import LOCK_FILE, Lock
from thingc.geometry.lock.reader import LockAnswers
from thingc.geometry.part_requests import Likely, PartRequest, PartRequests, RecordRequest
from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import NO_PIECES, Mesh, PartDefinition, PartFailure, PartRecord, PartSchema, Placed, StoredFile, WantedPieces
from thingc.geometry.record_cache import CachedRecords, ConvexAnswers
from thingc.geometry.record_json import from_json, record_from_json, with_left
from thingc.geometry.slice_cache import SliceCache, lacking
from thingc.geometry.store.build_locks import BuildLocks
from thingc.geometry.store.local import Store
from thingc.geometry.worker_calls import WorkerCalls

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

Result = TypeVar("Result")
Printed = Callable[[str, Sequence[str]], None]


class GeometryService(AbstractContextManager["GeometryService"]):
    """Provides the part schemas, part records and STEP files of one workspace. On exit, this context manager ends its workers.

    At most `jobs` parts are built at the same time. Each part may take at most `timeout` [s]. `on_progress` is called
    for each part, and `on_printed(part, lines)` with the lines that a part printed.

    After `realize`, `wanted` contains the requested definitions, and `decisions` contains the reasons for building or reusing them, by
    definition text. `inputs` contains the absolute paths of all files and folders that the answers depend on, including paths that do not
    exist. `reads` contains the states of the files that an answer depends on, by subject and path. Answers from a lock file have no entry
    in `reads`. `part_code` contains the source code of the parts that have been requested so far.

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
        self._on_printed = on_printed
        self._calls = WorkerCalls(workspace, store, jobs, timeout, workers, seed, on_progress)
        self.part_code = PartCode(workspace, store)
        self._results = Results(store, workspace.root)
        self._records = CachedRecords(workspace, store, self.part_code, self._results)
        self._requests = PartRequests(workspace, store, timeout, self.part_code, self._results)
        self._build_locks = BuildLocks(store)
        self._slices = SliceCache(self._calls, lambda: self.part_code.versions(None))
        self._convex = ConvexAnswers(self._calls, lambda: versions_of(["coacd", "manifold3d"], self.part_code.file_of, store))
        self._recent: dict[tuple[PartDefinition, tuple[int, ...]], tuple[PartRecord, str]] = {}
        self._expected: dict[str, CachedResult] = {}
        self._locked = LockAnswers(lock, workspace, self.part_code)
        self.unknown: list[str] = []
        self.reads: dict[str, dict[str, str]] = {}
        self.broken = self._locked.broken

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def inputs(self) -> frozenset[str]:
        """Absolute paths of the files and folders that the results depend on, in folders and packages that are tracked by content."""
        return frozenset(self.part_code.probed | self._results.consulted | self._locked.consulted)

    def warm(self) -> None:
        """Start the worker without waiting, so that it loads the kernel while the caller continues."""
        self._calls.pool().warm()

    def anticipate(self) -> bool:
        """Start to load the CAD kernel if there was no previous run in this workspace, or if a file that parts depend on has changed since
        then.

        Return whether the method started to load the kernel. Call this method before reading documents, because loading the kernel takes
        longest. If the workspace has a lock file, the kernel is not loaded.
        """
        if needed := not self._locked.exists and self._results.files_changed():
            self.warm()
        return needed

    def expect(self, last: GeometryService, saved: Collection[str] = ()) -> None:
        """Begin to build the parts of the service `last` whose code has changed, because these parts will probably be requested.

        `saved` contains the absolute paths of changed files. Workers build these parts while the classes are described. `realize` uses a
        result if the part still has the same parameters as in `last`, with the current default values.
        """
        count = 0
        self._calls.pool().prepare([path for path in saved if path.endswith(".py")])
        self._requests.slicings = dict(last._requests.slicings)
        for definition in last.wanted:
            prepared = self._requests.prepare(definition, last._requests.given_parameters(definition))
            if isinstance(prepared, PartFailure):
                continue
            cached = self._records.find(prepared)
            if cached is not None:
                self._expected[prepared.build_key.key] = cached
            elif count < self._jobs:
                self._calls.pool().begin([self._requests.with_slicings(prepared)])
                count += 1

    def close(self) -> None:
        """End the workers, unless they are shared."""
        self._calls.close()

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
            if (cached := self._results.find("schema", build_key.key)) is not None:
                answers[reference] = self._schema(reference, cached.value, code)
                self.reads[reference] = dict(cached.reads)
            elif (locked := self._locked.schema(reference)) is not None:
                answers[reference] = locked
            else:
                request = {"op": "describe", "references": [reference], **self._requests.common_fields(code)}
                task = PartRequest(subject=reference, build_key=build_key, code=code, request=request)
                tasks.setdefault(reference.partition(":")[0], []).append(task)
        groups = list(tasks.values())  # one child process per module, so that shared code of the classes in a file is loaded once
        if meanwhile is not None:
            self._calls.pool().begin(self._describing(groups))
            meanwhile()
        self._describe_in_workers(groups, answers)
        return answers

    def _describing(self, groups: list[list[PartRequest]]) -> Iterator[dict[str, Any]]:
        for index, group in enumerate(groups):
            references = [task.subject for task in group]
            placed = [task.subject for task in group if task.code is not None and task.code.place is not None]
            yield {**group[0].request, "references": references, "placed": placed, "group": index}

    def _describe_in_workers(self, groups: list[list[PartRequest]], described: dict[str, PartSchema | PartFailure]) -> None:
        if not groups:
            return
        single: list[list[PartRequest]] = []
        for request, answer in self._calls.run(list(self._describing(groups))):
            group = groups[request["group"]]
            if "failed" in answer:
                if len(group) > 1:  # a class ended the process: describe each class in its own process
                    single.extend([task] for task in group)
                else:
                    self._show_printed(group[0].subject, answer)
                    described[group[0].subject] = self._calls.failure(group[0].subject, answer)
                continue
            values, reads = answer["answer"]["answers"], answer["answer"]["reads"]
            failed = [task.subject for task in group if "failure" in values[task.subject]]
            if failed:  # the output of other classes is shown when their parts are built
                self._show_printed(failed[0], answer)
            for task in group:
                # the classes of a module are described together, so files that one class reads count for all classes
                self._results.keep("schema", task.build_key, values[task.subject], reads)
                self.reads[task.subject] = dict(reads)
                described[task.subject] = self._schema(task.subject, values[task.subject], task.code)
        self._describe_in_workers(single, described)

    def _schema(self, reference: str, value: Any, code: CodeIngredients | None) -> PartSchema | PartFailure:
        if "failure" in value:
            return self.part_code.with_namesakes(from_json(value["failure"], self.workspace.root, PartFailure))
        schema = from_json(value["schema"], self.workspace.root, PartSchema)
        if code is not None and code.place is not None:  # new comments change line numbers without a rebuild
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
        requests: dict[str, RecordRequest] = {}
        missing: list[RecordRequest] = []
        unique = {definition.text: definition for definition in definitions}
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
            requests[text] = prepared
            cached = self._expected.get(prepared.build_key.key) or self._records.find(prepared)
            if cached is not None:
                answers[text] = self._reuse(prepared, cached)
            elif locked and (locked_record := self._locked.record(definition)) is not None:
                self._decide(text, True, f"{LOCK_FILE} contains it")
                answers[text] = locked_record
                del requests[text]  # no part was built; `thingc why` reports the last build
            else:
                missing.append(prepared)
        tasks = self._requests.complete(missing, likely)
        if self._calls.workers is not None:
            self._calls.workers.forget([task.request for task in tasks])
        with closing(self._build_locks):
            self._model(tasks, answers)
        self._results.remember(
            (request.definition.reference, text, request.build_key)
            for text, request in requests.items() if isinstance(answers[text], PartRecord)
        )
        if requests:
            self._results.note_files({**self.part_code.files(), **self._results.met})
        keys = {text: (unique[text], convex.get(text, ())) for text in answers}
        new = {text: record for text, record in answers.items() if keys[text] not in self._recent}
        self._convex.add(new, convex)
        self._keep_recent({keys[text]: record for text, record in new.items()})
        answers |= new
        return {text: answers[text] for text in unique}

    def _keep_recent(self, answers: Mapping[tuple[PartDefinition, tuple[int, ...]], PartRecord | PartFailure]) -> None:
        for key, record in answers.items():
            if isinstance(record, PartRecord) and (decision := self.decisions.get(key[0].text)) is not None:
                self._recent[key] = record, decision.reason if decision.reused else unchanged_reason(decision.reason)
        while len(self._recent) > RECENT:
            del self._recent[next(iter(self._recent))]

    def decompose(self, meshes: Collection[tuple[str, int]]) -> Mapping[tuple[str, int], tuple[Mesh, ...] | PartFailure]:
        """Decompose meshes in the store into convex pieces, and return the pieces or the failure of each mesh."""
        return self._convex.pieces(meshes)

    def _model(self, tasks: Sequence[RecordRequest], answers: dict[str, PartRecord | PartFailure]) -> None:
        """Build the parts of these tasks in worker processes, and add their records or failures to `answers`.

        If another process is building a part, wait for its result.
        """
        by_text = {task.subject: task for task in tasks}
        built_elsewhere: list[RecordRequest] = []

        def find(task: RecordRequest) -> bool:
            """Return whether another process has built the part since the request was created."""
            cached = self._records.find_record(task.build_key.key)
            if cached is not None:
                answers[task.subject] = self._reuse(task, cached)
                self._build_locks.give_back(task.build_key.key)
            return cached is not None

        def needed_requests() -> Iterator[dict[str, Any]]:
            # without workers, do not wait for other processes
            has_workers = self._calls.workers is None or self._calls.workers.available
            for task in tasks:
                if has_workers and not self._build_locks.take(task.build_key.key):
                    built_elsewhere.append(task)
                elif not (has_workers and find(task)):
                    yield task.request

        def build(answered: Iterable[tuple[Mapping[str, Any], dict[str, Any]]]) -> None:
            for request, answer in answered:
                task = by_text[request["definition"]["text"]]
                answers[task.subject] = self._store_result(task, answer)
                self._build_locks.give_back(task.build_key.key)

        build(self._calls.run([task.request for task in tasks], "modelling", needed_requests()))
        for task in built_elsewhere:
            if task.subject not in answers:
                self._build_locks.wait(task.build_key.key, self.timeout + PATIENCE)
                if not find(task):
                    build(self._calls.run([task.request]))

    def _store_result(self, task: RecordRequest, answer: dict[str, Any]) -> PartRecord | PartFailure:
        """Store the record or failure that a worker created for a part definition, and return it."""
        self._decide(task.subject, False, task.reason)
        self._show_printed(task.definition.label, answer)
        if "failed" in answer:
            broken = self._calls.failure(task.subject, answer)
            if task.definition.kind == "file" and broken.kind == "crashed" and broken.message.startswith("killed by"):
                return replace(broken, kind="invalid", message=f"the CAD kernel cannot read the file ({broken.message})")
            return broken
        value = with_left(answer["answer"], answer.get("left", ()))
        reads, ran, slices = value.pop("reads"), value.pop("ran", None), value.pop("slices", ())
        self._results.keep("record", task.build_key, value, reads, task.reason)
        if not answer.get("left"):
            self._records.note_ran(task, ran, reads)
        self.reads[task.subject] = dict(reads)
        record = self._record(value, task.code)
        self._slices.keep(record, slices)
        return record

    def in_store(self, definition: PartDefinition) -> bool:
        """Return whether the store contains the record of a part definition."""
        prepared = self._requests.prepare(definition)
        return not isinstance(prepared, PartFailure) and self._records.find(prepared) is not None

    def _record(self, value: Any, code: CodeIngredients | None) -> PartRecord | PartFailure:
        if "failure" in value:
            return from_json(value["failure"], self.workspace.root, PartFailure)
        record = record_from_json(value["record"], self.workspace.root)
        return replace(record, code=code.place) if code is not None and code.place is not None else record

    def _reuse(self, request: RecordRequest, cached: CachedResult) -> PartRecord | PartFailure:
        """Return the cached record of a part, and store its reads and the reason for reusing the part."""
        self._decide(request.subject, True, unchanged_reason(cached.reason))
        self.reads[request.subject] = dict(cached.reads)
        return self._record(cached.value, request.code)

    def _decide(self, text: str, reused: bool, reason: str) -> None:
        self.decisions[text] = BuildReason(reused=reused, reason=reason)

    def slice(
        self, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
        requested: Mapping[str, Collection[Slicing]],
    ) -> dict[str, PartRecord | PartFailure]:
        """Slice parts for printing, and return their records with the resulting slices, keyed by definition text.

        `requested` contains the slicings to compute for each definition text. `records` contains the part records before slicing.
        """
        from_lock = [definition for definition in definitions if definition.text in lacking(records, requested)]
        if from_lock:
            decisions = self.decisions
            records = {**records, **self.realize(from_lock, locked=False)}
            self.decisions = {**decisions, **self.decisions}
        self._requests.expect_slicings(definitions, {text: [(one, False) for one in slicings] for text, slicings in requested.items()})
        return self._slices.add_slices(records, requested)

    # --- assemble ------------------------------------------------------------------------------------------------

    def assemble(self, name: str, instances: Sequence[Placed]) -> Callable[[], StoredFile]:
        """Start to write the STEP file of an assembly, unless the cache contains it with equal placements and colours.

        Return a function that waits for the file. The function raises `AssemblyFailed` if the kernel cannot write the file.
        """
        values = to_builtins(instances)
        key = repr([name, sorted(self.part_code.versions(None).items()), values])
        file = self.store.get_json("step", key)
        if file is not None and self.store.has(file["sha256"], file["size"]):
            return lambda: convert(file, StoredFile)
        wait = self._calls.begin_kernel_call(name, op="call", function=ASSEMBLE, arguments=[name, values])

        def finish() -> StoredFile:
            written = wait()
            self.store.put_json("step", key, written)
            return convert(written, StoredFile)

        return finish

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
        results = {brep: self.store.get_json("searches", key) for brep, key in keys.items()}
        missing = [brep for brep, result in results.items() if result is None]
        if missing:
            new_results = self._calls.begin_kernel_call(function, op="search", function=function, breps=missing)()["found"]
            for brep, result in new_results.items():
                self.store.put_json("searches", keys[brep], result)
            results |= new_results
        return {brep: convert(result, kind) for brep, result in results.items()}

    def _show_printed(self, part: str, answer: Mapping[str, Any]) -> None:
        if self._on_printed is not None and "printed" in answer:
            self._on_printed(part, answer["printed"])
