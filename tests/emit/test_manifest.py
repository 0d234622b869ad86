"""The manifest: hashes checked with hashlib, paths relative to the workspace, and identical bytes for identical input."""

from __future__ import annotations

import hashlib
import json
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pytest

import thingc
from emit.small_robot import assembly, request, span
from thingc.driver.output import verify, write_build
from thingc.geometry.store.local import Store
from thingc.model.resolve.resolver import Settings
from thingc.targets import json_writer, modes_json
from thingc.targets.artifact import Content, Loss, StoredArtifact
from thingc.targets.bom import emit as bom
from thingc.targets.manifest import DISTRIBUTIONS, manifest, versions
from thingc.targets.stl import emit as stl

LOSSES = (
    Loss(target="mjcf", mode="bench", path="yaw", what="velocity limit", how="carried as custom data", origin=(span(40),)),
    Loss(target="step", mode=None, path="motor", what="a mesh", how="omitted"),
)


def build_manifest(store: Store, files: dict[str, Content], documents: dict[str, str], parameters: dict[str, str]) -> bytes:
    whole = assembly(store)
    return manifest(
        whole, document="arm.yaml", documents=documents, files=files, losses=LOSSES, workspace=request(whole, store).workspace,
        settings=Settings(parameters=parameters), modes=["bench"], emit=["stl", "bom"], compat=(),
    )


def test_hashes_match_files_on_disk(tmp_path: Path) -> None:
    """The manifest of a written build lists every file with its SHA-256."""
    store = Store(str(tmp_path / "store"))
    asked = request(assembly(store), store)
    files = stl.emit(asked).files | bom.emit(asked).files | modes_json.emit(asked).files
    text = build_manifest(store, files, {"arm.yaml": "0" * 64}, {"reach": "120 mm"})
    folder = Path(write_build(str(tmp_path), "arm", {**files, "manifest.json": text}, store, "arm.yaml"))
    found = json.loads((folder / "manifest.json").read_bytes())
    on_disk = {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()}
    del on_disk["manifest.json"]
    assert found["files"] == on_disk
    assert list(found["files"]) == sorted(on_disk)
    assert len(on_disk) == 8, "five printed definitions, two tables and the modes"
    assert verify(str(folder)) == found


def test_manifest_has_all_entries(tmp_path: Path) -> None:
    """Each section of the manifest has the expected keys and values."""
    store = Store(str(tmp_path))
    found: dict[str, Any] = json.loads(build_manifest(store, {"bom.csv": b"x"}, {"materials.yaml": "b", "arm.yaml": "a"}, {"reach": "1 m"}))
    assert list(found) == ["name", "document", "choice", "versions", "documents", "files", "occurrences", "losses"]
    assert found["name"] == "arm" and found["document"] == "arm.yaml"
    assert found["choice"] == {"modes": ["bench"], "emit": ["stl", "bom"], "parameters": {"reach": "1 m"}, "choices": {}}
    assert found["documents"] == {"arm.yaml": "a", "materials.yaml": "b"}
    assert found["occurrences"][2] == {
        "path": "brace_a", "definition": "arm:Brace(length=0.12)", "link": "servo_a", "mass": 0.018288, "mass_source": "derived",
    }
    assert [o["path"] for o in found["occurrences"]] == [o.path for o in assembly(store).occurrences]
    assert found["losses"] == [
        {"target": "mjcf", "mode": "bench", "path": "yaw", "what": "velocity limit", "how": "carried as custom data",
         "file": "arm.yaml", "line": 40},
        {"target": "step", "mode": None, "path": "motor", "what": "a mesh", "how": "omitted", "file": None, "line": None},
    ]


def test_bytes_do_not_depend_on_input_order(tmp_path: Path) -> None:
    """Mappings in another order, or a stored instead of an inline file, give the same bytes. Absolute paths do not occur."""
    store = Store(str(tmp_path))
    sha256 = store.put(b"x")
    one = build_manifest(store, {"a": b"1", "b": StoredArtifact(sha256=sha256, size=1)}, {"x": "1", "y": "2"}, {"p": "1", "q": "2"})
    two = build_manifest(store, {"b": b"x", "a": b"1"}, {"y": "2", "x": "1"}, {"q": "2", "p": "1"})
    assert one == two
    assert str(tmp_path).encode() not in one and b"/w/" not in one


def test_manifest_cannot_list_itself(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^manifest\.json cannot list itself$"):
        build_manifest(Store(str(tmp_path)), {"manifest.json": b""}, {}, {})


def test_versions_match_importlib_metadata() -> None:
    found = dict(versions())  # kept for all of the process
    assert found.pop("python") == platform.python_version()
    assert found.pop("thingc") == thingc.__version__
    expected = {}
    for name in DISTRIBUTIONS:
        try:
            expected[name] = version(name)
        except PackageNotFoundError:
            continue
    assert found == expected
    assert {"build123d", "mujoco"} <= set(found)


class TestJson:
    def test_encoded_value_round_trips(self) -> None:
        """`json.loads` returns the value that was encoded."""
        value = {"a": [1, 2.5, None, True, "ü\n\"\\"], "rows": [[1.0, 0.1], [0.30000000000000004, 1e-9]], "empty": {}, "none": [],
                 "deep": {"x": [{"y": [1]}]}}
        assert json.loads(json_writer.encode(value)) == value

    def test_matrix_has_one_row_per_line(self) -> None:
        assert json_writer.encode({"X": ((1.0, -0.0), (0.0, 1.0))}) == b'{\n  "X": [\n    [1.0, 0.0],\n    [0.0, 1.0]\n  ]\n}\n'

    @pytest.mark.parametrize("value", [float("nan"), float("inf"), [-float("inf")]])
    def test_non_finite_numbers_are_rejected(self, value: object) -> None:
        with pytest.raises(ValueError, match="not JSON compliant"):
            json_writer.encode({"x": value})
