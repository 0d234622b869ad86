"""Read `parts.lock.json`. The file contains the schemas and records of parts, so that documents can be checked without running code.

The lock file is in the root folder of the workspace. The command `thingc lock` writes the file, and users commit it together with their
documents. A lock file of an untrusted workspace can be read safely. The reader checks the size, the structure and every number, and does
not run any code.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal, NoReturn

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import line_of
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.lock.json_format import BadLock, LockedSchema, read_record, read_value
from thingc.geometry.record import PartDefinition, PartRecord, PartSchema

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace
    from thingc.geometry.key.part_code import PartCode

LOCK_FILE = "parts.lock.json"
VERSION: Literal["lock/1"] = "lock/1"
MAX_BYTES = 10_000_000
REMAKE = "run `thingc lock`, and commit `parts.lock.json`"
"""The help text for all errors in lock files."""


class LockedThing(LockedSchema):
    """The entry of one part in the lock file: its schema, and what it was built from.

    `code` is the hash of the part's code. `reads` contains the states of the files that the part read, by path in the workspace. `records`
    contains the part records, keyed by definition text. Records are only validated when they are requested.
    """

    code: str
    reads: dict[str, str] = {}
    records: dict[str, Any] = {}

    def __post_init__(self) -> None:
        for file in self.reads:
            if os.path.isabs(file) or ".." in file.split("/") or "\0" in file:
                raise ValueError(f"expected `reads` to contain paths inside the workspace, found {file!r}")


class LockedFile(FrozenStruct):
    """The entry of a part that is a file: the state of the file's content, and the part record."""

    content: str
    record: Any


class Lock(FrozenStruct):
    """A parsed lock file.

    `things` is keyed by `module:Class`. `files` contains the parts that are files, by definition text. `others` contains classes that the
    workspace can use but that are not parts.
    """

    thingc: Literal["lock/1"]
    file: str = ""
    sha256: str = ""
    things: dict[str, LockedThing] = {}
    files: dict[str, LockedFile] = {}
    others: frozenset[str] = frozenset()

    def schema(self, reference: str) -> PartSchema | None:
        """Return the schema of the part `module:Class` from the lock file, without the location of the class.

        Return None if the lock file does not contain the class. Raises `BadLock` if the lock file contains an invalid value.
        """
        thing = self.things.get(reference)
        return None if thing is None else thing.schema(reference, f"things.{reference}")

    def record(self, definition: PartDefinition, code: tuple[str, int] | None = None) -> PartRecord | None:
        """Return the record of a part definition, or None if the lock file does not contain it.

        Raises `BadLock` if the lock file contains an invalid value.
        """
        text = definition.text
        if definition.kind == "file":
            file = self.files.get(text)
            return None if file is None else read_record(text, file.record, f"files.{text}.record", None)
        thing = self.things.get(definition.reference)
        if thing is None or text not in thing.records:
            return None
        return read_record(text, thing.records[text], f"things.{definition.reference}.records.{text}", code)

    def relatives(self, reference: str, code: tuple[str, int] | None = None) -> Iterable[PartRecord]:
        """Yield the records of the part `module:Class` in the lock file, for all parameter values in the file.

        Raises `BadLock` if the lock file contains an invalid value.
        """
        thing = self.things.get(reference)
        for text, values in (thing.records if thing is not None else {}).items():
            yield read_record(text, values, f"things.{reference}.records.{text}", code)


NO_LOCK = Lock(thingc=VERSION)
"""The lock of a workspace without a lock file."""


def lock_path(workspace: Workspace) -> str:
    """Return the path of the lock file in a workspace."""
    return os.path.join(workspace.root, LOCK_FILE)


def hash_of(reference: str, code: CodeIngredients | None, parts: PartCode) -> str:
    """Return the hash of the source code of the part `module:Class`. Comments, layout and docstrings do not change the hash.

    If `code` is None (a part of an installed package), return the hash of the version of the package.
    """
    package = reference.partition(":")[0].partition(".")[0]
    version = "" if code is not None else parts.versions(None, reference).get(f"version {package}", "unknown")
    ingredients = [["version", version]] if code is None else sorted(code.ingredients.items())
    return hashlib.sha256(json.dumps(ingredients, separators=(",", ":")).encode()).hexdigest()


def read_lock(workspace: Workspace, report: Report) -> Lock | None:
    """Read the lock file of a workspace. Return None if the workspace has no lock file. If the lock file is invalid, report the error and
    return None.
    """
    path = lock_path(workspace)
    if not os.path.lexists(path):
        return None
    if not os.path.isfile(path) or not workspace.contains(path):
        report.add(Code.LOCK_BROKEN, f"`{LOCK_FILE}` is not a file of this workspace", None, help="remove the file, then " + REMAKE)
        return None
    return read_lock_file(path, report)


def read_lock_file(path: str, report: Report) -> Lock | None:
    """Read and parse a lock file. If the file is unreadable or invalid, report the error and return None."""
    try:
        with open(path, "rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        report.add(Code.UNREADABLE, f"cannot read `{LOCK_FILE}`: {(error.strerror or 'an error').lower()}", None)
        return None
    try:
        return parse_lock(path, data)
    except BadLock as fault:
        report_bad(path, fault, report)
        return None


def report_missing(workspace: Workspace, report: Report) -> None:
    """Report an error if the workspace has no lock file.

    An invalid lock file is not reported, because `read_lock` has already reported it.
    """
    if not os.path.lexists(lock_path(workspace)):
        report.add(Code.NO_LOCK, f"the workspace has no `{LOCK_FILE}`", workspace.origin, help=REMAKE)


def report_bad(path: str, fault: BadLock, report: Report, *, severity: Severity = Severity.ERROR) -> None:
    """Report an invalid value in the lock file at `path`."""
    where = f" at `{fault.path[:200]}`" if fault.path else ""
    report.add(Code.LOCK_BROKEN, f"`{LOCK_FILE}` is invalid{where}: {fault}", line_of(path), help=REMAKE, severity=severity)


def parse_lock(path: str, data: bytes) -> Lock:
    """Parse the content of a lock file. Raises `BadLock` if the lock file contains an invalid value."""
    if len(data) > MAX_BYTES:
        raise BadLock("", f"the file has more than {MAX_BYTES} bytes")
    try:
        value = json.loads(data.decode("utf-8"), object_pairs_hook=_once, parse_float=_finite, parse_constant=_refuse)
    except UnicodeDecodeError:
        raise BadLock("", "the file is not UTF-8") from None
    except RecursionError:
        raise BadLock("", "the file has too many levels of nesting") from None
    except json.JSONDecodeError as fault:
        raise BadLock("", f"line {fault.lineno}, column {fault.colno} is not valid JSON") from None
    except ValueError:
        raise BadLock("", "a whole number in the file has too many digits") from None
    return replace(read_value(value, Lock, ""), file=path, sha256=hashlib.sha256(data).hexdigest())


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) != len(pairs):
        raise BadLock("", "a key occurs twice in one mapping")
    return table


def _refuse(constant: str) -> NoReturn:
    raise BadLock("", f"`{constant}` is not a number")


def _finite(digits: str) -> float:
    number = float(digits)
    if not math.isfinite(number):
        raise BadLock("", f"`{digits[:20]}` is too large")
    return number
