"""Import the STEP file of an assembly: one document per assembly, one STEP file per part, and a document of materials.

Parts get mounts at unambiguous features: bolt circles, through holes and planar faces.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence

from msgspec import convert

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import without_suffix
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.installed_packages import package_folder
from thingc.base.numeric import dist
from thingc.base.pose import Pose, Vector, add_scaled, along, dot
from thingc.base.safe_text import quote_names
from thingc.base.source import MappingNode, node_at
from thingc.documents.format.formatting import format_document
from thingc.documents.load.documents import read_tree
from thingc.geometry.client import begin_once
from thingc.geometry.features import Cylinder, Features, PlanarFace
from thingc.geometry.store.local import Store
from thingc.tools.importing.document_names import UsedNames, plain_name
from thingc.tools.importing.import_request import refuse_unreadable
from thingc.tools.importing.quantities import pose_words, quantity, was
from thingc.tools.importing.step_assembly import StepAssembly, StepChild, StepPart

MOST_MOUNTS = 12
"""Maximum number of mounts of a part."""
_NEAR = 1e-6
_SMALL_FACE = 0.2
"""Planar faces that are smaller than this fraction of the largest planar face do not get a mount."""


class FeatureMount(FrozenStruct):
    """A mount at a feature of a part. Its z axis points out of the material. `what` describes the feature."""

    name: str
    pose: Pose
    what: str


def feature_mounts(features: Features) -> tuple[FeatureMount, ...]:
    """Return mounts for the bolt circles, the other through holes, and the planar faces of a part, at most `MOST_MOUNTS`.

    The origin is at the end of a hole in the direction of the hole's axis, which points along the last coordinate axis that it is not
    perpendicular to. A planar face gets a mount if it is the only outermost face in its direction.
    """
    holes = [one for one in features.cylinders if one.through]
    mounts: list[FeatureMount] = []
    for number, circle in enumerate(_circles(holes), 1):
        first = circle[0]
        line, centre = first.line, _mean([one.line.point for one in circle])
        radius = dist(centre, line.point)
        words = f"bolt circle: {len(circle)} holes of {_mm(2.0 * first.radius)} mm on {_mm(2.0 * radius)} mm"
        mounts.append(FeatureMount(name=f"bolts_{number}", pose=along(line.axis, add_scaled(centre, line.axis, first.upper)), what=words))
        holes = [one for one in holes if one not in circle]
    for number, hole in enumerate(holes, 1):
        pose = along(hole.line.axis, add_scaled(hole.line.point, hole.line.axis, hole.upper))
        mounts.append(FeatureMount(name=f"hole_{number}", pose=pose, what=f"through hole of {_mm(2.0 * hole.radius)} mm"))
    for number, face in enumerate(_outermost(features.planes), 1):
        mounts.append(FeatureMount(name=f"face_{number}", pose=along(face.normal, face.centre), what="planar face"))
    return tuple(mounts[:MOST_MOUNTS])


def _circles(holes: Sequence[Cylinder]) -> Iterator[list[Cylinder]]:
    """Yield groups of at least three equal holes whose axes are on one circle around the centre of the group."""
    equal = group_by(holes, lambda hole: (hole.line.axis, *(round(value, 7) for value in (hole.radius, hole.lower, hole.upper))))
    for group in equal.values():
        centre = _mean([hole.line.point for hole in group])
        rings: dict[float, list[Cylinder]] = {}
        for hole in group:
            rings.setdefault(round(dist(centre, hole.line.point), 6), []).append(hole)
        for ring in rings.values():
            if len(ring) >= 3 and dist(_mean([hole.line.point for hole in ring]), centre) < _NEAR:
                yield ring


def _outermost(planes: Sequence[PlanarFace]) -> Iterator[PlanarFace]:
    largest = max((face.area for face in planes), default=0.0)
    for face in planes:
        parallel = [other for other in planes if other is not face and dist(other.normal, face.normal) < _NEAR]
        height = dot(face.normal, face.centre)
        if face.area >= _SMALL_FACE * largest and all(dot(face.normal, other.centre) < height - _NEAR for other in parallel):
            yield face


def _mean(points: Sequence[Vector]) -> Vector:
    x, y, z = (math.fsum(values) / len(points) for values in zip(*points, strict=True))
    return (x, y, z)


def _mm(length: float) -> str:
    return f"{1000.0 * length:.6g}"


READER = "thingc.tools.kernel.step_reader:read_step_assembly"
"""The function that reads the file in a worker process."""
TIME_LIMIT = 600.0
"""Time limit [s] for reading a file."""
UNKNOWN = "unspecified"
"""The material of parts whose material is not known."""
UNKNOWN_DENSITY = 1000.0
MATERIALS = "materials.yaml"
STOCK = "thingc_stock.materials"


class ImportedAssembly(FrozenStruct):
    """An imported STEP assembly. `name` is the name of the outermost document, and `files` maps paths to contents.

    `notes` lists everything that is not in the documents, or that was assumed.
    """

    name: str
    files: Mapping[str, bytes]
    assembly: StepAssembly
    notes: tuple[str, ...]


def import_step(path: str, store: Store, report: Report) -> ImportedAssembly | None:
    """Import a STEP assembly. If the file cannot be imported, report an error and return None."""
    name = os.path.basename(path)
    try:
        with open(path, "rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as fault:
        refuse_unreadable(path, fault, (".step", ".stp"), report)
        return None
    store.check()
    request = {"op": "call", "function": READER, "arguments": [os.path.abspath(path)], "store": store.root, "timeout": TIME_LIMIT}
    answer = begin_once(request)()
    refused = answer["answer"].get("refused") if "answer" in answer else f"the CAD kernel cannot read the file ({answer['failed']})"
    if refused is not None:
        flat = "no assembly structure" in refused
        help = f"to use the file as one part, write `{{file: {name}}}` in a document" if flat else "export the assembly again as STEP"
        report.add(Code.SOURCE_XML, f"`{name}`: {refused}", None, help=help, detail=answer.get("detail"))
        return None
    return StepDocuments(convert(answer["answer"]["assembly"], StepAssembly), name, digest, store).imported_assembly()


class StepDocuments:
    """Writes the documents of a STEP assembly. `source` is the name of the STEP file."""

    def __init__(self, assembly: StepAssembly, source: str, digest: str, store: Store) -> None:
        self.assembly, self.source, self.digest, self.store = assembly, source, digest, store
        stem = plain_name(without_suffix(source), "robot")
        groups = [group.name if group.name.strip() else stem for group in assembly.assemblies]
        # the outermost assembly is last, and has precedence over nested assemblies of the same name
        self.documents = distinct_words(groups[::-1], "assembly", [without_suffix(MATERIALS)])[::-1]
        self.files = distinct_words([part.name for part in assembly.parts], "part")
        self.mounts = [feature_mounts(part.features) for part in assembly.parts]
        self.components = [distinct_words([child.name for child in group.children], "part") for group in assembly.assemblies]
        self.stock = stock_materials()

    def imported_assembly(self) -> ImportedAssembly:
        """Return the contents of all files."""
        assembly = self.assembly
        files = {f"{self.documents[number]}.yaml": self._document(number) for number in range(len(assembly.assemblies))}
        files |= {f"parts/{self.files[number]}.step": self.store.read(part.sha256) for number, part in enumerate(assembly.parts)}
        materials = [*self._materials()]
        files |= {MATERIALS: "\n".join(("thingc: materials/1", "materials:", *materials, "")).encode()} if materials else {}
        notes = tuple(self._notes())
        files["import.json"] = self._record(notes)
        return ImportedAssembly(name=self.documents[assembly.root], files=files, assembly=assembly, notes=notes)

    def frame(self, child: StepChild) -> Pose:
        """Return the pose of the frame of a component in its assembly.

        The frame of a nested document is the frame of its first component, which the document does not place.
        """
        if child.assembly is None:
            return child.pose
        return child.pose @ self.frame(self.assembly.assemblies[child.assembly].children[0])

    def _document(self, number: int) -> bytes:
        assembly, group, names = self.assembly, self.assembly.assemblies[number], self.components[number]
        base = self.frame(group.children[0]).inverse()
        lines = [f"# From {json.dumps(self.source, ensure_ascii=False)}.", "thingc: assembly/1", f"name: {self.documents[number]}"]
        used = {self._material(assembly.parts[child.part]) for child in group.children if child.part is not None}
        lists = [STOCK] * (not used.isdisjoint(self.stock)) + [MATERIALS] * bool(used.difference(self.stock))
        lines += [f"materials: [{', '.join(lists)}]"] if lists else []
        lines.append("components:")
        for child, name in zip(group.children, names, strict=True):
            pose = pose_words(base @ self.frame(child), before=", ")
            lines.append(f"  {name}:{was(name, child.name)}")
            if child.assembly is not None:
                lines.append(f"    assembly: {self.documents[child.assembly]}.yaml")
            elif child.part is not None:
                lines.append(f"    file: parts/{self.files[child.part]}.step")
                lines.append(f"    material: {self._material(assembly.parts[child.part])}")
            lines += [] if name == names[0] else [f"    at: {{in: {names[0]}.origin{pose}}}"]
            if child.part is not None and (mounts := self.mounts[child.part]):
                lines += ["    mounts:", *(f"      {mount.name}: {{{pose_words(mount.pose)}}}  # {mount.what}" for mount in mounts)]
        if number == self.assembly.root:
            lines += ["modes:", f"  source: {{root: {self._base(number)}, base: fixed}}"]
        report = Report()
        formatted = format_document(f"{self.documents[number]}.yaml", "\n".join((*lines, "")).encode(), report)
        assert formatted is not None, report.diagnostics
        return formatted

    def _base(self, number: int) -> str:
        """Return the path of the first part of an assembly."""
        first, name = self.assembly.assemblies[number].children[0], self.components[number][0]
        return name if first.assembly is None else f"{name}.{self._base(first.assembly)}"

    def _material(self, part: StepPart) -> str:
        """Return the name of the material of a part: a material of `thingc_stock`, or a material with a density in the file."""
        word = plain_name(part.material, "material").lower() if part.material else UNKNOWN
        return word if word in self.stock or part.density is not None else UNKNOWN

    def _materials(self) -> Iterator[str]:
        """Yield the lines of the materials that `thingc_stock` does not contain."""
        for word, density in sorted({self._material(part): part.density for part in self.assembly.parts}.items()):
            if word == UNKNOWN:
                yield f"  {word}: {{density: {quantity(UNKNOWN_DENSITY, 'kg/m^3')}}}  # assumed: the file does not specify the material"
            elif density is not None and word not in self.stock:
                yield f"  {word}: {{density: {quantity(density, 'kg/m^3')}}}"

    def _notes(self) -> Iterator[str]:
        """Yield a message for everything that is not in the documents, or that was assumed."""
        unknown = {self.files[number]: part.material for number, part in enumerate(self.assembly.parts) if self._material(part) == UNKNOWN}
        if unknown:
            parts = quote_names([f"{file} ({material})" if material else file for file, material in unknown.items()], 8)
            yield f"assumed density of {UNKNOWN_DENSITY:g} kg/m^3 (`{UNKNOWN}` in {MATERIALS}) for {parts}"
        for number, part in enumerate(self.assembly.parts):
            if len(part.colors) > 1:
                yield f"parts/{self.files[number]}.step: imported only the colour {part.colors[0]} of {len(part.colors)} colours"
        yield from (f"shape `{name}` without solids: omitted" for name in self.assembly.left_out)

    def _record(self, notes: tuple[str, ...]) -> bytes:
        """Return the content of `import.json`: the source, the names of all parts and mounts, and the notes."""
        parts = [
            {
                "file": f"parts/{self.files[number]}.step", "name": part.name, "colors": part.colors, "material": part.material,
                "also": sorted(name for name, of in self.assembly.merged.items() if of == part.name),
                "mounts": {one.name: one.what for one in self.mounts[number]},
            }
            for number, part in enumerate(self.assembly.parts)
        ]
        documents = [
            {
                "file": f"{self.documents[number]}.yaml", "name": group.name,
                "components": {word: child.name for word, child in zip(self.components[number], group.children, strict=True)},
            }
            for number, group in enumerate(self.assembly.assemblies)
        ]
        source = {"file": self.source, "sha256": self.digest}
        record = {"import": 1, "source": source, "documents": documents, "parts": parts, "notes": notes}
        return (json.dumps(record, indent=2, ensure_ascii=False) + "\n").encode()


def distinct_words(names: Sequence[str], kind: str, reserved: Sequence[str] = ()) -> list[str]:
    """Return a different document name for each of the names, which may be equal. Names that are empty get the name `kind`."""
    used = UsedNames(reserved)
    return [used.take(name.strip() or kind, kind) for name in names]


def stock_materials() -> frozenset[str]:
    """Return the names of the materials of `thingc_stock`, without running its code."""
    folder = package_folder(STOCK.partition(".")[0])
    if folder is None:
        return frozenset()
    with open(os.path.join(folder, "materials.yaml"), "rb") as stream:
        tree = read_tree("materials.yaml", stream.read(), Report())
    materials = node_at(tree, ("materials",)) if tree is not None else None
    return frozenset(materials.entries) if isinstance(materials, MappingNode) else frozenset()
