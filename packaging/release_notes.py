"""Print the section of CHANGELOG.md about a version: `python packaging/release_notes.py v0.2.0`.

The script exits with 1 if the tag is not the version of the package, or if the changelog has no section with this version as its heading.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def section(changelog: str, version: str) -> str | None:
    """Return the text below the heading of a version, or None if there is no such heading, or no text."""
    found = re.search(rf"^## {re.escape(version)}(?: [^\n]*)?\n(.*?)(?=^## |\Z)", changelog, re.MULTILINE | re.DOTALL)
    return found[1].strip() or None if found else None


def main(tag: str) -> int:
    """Print the notes, and return 0; or print an error, and return 1."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    if tag != f"v{version}":
        print(f"the tag is `{tag}`, and the version in pyproject.toml is `{version}`", file=sys.stderr)
        return 1
    notes = section((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), version)
    if notes is None:
        print(f"CHANGELOG.md has no section `## {version}`: rename `## Unreleased`", file=sys.stderr)
        return 1
    print(notes)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
