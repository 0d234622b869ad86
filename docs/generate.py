"""Writes `docs/diagnostics.md` from the closed set of codes: `python docs/generate.py`."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from thingc.diagnostics import Code

PAGE = Path(__file__).resolve().parent / "diagnostics.md"

HEAD = """\
# Diagnostics

Everything that thingc can say is wrong. A message names the place, what was expected and what was found; its `help` says what to
type next.

```yaml
# wrong.yaml
thingc: assembly/1
name: wrong
materials: [assemblies/materials.yaml]
components:
  plate: {part: arm:BasePlate, params: {siz: 120 mm}}
  board: {frame: true, mass: 12 g, at: {in: plat.origin}}
```

```console
$ thingc check wrong.yaml
error[TC305]: `arm:BasePlate` has no parameter `siz`
   --> wrong.yaml:6:41
  6 |   plate: {part: arm:BasePlate, params: {siz: 120 mm}}
    |                                         ^^^
  note: `arm:BasePlate` is written here
...
  help: did you mean `size`?

error[TC302]: this document has no component `plat`
   --> wrong.yaml:7:45
  7 |   board: {frame: true, mass: 12 g, at: {in: plat.origin}}
    |                                             ^^^^^^^^^^^
  help: did you mean `plate`?

2 errors
```

Several faults are said in one run. A document that is not well-formed, or whose keys and values are wrong (TC1xx, TC2xx), is
mended first: names, parts and masses are looked at when it is right. Errors end a build. Warnings do not, unless `--strict` is
given. How all this looks in JSON is in [outputs](outputs.md#json).

Codes are never used twice and never renumbered.
"""


def sections() -> dict[str, str]:
    """What each hundred is about (`TC1`: `reading files`), from the comments in the source of `Code`."""
    found = re.findall(r"# --- (TC\d)xx: ([^()\n-]+?)(?: \([^)]*\))? -+$", inspect.getsource(Code), re.MULTILINE)
    return dict(found)


def page() -> str:
    """The whole page."""
    lines = [HEAD]
    titles = sections()
    for hundred in sorted({code.code[:3] for code in Code}):
        lines += [f"## {hundred}xx: {titles[hundred]}", "", "| code | | cure |", "|---|---|---|"]
        for code in sorted((code for code in Code if code.code.startswith(hundred)), key=lambda code: code.code):
            lines.append(f"| {code.code} | {_cell(code.title)} | {_cell(code.cure)} |")
        lines.append("")
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
    print(f"{PAGE.name}: {len(Code)} codes")
