"""Convert paths in documents to names for formats other than MJCF. The character `_` replaces `/` and also `::`, which is the separator of
Gazebo.

Each name must be unique.
"""

from __future__ import annotations

import re

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.pose import NO_POSE
from thingc.base.source import Origin
from thingc.model.robot.types import Robot, Site


def safe(path: str) -> str:
    """Convert a path to a name for an output file, such as `hand/tip` to `hand_tip`."""
    return path.replace("/", "_").replace("::", "_")


def package_name(robot: str) -> str:
    """Return the name of the robot's ROS package, with the letters that REP 144 allows: `arm_description` for `Arm`."""
    return re.sub("_+", "_", f"{robot.lower()}_description")


def frames(robot: Robot) -> dict[int, list[Site]]:
    """Return the frames that are written as extra links or frames, by the index of the body to which they belong.

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
    """The names in one namespace of a file of the format `target` (such as `URDF`). A duplicate name is reported at its second use.

    `both` is a phrase for the error message about a duplicate name: `be the link` or `have the name`.
    """

    def __init__(self, both: str, target: str, report: Report) -> None:
        self._both = both
        self._target = target
        self._report = report
        self._owners: dict[str, tuple[str, Origin]] = {}

    def take(self, path: str, origin: Origin, made: str | None = None) -> str:
        """Reserve the name for a path, and return it. If the name is already in use, report an error.

        `made` describes an element that has no path in the document. The origin is empty for a name that every file contains.
        """
        self.free(path, origin, made)
        return safe(path)

    def free(self, path: str, origin: Origin, made: str | None = None) -> bool:
        """Reserve the name for a path. If the name is already in use, report it and return False."""
        name, this = safe(path), (made or f"`{path}`", origin)
        owner, before = self._owners.setdefault(name, this)
        if (owner, before) != this:
            self._report.add(
                Code.SAME_NAME, f"{this[0]} and {owner} would both {self._both} `{name}` in {self._target}", origin, path=path,
                help="rename one of the two elements" if before else "choose another name",
                notes=[Note(message=f"{owner} is defined here", span=span) for span in before[:1]],
            )
        return (owner, before) == this
