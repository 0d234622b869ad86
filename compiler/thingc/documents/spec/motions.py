"""The `motions:` block of an `assembly/1` document."""

from __future__ import annotations

from pydantic import Field

from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import TimeField
from thingc.documents.spec.name_types import PoseField


class MotionPoseSpec(Model):
    """A pose of a motion. All joints have zero speed in the pose."""

    pose: PoseField
    """A pose of this document."""
    time: TimeField = Field(examples=["1.5 s"])
    """The time at which the robot is in the pose."""


class MotionFileSpec(Model):
    """A motion whose joint positions are in a file."""

    file: str = Field(examples=["wave.csv"])
    """A CSV file with a column `time` and a column for each joint, such as `elbow [deg]`, relative to this document."""
