"""The document test `drive_margin`: the drives must be able to follow a motion, with a margin."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.diagnostics import Code
from thingc.base.units import NUMBER
from thingc.documents.checks.kind import CheckKind
from thingc.documents.checks.torque_margin import TorqueCheck, link, unused_drives
from thingc.documents.spec.base import Model, optional
from thingc.documents.spec.fields import NumberField
from thingc.documents.spec.name_types import JointNames, ModeNames, MotionField

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader


class DriveMarginTest(Model):
    """Drives must follow a motion with a margin, which is the effort that a drive can exert at its speed divided by the effort it needs."""

    motion: MotionField = Field(examples=["wave"])
    """A motion of this document."""
    drive: JointNames = Field(default="*", examples=["shoulder", ["shoulder", "leg_*"]])
    """Names or patterns of driven joints; default: all."""
    mode: ModeNames | None = optional("bench", ["bench", "wall"])
    """Names or patterns of modes whose base is not `free`, or `all`; default: all these modes that use one of the drives."""
    min: NumberField
    """The smallest allowed margin. For example, 1.5 requires 1.5 times the effort that the motion needs."""


class DriveCheck(TorqueCheck):
    """A parsed `drive_margin` test, which requires a margin of at least `minimum` of each drive of `joints` during a motion."""

    motion: str


def read_drive_margin(spec: DriveMarginTest, reader: Reader) -> DriveCheck:
    """Parse the keys of a `drive_margin` test. Modes with a free base, whose motion is unknown, are reported."""
    minimum = reader.number(spec.min, "min", NUMBER, above=0.0)
    joints = reader.drives(spec.drive, "drive")
    reader.motion(spec.motion, "motion")
    unusable = {
        name: "has a free base, which is not supported" if mode.base == "free" else f"does not use the drive of joint `{joints[0]}`"
        for name, mode in reader.modes.items() if mode.base == "free" or (joints and len(unused_drives(joints, mode)) == len(joints))
    }
    if spec.mode is None:
        reader.chosen_modes = tuple(name for name in reader.modes if name not in unusable) or reader.chosen_modes
    wrong = [name for name in reader.chosen_modes if name in unusable]
    if wrong:
        usable_modes = ", ".join(f"`{name}`" for name in reader.modes if name not in unusable)
        reader.error(
            Code.TEST, f"mode `{wrong[0]}` {unusable[wrong[0]]}", "mode" if spec.mode is not None else (), on_key=spec.mode is None,
            help=f"use mode {usable_modes}" if usable_modes else "add a mode with `base: fixed` that uses the drives",
        )
    return DriveCheck(joints=joints, minimum=minimum, motion=spec.motion)


KIND = CheckKind(
    name="drive_margin", position=9, summary="Drives can follow a motion, with a margin.", examples=[{"motion": "wave", "min": 1.5}],
    stub={"motion": "$motion", "min": "1.5"}, model=DriveMarginTest, read=read_drive_margin, link=link,
)
