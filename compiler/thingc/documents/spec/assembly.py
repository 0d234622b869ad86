"""The `assembly/1` document, key by key. Field docstrings are the hover text of an editor."""

from typing import Annotated, Any, Literal, Union

from pydantic import ConfigDict, Field
from pydantic_core import PydanticCustomError

from thingc.base.joints.kinds import JointType
from thingc.base.suggestions import Suggestion
from thingc.documents.load.paths import SUFFIXES_WITH_UNIT
from thingc.documents.spec import fields, name_types
from thingc.documents.spec.allowances import Allow, allow
from thingc.documents.spec.base import Model, given_keys, optional, require_with, rule
from thingc.documents.spec.catalog import QuantityText
from thingc.documents.spec.drives import DriveSpec, DynamicsSpec
from thingc.documents.spec.interfaces import InterfaceSpec
from thingc.documents.spec.link_shapes import ChoiceSpec, Collision, CollisionSpec, ShapeSpec
from thingc.documents.spec.mass import CentreOfMassSpec, InertiaMatrix, InertiaSpec, MassSpec
from thingc.documents.spec.materials import MaterialSpec, ProcessSpec
from thingc.documents.spec.modes import ModeSpec, SimulationSpec
from thingc.documents.spec.motions import MotionFileSpec, MotionPoseSpec
from thingc.documents.spec.names import NamesSpec
from thingc.documents.spec.patterns import raw_schema
from thingc.documents.spec.poses import PoseSpec
from thingc.documents.spec.repeats import RepeatSpec
from thingc.documents.spec.sensors import SensorSpec
from thingc.documents.spec.tendons import TendonSpec
from thingc.documents.spec.tests import TestSpec
from thingc.documents.spec.transmissions import TransmissionSpec

_RAW_TEXT = "a string, a number, a boolean, a list of these, or a mapping"


def _raw(value: Any) -> Any:
    """Validate an attribute for a target: a scalar, a list of scalars, or a mapping of these."""
    wrong: list[PydanticCustomError] = []
    validated = _validate_raw(value, (), wrong)
    fields.raise_all(wrong)
    return validated


def _validate_raw(value: Any, path: tuple[str | int, ...], wrong: list[PydanticCustomError]) -> Any:
    if isinstance(value, dict):
        return {key: _validate_raw(item, (*path, key), wrong) for key, item in value.items()}
    scalars = value if isinstance(value, list) else [value]
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):  # added elements
        return [_validate_raw(entry, (*path, number), wrong) for number, entry in enumerate(value)]
    if not all(entry is None or isinstance(entry, (str, int, float)) for entry in scalars):  # null values are reported for every key
        error = fields.fault("type", f"expected {_RAW_TEXT}, found {fields.describe(value)}")
        wrong.append(fields.within(error, path) if path else error)
    return value


_RAW_SCHEMA = {"description": "Attributes by path.", "examples": [{"joint": {"yaw": {"solreflimit": "0.01 1"}}}], **raw_schema(6)}

RawField = Annotated[
    Union[str, int, float, bool, list[Any], dict[str, Any]], fields.FieldValidator(_raw, _RAW_TEXT, _RAW_SCHEMA),
    name_types.RefersTo("raw"),
]




class ParameterSpec(Model):
    """A parameter in long form: its default value, and the range of values that a variant or a parent assembly can set."""

    value: fields.AnyQuantityField
    """The default value."""
    min: fields.AnyQuantityField | None = None
    """The smallest allowed value, with the same physical dimension."""
    max: fields.AnyQuantityField | None = None
    """The largest allowed value, with the same physical dimension."""
    doc: str = Field(default="", examples=["servo axis to servo axis"])
    """A one-line description."""


class MountSpec(PoseSpec):
    """A mount that the document adds to a component, at a pose in the component's frame.

    The z axis of the mount points out of the material.
    """

    interface: str | InterfaceSpec | None = optional("x430-horn", {"bolts": {"thread": "M3", "count": 4, "circle": "20 mm"}})
    """The mating features of the mount, which must fit the mount on the other side, or only the name of an interface."""
    tolerance: fields.LengthField | None = None
    """The largest deviation of its position along each axis of the part, for tolerance stacks; default: that of the process."""


class BomSpec(Model):
    """The entry of a component in the bill of materials."""

    number: str | None = optional("902-0135-000")
    """Order number or drawing number."""
    supplier: str | None = optional("ROBOTIS")
    """Supplier."""
    cost: fields.CostField | dict[QuantityText, fields.CostField] | None = optional("12.50 EUR", {"1": "12.50 EUR", "10": "9.80 EUR"})
    """Price per piece, or prices by the smallest quantity for which they apply."""
    make: Literal["buy", "print", "machine"] | None = None
    """Whether the component is bought, printed or machined. Bought components do not get a print file."""
    link: fields.LinkField | None = None
    """Web page of the part."""
    picture: str | None = optional("pictures/xm430.png")
    """Picture of the part: PNG, JPEG, WebP or SVG, relative to this document."""


class ComponentBomSpec(BomSpec):
    """The entry of a component, or of a nested assembly, in the bill of materials."""

    as_: Literal["one"] | None = Field(
        default=None, alias="as", description="`one` lists a nested assembly as one bought part, without the parts that it contains.",
    )


class PrintSpec(Model):
    """Print settings of a part."""

    up: Literal["auto"] | Annotated[list[fields.NumberField], Field(min_length=3, max_length=3)] | None = optional(
        [0, 0, 1], [0, -1, 0], "auto",
    )
    """The direction away from the bed, in the part's axes, or `auto` for the least support; default: `[0, 0, 1]`."""


class AtSpec(PoseSpec):
    """The placement of a component by a pose: the pose of the component's frame in another frame, without a mate."""

    in_: name_types.MountField = Field(alias="in", description="The frame: a mount, or a component's `origin`.")


class AttachSpec(Model):
    """A rigid mate between a mount of the component and another mount, in its long form with all keys."""

    mount: name_types.OwnMountField
    """A mount of this component."""
    to: name_types.MountField
    """The mount to which the component is attached."""
    turn: fields.AngleField | None = None
    """A constant rotation about the z axis of the mount `to`."""
    gap: fields.LengthField | None = None
    """A constant distance along the z axis of the mount `to`."""


class ComponentDefaults(Model):
    """Defaults for all components of this document (`defaults: component:`)."""

    material: name_types.MaterialField | None = optional("petg")
    """A material that this document can use."""
    mass: MassSpec | fields.MassField | None = optional("57.2 g", {"value": "57.2 g", "source": "measured"})
    """The mass, which replaces the mass from the part and its material."""
    com: CentreOfMassSpec | fields.Vector3Length | None = optional("0 0 12 mm", {"value": "0 0 12 mm", "source": "vendor"})
    """The centre of mass, in the frame of the component."""
    inertia: InertiaSpec | InertiaMatrix | None = optional({"ixx": "2e-5 kg*m^2", "iyy": "2e-5 kg*m^2", "izz": "3e-5 kg*m^2"})
    """The inertia about the centre of mass, in the axes of the component."""
    collision: Collision | CollisionSpec | None = optional(
        "box", {"decompose": {"pieces": 8}}, {"shapes": [{"box": "40 20 10 mm", "at": {"xyz": "0 0 5 mm"}}]},
    )
    """The collision shape for simulators, or a list of shapes; default: `hull`."""
    visual: bool | None = None
    """Whether the component is drawn; default: true."""
    process: ProcessSpec | None = optional({"kind": "fdm", "walls": 4, "infill": "30 %"})
    """The manufacturing process. Keys of this process override keys of the material's process."""
    print: PrintSpec | None = optional({"up": [0, 0, 1]})
    """The orientation of the part on the printer."""
    bom: BomSpec | None = optional({"number": "902-0135-000", "supplier": "ROBOTIS", "cost": "269.90 USD", "make": "buy"})
    """The entry in the bill of materials."""


KINDS = ("part", "file", "assembly", "link", "frame")
"""Keys that determine the kind of a component. Each component must have exactly one of the keys."""

PART_KEYS = ("visual", "process", "print")
"""Keys that a component with `link` cannot have, because each shape of a link has its own settings."""


def _component_rules(schema: dict[str, Any]) -> None:
    """Add the cross-field rules of `ComponentSpec` to its schema, so that editors can check them."""
    none_or_shapes = {"anyOf": [{"const": "none"}, {"type": "object", "required": ["shapes"]}]}
    schema["oneOf"] = [{"required": [kind]} for kind in KINDS]
    schema["not"] = {"required": ["attach", "at"]}
    schema["dependentSchemas"] = {
        key: {"anyOf": [{"required": [of]}, {"properties": {key: {"maxProperties": 0}}}]}
        for key, of in (("params", "part"), ("parameters", "assembly"))
    } | {
        "as": {"required": ["assembly"], "not": {"required": ["mode"]}}, "pose": {"required": ["as"]},
        "unit": {"required": ["file"]}, "faces": {"required": ["file"]}, "shapes": {"required": ["link"]},
        "mode": {"required": ["assembly", "at"]},
        **{key: {"not": {"required": ["link"]}} for key in PART_KEYS},
        "collision": {
            "if": {"required": ["link"]},
            "then": {"properties": {"collision": {"type": "object", "properties": {
                **dict.fromkeys(("kind", "shapes", "decompose"), False),
                **dict.fromkeys(("targets", "modes"), {"additionalProperties": none_or_shapes}),
            }}}},
        },
        "keep": {"anyOf": [{"properties": {"keep": {"const": False}}}, {"required": ["attach"]}, {"required": ["at"]}]},
        "mirror": {"not": {"required": ["frame"]}},
    }
    for branch in schema["properties"]["attach"]["anyOf"]:
        if "additionalProperties" in branch:
            branch |= {"minProperties": 1, "maxProperties": 1}


class ComponentSpec(ComponentDefaults):
    """A component with exactly one of the keys `part`, `file`, `assembly`, `link`, `frame`, and at most one of `attach`, `at`."""

    model_config = ConfigDict(json_schema_extra=_component_rules)

    part: name_types.PartField | None = optional("arm:BasePlate", "thingc_stock.dynamixel:XM430")
    """The class of a part, as `module:Class`."""
    file: str | None = optional("parts/motor.step")
    """The file of a part: STEP, BREP, STL, 3MF or OBJ, relative to this document."""
    assembly: name_types.AssemblyDocument | None = optional("end_effector.yaml")
    """Another assembly document, relative to this one."""
    link: Literal[True] | None = None
    """A component whose geometry is listed under `shapes`, and whose mass is specified."""
    frame: Literal[True] | None = None
    """A component without geometry."""
    shapes: list[ShapeSpec] = Field(default=[], examples=[[{"box": "380 90 110 mm"}]])
    """The visual and collision shapes of a link."""
    unit: Literal["um", "mm", "cm", "m", "in", "ft"] | None = None
    """The unit of length in an STL, OBJ or BREP file, because these formats do not specify the unit; default: mm."""
    faces: fields.CountField | None = optional(5000)
    """The largest number of triangles in meshes for simulators. Print files, masses and STEP files use the full geometry."""
    params: dict[name_types.PartParameter, fields.AnyQuantityField] = Field(default={}, examples=[{"length": "120 mm", "holes": 4}])
    """Values for parameters of the part, by name."""
    parameters: dict[name_types.NestedParameter, fields.AnyQuantityField] = Field(default={}, examples=[{"pen_diameter": "15 mm"}])
    """Values for parameters of the nested assembly, by name."""
    attach: Annotated[
        AttachSpec | dict[name_types.OwnMountKey, name_types.MountField] | None, Field(union_mode="left_to_right"),
    ] = optional({"back": "plate.servo_seat"}, {"mount": "back", "to": "plate.servo_seat", "turn": "90 deg"})
    """The rigid mate that places the component: `{my_mount: other.mount}`, or the long form with all keys."""
    at: AtSpec | None = optional({"in": "bracket.board", "xyz": "0 0 4 mm"})
    """Placement by a pose in another frame."""
    mode: name_types.NestedMode | None = optional("bench")
    """A mode of the nested assembly. The root of the mode is placed `at` the pose, and can move like the base of the mode."""
    as_: Literal["lump"] | None = Field(
        default=None, alias="as", description="`lump` replaces the nested assembly by one rigid body, computed from `parts.lock.json`.",
    )
    pose: name_types.NestedPose | None = optional("folded")
    """The pose of the nested assembly in a lump; default: the start pose of its first mode."""
    keep: bool = False
    """Whether the component starts a separate link, which a fixed joint connects to its neighbour; only with `attach` or `at`."""
    mounts: dict[name_types.NewMount, MountSpec] = Field(default={}, examples=[{"shaft": {"xyz": "0 0 20 mm", "rpy": "180 0 0 deg"}}])
    """Mounts that this document adds to the component, by name."""
    detail: list[fields.Name] = Field(default=[], examples=[["fasteners"]])
    """Levels of detail to which the component belongs. Simulation models omit its shapes if `detail` of the document lists a level."""
    mirror: Literal["x", "y", "z"] | None = None
    """Mirrors the part, or the whole nested assembly, at the plane normal to this axis of its frame."""
    repeat: RepeatSpec | None = optional({"count": 6}, {"count": "=legs", "as": "k"})
    """Repeats the entry as `name_0`, `name_1` and so on."""
    bom: ComponentBomSpec | None = optional(
        {"number": "902-0135-000", "cost": "269.90 USD"}, {"as": "one", "number": "RG2", "supplier": "OnRobot"},
    )
    """The entry in the bill of materials."""
    allow: Allow = allow()
    """Suppressed warnings of this component, by code, each with a reason."""

    def _check_rules(self) -> None:
        kinds = given_keys(self, KINDS)
        if not kinds:
            raise rule("a component requires one of `part`, `file`, `assembly`, `link: true` or `frame: true`",
                        "add `link: true` next to `shapes`" if self.shapes else "write, for example, `part: arm:BasePlate`")
        if len(kinds) > 1:
            found = ", ".join(f"`{k}`" for k in kinds)
            raise rule(
                f"a component must have exactly one of {', '.join(f'`{kind}`' for kind in KINDS)}, found {found}",
                "keep only one of these keys", kinds[1],
            )
        for key, kind, other, its in (("params", "part", "assembly", "parameters"), ("parameters", "assembly", "part", "params")):
            if getattr(self, key) and getattr(self, kind) is None:
                help = Suggestion(f"use `{its}` with `{other}`", (key, its)) if getattr(self, other) else f"remove `{key}`"
                raise rule(f"`{key}` can only be used with `{kind}`", help, key)
        require_with(self, "unit", "file", "remove `unit`")
        if self.unit is not None and self.file is not None and self.file.lower().endswith(SUFFIXES_WITH_UNIT):
            raise rule(f"`unit` cannot be used with `{self.file}`, which specifies a unit", "remove `unit`", "unit")
        require_with(self, "faces", "file", "remove `faces`, and set `mesh` in `thingc.toml` instead")
        require_with(self, "shapes", "link", "move `shapes` to a separate component with `link: true`")
        for key in PART_KEYS:
            if self.link is not None and getattr(self, key) is not None:
                help = "set `for` of each shape: `visual`, `collision` or `both`" if key == "visual" else f"remove `{key}`"
                raise rule(f"`{key}` can only be used with `part` or `file`, not with `link`", help, key)
        if self.link is not None and self.collision is not None and not (
            isinstance(self.collision, CollisionSpec) and not given_keys(self.collision, ("kind", "shapes", "decompose"))
            and all(choice == "none" or isinstance(choice, ChoiceSpec) and choice.shapes for choice in self.collision.variants.values())
        ):
            help = "set `for` and `decompose` of the `shapes` instead, or write, for example, `collision: {modes: {bench: none}}`"
            raise rule("`collision` of a link can only be set per target or mode, to `none` or `shapes`", help, "collision")
        if self.bom is not None and self.bom.as_ is not None and self.assembly is None:
            raise rule("`as: one` can only be used with `assembly`", "remove `as`", "bom")
        if isinstance(self.collision, CollisionSpec) and self.frame is not None:
            raise rule("`collision` with shapes cannot be used with `frame`", "write `link: true` and list the `shapes`", "collision")
        if self.mirror is not None and self.frame is not None:
            raise rule("`mirror` cannot be used with `frame`", "remove `mirror`", "mirror")
        if self.attach is not None and self.at is not None:
            raise rule("a component cannot have both `attach` and `at`", "remove `attach` or `at`", "at")
        require_with(self, "mode", "assembly", "remove `mode`")
        if self.as_ is not None and (self.assembly is None or self.mode is not None):
            raise rule("`as: lump` can only be used with `assembly`, and without `mode`", "remove `as`, or replace `mode` by `pose`", "as")
        if self.pose is not None and self.as_ is None:
            help = "add `as: lump`, or place the component by `attach`, `at` or a joint"
            raise rule("`pose` can only be used with `as: lump`", help, "pose")
        if self.keep and self.attach is None and self.at is None:
            raise rule("`keep` can only be used with `attach` or `at`", "write `keep: true` in a `fixed` joint, or remove `keep`", "keep")
        if isinstance(self.attach, dict) and len(self.attach) != 1:
            raise rule(f"expected one mate in `attach`, found {len(self.attach)}",
                        "keep only one mate" if self.attach
                        else "write, for example, `{back: plate.servo_seat}`", "attach")


class LimitSpec(Model):
    """Position limits of a joint, and limits of effort and velocity."""

    lower: fields.JointValueField | None = None
    """The smallest position of the joint."""
    upper: fields.JointValueField | None = None
    """The largest position of the joint."""
    effort: fields.EffortField | None = None
    """Largest torque or force of the joint; default: from the drive."""
    velocity: fields.SpeedField | None = None
    """Largest speed of the joint; default: from the drive."""
    cone: fields.AngleField | None = None
    """The largest rotation of a ball joint, about any axis. A ball joint has no other position limit."""
    source: Literal["geometry"] | None = None
    """The source of the position limits. The command `thingc limits --write` writes `geometry`. The key does not change the robot."""


class MimicSpec(Model):
    """A mimic, by which a joint follows another joint: q = multiplier * q(joint) + offset, or a polynomial in q(joint)."""

    model_config = ConfigDict(json_schema_extra={
        "if": {"required": ["polynomial"]}, "then": {"properties": {key: {"not": {}} for key in ("multiplier", "offset")}},
    })

    joint: name_types.CoordinateField
    """A joint of this document."""
    multiplier: fields.MultiplierField = 1  # type: ignore[assignment]
    """Ratio of the motion of this joint to the motion of the other joint; default: 1."""
    offset: fields.JointValueField = 0  # type: ignore[assignment]
    """Position of this joint when the other joint is at 0; default: 0."""
    polynomial: Annotated[list[fields.AnyQuantityField], Field(min_length=2, max_length=5)] | None = optional(["10 deg", 1, "0.2 rad^-1"])
    """Coefficients of a polynomial in q(joint), in ascending order up to at most the fourth power; replaces `multiplier` and `offset`."""

    def _check_rules(self) -> None:
        for key in ("multiplier", "offset"):
            if self.polynomial is not None and key in self.model_fields_set:
                raise rule(
                    f"`polynomial` cannot be combined with `{key}`",
                    f"remove `{key}`, and set `polynomial[{int(key == 'multiplier')}]` instead", key,
                )


DriveValue = DriveSpec | name_types.ComponentField


class JointDefaults(Model):
    """Defaults for all joints of this document (`defaults: joint:`)."""

    limit: LimitSpec | list[LimitSpec] | dict[fields.Index, LimitSpec] | None = optional(
        {"lower": "-90 deg", "upper": "90 deg"}, {"lower": 0, "upper": "20 mm"},
    )
    """The limits of the joint; a list for a joint with several coordinates."""
    dynamics: DynamicsSpec | list[DynamicsSpec] | dict[fields.Index, DynamicsSpec] | None = optional(
        {"damping": "0.02 N*m*s/rad", "friction": "0.05 N*m"},
    )
    """The passive dynamics of the joint; a list for a joint with several coordinates."""
    turn: fields.AngleField | None = None
    """A constant rotation about the z axis of the parent mount (or about `axis`), before the motion."""
    gap: fields.LengthField | None = None
    """A constant distance along the z axis of the parent mount (or along `axis`)."""
    drive: DriveValue | list[DriveValue] | dict[fields.Index, DriveValue] | None = optional(
        "yaw_servo", {"kind": "position", "kp": "20 N*m/rad", "effort": "4 N*m"},
    )
    """The drive of the joint: a component that is an actuator, or an inline actuator."""


class JointSpec(JointDefaults):
    """A joint, by which a mount of the child component moves relative to a mount of the parent component."""

    type: JointType
    """The kind of joint: `revolute` rotates within limits, `continuous` without limits, `prismatic` translates, `screw` does both."""
    parent: name_types.MountField
    """The parent mount: `component.mount`."""
    child: name_types.MountField
    """The child mount. The joint places the component of this mount."""
    axis: Annotated[list[fields.NumberField], Field(min_length=3, max_length=3)] | None = optional([0, 1, 0])
    """The axis of motion, in the parent mount's frame. With an `axis`, the mounts coincide at q = 0 instead of facing each other."""
    offset: fields.JointValueField | list[fields.JointValueField] | dict[fields.Index, fields.JointValueField] | None = optional("30 deg")
    """The position of the joint at q = 0, which is added to q."""
    reverse: bool = False
    """Whether the joint moves in the opposite direction of its axis."""
    lead: fields.LengthField | None = optional("8 mm", "-2 mm")
    """For a `screw`, the advance per turn; negative for a left-hand thread."""
    mimic: MimicSpec | list[MimicSpec] | dict[fields.Index, MimicSpec] | None = optional({"joint": "left_jaw", "multiplier": -1})
    """The joint that this joint mimics: q = multiplier * q(joint) + offset."""
    loop: bool = False
    """Whether the joint closes a loop instead of placing the child."""
    keep: bool = False
    """For a `fixed` joint: whether its two sides remain separate links."""
    repeat: RepeatSpec | None = optional({"count": 6})
    """Repeats the entry as `name_0`, `name_1` and so on."""
    allow: Allow = allow()
    """Suppressed warnings of this joint, by code, each with a reason."""


class DefaultsSpec(Model):
    """Default values for the components and joints of this document. Default values do not apply to nested documents."""

    component: ComponentDefaults | None = optional({"material": "petg"})
    """Defaults of components."""
    joint: JointDefaults | None = optional({"dynamics": {"damping": "0.02 N*m*s/rad"}})
    """Defaults of joints."""

    def _check_rules(self) -> None:
        collision = self.component.collision if self.component is not None else None
        choices = (collision, *collision.variants.values()) if isinstance(collision, CollisionSpec) else ()
        if any(choice.shapes for choice in choices if not isinstance(choice, str)):
            raise rule("`shapes` cannot be a default", "list the shapes in the component")


class TurnSpec(Model):
    """The orientation of a ball joint in a pose, or the pose of a free joint."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "not": {"required": ["rpy", "quat"]}})

    xyz: fields.Vector3Length | None = None
    """The position of a free joint, in the parent mount's axes."""
    rpy: fields.Vector3Angle | None = None
    """Extrinsic roll, pitch, yaw in the parent mount's axes, as in URDF."""
    quat: Annotated[list[fields.NumberField], Field(min_length=4, max_length=4)] | None = optional([0.966, 0.259, 0, 0])
    """The quaternion w, x, y, z, as in MJCF, of any length except 0."""

    def _check_rules(self) -> None:
        if (self.rpy is None) == (self.quat is None) and not (self.rpy is None and self.xyz is not None):
            raise rule("an orientation requires either `rpy` or `quat`", "write, for example, `{rpy: 0 20 0 deg}`")


PoseValue = name_types.PoseValueField | list[fields.JointValueField] | dict[fields.Index, fields.JointValueField] | TurnSpec


class DetailSpec(Model):
    """The levels of detail that simulation models omit: `-fasteners`, or a list. Masses and inertias do not change."""

    sim: fields.OmittedField = Field(default=(), examples=["-fasteners", ["-fasteners", "-electronics"]])
    """Omitted in all simulation models."""
    mjcf: fields.OmittedField | None = optional("-fasteners")
    """Omitted in MuJoCo models, in place of `sim`."""
    urdf: fields.OmittedField | None = optional("-fasteners")
    """Omitted in URDF files and ROS packages, in place of `sim`."""
    sdf: fields.OmittedField | None = optional("-fasteners")
    """Omitted in SDF files, in place of `sim`."""
    usd: fields.OmittedField | None = optional("-fasteners")
    """Omitted in USD files, in place of `sim`."""
    modes: dict[name_types.ModeField, fields.OmittedField] = Field(default={}, examples=[{"walking": ["-fasteners", "-electronics"]}])
    """Omitted in the simulation models of single modes of this document, in addition to the levels of the format."""


class AssemblySpec(Model):
    """An assembly of components and joints: a robot, or a part of one."""

    thingc: Literal["assembly/1"]
    """Kind and version of this document."""
    name: fields.Name
    """The name of the robot and of its build folder."""
    description: str = Field(default="", examples=["Four-axis pen-drawing arm."])
    """A one-line description."""
    parameters: dict[name_types.NewParameter, ParameterSpec | fields.AnyQuantityField] = Field(
        default={}, examples=[{"reach": {"value": "100 mm", "min": "60 mm", "max": "200 mm"}, "pen_diameter": "15 mm"}],
    )
    """Parameters, by name, whose values a variant or a parent assembly can set."""
    materials: list[name_types.MaterialsDocument] | dict[name_types.NewMaterial, MaterialSpec] = Field(default=[], examples=[
        ["thingc_stock.materials"], ["materials.yaml"], {"petg": {"density": "1270 kg/m^3"}},
    ])
    """Materials that this document can use: definitions by name, or materials documents as paths or `package.document`."""
    catalog: str | None = optional("catalog.csv")
    """Catalogue of bought parts: a CSV file with the columns `number`, `supplier`, `cost`, `quantity`, `link`, `picture`."""
    defaults: DefaultsSpec | None = optional({"component": {"material": "petg"}})
    components: Annotated[dict[name_types.NewComponent, ComponentSpec], Field(min_length=1)] = Field(
        examples=[{"plate": {"part": "arm:BasePlate"}}],
    )
    """Parts, nested assemblies and frames, by name."""
    joints: dict[name_types.NewJoint, JointSpec] = Field(
        default={}, examples=[{"yaw": {"type": "continuous", "parent": "servo.horn", "child": "bracket.seat"}}],
    )
    """Joints, by name."""
    tendons: dict[name_types.NewTendon, TendonSpec] = Field(
        default={}, examples=[{"grip": {"joints": {"left": "12 mm/rad", "right": "12 mm/rad"}, "drive": {"kind": "motor"}}}],
    )
    """Tendons, by name: sums of joint coordinates, or paths, along which drives and springs act."""
    transmissions: dict[name_types.NewTransmission, TransmissionSpec] = Field(
        default={}, examples=[{"knee": {"actuator": "motor_2", "joint": "knee", "ratio": 9, "efficiency": "85 %"}}],
    )
    """Transmissions, by name: gearboxes, belts and differentials between actuators and joints."""
    links: dict[name_types.NewLink, name_types.ComponentField] = Field(default={}, examples=[{"base_link": "plate"}])
    """Names of links, each with the component whose frame is the frame of the link."""
    mounts: dict[name_types.NewExport, name_types.MountField] = Field(default={}, examples=[{"base": "plate.bottom", "tip": "hand.tip"}])
    """Mounts that this assembly exports to a parent assembly."""
    poses: dict[name_types.NewPose, dict[name_types.JointKey, PoseValue]] = Field(
        default={}, examples=[{"home": {"yaw": "30 deg", "leg_*.knee": "-90 deg"}}],
    )
    """Poses, by name: positions of joints. Joints that a pose does not set are at 0."""
    motions: dict[name_types.NewMotion, Annotated[list[MotionPoseSpec], Field(min_length=2)] | MotionFileSpec] = Field(
        default={}, examples=[{"wave": [{"pose": "home", "time": 0}, {"pose": "reach", "time": "1.5 s"}], "log": {"file": "wave.csv"}}],
    )
    """Motions, by name: poses with times, between which the joints move with minimum jerk, or a CSV file."""
    modes: dict[name_types.NewMode, ModeSpec] = Field(default={}, examples=[{"bench": {"root": "plate", "pose": "home"}}])
    """Modes, by name. Each mode is a simulation model; the first mode is the default."""
    detail: DetailSpec | None = optional({"sim": "-fasteners"})
    """Levels of detail that simulation models omit."""
    order: list[name_types.ComponentField] = Field(default=[], examples=[["plate", "servo", "screw_*"]])
    """The order in which assembly instructions add these components. Other components are added where they fit."""
    simulation: SimulationSpec | None = optional({"timestep": "2 ms", "integrator": "implicitfast"})
    raw: dict[str, RawField] = Field(default={}, examples=[{"mjcf": {"joint": {"yaw": {"solreflimit": "0.01 1"}}}}])
    """Attributes that are added to the output files of one target, by path. Only the target checks their values."""
    sensors: dict[name_types.NewSensor, SensorSpec] = Field(default={}, examples=[{"imu": {"type": "imu", "at": "body.imu"}}])
    """Sensors, by name."""
    names: NamesSpec | None = optional({"joints": {"joint_1": "1"}})
    """Names in output files that differ from the names in this document."""
    tests: dict[name_types.NewTest, TestSpec] = Field(default={}, examples=[{"light": {"mass": {"max": "2.2 kg"}}}])
    """Tests of the robot, which `thingc test` runs."""
    allow: Allow = allow()
    """Suppressed warnings of this document, by code, each with a reason."""
