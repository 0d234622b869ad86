"""Collect the visual and collision shapes of each occurrence for any target, and compute the size of a robot.

The shapes are primitives, or meshes that all occurrences of a definition share. They are the same in every mode, and are therefore
computed only once. Meshes are copied from the store by their hash, and are not parsed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Literal

from msgspec.structs import replace

from thingc.base import numeric
from thingc.base.diagnostics import Code, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import inf, maximum, minimum
from thingc.base.pose import NO_POSE, Pose, Vector
from thingc.base.primitives import Primitive, PrimitiveShape
from thingc.base.source import Origin
from thingc.geometry.record import Mesh, PartDefinition
from thingc.model.assembly.types import Assembly, Occurrence, Surface
from thingc.model.resolve.types import Material
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss, StoredArtifact

INFINITE_HALF = 100.0
"""Half of the side length [m] of a plane that replaces an infinite plane. Some formats do not support infinite planes."""


class MeshAsset(FrozenStruct):
    """A mesh that a target writes to its own file.

    `mesh` is the mesh in the store (OBJ) [m], and `volume` is the volume of the part [m^3]. `origin` is the location in the documents of
    the first occurrence that uses the mesh. `original` is the content of the original mesh file, which replaces `mesh` if it is not None.
    `scale` contains the factors that convert the original mesh to metres.
    """

    name: str
    mesh: Mesh
    volume: float
    origin: Origin
    original: StoredArtifact | None = None
    scale: Vector | None = None

    @property
    def file(self) -> str:
        """Return the file name of the mesh."""
        return f"{self.name}.obj" if self.original is None else self.name

    @property
    def stored(self) -> StoredArtifact:
        """Return the content of the mesh file as a reference to the store."""
        return self.original or StoredArtifact(sha256=self.mesh.sha256, size=self.mesh.size)


class Shape(FrozenStruct):
    """A shape in the frame of its occurrence: a mesh with the name `mesh`, or a primitive with a `size` [m] as in `Primitive`.

    `name` is the name that the document gives to the shape, prefixed with the path of its assembly, or None. `origin` is the location of a
    shape that a document lists.
    """

    kind: Literal["mesh"] | PrimitiveShape
    mesh: str | None = None
    size: tuple[float, ...] = ()
    pose: Pose = NO_POSE
    material: Material | None = None
    color: str | None = None
    name: str | None = None
    origin: Origin = ()


class Shapes(FrozenStruct):
    """The visual and collision shapes of the occurrence at `path`."""

    path: str
    origin: Origin
    visual: tuple[Shape, ...]
    collision: tuple[Shape, ...]


class Geometry(FrozenStruct):
    """The visual and collision geometry of an assembly. `shapes[i]` contains the shapes of occurrence i. Mesh assets are in the order in
    which they are first used. `modes` contains the shapes of modes with other collision shapes.
    """

    shapes: tuple[Shapes, ...]
    meshes: tuple[MeshAsset, ...]
    modes: dict[str, tuple[Shapes, ...]] = {}

    def in_mode(self, mode: str) -> Geometry:
        """Return the geometry with the shapes of a mode."""
        return replace(self, shapes=self.modes[mode]) if mode in self.modes else self

    @property
    def assets(self) -> dict[str, StoredArtifact]:
        """Return the contents of all mesh files, by file name."""
        return {mesh.file: mesh.stored for mesh in self.meshes}


def material_name(material: Material | None, color: str | None) -> str | None:
    """Return the name of a visual material, such as `petg_e6e6fa`. Return None if the shape has no colour.

    The name contains the material and the colour, because a material may have several colours.
    """
    if color is None:
        return None
    return f"{material.name if material is not None else 'color'}_{color.removeprefix('#')}"


def materials(shapes: Iterable[Shapes]) -> dict[str, tuple[str, Origin]]:
    """Return the colour and the source location of each visual material, keyed by name, in the order of first use."""
    named: dict[str, tuple[str, Origin]] = {}
    for owner in shapes:
        for shape in owner.visual:
            name = material_name(shape.material, shape.color)
            if name is not None and shape.color is not None:
                named.setdefault(name, (shape.color, shape.material.origin if shape.material is not None else owner.origin))
    return named


def name_with_index(name: str, index: int) -> str:
    """Return a name with its index appended, such as `hand/cap_1` for index 1. If the index is 0, return the name unchanged."""
    return f"{name}_{index}" if index else name


def named_shapes(shapes: Iterable[Shape], default: str) -> Iterator[tuple[str, Shape]]:
    """Yield each shape with a unique name: its custom name, or the name `default` with a number if it has none or the name is in use."""
    used: set[str | None] = {None}
    for index, shape in enumerate(shapes):
        yield name_with_index(default, index) if shape.name in used else shape.name or "", shape
        used.add(shape.name)


def report_same_file(occurrence: Occurrence, owner: Occurrence, path: str, report: Report) -> None:
    """Report that two occurrences with different definitions would be written as the same file."""
    label, other_label = occurrence.definition.label, owner.definition.label
    report.add(
        Code.SAME_FILE, f"`{label}` and `{other_label}` have the same file name (`{path}`)", occurrence.origin, path=occurrence.path,
        help="rename one of the two files", notes=[Note(message=f"`{other_label}` is used here", span=next(iter(owner.origin), None))],
    )


def channels(color: str) -> tuple[float, float, float, float]:
    """Convert a colour `#rrggbb` or `#rrggbbaa` to red, green, blue and opacity, each from 0 to 1."""
    digits = color.removeprefix("#")
    red, green, blue, alpha = (int(digits[k : k + 2] or "ff", 16) / 255.0 for k in range(0, 8, 2))
    return red, green, blue, alpha


def can_collide(piece: Mesh | Primitive) -> bool:
    """Return whether a shape can collide. A shape can collide if it has a volume or is a plane."""
    return not piece.flat if isinstance(piece, Mesh) else piece.shape == "plane" or numeric.minimum(piece.size) > 0.0


def linear(channel: float) -> float:
    """Convert a channel of an sRGB colour, from 0 to 1, to linear light (IEC 61966-2-1)."""
    return round(channel / 12.92 if channel <= 0.04045 else ((channel + 0.055) / 1.055) ** 2.4, 6)


def collect_geometry(
    assembly: Assembly, target: str, folder: str, report: Report, *, original: bool = False,
    describe_flat: Callable[[Mesh | Primitive], str] = lambda _: "the collision shape has no volume",
) -> tuple[Geometry, list[Loss]]:
    """Compute the visual and collision shapes of every occurrence. Also return the export losses of collision shapes without a volume.

    If `original` is True, the contents of original mesh files are used where available. If meshes of two definitions have the same file
    name in `folder`, an error is reported. `describe_flat` returns the reason why a shape cannot collide, for the export loss.
    """
    collector = _Collector(target, folder, report, original, describe_flat)
    shapes = tuple(collector.shapes(occurrence) for occurrence in assembly.occurrences)
    variants = {mode.name: variant for mode in assembly.modes if (variant := assembly.in_mode(mode.name)) is not assembly}
    modes = {name: tuple(collector.shapes(occurrence) for occurrence in variant.occurrences) for name, variant in variants.items()}
    return Geometry(shapes=shapes, meshes=tuple(collector.meshes.values()), modes=modes), collector.losses


class _Collector:
    def __init__(self, target: str, folder: str, report: Report, original: bool, describe_flat: Callable[[Mesh | Primitive], str]) -> None:
        self.target = target
        self.folder = folder
        self.report = report
        self.original = original
        self.describe_flat = describe_flat
        self.losses: list[Loss] = []
        self.meshes: dict[str, MeshAsset] = {}
        self.owners: dict[str, Occurrence] = {}

    def shapes(self, occurrence: Occurrence) -> Shapes:
        definition = occurrence.component.definition
        stem = definition.stem if occurrence.listed is None and isinstance(definition, PartDefinition) else ""
        surfaces = [self.shape(occurrence, surface, surface.name or stem) for surface in occurrence.drawn]
        visual = tuple(shape for shape in surfaces if shape is not None)
        return Shapes(path=occurrence.path, origin=occurrence.origin, visual=visual, collision=tuple(self.collision(occurrence, stem)))

    def collision(self, occurrence: Occurrence, stem: str) -> Iterator[Shape]:
        """Yield the collision shapes of an occurrence: the shapes that a document lists, or the shapes that `collision:` selects.

        There is one shape for each piece that can collide.
        """
        choice = occurrence.overrides.collision
        for index, piece in enumerate(occurrence.touching):
            if not can_collide(piece.solid):
                what = f"the contacts: {self.describe_flat(piece.solid)}"
                self.losses.append(Loss(self.target, None, occurrence.path, what, "omitted", occurrence.origin))
                continue
            kind = f"convex{occurrence.overrides.pieces or ''}" if choice == "decompose" else choice
            suffix = f"_{kind}" if choice in ("hull", "mesh") else f"_{kind}_{index}"
            shape = self.shape(occurrence, piece, piece.name or stem, "" if piece.name else suffix)
            if shape is not None:
                yield shape

    def shape(self, occurrence: Occurrence, surface: Surface, stem: str, suffix: str = "") -> Shape | None:
        """Convert a mesh or a primitive to a shape in the frame of its occurrence. A mesh gets the name `stem + suffix`.

        If another definition uses the same file name, report an error and return None.
        """
        mesh, title = surface.solid, occurrence.name_in_files(surface)
        shape = Shape(kind="mesh", pose=surface.pose, material=surface.material, color=surface.color, name=title, origin=surface.origin)
        if isinstance(mesh, Primitive):
            return replace(shape, kind=mesh.shape, size=mesh.size, pose=mesh.pose)
        name = stem + suffix
        owner = self.owners.setdefault(name.casefold(), occurrence)
        existing = self.meshes.get(name)
        shared = bool(surface.name) and existing is not None and existing.mesh == mesh  # a mesh file that several components list
        if owner.definition != occurrence.definition and not shared:
            report_same_file(occurrence, owner, f"{self.folder}/{stem}.obj", self.report)
            return None
        original = StoredArtifact(sha256=surface.own[0], size=surface.own[1]) if self.original and surface.own is not None else None
        self.meshes.setdefault(name, MeshAsset(
            name=name, mesh=mesh, volume=occurrence.record.volume if occurrence.record is not None and not surface.name else surface.volume,
            origin=occurrence.origin, original=original, scale=surface.scale,
        ))
        return replace(shape, mesh=name)


Box = tuple[Vector, Vector]
"""A bounding box, as its lower and its upper corner [m]."""


def placements(robot: Robot) -> tuple[tuple[tuple[int | None, Pose], ...], tuple[tuple[tuple[Pose, Box | None], ...], ...]]:
    """Return two tuples: the parent and the pose of every body, and the pose and the bounding box of each part of the body."""
    links, occurrences = robot.assembly.links, robot.assembly.occurrences
    boxes = tuple(occurrence.box for occurrence in occurrences)
    return tuple((body.parent, body.X_PL) for body in robot.bodies), tuple(
        tuple((pose, boxes[member]) for member, pose in zip(links[body.link].members, links[body.link].poses, strict=True))
        for body in robot.bodies
    )


def bounds(bodies: Sequence[tuple[int | None, Pose]], parts: Sequence[Sequence[tuple[Pose, Box | None]]]) -> Box | None:
    """Compute the bounding box [m] of the robot in the world at q = 0 from the bounding boxes of its parts. Return None if the robot has no
    geometry.

    The minimum of a coordinate of a rotated box is the sum of the minima of its three terms (Arvo, "Transforming axis-aligned bounding
    boxes", Graphics Gems, 1990).
    """
    low, high = [inf] * 3, [-inf] * 3
    poses: list[Pose] = []
    for (parent, X_PL), body_parts in zip(bodies, parts, strict=True):
        body_pose = (NO_POSE if parent is None else poses[parent]) @ X_PL
        poses.append(body_pose)
        for pose, box in body_parts:
            if box is None:
                continue
            X_WP = body_pose @ pose
            for axis, (row, origin) in enumerate(zip(X_WP.rotation, X_WP.translation, strict=True)):
                ends = [(a * low_end, a * high_end) for a, low_end, high_end in zip(row, *box, strict=True)]
                low[axis] = minimum(low[axis], minimum(ends[0]) + minimum(ends[1]) + minimum(ends[2]) + origin)
                high[axis] = maximum(high[axis], maximum(ends[0]) + maximum(ends[1]) + maximum(ends[2]) + origin)
    if low[0] > high[0]:
        return None
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
