"""What ran of a part's code when it was modelled: as long as that stays as it is, so does the part, whatever else is edited.

A part is modelled by code that is given nothing but its parameters and files. Loading the modules runs everything but the bodies of their
functions (the outline), and of these some run. Where the outline is the same and each body that ran is, the code goes the same way again,
step by step, and never gets to where it would be another. Code that may look at functions without calling them is taken as a whole.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from thingc.geometry.key.module_key import CodeIngredients

Ran = Mapping[str, Sequence[int] | None]
"""By module's label, the numbers of the functions that ran; None for all."""


def outlined(code: CodeIngredients) -> CodeIngredients:
    """The code without the bodies of its functions."""
    return replace(code, ingredients={one.label: f"{one.facts.outline} {one.path}" for one in code.sources.values()})


def executed_functions(code: CodeIngredients, ran: Mapping[str, Sequence[int] | None]) -> dict[str, Any] | None:
    """What is kept of the functions that ran, by file: their numbers by module, and their digest; None where they do not tell."""
    labelled = {code.sources[file].label: numbers for file, numbers in ran.items() if file in code.sources}
    digest = _digest(code, labelled)
    return None if digest is None or len(labelled) < len(ran) else {"ran": labelled, "digest": digest}


def is_unchanged(code: CodeIngredients, kept: Mapping[str, Any]) -> bool:
    """Whether everything that ran then is the same in this code."""
    digest: str = kept["digest"]
    return _digest(code, kept["ran"]) == digest


def _digest(code: CodeIngredients, ran: Ran) -> str | None:
    facts = {one.label: one.facts for one in code.sources.values()}
    digest = hashlib.sha256()
    for label, numbers in sorted(ran.items()):
        if label not in facts or numbers and numbers[-1] >= len(facts[label].bodies):
            return None
        texts = [facts[label].syntax] if numbers is None else [facts[label].bodies[number] for number in numbers]
        digest.update(f"{label} {numbers} {texts}\n".encode())
    return digest.hexdigest()
