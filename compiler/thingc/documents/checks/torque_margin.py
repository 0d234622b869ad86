"""The document test `torque_margin`: the drives must hold the robot still against gravity, with a margin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.diagnostics import Code, make_notes
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.units import NUMBER
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model, optional
from thingc.documents.spec.fields import NumberField
from thingc.documents.spec.name_types import JointNames, ModeNames, PoseNames

if TYPE_CHECKING:
    from thingc.model.assembly.report import LinkReport
    from thingc.model.assembly.types import JointEdge, LinkedTendon
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Mode, Test


class TorqueMarginTest(Model):
    """Drives must hold the robot still against gravity with a margin, which is the effort limit of a drive divided by its static torque."""

    drive: JointNames = Field(examples=["shoulder", ["shoulder", "leg_*"]])
    """Names or patterns of driven joints."""
    mode: ModeNames | None = optional("bench", ["bench", "wall"])
    """Names or patterns of modes in which the robot has a support, or `all`; default: the first mode."""
    pose: PoseNames | None = optional("home", "leg_*", ["home", "reach"])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    min: NumberField
    """The smallest allowed margin. For example, 1.5 requires an effort limit of 1.5 times the static torque."""


class TorqueCheck(OneLineStruct):
    """A parsed `torque_margin` test.

    The test requires the effort limit of each drive of `joints` (paths) to be at least `minimum` times its static effort.
    """

    joints: tuple[str, ...]
    minimum: float


def read_torque_margin(spec: TorqueMarginTest, reader: Reader) -> TorqueCheck:
    """Parse the keys of a `torque_margin` test. Modes in which the document does not specify what supports the robot are reported."""
    minimum = reader.number(spec.min, "min", NUMBER, above=0.0)
    joints = reader.drives(spec.drive, "drive")
    floating = [name for name in reader.chosen_modes if not _is_supported(reader.modes[name])]
    if floating:
        supported = [name for name, mode in reader.modes.items() if _is_supported(mode) and not unused_drives(joints, mode)]
        hint = f", or use another mode: {', '.join(f'`{name}`' for name in supported)}" if supported else ""
        reader.error(
            Code.TEST, f"nothing supports the free base of mode `{floating[0]}`", "mode" if spec.mode is not None else (),
            on_key=spec.mode is None, help=f"set `standing_on: [...]` in the mode{hint}",
        )
    for name in reader.chosen_modes:
        absent = unused_drives(joints, reader.modes[name])
        if absent:
            reader.error(
                Code.TEST, f"mode `{name}` does not use the drive of joint `{absent[0]}`", "drive",
                help="list only drives that are in the `actuators` of the mode",
            )
    return TorqueCheck(joints=joints, minimum=minimum)


def _is_supported(mode: Mode) -> bool:
    """Return True if the base of a mode does not float, or if feet or holds support it."""
    return mode.base != "free" or mode.standing is not None or bool(mode.holds)


def unused_drives(joints: Sequence[str], mode: Mode) -> list[str]:
    """Return the joints (paths in `joints`) whose drives a mode does not use."""
    used = mode.actuators
    return [joint for joint in joints if used is not None and joint not in used]


def link(test: Test, check: TorqueCheck, drives: Mapping[str, JointEdge | LinkedTendon], findings: LinkReport) -> None:
    """Report drives without an effort limit in a `torque_margin` test, because their torque margin cannot be computed."""

    for path in check.joints:
        joint = drives.get(path)
        if joint is not None and joint.limit.effort is None:
            findings.error(
                Code.TEST, f"drive `{path}` has no effort limit",
                (test.spans["drive"],) if "drive" in test.spans else test.origin, path=path,
                help="set `limit: {effort: ...}` of the joint, or `effort` of its drive",
                notes=make_notes(f"`{path}` is defined here", joint.origin),
            )


KIND = CheckKind(
    name="torque_margin", position=6, summary="Drives hold the robot still against gravity, with a margin.",
    examples=[{"drive": "shoulder", "min": 1.5, "pose": "stretched"}], stub={"drive": "*", "min": "2"}, smooth={"margin": NUMBER},
    model=TorqueMarginTest, read=read_torque_margin, link=link,
)
