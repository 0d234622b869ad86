"""Pairs of documents with known differences. In one group, documents of existing robots are edited, and `cases.yaml` lists the expected
changes. In the other group, documents are rewritten without changing the robot.
"""

from __future__ import annotations

import random
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import yaml

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
Made = tuple[str, str, str, str | None]


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A document in its workspace. `folder` is the folder of the workspace, which is copied, and `document` is the path relative to this
    folder.
    """

    folder: str
    document: str

    def copy(self, to: Path) -> Path:
        """Copy the workspace to a folder, and return the path of the document in the copy."""
        for name in ("assemblies", "parts") if self.folder == "." else (".",):
            shutil.copytree(
                ROOT / self.folder / name, to / name, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__", "build"),
            )
        if self.folder == ".":
            shutil.copy(ROOT / "thingc.toml", to)
        return to / self.document


ROBOTS = {
    "arm": Robot(folder=".", document="assemblies/arm.yaml"),
    "minchw": Robot(folder=".", document="assemblies/minchw/minchw.yaml"),
    "hexapod": Robot(folder="gallery/hexapod", document="hexapod.yaml"),
}


@dataclass(frozen=True, kw_only=True)
class Case:
    """A robot, edits of files beside its document, and the changes that these edits cause."""

    robot: str
    name: str
    edits: tuple[tuple[str, str, str], ...]
    made: frozenset[Made]

    def write(self, document: Path) -> None:
        """Apply the edits of the case to the files beside a document. Raises `ValueError` if the text of an edit does not occur exactly
        once.
        """
        for file, old, new in self.edits:
            path = document.parent / file
            text = path.read_text()
            if text.count(old) != 1:
                raise ValueError(f"{self.robot}, {self.name}: {old!r} stands {text.count(old)} times in {file}")
            path.write_text(text.replace(old, new))


def cases() -> list[Case]:
    """Return the cases that `cases.yaml` lists."""
    return [
        Case(
            robot=one["robot"], name=one["name"], edits=tuple((edit["file"], edit["old"], edit["new"]) for edit in one["edits"]),
            made=frozenset((what, how, path, field) for what, how, path, field in one["made"]),
        )
        for one in yaml.safe_load((HERE / "cases.yaml").read_text())
    ]


def rewritten(text: str, number: int) -> str:
    """Rewrite a document without changing its meaning. Depending on `number`, the function changes comments, empty lines, units, quotes or
    the order of sections.
    """
    source = random.Random(number)
    kind = number % 5
    if kind == 0:
        lines = text.split("\n")
        for _ in range(8):
            lines.insert(source.randrange(1, len(lines)), source.choice(("", "# a remark", "    # another")))
        return "\n".join(lines)
    if kind == 1:
        return "\n".join(re.sub(r"\s+#( .*)?$", "", line) for line in text.split("\n"))
    if kind == 2:
        return re.sub(r"(?<![\w.-])(?<!\d )(\d+) mm\b(?!\))", lambda m: f"{int(m[1]) / 10:g} cm" if source.random() < 0.5 else m[0], text)
    if kind == 3:
        return re.sub(r"(: )=([\w ]+)([,}\n])", lambda m: f'{m[1]}"={m[2]}"{m[3]}' if source.random() < 0.7 else m[0], text)
    head, *sections = re.split(r"\n(?=[a-z]+:)", text)
    source.shuffle(sections)
    return "\n".join([head, *(section.rstrip("\n") for section in sections)]) + "\n"
