"""The `modes:` and `simulation:` of an `assembly/1` document."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from thingc.base.joints.kinds import BaseType
from thingc.documents.spec.allowances import Allow, allow
from thingc.documents.spec.base import Model, rule
from thingc.documents.spec.fields import ForceField, NumberField, TimeField, Vector3Acceleration
from thingc.documents.spec.name_types import ComponentField, JointPattern, ModeField, OwnPoseKey, PoseField, RootField, ShownMountField
from thingc.documents.spec.poses import PoseSpec

StandsOn = Literal["floor", "wall", "ceiling"]
"""What a robot stands on, clings to or hangs from, in words."""


class SimulationSpec(Model):
    """How simulators step."""

    timestep: TimeField | None = None
    """Time between two states."""
    integrator: Literal["euler", "rk4", "implicit", "implicitfast"] | None = None
    """MuJoCo's way from one state to the next."""
    cone: Literal["pyramidal", "elliptic"] | None = None
    """The shape of the friction cone of contacts."""
    impratio: NumberField | None = None
    """Ratio of friction to normal impedance; above 1 contacts slip less."""


class WorldAtSpec(PoseSpec):
    """The world side of a mode's root: its pose in the world."""

    on: Literal["floor"] | None = None
    """`floor`: as high as it has to be for the robot's lowest point, in the mode's start pose, to touch the plane z = 0."""


class ContactsSpec(Model):
    """Who may touch whom in this mode."""

    exclude: list[Annotated[list[ComponentField], Field(min_length=2, max_length=2)]] = Field(
        default=[], examples=[[["plate", "hand"], ["leg_*", "body"]]],
    )
    """Pairs of components (globs allowed) that never touch."""
    adhesion: dict[ShownMountField, ForceField] = Field(default={}, examples=[{"front_foot.sole": "300 N"}])
    """Pull-off force per mount."""


class HoldSpec(PoseSpec):
    """Where a further mount is held, the world side as `at` of a root, and what the hold can carry."""

    at: Literal["here"] | None = None
    """`here`: where the mode's own pose puts it; else `xyz` and `rpy` say where."""
    carries: Literal["force", "force and torque"] = "force and torque"
    """`force`: a point that stays, about which the link may turn; `force and torque`: a clamp."""

    @model_validator(mode="after")
    def _one_place(self) -> HoldSpec:
        placed = [key for key in ("xyz", "rpy", "quat") if key in self.model_fields_set]
        if self.at is not None and placed:
            raise rule(f"a hold is `here` or at a place of its own; here are `at` and `{placed[0]}`", "keep one of them", placed[0])
        if self.at is None and not placed:
            raise rule("a hold says where: `at: here`, or `xyz` and `rpy`", "write for example `at: here`")
        if self.carries == "force" and placed[-1:] in (["rpy"], ["quat"]):
            key = placed[-1]
            raise rule(f"a hold that carries force alone holds a point: `{key}` turns nothing", f"take `{key}` out", key)
        return self


class StandingSpec(Model):
    """What a floating mode stands on."""

    mounts: Annotated[list[ShownMountField], Field(min_length=1)] = Field(examples=[["leg_0.sole", "leg_2.sole", "leg_4.sole"]])
    """The mounts at which the floor pushes the robot, patterns allowed."""
    friction: NumberField | None = None
    """Sliding friction between them and the floor; that of their materials unless written."""


class ModeSpec(Model):
    """One simulation model."""

    root: RootField | None = None
    """A mount (mated to the world) or a component (laid on the world frame)."""
    base: BaseType | None = None
    """`fixed` (default), `held`, `free`, `planar` (in the x-y plane of `at`) or `ball` (about the root's origin)."""
    at: WorldAtSpec | None = Field(default=None, examples=[{"xyz": "0 0 300 mm", "rpy": "0 0 90 deg"}, {"on": "floor"}])
    """Where in the world the root is; its origin unless written."""
    at_in: dict[OwnPoseKey, PoseSpec] | None = Field(default=None, examples=[{"sit": {"xyz": "0 0 100 mm"}}])
    """Where in the world the root of a `free` or `held` base is in some of its poses; at `at` in the others."""
    gravity: StandsOn | Vector3Acceleration | None = Field(default=None, examples=["wall", "0 0 -1.62 m/s^2"])
    """What the robot stands on or hangs from, or a vector in the world frame; `floor` unless written."""
    pose: PoseField | None = None
    """Where it starts."""
    poses: list[PoseField] | None = Field(default=None, examples=[["home", "folded"]])
    """Its keyframes; all unless written."""
    actuators: list[JointPattern] | None = Field(default=None, examples=[["yaw", "leg_*"]])
    """The joints driven here, globs allowed; all unless written."""
    contacts: ContactsSpec | None = Field(default=None, examples=[{"exclude": [["plate", "hand"]]}])
    hold: dict[RootField, HoldSpec | Literal["here"]] | None = Field(
        default=None, examples=[
            {"rear_foot.sole": "here"}, {"rear_foot.sole": {"at": "here", "carries": "force"}}, {"rear_foot.sole": {"xyz": "200 0 0 mm"}},
        ],
    )
    """Further mounts held to the world, each at a pose or `here`: where the mode's own pose puts it."""
    standing_on: StandingSpec | list[ShownMountField] | None = Field(
        default=None, examples=[["leg_0.sole", "leg_2.sole", "leg_4.sole"], {"mounts": ["leg_*.sole"], "friction": 0.6}],
    )
    """The mounts that a free base stands on: the floor pushes there, and does not hold. What statics asks about."""
    cut: list[JointPattern] | None = Field(default=None, examples=[["rear_knee"]])
    """The joints at which loops are cut, globs allowed."""
    simulation: SimulationSpec | None = Field(default=None, examples=[{"timestep": "1 ms"}])
    """Simulation settings of this mode, which override those of the document."""
    extends: ModeField | None = None
    """Another mode that this one is merged over."""
    allow: Allow = allow()
    """Warnings of this mode, and of those that extend it, that are meant so, by code, each with the reason."""
