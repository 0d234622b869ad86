"""One parameter of a leg changed: the parts that use it are modelled, no other, and each once. Counted in a store of its own."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from conformance.harness import ROOT, build, build_here, replace

from .conftest import DOCUMENT

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("one_kernel")]

EVERYTHING = 13
"""Definitions of MInchW: four prints and the chassis, tray and cell, two servos, the magnet, three sizes of screws."""

EDITS = {
    "brace thickness": ("leg_length / 25)", "leg_length / 12.5)", {"minchw.leg:ThighBrace(thickness=0.00512)"}),
    "leg length": ("front_leg: \"=leg_length\"", "front_leg: 70 mm", {"minchw.leg:ThighBrace(length=0.07)"}),
    "hip": ("params: {thickness: =wall + 2 mm}\n    material: petg_white\n  knee", (
        "params: {thickness: =wall + 3 mm}\n    material: petg_white\n  knee"), {"minchw.leg:HipBracket(thickness=0.006)"}),
    "joint limit": ("upper: 125 deg", "upper: 124 deg", set()),
}
"""What is written instead of what, and the definitions that are new with it, worked out from the documents by hand."""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared_store: str, minchw: Path) -> Path:
    """A copy of the documents and parts with a store in which MInchW as it is has been modelled."""
    folder = tmp_path_factory.mktemp("edited")
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", folder)
    answer = build(DOCUMENT, "--emit", "mjcf", store=folder / "store", cwd=folder)
    assert len(answer["modelled"]) == EVERYTHING and answer["reused"] == []
    return folder


@pytest.mark.parametrize("edit", EDITS)
def test_only_the_parts_that_use_it_are_modelled(workspace: Path, edit: str) -> None:
    old, new, expected = EDITS[edit]
    file = next(path for path in (workspace / "assemblies" / "minchw").glob("*.yaml") if old in path.read_text())
    before = set(build_here(DOCUMENT, "--emit", "mjcf", store=workspace / "store", cwd=workspace)["reused"])
    replace(file, old, new)
    try:
        answer = build_here(DOCUMENT, "--emit", "mjcf", store=workspace / "store", cwd=workspace)
    finally:
        replace(file, new, old)
    after = set(answer["modelled"]) | set(answer["reused"])
    assert len(answer["modelled"]) == len(set(answer["modelled"])), "each once"
    assert set(answer["modelled"]) == after - before == expected
    assert set(answer["reused"]) == after & before
    assert len(after | before) == EVERYTHING + len(expected)
