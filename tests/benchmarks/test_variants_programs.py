"""The programs of `make bench-variants` run with the current documents and functions of thingc."""

from __future__ import annotations

import contextlib
import importlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from thingc.batch import plan
from thingc.driver.environment import Options

ROOT = Path(__file__).resolve().parents[2]


def program(monkeypatch: pytest.MonkeyPatch, name: str) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks" / "variants"))
    monkeypatch.delitem(sys.modules, name, raising=False)
    return importlib.import_module(name)


def test_lanes_of_beside_have_equal_models(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """All lanes run except PyMJCF, which needs an environment of its own: models of MjSpec replace its models."""
    beside = program(monkeypatch, "beside")

    @contextlib.contextmanager
    def elsewhere(model: Path) -> Iterator[Any]:
        spec = beside.mujoco.MjSpec.from_file(str(model))

        def edited(index: int, scratch: Path | None = None) -> Any:
            return beside.edited(spec, *beside.numbers(index))

        yield SimpleNamespace(model=edited, seconds=lambda indices: beside.timed(lambda some: list(map(edited, some)), indices))

    monkeypatch.setattr(beside, "pymjcf", elsewhere)
    monkeypatch.setattr(sys, "argv", ["beside.py", "--count", "1", "--rounds", "1"])
    assert beside.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["MjSpec:", "PyMJCF:", "own", "lent", "MjSpec", "PyMJCF"]


def test_batches_of_equal_have_variants(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared_store: str) -> None:
    equal = program(monkeypatch, "equal")
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", tmp_path)
    for kind in equal.KINDS:
        document = equal.write_document(kind, tmp_path, count=3, seed=11)
        variants = list(plan(str(document), options=Options(store=shared_store)))
        assert len(variants) == 3 and all(variant.failed is None for variant in variants)
