"""Tests of a document: names, units and ranges worked out. What mounts of parts they name is `graph`'s business."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

from thingc.diagnostics import Code
from thingc.joints import KINDS
from thingc.resolve import references
from thingc.resolve.model import Joint, Mode, Reference
from thingc.resolve.modes import components_fitting, driven
from thingc.resolve.references import GLOB, suggested
from thingc.resolve.scope import Scope
from thingc.resolve.table import Context, Table
from thingc.resolve.tests_model import (
    Allowance,
    CentreCheck,
    Check,
    CollisionCheck,
    JointRange,
    MassCheck,
    PointCheck,
    ReachCheck,
    SettleCheck,
    Test,
    TorqueCheck,
)
from thingc.source import MappingNode, Path, SequenceNode, node_at, walk
from thingc.spec import tests as spec
from thingc.units import ANGLE, LENGTH, MASS, NUMBER, TIME, Dimension, Quantity

ALL = "all"
SAMPLES = 200
"""Positions of a sweep that does not say how many."""
MOST_SAMPLES = 10_000
LONGEST = 600.0
"""The longest simulation [s] that a document may ask for, so that no document can keep a machine busy for ever."""
ANGLE_OFF = math.radians(1.0)
"""How far a mount may be off the direction [rad] of a point test that does not say."""
HOLD = 1.0
"""How long rest has to last [s] in a test that does not say."""


def tests(context: Context, table: Table, scope: Scope, modes: Sequence[Mode]) -> Iterator[Test]:
    """The tests of the document, in its order. One that is wrong is left out (reported)."""
    reader, around = _Reader(table, scope, modes), context.around(table)
    for name, written in table.spec.tests.items():
        kind = next(kind for kind in spec.KINDS if getattr(written, kind) is not None)
        limits = [joint and joint.limit for joint in table.joints.values()] if written.no_collision is not None else None
        stated = (written, context.values(scope, f"tests {name}", written), modes, limits, *around)
        found = context.sound(("test", name), stated, partial(reader.test, name, kind, getattr(written, kind)))
        if found is not None:
            yield found


class _Reader:
    def __init__(self, table: Table, scope: Scope, modes: Sequence[Mode]) -> None:
        self.table = table
        self.scope = scope
        self.modes = {mode.name: mode for mode in modes}
        self.sound = True

    def test(self, name: str, kind: str, written: Any) -> Test | None:
        """One test; None where something of it was wrong (reported)."""
        path: Path = ("tests", name, kind)
        self.sound = not self.scope.doubts.touch(path)
        chosen = self.chosen_modes(written, path) if hasattr(written, "mode") else ()
        poses, every = self.chosen_poses(written, path) if hasattr(written, "pose") else ((), False)
        check: Check | None
        match written:
            case spec.MassTest():
                check = self.mass(written, path)
            case spec.CentreTest():
                check = self.centre(written, path)
            case spec.ReachTest():
                check = self.reach(written, path)
            case spec.PointTest():
                check = self.point(written, path)
            case spec.NoCollisionTest():
                check = self.no_collision(written, path)
            case spec.TorqueMarginTest():
                check = self.torque_margin(written, path, chosen)
            case _:
                check = self.settles(written, path)
        if not self.sound or check is None:
            return None
        node = node_at(self.scope.document.tree, path)
        spans = {
            ".".join(str(step) for step in inner): self.scope.span((*path, *inner))
            for inner, _ in walk(node) if inner
        } if isinstance(node, (MappingNode, SequenceNode)) else {}
        return Test(
            name=name, kind=kind, check=check, modes=chosen, poses=poses, every_pose=every,
            origin=self.scope.origin(("tests", name), key=True), spans=spans,
        )

    # --- kinds ------------------------------------------------------------------------------------------------------

    def mass(self, written: spec.MassTest, path: Path) -> MassCheck:
        """Bounds of a mass."""
        low, high = self.bounds(written.min, written.max, path, MASS, "the mass")
        return MassCheck(of=self.components(written.of, (*path, "of")), minimum=low, maximum=high)

    def centre(self, written: spec.CentreTest, path: Path) -> CentreCheck:
        """A box for the centre of mass."""
        box: dict[str, tuple[float, float]] = {}
        for axis in ("x", "y", "z"):
            said = getattr(written.within, axis)
            if said is not None:
                box[axis] = self.interval(said, (*path, "within", axis), LENGTH, f"a bound on {axis}")
        return CentreCheck(of=self.components(written.of, (*path, "of")), frame=self.mount(written.in_, (*path, "in")), box=box)

    def reach(self, written: spec.ReachTest, path: Path) -> ReachCheck | None:
        """Bounds of the greatest distance of two mounts."""
        of, base = self.mount(written.of, (*path, "of")), self.mount(written.from_, (*path, "from"))
        low, high = self.bounds(written.min, written.max, path, LENGTH, "the reach")
        return ReachCheck(of=of, base=base, minimum=low, maximum=high) if of is not None and base is not None else None

    def point(self, written: spec.PointTest, path: Path) -> PointCheck | None:
        """A point that a mount has to reach."""
        mount, frame = self.mount(written.mount, (*path, "mount")), self.mount(written.in_, (*path, "in"))
        at = self.scope.vector(written.at, (*path, "at"), LENGTH, "`at`")
        within = self.number(written.within, (*path, "within"), LENGTH, "`within`", above=0.0)
        direction, angle = None, ANGLE_OFF
        if written.direction is not None:
            x, y, z = (
                self.number(value, (*path, "direction", index), NUMBER, "a part of `direction`")
                for index, value in enumerate(written.direction)
            )
            length = math.hypot(x, y, z)
            if length == 0.0:
                self.error(Code.OUT_OF_RANGE, "`direction` has no length: it points nowhere", (*path, "direction"),
                           help="write for example `direction: [0, 0, -1]`")
            direction = (x / length, y / length, z / length) if length > 0.0 else None
        if written.angle is not None:
            angle = self.number(written.angle, (*path, "angle"), ANGLE, "`angle`", above=0.0)
        if mount is None or at is None:
            self.sound = False
            return None
        return PointCheck(mount=mount, point=at, frame=frame, within=within, direction=direction, angle=angle)

    def no_collision(self, written: spec.NoCollisionTest, path: Path) -> CollisionCheck:
        """Poses or ranges without collisions."""
        samples = SAMPLES
        if written.samples is not None:
            wanted = self.number(written.samples, (*path, "samples"), NUMBER, "`samples`", least=1.0, most=float(MOST_SAMPLES))
            if wanted % 1.0 > 0.0:
                self.error(Code.VALUE_KIND, f"`samples` must be a whole number, found {wanted:g}", (*path, "samples"))
            samples = int(wanted) if self.sound else SAMPLES
        clearance = 0.0
        if written.clearance is not None:
            clearance = self.number(written.clearance, (*path, "clearance"), LENGTH, "`clearance`", least=0.0)
        return CollisionCheck(
            ranges=tuple(self.ranges(written.joints, (*path, "joints"))), samples=samples, clearance=clearance,
            allow=tuple(self.allowance(said, (*path, "allow", index)) for index, said in enumerate(written.allow)),
        )

    def torque_margin(self, written: spec.TorqueMarginTest, path: Path, chosen: Sequence[str]) -> TorqueCheck:
        """A margin of drives; only where the document says what carries the robot."""
        minimum = self.number(written.min, (*path, "min"), NUMBER, "`min`", above=0.0)
        at = (*path, "drive")
        patterns = [(written.drive, at)] if isinstance(written.drive, str) else [
            (pattern, (*at, index)) for index, pattern in enumerate(written.drive)
        ]
        joints = driven(self.table, self.scope, patterns)
        self.sound = self.sound and bool(joints)
        floating = [name for name in chosen if not _carried(self.modes[name])]
        if floating:
            standing = [name for name, mode in self.modes.items() if _carried(mode)]
            others = f", or name modes that stand: {', '.join(f'`{name}`' for name in standing)}" if standing else ""
            self.error(
                Code.TEST, f"the base of mode `{floating[0]}` floats: what carries it there is not known",
                (*path, "mode") if written.mode is not None else path, key=written.mode is None,
                help=f"say what it stands on, `standing_on: [...]` in the mode{others}",
            )
        for name in chosen:
            present = self.modes[name].actuators
            absent = [joint for joint in joints if present is not None and joint not in present]
            if absent:
                self.error(
                    Code.TEST, f"mode `{name}` leaves the drive of joint `{absent[0]}` out", at,
                    help="name drives that are among the mode's `actuators`",
                )
        return TorqueCheck(joints=joints, minimum=minimum)

    def settles(self, written: spec.SettlesTest, path: Path) -> SettleCheck:
        """A simulation that comes to rest."""
        within = self.number(written.within, (*path, "within"), TIME, "`within`", above=0.0, most=LONGEST)
        drift = self.number(written.drift, (*path, "drift"), LENGTH, "`drift`", above=0.0)
        hold = HOLD
        if written.for_ is not None:
            hold = self.number(written.for_, (*path, "for"), TIME, "`for`", above=0.0, most=LONGEST)
        moved = penetration = None
        if written.moved is not None:
            moved = self.number(written.moved, (*path, "moved"), LENGTH, "`moved`", above=0.0)
        if written.penetration is not None:
            penetration = self.number(written.penetration, (*path, "penetration"), LENGTH, "`penetration`", above=0.0)
        return SettleCheck(within=within, drift=drift, hold=hold, moved=moved, penetration=penetration, floor=written.floor)

    # --- values -----------------------------------------------------------------------------------------------------

    def error(self, code: Code, message: str, path: Path, *, help: str | None = None, key: bool = False) -> None:
        """Report, and leave this test out."""
        self.sound = False
        self.scope.error(code, message, path, help=help, key=key)

    def number(
        self, raw: Any, path: Path, dimension: Dimension, what: str, *, above: float | None = None, least: float | None = None,
        most: float | None = None,
    ) -> float:
        """The SI value; not a number, which no comparison finds fault with, where it was wrong (reported)."""
        value = self.scope.number(raw, path, dimension, what, above=above, least=least)
        if value is not None and most is not None and value > most:
            bound = Quantity(most, dimension)
            self.error(Code.OUT_OF_RANGE, f"{what} must be at most {bound}, found {Quantity(value, dimension)}", path)
        if value is None:
            self.sound = False
            return math.nan
        return value

    def interval(self, said: Sequence[Any], path: Path, dimension: Dimension, what: str) -> tuple[float, float]:
        """Two values in order."""
        low, high = (self.number(value, (*path, index), dimension, what) for index, value in enumerate(said))
        if low > high:
            self.error(
                Code.OUT_OF_RANGE, f"{what}: the smallest value comes first, found {Quantity(low, dimension)} before "
                f"{Quantity(high, dimension)}", path, help="exchange the two",
            )
        return low, high

    def bounds(
        self, low: Any, high: Any, path: Path, dimension: Dimension, what: str,
    ) -> tuple[float | None, float | None]:
        """`min` and `max`, as far as they are written."""
        least = None if low is None else self.number(low, (*path, "min"), dimension, f"`min` of {what}", least=0.0)
        most = None if high is None else self.number(high, (*path, "max"), dimension, f"`max` of {what}", least=0.0)
        if least is not None and most is not None and least > most:
            self.error(
                Code.OUT_OF_RANGE,
                f"`min` of {what} is above its `max`: {Quantity(least, dimension)} and {Quantity(most, dimension)}",
                (*path, "min"), help="exchange the two",
            )
        return least, most

    def mount(self, text: str | None, path: Path) -> Reference | None:
        """A mount of a component, or one that the document exports."""
        if text is None:
            return None
        found = references.shown_mount(self.table, self.scope, text, path)
        self.sound = self.sound and found is not None
        return found

    def components(self, text: str | None, path: Path) -> tuple[Reference, ...]:
        """The components that a name or pattern fits."""
        if text is None:
            return ()
        names = components_fitting(self.table, self.scope, text, path)
        self.sound = self.sound and bool(names)
        origin = self.scope.origin(path)
        return tuple(Reference(path=tuple(name.split(".")), mount=None, origin=origin) for name in names)

    def allowance(self, said: spec.AllowSpec, path: Path) -> Allowance:
        """A pair that may touch."""
        one, other = (self.components(text, (*path, "pair", side)) for side, text in enumerate(said.pair))
        return Allowance(
            one=one, other=other, text=f"`{said.pair[0]}` and `{said.pair[1]}`", reason=said.reason.strip(),
            origin=self.scope.origin((*path, "pair")),
        )

    # --- names of modes, poses and joints ---------------------------------------------------------------------------

    def chosen(self, said: str | list[str], path: Path, known: Sequence[str], section: str, code: Code) -> tuple[str, ...]:
        """The names of a section that names and patterns fit, in its order."""
        what = section.removesuffix("s")
        found: set[str] = set()
        for text, at in [(said, path)] if isinstance(said, str) else [(text, (*path, k)) for k, text in enumerate(said)]:
            fitting = [text] if text in known else [name for name in known if text == ALL or fnmatchcase(name, text)]
            found.update(fitting)
            if fitting:
                continue
            self.sound = False
            if self.scope.doubts.lacks(section) or text in getattr(self.table.spec, section):
                continue
            help = suggested(text, known, what=section)
            if GLOB.search(text) or text == ALL:
                self.error(Code.NO_MATCH, f"pattern `{text}` fits no {what}", at, help=help)
            else:
                self.error(code, f"there is no {what} `{text}`", at, help=help)
        return tuple(name for name in known if name in found)

    def chosen_modes(self, written: Any, path: Path) -> tuple[str, ...]:
        """The modes to run in: those written, else the first."""
        if not self.modes:
            self.sound = False
            return ()
        if written.mode is None:
            return (next(iter(self.modes)),)
        return self.chosen(written.mode, (*path, "mode"), list(self.modes), "modes", Code.UNKNOWN_MODE)

    def chosen_poses(self, written: Any, path: Path) -> tuple[tuple[str | None, ...], bool]:
        """The poses to run in, and whether all keyframes of the mode are meant."""
        if written.pose is None:
            return (None,), False
        if written.pose == ALL and ALL not in self.table.poses:
            return (), True
        return self.chosen(written.pose, (*path, "pose"), list(self.table.poses), "poses", Code.UNKNOWN_POSE), False

    def ranges(self, said: dict[str, Any], path: Path) -> Iterator[JointRange]:
        """The joints of a sweep and how far each goes; an exact name goes before a pattern."""
        joints = dict(self.table.all_joints())
        movable = {name: joint for name, joint in joints.items() if joint is not None and _movable(joint)}
        chosen: dict[str, tuple[Any, Path]] = {}
        for text in sorted(said, key=lambda text: text in joints):
            at = (*path, text)
            fitting = [text] if text in joints else [name for name in movable if fnmatchcase(name, text)]
            chosen.update((name, (said[text], at)) for name in fitting)
            if fitting or self.table.unsure_joints():
                self.sound = self.sound and bool(fitting)
            elif GLOB.search(text):
                self.error(Code.NO_MATCH, f"pattern `{text}` fits no joint that can be moved", at, key=True,
                           help=suggested(text, movable, what="joints"))
            else:
                self.error(Code.UNKNOWN_JOINT, f"there is no joint `{text}`", at, key=True, help=suggested(text, movable, what="joints"))
        for name, joint in joints.items():
            if name not in chosen:
                continue
            if joint is None:
                self.sound = False
            elif not _movable(joint):
                why = f"mimics `{joint.mimic.joint}`" if joint.mimic is not None else f"is {joint.kind} and has no coordinate"
                self.error(Code.TEST, f"joint `{name}` {why}: it cannot be moved through a range", chosen[name][1], key=True,
                           help=f"move `{joint.mimic.joint}`" if joint.mimic is not None else "take it out")
            else:
                yield self.range(name, joint, *chosen[name])

    def range(self, name: str, joint: Joint, said: Any, path: Path) -> JointRange:
        """From where to where a joint goes."""
        kind = KINDS[joint.kind]
        low = joint.limit.lower if joint.limit.lower is not None else -math.pi
        high = joint.limit.upper if joint.limit.upper is not None else math.pi
        if said != ALL and kind.coordinate is not None:
            first, last = self.interval(said, path, kind.coordinate, f"the range of joint `{name}`")
            shown = kind.twists[0].shown
            if kind.limits != "none" and (first < low - 1e-9 or last > high + 1e-9):
                self.error(
                    Code.OUT_OF_RANGE, f"the range of joint `{name}` leaves its limits {shown(low)} to {shown(high)}", path,
                    help="write `all` for the whole range",
                )
            low, high = first, last
        return JointRange(joint=name.replace(".", "/"), lower=low, upper=high)


def _carried(mode: Mode) -> bool:
    """Whether something other than a simulation knows of carries the base of a mode."""
    return mode.base != "free" or mode.standing is not None or bool(mode.holds)


def _movable(joint: Joint) -> bool:
    return joint.mimic is None and KINDS[joint.kind].coordinate is not None
