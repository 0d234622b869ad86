"""Names as ROS takes them: a path with `_` for its `/`, each for one thing alone."""

from __future__ import annotations

from thingc.diagnostics import Code, Note, Report
from thingc.source import Origin


def safe(path: str) -> str:
    """`hand/tip` as `hand_tip`."""
    return path.replace("/", "_")


class Names:
    """The names of one kind of thing in a file, `what` in words; two things of one name are reported at the second."""

    def __init__(self, what: str, report: Report) -> None:
        self._what = what
        self._report = report
        self._owners: dict[str, tuple[str, Origin]] = {}

    def take(self, path: str, origin: Origin) -> str:
        """The name of what stands at a path."""
        self.free(path, origin)
        return safe(path)

    def free(self, path: str, origin: Origin) -> bool:
        """Whether the name of what stands at a path is its own, as it is from now on; reported otherwise."""
        name = safe(path)
        owner, before = self._owners.setdefault(name, (path, origin))
        alone = (owner, before) == (path, origin)
        if not alone:
            self._report.add(
                Code.SAME_NAME, f"{self._what} `{path}` and `{owner}` would both be called `{name}` in URDF", origin, path=path,
                help="rename one of the two", notes=[Note(message=f"`{owner}` is made here", span=next(iter(before), None))],
            )
        return alone
