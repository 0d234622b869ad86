"""Map the key paths of a generated document to the elements of the source file, so that diagnostics can refer to the source file."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.base.source import Path, Span
from thingc.tools.importing.document_names import DocumentNaming


def places_of(words: DocumentNaming) -> dict[Path, Span]:
    """Return the source location of each section, component, shape, mount, joint and so on of a generated document, by key path."""
    robot = words.robot
    places: dict[Path, Span] = {(): robot.where, **dict(_components(words)), **dict(_joints(words))}
    places |= {("tendons", words.tendons[one.name]): one.where for one in robot.tendons}
    places |= {("tendons", words.tendons[one.name], "drive"): one.drive.where for one in robot.tendons if one.drive is not None}
    places |= {("transmissions", words.transmissions[one.name]): one.where for one in robot.transmissions}
    places |= {("sensors", word): one.where for one, word in zip(robot.sensors, words.sensors, strict=True)}
    places |= {("poses", words.poses[one.name]): one.where for one in robot.poses}
    places |= {("mounts", word): words.link_of[name].where for name, word in words.frames.items()}
    return places | {("mounts", words.sites[site.name]): site.where for link in robot.links for site in link.sites}


def _components(words: DocumentNaming) -> Iterator[tuple[Path, Span]]:
    for name, word in words.links.items():
        link, above, path = words.link_of[name], words.above.get(name), ("components", word)
        yield path, link.where
        if link.weight is not None:
            yield from (((*path, key), link.weight.where) for key in ("mass", "com", "inertia"))
        if link.weight is not None and name in words.points:
            yield ("components", words.points[name]), link.weight.where
        yield from (((*path, "shapes", number), shape.where) for number, (shape, _) in enumerate(words.items(link)))
        if above is not None:
            yield (*path, "at"), above.where
        joints = [joint for one in (above, *words.below.get(name, ())) if one is not None for joint in one.joints]
        mounts = {words.mounts[joint.name]: joint.where for joint in joints}
        mounts |= {words.frames[one.child]: one.where for one in words.below.get(name, ()) if one.child in words.frames}
        mounts |= {words.sites[site.name]: site.where for site in link.sites}
        mounts |= {words.ends[words.loops[one.name]]: one.where for one in words.robot.loops if name in dict(one.ends)}
        mounts |= {words.magnets[one.name]: one.where for one in words.robot.adhesions if one.link == name}
        yield from (((*path, "mounts", mount), where) for mount, where in mounts.items())


def _joints(words: DocumentNaming) -> Iterator[tuple[Path, Span]]:
    for joint in (joint for one in words.order for joint in one.joints):
        path = ("joints", words.joints[joint.name])
        yield path, joint.where
        if joint.follows is not None:
            yield (*path, "mimic"), joint.follows.where
        if joint.drive is not None:
            yield (*path, "drive"), joint.drive.where
    yield from ((("joints", words.loops[one.name]), one.where) for one in words.robot.loops)
