"""`python -m thingc.realize.worker`: the process that holds the CAD kernel.

Requests and answers are lines of JSON on standard input and output. It imports build123d once and forks a child for each
request; at the end of its input it ends at once, with all of its children. `--inline` runs requests in the process itself
(systems without fork: one such worker per core); `--assemble` reads one request to write a STEP file and needs OCP only.
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
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.realize.scratch import Scratch

AHEAD = (
    "importlib.metadata", "importlib.resources.readers", "manifold3d", "thingc.realize.describing", "thingc.realize.modelling",
    "thingc.realize.slicing", "thingc.things.adjust", "thingc.things.assets", "thingc.things.inspection", "thingc.things.resolver",
    "thingc.workspace",
)
"""What children would each import again."""


def main(arguments: list[str]) -> None:
    """Serve until the end of standard input. Never returns."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.dont_write_bytecode = True
    answers = os.dup(1)
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    parent = int(arguments[arguments.index("--parent") + 1]) if "--parent" in arguments else os.getppid()
    if hasattr(os, "fork"):
        from thingc.realize.children import die_with_parent

        die_with_parent(parent)  # nobody watches standard input while the kernel is loaded
    from thingc.realize.scratch import Scratch, remove, settle

    scratch = Scratch()
    settle(scratch.folder)
    try:
        if "--assemble" in arguments:
            _answer(answers, _safely(json.loads(sys.stdin.buffer.readline())))
        elif not _load(answers):
            return
        elif hasattr(os, "fork") and "--inline" not in arguments:
            from thingc.realize.children import live_without_parent

            live_without_parent()  # from here on the end of standard input does it; the parent's thread may end before
            if os.getppid() == parent:
                jobs = int(arguments[arguments.index("--jobs") + 1]) if "--jobs" in arguments else os.cpu_count() or 1
                _serve(answers, jobs, scratch)
        else:
            for line in sys.stdin.buffer:
                folder = scratch.make()
                settle(folder)
                _answer(answers, _safely({**json.loads(line), "scratch": folder}))
                remove(folder)
    finally:
        scratch.close()
        os._exit(0)


def _load(answers: int) -> bool:
    """Import the kernel and everything requests need, once; False where that cannot be imported, which is said."""
    gc.disable()
    try:
        from thingc.realize.deferred import import_cheaply

        import_cheaply("build123d")
        for name in AHEAD:
            importlib.import_module(name)
        from thingc.realize import asking
        from thingc.realize.reads import wrap_importers

        wrap_importers()
        asking.install()
    except BaseException as fault:
        import traceback

        _answer(answers, {"broken": f"{type(fault).__name__}: {fault}", "detail": traceback.format_exc()})
        return False
    gc.freeze()
    gc.set_threshold(100_000, 20, 100)  # meshes are many small tuples
    gc.enable()
    _answer(answers, {"ready": True})
    return True


def _answer(descriptor: int, value: Mapping[str, Any]) -> None:
    data = json.dumps(value).encode() + b"\n"
    while data:
        data = data[os.write(descriptor, data) :]


def _safely(request: Mapping[str, Any]) -> dict[str, Any]:
    try:
        return {"id": request["id"], "answer": perform(request)}
    except BaseException as fault:
        import traceback

        words = f"{type(fault).__name__}: {fault}"
        return {"id": request["id"], "failed": "crashed", "words": words, "detail": traceback.format_exc()}


def perform(request: Mapping[str, Any]) -> dict[str, Any]:
    """Do what one request asks: `describe`, `model`, `decompose`, `slice` or `assemble`."""
    from thingc.realize.store import Store

    operation = request["op"]
    if operation == "assemble":
        from thingc.realize.assembling import assemble

        return assemble(request["name"], request["instances"], Store(request["store"]))
    from thingc.realize.session import Surroundings

    if operation == "decompose":
        from thingc.realize.decomposing import decompose

        return {"pieces": decompose(request["mesh"], Store(request["store"]))}
    if operation == "slice":
        from thingc.realize.slices import Slicing
        from thingc.realize.slicing import slice_stored

        return slice_stored(request["mesh"], Slicing(**request["slicing"]), Store(request["store"]))
    around = Surroundings(
        root=request["root"], parts=tuple(request["parts"]), packages=tuple(request["packages"]), hashes=dict(request["hashes"]),
        plain=tuple(request["plain"]), store=request["store"], scratch=request["scratch"],
    )
    if operation == "describe":
        from thingc.realize.describing import describe

        return describe(request["references"], around)
    from thingc.realize.modelling import Tessellations, model
    from thingc.workspace import Tessellation

    asked = {name: Tessellation(**values) for name, values in request["tessellations"].items()}
    return model(request["definition"], Tessellations(**asked), around)


def _serve(answers: int, jobs: int, scratch: Scratch) -> None:
    """The server: at most `jobs` children at once, each with its deadline and its folder."""
    from thingc.realize.children import Child, kill_group, start

    waiting: deque[dict[str, Any]] = deque()
    running: dict[int, Child] = {}
    selector = selectors.DefaultSelector()
    selector.register(0, selectors.EVENT_READ)
    received = bytearray()

    def finish(child: Child, *, hung: bool = False) -> None:
        selector.unregister(child.pipe)
        del running[child.pipe]
        _answer(answers, child.end(hung=hung))

    try:
        while True:
            while waiting and len(running) < jobs:
                request = waiting.popleft()
                _prepare(request)
                child = start(request, perform, scratch.make(), [0, answers, *scratch.descriptors, *running])
                running[child.pipe] = child
                selector.register(child.pipe, selectors.EVENT_READ)
            now = time.monotonic()
            for child in [child for child in running.values() if child.deadline <= now]:
                finish(child, hung=True)
            rest = min((child.deadline for child in running.values()), default=None)
            for key, _ in selector.select(None if rest is None else max(0.0, rest - time.monotonic())):
                if key.fd == 0:
                    data = os.read(0, 1 << 20)
                    if not data:
                        return
                    received += data
                    *lines, remainder = received.split(b"\n")
                    received = bytearray(remainder)
                    waiting.extend(json.loads(line) for line in lines)
                elif key.fd in running:
                    child = running[key.fd]
                    if not child.read() or child.answered:
                        finish(child)
    except BrokenPipeError:
        return
    finally:
        for child in running.values():
            kill_group(child.process)


def _prepare(request: Mapping[str, Any]) -> None:
    """What children would each do again: compile the part files (without running them), load the packages they import."""
    from thingc.realize.loading import compile_ahead

    for file, sha256 in request.get("hashes", {}).items():
        compile_ahead(file, sha256)
    for name in request.get("preload", ()):
        if name not in sys.modules:
            with contextlib.suppress(Exception):
                importlib.import_module(name)


if __name__ == "__main__":
    main(sys.argv[1:])
