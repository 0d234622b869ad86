"""Files named `*.thingc.yaml` are documents in every search, with or without the key `thingc`."""

from __future__ import annotations

import json
import re
from fnmatch import fnmatch
from pathlib import Path

import jsonschema
import pytest
import yaml
from referencing import Registry, Resource

from thingc.base.diagnostics import Report
from thingc.base.filesystem import without_suffix
from thingc.documents.load.discovery import assemblies_in, documents_in, find_packaged, is_document, packaged_documents
from thingc.documents.workspace import Workspace
from thingc.tools.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
MATERIALS = "thingc: materials/1\nmaterials: {wood: {density: 700 kg/m^3}}\n"
ROBOT = "thingc: assembly/1\nname: crate\nmaterials: [wood.thingc.yaml]\ncomponents:\n  crate: {frame: true, mass: 12 g}\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a workspace with two documents, a file without the key, and YAML files that are not documents."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "crate.thingc.yaml").write_text(ROBOT)
    (tmp_path / "wood.thingc.yaml").write_text(MATERIALS)
    (tmp_path / "empty.thingc.yml").write_text("name: empty\n")
    (tmp_path / "other.yaml").write_text("name: other\n")
    (tmp_path / "thingc.yaml").write_text("name: other\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def workspace(folder: Path) -> Workspace:
    found = Workspace.find(str(folder / "crate.thingc.yaml"), Report())
    assert found is not None
    return found


@pytest.mark.parametrize(("path", "stem"), [
    ("a/b.yaml", "a/b"), ("a/b.thingc.yaml", "a/b"), ("a/b.thingc.toml", "a/b"), ("a/b.py", "a/b"), ("a.thingc/b", "a.thingc/b"),
    ("thingc.yaml", "thingc"), ("b.c.yaml", "b.c"),
])
def test_name_without_document_suffix(path: str, stem: str) -> None:
    assert without_suffix(path) == stem


def test_document_files_are_found(folder: Path) -> None:
    names = ["crate.thingc.yaml", "empty.thingc.yml", "wood.thingc.yaml"]
    assert [Path(path).name for path in documents_in(str(folder), workspace(folder))] == names
    assert [Path(path).name for path in assemblies_in(str(folder), workspace(folder))] == ["crate.thingc.yaml"]
    assert not is_document(str(folder / "thingc.yaml")) and not is_document(str(folder / "empty.thingc.yml"), "assembly/")
    assert not is_document(str(folder / "missing.thingc.yaml"))


def test_commands_accept_document_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "crate.thingc.yaml", "wood.thingc.yaml"]) == 0
    assert main(["info"]) == 0  # the only robot
    assert capsys.readouterr().out.count("crate: 12") == 1
    assert main(["touched", "wood.thingc.yaml"]) == 0
    assert capsys.readouterr().out.split() == ["crate.thingc.yaml", "wood.thingc.yaml"]
    assert main(["fmt", "--check", "crate.thingc.yaml"]) == 0
    assert main(["check", "crat.yaml"]) == 2
    assert "did you mean `crate.thingc.yaml`?" in capsys.readouterr().out
    assert main(["new", "rover.thingc.yaml"]) == 2
    assert "  help: write `thingc new rover`\n" in capsys.readouterr().err


def test_missing_thingc_key_is_an_error(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In a folder, and in a file passed by pre-commit."""
    for words in (["."], ["--touched", "--", "empty.thingc.yml", "other.yaml"]):
        assert main(["check", *words]) == 1
        assert re.findall(r"error\[(TC\d+)\].*\n *--> ([\w.]+):", capsys.readouterr().out) == [("TC111", "empty.thingc.yml")]


def test_packaged_document_files_are_found(folder: Path) -> None:
    package = folder / "parts" / "shelf"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "wood.thingc.yaml").write_text(MATERIALS)
    report = Report()
    path = find_packaged("shelf.wood", where=None, workspace=workspace(folder), examined=set(), report=report)
    assert path == str(package / "wood.thingc.yaml") and not report.diagnostics
    assert packaged_documents(workspace(folder))["shelf.wood"] == path


def test_hooks_match_document_files() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    patterns = [hook["files"] for hook in hooks if "files" in hook]
    assert len(patterns) == 3
    assert all(re.search(pattern, f"robots/a.thingc.{end}") for pattern in patterns for end in ("yaml", "yml", "toml"))
    events = json.loads((ROOT / "editors/vscode/package.json").read_text())["activationEvents"]
    assert "workspaceContains:**/*.thingc.{yaml,yml,toml}" in events


@pytest.fixture(scope="module")
def schemas() -> dict[str, dict[str, object]]:
    """Return the files of the folder `schemas/`."""
    return {path.name: json.loads(path.read_text(encoding="utf-8")) for path in (ROOT / "schemas").glob("*.json")}


def test_each_schema_has_the_url_of_its_file(schemas: dict[str, dict[str, object]]) -> None:
    base = "https://raw.githubusercontent.com/thingc/thingc/main/schemas/"
    catalog = schemas["catalog.json"]
    named = {name: schema for name, schema in schemas.items() if schema is not catalog}
    assert len(named) >= 5 and all(schema["$id"] == f"{base}{name}" for name, schema in named.items())
    assert catalog["version"] == 1
    for entry in catalog["schemas"]:  # type: ignore[attr-defined]
        assert set(entry) == {"name", "description", "fileMatch", "url"} and entry["url"].removeprefix(base) in named
        assert "schema" not in entry["description"].lower()  # a rule of SchemaStore


@pytest.mark.parametrize(("name", "schema"), [
    ("robots/a.thingc.yaml", "document-1.json"), ("a.thingc.yml", "document-1.json"), ("a.thingc.toml", "document-1.json"),
    ("thingc.toml", "workspace-1.json"), ("a.yaml", None), ("thingc.yaml", None),
])
def test_catalogue_selects_a_schema_by_file_name(name: str, schema: str | None, schemas: dict[str, dict[str, object]]) -> None:
    entries = schemas["catalog.json"]["schemas"]
    found = [one["url"] for one in entries if any(fnmatch(Path(name).name, match) for match in one["fileMatch"])]  # type: ignore[attr-defined]
    assert [url.rpartition("/")[2] for url in found] == ([] if schema is None else [schema])


@pytest.mark.parametrize(("text", "right"), [
    (ROBOT, True), (MATERIALS, True), ("thingc: variants/1\nname: two\nassembly: crate.thingc.yaml\nparameters: {x: [1 mm, 2 mm]}\n", True),
    (ROBOT.replace("components", "componets"), False), (MATERIALS.replace("density", "densty"), False), ("name: crate\n", False),
    (ROBOT.replace("assembly/1", "materials/1"), False), ("thingc: workspace/1\n", False),
])
def test_combined_schema_selects_the_document_kind(text: str, right: bool, schemas: dict[str, dict[str, object]]) -> None:
    registry = Registry().with_resources((schema["$id"], Resource.from_contents(schema)) for schema in schemas.values() if "$id" in schema)
    validator = jsonschema.Draft202012Validator(schemas["document-1.json"], registry=registry)
    assert validator.is_valid(yaml.safe_load(text)) == right
