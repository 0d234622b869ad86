"""The tests in the robot documents of this repository pass, and fail if their bounds are wrong."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
from pathlib import Path

import pytest

from thingc.tools.cli.main import main

ROBOTS = ("assemblies/arm.yaml", "assemblies/minchw/minchw.yaml")


def answer(document: Path, *words: str) -> tuple[int, dict[str, list[dict[str, object]]]]:
    with contextlib.redirect_stdout(io.StringIO()) as out:
        code = main(["test", str(document), "--format", "json", *words])
    return code, json.loads(out.getvalue())


@pytest.mark.parametrize("document", ROBOTS)
def test_repository_robots_pass_their_tests(document: str, root: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    code, found = answer(root / document)
    assert code == 0 and found["diagnostics"] == []
    assert {result["kind"] for result in found["tests"]} == {
        "mass", "centre", "reach", "point", "no_collision", "torque_margin", "settles",
    }
    assert all(result["passed"] for result in found["tests"])


@pytest.mark.parametrize(("written", "instead", "code"), [
    ("max: 0.6 kg", "max: 0.4 kg", "TC651"),
    ("x: [-48 mm, 48 mm]", "x: [-8 mm, 8 mm]", "TC652"),
    ("=2 * reach + 140 mm", "=2 * reach + 160 mm", "TC653"),
    ('["=reach + 60 mm", 0, 0]', '["=reach + 260 mm", 0, 0]', "TC654"),
    ("elbow: [60 deg, 115 deg]", "elbow: [60 deg, 130 deg]", "TC655"),
    ("min: 5}", "min: 20}", "TC656"),
    ("moved: 5 mm", "moved: 1 mm", "TC657"),
])
def test_violated_bound_fails_at_its_place(
    written: str, instead: str, code: str, root: Path, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The diagnostic is on the line of the violated value, or on that of the test if it concerns the test as a whole."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    shutil.copytree(root / "assemblies", tmp_path / "assemblies")
    shutil.copytree(root / "parts", tmp_path / "parts", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(root / "thingc.toml", tmp_path)
    document = tmp_path / "assemblies" / "arm.yaml"
    text = document.read_text()
    assert text.count(written) == 1
    document.write_text(text.replace(written, instead))
    line = 1 + next(k for k, row in enumerate(document.read_text().splitlines()) if instead in row)
    name = next(
        found[1] for row in reversed(document.read_text().splitlines()[:line]) if (found := re.match(r"  (\w+):", row))
    )
    exit_code, found = answer(document, "--only", name)
    assert exit_code == 1 and {entry["code"] for entry in found["diagnostics"]} == {code}
    for entry in found["diagnostics"]:
        place = entry["line"]
        assert isinstance(place, int) and line - 3 <= place <= line + 2, entry
        assert f"test `{name}`" in str(entry["message"]) and re.search(r"\d", str(entry["message"]))
