"""Types of the authoring API, as type checkers and a plain `import thingc` see them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

PART = Path(__file__).with_name("typed_part.py")


def without_colour() -> dict[str, str]:
    return {**os.environ, "NO_COLOR": "1", "TERM": "dumb", "MYPY_FORCE_COLOR": "0"}


def test_mypy_checks_the_part(root: Path) -> None:
    """`make test` runs mypy once for thingc and the part."""
    assert "typed_part" in tomllib.loads((root / "pyproject.toml").read_text())["tool"]["mypy"]["packages"]


@pytest.mark.slow
def test_pyright_infers_types_of_moved_things(root: Path, tmp_path: Path) -> None:
    try:
        started = subprocess.run([sys.executable, "-m", "pyright", "--version"], capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        pytest.skip("pyright cannot fetch its engine here")
    if started.returncode != 0:
        pytest.skip("pyright cannot start here")
    lines = PART.read_text().splitlines()
    (tmp_path / "typed_part.py").write_bytes(PART.read_bytes())
    settings = {"extraPaths": [str(root / "compiler")], "typeCheckingMode": "standard", "enableTypeIgnoreComments": False}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    ran = subprocess.run(
        [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable, "-p", str(tmp_path)],
        cwd=tmp_path, capture_output=True, text=True, env=without_colour(),
    )
    found = json.loads(ran.stdout)["generalDiagnostics"]
    wrong = {one["range"]["start"]["line"] for one in found if one["severity"] == "error"}
    assert wrong == {number for number, line in enumerate(lines) if line.endswith("# type: ignore")}


def test_import_does_not_load_the_kernel() -> None:
    code = (
        "import sys, thingc; from thingc import Length, Range, Actuator\n"
        "assert 'Thing' in dir(thingc)\n"
        "print(sorted({name.split('.')[0] for name in sys.modules} & {'build123d', 'OCP', 'numpy'}))\n"
        "try:\n    thingc.Thong\nexcept AttributeError as error:\n    print(error)\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\nmodule `thingc` has no attribute `Thong`\n"


def test_all_exported_names_exist() -> None:
    import thingc

    for name in thingc.__all__:
        found = getattr(thingc, name)
        of = found.__name__ if isinstance(found, ModuleType) else found.__module__
        assert of.startswith("thingc") or name in {"Length", "Angle", "Mass", "Count", "Ratio", "MATE"}
