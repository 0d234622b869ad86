"""Names of the source made names of the language, each its own: the same source gives the same names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from thingc.documents.load.yaml_scalars import core_value
from thingc.documents.spec.name_types import RESERVED

LONGEST = 100
"""Characters of a name: of more, the first ones."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def plain_name(name: str, kind: str) -> str:
    """The name in letters, digits and `_`; `kind` is put before one that begins otherwise, and behind one that means something else."""
    word = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_")[:LONGEST] or kind
    if not _NAME.fullmatch(word):
        word = f"{kind}_{word}"
    return f"{word}_{kind}" if word.lower() in RESERVED or not isinstance(core_value(word), str) else word


def distinct(names: Iterable[str], kind: str, taken: Iterable[str] = (), earlier: Mapping[str, str] | None = None) -> dict[str, str]:
    """What each of the names is called in a document; no two alike but for case, and none as what is `taken`. What was called something
    `earlier` is called so again; a name that can stay does, whatever the others are called."""
    used, wanted = {one.lower() for one in taken}, list(dict.fromkeys(names))
    words: dict[str, str] = {}
    for name in wanted:
        word = (earlier or {}).get(name)
        if word is not None and word.lower() not in used and plain_name(word, kind) == word:
            words[name] = word
            used.add(word.lower())
    for name in sorted(wanted, key=lambda name: plain_name(name, kind) != name):
        if name in words:
            continue
        plain = plain_name(name, kind)
        number, word = 1, plain
        while word.lower() in used:
            number += 1
            word = f"{plain}_{number}"
        used.add(word.lower())
        words[name] = word
    return {name: words[name] for name in wanted}
