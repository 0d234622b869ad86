"""Models of the shapes of a link in a document. Field docstrings are the hover text of an editor."""

from typing import Annotated, Any, Literal, get_args

from pydantic import ConfigDict, Field

from thingc.documents.load.paths import SUFFIXES_WITH_UNIT
from thingc.documents.spec.base import Model, given_keys, optional, require_one, require_with, rule
from thingc.documents.spec.fields import ColorField, CountField, LengthField, NumberField, Vector3Length
from thingc.documents.spec.materials import FrictionSpec
from thingc.documents.spec.name_types import MaterialField, ModeField
from thingc.documents.spec.names import FileName
from thingc.documents.spec.poses import PoseSpec

ShapeKind = Literal["mesh", "box", "sphere", "cylinder", "capsule", "ellipsoid", "plane"]
Collision = Literal["hull", "box", "cylinder", "capsule", "sphere", "decompose", "mesh", "part", "none"]
"""Kinds of the collision shape of a part."""

KINDS: tuple[ShapeKind, ...] = get_args(ShapeKind)
"""Keys that determine the kind of a shape. Each shape must have exactly one of the keys."""

OF_MESHES = ("unit", "scale", "decompose")
"""Keys that can only be used with `mesh`."""


class RoundSpec(Model):
    """A sphere, as a shape of a link."""

    radius: LengthField
    """Radius of the sphere."""


class LongSpec(Model):
    """A cylinder or a capsule along the z axis, as a shape of a link."""

    radius: LengthField
    """Radius of the round cross-section."""
    length: LengthField
    """Length along z. The length of a capsule does not include its round ends."""


def _shape_rules(schema: dict[str, Any]) -> None:
    """Add the cross-field rules of `ShapeSpec` to its schema, so that editors can check them."""
    schema["oneOf"] = [{"required": [kind]} for kind in KINDS]
    schema["dependentSchemas"] = {key: {"required": ["mesh"]} for key in OF_MESHES}


class DecomposeSpec(Model):
    """The decomposition of a mesh into convex pieces."""

    pieces: CountField | None = optional(8)
    """The largest number of pieces; default: as many as the mesh needs."""


class ContactShapeSpec(Model):
    """A shape with exactly one of the keys `mesh`, `box`, `sphere`, `cylinder`, `capsule`, `ellipsoid`, `plane`."""

    model_config = ConfigDict(json_schema_extra=_shape_rules)

    mesh: str | None = optional("meshes/trunk.stl")
    """A mesh file: STL, OBJ, COLLADA (`.dae`), PLY or glTF (`.glb`), relative to this document."""
    unit: Literal["um", "mm", "cm", "m", "in", "ft"] | None = None
    """The unit of length in an STL, OBJ or PLY `mesh`, because these formats do not specify the unit; default: mm."""
    scale: Annotated[list[NumberField], Field(min_length=3, max_length=3)] | NumberField | None = optional([1, 1, -1], 0.5)
    """Scale factors for a `mesh` along x, y and z, or a single factor. A negative factor mirrors the mesh."""
    decompose: Literal[True] | DecomposeSpec | None = optional(True, {"pieces": 8})
    """Decomposes a `mesh` into convex pieces for collisions; default: the convex hull of the mesh."""
    box: Vector3Length | None = optional("380 90 110 mm")
    """A box: its lengths along x, y and z."""
    sphere: RoundSpec | None = optional({"radius": "20 mm"})
    """A sphere: its radius."""
    cylinder: LongSpec | None = optional({"radius": "20 mm", "length": "80 mm"})
    """A cylinder: its radius, and its length along z."""
    capsule: LongSpec | None = optional({"radius": "20 mm", "length": "80 mm"})
    """A capsule along z: a cylinder with this radius and length between two hemispheres."""
    ellipsoid: Vector3Length | None = optional("40 20 20 mm")
    """An ellipsoid: its half axes along x, y and z."""
    plane: Annotated[list[LengthField], Field(min_length=2, max_length=2)] | None = optional([0, 0], ["2 m", "1 m"])
    """A plane: its lengths along x and y, 0 for an infinite length. The solid is below the plane, and z points out of the solid."""
    at: PoseSpec | None = optional({"xyz": "0 0 40 mm", "rpy": "0 90 0 deg"})
    """The pose of the shape in the frame of the component; default: the origin."""
    material: MaterialField | None = optional("rubber")
    """The material of the shape; default: the material of the component."""
    friction: FrictionSpec | None = optional({"slide": 0.6})
    """The friction of the shape, which overrides the friction of its material."""
    name: FileName | None = optional("left-foot")
    """The name of the shape in output files; default: the name of the component with a number."""

    @property
    def kind(self) -> ShapeKind:
        """The kind of the shape, one of `KINDS`."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    def _check_rules(self) -> None:
        help = "write each shape as a separate item: `- {...}`" if given_keys(self, KINDS) else "write, for example, `box: 40 40 20 mm`"
        require_one(self, KINDS, "a shape", help)
        for key in OF_MESHES:
            require_with(self, key, "mesh", f"remove `{key}`")
        if self.unit is not None and self.mesh is not None and self.mesh.lower().endswith(SUFFIXES_WITH_UNIT):
            raise rule(f"`unit` cannot be used with `{self.mesh}`, which specifies a unit", "use `scale` instead of `unit`", "unit")


class ShapeSpec(ContactShapeSpec):
    """A shape of a link, with exactly one of the keys `mesh`, `box`, `sphere`, `cylinder`, `capsule`, `ellipsoid`, `plane`."""

    for_: Literal["visual", "collision", "both"] = Field(
        default="both", alias="for", description="Whether the shape is visual, for collision, or both; default: both.",
    )
    color: ColorField | None = None
    """The colour of the shape; default: the colour of its material."""

    def _check_rules(self) -> None:
        super()._check_rules()
        if self.decompose is not None and self.for_ == "visual":
            raise rule("`decompose` can only be used with a shape for collisions", "remove `decompose`, or `for: visual`", "decompose")


class ChoiceSpec(Model):
    """The collision shapes of a part in a format, with exactly one of the keys `shapes`, `decompose`."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1})

    shapes: Annotated[list[ContactShapeSpec], Field(min_length=1)] | None = optional([{"box": "40 20 10 mm"}])
    """The collision shapes, in the frame of the part."""
    decompose: DecomposeSpec | None = optional({"pieces": 8})
    """Decomposes the part into convex pieces."""

    def _check_rules(self) -> None:
        known = [key for key in ("kind", "shapes", "decompose") if key in type(self).model_fields]
        if given_keys(self, known) or not any(getattr(self, key, None) for key in ("targets", "modes")):
            require_one(self, known, "collision shapes", "write, for example, `collision: {shapes: [{box: 40 20 10 mm}]}`")


class TargetChoicesSpec(Model):
    """The collision shapes of a part in single formats."""

    mjcf: Collision | ChoiceSpec | None = optional("box", {"decompose": {"pieces": 8}})
    """The shapes in MuJoCo models."""
    urdf: Collision | ChoiceSpec | None = optional("box", {"decompose": {"pieces": 8}})
    """The shapes in URDF files and ROS packages."""
    sdf: Collision | ChoiceSpec | None = optional("box", {"decompose": {"pieces": 8}})
    """The shapes in SDF files."""
    usd: Collision | ChoiceSpec | None = optional("box", {"decompose": {"pieces": 8}})
    """The shapes in USD files."""


class CollisionSpec(ChoiceSpec):
    """The collision shapes of a part, in long form, with exactly one of the keys `kind`, `shapes`, `decompose`."""

    kind: Collision | None = None
    """The kind of collision shape; default with `targets` or `modes`: `hull`."""
    targets: TargetChoicesSpec | None = optional({"mjcf": {"decompose": {"pieces": 8}}, "urdf": "box"})
    """The collision shapes in single formats."""
    modes: dict[ModeField, Collision | ChoiceSpec] = Field(default={}, examples=[{"bench": "none", "walking": "box"}])
    """The collision shapes in single modes of this document."""

    @property
    def variants(self) -> dict[tuple[str, ...], Collision | ChoiceSpec]:
        """The collision shapes in single formats and modes, by their path below `collision`."""
        keys = (("targets", dict(self.targets or ())), ("modes", self.modes))
        return {(key, name): value for key, values in keys for name, value in values.items() if value is not None}
