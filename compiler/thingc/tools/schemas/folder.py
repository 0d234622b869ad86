"""The folder `.thingc/schema/` of a workspace: one schema per document, each written aside and renamed, never in git."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterable
from typing import Any

from thingc.base.safe_text import json_text

FOLDER = ".thingc"
SCHEMAS = ".thingc/schema"
IGNORED = "*\n"
"""What `.gitignore` in the folder says."""


def schema_path(relative: str) -> str:
    """Where the schema of a document lies; both paths are in the workspace, with `/`."""
    return f"{SCHEMAS}/{relative}.json"


def text_of(schema: dict[str, Any]) -> str:
    """A schema as the file has it: on one line, which is written ten times faster than an indented one."""
    return json_text(json.dumps(schema, ensure_ascii=False)) + "\n"


def load_schema(root: str, relative: str) -> dict[str, Any]:
    """The schema of a document as it was last written; empty where there is none."""
    try:
        with open(os.path.join(root, schema_path(relative)), encoding="utf-8") as stream:
            schema = json.load(stream)
    except (OSError, ValueError):
        return {}
    return schema if isinstance(schema, dict) else {}


def write_schema(root: str, relative: str, schema: dict[str, Any]) -> bool:
    """Write the schema of a document where it is not the same already; whether it was. Raises OSError."""
    _ignore(root)
    return write_text(os.path.join(root, schema_path(relative)), text_of(schema))


def write_text(path: str, text: str) -> bool:
    """Write a file aside and rename it, where it does not hold the same text already; whether it was written."""
    data = text.encode("utf-8")
    try:
        with open(path, "rb") as stream:
            if stream.read() == data:
                return False
    except FileNotFoundError:
        pass
    os.makedirs(os.path.dirname(path), exist_ok=True)
    aside = f"{path}.{os.getpid()}.new"
    try:
        with open(aside, "wb") as stream:
            stream.write(data)
        if os.path.exists(path):
            os.chmod(aside, os.stat(path).st_mode & 0o777)
        os.replace(aside, os.path.realpath(path))
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(aside)
    return True


def remove_others(root: str, documents: Iterable[str]) -> list[str]:
    """Remove the schemas of documents that are not there any more; the documents' paths in the workspace."""
    top = os.path.join(root, SCHEMAS)
    kept = set(documents)
    removed: list[str] = []
    for folder, _, files in os.walk(top, topdown=False):
        for name in sorted(files):
            path = os.path.join(folder, name)
            relative = os.path.relpath(path, top).replace(os.sep, "/").removesuffix(".json")
            if name.endswith(".json") and relative not in kept:
                os.unlink(path)
                removed.append(relative)
        if folder != top:
            with contextlib.suppress(OSError):  # it is not empty
                os.rmdir(folder)
    return sorted(removed)


def _ignore(root: str) -> None:
    path = os.path.join(root, FOLDER, ".gitignore")
    if not os.path.exists(path):
        write_text(path, IGNORED)
