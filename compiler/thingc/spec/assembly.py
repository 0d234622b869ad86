"""The `assembly/1` document, key by key. Field docstrings are the hover text of an editor."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from thingc.spec.base import Model
from thingc.spec.fields import (
    AngleField,
    AnyQuantityField,
    ArmatureField,
    CostField,
    CountField,
    DampingField,
    EffortField,
    ForceField,
    FrictionField,
    InertiaField,
    JointValueField,
    LengthField,
    MassField,
    MultiplierField,
    Name,
    NumberField,
    RawField,
    ReferenceField,
    SpeedField,
    StiffnessField,
    TimeField,
    Vector3Acceleration,
    Vector3Angle,
    Vector3Length,
)
from thingc.spec.materials import MaterialSpec, ProcessSpec

Source = Literal["measured", "vendor", "estimated"]


def _rule(message: str, help: str = "", key: str | None = None) -> PydanticCustomError:
    """A broken rule of a whole mapping, in words; `key` is the one of its keys that is to blame."""
    return PydanticCustomError("rule", "{message}", {"message": message, "help": help, "path": (key,) if key is not None else ()})


class ParameterSpec(Model):
    """A parameter in full: its value, and what a variant or a parent may set it to."""

    value: AnyQuantityField
    """The value where nobody sets another."""
    min: AnyQuantityField | None = None
    """The smallest value allowed, in the same dimension."""
    max: AnyQuantityField | None = None
    """The largest value allowed, in the same dimension."""
    doc: str = ""
    """One line for the people who set it."""


class StatedMass(Model):
    """A mass and where it is from."""

    value: MassField
    source: Source
    """`measured`, `vendor` or `estimated`."""


class StatedCentre(Model):
    """A centre of mass and where it is from."""

    value: Vector3Length
    source: Source


class InertiaMatrix(Model):
    """Inertia about the centre of mass, component axes. Products default to 0."""

    ixx: InertiaField
    iyy: InertiaField
    izz: InertiaField
    ixy: InertiaField | Literal[0] = 0
    ixz: InertiaField | Literal[0] = 0
    iyz: InertiaField | Literal[0] = 0


class StatedInertia(Model):
    """An inertia and where it is from."""

    value: InertiaMatrix
    source: Source


class MountSpec(Model):
    """A mount added to a component: a frame on it, z pointing out of the material."""

    xyz: Vector3Length = (0, 0, 0)  # type: ignore[assignment]
    rpy: Vector3Angle = (0, 0, 0)  # type: ignore[assignment]
    """Extrinsic roll, pitch, yaw, as in URDF."""
    interface: str | None = None
    """What fits: `x430-horn`, `m2.5-clearance`."""


class BomSpec(Model):
    """The line of the bill of materials."""

    number: str | None = None
    supplier: str | None = None
    cost: CostField | None = None
    make: Literal["buy", "print", "machine"] | None = None


class AtSpec(Model):
    """Plain placement: my frame at this pose in that frame; no mate, no flip."""

    in_: ReferenceField = Field(alias="in", description="The frame: a mount, or a component's `origin`.")
    xyz: Vector3Length = (0, 0, 0)  # type: ignore[assignment]
    rpy: Vector3Angle = (0, 0, 0)  # type: ignore[assignment]
    """Extrinsic roll, pitch, yaw, as in URDF."""


class AttachSpec(Model):
    """The rigid mate in full."""

    mount: ReferenceField
    """My mount."""
    to: ReferenceField
    """The mount that it meets."""
    turn: AngleField | None = None
    """A constant turn about and along the other mount's z."""
    gap: LengthField | None = None
    """A constant distance along the other mount's z."""


class RepeatSpec(Model):
    """Makes `name_0` to `name_{count-1}`."""

    count: CountField
    as_: Name = Field(default="i", alias="as", description="The index: in expressions `i`, in references `$i`.")


Collision = Literal["hull", "box", "cylinder", "capsule", "sphere", "decompose", "mesh", "part", "none"]


class ComponentDefaults(Model):
    """What `defaults: component:` may set for every component of this document."""

    material: str | None = None
    """A material in scope."""
    mass: StatedMass | MassField | None = None
    """Mass, over what the part and its material say."""
    com: StatedCentre | Vector3Length | None = None
    """Centre of mass, component axes."""
    inertia: StatedInertia | InertiaMatrix | None = None
    """Inertia about the centre of mass, component axes."""
    collision: Collision | None = None
    """The shape that simulators collide: `hull` unless said otherwise."""
    visual: bool | None = None
    """Whether it is drawn; true unless said otherwise."""
    process: ProcessSpec | None = None
    """How it is made, merged over the material's process."""
    bom: BomSpec | None = None
    """The line of the bill of materials."""
    expect: Literal["ignore"] | None = None
    """`ignore`: do not warn where the geometry was cut for another part."""


class ComponentSpec(ComponentDefaults):
    """A node: exactly one of `part`, `file`, `assembly`, `frame`, placed by at most one of `attach`, `at`."""

    part: str | None = None
    """A Thing or shape as `module:Class`."""
    file: str | None = None
    """A part of a file: STEP, BREP, STL, 3MF or OBJ, relative to this document."""
    assembly: str | None = None
    """Another assembly document, relative to this one."""
    frame: Literal[True] | None = None
    """A component without geometry."""
    params: dict[str, AnyQuantityField] = {}
    """The part's parameters."""
    parameters: dict[str, AnyQuantityField] = {}
    """The nested assembly's parameters."""
    attach: Annotated[AttachSpec | dict[str, ReferenceField] | None, Field(union_mode="left_to_right")] = None
    """The rigid mate: `{my_mount: other.mount}`, or in full."""
    at: AtSpec | None = None
    """Plain placement in another frame."""
    mounts: dict[Name, MountSpec] = {}
    """Mounts to add."""
    mirror: Literal["x", "y", "z"] | None = None
    """Reserved."""
    repeat: RepeatSpec | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> ComponentSpec:
        kinds = [k for k in ("part", "file", "assembly", "frame") if getattr(self, k) is not None]
        if not kinds:
            raise _rule("a component needs one of `part`, `file`, `assembly` or `frame: true`; none is here",
                        "write for example `part: arm:BasePlate`")
        if len(kinds) > 1:
            named = " and ".join(f"`{k}`" for k in kinds)
            raise _rule(
                f"a component has exactly one of `part`, `file`, `assembly`, `frame`; here are {named}", "keep one of them",
            )
        if self.params and self.part is None:
            raise _rule(
                "`params` belongs to a `part`", "a nested assembly takes `parameters`" if self.assembly else "take it out",
            )
        if self.parameters and self.assembly is None:
            raise _rule("`parameters` belongs to a nested `assembly`", "a part takes `params`" if self.part else "take it out")
        if self.attach is not None and self.at is not None:
            raise _rule("a component is placed by `attach` or by `at`, not by both", "keep one of them")
        if isinstance(self.attach, dict) and len(self.attach) != 1:
            raise _rule(f"`attach` names one mate `{{my_mount: other.mount}}`; here are {len(self.attach)}",
                        "one mate places a component; a second one would have to agree with it" if self.attach
                        else "write for example `{back: plate.servo_seat}`", "attach")
        return self


class LimitSpec(Model):
    """Where a joint stops, and how hard and fast it may be driven."""

    lower: JointValueField | None = None
    upper: JointValueField | None = None
    effort: EffortField | None = None
    """Largest torque or force; from the drive unless written."""
    velocity: SpeedField | None = None
    """Largest speed; from the drive unless written."""


class DynamicsSpec(Model):
    """What a joint does by itself."""

    damping: DampingField | None = None
    friction: FrictionField | None = None
    armature: ArmatureField | None = None
    """Reflected rotor inertia; from the drive unless written."""
    stiffness: StiffnessField | None = None


class MimicSpec(Model):
    """q = multiplier * q(joint) + offset."""

    joint: ReferenceField
    """A joint of this document."""
    multiplier: MultiplierField = 1  # type: ignore[assignment]
    offset: JointValueField = 0  # type: ignore[assignment]


class DriveSpec(Model):
    """An inline actuator."""

    kind: Literal["position", "velocity", "motor"]
    kp: NumberField | None = None
    """Position gain [N m/rad or N/m]."""
    kv: NumberField | None = None
    """Velocity gain [N m s/rad or N s/m]."""
    effort: EffortField | None = None
    velocity: SpeedField | None = None
    armature: ArmatureField | None = None

    @model_validator(mode="after")
    def _gain(self) -> DriveSpec:
        if self.kind == "position" and self.kp is None:
            raise _rule("a position drive needs `kp`; none is here", "write for example `kp: 20`")
        return self


class JointDefaults(Model):
    """What `defaults: joint:` may set for every joint of this document."""

    limit: LimitSpec | None = None
    dynamics: DynamicsSpec | None = None
    turn: AngleField | None = None
    gap: LengthField | None = None
    drive: DriveSpec | ReferenceField | None = None


JointType = Literal["fixed", "revolute", "continuous", "prismatic", "cylindrical", "universal", "ball", "planar", "screw"]


class JointSpec(JointDefaults):
    """An edge that moves: the child's mount on the parent's mount."""

    type: JointType
    parent: ReferenceField
    """The mount that stays: `component.mount`."""
    child: ReferenceField
    """The mount that moves; its component is placed by this joint."""
    offset: JointValueField | None = None
    """Pose of the geometry at q = 0."""
    mimic: MimicSpec | None = None
    loop: bool = False
    """Closes a loop instead of placing the child."""
    repeat: RepeatSpec | None = None


class DefaultsSpec(Model):
    """Merged under this document's own components and joints, not inside nested ones."""

    component: ComponentDefaults | None = None
    joint: JointDefaults | None = None


class SimulationSpec(Model):
    """How simulators step."""

    timestep: TimeField | None = None
    integrator: Literal["euler", "rk4", "implicit", "implicitfast"] | None = None
    cone: Literal["pyramidal", "elliptic"] | None = None
    impratio: NumberField | None = None


class WorldAtSpec(Model):
    """The world side of a mode's root."""

    xyz: Vector3Length = (0, 0, 0)  # type: ignore[assignment]
    rpy: Vector3Angle = (0, 0, 0)  # type: ignore[assignment]


class ContactsSpec(Model):
    """Who may touch whom in this mode."""

    exclude: list[Annotated[list[ReferenceField], Field(min_length=2, max_length=2)]] = []
    """Pairs of components (globs allowed) that never touch."""
    adhesion: dict[ReferenceField, ForceField] = {}
    """Pull-off force per mount."""


class HoldPoseSpec(Model):
    """Where a further mount is held: the world side, as `at` of a root."""

    xyz: Vector3Length = (0, 0, 0)  # type: ignore[assignment]
    rpy: Vector3Angle = (0, 0, 0)  # type: ignore[assignment]


class ModeSpec(Model):
    """One simulation model."""

    root: ReferenceField | None = None
    """A mount (mated to the world) or a component (laid on the world frame)."""
    base: Literal["fixed", "held", "free", "planar", "ball"] | None = None
    """`fixed` (default), `held` or `free`."""
    at: WorldAtSpec | None = None
    gravity: Literal["floor", "wall", "ceiling"] | Vector3Acceleration | None = None
    pose: Name | None = None
    """Where it starts."""
    poses: list[Name] | None = None
    """Its keyframes; all unless written."""
    actuators: list[str] | None = None
    """The joints driven here, globs allowed; all unless written."""
    contacts: ContactsSpec | None = None
    hold: dict[ReferenceField, HoldPoseSpec | Literal["here"]] | None = None
    """Further mounts held to the world, each at a pose or `here`: where the mode's own pose puts it."""
    cut: list[str] | None = None
    """The joints at which loops are cut, globs allowed."""
    simulation: SimulationSpec | None = None
    extends: Name | None = None
    """Another mode that this one is merged over."""


class SensorSpec(Model):
    """What the robot measures: on a mount (`imu`, `force`, `camera`), or of a joint."""

    type: Literal["imu", "force", "joint", "camera"]
    at: ReferenceField | None = None
    """The mount it sits on; a camera looks along its z, with its y up."""
    joint: ReferenceField | None = None
    """Of a `joint` sensor the joint, if it is not the one that is called like the sensor."""
    fovy: AngleField | None = None
    """Of a camera the angle of view from bottom to top; 45 deg unless written."""

    @model_validator(mode="after")
    def _keys(self) -> SensorSpec:
        if self.type == "joint":
            if self.at is not None:
                raise _rule("a `joint` sensor has no `at`: it measures a joint", "write `joint: NAME`, or choose another `type`")
        else:
            if self.at is None:
                raise _rule(f"a sensor of type `{self.type}` needs `at`; none is here", "write for example `at: body.top`")
            if self.joint is not None:
                raise _rule(f"`joint` belongs to a sensor of type `joint`; this one is `{self.type}`", "take it out")
        if self.fovy is not None and self.type != "camera":
            raise _rule(f"`fovy` belongs to a camera; this sensor is `{self.type}`", "take it out")
        return self


class AssemblySpec(Model):
    """An assembly of components and joints: a robot, or a part of one."""

    thingc: Literal["assembly/1"]
    """Kind and version of this document."""
    name: Name
    """The robot's name: also of the build folder."""
    description: str = ""
    parameters: dict[Name, ParameterSpec | AnyQuantityField] = {}
    """What a variant or a parent assembly may set."""
    materials: list[str] | dict[Name, MaterialSpec] = []
    """Material documents in scope, or materials written here."""
    defaults: DefaultsSpec | None = None
    components: Annotated[dict[Name, ComponentSpec], Field(min_length=1)]
    joints: dict[Name, JointSpec] = {}
    links: dict[Name, ReferenceField] = {}
    """Names a link and picks its frame."""
    mounts: dict[Name, ReferenceField] = {}
    """Frames this assembly shows to a parent assembly."""
    poses: dict[Name, dict[str, JointValueField]] = {}
    modes: dict[Name, ModeSpec] = {}
    """One simulation model each; the first is the default."""
    simulation: SimulationSpec | None = None
    raw: dict[str, RawField] = {}
    """Attributes by path, checked by the target alone."""
    sensors: dict[Name, SensorSpec] = {}
    """What the robot measures."""
