"""Types for strings that refer to elements of a robot by path, and rules for the names of these elements in exported files.

A document can change the exported names of elements with `names:`. The annotation of each type shows which kind of element a path refers
to, so that `targets/custom_names.py` can replace the path. Type checkers treat these types as `str`.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

LinkPath: TypeAlias = Annotated[str, "components"]
"""Path of the component that gives a link its name (`hand/cap`)."""
SitePath: TypeAlias = Annotated[str, "mounts"]
"""Path of an exported mount (`hand/tip`), or of a component (its frame)."""
JointPath: TypeAlias = Annotated[str, "joints"]
"""Path of a joint or one of its coordinates (`hand/wrist_0`)."""
TendonPath: TypeAlias = Annotated[str, "tendons"]
"""Path of a tendon (`hand/grip`)."""
PoseName: TypeAlias = Annotated[str, "poses"]
"""Name of a pose."""
SensorPath: TypeAlias = Annotated[str, "sensors"]
"""Path of a sensor (`leg/imu`)."""
RawPath: TypeAlias = Annotated[tuple[str, ...], "raw"]
"""Keys of an attribute for a target (`("joint", "yaw", "margin")`). The second key may be one of the paths above."""
RawAttributes: TypeAlias = Annotated[dict[str, str], "raw"]
"""Attributes of a MuJoCo element. Some attributes refer to other elements."""

LONGEST = 200
"""Maximum number of characters of a name."""

TAKEN: dict[str, tuple[str, ...]] = {"components": ("world",), "mounts": ("world",), "joints": ("root",)}
"""Names that files always contain, by kind: the world, and the joint of a free base. Other elements cannot have these names."""


def is_file_name(text: str) -> bool:
    """Return whether `text` can be the name of an element in an exported file.

    A valid name has 1 to `LONGEST` printable characters and does not begin or end with a space.
    """
    return 0 < len(text) <= LONGEST and text == text.strip() and text.isprintable()
