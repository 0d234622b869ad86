"""Parse the scalars of YAML 1.2 (core schema, chapter 10.3.2 of the specification) to Python values."""

from __future__ import annotations

import re

from thingc.base.source import Scalar

_NULL = frozenset(("", "~", "null", "Null", "NULL"))
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INT = re.compile(r"[-+]?[0-9]+", re.ASCII)
_OCTAL = re.compile(r"0o[0-7]+", re.ASCII)
_HEX = re.compile(r"0x[0-9a-fA-F]+", re.ASCII)
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?", re.ASCII)
_SPECIAL = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)", re.ASCII)

MAX_DIGITS = 400
"""Maximum number of digits of an integer. Integers with more digits overflow a double."""


def core_value(text: str) -> Scalar:
    """Parse a plain (unquoted) scalar: `yes`, `no` and `on` are strings, `1e-3` is a float, and `0o17` is 15.

    Raises OverflowError for `.inf`, `.nan` and for numbers that overflow a double.
    """
    first = text[:1]
    if first in "0123456789+-.":
        if not first:
            return None
        if _INT.fullmatch(text):
            return _whole(text, 10)
        if _FLOAT.fullmatch(text):
            value = float(text)
            if value - value != 0.0:
                raise OverflowError(text)
            return value
        if _OCTAL.fullmatch(text):
            return _whole(text[2:], 8)
        if _HEX.fullmatch(text):
            return _whole(text[2:], 16)
        if _SPECIAL.fullmatch(text):
            raise OverflowError(text)
        return text
    if text in _NULL:
        return None
    return _BOOL.get(text, text)


def _whole(digits: str, base: int) -> int:
    if len(digits) > MAX_DIGITS:
        raise OverflowError(digits)
    value = int(digits, base)
    float(value)
    return value
