"""Find the name that a user probably meant by a misspelled name, and format help texts such as `did you mean ...?`."""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import islice

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import quote_names


def closest_name(name: str, candidates: Iterable[str]) -> str | None:
    """Return the candidate that the user probably meant by the misspelled `name`, if there is exactly one.

    Return None if no candidate or several candidates are possible. A misspelling has an extra, missing or swapped letter, a different case,
    or, in names with at least five letters, a wrong letter. A different digit is not a misspelling: `foot_1` is not a misspelled `foot_0`.
    """
    matches = {candidate for candidate in candidates if candidate == name or _is_misspelling(name, candidate)}
    return matches.pop() if len(matches) == 1 and name not in matches else None


def _is_misspelling(name: str, candidate: str) -> bool:
    if min(len(name), len(candidate)) < 2 or [c for c in name if c.isdigit()] != [c for c in candidate if c.isdigit()]:
        return False
    if name.lower() == candidate.lower():
        return True
    at = next((at for at, (a, b) in enumerate(zip(name, candidate)) if a != b), min(len(name), len(candidate)))
    short, long = sorted((name[at:], candidate[at:]), key=len)
    if len(long) == len(short) + 1:
        return long[1:] == short
    if len(long) != len(short):
        return False
    return short[2:] == long[2:] and short[:2] == long[1::-1] or (len(name) >= 5 and short[1:] == long[1:])


class Suggestion(FrozenStruct, kw_only=False):
    """A help text for a diagnostic. If the correct text is unambiguous, `fix` contains the written text and its replacement."""

    text: str
    fix: tuple[str, str] | None = None

    def __str__(self) -> str:
        return self.text


Hint = str | Suggestion
"""A message or a help text: a string, or a `Suggestion` that can contain a fix."""


def text_of(hint: Hint | None) -> str | None:
    """Return a hint as plain text, or None if there is no hint."""
    return None if hint is None else str(hint)


MAX_NAME = 100
MAX_CANDIDATES = 1000
MAX_COMPARED = 20


def _common_ends(a: str, b: str) -> int:
    """Return the length of the common prefix of two names plus the length of their common suffix."""
    return len(os.path.commonprefix((a, b))) + len(os.path.commonprefix((a[::-1], b[::-1])))


def nearest(name: str, candidates: Iterable[str]) -> str | None:
    """Return the candidate that is most similar to `name`, or None if no candidate is similar.

    The time for a comparison is quadratic in the length of the names. Very long names, and candidates after the first `MAX_CANDIDATES`, are
    therefore not compared.
    """
    import difflib

    ordered = sorted(candidates) if isinstance(candidates, (set, frozenset)) else candidates
    names = sorted({candidate for candidate in islice(ordered, MAX_CANDIDATES) if len(candidate) <= MAX_NAME})
    if len(name) > MAX_NAME:
        return None
    lowered: dict[str, str] = {candidate.lower(): candidate for candidate in reversed(names)}
    if name.lower() in lowered:
        return lowered[name.lower()]
    if len(names) > MAX_COMPARED:
        names.sort(key=lambda candidate: -_common_ends(name, candidate))
        names = sorted(names[:MAX_COMPARED])
    matches = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    return matches[0] if matches else None


def near_hint(name: str, candidates: Iterable[str]) -> Suggestion | None:
    """Return the hint `did you mean ...?` with the candidate that is most similar to `name`. Return None if no candidate is similar."""
    names = list(candidates)
    closest = nearest(name, names)
    if closest is None:
        return None
    return Suggestion(f"did you mean `{closest}`?", (name, closest) if closest_name(name, names) == closest else None)


def did_you_mean(name: str, candidates: Iterable[str], *, what: str = "names") -> Hint:
    """Return a help text for an unknown name: the most similar known name, or else a list of at most twelve known names."""
    names = sorted(set(candidates))
    hint = near_hint(name, names)
    if hint is not None:
        return hint
    if not names:
        return f"no {what} are available"
    return f"known {what}: {quote_names(names, 12)}"


def file_meant(name: str, files: Iterable[str], *, what: str = "files") -> Hint:
    """Return a help text for an unknown file name, as `did_you_mean` does for other names. File name extensions are not compared."""
    by_stem = {os.path.splitext(file)[0]: file for file in sorted(files, reverse=True)}
    stem = nearest(os.path.splitext(name)[0], by_stem)
    if stem is not None:
        certain = closest_name(os.path.splitext(name)[0], by_stem) == stem and by_stem[stem].endswith(os.path.splitext(name)[1])
        return Suggestion(f"did you mean `{by_stem[stem]}`?", (name, by_stem[stem]) if certain else None)
    return did_you_mean("", by_stem.values(), what=what)
