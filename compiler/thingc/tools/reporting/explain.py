"""Explain diagnostic codes for the command `thingc explain`: the meaning, the fix, and a wrong and a right example.

The texts are in `examples.json` in this folder, which `docs/generate.py` generates from the codes and from `docs/codes`. Therefore, `thingc
explain` does not have to import the modules that define codes.
"""

from __future__ import annotations

import difflib
import json
import os
import re
from functools import cache
from typing import Any

from thingc.base.grouping import group_by

Explanation = dict[str, Any]
"""The keys are `code`, `name`, `title`, `meaning`, `cure`, `wrong` and `right`.

The examples `wrong` and `right` have the form `{"files": {name: text}, "command", "said"}`, and the first file is the document. The
examples are None if no document can cause the diagnostic.
"""


@cache
def _data() -> dict[str, Any]:
    with open(os.path.join(os.path.dirname(__file__), "examples.json"), encoding="utf-8") as stream:
        data: dict[str, Any] = json.load(stream)
    return data


def explanations() -> list[Explanation]:
    """Return the explanations of all diagnostic codes, sorted by code."""
    codes: list[Explanation] = _data()["codes"]
    return codes


def find(word: str) -> Explanation | None:
    """Return the explanation of a diagnostic code, given as `TC302`, `tc302`, `302` or `unknown_component`.

    Return None for an unknown code.
    """
    code_or_words = word.strip().upper()
    code_or_words = code_or_words.removeprefix("TC") if re.fullmatch(r"TC\d+", code_or_words) else code_or_words
    return next((code for code in explanations() if code_or_words in (code["code"].removeprefix("TC"), code["name"])), None)


def similar_codes(word: str, count: int = 3) -> list[Explanation]:
    """Return the explanations of diagnostic codes that are similar to an unknown code or other word.

    Similar codes have the nearest numbers, a title that contains the word, or a similar name.
    """
    number = re.fullmatch(r"(?:TC)?(\d+)", word.strip().upper())
    if number is not None and len(number.group(1)) == 3:
        number_in_code = int(number.group(1))
        return sorted(explanations(), key=lambda code: abs(int(code["code"][2:]) - number_in_code))[:count]
    text = word.strip().lower().replace("_", " ")
    if number is not None:
        numbers = {code["code"][2:]: code for code in explanations()}
        return [numbers[match] for match in difflib.get_close_matches(number.group(1), numbers, n=count)]
    spoken = [code for code in explanations() if text in f"{code['title']} {code['name'].replace('_', ' ')}".lower()]
    if spoken:
        return spoken[:count]
    words = {known: code for code in explanations() for known in (*code["name"].lower().split("_"), code["name"].lower())}
    matches = difflib.get_close_matches(text, words, n=count, cutoff=0.75)
    return list({words[match]["code"]: words[match] for match in matches}.values())


def as_page(explanation: Explanation) -> str:
    """Format the explanation of a diagnostic code as text for the terminal."""
    lines = [f"{explanation['code']}: {explanation['title']}", ""]
    if explanation["meaning"]:
        lines += [explanation["meaning"], ""]
    lines += [f"Fix: {explanation['cure']}", ""]
    for side in ("wrong", "right"):
        example = explanation[side]
        if example is None:
            continue
        lines += [f"{side.capitalize()}:", ""]
        for name, text in example["files"].items():
            lines += [f"  {name}", *(f"  | {line}".rstrip() for line in text.rstrip("\n").split("\n")), ""]
        lines += [f"  $ {example['command']}", *(f"  {line}".rstrip() for line in example["said"].split("\n")), ""]
    return "\n".join(lines)


def sections() -> list[tuple[str, list[Explanation]]]:
    """Return the explanations of all diagnostic codes, grouped by section.

    A section has a title such as `TC3xx: names and values across documents`.
    """
    by_hundred = group_by(explanations(), lambda code: str(code["code"][:3]))
    return [(f"{hundred}xx: {_data()['sections'][hundred]}", codes) for hundred, codes in by_hundred.items()]
