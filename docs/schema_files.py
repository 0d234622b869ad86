"""Create the files of the folder `schemas/`, which editors and https://www.schemastore.org use."""

from __future__ import annotations

import json
from pathlib import Path

from thingc.documents.spec.validation import KINDS
from thingc.tools.schemas.general_schema import DIALECT, json_schema

FOLDER = Path(__file__).resolve().parents[1] / "schemas"
URL = "https://raw.githubusercontent.com/thingc/thingc/main/schemas/"
"""Base of the `$id` of schemas, where editors load them."""


def schema_files() -> dict[Path, str]:
    """Return the JSON Schemas of each kind of document and of all documents, and `catalog.json`, the entries for SchemaStore.

    The keys are paths. A file `*.thingc.yaml` may be of any kind except `workspace`, and an entry of SchemaStore has one schema. Therefore,
    the schema `document-1.json` selects the schema of the kind by the key `thingc`.
    """
    schemas = {f"{kind}-1.json": {"$schema": DIALECT, "$id": f"{URL}{kind}-1.json", **json_schema(kind)} for kind in KINDS}
    kinds_of_files = [kind for kind in KINDS if kind != "workspace"]
    either = [
        {"if": {"properties": {"thingc": {"const": f"{kind}/1"}}, "required": ["thingc"]}, "then": {"$ref": f"{kind}-1.json"}}
        for kind in kinds_of_files
    ]
    key = {"title": "Thingc", "description": "The kind of this document.", "enum": [f"{kind}/1" for kind in kinds_of_files]}
    schemas["document-1.json"] = {
        "$schema": DIALECT, "$id": f"{URL}document-1.json", "title": "thingc document, version 1", "type": "object",
        "properties": {"thingc": key}, "required": ["thingc"], "allOf": either,
    }
    named = ("thingc document", "A robot, materials or variants for thingc", [f"*.thingc.{end}" for end in ("yaml", "yml", "toml")])
    settings = ("thingc workspace", "Settings of a thingc workspace", ["thingc.toml"])
    entries = [
        {"name": name, "description": description, "fileMatch": match, "url": f"{URL}{file}"}
        for (name, description, match), file in ((named, "document-1.json"), (settings, "workspace-1.json"))
    ]
    schemas["catalog.json"] = {"version": 1, "schemas": entries}
    return {FOLDER / name: json.dumps(content, indent=2, ensure_ascii=False) + "\n" for name, content in schemas.items()}
