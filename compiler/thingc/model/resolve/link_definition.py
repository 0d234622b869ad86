"""Data types for links, which are components without a CAD model whose shapes are listed in the document."""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.one_line_repr import OneLineRepr, OneLineStruct, format_count
from thingc.base.pose import NO_POSE, Mirror, Pose
from thingc.base.primitives import Primitive
from thingc.base.source import Origin
from thingc.geometry.meshes.files import MeshFile
from thingc.geometry.record import with_mirror

if TYPE_CHECKING:
    from thingc.model.resolve.types import Material

NAMED = 3
"""Maximum number of shapes that the label of a link lists."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LinkShape(OneLineRepr):
    """A shape that a document lists for a link, in the frame of the link.

    If `drawn` is True, the shape is displayed. If `touches` is True, the shape can collide. `pose` is the pose of a mesh file. The pose of
    a primitive is part of the primitive. `material`, `color` (`#rrggbb`) and `friction` (sliding, torsional, rolling) override the values
    of the link and its material. A value of None does not override. `name` is the name of the shape in output files. `pieces` is the
    largest number of convex pieces into which a mesh file is decomposed for collisions: 0 for any number, None for its convex hull.
    """

    solid: Primitive | MeshFile
    drawn: bool
    touches: bool
    pose: Pose = NO_POSE
    material: Material | None = None
    color: str | None = None
    name: str | None = None
    pieces: int | None = None
    friction: tuple[float | None, float | None, float | None] = (None, None, None)
    origin: Origin = field(default=(), compare=False)

    @property
    def word(self) -> str:
        """The name of the shape in messages: the file name of a mesh, or the type of a primitive."""
        return self.solid.path if isinstance(self.solid, MeshFile) else self.solid.shape

    @property
    def content(self) -> tuple[object, ...]:
        """All properties of the shape as plain values. The text of the link's definition is computed from these values."""
        solid, material = self.solid, self.material.name if self.material is not None else None
        pose = self.pose if isinstance(solid, MeshFile) else solid.pose
        shape = (solid.path, *solid.content) if isinstance(solid, MeshFile) else (solid.shape, solid.size)
        return (*shape, pose.rotation, pose.translation, self.drawn, self.touches, material, self.color, self.friction,
                *([self.name] if self.name else []), *(["pieces", self.pieces] if self.pieces is not None else []))

    def mirror_image(self, mirror: Mirror) -> LinkShape:
        """Return the mirror image of the shape.

        A primitive is symmetric, so only its pose changes. A mesh file is mirrored when it is read.
        """
        if isinstance(self.solid, MeshFile):
            return dataclasses.replace(self, solid=replace(self.solid, scale=mirror.vector(self.solid.scale)), pose=mirror.frame(self.pose))
        return dataclasses.replace(self, solid=replace(self.solid, pose=mirror.frame(self.solid.pose)))


class LinkDefinition(OneLineStruct):
    """The definition of a link, which consists of a list of shapes. Equal definitions are one node of the hierarchical assembly graph.

    `text` is `link-` and 12 hex digits of the SHA-256 of the list of shapes (`link` if the list is empty). `label` is the display name. For
    a mirror image, `mirror` is the axis in the frame of the link, and `plain` is the original definition.
    """

    shapes: tuple[LinkShape, ...]
    text: str
    label: str
    mirror: str | None = None
    plain: LinkDefinition | None = None

    def mirror_image(self, axis: str) -> LinkDefinition:
        """Return the mirror image of the link. The mirror plane contains the origin of the link and is normal to `axis` (`x | y | z`)."""
        mirror = Mirror(axis)
        return replace(
            self, shapes=tuple(shape.mirror_image(mirror) for shape in self.shapes), text=with_mirror(self.text, axis),
            label=with_mirror(self.label, axis), mirror=axis, plain=self,
        )


def mesh_files_of(definition: object) -> tuple[MeshFile, ...]:
    """Return the mesh files that a link lists, or an empty tuple for other definitions."""
    shapes = definition.shapes if isinstance(definition, LinkDefinition) else ()
    return tuple(dict.fromkeys(shape.solid for shape in shapes if isinstance(shape.solid, MeshFile)))


def link_of(shapes: tuple[LinkShape, ...]) -> LinkDefinition:
    """Create the definition of a link from a list of shapes."""
    if not shapes:
        return LinkDefinition(shapes=(), text="link", label="link")
    digest = hashlib.sha256(repr([shape.content for shape in shapes]).encode()).hexdigest()[:12]
    listed = ", ".join(shape.word for shape in shapes) if len(shapes) <= NAMED else format_count(len(shapes), "shape")
    return LinkDefinition(shapes=shapes, text=f"link-{digest}", label=f"link ({listed})")
