"""One parameter of a leg changes: exactly the parts that use it are built, each once. No other test builds these parts."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from conformance.harness import ROOT, build_here, replace

from .conftest import DOCUMENT

pytestmark = pytest.mark.slow

EVERYTHING = 13
"""Definitions of MInchW: four prints and the chassis, tray and cell, two servos, the magnet, three sizes of screws."""

EDITS = {
    "brace thickness": ("leg_length / 25)", "leg_length / 12.5)", {"minchw.leg:ThighBrace(thickness=0.00512)"}),
    "leg length": ("front_leg: \"=leg_length\"", "front_leg: 71 mm", {"minchw.leg:ThighBrace(length=0.071)"}),
    "hip": ("params: {thickness: =wall + 2 mm}\n    material: petg_white\n  knee", (
        "params: {thickness: =wall + 3.7 mm}\n    material: petg_white\n  knee"), {"minchw.leg:HipBracket(thickness=0.0067)"}),
    "joint limit": ("upper: 125 deg", "upper: 124 deg", set()),
}
"""The replaced text with its replacement, and the number of new definitions, which follows from the documents."""


@pytest.fixture(scope="module")
def unedited(tmp_path_factory: pytest.TempPathFactory, shared_store: str, minchw: Path) -> tuple[Path, set[str]]:
    """A copy of the documents and parts, and the definitions of the unchanged robot, which are in the store."""
    folder = tmp_path_factory.mktemp("edited")
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", folder)
    reused = build_here(DOCUMENT, "--emit", "mjcf", store=shared_store, cwd=folder)["reused"]
    assert len(reused) == EVERYTHING
    return folder, set(reused)


@pytest.mark.parametrize("edit", EDITS)
def test_only_parts_that_use_the_parameter_are_built(unedited: tuple[Path, set[str]], shared_store: str, edit: str) -> None:
    (workspace, before), (old, new, expected) = unedited, EDITS[edit]
    file = next(path for path in (workspace / "assemblies" / "minchw").glob("*.yaml") if old in path.read_text())
    replace(file, old, new)
    try:
        answer = build_here(DOCUMENT, "--emit", "mjcf", store=shared_store, cwd=workspace)
    finally:
        replace(file, new, old)
    after = set(answer["modelled"]) | set(answer["reused"])
    assert len(answer["modelled"]) == len(set(answer["modelled"])), "each once"
    assert set(answer["modelled"]) == after - before == expected
    assert set(answer["reused"]) == after & before
    assert len(after | before) == EVERYTHING + len(expected)
