"""A hundred files with one slip each: no traceback, and what is refused is refused near the slip."""

from __future__ import annotations

import random
import re
from pathlib import Path

from thingc.diagnostics import Report
from thingc.importing import import_robot

ROBOTS = sorted((Path(__file__).parent / "robots").glob("*.urdf"))
SLIPS = (
    lambda line, _: re.sub(r'"[-\d.e]+', '"nan', line, count=1),
    lambda line, _: re.sub(r'="[^"]*"', '=""', line, count=1),
    lambda line, chance: line[: chance.randrange(len(line) + 1)],
    lambda line, _: re.sub(r'link="\w', 'link="x_', line),
    lambda line, _: line.replace(">", "", 1),
    lambda line, _: re.sub(r'type="\w', 'type="q', line),
)


def test_slips_are_said_where_they_are(tmp_path: Path) -> None:
    chance, path, refused, near = random.Random(5), tmp_path / "mutant.urdf", 0, 0
    while refused < 100:
        lines = chance.choice(ROBOTS).read_text().split("\n")
        number = chance.randrange(len(lines))
        slipped = chance.choice(SLIPS)(lines[number], chance)
        if slipped == lines[number]:
            continue
        lines[number] = slipped
        path.write_text("\n".join(lines))
        report = Report()
        if import_robot(str(path), report) is None:
            places = [d.span for d in report.diagnostics] + [note.span for d in report.diagnostics for note in d.notes]
            refused += 1
            near += any(place is not None and abs(place.line - number - 1) <= 3 for place in places)
        else:
            assert not report.failed
    assert near >= 90
