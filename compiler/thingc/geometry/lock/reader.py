"""Read part schemas and records from `parts.lock.json`. The lock file is used in addition to the store, or as the only source if no code
may run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property
from typing import Any, TypeVar

from msgspec.structs import replace

from thingc.documents.workspace import Workspace
from thingc.geometry.build_reasons import BuildReason
from thingc.geometry.key.file_states import state_of
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.modules import Module
from thingc.geometry.key.part_code import PartCode
from thingc.geometry.lock.json_format import CONTINUOUS, BadLock
from thingc.geometry.lock.lock import LOCK_FILE, NO_LOCK, Lock, hash_of, lock_path
from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import NO_PIECES, ActuatorRecord, Mesh, PartDefinition, PartFailure, PartRecord, PartSchema, WantedPieces
from thingc.geometry.slice_cache import lacking

MAX_READ = 200_000_000
"""Maximum total size [bytes] of the files that are compared with the lock file. The limit applies to parts that are files, and to files
that parts read.
"""

_SOME = 1e-6
"""Placeholder for the volume, the area or the moments of a part, if the value is not used."""
_T = TypeVar("_T")


class LockAnswers:
    """Looks up schemas and records of parts in the lock file of a workspace, which the function `read` reads when it is first needed.

    An entry is used only if it matches the current code and files of the part. `consulted` contains the absolute paths of the files that
    were read. Errors in the lock file are added to `broken`, and the entry with the error counts as missing.
    """

    def __init__(self, read: Callable[[], Lock | None] | None, workspace: Workspace, parts: PartCode) -> None:
        self.broken: list[BadLock] = []
        self.workspace = workspace
        self.consulted: set[str] = set()
        self._read = read
        self._parts = parts
        self._states: dict[tuple[str, bool], str] = {}
        self._bytes = 0
        self._current: dict[str, bool] = {}

    @cached_property
    def lock(self) -> Lock:
        """The lock file. If the workspace has no valid lock file, the lock is empty."""
        lock = self._read() if self._read is not None else None
        if lock is None:
            return NO_LOCK
        self.consulted.add(lock.file)
        return lock

    @property
    def exists(self) -> bool:
        """Whether a lock file exists and may be used."""
        return self._read is not None and os.path.lexists(lock_path(self.workspace))

    def current(self, reference: str) -> bool:
        """Return whether the lock file matches the current code of `module:Class` and the current state of the files that this code
        read.
        """
        if reference not in self._current:
            thing = self.lock.things.get(reference)
            code = self._parts.code(reference)
            self._current[reference] = (
                thing is not None and not isinstance(code, PartFailure) and thing.code == hash_of(reference, code, self._parts)
                and all(self.state(path, state) == state for path, state in thing.reads.items())
            )
        return self._current[reference]

    def state(self, path: str, like: str) -> str:
        """Return the state of a file or folder of the workspace, in the format of the entries in `reads`.

        The method reads only regular files and folders.
        """
        folder = like.startswith("folder:")
        if (path, folder) not in self._states:
            self._states[path, folder] = self._look(os.path.join(self.workspace.root, path), folder)
        return self._states[path, folder]

    def _look(self, path: str, folder: bool) -> str:
        if not self.workspace.contains(path):
            return "outside"
        self.consulted.add(os.path.normpath(path))
        if os.path.isfile(path):
            self._bytes += os.stat(path).st_size
            if self._bytes > MAX_READ:
                return "too large"
        elif os.path.lexists(path) and not os.path.isdir(path):
            return "special"
        return state_of(path, listed=folder)

    def schema(self, reference: str) -> PartSchema | None:
        """Return the part schema of `module:Class`, with the location of its class.

        Return None if the lock file is out of date or does not contain the schema.
        """
        if not self.current(reference):
            return None
        schema = self._try_read(self.lock.schema, reference)
        place = self.place(reference)
        return replace(schema, file=place[0], line=place[1]) if schema is not None and place is not None else schema

    def record(self, definition: PartDefinition) -> PartRecord | None:
        """Return the record of a part definition.

        Return None if the lock file is out of date or does not contain the record.
        """
        if definition.kind == "file":
            file = self.lock.files.get(definition.text)
            if file is None or self.state(definition.reference, "file:") != file.content:
                return None
        elif not self.current(definition.reference):
            return None
        return self._try_read(self.lock.record, definition, self.place(definition.reference))

    def relative(self, definition: PartDefinition) -> PartRecord | None:
        """Return a placeholder record for a part definition that is not in the lock file.

        Return None if the lock file does not contain the class of the part. The placeholder has the same mounts as the records of the class
        with other parameters. The placeholder has no mounts if counts, flags, choices or strings that differ from their defaults may affect
        the names of mounts.
        """
        schema = self._try_read(self.lock.schema, definition.reference)
        if schema is None:
            return None
        values = dict(definition.parameters)
        same_mounts = all(one.kind in CONTINUOUS or values.get(one.name) == one.default for one in schema.parameters)
        place = self.place(definition.reference)
        relatives: list[PartRecord] | None = self._try_read(list, self.lock.relatives(definition.reference, place)) if same_mounts else []
        if relatives is None:
            return None
        return PartRecord(
            text=definition.text, material=schema.material, volume=_SOME, area=_SOME,
            inertia=((_SOME, 0.0, 0.0), (0.0, _SOME, 0.0), (0.0, 0.0, _SOME)),
            mounts={name: mount for record in relatives for name, mount in record.mounts.items()},
            actuator=ActuatorRecord(kind="motor") if schema.actuator else None, code=place, exact=False,
        )

    def place(self, reference: str) -> tuple[str, int] | None:
        """Return the file and line of the class `module:Class`, or None if the class is not found."""
        code = self._parts.code(reference) if ":" in reference else None
        return code.place if isinstance(code, CodeIngredients) else None

    def _try_read(self, read: Callable[..., _T], *arguments: Any) -> _T | None:
        try:
            return read(*arguments)
        except BadLock as fault:
            self.broken.append(fault)
            return None


class LockOnlyGeometry:
    """A replacement for `GeometryService` that uses only the lock file. The replacement does not import code of the workspace, start
    processes or use a store.

    `unknown` contains the labels of definitions that are not in the lock file, and `broken` contains the errors in the lock file. Without a
    lock file, the only results are failures of parts that cannot be loaded or must not be loaded. The caller must report that the lock file
    is missing.
    """

    def __init__(self, workspace: Workspace, lock: Lock | None) -> None:
        self.workspace = workspace
        self.decisions: Mapping[str, BuildReason] = {}
        self.unknown: list[str] = []
        self._lock = lock
        self._parts = PartCode(workspace, None)
        self._answers = LockAnswers(lambda: lock, workspace, self._parts)
        self.broken = self._answers.broken

    @property
    def inputs(self) -> frozenset[str]:
        """Absolute paths of the files on which the schemas and records from the lock file depend."""
        return frozenset(self._parts.probed | self._answers.consulted | ({self._lock.file} if self._lock is not None else set()))

    def anticipate(self) -> bool:
        """Do nothing and return False, because parts are never built."""
        return False

    def close(self) -> None:
        """Do nothing, because there are no processes to end."""

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """Return the part schema or failure of each `module:Class`, by reference.

        Without a lock file, references without a failure are omitted.
        """
        answers = {reference: self._find_schema(reference) for reference in dict.fromkeys(references)}
        return {reference: answer for reference, answer in answers.items() if answer is not None}

    def _find_schema(self, reference: str) -> PartSchema | PartFailure | None:
        code, lock, answers = self._parts.code(reference), self._lock, self._answers
        if isinstance(code, PartFailure):
            return code
        if lock is None:
            return None
        file, line = (code.place if code is not None else None) or (None, None)
        thing = lock.things.get(reference)
        if thing is None:
            if reference in lock.others:
                return PartFailure(subject=reference, kind="invalid", message="the class is not a part", file=file, line=line)
            message = f"`{LOCK_FILE}` does not contain this part"
            return PartFailure(subject=reference, kind="unlocked", message=message, file=file, line=line)
        schema = answers.schema(reference)
        if schema is not None:
            return schema
        if answers.current(reference):
            return PartFailure(subject=reference, kind="unlocked", message=f"the entry of this part in `{LOCK_FILE}` is invalid")
        what = "the code" if thing.code != hash_of(reference, code, self._parts) else "a file that the part reads"
        return PartFailure(
            subject=reference, kind="stale", message=f"{what} has changed since `{LOCK_FILE}` was written", file=file, line=line,
        )

    def hiding(self, reference: str) -> tuple[Module, ...]:
        """Return the modules that hide other modules of the same name, among the modules on which the part `module:Class` depends."""
        return self._parts.hiding(reference)

    def realize(
        self, definitions: Sequence[PartDefinition], convex: WantedPieces = NO_PIECES, likely: object = None,
    ) -> dict[str, PartRecord | PartFailure]:
        """Return the record or failure of each definition, by text.

        For a definition that is not in the lock file, the record is a placeholder with the names of its mounts. If these names are not
        known either, the definition is omitted.
        """
        records: dict[str, PartRecord | PartFailure] = {}
        for definition in definitions if self._lock is not None else ():
            before = len(self.broken)
            record = self._answers.record(definition)
            if record is None and definition.kind == "file":
                records[definition.text] = _unlocked_file(definition, self._answers.lock)
                continue
            if record is None and len(self.broken) == before:
                self.unknown.append(definition.label)
                record = self._answers.relative(definition)
            if record is not None:
                records[definition.text] = record
        return records

    def decompose(self, meshes: Collection[tuple[str, int]]) -> Mapping[tuple[str, int], tuple[Mesh, ...] | PartFailure]:
        """Return no pieces, because a lock file does not contain meshes."""
        return {}

    def slice(
        self, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
        requested: Mapping[str, Collection[Slicing]],
    ) -> dict[str, PartRecord | PartFailure]:
        """Return part records with slices from the lock file. If the slices of a record are missing, the record becomes inexact, and its
        label is added to `unknown`.
        """
        sliced = dict(records)
        labels = {definition.text: definition.label for definition in definitions}
        for text in lacking(records, requested):
            record = sliced[text]
            if isinstance(record, PartRecord) and record.exact:
                self.unknown.append(labels[text])
                sliced[text] = replace(record, exact=False)
        return sliced


def _unlocked_file(definition: PartDefinition, lock: Lock) -> PartFailure:
    reference = definition.reference
    if definition.text in lock.files:
        return PartFailure(subject=reference, kind="stale", message=f"the file has changed since `{LOCK_FILE}` was written")
    return PartFailure(subject=reference, kind="unlocked", message=f"`{LOCK_FILE}` does not contain this part")
