"""The templates of `thingc new`. Each template is a folder, and `common/` contains the files that all templates share.

The folder `stubs/` contains the templates of `thingc add`. In file names and texts of a template, the name of the robot is `my_robot`, so
that the folder is a valid workspace. In a new workspace, the prefix `dot_` of file names is replaced by a dot.
"""

from __future__ import annotations

from pathlib import Path

TEMPLATES = {
    "arm": "an arm of three servos, bolted to a table or held by its tip",
    "legged": "a biped of four servos that walks and can stand on either foot",
    "gripper": "a gripper with one servo: two gears, and fingers kept parallel by loops",
    "empty": "two parts and a joint",
}
"""Maps the names of the templates to descriptions. The first template is the default."""
PLACEHOLDER = "my_robot"
_HERE = Path(__file__).parent


def files_of(template: str, name: str) -> dict[str, bytes]:
    """Return the files of a new workspace for a robot, keyed by path with `/` as separator.

    A file of the template replaces the file with the same path in `common/`.

    Raises `ValueError` if another document in the template already has the name of the robot.
    """
    if name.lower() != PLACEHOLDER and any(path.stem == name.lower() for path in (_HERE / template).glob("*.yaml")):
        raise ValueError(f"`{name}` is the name of another document of the template `{template}`")
    files: dict[str, bytes] = {}
    for folder in (_HERE / "common", _HERE / template):
        for path in sorted(folder.rglob("*")):
            words = path.relative_to(folder).parts
            if path.is_file() and "__pycache__" not in words:
                place = "/".join(f".{word.removeprefix('dot_')}" if word.startswith("dot_") else word for word in words)
                files[place.replace(PLACEHOLDER, name)] = path.read_bytes().replace(PLACEHOLDER.encode(), name.encode())
    return files


def new_part(name: str, material: str | None) -> str:
    """Return the source code of a new Python module with one part class.

    `material` is the default material of the part, or None if documents must specify a material.
    """
    text = (_HERE / "stubs" / "part.py").read_text(encoding="utf-8")
    argument = "" if material is None else f'material="{material}"'
    return text.replace("MyPart", name).replace('material="pla"', argument)


def new_assembly(name: str, suffix: str) -> str:
    """Return the content of a new assembly document with one frame. `suffix` is the suffix of the document file, `.yaml` or `.toml`."""
    return (_HERE / "stubs" / f"assembly{suffix}.txt").read_text(encoding="utf-8").replace("NAME", name)
