"""Skip a command if none of its inputs has changed since the last run.

All inputs and the result of a run are recorded in a *stamp*, which is saved in the store. A stamp is valid if all input files are
unchanged, all missing files are still missing, and thingc and all installed packages are the same. If the stamp is valid, the recorded
diagnostics are printed again, and no document is parsed. For the command `build`, the build folder must also be unchanged.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, get_type_hints

import msgspec
from msgspec.structs import asdict

import thingc
from thingc.base.diagnostics import Code, Diagnostic
from thingc.driver.environment import Environment
from thingc.driver.pipeline import Compilation
from thingc.geometry.store.local import Store

FOLDER = "folder:"
"""Prefix of the digest of a folder, which distinguishes it from the digest of a file."""


def fingerprint() -> str:
    """Return a digest of the Python interpreter, the installed packages, the code of thingc, and the environment variables that affect
    builds.

    The installed packages are identified by the names of their metadata folders, which contain the versions.
    """
    from thingc.geometry.key.environment_variables import passed_variables

    variables = [*sorted(passed_variables().items()), os.environ.get("SOURCE_DATE_EPOCH")]
    digest = hashlib.sha256(f"{sys.version}\n{variables}\n".encode("utf-8", "surrogateescape"))
    for entry in filter(os.path.isdir, sys.path):
        for name in sorted(os.listdir(entry)):
            if name.endswith((".dist-info", ".egg-info", ".pth")):
                digest.update(f"{entry}/{name}\n".encode())
    digest.update(_code_state())
    return digest.hexdigest()


@cache
def _code_state() -> bytes:
    """Return the sizes and modification times of all files of thingc.

    They are read once per process, because a process continues to run the code that it has loaded, even if the files change.
    """
    package_folder, lines = os.path.dirname(thingc.__file__), []
    for folder, folders, names in os.walk(package_folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        for name in sorted(names):
            state = os.stat(f"{folder}/{name}")
            lines.append(f"{folder[len(package_folder):]}/{name} {state.st_size} {state.st_mtime_ns}\n")
    return "".join(lines).encode()


def state_of(path: str, store: Store | None = None) -> str | None:
    """Return a digest of a file or folder, or None if the path does not exist.

    The digest of a file is the SHA-256 of its content. The digest of a folder is `folder:` and the SHA-256 of the names of its entries. If
    `store` is given, the digests of large files are cached.
    """
    from thingc.geometry.store.file_digests import digest_of

    try:
        return digest_of(path, store)
    except IsADirectoryError:
        names = "\n".join(sorted(os.listdir(path)))
        return FOLDER + hashlib.sha256(names.encode("utf-8", "surrogateescape")).hexdigest()
    except (OSError, ValueError):
        return None


def key_of(command: str, document: str, choice: Mapping[str, object]) -> str:
    """Return the key of the stamp of a command in the store. `choice` contains the options of the command."""
    text = json.dumps([command, os.path.abspath(document), choice], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def save(
    store: Store, key: str, inputs: Mapping[str, str | None] | None, diagnostics: Sequence[Diagnostic], answer: Mapping[str, object]
) -> None:
    """Save the stamp of a finished command in the store.

    The stamp contains the inputs, the diagnostics, and the result `answer` of the command. `inputs` maps absolute paths to digests (see
    `state_of`). If an input has changed during the run, `inputs` is None, and nothing is saved.
    """
    if inputs is not None:
        plain = [to_plain(d) for d in diagnostics]
        stamp = {"fingerprint": fingerprint(), "inputs": dict(inputs), "diagnostics": plain, "answer": dict(answer)}
        store.note_json("stamp", key, stamp)


def load(store: Store, key: str) -> tuple[list[Diagnostic], dict[str, Any]] | None:
    """Return the diagnostics and the result of the last run of a command, or None if an input has changed since the run."""
    stamp = store.get_json("stamp", key)
    if not isinstance(stamp, dict) or any(state_of(path, store) != state for path, state in stamp["inputs"].items()):
        return None
    if stamp["fingerprint"] != fingerprint():
        return None
    return [from_plain(d) for d in stamp["diagnostics"]], dict(stamp["answer"])


def to_plain(d: Diagnostic) -> dict[str, object]:
    """Convert a diagnostic to values that can be serialized as JSON."""
    plain: dict[str, object] = msgspec.to_builtins({**asdict(d), "code": d.code.name}, enc_hook=str)  # converts subclasses of `str`
    return plain


@cache
def _types() -> dict[str, Any]:
    return get_type_hints(Diagnostic)


def from_plain(plain: Mapping[str, object]) -> Diagnostic:
    """Convert the values that `to_plain` returns back to a diagnostic."""
    fields = {name: msgspec.convert(value, _types()[name]) for name, value in plain.items() if name != "code"}
    return Diagnostic(code=Code[str(plain["code"])], **fields)


def inputs(environment: Environment, compilation: Compilation) -> dict[str, str | None] | None:
    """Return all files and folders that a compilation has read, as a mapping from absolute paths to digests.

    Call this function only if the compilation has no errors. Return None if a file has changed during the compilation, because its content
    at the time of reading is unknown.
    """
    workspace, documents = environment.workspace, compilation.documents
    assert workspace is not None and documents is not None
    states = {**workspace.inputs, **{document.path: document.sha256 for document in documents.by_path.values()}}
    states.update({path: state_of(path, environment.store) for path in dependencies_of(environment, compilation) if path not in states})
    changed = any(state is not None and os.stat(path).st_mtime_ns >= environment.started for path, state in states.items())
    return None if changed else states


def dependencies_of(environment: Environment, compilation: Compilation) -> set[str]:
    """Return the absolute paths of all files and folders on which a compilation depends, even if the compilation has errors.

    Missing files are included. Files of packages are included only if the packages are tracked by content.
    """
    from thingc.documents.workspace import settings_files
    from thingc.model.resolve.choices import chosen_files

    workspace, documents = environment.workspace, compilation.documents
    paths = {environment.document, *(workspace.inputs if workspace is not None else settings_files(environment.document))}
    if workspace is not None:
        paths.update(environment.parts.inputs, chosen_files(compilation.settings.choices, environment.document))
        paths.update(environment.locked.inputs if "locked" in vars(environment) else ())
    if documents is not None:
        paths.update(documents.files, (document.path for document in documents.by_path.values()))
    return paths
