"""Poses as MJCF writes them."""

from __future__ import annotations

from functools import lru_cache

from thingc.base.pose import IDENTITY, Pose
from thingc.targets.xml_writer import XmlValue


def pose_attributes(pose: Pose) -> dict[str, XmlValue]:
    """`pos` [m] and `quat` (w, x, y, z) of a pose, each only where it says something."""
    return dict(_pose_texts(pose))


@lru_cache(maxsize=4096)
def _pose_texts(pose: Pose) -> tuple[tuple[str, XmlValue], ...]:
    attributes: list[tuple[str, XmlValue]] = []
    if any(component != 0.0 for component in pose.translation):
        attributes.append(("pos", pose.translation))
    if pose.rotation != IDENTITY:
        attributes.append(("quat", pose.quaternion()))
    return tuple(attributes)
