"""Columns of a table for Arrow. `pyarrow.array` imports pandas where that is installed, to ask whether its values are of pandas, and that
takes as long as a dozen variants; here they are laid out as Arrow's memory has them."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

LARGEST = 2**31 - 1
"""How many bytes the texts of one Arrow array may have together."""


def column(values: Sequence[Any], type: Any) -> Any:
    """`pyarrow.array(values, type)` for `int64`, `float64`, `bool_`, `string` and `binary`; None where there is no value. Raises what
    `array` raises for a value that is none of its type."""
    import pyarrow

    data: list[Any]
    if type in (pyarrow.int64(), pyarrow.float64()):
        data = [array("q" if type == pyarrow.int64() else "d", [0 if value is None else value for value in values])]
    elif type == pyarrow.bool_():
        data = [_bits(values)]
    else:
        told = [b"" if value is None else value.encode() if isinstance(value, str) else value for value in values]
        ends = list(accumulate(map(len, told), initial=0))
        if ends[-1] > LARGEST:
            return pyarrow.array(values, type)
        data = [array("i", ends), b"".join(told)]
    there = _bits([value is not None for value in values])
    return pyarrow.Array.from_buffers(type, len(values), [pyarrow.py_buffer(one) for one in (there, *data)])


def _bits(flags: Sequence[Any]) -> bytes:
    """One bit each, the first the lowest of the first byte."""
    return int("0" + "".join("1" if flag else "0" for flag in reversed(flags)), 2).to_bytes(len(flags) // 8 + 1, "little")
