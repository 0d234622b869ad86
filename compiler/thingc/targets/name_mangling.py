"""Convert paths in documents to the names that formats other than MJCF use. The character `_` replaces `/`. `::`, which Gazebo uses as a
separator, is replaced in the same way.

Each resulting name must be unique.
"""

from __future__ import annotations

import re

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.pose import NO_POSE
from thingc.base.source import Origin
from thingc.model.robot.types import Robot, Site

LINK = "_link"
"""Suffix of the name of an intermediate link in a chain of joints. The suffix is appended to the name of the preceding joint. The suffix is
needed because a component can have the same name as a joint.
"""


def safe(path: str) -> str:
    """Convert a path to a name for an output file, such as `hand/tip` to `hand_tip`."""
    return path.replace("/", "_").replace("::", "_")


def package_name(robot: str) -> str:
    """Return the name of the ROS package of a robot, such as `arm_description` for `Arm`. The name contains only the characters that REP
    144 allows.
    """
    return re.sub("_+", "_", f"{robot.lower()}_description")


def frames(robot: Robot) -> dict[int, list[Site]]:
    """Return the frames that are written as additional links or frames, by the index of the body to which they belong.

    If several paths have the same name and frame, only the first path is included.
    """
    links = robot.assembly.links
    known = {(safe(links[body.link].name), index, NO_POSE) for index, body in enumerate(robot.bodies)}
    sites: dict[int, list[Site]] = {}
    for site in robot.sites:
        frame = (safe(site.path), site.body, site.pose)
        if frame not in known:
            known.add(frame)
            sites.setdefault(site.body, []).append(site)
    return sites


class MangledNames:
    """The names in one namespace of a file of the format `target` (such as `URDF`). If a name is used twice, an error is reported at the
    second use.

    `kind` is the kind of the names in this error message: `name` or `link name`.
    """

    def __init__(self, kind: str, target: str, report: Report) -> None:
        self._kind = kind
        self._target = target
        self._report = report
        self._owners: dict[str, tuple[str, Origin]] = {}

    def take(self, path: str, origin: Origin, description: str | None = None) -> str:
        """Reserve the name for a path, and return the name. If the name is already in use, report an error.

        `description` describes an element that has no path in the document. `origin` is empty for a name that every file contains.
        """
        self.free(path, origin, description)
        return safe(path)

    def free(self, path: str, origin: Origin, description: str | None = None) -> bool:
        """Reserve the name for a path, and return True. If the name is already in use, report an error and return False."""
        name, this = safe(path), (description or f"`{path}`", origin)
        owner, before = self._owners.setdefault(name, this)
        if (owner, before) != this:
            self._report.add(
                Code.SAME_NAME, f"{this[0]} and {owner} have the same {self._kind} in {self._target} (`{name}`)", origin, path=path,
                help="rename one of the two elements" if before else "choose another name",
                notes=[Note(message=f"{owner} is defined here", span=span) for span in before[:1]],
            )
        return (owner, before) == this
