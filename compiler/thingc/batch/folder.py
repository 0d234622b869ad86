"""Prepare the folder of a batch: lock the folder, protect files of the user, and check whether an existing batch can be resumed."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import threading
from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.diagnostics import Code, Diagnostic, Severity, shown_path
from thingc.base.exceptions import PicklableError
from thingc.base.filesystem import NO_ROOM, BadPath, listing
from thingc.base.safe_text import json_text, quote_names
from thingc.base.suggestions import Hint, text_of
from thingc.batch import folder_layout
from thingc.batch.packed_layout import DamagedChunk, complete
from thingc.driver.output import NOTHING, lock_folder as lock_output_folder, unexpected_files as unexpected_in_build
from thingc.driver.up_to_date import state_of
from thingc.geometry.store.file_digests import Digests

KIND = "batch/1"
_OLD = re.compile(r"\.old-[0-9]+-[0-9a-f]{8}")
INNER = {
    folder_layout.VARIANTS: re.compile(r"[0-9a-f]{12}"), folder_layout.CHUNKS: re.compile(r"[0-9]{6}(\.run)?\.parquet|[0-9]{6}\.jsonl"),
    folder_layout.ASSETS: re.compile(r"[0-9a-f]{64}"), folder_layout.PICTURES: re.compile(r"[0-9a-f]{12}\.png"),
}
"""The names of the subfolders of a batch folder, and patterns of the names of files and folders in them."""
FOLDERS, PACKED = "folders", "packed"
"""Names of the layouts: `folders` stores each variant in a folder, and `packed` stores many variants in one file."""
MANY = 2000
"""Maximum number of variants for which `folders` is the default layout."""


class BatchFault(PicklableError):
    """Raised if a batch cannot start or continue.

    `diagnostic` is the reason, as a diagnostic with a code. Variants that are already built remain in the folder.
    """

    def __init__(self, code: Code, message: str, help: Hint | None = None, detail: str | None = None) -> None:
        super().__init__(f"{message}: {help}" if help else message)
        self.diagnostic = Diagnostic(code=code, severity=Severity.ERROR, message=message, help=text_of(help), detail=detail)


def lock_folder(folder: str) -> contextlib.AbstractContextManager[None]:
    """Lock the folder of a batch while the context is active. Raises `BatchFault` if another process has locked the folder."""

    def refuse(locked: str) -> None:
        message = f"another batch is being written to `{shown_path(locked)}`"
        raise BatchFault(Code.BATCH_LOCKED, message, "wait until the other batch has finished, or use another folder with -o")

    os.makedirs(os.path.dirname(folder), exist_ok=True)
    return lock_output_folder(folder, refuse)


def read_batch(folder: str) -> dict[str, Any] | None:
    """Return the content of the file `batch.json` in a folder. Return None if thingc did not write this file."""
    described = _read_json(folder, folder_layout.BATCH)
    return described if described.get("thingc") == KIND else None


def _read_json(folder: str, name: str) -> dict[str, Any]:
    """Return the JSON object in a file. Return an empty dict if the file is missing or damaged."""
    try:
        with open(os.path.join(folder, name), encoding="utf-8") as stream:
            content = json.load(stream)
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def read_description(document: str, folder: str, hint: str) -> dict[str, Any]:
    """Return the content of `batch.json` in the folder of a batch.

    Raises `BatchFault` with the help text `hint` if the folder does not contain a batch of `document`.
    """
    described = read_batch(folder)
    if described is None or described.get("document") != document:
        raise BatchFault(Code.NO_BATCH, f"there is no batch of `{document}` in `{shown_path(folder)}`", hint)
    return described


def check_chunks(folder: str, described: Mapping[str, Any]) -> None:
    """Raise `MissingChunk` if a file of a packed batch is missing. `described` is the content of the file `batch.json` of this batch."""
    if described["layout"] == PACKED:
        complete(folder, described.get("asked", 0) if described["finished"] else 0)


def write_batch(folder: str, batch: Mapping[str, Any]) -> None:
    """Write the file `batch.json` of a batch atomically."""
    _write_json(folder, folder_layout.BATCH, {"thingc": KIND, **batch})


def _write_json(folder: str, name: str, content: Mapping[str, Any]) -> None:
    path = os.path.join(folder, name)
    with open(f"{path}.new", "w", encoding="utf-8", newline="\n") as stream:
        stream.write(json_text(json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False)) + "\n")
    os.replace(f"{path}.new", path)


def record_states(folder: str, *names: str) -> None:
    """Record the current states of files that users can edit, so that the next batch can detect whether they have been edited."""
    _update_states(folder, {name: state_of(os.path.join(folder, name)) for name in names})


def clear_state(folder: str, name: str) -> None:
    """Delete the recorded state of a file before the file is written again."""
    _update_states(folder, {name: None})


def _update_states(folder: str, states: Mapping[str, str | None]) -> None:
    known = _read_json(folder, folder_layout.SHOWN)
    _write_json(folder, folder_layout.SHOWN, {name: state for name, state in {**known, **states}.items() if state is not None})


def are_unchanged(folder: str, *names: str) -> bool:
    """Return whether all named files are unchanged since their states were recorded."""
    known = _read_json(folder, folder_layout.SHOWN)
    return all(name in known and state_of(os.path.join(folder, name)) == known[name] for name in names)


def _find_edited(folder: str) -> list[str]:
    """Return the names of the files that the user has edited. Deleted and empty files do not count as edited."""
    known = _read_json(folder, folder_layout.SHOWN)
    mine = (folder_layout.TABLE_CSV, folder_layout.TABLE_PARQUET, folder_layout.PAGE)
    return [name for name in mine if name in known and state_of(os.path.join(folder, name)) not in (known[name], None, NOTHING)]


def prepare_folder(folder: str, document: str, assembly: str) -> None:
    """Prepare the folder for a new batch. `document` describes its variants.

    If the folder contains a finished batch of this document, the files of this batch are moved aside. The context manager
    `clear_in_background` later deletes the files that were moved aside. Raises `BatchFault` if the folder contains any other files.
    """
    if not os.path.lexists(folder):
        os.makedirs(folder)
    elif not os.path.isdir(folder):
        raise BatchFault(
            Code.UNEXPECTED, f"the batch folder `{shown_path(folder)}` is a file", "move the file, or use another folder with -o",
        )
    elif os.listdir(folder):
        described = read_batch(folder)
        if described is not None and described.get("document") != document:
            raise BatchFault(
                Code.UNEXPECTED, f"`{shown_path(folder)}` contains the batch of another document (`{described.get('document')}`)",
                "move the existing files, or use another folder with -o",
            )
        unexpected = sorted([*unexpected_files(folder, assembly), *_find_edited(folder)])
        if described is None or unexpected:
            raise BatchFault(
                Code.UNEXPECTED, f"`{shown_path(folder)}` contains unknown or modified files ({quote_names(unexpected, 8)})",
                "move the files, or use another folder with -o",
            )
        if not described.get("finished"):
            raise BatchFault(
                Code.BATCH_UNFINISHED, f"`{shown_path(folder)}` contains an unfinished batch",
                "continue with --resume, or delete the folder",
            )
        _set_aside(folder, described)


def create_subfolders(folder: str, layout: str) -> None:
    """Create the subfolders that a batch with this layout requires.

    The file `batch.json` must already exist, so that an interrupted run can be resumed.
    """
    for inner in (folder_layout.CHUNKS if layout == PACKED else folder_layout.VARIANTS, folder_layout.ASSETS):
        os.makedirs(os.path.join(folder, inner), exist_ok=True)


def _set_aside(folder: str, described: Mapping[str, Any]) -> None:
    """Rename the files of a finished batch, so that they can be deleted later.

    If the renaming is interrupted, the old batch is treated as unfinished and can be resumed.
    """
    write_batch(folder, {**{key: value for key, value in described.items() if key != "thingc"}, "finished": False})
    for name in (folder_layout.JOURNAL, folder_layout.TABLE_CSV, folder_layout.TABLE_PARQUET, folder_layout.PAGE):
        with contextlib.suppress(FileNotFoundError):
            os.unlink(os.path.join(folder, name))
    old = os.path.join(folder, f".old-{os.getpid()}-{os.urandom(4).hex()}")
    os.mkdir(old)
    for inner in INNER:
        with contextlib.suppress(FileNotFoundError):
            os.rename(os.path.join(folder, inner), os.path.join(old, inner))


@contextlib.contextmanager
def clear_in_background(folder: str) -> Iterator[None]:
    """Delete the files of old batches in a background thread, because deleting thousands of variants takes seconds.

    On exit, the context manager waits until all files are deleted. After an exception, the next batch deletes the remaining files.
    """
    stopped = threading.Event()
    old = [os.path.join(folder, name) for name in os.listdir(folder) if _OLD.fullmatch(name)]
    thread = threading.Thread(target=_delete, args=(old, stopped), name="thingc-clearing", daemon=True)
    thread.start()
    try:
        yield
    except BaseException:
        stopped.set()
        raise
    finally:
        thread.join()


def _delete(folders: list[str], stopped: threading.Event) -> None:
    """Delete folders that were moved aside, one variant at a time, until the event `stopped` is set."""
    for folder in folders:
        for inner in INNER:
            place = os.path.join(folder, inner)
            for name in listing(place):
                if stopped.is_set():
                    return
                folder_layout.remove(os.path.join(place, name))
        shutil.rmtree(folder, ignore_errors=True)


def unexpected_files(folder: str, assembly: str) -> list[str]:
    """Return the sorted paths of all files in the folder that a batch must not delete.

    A batch must not delete files that no batch of `assembly` wrote, or that have changed since a batch wrote them.
    """
    known: Digests = {}  # variants share meshes
    paths = [name for name in os.listdir(folder) if name.removesuffix(".new") not in folder_layout.OWN and not _OLD.fullmatch(name)]
    for inner, pattern in INNER.items():
        place = os.path.join(folder, inner)
        for name in os.listdir(place) if os.path.isdir(place) else ():  # an unreadable variant can contain any files
            if name.startswith(folder_layout.NEW):
                continue
            path = f"{inner}/{name}"
            if not pattern.fullmatch(name):
                paths.append(path)
            elif inner == folder_layout.VARIANTS:
                paths.extend(f"{path}/{file}" for file in unexpected_in_build(os.path.join(folder, path), assembly, known=known).names)
    return sorted(paths)


def differences(previous: Mapping[str, Any], current: Mapping[str, Any]) -> list[str]:
    """Compare the content `previous` of `batch.json` with the new content `current`. Return the reasons against resuming the batch."""
    reasons: list[str] = []
    if previous["layout"] != current["layout"]:
        reasons.append(f"the layout is `{previous['layout']}`, not `{current['layout']}`")
    if previous.get("plan") != current["plan"]:
        reasons.append("the settings, rules, modes or targets of the variants differ")
    if changed := _differing_names(previous.get("inputs"), current["inputs"]):
        reasons.append(f"{quote_names(changed, 4)} changed")
    if versions := _differing_names(previous.get("versions"), current["versions"]):
        reasons.append("the installed versions differ: " + ", ".join(f"`{name}`" for name in versions))
    return reasons


def _differing_names(previous: Any, current: Mapping[str, Any]) -> list[str]:
    """Return the sorted names that have different values in two mappings."""
    old = previous if isinstance(previous, dict) else {}
    return sorted(name for name in {*old, *current} if old.get(name) != current.get(name))


def explain_os_error(folder: str, fault: OSError) -> BatchFault:
    """Convert an error of the operating system to a `BatchFault` that explains why the folder of a batch cannot be read or written."""
    if isinstance(fault, DamagedChunk):
        return BatchFault(Code.BATCH_CHANGED, fault.words, fault.cure)
    if isinstance(fault, BadPath):
        message = f"a file of the batch in `{shown_path(folder)}` is damaged: {fault}"
        return BatchFault(Code.BATCH_CHANGED, message, "delete the folder and build the batch again")
    place = shown_path(str(fault.filename)) if fault.filename is not None else shown_path(folder)
    if fault.errno in NO_ROOM:
        return BatchFault(
            Code.OUTPUT, f"not enough disk space for the batch in `{shown_path(folder)}`: {os.strerror(fault.errno)}",
            "free some space, and continue with --resume",
        )
    if isinstance(fault, (FileExistsError, NotADirectoryError)):
        return BatchFault(
            Code.OUTPUT, f"cannot write the batch to `{shown_path(folder)}`: a parent of the folder is a file",
            "move the file, or use another folder with -o",
        )
    return BatchFault(
        Code.OUTPUT, f"cannot write the batch to `{place}`: {fault.strerror or fault}",
        "make the folder writable and continue with --resume, or use another folder with -o",
    )
