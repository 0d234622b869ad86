"""JSON with comments and trailing commas, as editors keep their settings: read with places, so that one value can be replaced
and every other byte stays."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

_SPACE = re.compile(r"(?:[ \t\r\n]+|//[^\r\n]*|/\*.*?\*/)*", re.DOTALL)
_STRING = re.compile(r'"(?:[^"\\\x00-\x1f]|\\.)*"')
_PLAIN = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|true|false|null")
MAX_LEVELS = 100


class NotJson(ValueError):
    """Text that is no JSON with comments. `offset` is the character to blame."""

    def __init__(self, message: str, offset: int) -> None:
        super().__init__(message)
        self.offset = offset


@dataclass(slots=True)
class Value:
    """A value and where it stands (`end` exclusive); of an object the members by name, each the place where its key begins and its
    value."""

    plain: Any
    start: int
    end: int
    members: dict[str, tuple[int, Value]] = field(default_factory=dict)


def read(text: str) -> Value:
    """The value that a text is. Raises `NotJson`."""
    value = _value(text, _skip(text, 1 if text.startswith("\ufeff") else 0), 0)
    rest = _skip(text, value.end)
    if rest < len(text):
        raise NotJson("expected the end", rest)
    return value


def _skip(text: str, at: int) -> int:
    match = _SPACE.match(text, at)
    return match.end() if match else at


def _value(text: str, at: int, level: int) -> Value:
    if level > MAX_LEVELS:
        raise NotJson(f"more than {MAX_LEVELS} levels", at)
    if text[at : at + 1] == "{":
        return _object(text, at, level)
    if text[at : at + 1] == "[":
        return _list(text, at, level)
    match = _STRING.match(text, at) or _PLAIN.match(text, at)
    if match is None:
        raise NotJson("expected a value", at)
    try:
        return Value(json.loads(match.group()), at, match.end())
    except ValueError:
        raise NotJson("no text that JSON allows", at) from None


def _object(text: str, start: int, level: int) -> Value:
    members: dict[str, tuple[int, Value]] = {}
    at = _skip(text, start + 1)
    while text[at : at + 1] != "}":
        key = _STRING.match(text, at)
        if key is None:
            raise NotJson("expected a key in quotes or `}`", at)
        colon = _skip(text, key.end())
        if text[colon : colon + 1] != ":":
            raise NotJson("expected `:`", colon)
        value = _value(text, _skip(text, colon + 1), level + 1)
        members[json.loads(key.group())] = (at, value)
        at = _next(text, value.end, "}")
    return Value({name: value.plain for name, (_, value) in members.items()}, start, at + 1, members)


def _list(text: str, start: int, level: int) -> Value:
    items: list[Any] = []
    at = _skip(text, start + 1)
    while text[at : at + 1] != "]":
        value = _value(text, at, level + 1)
        items.append(value.plain)
        at = _next(text, value.end, "]")
    return Value(items, start, at + 1)


def _next(text: str, at: int, end: str) -> int:
    """Behind the comma, or at the bracket that ends."""
    at = _skip(text, at)
    if text[at : at + 1] == ",":
        return _skip(text, at + 1)
    if text[at : at + 1] != end:
        raise NotJson(f"expected `,` or `{end}`", at)
    return at


def with_members(text: str, key: str, members: Mapping[str, Any]) -> str:
    """The text with these members in the object under a key of its outermost one, which is made where there is none.

    Everything else stays as it is, byte for byte. Raises `NotJson`, also where one of the two is no object.
    """
    if not text.strip("\ufeff \t\r\n"):
        text = "{}\n"
    top = _mapping(read(text))
    if key not in top.members:
        return _inserted(text, top, {key: dict(members)}) if members else text
    there = _mapping(top.members[key][1])
    known = {name: value for name, (_, value) in there.members.items()}
    fresh = {name: value for name, value in members.items() if name not in known}
    if fresh:
        text = _inserted(text, there, fresh)
    for name, value in sorted(known.items(), key=lambda item: -item[1].start):
        if name in members and value.plain != members[name]:
            text = text[: value.start] + _shown(members[name], _indent(text, value.start)) + text[value.end :]
    return text


def without_members(text: str, key: str, names: Iterable[str]) -> str:
    """The text without some members of the object under a key of its outermost one: their lines and commas go with them."""
    for name in names:
        there = read(text).members[key][1]
        start, value = there.members[name]
        text = _without(text, start, value.end)
    return text


def _mapping(value: Value) -> Value:
    if not isinstance(value.plain, dict):
        raise NotJson("expected an object", value.start)
    return value


def _without(text: str, start: int, end: int) -> str:
    comma = _skip(text, end)
    if text[comma : comma + 1] == ",":
        end = comma + 1
    else:  # the last one: the comma before it goes
        before = text[:start].rstrip()
        if before.endswith(","):
            text = before[:-1] + text[len(before) :]
            start, end = start - 1, end - 1
    line = text.rfind("\n", 0, start) + 1
    rest = re.match(r"[ \t]*\r?\n", text[end:])
    if rest is not None and not text[line:start].strip():
        return text[:line] + text[end + rest.end() :]
    return text[:start] + text[end:].lstrip(" \t")


def _inserted(text: str, here: Value, members: Mapping[str, Any]) -> str:
    """New members behind the others of an object, each on a line of its own."""
    newline = "\r\n" if "\r\n" in text else "\n"
    outer = _indent(text, here.start)
    inner = outer + ("\t" if outer.startswith("\t") or "\n\t" in text else "  ")
    close = here.end - 1
    if here.members:
        first = next(iter(here.members.values()))[0]
        if "\n" in text[here.start : first]:
            inner = _indent(text, first)
    step = "\t" if inner.endswith("\t") else "  "
    lines = [f"{inner}{json.dumps(name, ensure_ascii=False)}: {_shown(value, inner, step)}" for name, value in members.items()]
    body = ("," + "\n").join(lines).replace("\n", newline)
    head = text[:close]
    trailing = ""
    if here.members:
        last = max(value.end for _, value in here.members.values())
        after = _skip(text, last)
        if text[after : after + 1] == ",":
            trailing = ","
        else:
            head = f"{text[:last]},{text[last:close]}"
    return f"{head.rstrip()}{newline}{body}{trailing}{newline}{outer}{text[close:]}"


def _indent(text: str, at: int) -> str:
    """The white space at the beginning of the line of a character."""
    line = text[text.rfind("\n", 0, at) + 1 :]
    return line[: len(line) - len(line.lstrip(" \t"))]


def _shown(value: Any, indent: str, step: str = "  ") -> str:
    return json.dumps(value, indent=step, ensure_ascii=False).replace("\n", "\n" + indent)
