"""The main module of a worker process, which loads the CAD kernel: `python -m thingc.geometry.worker.server`.

Requests and answers are lines of JSON on standard input and output. The server imports build123d once and forks a child for each request.
When its input ends, the server ends all its children and exits immediately. With `--inline`, requests run in the server process itself.
This option is used on systems without fork, with one worker per core. With `--once`, the server reads one request to write or read a STEP
file, or to find features of shapes. These requests only require OCP.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import selectors
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from msgspec import convert, to_builtins

from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Outbox, Store, StoreUnusable
from thingc.geometry.worker.captured_output import lines_of
from thingc.geometry.worker.children import WATCH, Child, die_with_parent, fork_child, live_without_parent
from thingc.geometry.worker.process_tree import FIRST, adopt_orphans, give_priority
from thingc.geometry.worker.scratch import Scratch, remove, settle

AHEAD = (
    "importlib.metadata", "importlib.readers", "manifold3d", "numpy.ma", "thingc.geometry.worker.part_schemas",
    "thingc.geometry.worker.kernel.build_part", "thingc.geometry.worker.kernel.slicing", "thingc.geometry.things.adjust",
    "thingc.geometry.things.assets", "thingc.geometry.things.inspection", "thingc.geometry.things.resolver", "thingc.documents.workspace",
)
"""Modules that the server imports, so that its child processes do not have to import them."""


def main(arguments: list[str]) -> None:
    """Read requests from standard input and write the answers until standard input ends. The function does not return."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.dup(1)
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    parent = int(arguments[arguments.index("--parent") + 1]) if "--parent" in arguments else os.getppid()
    if hasattr(os, "fork"):
        die_with_parent(parent)  # standard input is not read while the kernel is loaded
    scratch = Scratch()
    settle(scratch.folder)
    try:
        if "--once" in arguments:
            _answer(answers, _answer_or_failure(json.loads(sys.stdin.buffer.readline())))
        elif not _load(answers):
            return
        elif hasattr(os, "fork") and "--inline" not in arguments:
            live_without_parent()  # from now on, the end of standard input ends the server; the thread that started it may end earlier
            if os.getppid() == parent:
                jobs = int(arguments[arguments.index("--jobs") + 1]) if "--jobs" in arguments else os.cpu_count() or 1
                _Server(answers, jobs, scratch).serve()
        else:
            for line in sys.stdin.buffer:
                folder = scratch.make()
                settle(folder)
                request = json.loads(line)
                _answer(answers, _move_results(_answer_or_failure({**request, "scratch": folder}), request["store"], folder))
    finally:
        scratch.close()
        os._exit(0)


def _load(answers: int) -> bool:
    """Import the CAD kernel and all modules that requests need. If an import fails, send the reason to the client, and return False."""
    gc.disable()
    try:
        from thingc.geometry.worker.lazy_build123d import import_cheaply

        import_cheaply("build123d")
        for name in AHEAD:
            importlib.import_module(name)
        _disable_threads()
        _enlarge_object_table()
        from thingc.geometry.key.modules import installed_roots
        from thingc.geometry.worker import executed_functions, impure_inputs
        from thingc.geometry.worker.file_reads import wrap_importers

        wrap_importers()
        installed_roots()  # cache the results, so that children do not have to search
        executed_functions.install()
        impure_inputs.install()
        sys.dont_write_bytecode = True  # modules that are imported after this line may be in folders of the user
    except BaseException as fault:
        import traceback

        _answer(answers, {"broken": f"{type(fault).__name__}: {fault}", "detail": traceback.format_exc()})
        return False
    gc.freeze()
    gc.set_threshold(400_000, 20, 100)  # a mesh consists of many small tuples
    gc.enable()
    _answer(answers, {"ready": True})
    return True


def _disable_threads() -> None:
    """Prevent the CAD kernel and (on Linux) manifold3d from starting threads, because child processes already run in parallel.

    Threads would take up to a fifth more processor time. The CAD kernel has a function that disables threads. TBB, which manifold3d uses,
    counts the available processors once, when it is first used. Therefore, the number is reduced before the first use.
    """
    from manifold3d import Manifold
    from OCP.OSD import OSD_ThreadPool

    OSD_ThreadPool.DefaultPool_s(1)
    if sys.platform == "linux":
        try:
            allowed = os.sched_getaffinity(0)
            os.sched_setaffinity(0, {min(allowed)})
        except OSError:  # some sandboxes refuse this call
            return
        Manifold.cube().volume()
        os.sched_setaffinity(0, allowed)


def _enlarge_object_table() -> None:
    """Make pybind11 enlarge the table in which it stores the objects of the CAD kernel.

    If a child process enlarged the table, all memory pages of the table would be copied. The new size is enough for twice the current
    number of objects, which is more than most parts need.
    """
    from OCP.gp import gp_Pnt

    _ = [gp_Pnt() for _ in range(6000)]


def _answer(descriptor: int, value: Mapping[str, Any]) -> None:
    data = json.dumps(value).encode() + b"\n"
    while data:
        data = data[os.write(descriptor, data) :]


def _answer_or_failure(request: Mapping[str, Any]) -> dict[str, Any]:
    try:
        return {"id": request["id"], **answer_request(request)}
    except BaseException as fault:
        import traceback

        message = f"{type(fault).__name__}: {fault}"
        return {"id": request["id"], "failed": "crashed", "message": message, "detail": traceback.format_exc()}


def answer_request(request: Mapping[str, Any]) -> dict[str, Any]:
    """Run a request, and measure its time.

    Return the `answer` and the `span` of the request. Return a failure if the store is unusable. `span` contains the start and the end time
    of the work (`time.monotonic`). For a part, the time begins when its class has been loaded.
    """
    start = time.monotonic()
    try:
        answer = perform(request)
        return {"answer": answer, "span": [answer.pop("loaded", start), time.monotonic()]}
    except StoreUnusable as fault:
        return {"failed": "unusable", "message": fault.reason}


def _move_results(answer: dict[str, Any], store: str, folder: str) -> dict[str, Any]:
    """Move the results of a request from its `folder` to the store and remove the folder.

    Return the answer with the lines that the part `printed`.
    """
    try:
        if "answer" in answer:
            Outbox(store, folder).deliver()
        lines = lines_of(folder)
        return {**answer, "printed": lines} if lines else answer
    except StoreUnusable as fault:
        return {"id": answer["id"], "failed": "unusable", "message": fault.reason}
    finally:
        remove(folder)


def perform(request: Mapping[str, Any]) -> dict[str, Any]:
    """Run a request of the kind `describe`, `model`, `decompose`, `slice`, `call` or `search`.

    `call` calls the `function` of a module (`module:function`) with the `arguments` and the store. `search` calls it with each of several
    B-reps.

    If the request has its own folder (`scratch`), files for the store are written there. Raises `StoreUnusable` if the store is not
    writable.
    """
    store = Outbox(request["store"], request["scratch"]) if "scratch" in request else Store(request["store"])
    operation = request["op"]
    if operation == "call":
        answer: dict[str, Any] = _function(request)(*request["arguments"], store)
        return answer
    if operation == "search":
        from thingc.geometry.worker.kernel.step_assembly import load_shape

        return {"found": {brep: to_builtins(_function(request)(load_shape(store, brep))) for brep in request["breps"]}}
    from thingc.geometry.worker.part_session import RequestContext

    if operation == "decompose":
        from thingc.geometry.worker.kernel.convex_decomposition import decompose

        return {"pieces": decompose(request["mesh"], request["most"], store)}
    if operation == "slice":
        from thingc.geometry.worker.kernel.slicing import slice_stored

        return slice_stored(request["mesh"], convert(request["slicing"], Slicing), store)
    context = convert(request, RequestContext)
    if operation == "describe":
        from thingc.geometry.worker.part_schemas import describe

        return describe(request["references"], request["placed"], context)
    from thingc.geometry.worker.kernel.build_part import Tessellations, build_part

    until = time.monotonic() + request["timeout"] / 2
    answer = build_part(request["definition"], convert(request["tessellations"], Tessellations), context, store)
    return {**answer, "slices": _likely_slices(answer, request["slicings"], store) if time.monotonic() < until else []}


def _function(request: Mapping[str, Any]) -> Callable[..., Any]:
    """Return the function `module:name` of a request."""
    module, _, name = request["function"].partition(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function


def _likely_slices(answer: Mapping[str, Any], likely: Iterable[tuple[Mapping[str, Any], bool]], store: Store) -> list[Any]:
    """Slice a part that was just built, with the settings that documents will probably use (`LikelySlicing`).

    Return a list of pairs. Each pair contains the settings and the result as JSON values. If slicing fails, the pair is omitted.
    """
    from thingc.geometry.worker.kernel.slicing import slice_stored

    record = answer.get("record", {})
    mesh = record.get("meshes", {}).get("slicing")
    answers: list[Any] = []
    for one, own_up in likely if mesh is not None else ():
        slicing = {**one, "up": own_up and record["up"] or one["up"]}
        with contextlib.suppress(Exception):
            answers.append([slicing, slice_stored(convert(mesh, Mesh).sha256, convert(slicing, Slicing), store)])
    return answers


class _Server:
    """The server that forks a child process for each request. Each child has a deadline and a folder. Processes that a child starts are
    ended together with the child.

    At most `jobs` children build parts at the same time. In addition, at most `jobs` children can describe classes, because the client
    waits for descriptions before it sends more requests. The server may fork one spare child before it receives a request.
    """

    def __init__(self, answers: int, jobs: int, scratch: Scratch) -> None:
        adopt_orphans()
        self.answers = answers
        self.jobs = jobs
        self.scratch = scratch
        self.usual = give_priority(FIRST)
        self.waiting: dict[bool, deque[dict[str, Any]]] = {True: deque(), False: deque()}  # describe requests, other requests
        self.running: dict[int, Child] = {}
        self.spare: Child | None = None
        self.selector = selectors.DefaultSelector()
        self.selector.register(0, selectors.EVENT_READ)
        self.received = bytearray()

    def serve(self) -> None:
        """Answer requests until standard input ends, or until the client no longer reads answers."""
        try:
            while True:
                self.begin_waiting()
                for key, _ in self.selector.select(WATCH if self.running else None):
                    if key.fd == 0:
                        data = os.read(0, 1 << 20)
                        if not data:
                            return
                        self.receive(data)
                    elif key.fd in self.running:
                        child = self.running[key.fd]
                        if not child.read() or child.answered:
                            self.finish(child)
                for child in list(self.running.values()):
                    reason = child.end_reason(time.monotonic())
                    if reason is not None:
                        self.finish(child, reason)
        except BrokenPipeError:
            return
        finally:
            for child in self.children():
                child.end("hung", ())

    def receive(self, data: bytes) -> None:
        """Process data that has arrived from the client or from a child process."""
        *lines, incomplete = (self.received + data).split(b"\n")
        self.received = bytearray(incomplete)
        for line in lines:
            self.take(json.loads(line))

    def take(self, message: dict[str, Any]) -> None:
        """Process a message from the client. The message can queue a request, cancel a request (`forget`), or announce a request
        (`prepare`).
        """
        if "prepare" in message:
            self.prepare({"hashes": dict.fromkeys(message["prepare"])})
            self.spare = self.spare or self.start()
            return
        if "forget" not in message:
            self.waiting[message["op"] == "describe"].append(message)
            return
        for one in [one for one in self.waiting[False] if one["id"] == message["forget"]]:
            self.waiting[False].remove(one)
        for child in [child for child in self.running.values() if child.request["id"] == message["forget"]]:
            self.end(child, "hung")
            remove(child.scratch)

    def begin_waiting(self, done: Child | None = None) -> None:
        """Start queued requests while there is capacity. The slot of the child `done`, which is about to end, counts as free."""
        for describes, requests in self.waiting.items():
            busy = sum((child.request["op"] == "describe") == describes for child in self.running.values() if child is not done)
            for _ in range(min(self.jobs - busy, len(requests))):
                self.begin(requests.popleft())

    def begin(self, request: dict[str, Any]) -> None:
        """Send a request to the spare child process. If there is no spare child process, fork a new child process."""
        self.prepare(request)
        child, self.spare = self.spare or self.start(), None
        child.ask(request)
        self.running[child.pipe] = child
        self.selector.register(child.pipe, selectors.EVENT_READ)

    def prepare(self, request: Mapping[str, Any]) -> None:
        """Load the modules that child processes need for a request. End an existing spare child, because it was forked before these modules
        were loaded.
        """
        if _prepare(request) and self.spare is not None:
            spare, self.spare = self.spare, None
            spare.end("hung", {child.process for child in self.children()})
            remove(spare.scratch)

    def start(self) -> Child:
        """Fork a new child process."""
        descriptors = [0, self.answers, *self.scratch.descriptors, *self.running]
        return fork_child(answer_request, self.usual, self.scratch.make(), descriptors)

    def children(self) -> list[Child]:
        """Return all child processes that are running, including the spare child."""
        return [*self.running.values(), *([self.spare] if self.spare is not None else [])]

    def finish(self, child: Child, reason: str | None = None) -> None:
        """End a child process and send its answer to the client.

        If the child has not started processes, it is only stopped before its answer is sent, and ended afterwards. The child is stopped
        first because freeing its memory takes as long as a fork.
        """
        only_stopped = reason is None and child.answered and child.stop()
        ended = child.answer if only_stopped else self.end(child, reason)
        _answer(self.answers, _move_results(ended, child.request["store"], child.scratch))
        if only_stopped:
            self.end(child, reason)

    def end(self, child: Child, reason: str | None) -> dict[str, Any]:
        """End a child process, and return its answer or its failure."""
        if child.answered:  # ending a child takes as long as a fork, so another core starts the next request
            self.begin_waiting(child)
        self.selector.unregister(child.pipe)
        del self.running[child.pipe]
        return child.end(reason, {other.process for other in self.children()})


def _prepare(request: Mapping[str, Any]) -> bool:
    """Do work that each child process would otherwise repeat, such as importing modules. Return whether there was such work.

    The part files are compiled without running them, the packages that they import are loaded, and the loaded modules are recorded.
    """
    from thingc.geometry.worker.file_reads import remember_loaded
    from thingc.geometry.worker.kernel.mesh_files import reads_with_trimesh
    from thingc.geometry.worker.loading import compile_ahead

    did_work = [compile_ahead(file, sha256) for file, sha256 in request.get("hashes", {}).items()]
    of_file = request.get("definition", {}).get("kind") == "file" and reads_with_trimesh(request["definition"]["reference"])
    for name in (*request.get("preload", ()), *(["trimesh"] if of_file else [])):
        if name not in sys.modules:
            with contextlib.suppress(Exception):
                importlib.import_module(name)
            did_work.append(True)
    remember_loaded()
    return any(did_work)


if __name__ == "__main__":
    main(sys.argv[1:])
