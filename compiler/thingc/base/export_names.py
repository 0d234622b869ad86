"""Types for strings that refer to elements of a robot by path, and rules for the names of these elements in exported files.

A document can change the exported names of elements with `names:`. The annotation of each type shows which kind of element a path refers
to, so that `targets/custom_names.py` can replace the path. For type checkers, these types are equal to `str`.
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
"""Keys of a raw attribute for one target, such as `("joint", "yaw", "margin")`. The second key is often the path of an element."""
RawAttributes: TypeAlias = Annotated[dict[str, str], "raw"]
"""Attributes of a MuJoCo element by name. The value of an attribute can be the path of another element."""

LONGEST = 200
"""Maximum number of characters of a name."""

TAKEN: dict[str, tuple[str, ...]] = {"components": ("world",), "mounts": ("world",), "joints": ("root",)}
"""Reserved names by kind of element: the world, and the joint of a free base. Elements of a document cannot have these names, because
exported files always contain them.
"""


def is_file_name(text: str) -> bool:
    """Return whether `text` can be the name of an element in an exported file.

    A valid name has 1 to `LONGEST` printable characters and does not begin or end with a space.
    """
    return 0 < len(text) <= LONGEST and text == text.strip() and text.isprintable()
