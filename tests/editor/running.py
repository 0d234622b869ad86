"""Commands of thingc, and what they wrote for editors."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import pytest

from thingc.cli.main import main

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


def wired(folder: Path) -> dict[str, Any]:
    """`yaml.schemas` as it stands in the settings of VS Code."""
    found: dict[str, Any] = json.loads((folder / ".vscode" / "settings.json").read_text())["yaml.schemas"]
    return found
