"""The parts that every kind of test needs, so that none is missing from a new kind."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from thingc.base.diagnostics import Code
from thingc.documents.checks import kinds
from thingc.driver.testing.kinds import measurement_of

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "compiler" / "thingc"
MODULES = sorted(path for path in (PACKAGE / "documents/checks").glob("[!_]*.py") if path.name != "kind.py")
MEASUREMENTS = sorted(path.stem for path in (PACKAGE / "driver/testing/kinds").glob("[!_]*.py"))
TESTS = [path for path in (ROOT / "tests").rglob("test_*.py") if path != Path(__file__)]


@pytest.mark.parametrize("module", MODULES, ids=lambda path: path.stem)
def test_every_module_defines_a_kind(module: Path) -> None:
    assert module.stem in kinds(), f"documents/checks/{module.name} has no `KIND` of the name `{module.stem}`"


def test_codes_of_kinds_are_tested() -> None:
    """Some test must name each code, that is, expect a test of the kind to fail."""
    tested = "\n".join(path.read_text() for path in TESTS)
    measuring = [*(PACKAGE / "driver/testing/kinds").glob("*.py"), PACKAGE / "driver/testing/certificate.py"]
    codes = {Code[name].code for path in measuring for name in re.findall(r"\bCode\.(TEST_\w+)", path.read_text())}
    missing = [code for code in codes if not re.search(rf"\b{code}\b", tested)]
    assert len(codes) > len(MODULES) and missing == [], f"no test expects {missing}: add a test of the kind"


def test_every_kind_has_a_measurement() -> None:
    assert sorted(kinds()) == MEASUREMENTS, "each kind in documents/checks/ needs a module of its name in driver/testing/kinds/"
    for name, kind in kinds().items():
        assert measurement_of(name).kind is kind, f"driver/testing/kinds/{name}.py measures another kind"


def test_positions_of_kinds_are_consecutive() -> None:
    assert [kind.position for kind in kinds().values()] == [*range(1, len(kinds()) + 1)]
