"""MJCF: MuJoCo's own reading of a file, through `MjSpec`, as a robot; MuJoCo is imported when there is one to read, and opens no file."""

from __future__ import annotations

from thingc.tools.importing.mjcf.reader import read_mjcf

__all__ = ["read_mjcf"]
