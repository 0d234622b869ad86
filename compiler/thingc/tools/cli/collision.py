"""Implementation of `thingc collision`, which measures how well the collision shapes of a robot approximate its parts."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from typing import TYPE_CHECKING, Any

from msgspec import to_builtins
from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.primitives import Primitive
from thingc.driver import pipeline
from thingc.driver.environment import Environment, attempted
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.targets.render.picture import NoGraphics
from thingc.tools.cli import console, render

if TYPE_CHECKING:
    from numpy.typing import NDArray

EPILOG = """\
For each part, the table shows the largest distance of a point of the part from the collision shapes, the largest distance of a point of the
shapes from the part, and the volume of the shapes divided by the volume of the part.

  thingc collision assemblies/arm.yaml
  thingc collision assemblies/arm.yaml -o shapes.png         also draw the shapes over the parts
"""

SAMPLES = 4000
"""Number of random points on a surface, in addition to its vertices."""

FEW, MANY = 16, 500
"""Numbers of triangles near a point to which its distance is measured: for all points, and for the farthest points."""

AGAIN = 50
"""Number of points whose distance is measured again at once."""


class Deviation(FrozenStruct):
    """The deviation of the collision shapes of occurrences from their part or link.

    `outside` is the largest distance [m] of a point of the part from the shapes, `beyond` is the largest distance of a point of the shapes
    from the part, and `ratio` is the ratio of volumes. These values are None without a solid part, or for a plane.
    """

    paths: tuple[str, ...]
    kind: str
    shapes: int
    outside: float | None = None
    beyond: float | None = None
    ratio: float | None = None


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc collision` to the parser."""
    parser.epilog = EPILOG
    console.add_document(parser)
    formats = ("mjcf", "urdf", "sdf", "usd")
    parser.add_argument("--target", choices=formats, default="", help="measure the shapes in this format (default: in all formats)")
    parser.add_argument("-o", "--output", metavar="PNG", help="also draw the collision shapes over the parts of the first mode")
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc collision`, and return the exit code. With text output, diagnostics are printed to standard error."""
    console.require_document(arguments.document)
    render.check_output(arguments.output)
    found: list[Deviation] = []
    options = replace(console.options_of(arguments), compat=())
    try:
        diagnostics = attempted(arguments.document, options, partial(_measure, arguments, found))
    except NoGraphics as fault:
        diagnostics = [render.no_graphics(fault)]
    if arguments.format == "json":
        console.print_json(diagnostics, collision=to_builtins(found))
        return console.exit_code(diagnostics)
    code = console.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)
    if found:
        console.say(*as_text(found))
    return code


def _measure(arguments: argparse.Namespace, found: list[Deviation], environment: Environment) -> list[Diagnostic]:
    """Measure the deviations, and draw the picture if requested. Return the diagnostics."""
    compilation = pipeline.compile(environment)
    diagnostics = console.final(compilation.report, strict=arguments.strict)
    if console.exit_code(diagnostics) or compilation.assembly is None:
        return diagnostics
    found += deviations(compilation.assembly.in_target(arguments.target), environment.store)
    if arguments.output is not None:
        robot = compilation.robots[0]
        pose = robot.keyframes[0].name if robot.keyframes else None
        render.draw(environment, compilation, robot, pose, arguments.output, collision=True)
    return console.final(compilation.report, strict=arguments.strict)


def deviations(assembly: Assembly, store: Store) -> list[Deviation]:
    """Measure the collision shapes of each part and link. Occurrences with equal shapes are measured once."""
    groups: dict[object, list[Occurrence]] = {}
    for one in assembly.occurrences:
        if one.has_contacts or one.drawn:
            key = (one.definition.text, one.overrides.collision, one.overrides.pieces, tuple(surface.solid for surface in one.touching))
            groups.setdefault(key, []).append(one)
    return [_deviation(tuple(one.path for one in several), several[0], store) for several in groups.values()]


def _deviation(paths: tuple[str, ...], one: Occurrence, store: Store) -> Deviation:
    from manifold3d import Manifold, OpType

    from thingc.model.solids.shapes import solid_of

    kind = "shapes" if one.listed is not None else one.overrides.collision
    measured = Deviation(paths=paths, kind=kind, shapes=len(one.touching))
    part = solid_of(store, one.drawn if one.listed is not None else one.solids)
    solids = [(solid_of(store, [surface]), surface.solid) for surface in one.touching]
    if part is None or not solids or any(isinstance(solid, Primitive) and solid.shape == "plane" for _, solid in solids):
        return measured
    whole = [
        made.whole if isinstance(solid, Primitive) or kind == "mesh" else made.whole.hull() for made, solid in solids if made is not None
    ]
    shapes = Manifold.batch_boolean(whole, OpType.Add)
    return replace(
        measured, outside=farthest(part.whole, shapes), beyond=farthest(shapes, part.whole), ratio=shapes.volume() / part.whole.volume(),
    )


def farthest(solid: Any, other: Any) -> float:
    """Return the largest distance [m] of a point of a solid from another solid, measured at vertices and at sampled points."""
    import numpy as np
    import trimesh
    from scipy.spatial import cKDTree

    outside = solid - other
    if outside.is_empty():
        return 0.0
    points, _ = _sampled(outside)
    samples, triangles = _sampled(other)
    tree = cKDTree(samples)

    def apart(points: NDArray[Any], neighbours: int) -> NDArray[Any]:
        nearest = triangles[tree.query(points, k=min(neighbours, len(samples)))[1]]
        asked = np.repeat(points, nearest.shape[1], axis=0)
        there = trimesh.triangles.closest_point(nearest.reshape(-1, 3, 3), asked)  # type: ignore[no-untyped-call]
        return np.asarray(np.linalg.norm(there - asked, axis=1).reshape(-1, nearest.shape[1]).min(axis=1))

    upper, largest = apart(points, FEW), 0.0
    order = np.argsort(-upper, kind="stable")
    for start in range(0, len(order), AGAIN):  # the distance to few triangles can be too large
        some = order[start : start + AGAIN]
        if upper[some[0]] <= largest:
            break
        largest = max(largest, float(apart(points[some], MANY).max()))
    return largest


def _sampled(solid: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return points (n, 3) on the surface of a solid, and the triangle (n, 3, 3) that contains each point."""
    import numpy as np
    import trimesh

    mesh = solid.to_mesh64()
    corners = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts, dtype=np.int64)]
    surface = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    samples, owners = trimesh.sample.sample_surface(surface, SAMPLES, seed=0)
    return np.concatenate([corners.reshape(-1, 3), samples]), np.concatenate([np.repeat(corners, 3, axis=0), corners[owners]])


def as_text(found: list[Deviation]) -> list[str]:
    """Format the deviations as a table."""
    rows = [("part", "collision", "shapes", "part outside", "shapes beyond", "volume ratio")]
    for one in found:
        path = one.paths[0] + (f" (and {len(one.paths) - 1} more)" if len(one.paths) > 1 else "")
        numbers = ("", "", "") if one.ratio is None else (_millimetres(one.outside), _millimetres(one.beyond), f"{one.ratio:.3f}")
        rows.append((path, one.kind, str(one.shapes), *numbers))
    return console.table(rows, right=(2, 3, 4, 5))


def _millimetres(length: float | None) -> str:
    return f"{1e3 * (length or 0.0):.3g} mm"
