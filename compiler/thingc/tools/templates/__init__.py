"""What `thingc new` begins a workspace with: one folder here for each template, and `common/` for what all of them have. `stubs/` has
what `thingc add` begins a part or an assembly with.

In a template the robot is called `my_robot`, in names of files and in texts; so each of them is a workspace as it lies here. A name that
begins with `dot_` begins with a dot in the workspace.
"""

from __future__ import annotations

from pathlib import Path

TEMPLATES = {
    "arm": "an arm of three servos, bolted to a table or held by its tip",
    "legged": "a biped of four servos that walks, and stands on either foot",
    "gripper": "a gripper of one servo: two gears, and fingers that loops keep parallel",
    "empty": "two parts and a joint, to begin with",
}
"""Each template, and in words what its robot is; the first is the usual one."""
PLACEHOLDER = "my_robot"
_HERE = Path(__file__).parent


def files_of(template: str, name: str) -> dict[str, bytes]:
    """The files of a workspace, by their path in it with `/`, for a robot of that name. What a template has itself goes before what all
    of them have. Raises `ValueError` for a name that another document of the template has."""
    if name.lower() != PLACEHOLDER and any(path.stem == name.lower() for path in (_HERE / template).glob("*.yaml")):
        raise ValueError(f"`{name}` is another document of the template `{template}`")
    files: dict[str, bytes] = {}
    for folder in (_HERE / "common", _HERE / template):
        for path in sorted(folder.rglob("*")):
            words = path.relative_to(folder).parts
            if path.is_file() and "__pycache__" not in words:
                place = "/".join(f".{word.removeprefix('dot_')}" if word.startswith("dot_") else word for word in words)
                files[place.replace(PLACEHOLDER, name)] = path.read_bytes().replace(PLACEHOLDER.encode(), name.encode())
    return files


def new_part(name: str, material: str | None) -> str:
    """Return a module of parts with one class, with a default material (None: the document must set it)."""
    text = (_HERE / "stubs" / "part.py").read_text(encoding="utf-8")
    stated = "" if material is None else f'material="{material}"'
    return text.replace("MyPart", name).replace('material="pla"', stated)


def new_assembly(name: str, suffix: str) -> str:
    """Return an assembly document with one frame; `suffix` is `.yaml` or `.toml`."""
    return (_HERE / "stubs" / f"assembly{suffix}.txt").read_text(encoding="utf-8").replace("NAME", name)
