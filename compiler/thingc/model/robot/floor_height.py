"""Compute the height of a robot in modes with `on: floor`, so that the lowest point of the robot touches the plane z = 0.

Only collision shapes are used, so that a simulation starts without penetration between the robot and the floor. The height is computed for
the start pose of the mode. For a mode with a `free` base, a height is computed for each keyframe.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report
from thingc.base.memo import Memo
from thingc.base.numeric import inf, minimum, sum_of
from thingc.base.pose import Pose, Vector
from thingc.base.primitives import Primitive
from thingc.geometry.record import Mesh
from thingc.model.assembly.types import Assembly, LinkedMode, Occurrence
from thingc.model.resolve.types import NamedPose
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.loop_closure import closed_coordinates
from thingc.model.robot.loop_cuts import spanning
from thingc.model.robot.tree import bodies_from, in_link, root_pose

MeshVertices = Callable[[Mesh], Sequence[Vector]]
"""Function that returns the vertices [m] of a mesh in the store."""

DECIMALS = 7
"""Number of decimals of heights [m]. Without rounding, a height of 0.05825 would become 0.05825000014901161, because vertices of meshes
have single precision.
"""

ROUNDING = 1e-6
"""Largest distance [m] by which a mesh can exceed the bounding box of its part because of rounding."""


def stand(assembly: Assembly, mesh_vertices: MeshVertices | None, report: Report, memo: Memo | None = None) -> Assembly:
    """Return a copy of the assembly in which modes with `on: floor` have a computed height in `at` and `at_in`.

    Without `mesh_vertices`, the heights are computed from bounding boxes of parts, which is accurate enough if meshes are not needed. If a
    robot does not have collision shapes, an error is reported. `memo` caches results.
    """
    if not any(mode.on_floor for mode in assembly.modes):
        return assembly
    memo = memo or Memo()
    modes = tuple(
        _with_height(assembly.in_mode(mode.name), mode, mesh_vertices, report, memo) if mode.on_floor else mode for mode in assembly.modes
    )
    return replace(assembly, modes=modes)


def _with_height(assembly: Assembly, mode: LinkedMode, mesh_vertices: MeshVertices | None, report: Report, memo: Memo) -> LinkedMode:
    by_name = {pose.name: pose for pose in assembly.poses}
    start = _height(assembly, mode, assembly.start_pose(mode), mesh_vertices, memo)
    if start is None:
        if all(occurrence.exact for occurrence in assembly.occurrences):
            report.add(
                Code.NOTHING_TOUCHES, f"no part can touch the floor in mode `{mode.name}` (`on: floor`)",
                mode.origin, path=mode.name, help="set `collision` of a part to a value other than `none`, or write `at: {xyz: ...}`",
            )
        return mode
    at_in: dict[str, Pose] = {}
    if mode.base == "free" and not mode.holds:
        for name in mode.poses:
            height = start if name == mode.pose else _height(assembly, mode, by_name[name], mesh_vertices, memo)
            at_in[name] = _set_height(mode.at, start if height is None else height)
    return replace(mode, at=_set_height(mode.at, start), at_in=at_in | mode.at_in)


def _set_height(at: Pose, height: float) -> Pose:
    x, y, _ = at.translation
    return replace(at, translation=(x, y, height))


def _height(assembly: Assembly, mode: LinkedMode, pose: NamedPose, mesh_vertices: MeshVertices | None, memo: Memo) -> float | None:
    """Compute the height z [m] of the root in a pose for which the robot touches the floor.

    Return None if there are no collision shapes.
    """
    start = assembly.link_of[mode.root.occurrence]
    on_plane = root_pose(assembly, replace(mode, at=_set_height(mode.at, 0.0)))
    bodies = bodies_from(assembly, start, spanning(assembly, mode), on_plane, memo)
    link_poses = dict(zip((body.link for body in bodies), placed_bodies(bodies, closed_coordinates(assembly, pose, memo), bodies[0].X_PL)))
    poses = [link_poses[link] @ inner for link, inner in zip(assembly.link_of, in_link(assembly)) if link in link_poses]
    if len(poses) < len(assembly.occurrences):
        return None
    lowest = _lowest(list(zip(assembly.occurrences, poses, strict=True)), (mode.name, pose.name), mesh_vertices, memo)
    return None if lowest == inf else round(-lowest, DECIMALS) + 0.0


def _lowest(
    parts: Sequence[tuple[Occurrence, Pose]], place: tuple[str, str], mesh_vertices: MeshVertices | None, memo: Memo,
) -> float:
    """Return the smallest z coordinate [m] of all collision shapes in the world. If there are no collision shapes, return infinity.

    Meshes whose bounding boxes are lowest are examined first. Meshes that cannot be lower than the result are not read.
    """
    lowest = inf
    meshes: list[tuple[float, int, int, Mesh, Pose]] = []
    for number, (part, pose) in enumerate(parts):
        low = inf if part.box is None else pose.translation[2] + of_box(part.box, pose.rotation[2])
        if mesh_vertices is None and part.overrides.collision != "shapes":
            lowest = minimum(lowest, low if part.collides else inf)
            continue
        for index, surface in enumerate(part.touching):
            shape = surface.solid
            if isinstance(shape, Primitive):
                if minimum(shape.size) > 0.0 and shape.shape != "plane":
                    lowest = minimum(lowest, pose.translation[2] + shape.lowest(pose.rotation[2]))
            elif not shape.flat:  # MuJoCo ignores collisions of meshes without volume
                # the collision shapes of a Thing, or of a document, may extend beyond the box of the part
                bound = -inf if part.overrides.collision in ("part", "shapes") else low - ROUNDING
                meshes.append((bound, number, index, shape, pose @ surface.pose))
    for bound, number, index, mesh, pose in sorted(meshes, key=lambda entry: entry[:3]):
        if bound >= lowest or mesh_vertices is None:
            break
        part, _ = parts[number]
        points = memo(("mesh_vertices", part.path, index), partial(vertices_of, mesh_vertices, mesh), mesh.sha256)
        lowest_point = memo(("lowest", *place, part.path, index), of_points, points, pose.rotation[2])
        lowest = minimum(lowest, pose.translation[2] + lowest_point)
    return lowest


def vertices_of(mesh_vertices: MeshVertices, mesh: Mesh, sha256: str) -> Sequence[Vector]:
    """Return the vertices of a mesh. `sha256` is the digest of the mesh, which a `Memo` uses as the cache key."""
    return mesh_vertices(mesh)


def of_points(points: Sequence[Vector], down: Vector) -> float:
    """Return the smallest dot product [m] of the vector `down` and any of the points."""
    x, y, z = down
    return minimum(x * a + y * b + z * c for a, b, c in points)


def of_box(box: tuple[Vector, Vector], down: Vector) -> float:
    """Return the smallest dot product [m] of the vector `down` and any point of a box."""
    return sum_of(minimum(component * low, component * high) for component, low, high in zip(down, *box, strict=True))
