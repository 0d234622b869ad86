"""Import files of robots with one random error each, and check the diagnostics:
`python benchmarks/importing/slips.py FILE_OR_FOLDER... [--count 500]`.

An error must not cause a traceback. If a file is rejected, a diagnostic must be near the error. It must be at most two lines away, because
the parser finds an unclosed tag later, or at a line that uses a removed name.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from thingc.base.diagnostics import Report
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import import_robot

NEAR = 2
"""Number of lines between an error and a diagnostic that counts as near."""
NAME = re.compile(r'\bname="([^"]+)"')
Slip = Callable[[str, random.Random], str]
SLIPS: dict[str, Slip] = {
    "nan": lambda line, _: re.sub(r'"[-\d.e]+', '"nan', line, count=1),
    "beyond numbers": lambda line, _: re.sub(r'"[-\d.]+', '"1e999', line, count=1),
    "a word for a number": lambda line, _: re.sub(r'"-?\d[\d.]*', '"O.5', line, count=1),
    "a comma": lambda line, _: re.sub(r'(\d) (-?\d)', r"\1, \2", line, count=1),
    "empty": lambda line, _: re.sub(r'="[^"]*"', '=""', line, count=1),
    "cut off": lambda line, chance: line[: chance.randrange(len(line) + 1)],
    "another link": lambda line, _: re.sub(r'link="\w', 'link="x_', line),
    "another joint": lambda line, _: re.sub(r'joint="\w', 'joint="x_', line),
    "a tag that is not closed": lambda line, _: line.replace(">", "", 1),
    "a quote that is not closed": lambda line, _: re.sub(r'"([^"]*)"', r'"\1', line, count=1),
    "another kind": lambda line, _: re.sub(r'type="\w', 'type="q', line) if "<joint" in line else line,
    "an attribute less": lambda line, _: re.sub(r'(<(?:joint|link|parent|child|mass|box|mesh)[^>]*?) \w+="[^"]*"', r"\1", line, count=1),
    "no direction": lambda line, _: re.sub(r'<axis xyz="[^"]*"', '<axis xyz="0 0 0"', line),
    "below zero": lambda line, _: re.sub(r'((?:value|radius|length|effort|velocity)=")(\d)', r"\1-\2", line, count=1),
    "ends swapped": lambda line, _: re.sub(r'(.*?)lower="([^"]+)"(.*?)upper="([^"]+)"', r'\1lower="\4"\3upper="\2"', line),
    "twice": lambda line, _: f"{line}{line}" if re.search(r"<(link|joint)\b[^>]*/>|<(parent|child|mass|limit|axis)\b", line) else line,
    "nan in an element": lambda line, _: re.sub(r">-?\d[\d.]*", ">nan", line, count=1),
    "another name in an element": lambda line, _: re.sub(r"<(parent|child)>\w", r"<\1>x_", line),
    "another frame": lambda line, _: re.sub(r'(relative_to|attached_to|expressed_in)="\w', r'\1="x_', line),
    "a child as its own parent": lambda line, _: re.sub(r'<child link="([^"]*)"', r'<child link="\1"/><parent link="\1"', line),
}
"""Functions that introduce an error into a line. A function returns the line unchanged if the error does not apply."""


def robots_in(folder: Path) -> list[Path]:
    """Return the URDF and SDF files in a folder. MJCF files must be named explicitly, because some MJCF files are only parts of other
    files.
    """
    return sorted(path for path in folder.rglob("*") if path.suffix in (".urdf", ".sdf"))


def slipped(text: str, chance: random.Random) -> tuple[str, int, str]:
    """Return a copy of a text with one random error, the line number of the error (from 1), and the kind of the error."""
    lines = text.split("\n")
    while True:
        number, name = chance.randrange(len(lines)), chance.choice(list(SLIPS))
        after = SLIPS[name](lines[number], chance)
        if after != lines[number]:
            return "\n".join([*lines[:number], after, *lines[number + 1 :]]), number + 1, name


def refused(path: Path) -> list[int] | None:
    """Import a file, and return the lines of its diagnostics and notes. Return None if the file is accepted."""
    report = Report()
    if import_robot(str(path), report, ImportRequest(repair="nearest", meshes=False)) is not None:
        return None
    places = [d.span for d in report.diagnostics] + [note.span for d in report.diagnostics for note in d.notes]
    return [place.line for place in places if place is not None]


def uses_lost_name(before: str, after: str, line: int, said: Sequence[int]) -> bool:
    """Return whether one of the reported lines contains the name that the error removed."""
    name = NAME.search(before.split("\n")[line - 1])
    lines = after.split("\n")
    return name is not None and name[0] not in lines[line - 1] and any(f'"{name[1]}"' in lines[one - 1] for one in said)


def tried(files: Sequence[Path], count: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Import files with random errors. Return the number of errors that were `refused`, reported `near` the error, accepted (`taken`) or
    caused an exception (`raised`). Also return descriptions of unexpected results.
    """
    chance, found, odd = random.Random(seed), Counter[str](), list[str]()
    texts = {file: file.read_text() for file in files if refused(file) is None}
    if not texts:
        raise SystemExit("none of these files can be imported as it is")
    with tempfile.TemporaryDirectory() as folder:
        beside = {file: _beside(file, Path(folder) / str(number)) for number, file in enumerate(texts)}
        for _ in range(count):
            file = chance.choice([*texts])
            path = beside[file] / f"slip{file.suffix}"
            text, line, name = slipped(texts[file], chance)
            path.write_text(text)
            try:
                said = refused(path)
            except Exception:
                found["raised"] += 1
                odd.append(f"{file.name}:{line}: {name}: {traceback.format_exc().splitlines()[-1]}")
                continue
            if said is None:
                found["taken"] += 1
                continue
            near = any(abs(one - line) <= NEAR for one in said) or uses_lost_name(texts[file], text, line, said)
            found["refused"] += 1
            found["near"] += near
            if not near:
                odd.append(f"{file.name}:{line}: {name}: said at {sorted(said)[:4]}")
    return found, odd


def _beside(file: Path, folder: Path) -> Path:
    """Return a new folder for modified copies of a file. For MJCF, the folder contains the other files that the model needs."""
    if file.suffix == ".xml":
        shutil.copytree(file.parent, folder)
    else:
        folder.mkdir()
    return folder


def main() -> int:
    """Run all imports. Return 1 if an import caused a traceback, or if less than 95 % of the rejected errors were reported nearby."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    files = [file for path in arguments.paths for file in (robots_in(path) if path.is_dir() else [path])]
    found, odd = tried(files, arguments.count, arguments.seed)
    print("\n".join(odd))
    print(
        f"{arguments.count} slips in {len(files)} files: {found['refused']} refused, {found['near']} of them where the slip is "
        f"({found['near'] / max(found['refused'], 1):.1%}); {found['taken']} taken; {found['raised']} tracebacks",
    )
    return int(found["raised"] > 0 or found["near"] < 0.95 * found["refused"])


if __name__ == "__main__":
    sys.exit(main())
