"""Format Python modules: assignments of nested calls, lists and dictionaries, in the style of ruff."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.generated_header import heading
from thingc.base.safe_text import escape_control
from thingc.model.robot.types import Robot

WIDTH = 88
"""Maximum length of a line."""

INDENT = "    "


class PythonExpression(str):
    """Python code, which is written unchanged."""

    __slots__ = ()


class PythonCall(FrozenStruct, kw_only=False):
    """A call with keyword arguments. Arguments that are None are omitted."""

    function: str
    arguments: Mapping[str, object]


def module(robot: Robot, framework: str, imports: Iterable[str], body: Iterable[str]) -> bytes:
    """Return the text of a module for a mode. `imports` and `body` contain blocks of code, which are separated by empty lines."""
    header = escape_control(heading(robot.assembly.definition.document, robot.mode.name))
    title = f'# {header}\n"""The robot `{robot.assembly.name}` in the mode `{robot.mode.name}`, for {framework}."""'
    return ("\n\n".join([title, *imports, *body]) + "\n").encode()


def import_line(package: str, names: Iterable[str]) -> str:
    """Return an import statement of names from a module."""
    flat = f"from {package} import {', '.join(names)}"
    return flat if len(flat) <= WIDTH else "\n".join([f"from {package} import (", *(f"{INDENT}{name}," for name in names), ")"])


def assignment(name: str, value: object) -> str:
    """Return an assignment to a constant."""
    return f"{name} = {_text(value, '', len(name) + 3)}"


def file_name(robot: Robot) -> str:
    """Return the name of the module of a mode, without the suffix. The name is a valid Python identifier."""
    return _identifier(f"{robot.assembly.name}_{robot.mode.name}")


def constant(robot: Robot) -> str:
    """Return the name of the Python constant that describes a robot, such as `ARM_CFG`."""
    return f"{_identifier(robot.assembly.name).upper()}_CFG"


def _identifier(text: str) -> str:
    return re.sub(r"^(?=\d)", "_", re.sub(r"\W", "_", text))


def _text(value: object, indent: str, column: int) -> str:
    """Format a value that begins at a column. A value that does not fit on the line has one line for each of its items."""
    opening, items, closing = _items(value)
    flat = opening + ", ".join(head + _text(item, indent, 0) for head, item in items) + closing
    if not items or (column + len(flat) <= WIDTH and "\n" not in flat):
        return flat if not isinstance(value, tuple) or len(items) != 1 else f"{flat[:-1]},)"
    deeper = indent + INDENT
    # a line ends with a comma
    lines = [f"{deeper}{head}{_text(item, deeper, len(deeper) + len(head) + 1)}," for head, item in items]
    return "\n".join([opening, *lines, indent + closing])


def _items(value: object) -> tuple[str, list[tuple[str, object]], str]:
    """Return the beginning of a value, its items, each with the text before it, and its end."""
    if isinstance(value, PythonCall):
        return f"{value.function}(", [(f"{name}=", item) for name, item in value.arguments.items() if item is not None], ")"
    if isinstance(value, Mapping):
        return "{", [(f"{json.dumps(key, ensure_ascii=False)}: ", item) for key, item in value.items()], "}"
    if isinstance(value, (list, tuple)):
        return ("[", [("", item) for item in value], "]") if isinstance(value, list) else ("(", [("", item) for item in value], ")")
    return _plain(value), [], ""


def _plain(value: object) -> str:
    if isinstance(value, PythonExpression):
        return str(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value + 0.0) if isinstance(value, float) else repr(value)
