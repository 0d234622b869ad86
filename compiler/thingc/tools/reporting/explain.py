"""Explanations of codes for `thingc explain`: meaning, fix, and a wrong and a right example.

The texts are in `examples.json` in this folder, which `docs/generate.py` generates from `docs/codes`.
"""

from __future__ import annotations

import difflib
import json
import os
import re
from typing import Any

from thingc.base.diagnostics import DiagnosticCode
from thingc.documents.checks import all_codes

_FILE = os.path.join(os.path.dirname(__file__), "examples.json")


def _data() -> dict[str, Any]:
    with open(_FILE, encoding="utf-8") as stream:
        explanations: dict[str, Any] = json.load(stream)
    return explanations


def find(word: str) -> DiagnosticCode | None:
    """Return the code for a string such as `TC302`, `tc302`, `302` or `unknown_component`, or None if the code does not exist."""
    asked = word.strip().upper()
    asked = asked.removeprefix("TC") if re.fullmatch(r"TC\d+", asked) else asked
    return next((code for code in all_codes() if asked in (code.code.removeprefix("TC"), code.name)), None)


def near(word: str, count: int = 3) -> list[DiagnosticCode]:
    """Return codes similar to a word: the nearest numbers, or codes whose title contains the word, or codes with a similar name."""
    number = re.fullmatch(r"(?:TC)?(\d+)", word.strip().upper())
    if number is not None and len(number.group(1)) == 3:
        wanted = int(number.group(1))
        return sorted(all_codes(), key=lambda code: abs(int(code.code[2:]) - wanted))[:count]
    asked = word.strip().lower().replace("_", " ")
    if number is not None:
        numbers = {code.code[2:]: code for code in all_codes()}
        return [numbers[match] for match in difflib.get_close_matches(number.group(1), numbers, n=count)]
    spoken = [code for code in all_codes() if asked in f"{code.title} {code.name.replace('_', ' ')}".lower()]
    if spoken:
        return spoken[:count]
    words = {known: code for code in all_codes() for known in (*code.name.lower().split("_"), code.name.lower())}
    return list(dict.fromkeys(words[match] for match in difflib.get_close_matches(asked, words, n=count, cutoff=0.75)))


def explained(code: DiagnosticCode) -> dict[str, Any]:
    """Return `code`, `title`, `meaning`, `cure`, `wrong` and `right` of a code.

    An example is `{"files": {name: text}, "command", "said"}`. The document is the first file. If no document can cause the code on a
    working machine, the examples are None.
    """
    entry = _data()["codes"].get(code.code, {})
    return {
        "code": code.code, "title": code.title, "meaning": entry.get("meaning"), "cure": code.cure,
        "wrong": entry.get("wrong"), "right": entry.get("right"),
    }


def as_page(code: DiagnosticCode) -> str:
    """Format the explanation of a code as text."""
    explanation = explained(code)
    lines = [f"{code.code}: {code.title}", ""]
    if explanation["meaning"]:
        lines += [explanation["meaning"], ""]
    lines += [f"Fix: {code.cure}", ""]
    for side in ("wrong", "right"):
        example = explanation[side]
        if example is None:
            continue
        lines += [f"{side.capitalize()}:", ""]
        for name, text in example["files"].items():
            lines += [f"  {name}", *(f"  | {line}".rstrip() for line in text.rstrip("\n").split("\n")), ""]
        lines += [f"  $ {example['command']}", *(f"  {line}".rstrip() for line in example["said"].split("\n")), ""]
    return "\n".join(lines)


def sections() -> list[tuple[str, list[DiagnosticCode]]]:
    """Return all codes by section, such as `TC3xx: names and values across documents`."""
    titles = _data()["sections"]
    hundreds = sorted({code.code[:3] for code in all_codes()})
    by_number = sorted(all_codes(), key=lambda code: code.code)
    return [
        (f"{hundred}xx: {titles[hundred]}" if hundred in titles else f"{hundred}xx", [c for c in by_number if c.code[:3] == hundred])
        for hundred in hundreds
    ]
