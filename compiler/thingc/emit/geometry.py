"""What of each occurrence MuJoCo shall draw and touch: mesh assets shared by definition, and shapes per occurrence.

The same in every mode, so it is worked out once. Meshes go from the store into the build by name, unread.
"""

from __future__ import annotations

from dataclasses import dataclass

from thingc.diagnostics import Code, Note, Report
from thingc.emit.artifact import Loss, Stored
from thingc.graph.types import Assembly, Occurrence
from thingc.memo import Memo
from thingc.pose import NO_POSE, Pose
from thingc.realize.record import Mesh, PartDefinition, Primitive
from thingc.resolve.model import Material
from thingc.source import Origin

STL_FACES = 200_000
"""The most faces that MuJoCo reads from an STL file (`stl_decoder`); it has no such bound for OBJ."""

ABSENT = {
    "decompose": "there is no convex decomposition of it", "part": "its Thing has no `collision()`", "hull": "it has no hull",
    "mesh": "it has no mesh",
}
"""Why there is no shape, by what `collision` chose."""

PIECES = {"decompose": "convex"}
"""What the files of pieces are called where that is not what `collision` chose."""


LEAST_VOLUME = 1e-14
"""Of a part [m^3]: MuJoCo refuses solid meshes of up to 1e-15 (mjMINVAL), and a mesh holds somewhat less than its part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshAsset:
    """A mesh asset: its name, its file in `assets/`, where its bytes lie, and whether MuJoCo must take it as a surface
    (`inertia="shell"`), which it must where the mesh encloses no volume, or almost none."""

    name: str
    file: str
    stored: Stored
    shell: bool
    origin: Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A geom in its occurrence's frame: `kind` `mesh` (named by `mesh`) or a primitive of `size`, both as MuJoCo's [m]."""

    kind: str
    mesh: str | None = None
    size: tuple[float, ...] = ()
    pose: Pose = NO_POSE


@dataclass(frozen=True, slots=True, kw_only=True)
class Shapes:
    """Of one occurrence, at `path`: what is drawn (None: nothing) and what collides, of what material, in what colour."""

    path: str
    origin: Origin
    material: Material | None
    color: str | None
    visual: Shape | None
    collision: tuple[Shape, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry:
    """Of an assembly: `shapes[i]` of occurrence i, the mesh assets in the order first met, and what was lost."""

    shapes: tuple[Shapes, ...]
    meshes: tuple[MeshAsset, ...]
    losses: tuple[Loss, ...]

    @property
    def assets(self) -> dict[str, Stored]:
        """Where the bytes of each file in `assets/` lie."""
        return {mesh.file: mesh.stored for mesh in self.meshes}


def geometry(assembly: Assembly, report: Report, memo: Memo | None = None) -> Geometry:
    """The geometry of every occurrence; what MuJoCo cannot take is reported, what it takes differently is a loss."""
    inputs = tuple(
        (
            one.path, one.definition, one.record, one.component.definition, one.overrides.collision, one.overrides.visual,
            one.material, one.color, one.origin,
        )
        for one in assembly.occurrences
    )
    found, said = (memo or Memo())("geometry", lambda _: _collected(assembly), inputs)
    for diagnostic in said.diagnostics:
        report.say(diagnostic)
    return found


def _collected(assembly: Assembly) -> tuple[Geometry, Report]:
    report = Report()
    return _Collector(report).collect(assembly), report


class _Collector:
    def __init__(self, report: Report) -> None:
        self.report = report
        self.meshes: dict[str, MeshAsset] = {}
        self.owners: dict[str, Occurrence] = {}
        self.losses: list[Loss] = []

    def collect(self, assembly: Assembly) -> Geometry:
        shapes = tuple(self.shapes(occurrence) for occurrence in assembly.occurrences)
        return Geometry(shapes=shapes, meshes=tuple(self.meshes.values()), losses=tuple(self.losses))

    def shapes(self, occurrence: Occurrence) -> Shapes:
        record, definition = occurrence.record, occurrence.component.definition
        drawn: Shape | None = None
        touching: tuple[Shape, ...] = ()
        if record is not None and record.meshes and isinstance(definition, PartDefinition):
            visual = record.meshes.get("visual") if occurrence.overrides.visual else None
            drawn = self.mesh(occurrence, definition.stem, "", "obj", visual) if visual is not None else None
            touching = self.collision(occurrence, definition.stem)
        return Shapes(
            path=occurrence.path, origin=occurrence.origin, material=occurrence.material, color=occurrence.color, visual=drawn,
            collision=touching,
        )

    def collision(self, occurrence: Occurrence, stem: str) -> tuple[Shape, ...]:
        """What `collision:` chose for an occurrence: one shape per piece that can collide."""
        choice = occurrence.overrides.collision
        if choice == "none":
            return ()
        pieces = occurrence.touching
        if not pieces:
            return self.missing(occurrence, ABSENT.get(choice, f"no {choice} could be fitted to it"))
        if choice == "mesh":
            self.lose(occurrence, "its collision mesh: MuJoCo touches the convex hull of a mesh", "approximated")
        shapes: list[Shape] = []
        for index, piece in enumerate(pieces):
            suffix = f"_{choice}" if choice in ("hull", "mesh") else f"_{PIECES.get(choice, choice)}_{index}"
            if isinstance(piece, Primitive):
                if min(piece.size) > 0.0:
                    shapes.append(_primitive(piece))
                else:
                    self.flat(occurrence, f"the {choice} that encloses it has no volume")
            elif piece.flat:
                self.flat(occurrence, "the points of its collision mesh lie in one plane")
            elif piece.faces > STL_FACES:
                self.report.add(
                    Code.MESH_TOO_LARGE,
                    f"`{occurrence.path}` ({occurrence.definition.label}) has a collision mesh of {piece.faces} faces, and MuJoCo "
                    f"reads at most {STL_FACES}",
                    occurrence.origin,
                    path=occurrence.path,
                    help="write `collision: hull`, or give the workspace a coarser `mesh`",
                )
            else:
                shape = self.mesh(occurrence, stem, suffix, "stl", piece)
                if shape is not None:
                    shapes.append(shape)
        return tuple(shapes)

    def mesh(self, occurrence: Occurrence, stem: str, suffix: str, extension: str, mesh: Mesh) -> Shape | None:
        """The shape of a mesh in the part's own frame; its asset is kept. None when another definition has its file name."""
        name = stem + suffix
        owner = self.owners.setdefault(name.casefold(), occurrence)
        if owner.definition != occurrence.definition:
            self.report.add(
                Code.SAME_FILE,
                f"`{occurrence.definition.label}` and `{owner.definition.label}` would both be written as `mjcf/assets/{stem}.obj`",
                occurrence.origin,
                path=occurrence.path,
                help="rename one of the two files",
                notes=[Note(message=f"`{owner.definition.label}` is used here", span=next(iter(owner.origin), None))],
            )
            return None
        self.meshes.setdefault(name, MeshAsset(
            name=name,
            file=f"{name}.{extension}",
            stored=Stored(sha256=mesh.sha256, size=mesh.size),
            shell=mesh.flat or not mesh.closed or (occurrence.record is not None and occurrence.record.volume < LEAST_VOLUME),
            origin=occurrence.origin,
        ))
        return Shape(kind="mesh", mesh=name)

    def missing(self, occurrence: Occurrence, why: str) -> tuple[Shape, ...]:
        choice = occurrence.overrides.collision
        self.report.add(
            Code.COLLISION_MISSING,
            f"`{occurrence.path}` ({occurrence.definition.label}) asks for `collision: {choice}`, but {why}",
            occurrence.origin,
            path=occurrence.path,
            help="write `collision: hull`, or `none` if it shall touch nothing",
        )
        return ()

    def flat(self, occurrence: Occurrence, why: str) -> tuple[Shape, ...]:
        self.lose(occurrence, f"its contacts: {why}, and MuJoCo needs a solid to touch", "omitted")
        return ()

    def lose(self, occurrence: Occurrence, what: str, how: str) -> None:
        span = next(iter(occurrence.origin), None)
        self.losses.append(Loss(target="mjcf", mode=None, path=occurrence.path, what=what, how=how, span=span))


def _primitive(primitive: Primitive) -> Shape:
    return Shape(kind=primitive.shape, size=primitive.size, pose=primitive.pose)
