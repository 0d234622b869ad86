"""Find the values that the user changed in documents, and the values that changed as a consequence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from thingc.base.joints.kinds import KINDS
from thingc.base.units import Dimension, Quantity, UnitError, parse_quantity
from thingc.tools.diff.name_mapping import NameMapping, Pair
from thingc.tools.diff.snapshot import PERHAPS, Change, Fact, How, Named, Snapshot, SnapshotElement, Value, What, display_value
from thingc.tools.diff.source_locations import names_in

POSITIONS = frozenset({"limit.lower", "limit.upper", "limit.cone", "offset"})
LONGEST = 40
"""Maximum number of characters of a value that is displayed as in the document."""


def format_values(pair: Pair, key: str, old: Fact | None, new: Fact | None, robots: tuple[Snapshot, Snapshot]) -> tuple[str, str] | None:
    """Format the old and the new value of a property with units. Return None if the physical dimension of the property is unknown."""
    texts = tuple(_format_fact(fact) for fact in (old, new))
    if texts[0] is not None and texts[1] is not None:
        return (texts[0], texts[1])
    dimensions = [_dimension(thing, key, robot) for thing, robot in zip((pair.old, pair.new), robots, strict=True)]
    values = [fact.value if fact is not None else None for fact in (old, new)]
    if dimensions[0] is None or dimensions[0] != dimensions[1]:
        return None
    return (_number(values[0], dimensions[0]), _number(values[1], dimensions[0]))


def _format_fact(fact: Fact | None) -> str | None:
    if fact is None:
        return None
    if fact.words is not None:
        return fact.words
    written = fact.written
    plain = written is not None and "=" not in written and len(written) <= LONGEST and not written.startswith(("[", "{"))
    return written if plain and isinstance(fact.value, (int, float)) and not isinstance(fact.value, bool) else None


def _dimension(thing: SnapshotElement, key: str, robot: Snapshot) -> Dimension | None:
    if thing.what == "pose" or thing.what == "joint" and key in POSITIONS:
        joint = robot.things.get(("joint", key)) if thing.what == "pose" else thing
        return None if joint is None else _coordinate(joint)
    if thing.what == "parameter":
        for fact in thing.facts.values():
            try:
                return parse_quantity(fact.written or "").dimension
            except UnitError:
                continue
    return None


def _coordinate(joint: SnapshotElement) -> Dimension | None:
    """Return the physical dimension of the coordinate q of a joint, or None if it is unknown.

    A path that ends with a number, such as `wrist_1`, refers to one coordinate of a joint.
    """
    kind = KINDS.get(joint.label or "")
    if kind is None or kind.coordinate is not None:
        return kind.coordinate if kind is not None else None
    number = joint.path.rpartition("_")[2]
    return kind.twists[int(number)].coordinate if number.isdecimal() and int(number) < len(kind.twists) else None


def _number(value: Value, dimension: Dimension) -> str:
    return str(Quantity(float(value), dimension)) if isinstance(value, (int, float)) else "nothing"


_MADE_OF = frozenset({"part", "file", "assembly", "link", "frame", "mirror"})
"""Keys that define the kind and the content of a component."""
_REFERENCED_KINDS: tuple[What, ...] = ("mount", "joint", "pose", "mode")
_INNER: frozenset[What] = frozenset({"parameter", "mate", "mount"})
"""Kinds of elements that are part of a component. Their changes are not reported if the component itself was added or removed."""


class DocumentChanges:
    """Collects the changes of a robot and the causes of each change."""

    def __init__(self) -> None:
        self.found: list[Change] = []
        self._at: dict[tuple[What, str], list[Change]] = {}
        self._on: dict[str, list[Change]] = {}

    def add(self, change: Change) -> None:
        """Add a change, and the changes that caused it."""
        self.found.append(change)
        for path in {change.path, change.new_path or change.path}:
            self._at.setdefault((change.what, path), []).append(change)
            if change.what == "mount":
                self._on.setdefault(path.rpartition("/")[0], []).append(change)

    def roots(self, change: Change) -> tuple[str, ...]:
        """Return the paths of the edits that caused `change`, or the path of `change` itself if it has no other cause."""
        return tuple(word for word in change.because if word != PERHAPS) if change.caused else (change.path,)

    def causes(self, kind: What, paths: Iterable[str], fields: Iterable[str] | None = None) -> dict[str, None]:
        """Return the user's changes that affected the elements of the given kind at the given `paths`.

        If `fields` is given, only changes of these fields count. A field name that ends with a dot, such as `process.`, is a prefix.
        """
        wanted_fields = None if fields is None else tuple(fields)
        causes: dict[str, None] = {}
        for path in paths:
            for change in self._at.get((kind, path), ()):
                if wanted_fields is None or _affects(change, wanted_fields):
                    causes |= dict.fromkeys(self.roots(change))
        return causes

    def causes_of_mounts(self, paths: Iterable[str]) -> dict[str, None]:
        """Return the user's changes that affected the mounts of the given components."""
        return {root: None for path in paths for change in self._on.get(path, ()) for root in self.roots(change)}

    def structure(self) -> dict[str, None]:
        """Return the user's changes that caused structural changes of the robot.

        Structural changes affect components, mates, or the links that a joint connects.
        """
        causes: dict[str, None] = {}
        for change in self.found:
            built = change.what in ("component", "joint") and (
                change.change in ("added", "removed", "renamed") or change.field in {*_MADE_OF, "type", "parent", "child", "loop"}
            )
            if built or change.what == "mate":
                causes |= dict.fromkeys(self.roots(change))
        return causes


def _affects(change: Change, fields: tuple[str, ...]) -> bool:
    """Return whether a change affects a field in `fields` or the whole element. Return False if the element was only renamed."""
    field = change.field
    if field is None:
        return change.change != "renamed"
    return any(field == one or one.endswith(".") and field.startswith(one) for one in fields)


class DocumentComparison:
    """Compares the values in the old and the new documents, and collects the changes in the attribute `changes`."""

    def __init__(self, pairing: NameMapping) -> None:
        self.pairing = pairing
        self.changes = DocumentChanges()
        self._parameters = {pair.new.path: pair for pair in pairing.pairs if pair.new.what == "parameter"}
        self._known: dict[str, tuple[str, ...]] = {}
        unmatched: list[tuple[SnapshotElement, How]] = [(one, "removed") for one in pairing.gone]
        unmatched += [(one, "added") for one in pairing.come]
        for thing, change in unmatched:
            if thing.what == "component":
                self._add_unmatched(thing, change)
        for pair in pairing.pairs:
            if pair.new_path is not None:
                self._add_rename(pair)
        for thing, change in unmatched:
            if thing.what != "component":
                self._add_unmatched(thing, change)
        for pair in pairing.pairs:
            self._compare_facts(pair)

    def _add_unmatched(self, thing: SnapshotElement, change: How) -> None:
        """Add a change for an element that exists only in the old robot or only in the new robot."""
        counterpart = self.pairing.path("component", thing.of) if change == "removed" else self.pairing.old_component(thing.of)
        inner = thing.of != "" and counterpart is None and thing.what != "component"
        if inner and thing.what in _INNER:
            return
        owner = thing.path.rpartition("/")[0] if thing.what == "component" else thing.of if inner else ""
        because = tuple(self.changes.causes("component", [owner])) if owner else ()
        label = thing.label if thing.label is not None else display_value(
            next(iter(thing.facts.values())).value,
        ) if len(thing.facts) == 1 else None
        self.changes.add(Change(
            what=thing.what, change=change, path=thing.path, because=because, span=thing.span,
            old=label if change == "removed" else None, new=label if change == "added" else None,
        ))

    def _add_rename(self, pair: Pair) -> None:
        """Add a change for an element that was renamed.

        If an assembly was renamed, the new paths of its elements are consequences of this change.
        """
        old, new = pair.old, pair.new
        if old.what == "mate":
            return
        above = old.of if old.what != "component" else old.path.rpartition("/")[0]
        same_name = new.path.rpartition("/")[2] == old.path.rpartition("/")[2]
        at_home = self.pairing.path("component", above) == (new.of if old.what != "component" else new.path.rpartition("/")[0])
        if old.what in ("parameter", "mount") and same_name and at_home:
            return
        because = tuple(self.changes.causes("component", [above])) if same_name and at_home and above else ()
        if pair.perhaps and not because:
            because = (PERHAPS,)
        self.changes.add(Change(
            what=old.what, change="renamed" if at_home else "moved", path=old.path, new_path=new.path, because=because, reason=pair.reason,
            span=new.span,
        ))

    def _compare_facts(self, pair: Pair) -> None:
        """Compare all properties of an element that exists in both robots, and add a change for each property whose value changed."""
        pairing, old, new = self.pairing, pair.old, pair.new
        changed = [fact for fact in pairing.facts(old, new) if not pairing.same(*fact[1:])]
        changed_content = {key for key, _, _ in changed if key in _MADE_OF}
        # add changed texts first, because they may cause other changes
        changed.sort(key=lambda one: _source_of(old.facts.get(pairing.old_fact(old, one[0]))) == _source_of(new.facts.get(one[0])))
        for key, old_value, new_value in changed:
            if changed_content and key.startswith("params."):
                continue  # the parameters are now parameters of another part class
            old_fact, new_fact = old.facts.get(pairing.old_fact(old, key)), new.facts.get(key)
            if old.what == "pose" and self._is_joint_unmatched(key):
                because: tuple[str, ...] = tuple(self.changes.causes("joint", [key]))
            else:
                because = self._causes_of_value(pair, key, old_fact, new_fact, changed_content)
            self.changes.add(Change(
                what=_what(new, key), change="changed", path=old.path, new_path=pair.new_path, field=key, old=display_value(old_value),
                new=display_value(new_value), because=because,
                words=format_values(pair, key, old_fact, new_fact, (pairing.old, pairing.new)), span=new_fact and new_fact.span or new.span,
            ))

    def _is_joint_unmatched(self, joint: str) -> bool:
        """Return whether a joint exists in only one of the two robots."""
        return any(thing.what == "joint" and thing.path == joint for thing in (*self.pairing.gone, *self.pairing.come))

    def _causes_of_value(self, pair: Pair, key: str, old: Fact | None, new: Fact | None, changed_content: set[str]) -> tuple[str, ...]:
        """Return the changes that caused the new value of a property.

        If the value is an expression whose text did not change, the causes are the changed parameters in the expression. If the document
        does not contain the property, the causes are changes of the component or of the drive.
        """
        old_value, new_value = (fact.value if fact is not None else None for fact in (old, new))
        if new is not None and new.written is not None and _source_of(old) == new.written:
            return self._referenced_changes(new) or self._changes_of_names(old_value, new_value) or tuple(self.changes.structure())
        if _source_of(old) is None and _source_of(new) is None:
            if pair.new.what == "component" and changed_content and key not in changed_content:
                return tuple(self.changes.causes("component", [pair.new.path], _MADE_OF))
            if pair.new.what == "joint" and key.startswith(("limit.", "dynamics.", "drive.")):
                return self._drive_changes(pair)
            if pair.new.what == "mode" and key == "poses":
                return tuple(self.changes.causes("mode", [pair.new.path], ("pose",))) or self._changes_of_names(old_value, new_value)
            return self._changes_of_names(old_value, new_value)
        return ()

    def _referenced_changes(self, fact: Fact) -> tuple[str, ...]:
        """Return the changes of elements to which an expression refers: parameters, mounts, joints, poses and modes of a document."""
        causes: dict[str, None] = {}
        for name in names_in(fact.written or ""):
            path = f"{fact.scope}/{name}" if fact.scope else name
            causes |= dict.fromkeys(self._parameter(path))
            for kind in _REFERENCED_KINDS:
                causes |= self.changes.causes(kind, [path])
        return tuple(causes)

    def _drive_changes(self, pair: Pair) -> tuple[str, ...]:
        """Return the changes of a drive that affected values that a joint inherits from the drive."""
        causes = self.changes.causes("joint", [pair.new.path], ("type", "drive", "drive.", "limit.", "dynamics."))
        drives = [
            fact.value.path for thing in (pair.old, pair.new)
            if (fact := thing.facts.get("drive")) is not None and isinstance(fact.value, Named)
        ]
        return tuple(causes or self.changes.causes("component", drives, _MADE_OF) | self.changes.causes("parameter", drives, ("params.",)))

    def _changes_of_names(self, old: Value, new: Value) -> tuple[str, ...]:
        """Return the changes that added names to a list or removed names from the list.

        If no cause is known for one of the names, the result is empty.
        """
        old_names, new_names = set(_names_in(self.pairing.translate(old))), set(_names_in(new))
        causes: dict[str, None] = {}
        for named in old_names ^ new_names:
            reasons = self.changes.causes(named.what, above_of(named.path))
            if not reasons:
                return ()
            causes |= reasons
        return tuple(sorted(causes))

    def _parameter(self, path: str) -> tuple[str, ...]:
        """Return the user's changes that led to the new value of a parameter. The result is empty if the value is unchanged.

        `path` is the path of the parameter in the new robot.
        """
        if path not in self._known:
            self._known[path] = ()  # stop at cycles of parameters, which are errors in the document
            pair = self._parameters.get(path)
            if pair is not None:
                old, new = pair.old.facts["value"], pair.new.facts["value"]
                if not self.pairing.same(old.value, new.value):
                    self._known[path] = self._causes_of_value(pair, "value", old, new, set()) or (pair.old.path,)
        return self._known[path]


def _what(thing: SnapshotElement, key: str) -> What:
    """Return the kind of element that a property belongs to.

    Keys that start with `params.` have the kind `parameter`, and keys that start with `bom.` the kind `bom`.
    """
    return "parameter" if key.startswith("params.") else "bom" if key.startswith("bom.") else thing.what


def _source_of(fact: Fact | None) -> str | None:
    return fact.written if fact is not None else None


def _names_in(value: Value) -> Iterator[Named]:
    if isinstance(value, Named):
        yield value
    elif isinstance(value, tuple):
        for one in value:
            yield from _names_in(one)


def above_of(path: str) -> list[str]:
    """Return the path of a component, followed by the paths of all assemblies that contain the component."""
    names = path.split("/")
    return ["/".join(names[:count]) for count in range(len(names), 0, -1)]
