"""Generated workspaces: damaged documents of the repository, and documents generated from the schemas."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.materials import MaterialsSpec

ROOT = Path(__file__).resolve().parents[2]

NASTY = [
    "", "0", "-0", "1", "-1", "1e308", "1e309", "-1e-320", "0x1F", "0o17", ".inf", ".nan", "NaN", "true", "null", "~", "{}", "[]", "[[]]",
    "*", "**", "*a", "&a 1", "!!python/object/apply:os.system [id]", "=", "= ", "=1/0", "=9**9**9", "=sqrt(-1)", "=(", "=a b", "=a.b",
        "=min()",
    "=max(1 mm, 1)", "=-" * 30, "1 mm", "1 mm mm", "1 mm/0", "1 m^99999", "1 furlong", "1  mm", "1\u00a0mm", "1 µm", "１ mm", "1,5 mm",
    "$i", "${i}", "$",
    "a.b.c.d", "a..b", ".", "..", "/etc/passwd", "../../../etc/passwd", "~/x", "C:\\x", "file:///etc/passwd", "a\\u0000b",
    "\"\\u0000\"", "\"\\ud800\"",
    "\U0001f600", "\u202e", "A" * 300, "x" * 5000, "- " * 50, "[" * 120, "{a: " * 60, "- - -", "? ?", ": :", "%YAML 1.1", "---", "...",
        "#", "<<: *a", "@", "`",
    "os:system", "subprocess:Popen", "builtins:eval", "arm:", ":Arm", "arm:__class__", "arm:Pen.__init__", "thingc.tools.cli.main:main",
    "world", "root", "origin",
    "hull", "decompose", "fixed", "held", "free", "planar", "x", "floor", "here", "measured", "1 N*m", "30 deg", "12 g", "15 %",
    "2026-01-01", "#fff",
    "{value: 1 mm, source: measured}", "{in: a.origin, xyz: 0 0 1 mm}", "{lower: 1 deg, upper: 0}", "{count: 99999999, as: i}",
    "{count: -1, as: i}", "0 0 0",
    "1 2 3 4", "[1, 2", "{joint: a, multiplier: 0}", "[1 mm, 2 deg, 3]", "'", "\"", "|", ">", "\t", "\r", "\x85", "\ufeff",
    *(f'"{escape}"' for escape in (
        r"q\e[31m:X", r"\e]0;x\a", r"a\0b.step", r"a\nb.yaml", r"\u202ea", r"\u200b", r"\x9b1m", r"\U000E0041", r"\r\n::error::x",
        r"\u2028",
    )),
    "caf\udce9.yaml", "=cmd|' /C calc'!A0", "a" * 100_000, "`" * 3000,
]
"""Texts that users and attackers may write in place of valid values."""

NAMES = [
    "caf\udce9.yaml", "a\nb.yaml", "\x1b[31m.yaml", "\u202ea.yaml", "-x.yaml", " .yaml", "$(id).yaml", "a\\.yaml", "'\".yaml",
    "a:b,c%d.yaml",
    "\u200b.toml", "x" * 200 + ".yaml",
]
"""Names that documents can have in a file system. `�` stands for a byte that is not valid UTF-8."""

PATHS = [
    "../x.yaml", "/etc/hostname", r'"a\0b.step"', r'"\e[31m.yaml"', *NAMES, "z_link.yaml", "z_pipe.yaml", "z_folder.yaml", "x.step",
    "document.yaml",
]
"""Paths with which documents may refer to other files."""

_VALUE = re.compile(r"(?<=: )[^\n{}\[\],#]+|(?<=\[)[^\n{}\[\],#]+|(?<=, )[^\n{}\[\],#]+")
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*")


@dataclass(frozen=True)
class Seed:
    """A document, the files beside it, and its name."""

    name: str
    files: Mapping[str, str]


def seeds() -> list[Seed]:
    """Return the robots of the repository and every case of an invalid document, each with the files beside it."""
    found: list[Seed] = []
    for folder in (ROOT / "assemblies", ROOT / "assemblies" / "minchw"):
        files = _texts(folder)
        found += [Seed(name, files) for name in files]
    for folder in sorted(path for path in (ROOT / "tests" / "cases").iterdir() if path.is_dir()):
        files = _texts(folder)
        found += [Seed(name, files) for name in files if not name.startswith("_") and name not in ("thingc.toml", "pyproject.toml")]
    return found


def _texts(folder: Path) -> dict[str, str]:
    return {
        path.name: path.read_bytes().decode("utf-8", "replace") for path in sorted(folder.iterdir())
        if path.is_file() and path.suffix in (".yaml", ".yml", ".toml") and path.stat().st_size < 100_000
    }


class Grammar:
    """Generates documents from the JSON Schemas of the document models. Most values are valid, and some are not."""

    def __init__(self, random_: random.Random) -> None:
        self.random = random_
        self.schemas = {"assembly": AssemblySpec.model_json_schema(), "materials": MaterialsSpec.model_json_schema()}
        self.names = ["a", "b", "c", "base", "arm", "leg", "leg_0", "hand", "home", "A"]

    def document(self, kind: str, *, toml: bool) -> str:
        """Generate a document of a kind."""
        schema = self.schemas[kind]
        value = self._made(schema, schema.get("$defs", {}), 0)
        if not isinstance(value, dict):
            return str(value)
        value["thingc"] = f"{kind}/1"
        value.setdefault("name", "fuzzed")
        if kind == "assembly" and not isinstance(value.get("components"), dict):
            value["components"] = {"base": {"frame": True}}
        return "\n".join(f"{key} = {_toml(item)}" for key, item in value.items()) if toml else _yaml(value)

    def _made(self, schema: Any, definitions: Any, depth: int) -> Any:
        choose = self.random
        if choose.random() < 0.02 or depth > 9 or not isinstance(schema, dict):
            return choose.choice(NASTY)
        if "$ref" in schema:
            return self._made(definitions.get(schema["$ref"].rpartition("/")[2], {}), definitions, depth + 1)
        for key in ("anyOf", "oneOf", "allOf"):
            if key in schema:
                return self._made(choose.choice(schema[key]), definitions, depth + 1)
        if "const" in schema:
            return schema["const"]
        if "enum" in schema:
            return choose.choice(schema["enum"])
        if schema.get("examples") and choose.random() < 0.7:
            return choose.choice(schema["examples"])
        kind = schema.get("type")
        if kind == "object" or "properties" in schema:
            return self._object(schema, definitions, depth)
        if kind == "array":
            count = choose.choice([0, 1, 2, 3, 3, 3, 4])
            return [self._made(schema.get("items", {}), definitions, depth + 1) for _ in range(count)]
        if kind == "boolean":
            return choose.random() < 0.7
        if kind in ("number", "integer"):
            return choose.choice([0, 1, 2, 3, -1, 0.5, 1e9, 10_001, 2**64])
        return choose.choice([*self.names, *[f"{a}.{b}" for a in self.names[:4] for b in ("origin", "m", "tip")], choose.choice(NASTY)])

    def _object(self, schema: Any, definitions: Any, depth: int) -> dict[str, Any]:
        choose = self.random
        made: dict[str, Any] = {}
        required = schema.get("required", [])
        for name, inner in schema.get("properties", {}).items():
            if name in required or choose.random() < (0.5 if depth == 0 else 0.25):
                made[name] = self._made(inner, definitions, depth + 1)
        more = schema.get("additionalProperties")
        if isinstance(more, dict):
            for _ in range(choose.choice([0, 1, 2, 4])):
                made[choose.choice(self.names)] = self._made(more, definitions, depth + 1)
        return made


def _yaml(value: Any) -> str:
    """Write a document in flow style, with one key of the first level per line. Texts are not quoted, so that damaged texts stay
    damaged."""
    return "\n".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "\n" if isinstance(value, dict) else _flow(value)


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(item) for item in value) + "]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, (int, float)) else '"' + str(value).replace("\\", "\\\\").replace('"', '\\"') + '"'


def mutated(text: str, choose: random.Random, donors: list[str]) -> str:
    """Return the text with one to five changes: a value, a word, a line, an indentation, a byte, or a piece of another document."""
    for _ in range(choose.choice([1, 1, 1, 2, 3, 5])):
        lines = text.split("\n")
        number = choose.randrange(len(lines))
        kind = choose.randrange(13)
        if kind <= 3 and (places := list(_VALUE.finditer(text))):
            place = choose.choice(places)
            other = choose.choice(NASTY) if choose.random() < 0.6 else choose.choice(places).group()
            text = text[: place.start()] + other + text[place.end():]
        elif kind == 4 and (places := list(_WORD.finditer(text))):
            place, other = choose.choice(places), choose.choice(places).group()
            text = text[: place.start()] + other + text[place.end():]
        elif kind == 5:
            text = "\n".join([*lines[:number], *lines[number + 1:]])
        elif kind == 6:
            text = "\n".join([*lines[:number], lines[number], *lines[number:]])
        elif kind == 7:
            shifted = " " * choose.randrange(4) + lines[number].lstrip() if choose.random() < 0.5 else "  " + lines[number]
            text = "\n".join([*lines[:number], shifted, *lines[number + 1:]])
        elif kind == 8 and text:
            at = choose.randrange(len(text))
            text = text[:at] + choose.choice(["{", "}", "[", "]", ":", ",", "\"", "'", "\t", "&a ", "*a", "#", "|", "\0", "é", "\u2028",
                "="]) + text[at:]
        elif kind == 9 and text:
            at = choose.randrange(len(text))
            text = text[:at] + text[at + choose.choice([1, 1, 2, 8, 60]):]
        elif kind == 10:
            other_lines = choose.choice(donors).split("\n")
            first = choose.randrange(len(other_lines))
            text = "\n".join([*lines[:number], *other_lines[first : first + choose.choice([1, 2, 5, 15])], *lines[number:]])
        elif kind == 11 and (places := list(re.finditer(r"\d+(?:\.\d+)?", text))):
            place = choose.choice(places)
            text = text[: place.start()] + choose.choice(["0", "-1", "1e30", "1e400", "99999999", "0.0000001",
                "1e-300"]) + text[place.end():]
        elif kind == 12 and (places := list(re.finditer(r"[\w./-]+\.(?:yaml|toml|step)", text))):
            place = choose.choice(places)
            text = text[: place.start()] + choose.choice(PATHS) + text[place.end():]
    return text


def mutated_code(text: str, choose: random.Random) -> str:
    """Return the text of a part file with one to three changes: bytes, words, texts or nesting."""
    for _ in range(choose.choice([1, 1, 2, 3])):
        at = choose.randrange(len(text) + 1)
        new = choose.choice(['"\\ud800"', "'\\0'", "\0", "\x1b[31m", "\u202e", '"\udce9"', "(" * 300, "def f(:", "\f", "\\", "'''", "0x",
            "é = 1\n", "-" * 5000, "class Pen(Thing): pass\n", "import os\n", "from . import *\n", "x = " + "[" * 150 + "]" * 150 + "\n"])
        text = text[:at] + new + text[at + choose.choice([0, 0, 1, 40]):]
    return text


def mutated_lock(text: str, choose: random.Random) -> str:
    """Return the lock with one to four changes."""
    for _ in range(choose.choice([1, 1, 2, 4])):
        kind = choose.randrange(4)
        places = list(re.finditer(r"-?\d+(?:\.\d+)?(?:e-?\d+)?|\"[^\"\n]*\"|true|false|null|\[[^\[\]\n]*\]", text))
        if kind <= 1 and places:
            place = choose.choice(places)
            other = choose.choice(["0", "-1", "1e308", "1e400", "NaN", "9" * 400, '""', '"x"', "null", "[]", "{}", "true", "[1, 2]",
                '"../x"',
                                   choose.choice(places).group()])
            text = text[: place.start()] + other + text[place.end():]
        elif kind == 2 and text:
            at = choose.randrange(len(text))
            text = text[:at] + text[at + choose.choice([1, 2, 50, 500]):]
        elif text:
            at = choose.randrange(len(text))
            text = text[:at] + choose.choice(["{", "}", "[", "]", ",", ":", '"', "\\ud800", "\0", "1"]) + text[at:]
    return text
