"""Commands of thingc, and what they wrote for editors."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import pytest

from thingc.tools.cli.main import main

ROOT = Path(__file__).resolve().parents[2]


def thingc(folder: Path, store: str, *words: str) -> str:
    """What a command prints on standard output, run by its function in this process; it must succeed."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.chdir(folder)
        patch.setenv("THINGC_STORE", store)
        code = main(list(words))
    assert code == 0, out.getvalue() + err.getvalue()
    return out.getvalue()


def schemas_of(folder: Path) -> dict[str, Any]:
    """`yaml.schemas`, as a person writes it into the settings of an editor: which document each schema in `.thingc/schema/` is for."""
    top = folder / ".thingc" / "schema"
    names = [path.relative_to(top).as_posix().removesuffix(".json") for path in sorted(top.rglob("*.yaml.json"))]
    return {f"./.thingc/schema/{name}.json": name for name in names}
