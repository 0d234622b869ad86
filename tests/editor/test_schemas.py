"""The files written by `thingc schema`: which documents get one, which are preserved, and schemas of invalid documents. Validated with
jsonschema."""

from __future__ import annotations

import json
import re
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from jsonschema_specifications import REGISTRY

from editor.running import ROOT, thingc

PLAIN = """\
thingc: assembly/1
name: small
components:
  plate: {part: arm:BasePlate}
  servo: {part: thingc_stock.dynamixel:XM430, attach: {back: plate.servo_seat}}
joints: {}
"""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Return a workspace with one document."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')
    (tmp_path / "parts").mkdir()
    shutil.copy(ROOT / "parts" / "arm.py", tmp_path / "parts")
    (tmp_path / "small.yaml").write_text(PLAIN)
    return tmp_path


@cache
def of_schemas() -> Any:
    """Return a validator of schemas that is ten times as fast as `check_schema`. The standard splits its keywords over seven schemas,
    which are resolved again at every step; here they are merged."""
    whole = jsonschema.Draft202012Validator.META_SCHEMA
    merged: dict[str, Any] = {"type": whole["type"], "properties": {}, "$defs": {}}
    for part in (whole, *(REGISTRY.contents(whole["$id"].removesuffix("schema") + one["$ref"]) for one in whole["allOf"])):
        merged["properties"].update(part["properties"])
        merged["$defs"].update(part.get("$defs", {}))
    text = re.sub(r'"meta/\w+#', '"#', json.dumps(merged).replace('"$dynamicRef": "#meta"', '"$ref": "#"'))
    return jsonschema.Draft202012Validator(json.loads(text), format_checker=jsonschema.Draft202012Validator.FORMAT_CHECKER)


CHECKED: set[str] = set()
"""Definitions already validated as schemas, as text: most are shared by all documents."""


def schema_of(folder: Path, name: str) -> Any:
    found = json.loads((folder / ".thingc" / "schema" / f"{name}.json").read_text())
    defined = {json.dumps(one): (key, one) for key, one in found.get("$defs", {}).items()}
    news = dict(pair for text, pair in defined.items() if text not in CHECKED)
    of_schemas().validate({**found, "$defs": news})
    CHECKED.update(defined)
    assert found["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    return found


def faults(schema: Any, document: Any) -> list[str]:
    return [error.message for error in jsonschema.Draft202012Validator(schema).iter_errors(document)]


def offered(schema: Any, definition: str) -> set[str]:
    return {branch["const"] for branch in schema["$defs"][definition]["anyOf"] if "const" in branch}


def test_every_document_has_a_matching_schema(workspace: Path) -> None:
    documents = sorted(path for folder in ("assemblies", "parts") for path in (workspace / folder).rglob("*.yaml"))
    written = sorted(path.relative_to(workspace / ".thingc/schema").as_posix() for path in (workspace / ".thingc/schema").rglob("*.json"))
    assert written == sorted([*(f"{path.relative_to(workspace).as_posix()}.json" for path in documents), "thingc.toml.json"])
    for path in documents:
        schema = schema_of(workspace, path.relative_to(workspace).as_posix())
        assert faults(schema, yaml.safe_load(path.read_text())) == []


def test_all_internal_references_resolve(workspace: Path) -> None:
    from urllib.parse import unquote

    for path in (workspace / ".thingc/schema").rglob("*.json"):
        schema = json.loads(path.read_text())
        waiting: list[Any] = [schema]
        while waiting:
            one = waiting.pop()
            if isinstance(one, dict):
                if isinstance(target := one.get("$ref"), str):
                    name = unquote(target.removeprefix("#/$defs/")).replace("~1", "/").replace("~0", "~")
                    assert name in schema["$defs"], target
                waiting.extend(one.values())
            elif isinstance(one, list):
                waiting.extend(one)


def test_unchanged_schemas_are_not_rewritten(small: Path, shared_store: str) -> None:
    first = thingc(small, shared_store, "schema")
    assert first.startswith(".thingc/schema: schemas of 2 documents: 2 written, 0 unchanged\n")
    files = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in small.rglob("*") if path.is_file()}
    assert thingc(small, shared_store, "schema") == ".thingc/schema: schemas of 2 documents: 0 written, 2 unchanged\n"
    assert files == {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in small.rglob("*") if path.is_file()}
    shutil.rmtree(small / ".thingc")
    thingc(small, shared_store, "schema")
    assert files.keys() == {path for path in small.rglob("*") if path.is_file()}
    assert all(path.read_bytes() == data for path, (data, _) in files.items())


def test_packaged_documents_are_offered(workspace: Path) -> None:
    branches = schema_of(workspace, "assemblies/arm.yaml")["properties"]["materials"]["anyOf"]
    listed = next(branch["items"]["anyOf"] for branch in branches if branch.get("type") == "array")
    assert {"const": "thingc_stock.materials", "description": "The materials of `thingc_stock`."}.items() <= next(
        one for one in listed if one.get("const") == "thingc_stock.materials"
    ).items()


def test_folder_is_git_ignored_and_stale_schemas_are_removed(small: Path, shared_store: str) -> None:
    (small / "deep").mkdir()
    (small / "deep" / "other.yaml").write_text(PLAIN.replace("small", "other"))
    thingc(small, shared_store, "schema")
    assert (small / ".thingc" / ".gitignore").read_text() == "*\n"
    assert (small / ".thingc/schema/deep/other.yaml.json").exists()
    shutil.rmtree(small / "deep")
    assert "1 removed" in thingc(small, shared_store, "schema")
    assert not (small / ".thingc/schema/deep").exists()


def test_schema_of_an_invalid_document_covers_the_rest(small: Path, shared_store: str) -> None:
    (small / "small.yaml").write_text(PLAIN.replace("joints: {}", """\
  half: {par: arm:RotorBrace}
  wrong: {part: arm:RotorBrace, params: {length: 3 kg}}
  lost: {part: arm:NotThere}
joints:
  turn: {type: revolute, parent: servo.rotor, chil: wrong.rotor_seat}
poses: {up: {turn: }}
modes: {bench: {root: plat, pose: up}}
"""))
    thingc(small, shared_store, "schema")
    schema = schema_of(small, "small.yaml")
    assert {"plate", "servo", "half", "wrong", "lost"} <= offered(schema, "component")
    # what is wrong about a component takes neither its mounts nor anybody's name away
    assert {"plate.servo_seat", "servo.rotor", "wrong.rotor_seat", "half.origin"} <= offered(schema, "mount")
    poses = schema["properties"]["poses"]
    joints = next(iter(poses.get("patternProperties", {"": poses.get("additionalProperties")}).values()))["properties"]
    assert "turn" in joints
    right = yaml.safe_load(PLAIN)
    right["components"]["wrong"] = {"part": "arm:RotorBrace", "params": {"length": "80 mm"}, "attach": {"rotor_seat": "servo.rotor"}}
    right["components"]["lost"] = {"part": "arm:NotThere", "params": {"any": 3}, "attach": {"thing": "plate.bottom"}}
    assert faults(schema, right) == []


def test_multi_coordinate_joints_are_set_as_a_whole(small: Path, shared_store: str) -> None:
    text = """\
thingc: assembly/1
name: several
components: {a: {frame: true}, b: {frame: true}, c: {frame: true}}
joints:
  wrist: {type: universal, parent: a.origin, child: b.origin}
  hip: {type: ball, parent: b.origin, child: c.origin, limit: {cone: 40 deg}, drive: [{axis: [1, 0, 0], kind: motor}]}
poses: {up: {wrist: [3 deg, 0], hip: {rpy: 0 20 0 deg}}}
modes: {slide: {root: a, base: planar}, turn: {root: a, base: ball, actuators: ["hip[0]"]}}
"""
    (small / "several.yaml").write_text(text)
    thingc(small, shared_store, "schema")
    schema, right = schema_of(small, "several.yaml"), yaml.safe_load(text)
    assert faults(schema, right) == []
    wrong = {**right, "poses": {"up": {"hip": 3}}}
    assert len(faults(schema, wrong)) == 1


def test_malformed_document_keeps_its_last_schema(small: Path, shared_store: str) -> None:
    thingc(small, shared_store, "schema")
    before = (small / ".thingc/schema/small.yaml.json").read_bytes()
    (small / "small.yaml").write_text(PLAIN + "joints: {turn: [\n")
    printed = thingc(small, shared_store, "schema")
    assert "small.yaml: the schema was not updated because of a syntax error" in printed
    assert (small / ".thingc/schema/small.yaml.json").read_bytes() == before


def test_malformed_new_document_gets_a_generic_schema(small: Path, shared_store: str) -> None:
    (small / "fresh.yaml").write_text("thingc: assembly/1\nname: [\n")
    thingc(small, shared_store, "schema")
    parts = schema_of(small, "fresh.yaml")["$defs"]["ComponentSpec"]["properties"]["part"]["anyOf"]
    assert "arm:BasePlate" in {branch.get("const") for branch in parts}


def test_syntax_error_in_a_part_keeps_the_schemas(small: Path, shared_store: str) -> None:
    thingc(small, shared_store, "schema")
    before = (small / ".thingc/schema/small.yaml.json").read_bytes()
    part = small / "parts" / "arm.py"
    part.write_text(part.read_text() + "\ndef half(:\n")
    printed = thingc(small, shared_store, "schema")
    assert "small.yaml: the schema was not updated because of a syntax error" in printed
    assert (small / ".thingc/schema/small.yaml.json").read_bytes() == before
    (small / "small.yaml").write_text(PLAIN.replace("arm:BasePlate", "arm:BasePlace", 1))
    part.write_text(part.read_text().removesuffix("\ndef half(:\n"))
    assert "1 written" in thingc(small, shared_store, "schema"), "a class that does not exist is an error of the document"


def test_no_model_option_starts_no_kernel(small: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    store = tmp_path_factory.mktemp("empty-store")
    thingc(small, str(store), "schema", "--no-model")
    schema = schema_of(small, "small.yaml")
    assert offered(schema, "mount") == {"plate.origin", "servo.origin"}
    assert faults(schema, yaml.safe_load(PLAIN)) == [], "what is not known is not refused"
    assert not (store / "blobs").exists() or not any((store / "blobs").iterdir())


def test_schema_of_a_single_document(small: Path, shared_store: str) -> None:
    (small / "other.yaml").write_text(PLAIN.replace("small", "other"))
    assert thingc(small, shared_store, "schema", "other.yaml") == ".thingc/schema: schemas of 1 document: 1 written, 0 unchanged\n"
    assert not (small / ".thingc/schema/small.yaml.json").exists()


def test_other_files_and_workspaces_are_ignored(small: Path, shared_store: str) -> None:
    (small / "compose.yaml").write_text("services: {}\n")
    (small / "inner").mkdir()
    (small / "inner" / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (small / "inner" / "theirs.yaml").write_text(PLAIN)
    assert "schemas of 2 documents" in thingc(small, shared_store, "schema")


def test_repeats_and_nested_documents_are_supported(small: Path, shared_store: str) -> None:
    (small / "big.yaml").write_text("""\
thingc: assembly/1
name: big
parameters: {count: 3}
components:
  plate: {part: arm:BasePlate}
  screw:
    repeat: {count: =count, as: i}
    part: thingc_stock.fasteners:Screw
    attach: {seat: plate.servo_screw_$i}
  inner: {assembly: small.yaml, attach: {plate.bottom: plate.table_0}}
""")
    thingc(small, shared_store, "schema")
    schema = schema_of(small, "big.yaml")
    document = yaml.safe_load((small / "big.yaml").read_text())
    assert faults(schema, document) == []
    assert {"screw_0.seat", "screw_2.seat", "inner.plate.bottom", "inner.servo.rotor"} <= offered(schema, "mount")
    document["mounts"] = {"a": "screw_1.seat", "b": "inner.servo.rotor", "c": "inner.plate.origin"}
    assert faults(schema, document) == []
    for wrong in ("screw_1.seet", "plate.servo_screw_99", "inner.bottom"):
        document["mounts"] = {"a": wrong}
        assert len(faults(schema, document)) == 1, wrong


def test_variants_schema_lists_assembly_parameters(small: Path, shared_store: str) -> None:
    (small / "small.yaml").write_text(PLAIN.replace("components:", "parameters: {reach: {value: 90 mm, doc: how far}}\ncomponents:"))
    sweep = {"thingc": "variants/1", "assembly": "small.yaml", "name": "sweep", "parameters": {"reach": ["80 mm", "90 mm"]}}
    (small / "sweep.yaml").write_text(yaml.safe_dump(sweep, sort_keys=False))
    thingc(small, shared_store, "schema")
    schema = schema_of(small, "sweep.yaml")
    assert faults(schema, sweep) == []
    assert schema["properties"]["parameters"]["properties"]["reach"]["description"] == "How far. A length; `90 mm` by default."
    assert len(faults(schema, {**sweep, "parameters": {"reech": ["80 mm"]}})) == 1


def test_lock_file_is_used_if_the_store_is_empty(small: Path, shared_store: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    thingc(small, shared_store, "lock")
    thingc(small, str(tmp_path_factory.mktemp("empty-store")), "schema", "--no-model")
    assert {"plate.servo_seat", "servo.rotor"} <= offered(schema_of(small, "small.yaml"), "mount")
