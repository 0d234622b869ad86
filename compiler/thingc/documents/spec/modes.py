"""The `modes:` and `simulation:` of an `assembly/1` document."""

from typing import Annotated, Literal

from pydantic import Field

from thingc.base.joints.kinds import BaseType
from thingc.documents.spec.allowances import Allow, allow
from thingc.documents.spec.base import Model, optional, rule
from thingc.documents.spec.fields import ForceField, LengthField, Name, NumberField, TimeField, Vector3Acceleration
from thingc.documents.spec.materials import FrictionSpec
from thingc.documents.spec.name_types import ComponentField, JointPattern, ModeField, OwnPoseKey, PoseField, RootField, ShownMountField
from thingc.documents.spec.poses import PoseSpec

StandsOn = Literal["floor", "wall", "ceiling"]
"""Surfaces that a robot can stand on, cling to or hang from."""


class SimulationSpec(Model):
    """The time step and the solver settings of simulators."""

    timestep: TimeField | None = None
    """The time step of the simulation."""
    integrator: Literal["euler", "rk4", "implicit", "implicitfast"] | None = None
    """The integrator of MuJoCo."""
    cone: Literal["pyramidal", "elliptic"] | None = None
    """The shape of the friction cone of contacts."""
    impratio: NumberField | None = None
    """Ratio of friction to normal impedance, as in MuJoCo. With a ratio above 1, contacts slip less."""


class WorldAtSpec(PoseSpec):
    """The pose of a mode's root in the world."""

    on: Literal["floor"] | None = None
    """With `floor`, the lowest point of the robot touches the plane z = 0 in the start pose of the mode."""


class PairSpec(Model):
    """A pair of components that always collide, with their own contact settings."""

    between: Annotated[list[ComponentField], Field(min_length=2, max_length=2)] = Field(examples=[["finger_*", "ball"]])
    """The two components; patterns are allowed."""
    friction: FrictionSpec | None = optional({"slide": 1.5})
    """The friction of the pair; default: from the materials of the two components."""
    margin: LengthField | None = optional("1 mm")
    """The distance between the shapes at which a contact begins; default: 0."""
    gap: LengthField | None = optional("0.5 mm")
    """The part of the margin in which a contact is detected but transmits no force; default: 0."""


class GroupSpec(Model):
    """A group of components, and the groups with which they collide."""

    components: Annotated[list[ComponentField], Field(min_length=1)] = Field(examples=[["finger_*", "palm"]])
    """The components of the group; patterns are allowed."""
    collide: list[Name] = Field(examples=[["others"], ["others", "fingers"]])
    """The groups with which the group collides. `others` are the components without a group, the floor, and other objects in the scene."""


class ContactsSpec(Model):
    """The contact settings of a mode."""

    exclude: list[Annotated[list[ComponentField], Field(min_length=2, max_length=2)]] = Field(
        default=[], examples=[[["plate", "hand"], ["leg_*", "body"]]],
    )
    """Pairs of components whose contacts are ignored; patterns are allowed."""
    pairs: list[PairSpec] = Field(default=[], examples=[[{"between": ["finger", "ball"], "friction": {"slide": 1.5}, "margin": "1 mm"}]])
    """Pairs of components that always collide, with their own friction and margin."""
    groups: dict[Name, GroupSpec] = Field(default={}, examples=[{"fingers": {"components": ["finger_*"], "collide": ["others"]}}])
    """Groups of components that collide only with the listed groups."""
    adhesion: dict[ShownMountField, ForceField] = Field(default={}, examples=[{"front_foot.sole": "300 N"}])
    """Largest adhesion force of a mount on a surface, by mount."""


class HoldSpec(PoseSpec):
    """The pose in the world at which an additional mount is held, and the loads that the hold supports."""

    at: Literal["here"] | None = None
    """With `here`, the mount is held where it is in the start pose of the mode. Otherwise, use `xyz` and `rpy`."""
    carries: Literal["force", "force and torque"] = "force and torque"
    """With `force`, the link can rotate about the held point. With `force and torque`, the link is clamped."""

    def _check_rules(self) -> None:
        super()._check_rules()
        placed = [key for key in ("xyz", "rpy", "quat") if key in self.model_fields_set]
        if self.at is not None and placed:
            raise rule(f"an entry of `hold` cannot have both `at` and `{placed[0]}`", f"remove `at` or `{placed[0]}`", placed[0])
        if self.at is None and not placed:
            raise rule("an entry of `hold` requires `at: here`, or `xyz` and `rpy`", "write, for example, `at: here`")
        if self.carries == "force" and placed[-1:] in (["rpy"], ["quat"]):
            key = placed[-1]
            raise rule(f"`{key}` has no effect with `carries: force`", f"remove `{key}`", key)


class StandingSpec(Model):
    """The mounts on which the robot stands in a mode with a free base."""

    mounts: Annotated[list[ShownMountField], Field(min_length=1)] = Field(examples=[["leg_0.sole", "leg_2.sole", "leg_4.sole"]])
    """The mounts at which the floor supports the robot; patterns are allowed."""
    friction: NumberField | None = None
    """Sliding friction between these mounts and the floor; default: the friction of their materials."""


class ModeSpec(Model):
    """A mode: a simulation model of the robot."""

    root: RootField | None = None
    """The root: a mount, which is mated to the world, or a component, which is placed at the world frame."""
    base: BaseType | None = None
    """The type of base: `fixed` (default), `held`, `free`, `planar` (in the x-y plane of `at`) or `ball` (about the origin of the root)."""
    at: WorldAtSpec | None = optional({"xyz": "0 0 300 mm", "rpy": "0 0 90 deg"}, {"on": "floor"})
    """Pose of the root in the world; default: the origin."""
    at_in: dict[OwnPoseKey, PoseSpec] | None = optional({"sit": {"xyz": "0 0 100 mm"}})
    """For a `free` or `held` base: the place of the root in a pose of the joints, by the name of the pose. In other poses, `at` applies."""
    gravity: StandsOn | Vector3Acceleration | None = optional("wall", "0 0 -1.62 m/s^2")
    """Gravity: the surface that supports the robot (`floor`, `wall` or `ceiling`), or a vector in the world frame; default: `floor`."""
    pose: PoseField | None = None
    """The pose in which the mode starts."""
    poses: list[PoseField] | None = optional(["home", "folded"])
    """The poses that are keyframes of the mode; default: all poses."""
    actuators: list[JointPattern] | None = optional(["yaw", "leg_*"])
    """The joints whose drives are used in the mode; patterns are allowed; default: all."""
    contacts: ContactsSpec | None = optional({"exclude": [["plate", "hand"]]})
    hold: dict[RootField, HoldSpec | Literal["here"]] | None = optional(
        {"rear_foot.sole": "here"}, {"rear_foot.sole": {"at": "here", "carries": "force"}}, {"rear_foot.sole": {"xyz": "200 0 0 mm"}},
    )
    """Additional mounts that are fixed to the world, each at a given place or at `here`, where the mount is in the start pose."""
    standing_on: StandingSpec | list[ShownMountField] | None = optional(
        ["leg_0.sole", "leg_2.sole", "leg_4.sole"], {"mounts": ["leg_*.sole"], "friction": 0.6},
    )
    """The mounts on which a free base stands. The floor can push at these mounts but not pull. Only static analyses use this key."""
    cut: list[JointPattern] | None = optional(["rear_knee"])
    """The joints at which kinematic loops are cut; patterns are allowed."""
    simulation: SimulationSpec | None = optional({"timestep": "1 ms"})
    """Simulation settings of this mode, which override the settings of the document."""
    extends: ModeField | None = None
    """Another mode whose settings this mode inherits."""
    allow: Allow = allow()
    """Suppressed warnings of this mode and of modes that extend it, by code, each with a reason."""
