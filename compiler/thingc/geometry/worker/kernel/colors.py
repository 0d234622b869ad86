"""Colours of build123d as `#rrggbb`."""

from __future__ import annotations

from typing import Any


def hexadecimal(color: Any) -> str:
    """A build123d `Color` as `#rrggbb` (sRGB; what it is transparent is left out)."""
    red, green, blue, *_ = tuple(color)
    return "#" + "".join(f"{min(255, max(0, round(255 * channel))):02x}" for channel in (red, green, blue))


def named(text: str) -> str:
    """A CSS name or `#rrggbb` as `#rrggbb`. Raises `ValueError` for what is no colour."""
    from build123d import Color

    return hexadecimal(Color(text))
