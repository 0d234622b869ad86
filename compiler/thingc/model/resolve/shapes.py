"""Resolve links, which are components whose geometry is a list of primitive shapes and mesh files in the document."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial

from thingc.base.diagnostics import Code
from thingc.base.pose import NO_POSE, Pose, Vector
from thingc.base.primitives import FARTHEST, Primitive
from thingc.base.source import Path
from thingc.base.units import LENGTH, NUMBER, parse_quantity, shorten
from thingc.documents.load.paths import MESH_SUFFIXES, SUFFIXES_WITH_UNIT, libraries, resolve_path
from thingc.documents.spec.link_shapes import ChoiceSpec, Collision, CollisionSpec, ContactShapeSpec, ShapeSpec
from thingc.documents.spec.sensors import VolumeSpec
from thingc.geometry.mesh_bounds import LARGEST
from thingc.geometry.meshes.files import MeshFile, mesh_file
from thingc.geometry.record import FILE_UNIT
from thingc.model.resolve.document_scope import ComponentScope, DocumentScope, ResolveRun
from thingc.model.resolve.link_definition import LinkDefinition, LinkShape, link_of
from thingc.model.resolve.materials import friction
from thingc.model.resolve.overrides import material, most_pieces
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.types import ChoicePath


def of_link(context: ResolveRun, table: DocumentScope, node: ComponentScope) -> LinkDefinition | None:
    """Create the definition of a component that is a `link`. If a shape of the link is invalid, report an error and return None."""
    return _resolve_shapes(context, table, node, node.spec.shapes, (*node.path, "shapes"))


def of_collision(context: ResolveRun, table: DocumentScope, node: ComponentScope) -> dict[ChoicePath, LinkDefinition]:
    """Create the lists of collision shapes of a component that is a part, by their path below `collision`.

    If a shape is invalid, which is reported, the list is omitted.
    """
    spec, path = node.spec.collision, (*node.path, "collision")
    if not isinstance(spec, CollisionSpec):
        return {}
    lists: dict[ChoicePath, LinkDefinition] = {}
    choices: dict[ChoicePath, Collision | ChoiceSpec] = {(): spec, **spec.variants}
    for inner, choice in choices.items():
        shapes = None if isinstance(choice, str) else choice.shapes
        listed = None if shapes is None else _resolve_shapes(context, table, node, shapes, (*path, *inner, "shapes"))
        if listed is not None:
            lists[inner] = listed if node.spec.mirror is None else listed.mirror_image(node.spec.mirror)
    return lists


def _resolve_shapes(
    context: ResolveRun, table: DocumentScope, node: ComponentScope, specs: Sequence[ContactShapeSpec], path: Path,
) -> LinkDefinition | None:
    shapes = [_shape(context, table, node.scope, spec, (*path, index)) for index, spec in enumerate(specs)]
    sound = tuple(shape for shape in shapes if shape is not None)
    return link_of(sound) if len(sound) == len(shapes) else None


def _shape(context: ResolveRun, table: DocumentScope, scope: Scope, spec: ContactShapeSpec, path: Path) -> LinkShape | None:
    pose = NO_POSE if spec.at is None else scope.pose(spec.at, (*path, "at"))
    solid = _mesh(context, scope, spec, path) if spec.mesh is not None else primitive(scope, spec, path, pose or NO_POSE)
    if solid is None or pose is None:
        return None
    use, color = (spec.for_, spec.color) if isinstance(spec, ShapeSpec) else ("collision", None)
    return LinkShape(
        solid=solid, pose=NO_POSE if isinstance(solid, Primitive) else pose, drawn=use != "collision", touches=use != "visual", color=color,
        pieces=None if spec.decompose is None else most_pieces(scope, spec.decompose, (*path, "decompose")),
        friction=friction(scope, spec.friction, (*path, "friction")), origin=scope.origin((*path, spec.kind)),
        material=material(scope, DefaultLayers(((spec, path),)), table.materials, unreadable=table.materials_unreadable), name=spec.name,
    )


def _mesh(context: ResolveRun, scope: Scope, spec: ContactShapeSpec, path: Path) -> MeshFile | None:
    """Return a mesh file with its scale.

    For an invalid entry, report an error and return None. For an unusable file, which `load` has reported, return None.
    """
    scale = _scale(scope, spec, path)
    absolute, workspace = resolve_path(spec.mesh or "", scope.document.path), context.workspace
    if scale is None or absolute is None or os.path.isabs(spec.mesh or "") or not workspace.contains(absolute):
        return None
    if not absolute.lower().endswith(MESH_SUFFIXES):
        return None
    try:
        stat = os.stat(absolute)
        if stat.st_size > LARGEST:
            scope.error(
                Code.TOO_LARGE, f"`{shorten(spec.mesh or '')}` has {stat.st_size // 1_000_000} MB (at most {LARGEST // 1_000_000} MB "
                "are allowed)", (*path, "mesh"), help="simplify the mesh to a few tens of thousands of triangles",
            )
            return None
        library_files = tuple(os.path.join(os.path.dirname(absolute), name) for name in libraries(absolute))
        times = tuple(os.stat(one).st_mtime_ns if os.path.isfile(one) else 0 for one in library_files)
        state = (stat.st_ino, stat.st_size, stat.st_mtime_ns, *times)
        return context.memo(("mesh", absolute, scale), partial(_file, scale, context.digest), absolute, workspace.relative(absolute), state)
    except OSError:
        return None


def _file(scale: Vector, digest: Callable[[str], str], absolute: str, path: str, _state: tuple[int, ...]) -> MeshFile:
    """Return a mesh file of a link.

    The argument `_state` is the state of the file on disk. The state is only used as a part of the cache key.
    """
    return mesh_file(absolute, path, scale, digest)


def _scale(scope: Scope, spec: ContactShapeSpec, path: Path) -> Vector | None:
    """Return the scale factors that convert the coordinates in a mesh file to metres.

    If a factor is invalid, report an error and return None.
    """
    at: Path = (*path, "scale")
    if isinstance(spec.scale, list):
        factors = [scope.number(factor, (*at, k), NUMBER, "a factor of `scale`") for k, factor in enumerate(spec.scale)]
    else:
        factors = [1.0 if spec.scale is None else scope.number(spec.scale, at, NUMBER, "`scale`")] * 3
    x, y, z = factors
    if x is None or y is None or z is None:
        return None
    if not x * y * z:
        scope.error(Code.OUT_OF_RANGE, "a factor of `scale` must not be 0", at, help="write, for example, `scale: [1, 1, -1]`")
        return None
    has_unit = spec.mesh is not None and spec.mesh.lower().endswith(SUFFIXES_WITH_UNIT)
    unit = 1.0 if has_unit else parse_quantity(f"1 {spec.unit or FILE_UNIT}").value
    return x * unit, y * unit, z * unit


def primitive(scope: Scope, spec: ContactShapeSpec | VolumeSpec, path: Path, pose: Pose) -> Primitive | None:
    """Create a primitive shape such as a box.

    The document specifies full lengths, and the primitive contains half lengths. If a length is invalid, report an error and return None.
    """
    at: Path = (*path, spec.kind)
    written = getattr(spec, spec.kind)
    sides: list[float | None]
    length = partial(scope.number, most=FARTHEST)
    match spec.kind:
        case "box" | "ellipsoid":
            sides = [length(side, (*at, k), LENGTH, f"a length of the {spec.kind}", above=0.0) for k, side in enumerate(written)]
        case "plane":
            sides = [length(side, (*at, k), LENGTH, "a length of the plane", least=0.0) for k, side in enumerate(written)]
        case "sphere":
            sides = [length(written.radius, (*at, "radius"), LENGTH, "`radius`", above=0.0)]
        case "cylinder" | "capsule":
            sides = [length(getattr(written, key), (*at, key), LENGTH, f"`{key}`", above=0.0) for key in ("radius", "length")]
        case "mesh":
            return None
    lengths = [side for side in sides if side is not None]
    if len(lengths) < len(sides):
        return None
    halved = {"box": (0, 1, 2), "plane": (0, 1), "cylinder": (1,), "capsule": (1,)}.get(spec.kind, ())
    return Primitive(shape=spec.kind, size=tuple(side / 2.0 if k in halved else side for k, side in enumerate(lengths)), pose=pose)
