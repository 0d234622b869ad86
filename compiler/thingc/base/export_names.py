"""Names in exported files: which fields of records hold paths that files may rename, and which texts are valid names.

The type of such a field states what the path belongs to; `targets/custom_names.py` finds the field by it. Type checkers see `str`.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

LinkPath: TypeAlias = Annotated[str, "components"]
"""The component that a link is called after (`hand/cap`)."""
SitePath: TypeAlias = Annotated[str, "mounts"]
"""A mount that is shown (`hand/tip`), or a component, whose frame is meant."""
JointPath: TypeAlias = Annotated[str, "joints"]
"""A joint, or one of its coordinates (`hand/wrist_0`)."""
TendonPath: TypeAlias = Annotated[str, "tendons"]
"""A tendon (`hand/grip`)."""
PoseName: TypeAlias = Annotated[str, "poses"]
"""A pose of the robot."""
SensorPath: TypeAlias = Annotated[str, "sensors"]
"""A sensor (`leg/imu`)."""
RawPath: TypeAlias = Annotated[tuple[str, ...], "raw"]
"""Keys down to an attribute of a target (`("joint", "yaw", "margin")`), the second of which may be one of the paths above."""
RawAttributes: TypeAlias = Annotated[dict[str, str], "raw"]
"""Those of an element of MuJoCo's, some of which name others."""

LONGEST = 200
"""Characters of a name."""

TAKEN: dict[str, tuple[str, ...]] = {"components": ("world",), "mounts": ("world",), "joints": ("root",)}
"""By kind, names that files have in any case: of the world, and of the joint of a free base."""


def is_file_name(text: str) -> bool:
    """Whether it is one line without spaces around it, of bounded length."""
    return 0 < len(text) <= LONGEST and text == text.strip() and text.isprintable()
