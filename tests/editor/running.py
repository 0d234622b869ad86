"""`thingc` run as a person runs it, and what it wrote for editors."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


def thingc(folder: Path, store: str, *words: str) -> str:
    """What a command prints on standard output; it must succeed."""
    done = subprocess.run(
        [sys.executable, "-P", "-m", "thingc", *words],
        cwd=folder, env={**os.environ, "THINGC_STORE": store}, capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def wired(folder: Path) -> dict[str, Any]:
    """`yaml.schemas` as it stands in the settings of VS Code."""
    found: dict[str, Any] = json.loads((folder / ".vscode" / "settings.json").read_text())["yaml.schemas"]
    return found
