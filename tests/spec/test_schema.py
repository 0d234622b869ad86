"""The JSON Schemas for editors: committed, up to date, and consistent with the compiler."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from schema_files import schema_files

from thingc.base.diagnostics import Report
from thingc.documents.load.discovery import is_document
from thingc.documents.load.documents import read_tree
from thingc.documents.spec.validation import KINDS
from thingc.tools.schemas.general_schema import json_schema

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {"assemblies": "**/*", "compiler/thingc/tools/templates": "**/*", ".": "*"}
DOCUMENTS = sorted(
    path for folder, pattern in FOLDERS.items() for path in (ROOT / folder).glob(pattern)
    if path.name == "thingc.toml" or (path.suffix in (".yaml", ".yml", ".toml") and is_document(str(path)))
)
schema_of = cache(json_schema)


def test_committed_schemas_are_up_to_date() -> None:
    files = schema_files()
    assert {*files} == {*(ROOT / "schemas").iterdir()} and {ROOT / "schemas" / f"{kind}-1.json" for kind in KINDS} < {*files}
    for path, text in files.items():
        assert path.read_bytes() == text.encode(), "run `python docs/generate.py`"


@pytest.mark.parametrize("kind", KINDS)
def test_schemas_name_their_dialect_and_kind(kind: str) -> None:
    """`test_schema_documents.py` compares the committed schemas with the metaschema."""
    schema = schema_of(kind)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert schema["title"] == f"thingc {kind} document, version 1"
    assert '"null"' not in json.dumps(schema)


def test_fields_have_title_description_and_examples() -> None:
    """An editor shows these for a key. The examples must be valid for the schema of the field."""
    silent, wrong = [], []
    for kind in KINDS:
        schema = json.loads((ROOT / "schemas" / f"{kind}-1.json").read_text(encoding="utf-8"))
        definitions = schema.get("$defs", {})
        for name, definition in {**definitions, kind: schema}.items():
            assert definition.get("description"), name
            assert definition["type"] == "object" and definition["additionalProperties"] is False, name
            for key, field in definition["properties"].items():
                silent += [f"{kind}: {name}.{key}: {word}" for word in ("title", "description", "examples") if not field.get(word)]
                validator = jsonschema.Draft202012Validator({**field, "$defs": definitions})
                wrong += [f"{kind}: {name}.{key}: {example!r}" for example in field.get("examples", []) if not validator.is_valid(example)]
    assert silent == []
    assert wrong == []


def test_mapping_fields_refer_to_their_definition() -> None:
    schema = schema_of("assembly")
    limit = schema["$defs"]["JointSpec"]["properties"]["limit"]
    assert limit["anyOf"][0] == {"$ref": "#/$defs/LimitSpec"} and limit["title"] == "Limit"
    defaults = schema["$defs"]["AssemblySpec" if "AssemblySpec" in schema["$defs"] else "DefaultsSpec"]["properties"]["joint"]
    assert defaults["$ref"] == "#/$defs/JointDefaults"
    assert defaults["description"] == "Defaults of joints."
    assert schema["$defs"]["DriveSpec"]["properties"]["kind"]["examples"] == ["position", "velocity", "motor"]


def test_field_docstrings_are_descriptions() -> None:
    """Inherited fields have descriptions too."""
    definitions = schema_of("assembly")["$defs"]
    assert definitions["ComponentSpec"]["properties"]["material"]["description"] == "A material that this document can use."
    assert definitions["ComponentSpec"]["properties"]["part"]["description"] == "The class of a part, as `module:Class`."
    rpy = definitions["AtSpec"]["properties"]["rpy"]["description"]
    assert rpy.startswith("Extrinsic roll, pitch, yaw, as in URDF. Three values, each an angle")
    assert definitions["LimitSpec"]["properties"]["effort"]["examples"] == ["4.1 N*m", "300 N", "=reach / 2"]


def plain(path: Path) -> dict[str, Any]:
    report = Report()
    tree = read_tree(str(path), path.read_bytes(), report)
    assert tree is not None
    assert not report.diagnostics
    value = tree.plain()
    assert isinstance(value, dict)
    return value


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_documents_of_the_repository_match_their_schema(path: Path) -> None:
    document = plain(path)
    kind = document["thingc"].partition("/")[0]
    jsonschema.Draft202012Validator(schema_of(kind)).validate(document)


GOOD = {"thingc": "assembly/1", "name": "x", "components": {"p": {"part": "a:B"}}}


@pytest.mark.parametrize("change", [
    {"nme": "x"}, {"name": "my arm"}, {"components": {}}, {"components": {"2p": {"part": "a:B"}}}, {"name": 5},
    {"thingc": "assembly/2"},
    {"components": {"p": {"part": "a:B", "mass": 5}}}, {"components": {"p": {"part": "a:B", "mass": "5"}}}, {"description": None},
    {"components": {"p": {"part": "a:B", "mass": {"value": "5 g"}}}}, {"components": {"p": {"part": "a:B", "collision": "hul"}}},
    {"joints": {"j": {"type": "revolute", "parent": "a.b"}}}, {"modes": {"b": {"at": {"xyz": ["0 mm", 0]}}}},
    {"components": {"p": {"link": True, "collision": {"modes": {"b": "hull"}}}}},
    {"components": {"p": {"link": True, "collision": {"targets": {"mjcf": {"decompose": {}}}}}}},
    {"components": {"p": {"part": "a:B", "com": [1, 2, 3]}}}, {"modes": {"b": {"contacts": {"exclude": [["a"]]}}}},
])
def test_schema_rejects_invalid_documents(change: dict[str, Any]) -> None:
    validator = jsonschema.Draft202012Validator(schema_of("assembly"))
    validator.validate(GOOD)
    with pytest.raises(jsonschema.ValidationError):
        validator.validate({**GOOD, **change})


def test_schema_accepts_valid_documents() -> None:
    validator = jsonschema.Draft202012Validator(schema_of("assembly"))
    for change in (
        {"$schema": "../schemas/assembly-1.json"},
        {"components": {"p": {"link": True, "collision": {"modes": {"b": "none", "c": {"shapes": [{"box": "1 1 1 mm"}]}}}}}},
        {"parameters": {"a": "5 mm", "b": {"value": 3, "min": 0}, "c": True, "d": "=a"}},
        {"materials": {"m": {"density": "5 kg/m^3"}}}, {"modes": {"b": {"gravity": "0 0 -9.81 m/s^2"}}},
        {"modes": {"b": {"gravity": "wall"}}},
        {"components": {"p": {"part": "a:B", "mass": "5 g", "com": [0, "=a", "1 mm"], "attach": {"back": "q.seat"}}}},
        {"components": {"p": {"part": "a:B", "mass": {"value": "=m", "source": "vendor"}, "repeat": {"count": "=n"}}}},
        {"raw": {"mjcf": {"a": {"b": 1}}}}, {"poses": {"h": {"j": 0, "leg_*": "folded", "k": "30 deg"}}},
    ):
        validator.validate({**GOOD, **change})
