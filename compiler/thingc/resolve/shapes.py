"""Links: components whose geometry is listed, shape by shape."""

from __future__ import annotations

from typing import assert_never

from thingc.pose import NO_POSE, Pose
from thingc.primitives import Primitive
from thingc.resolve.layers import Layers
from thingc.resolve.link_definition import LinkDefinition, ListedShape, link_of
from thingc.resolve.overrides import material
from thingc.resolve.scope import Scope
from thingc.resolve.table import Node, Table
from thingc.source import Path
from thingc.spec.listed import ShapeSpec
from thingc.units import LENGTH


def of_link(table: Table, node: Node) -> LinkDefinition | None:
    """The definition of a component that is a `link`; None where one of its shapes is wrong (reported)."""
    shapes = [_shape(table, node.scope, spec, (*node.path, "shapes", index)) for index, spec in enumerate(node.spec.shapes)]
    sound = tuple(shape for shape in shapes if shape is not None)
    return link_of(sound) if len(sound) == len(shapes) else None


def _shape(table: Table, scope: Scope, spec: ShapeSpec, path: Path) -> ListedShape | None:
    pose = NO_POSE if spec.at is None else scope.pose(spec.at.xyz, (*path, "at", "xyz"), spec.at.rpy, (*path, "at", "rpy"))
    solid = _primitive(scope, spec, path, pose or NO_POSE)
    if solid is None or pose is None:
        return None
    return ListedShape(
        solid=solid, drawn=spec.for_ != "collision", touches=spec.for_ != "visual", color=spec.color,
        material=material(scope, Layers(((spec, path),)), table.materials, unreadable=table.materials_unreadable),
    )


def _primitive(scope: Scope, spec: ShapeSpec, path: Path, pose: Pose) -> Primitive | None:
    """The primitive, of which documents say whole lengths; None where one of them is wrong (reported)."""
    at: Path = (*path, spec.kind)
    written = getattr(spec, spec.kind)
    sides: list[float | None]
    match spec.kind:
        case "box" | "ellipsoid":
            sides = [scope.number(side, (*at, k), LENGTH, f"a length of the {spec.kind}", above=0.0) for k, side in enumerate(written)]
        case "plane":
            sides = [scope.number(side, (*at, k), LENGTH, "a length of the plane", least=0.0) for k, side in enumerate(written)]
        case "sphere":
            sides = [scope.number(written.radius, (*at, "radius"), LENGTH, "`radius`", above=0.0)]
        case "cylinder" | "capsule":
            sides = [scope.number(getattr(written, key), (*at, key), LENGTH, f"`{key}`", above=0.0) for key in ("radius", "length")]
        case _:
            assert_never(spec.kind)
    whole = [side for side in sides if side is not None]
    if len(whole) < len(sides):
        return None
    halved = {"box": (0, 1, 2), "plane": (0, 1), "cylinder": (1,), "capsule": (1,)}.get(spec.kind, ())
    return Primitive(shape=spec.kind, size=tuple(side / 2.0 if k in halved else side for k, side in enumerate(whole)), pose=pose)
