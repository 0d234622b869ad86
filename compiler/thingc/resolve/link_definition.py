"""What a link is: a component whose geometry is listed, shape by shape, and modelled by nobody."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

from thingc.brief import Brief, counted
from thingc.frozen import dataclass
from thingc.mirror import Mirror
from thingc.primitives import Primitive
from thingc.realize.record import with_mirror

if TYPE_CHECKING:
    from thingc.resolve.model import Material

NAMED = 3
"""How many shapes a label names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedShape(Brief):
    """A shape of a link, in its frame: whether it is `drawn`, and whether it `touches`. `material` and `color` (`#rrggbb`) are what the
    shape itself says; None: as its link, and its material, have it."""

    solid: Primitive
    drawn: bool
    touches: bool
    material: Material | None = None
    color: str | None = None

    @property
    def word(self) -> str:
        """What it is, for people."""
        return self.solid.shape

    @property
    def said(self) -> tuple[object, ...]:
        """All that it says, as plain values."""
        solid, material = self.solid, self.material.name if self.material is not None else None
        return (
            solid.shape, solid.size, solid.pose.rotation, solid.pose.translation, self.drawn, self.touches, material, self.color,
        )

    def mirrored(self, mirror: Mirror) -> ListedShape:
        """Its mirror image: every primitive is the image of itself, in a frame that is mirrored."""
        return replace(self, solid=replace(self.solid, pose=mirror.frame(self.solid.pose)))


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkDefinition(Brief):
    """The shapes of a link: equal ones are one node of the HAG. `text` is `link-` and 12 hex of the SHA-256 of what it lists (`link`
    where that is nothing), `label` for people. Of a mirror image `mirror` is the axis of its frame, `plain` what it mirrors."""

    shapes: tuple[ListedShape, ...]
    text: str
    label: str
    mirror: str | None = None
    plain: LinkDefinition | None = None

    def mirrored(self, axis: str) -> LinkDefinition:
        """The definition of the mirror image at the plane normal to `axis` (`x | y | z`) of the link's frame."""
        mirror = Mirror(axis)
        return replace(
            self, shapes=tuple(shape.mirrored(mirror) for shape in self.shapes), text=with_mirror(self.text, axis),
            label=with_mirror(self.label, axis), mirror=axis, plain=self,
        )


def link_of(shapes: tuple[ListedShape, ...]) -> LinkDefinition:
    """The definition of a link with these shapes."""
    if not shapes:
        return LinkDefinition(shapes=(), text="link", label="link")
    digest = hashlib.sha256(repr([one.said for one in shapes]).encode()).hexdigest()[:12]
    listed = ", ".join(one.word for one in shapes) if len(shapes) <= NAMED else counted(len(shapes), "shape")
    return LinkDefinition(shapes=shapes, text=f"link-{digest}", label=f"link ({listed})")
