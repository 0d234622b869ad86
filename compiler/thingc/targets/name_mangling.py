"""Names outside of MJCF: a path with `_` for its `/`, each for one thing alone; also for `::`, with which Gazebo parts names."""

from __future__ import annotations

import re

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.pose import NO_POSE
from thingc.base.source import Origin
from thingc.model.robot.types import Robot, Site


def safe(path: str) -> str:
    """`hand/tip` as `hand_tip`."""
    return path.replace("/", "_").replace("::", "_")


def package_name(robot: str) -> str:
    """The ROS package that describes a robot, in the letters that REP 144 asks for: `Arm` is described by `arm_description`."""
    return re.sub("_+", "_", f"{robot.lower()}_description")


def frames(robot: Robot) -> dict[int, list[Site]]:
    """The frames on each body besides its own, by its index; of several paths of one name that are the same frame the first."""
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
    """The names of one kind of thing in a file, of a format that is called `target` (`URDF`); two things of one name are reported at the
    second. `both` says of which kind two with a name would be: `be the link`, `have the name`."""

    def __init__(self, both: str, target: str, report: Report) -> None:
        self._both = both
        self._target = target
        self._report = report
        self._owners: dict[str, tuple[str, Origin]] = {}

    def take(self, path: str, origin: Origin, made: str | None = None) -> str:
        """The name of what stands at a path; `made` says what it is, where that is no path of the document. What a file has in any case is
        of no origin."""
        self.free(path, origin, made)
        return safe(path)

    def free(self, path: str, origin: Origin, made: str | None = None) -> bool:
        """Whether the name of what stands at a path is its own, as it is from now on; reported otherwise."""
        name, this = safe(path), (made or f"`{path}`", origin)
        owner, before = self._owners.setdefault(name, this)
        if (owner, before) != this:
            self._report.add(
                Code.SAME_NAME, f"{this[0]} and {owner} would both {self._both} `{name}` in {self._target}", origin, path=path,
                help="rename one of the two" if before else "rename it",
                notes=[Note(message=f"{owner} is made here", span=span) for span in before[:1]],
            )
        return (owner, before) == this
