"""Slips of the keyboard: the one name that can have been meant."""

from __future__ import annotations

from collections.abc import Iterable


def meant(name: str, candidates: Iterable[str]) -> str | None:
    """The only candidate that `name` can be a slip of: a letter too many, missing, swapped with the next, in other case, or
    (in words of five letters or more) another. None where there is none or are several.

    Digits are never slips: `foot_1` is not a misspelt `foot_0`.
    """
    near = {candidate for candidate in candidates if candidate == name or _is_slip(name, candidate)}
    return near.pop() if len(near) == 1 and name not in near else None


def _is_slip(name: str, candidate: str) -> bool:
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
