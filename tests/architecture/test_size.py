"""The compiler stays within the size limits of `size.toml`."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
SIZES: dict[str, Any] = tomllib.loads((Path(__file__).parent / "size.toml").read_text())
PROPER: int = SIZES.pop("proper")["lines"]
SLACK = 150
"""If the code of a layer is smaller than its limit by more than this, the limit must be lowered."""
OUTSIDE = {"batch", "tools"}


@pytest.fixture(scope="module")
def figures() -> Any:
    """Return the numbers of `make structure`."""
    sys.path.insert(0, str(ROOT / "benchmarks" / "structure"))
    try:
        from figures import lying_here, structure  # type: ignore[import-not-found]
    finally:
        sys.path.pop(0)
        sys.modules.pop("figures", None)
    return structure(lying_here())


@pytest.fixture(scope="module")
def lines(figures: Any) -> dict[str, int]:
    """Return the code lines by layer, and by module of the top level."""
    return dict(figures.rooms)


@pytest.mark.parametrize("room", SIZES)
def test_layer_size_matches_its_limit(lines: dict[str, int], room: str) -> None:
    allowed = SIZES[room]["lines"]
    assert lines[room] <= allowed, f"`{room}` has {lines[room]} code lines, {allowed} are allowed: shorten it, or raise it with a reason"
    assert lines[room] >= allowed - SLACK, f"`{room}` has {lines[room]} code lines: lower its number in size.toml from {allowed}"


def test_every_layer_has_a_limit(lines: dict[str, int]) -> None:
    assert set(SIZES) == {room for room in lines if not room.endswith(".py")}


def test_compiler_core_is_small(lines: dict[str, int]) -> None:
    proper = sum(count for room, count in lines.items() if room not in OUTSIDE)
    assert proper <= PROPER, f"without `batch` and `tools` there are {proper} code lines, {PROPER} are allowed"


def test_files_have_at_most_400_code_lines(figures: Any) -> None:
    assert figures.largest[0] <= 400, figures.largest


def test_functions_have_at_most_50_lines(figures: Any) -> None:
    assert [one.where for one in figures.functions if one.lines > 50] == []


@pytest.mark.parametrize("room", SIZES)
def test_raised_limits_have_a_reason(room: str) -> None:
    for lines, reason in SIZES[room]["raised"]:
        assert lines > 0 and len(reason.split()) > 3, reason
