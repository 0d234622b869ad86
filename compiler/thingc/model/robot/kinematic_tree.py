"""The pass `root`, which builds the kinematic tree of a simulation model from an assembly and a mode."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.base.diagnostics import Code, Report
from thingc.base.memo import Memo
from thingc.base.pose import NO_POSE, Pose
from thingc.base.source import Origin
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.links import joined_links
from thingc.model.assembly.types import Assembly, LinkedMode, LinkedMount
from thingc.model.robot.loop_closure import closures_of, keyframes_of
from thingc.model.robot.loop_cuts import spanning
from thingc.model.robot.tree import base_moves, bodies_from, in_link, root_pose
from thingc.model.robot.types import Robot, Site


def root(assembly: Assembly, mode: LinkedMode, report: Report, memo: Memo | None = None) -> Robot | None:
    """Build the kinematic tree of the robot in a mode.

    If a link is not connected to the root, or if a loop does not close, report an error and return None.

    Frames of bodies are the frames of their links and do not depend on the root. The root determines only which end of a joint is the
    parent. A joint coordinate q is always the motion of the child in the document relative to its parent in the document. `memo` caches
    results.
    """
    memo, assembly = memo or Memo(), assembly.in_mode(mode.name)
    tree_mates = spanning(assembly, mode)
    bodies = bodies_from(assembly, assembly.link_of[mode.root.occurrence], tree_mates, root_pose(assembly, mode), memo)
    if len(bodies) < len(assembly.links):
        reached = {body.link for body in bodies}
        missing = next(link for link in assembly.links if link.index not in reached)
        report.add(
            Code.UNREACHED, f"link `{missing.name}` is not connected to the root of mode `{mode.name}`", missing.origin,
            path=missing.name, help="attach the components of this link to components that are connected to the root",
        )
        return None
    closures = closures_of(assembly, mode, bodies, tree_mates, report, memo)
    if closures is None:
        return None
    closed = keyframes_of(assembly, mode, bodies, closures, report, memo)
    if closed is None:
        return None
    body_of = {body.link: index for index, body in enumerate(bodies)}
    return Robot(
        name=assembly.name, mode=mode, assembly=assembly, base=mode.base, gravity=mode.gravity, bodies=bodies,
        sites=tuple(_sites(assembly, body_of, memo)), excluded=_excluded_pairs(assembly, mode, body_of), keyframes=closed[0],
        present=tuple(joint.path for joint in joints_of(assembly) if joint.actuator is not None and mode.has_drive(joint.path)),
        adhesion={adhesion.path: mode.adhesion.get(adhesion.path, 0.0) for adhesion in assembly.adhesions}, closures=closures,
        unclosed=closed[1], moves=base_moves(mode, bodies[0].X_PL),
    )


def _sites(assembly: Assembly, body_of: dict[int, int], memo: Memo) -> Iterator[Site]:
    """Yield the named frames (sites) of the robot. No name is yielded twice.

    Sites are exported mounts at every level, frames, link components that are merged into another link, mounts of sensors and tendons, and
    the roots, holds and feet of all modes.
    """
    placed = in_link(assembly)
    named: set[str] = set()
    mounts: list[tuple[LinkedMount, Origin]] = [(mount, mount.origin) for mount in assembly.exported]
    named_by = {link.frame for link in assembly.links}  # a body from a link with shapes already has this name
    mounts += [
        (LinkedMount(path=o.path, occurrence=o.index, mount="origin", pose=NO_POSE), o.origin) for o in assembly.occurrences
        if o.component.frame or o.listed is not None and o.index not in named_by
    ]
    mounts += [(m.root, m.origin) for m in assembly.modes]
    mounts += [(hold.mount, hold.origin) for m in assembly.modes for hold in m.holds]
    mounts += [(foot.mount, foot.origin) for m in assembly.modes for foot in m.feet]
    mounts += [(mount, sensor.origin) for sensor in assembly.sensors for mount in sensor.mounts]
    mounts += [(mount, tendon.origin) for tendon in assembly.tendons for mount in tendon.mounts]
    for mount, origin in mounts:
        if mount.path not in named:
            named.add(mount.path)
            pose = memo(("site at", mount.path), Pose.__matmul__, placed[mount.occurrence], mount.pose)
            yield Site(path=mount.path, body=body_of[assembly.link_of[mount.occurrence]], pose=pose, origin=origin)


def _excluded_pairs(assembly: Assembly, mode: LinkedMode, body_of: dict[int, int]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of bodies that do not collide.

    Pairs of bodies that a joint connects come first, in the order of the joints. Loop closures and fixed joints are included. The pairs in
    the setting `exclude` of the mode come last. The bodies of a pair are in link order, which is the same in every mode.
    """
    pairs: dict[tuple[int, int], None] = {}
    for first, second in (*joined_links(assembly, assembly.link_of[mode.root.occurrence]), *mode.exclude):
        pairs[(min(first, second), max(first, second))] = None
    return tuple((body_of[first], body_of[second]) for first, second in pairs)
