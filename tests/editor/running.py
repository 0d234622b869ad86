"""Run thingc commands in this process, and read the schemas that they write for editors."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import pytest

from thingc.tools.cli.main import main

ROOT = Path(__file__).resolve().parents[2]


def thingc(folder: Path, store: str, *words: str) -> str:
    """Return the standard output of a command, run by its function in this process; it must succeed."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.chdir(folder)
        patch.setenv("THINGC_STORE", store)
        code = main(list(words))
    assert code == 0, out.getvalue() + err.getvalue()
    return out.getvalue()


def schemas_of(folder: Path) -> dict[str, Any]:
    """Return `yaml.schemas` as in the settings of an editor: the document for each schema in `.thingc/schema/`."""
    top = folder / ".thingc" / "schema"
    names = [path.relative_to(top).as_posix().removesuffix(".json") for path in sorted(top.rglob("*.yaml.json"))]
    return {f"./.thingc/schema/{name}.json": name for name in names}
