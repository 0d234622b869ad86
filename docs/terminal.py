"""`make pictures`: record the terminal session of the README as an animated SVG.

The commands run in a temporary folder. The animation shows each command and its output, in twenty seconds.
"""

from __future__ import annotations

import html
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

SECONDS = 20.0
COLUMNS, ROWS = 96, 25
LINE, CHARACTER = 19.0, 8.43
"""Height of a line and width of a character [px]."""

SCENES: tuple[tuple[str, float], ...] = (
    ("thingc new rover", 0.0),
    ("cd rover && thingc check rover.yaml", 3.0),
    ("sed -i 's/drive: shoulder_servo/drive: sholder_servo/' rover.yaml   # a typo", 5.0),
    ("thingc check rover.yaml", 7.2),
    ("thingc check --fix rover.yaml", 10.0),
    ("thingc build rover.yaml", 12.5),
    ("thingc info rover.yaml | head -4", 15.5),
)
"""Commands and the times at which they are typed [s]."""

COLOURS = (
    (re.compile(r"^(error)(\[TC\d+\])"), "bad"), (re.compile(r"^\s+\|\s+\^+$"), "bad"), (re.compile(r"^\s+help: "), "good"),
    (re.compile(r"fixed `|no diagnostics remain"), "good"),
)
"""Patterns of coloured lines."""


@dataclass(frozen=True)
class Line:
    """A line of the recording: its time [s], text and class."""

    at: float
    text: str
    kind: str


def recorded() -> list[Line]:
    """Run all commands and return the lines."""
    lines: list[Line] = []
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        own = str(Path(sys.executable).parent)
        environment = {
            **os.environ, "THINGC_STORE": str(where / "store"), "COLUMNS": str(COLUMNS), "PATH": f"{own}{os.pathsep}{os.environ['PATH']}",
        }
        for command, start in SCENES:
            lines.append(Line(start, f"$ {command}", "typed"))
            done = subprocess.run(
                ["bash", "-c", command], cwd=where, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )
            if command.startswith("cd "):
                where /= command.split()[1]
            at = start + 0.3 + 0.022 * len(command)
            for number, text in enumerate(said(done.stdout)):
                lines.append(Line(at + 0.04 * number, text, next((kind for look, kind in COLOURS if look.search(text)), "plain")))
            lines.append(Line(at + 0.5, "", "plain"))
    return lines


def said(text: str) -> list[str]:
    """Return the lines of an output, truncated to the width of the picture, without progress lines."""
    return [line[:COLUMNS] for line in text.rstrip().splitlines() if not re.match(r"\w+ parts: \d", line)]


def svg(lines: list[Line]) -> str:
    """Return the animation, which repeats."""
    width, height = COLUMNS * CHARACTER + 36, ROWS * LINE + 56
    rules: list[str] = []
    texts: list[str] = []
    scrolled: dict[float, int] = {}
    for number, line in enumerate(lines):
        scrolled[line.at] = max(0, number + 1 - ROWS)
        share = 100.0 * line.at / SECONDS
        y = (number + 1) * LINE
        if line.text:
            if line.kind == "typed":
                rules.append(
                    f"@keyframes l{number} {{ 0%, {share:.2f}% {{ clip-path: inset(0 100% 0 0); }}"
                    f" {share + 100.0 * 0.022 * len(line.text) / SECONDS:.2f}%, 98% {{ clip-path: inset(0 0 0 0); }} 98.01%, 100%"
                    " { clip-path: inset(0 100% 0 0); } }"
                )
                timing = f"steps({len(line.text)})"
            else:
                rules.append(f"@keyframes l{number} {{ 0%, {share:.2f}% {{ opacity: 0; }} {share + 0.01:.2f}%, 98% {{ opacity: 1; }}"
                             " 98.01%, 100% { opacity: 0; } }")
                timing = "linear"
            texts.append(f'<text class="{line.kind}" y="{y:g}" style="animation: l{number} {SECONDS:g}s {timing} infinite">'
                         f"{html.escape(line.text)}</text>")
    moves = [f"{100.0 * at / SECONDS:.2f}% {{ transform: translateY({-LINE * by:g}px); }}" for at, by in scrolled.items()]
    rules.append(f"@keyframes scroll {{ 0% {{ transform: translateY(0); }} {' '.join(moves)} }}")
    newline = "\n"
    size = f'width="{width:.0f}" height="{height:.0f}"'
    return f"""<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width:.0f} {height:.0f}" role="img">
<title>thingc in a terminal: create a robot, find and fix a typo, build</title>
<style>
{newline.join(rules)}
text {{ font: 14px ui-monospace, Menlo, Consolas, "DejaVu Sans Mono", monospace; white-space: pre; fill: #e9edf1; }}
.typed {{ fill: #8fd0ff; }} .bad {{ fill: #ff8f87; }} .good {{ fill: #9be29b; }}
.scroll {{ animation: scroll {SECONDS:g}s step-end infinite; }}
</style>
<rect width="100%" height="100%" rx="10" fill="#1d242c"/>
<circle cx="22" cy="18" r="5" fill="#ff6159"/><circle cx="40" cy="18" r="5" fill="#ffbf2f"/><circle cx="58" cy="18" r="5" fill="#2aca41"/>
<svg x="18" y="36" width="{width - 36:.0f}" height="{ROWS * LINE + 8:.0f}"><g class="scroll">
{newline.join(texts)}
</g></svg>
</svg>
"""


def write(path: Path) -> None:
    """Record the session, and write the picture."""
    path.write_text(svg(recorded()))
