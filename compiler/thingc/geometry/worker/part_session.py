"""Run the code of part authors: load part modules, record the files that they read, and describe failures."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
import sys
import traceback
from collections.abc import Iterable
from time import monotonic
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.key.file_states import state_of
from thingc.geometry.record import FailureKind, ImpureInputs, PartFailure, SchemaKind
from thingc.geometry.things import assets
from thingc.geometry.things.inspection import is_part
from thingc.geometry.things.parameters import ParameterError, SignatureError
from thingc.geometry.worker import captured_output, executed_functions, sandbox
from thingc.geometry.worker.file_reads import FileReadRecorder, loaded_files
from thingc.geometry.worker.impure_inputs import ImpureInputRecorder
from thingc.geometry.worker.kernel.mesh_files import BadPartFile
from thingc.geometry.worker.loading import PartImporter


class NoPart(Exception):
    """Raised if a part cannot be described or built.

    The exception contains the kind of the failure (see `PartFailure`), the message, and the file and the line if they are known.
    """

    def __init__(self, kind: FailureKind, message: str, candidates: Iterable[str] = (), place: tuple[str, int] | None = None) -> None:
        super().__init__(message)
        self.kind = kind
        self.candidates = tuple(candidates)
        self.place = place


class RequestContext(FrozenStruct):
    """The settings of a request that runs part code: its folders, its files and its limits.

    `root` is the folder of the workspace, `parts` contains its part folders, and `packages` its packages. `hashes` contains the SHA-256 of
    the code files that are part of the key, and `plain` contains the part packages without `__init__.py`. `store` is the folder of the
    store, and `scratch` is the part's own folder.
    """

    root: str
    parts: tuple[str, ...]
    packages: tuple[str, ...]
    hashes: dict[str, str]
    plain: tuple[str, ...]
    store: str
    scratch: str


class PartSession:
    """A request that runs part code in its own process, with the folder of the workspace as the working folder.

    During the request, the importer is installed, and reads, impure inputs and output are recorded.

    `loaded` is the time at which the last requested class was loaded (`time.monotonic`).
    """

    def __init__(self, context: RequestContext) -> None:
        self.context = context
        self.importer = PartImporter(context.parts, context.packages, context.hashes, context.plain)
        self.recorder = FileReadRecorder(context.root, (context.store, context.scratch), context.hashes)
        self.impure_inputs = ImpureInputRecorder(self.is_own)
        self.loaded: float | None = None
        self._output = contextlib.ExitStack()
        self._changes = contextlib.ExitStack()

    def __enter__(self) -> PartSession:
        # a deleted folder does not have a name; Windows cannot open folders
        folder = os.open(os.curdir, os.O_RDONLY) if os.chdir in os.supports_fd else os.getcwd()
        if isinstance(folder, int):
            self._changes.callback(os.close, folder)
        self._changes.callback(os.chdir, folder)
        os.chdir(self.context.root)
        self._changes.callback(self.importer.remove)
        self.importer.install()
        executed_functions.begin()
        self.recorder.start()
        self.impure_inputs.start()
        sandbox.begin(self.context.scratch)
        self._output.enter_context(captured_output.keep(self.context.scratch))
        self._changes.callback(assets.install, None)
        assets.install(self.recorder.note, (self.context.root,))
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop()
        self._changes.close()

    def stop(self) -> None:
        """Stop all recording. Reads, inputs and changes after this call do not count, because the part does not cause them."""
        sandbox.end()
        self._output.close()
        self.recorder.stop()
        self.impure_inputs.stop()

    def is_own(self, file: str) -> bool:
        """Return whether a file contains code of the part's authors."""
        return file in self.context.hashes or file in self.importer.loaded.values()

    def reads(self, *mentioned: str | None) -> list[tuple[str, str]]:
        """Return the files that the part has read, with modules that are not covered by a version. The result also contains the files
        `mentioned`.

        These files are included because their layout determines line numbers in the answer.
        """
        states = dict(self.recorder.reads())
        loaded = [file for file in loaded_files() if file not in self.context.hashes and not self.recorder.leaves_out(file)]
        for file in (*loaded, *mentioned):
            if file is not None:
                states[self.recorder.relative(file)] = state_of(file)
        return sorted(states.items())

    def ran(self) -> dict[str, list[int] | None] | None:
        """Map each source file in the build key to the numbers of its functions that ran. The value None means that all functions of the
        file count as executed.

        Return None if other processes may have run functions of the part.
        """
        if any(warning.asked is ImpureInputs.PROCESS for warning in self.impure_inputs.found):
            return None
        return executed_functions.of([file for file in self.importer.loaded.values() if file in self.context.hashes], self.context.hashes)

    def part(self, reference: str) -> Any:
        """Import a module of a part, and return the object that `module:Class` names.

        Raises `NoPart` if the module does not contain the object. Exceptions of the module's own code are not caught.
        """
        module_name, _, name = reference.partition(":")
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as fault:
            if fault.name is not None and (module_name == fault.name or module_name.startswith(fault.name + ".")):
                raise NoPart("missing", f"there is no module `{module_name}`") from None
            raise
        part: Any = module
        for step in name.split("."):
            try:
                part = getattr(part, step)
            except AttributeError:
                names = sorted(
                    f"{module_name}:{member}" for member, value in vars(module).items()
                    if not member.startswith("_") and getattr(value, "__module__", None) == module_name and is_part(value)
                )
                raise NoPart("missing", f"the module `{module_name}` has no `{name}`", names) from None
        self.loaded = monotonic()
        return part

    def failure(self, subject: str, fault: BaseException) -> PartFailure:
        """Convert an exception of part code to a `PartFailure`. The failure refers to the innermost line in the authors' files.

        If the exception is a `MemoryError`, it is raised again.
        """
        if isinstance(fault, MemoryError):
            raise fault  # the available memory depends on the machine, so this failure must not be cached
        detail: str | None = "".join(traceback.format_exception(fault))
        column = 1
        places = [(one.filename, one.lineno) for one in traceback.extract_tb(fault.__traceback__) if self.is_own(one.filename)]
        if isinstance(fault, SyntaxError) and fault.filename is not None and self.is_own(fault.filename):
            places, column = [(str(fault.filename), fault.lineno)], fault.offset or 1
        file, line = places[-1] if places else (None, None)
        kind: FailureKind = "raised"
        message = _exception_text(fault)
        candidates: tuple[str, ...] = ()
        if isinstance(fault, NoPart):
            kind, message, candidates, detail = fault.kind, str(fault), fault.candidates, None
            file, line = fault.place or (file, line)
        elif isinstance(fault, sandbox.ForbiddenWrite):
            kind, message = "trespassed", f"`{self.recorder.relative(fault.filename)}`"
        elif isinstance(fault, (SignatureError, BadPartFile)) or isinstance(fault, ParameterError) and not places:
            kind, message = "invalid", str(fault)
        message = message.replace(os.path.join(self.context.root, ""), "")  # the path differs on other machines
        return PartFailure(
            subject=subject, kind=kind, message=message, file=file, line=line, candidates=candidates, detail=detail, column=column,
        )


def _exception_text(fault: BaseException) -> str:
    text = fault.msg if isinstance(fault, SyntaxError) else str(fault)
    if isinstance(fault, (NameError, AttributeError, ImportError)) and (suggestion := _python_suggests(fault)):
        text = f"{text}. {suggestion}"
    message = f"{type(fault).__name__}: {text}" if text else type(fault).__name__
    if isinstance(fault, ImportError) and (fault.name or "").startswith("thingc."):
        message = f"{message}; part files import from `thingc` itself: write `from thingc import MATE, MountPoint, Thing`"
    return "; ".join((message, *getattr(fault, "__notes__", ())))


def _python_suggests(fault: BaseException) -> str | None:
    """Return the suggestion that Python would print for an exception, such as `Did you mean: 'MountPoint'?`.

    Return None if Python would not print a suggestion. The function is needed because Python only computes suggestions for uncaught
    exceptions.
    """
    with contextlib.redirect_stderr(io.StringIO()) as captured_output:
        sys.__excepthook__(type(fault), fault, fault.__traceback__)
    match = re.search(r"\. (Did you (?:mean|forget)\b.*\?)\s*\Z", captured_output.getvalue())
    return match.group(1) if match is not None else None


def kind_of(part: Any, reference: str) -> SchemaKind:
    """Return the kind of the Python object to which a part reference refers. Raises `NoPart` if the object is not a part."""
    kind = is_part(part)
    if kind is None:
        raise NoPart("invalid", f"`{reference}` is not a part: expected a Thing, a build123d shape class or a function returning a shape")
    return kind
