"""Names as ROS takes them: a path with `_` for its `/`, each for one thing alone."""

from __future__ import annotations

import re

from thingc.diagnostics import Code, Note, Report
from thingc.source import Origin


def safe(path: str) -> str:
    """`hand/tip` as `hand_tip`."""
    return path.replace("/", "_")


def package_name(robot: str) -> str:
    """The ROS package that describes a robot, in the letters that REP 144 asks for: `Arm` is described by `arm_description`."""
    return re.sub("_+", "_", f"{robot.lower()}_description")


class Names:
    """The names of one kind of thing in a file, `kind` in words (`link`); two things of one name are reported at the second."""

    def __init__(self, kind: str, report: Report) -> None:
        self._kind = kind
        self._report = report
        self._owners: dict[str, tuple[str, Origin]] = {}

    def take(self, path: str, origin: Origin, made: str | None = None) -> str:
        """The name of what stands at a path; `made` says what it is, where that is no path of the document."""
        self.free(path, origin, made)
        return safe(path)

    def free(self, path: str, origin: Origin, made: str | None = None) -> bool:
        """Whether the name of what stands at a path is its own, as it is from now on; reported otherwise."""
        name, this = safe(path), (made or f"`{path}`", origin)
        owner, before = self._owners.setdefault(name, this)
        if (owner, before) != this:
            self._report.add(
                Code.SAME_NAME, f"{this[0]} and {owner} would both be the {self._kind} `{name}` in URDF", origin, path=path,
                help="rename one of the two", notes=[Note(message=f"{owner} is made here", span=next(iter(before), None))],
            )
        return (owner, before) == this
