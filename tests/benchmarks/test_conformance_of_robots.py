"""The fast part of `make conformance`: both robots in all modes at a few configurations, with the same questions and scripts.
Environments of readers are those of the command, and are created if they are missing. Readers that cannot be installed are skipped."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from conformance.harness import with_all_formats
from emit import usd_answers

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "benchmarks" / "conformance"
FEW = 5
"""The number of configurations."""

SUFFIXES = {"URDF": "urdf", "USD": "usda"}


@pytest.fixture(scope="module", autouse=True)
def on_path() -> Iterator[None]:
    sys.path.insert(0, str(FOLDER))
    yield
    sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def asked(on_path: None, shared_store: str) -> dict[str, list[Any]]:
    """Questions to all modes of both robots, by format."""
    from reference import question
    from study import ROBOTS

    questions: dict[str, list[Any]] = {format: [] for format in SUFFIXES}
    for path in ROBOTS:
        folder = with_all_formats(path, shared_store)
        for mjcf in sorted((folder / "mjcf").glob(f"{folder.name}_*.xml")):
            for format, suffix in SUFFIXES.items():
                file = next((folder / suffix.removesuffix("a")).glob(f"{mjcf.stem}.{suffix}"))
                questions[format].append(question(file, mjcf, count=FEW))
    assert [len(some) for some in questions.values()] == [15, 15]
    return questions


@pytest.mark.slow
@pytest.mark.parametrize(("name", "format"), [
    ("mujoco", "URDF"), ("check_urdf", "URDF"), ("pinocchio", "URDF"), ("usdchecker", "USD"), ("ours", "USD"),
])
def test_robots_are_equal_in_all_modes(asked: dict[str, list[Any]], name: str, format: str) -> None:
    """`ours` evaluates the frames of UsdPhysics independently. Other readers are tested only in `make conformance`."""
    from study import READERS, Judged, judged

    verdict, some = Judged(floats=format == "USD"), asked[format]
    reader = next((one for one in READERS if one.name == name), None)
    if reader is None or name == "usdchecker":  # which is among what the tests need
        answer = usd_answers.answer if reader is None else import_module(f"ask_{name}").answer
        for one in some:
            verdict.add(one.name, answer(one.request), one.answer, one.request["joints"])
    else:
        (ROOT / "build" / "conformance").mkdir(parents=True, exist_ok=True)
        some = some[::5]  # `make conformance` asks about all of them
        words, groups = judged(reader, ROOT / "build" / "conformance", [("robots", one) for one in some])
        if not groups:
            pytest.skip(f"{name} {words}")
        verdict = groups["robots"]
    assert verdict.faults == [] and verdict.files == len(some)
