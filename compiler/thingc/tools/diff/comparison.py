"""Compare two snapshots of a robot, and find the changes in documents that caused each difference."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from thingc.base.grouping import group_by
from thingc.base.inertia import MassProperties
from thingc.base.numeric import hypot
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Pose, rpy_of
from thingc.base.source import Span, line_of
from thingc.geometry.record import PartRecord
from thingc.tools.diff.document_changes import DocumentChanges, DocumentComparison, above_of
from thingc.tools.diff.name_mapping import NameMapping, equal, largest
from thingc.tools.diff.snapshot import Change, DisplayValue, How, OccurrenceSnapshot, Row, Snapshot, What

Farthest = Callable[[str, str], float | None]
"""Function that returns the largest distance [m] between the surfaces of two meshes, or None if unknown.

The arguments are the SHA-256 hashes of the meshes.
"""

Difference = tuple[str, DisplayValue, DisplayValue]
"""The name of a field, the old value of the field, and the new value."""

MADE = ("part", "file", "assembly", "link", "frame", "mirror", "faces", "unit")
WEIGHED = ("mass.", "com.", "inertia.", "process.", "material")
SHAPES = 1e-7
"""Relative tolerance of integrals over a shape. Integrals vary because the geometry kernel adds up the faces in varying order."""


class _Consequences:
    """Finds the consequences of changes in the documents, such as changed masses, and adds these consequences to the comparison."""

    def __init__(self, pairing: NameMapping, changes: DocumentChanges, farthest: Farthest) -> None:
        self.pairing, self.changes, self.farthest = pairing, changes, farthest
        self.old, self.new = pairing.old, pairing.new
        self.occurrences = [
            (occurrence, self.new.occurrences[new_path]) for path, occurrence in self.old.occurrences.items()
            if (new_path := pairing.path("component", path)) is not None and new_path in self.new.occurrences
        ]
        self._moved: dict[str, tuple[str, ...]] = {}

    def all(self) -> None:
        """Find everything that the changes in the documents affect. A cause comes before its effects."""
        for old, new in self.occurrences:
            self._geometry(old, new)
            self._mounts(old, new)
            self._mass(old, new)
        known = not (self.old.lacks or self.new.lacks)
        if known:
            self._places()
            self._links()
            self._robot_masses()
        if known or self.old.rows and self.new.rows:
            self._rows()
        self._coordinates()
        self._outcomes()

    def _add(
        self, kind: What, paths: tuple[str, str], difference: Difference, because: Iterable[str], span: Span | None = None,
        change: How = "changed",
    ) -> None:
        (old, new), (field, old_value, new_value) = paths, difference
        self.changes.add(Change(
            what=kind, change=change, path=old, new_path=new if new != old else None, field=field, old=old_value, new=new_value,
            because=tuple(dict.fromkeys(because)), span=span,
        ))

    # --- parts -------------------------------------------------------------------------------------------------------

    def _definition_changes(self, old: OccurrenceSnapshot, new: OccurrenceSnapshot) -> dict[str, None]:
        """Return the changes in the definition or the parameters of a part that may have changed the shape of the part.

        If only the code of the part changed, the result is empty.
        """
        paths = (old.path, new.path)
        return self.changes.causes("component", paths, MADE) | self.changes.causes("parameter", paths, ("params.",))

    def _geometry(self, old: OccurrenceSnapshot, new: OccurrenceSnapshot) -> None:
        before, after = old.shape, new.shape
        if before == after or before is None and after is None:
            return
        paths = (old.path, new.path)
        because, span = self._definition_changes(old, new), _code_location(after)
        if before is None or after is None:
            volume, new_size = (None if shape is None else shape.volume for shape in (before, after))
            self._add("geometry", paths, ("volume", volume, new_size), because, span)
            return
        assert before.box is not None and after.box is not None
        same_inertia = _nearly_equal(before.inertia, after.inertia) and _nearly_equal(before.centre, after.centre, _size(before.box))
        sizes: tuple[Difference, ...] = ("volume", before.volume, after.volume), ("area", before.area, after.area)
        fields = [one for one in sizes if not _nearly_equal(*one[1:])]
        if not _nearly_equal(before.box, after.box, _size(before.box)):
            fields.append(("box", before.box, after.box))
        if not fields and not same_inertia:
            fields.append(("centre", before.centre, after.centre))
        old_mesh, new_mesh = before.meshes.get("visual"), after.meshes.get("visual")
        distance = self.farthest(old_mesh.sha256, new_mesh.sha256) if fields and old_mesh is not None and new_mesh is not None else None
        for difference in fields:
            self._add("geometry", paths, difference, because, span)
        if distance:
            self._add("geometry", paths, ("surface", distance, distance), because or [old.path], span)

    def _mounts(self, old: OccurrenceSnapshot, new: OccurrenceSnapshot) -> None:
        paths = (old.path, new.path)
        because: dict[str, None] | None = None
        for name in {**old.mounts, **new.mounts}:
            old_mount, new_mount = old.mounts.get(name), new.mounts.get(name)
            if old_mount is not None and new_mount is not None and _same_pose(old_mount, new_mount):
                continue
            if because is None:
                because = self._definition_changes(old, new) or self.changes.causes("geometry", paths)
            change: How = "added" if old_mount is None else "removed" if new_mount is None else "moved"
            difference = ("pose", _display_pose(old_mount), _display_pose(new_mount))
            self._add("mount", (f"{old.path}/{name}", f"{new.path}/{name}"), difference, because, _code_location(new.shape), change)

    def _mass(self, old: OccurrenceSnapshot, new: OccurrenceSnapshot) -> None:
        fields: list[Difference] = []
        if old.properties is not None and new.properties is not None:
            fields += _masses(old.properties, new.properties, "")
        elif not _nearly_equal(old.mass, new.mass):
            fields.append(("mass", old.mass, new.mass))
        if old.source != new.source:
            fields.append(("mass_source", old.source, new.source))
        if not fields:
            return
        paths = (old.path, new.path)
        materials = [occurrence.material for occurrence in (old, new) if occurrence.material is not None]
        because = {
            **self._definition_changes(old, new), **self.changes.causes("component", paths, WEIGHED),
            **self.changes.causes("geometry", paths),
            **self.changes.causes("material", materials, ("density", "process.")),
        }
        for difference in fields:
            self._add("mass", paths, difference, because)

    # --- places ------------------------------------------------------------------------------------------------------

    def _places(self) -> None:
        """Compare the poses of parts and frames at q = 0, relative to the base of the old robot."""
        base = next((occurrence for occurrence in self.old.occurrences.values() if occurrence.parent is None), None)
        new_base = self.pairing.path("component", base.path) if base is not None else None
        if base is None or new_base is None or base.place is None or new_base not in self.new.occurrences:
            return
        new_place = self.new.occurrences[new_base].place
        assert new_place is not None
        back = base.place @ new_place.inverse()
        for old, new in self.occurrences:
            if old.place is None or new.place is None:
                continue
            old_pose, new_pose = old.place, back @ new.place
            differences: list[Difference] = []
            if not _same(old_pose.translation, new_pose.translation):
                differences.append(("place", tuple(old_pose.translation), tuple(new_pose.translation)))
            if not all(map(_same, old_pose.rotation, new_pose.rotation)):
                differences.append(("turn", tuple(rpy_of(old_pose.rotation)), tuple(rpy_of(new_pose.rotation))))
            for difference in differences:
                because = self._causes_of_pose(new.path) or self.changes.structure()
                self._add("component", (old.path, new.path), difference, because, change="moved")

    def _causes_of_pose(self, path: str) -> tuple[str, ...]:
        """Return the changes that caused the new pose of a part.

        These changes affect the attachments between the part and the base in the new robot.
        """
        if path not in self._moved:
            self._moved[path] = ()
            occurrence = self.new.occurrences[path]
            if occurrence.parent is not None:
                causes = dict.fromkeys(self._causes_of_pose(occurrence.parent))
                old = self.pairing.old_component(path)
                old_occurrence = self.old.occurrences.get(old) if old is not None else None
                if old_occurrence is None or not self._is_attached_equally(old_occurrence, occurrence):
                    causes |= self._attachment_changes(occurrence)
                    if old_occurrence is not None:
                        causes |= self._attachment_changes(old_occurrence)
                self._moved[path] = tuple(causes)
        return self._moved[path]

    def _is_attached_equally(self, old: OccurrenceSnapshot, new: OccurrenceSnapshot) -> bool:
        if old.parent is None or new.parent is None or self.pairing.path("component", old.parent) != new.parent:
            return False
        parent_place, place = self.old.occurrences[old.parent].place, old.place
        new_parent_place, new_place = self.new.occurrences[new.parent].place, new.place
        return parent_place is not None and place is not None and new_parent_place is not None and new_place is not None and _same_pose(
            parent_place.inverse() @ place, new_parent_place.inverse() @ new_place,
        )

    def _attachment_changes(self, occurrence: OccurrenceSnapshot) -> dict[str, None]:
        """Return the changes that affect how a part is attached: changes of the mate or joint, of the two mounts, and of the two parts."""
        ends = [occurrence.path, *([occurrence.parent] if occurrence.parent is not None else [])]
        above = [path for end in ends for path in above_of(end)]
        causes = self.changes.causes("mate", above) | self.changes.causes_of_mounts(above)
        causes |= self.changes.causes("parameter", ends, ("params.",)) | self.changes.causes("geometry", ends)
        causes |= self.changes.causes("component", ends, MADE)
        if occurrence.joint is not None:
            coordinates = [occurrence.joint, *(f"{occurrence.joint}_{k}" for k in range(6))]
            causes |= self.changes.causes("joint", coordinates, ("turn", "gap", "axis", "offset", "reverse", "parent", "child", "type"))
        return causes

    # --- links and the whole robot -----------------------------------------------------------------------------------

    def _links(self) -> None:
        """Compare the names and frames of the links. If a link consists of several parts, also compare the total mass of the link."""
        olds, news = ({link.frame: link for link in side.links} for side in (self.old, self.new))
        for old, new in self.occurrences:
            before, after = olds.get(old.path), news.get(new.path)
            names = [None if link is None or link.name == frame else link.name for link, frame in ((before, old.path), (after, new.path))]
            if (before is None) != (after is None) or names[0] != names[1]:
                old_name, new_name = (None if link is None else link.name for link in (before, after))
                self._add("component", (old.path, new.path), ("link", old_name, new_name), self.changes.structure())
            if before is None or after is None or len(before.members) == len(after.members) == 1:
                continue
            because: dict[str, None] | None = None
            for difference in _masses(before.properties, after.properties, "link."):
                if because is None:
                    because = self._mass_changes([*before.members, *after.members]) or self.changes.structure()
                self._add("mass", (before.name, after.name), difference, because)

    def _mass_changes(self, paths: Sequence[str]) -> dict[str, None]:
        causes = self.changes.causes("mass", paths)
        causes |= self.changes.causes("component", [above for path in paths for above in above_of(path)], ("place", "turn", *MADE))
        return causes

    def _robot_masses(self) -> None:
        if self.old.whole is None or self.new.whole is None:
            return
        paths = [*self.old.occurrences, *self.new.occurrences]
        for difference in _masses(self.old.whole, self.new.whole, "robot."):
            self._add("mass", ("", ""), difference, self._mass_changes(paths) or self.changes.structure())
        reach, new_reach = _reach(self.old), _reach(self.new)
        if not _nearly_equal(reach, new_reach):
            moved = self.changes.causes("mount", [f"{path}/{name}" for path, one in self.new.occurrences.items() for name in one.mounts])
            moved |= self.changes.causes("component", paths, ("place", "turn"))
            self._add("geometry", ("", ""), ("robot.reach", reach, new_reach), moved or self.changes.structure())

    def _coordinates(self) -> None:
        """Compare the order of the joint coordinates in each mode. Coordinates that exist in only one of the two robots are ignored."""
        joints = [path for kind, path in self.old.things if kind == "joint"]
        known = {path: new for path in joints if (new := self.pairing.path("joint", path)) is not None}
        for mode, names in self.old.coordinates.items():
            new_mode = self.pairing.path("mode", mode) or (mode if mode in self.new.coordinates else None)
            if new_mode is None or new_mode not in self.new.coordinates:
                continue
            old_order = [known[name] for name in names if name in known]
            new_order = [name for name in self.new.coordinates[new_mode] if name in set(old_order)]
            if [name for name in old_order if name in set(new_order)] != new_order:
                because = self.changes.causes("mode", [mode, new_mode], ("root", "cut", "base")) or self.changes.structure()
                self._add("mode", (mode, new_mode), ("coordinates", tuple(names), tuple(self.new.coordinates[new_mode])), because)

    # --- outputs -----------------------------------------------------------------------------------------------------

    def _rows(self) -> None:
        """Compare the rows of the old and new bill of materials that have the same part definition, and compare the print files."""
        olds, news = (group_by(side.rows, lambda row: row.definition) for side in (self.old, self.new))
        renumbered: list[tuple[str, Row, Row]] = []
        causes: dict[str, None] = {}
        for definition in {**olds, **news}:
            ones, others = olds.get(definition, []), news.get(definition, [])
            for one, other in _pair_rows(ones, others, lambda path: self.pairing.path("component", path)):
                members = [*(one.members if one else ()), *(other.members if other else ())]
                if one is None or other is None:
                    because = self._row_changes(members)
                    causes |= because
                    row = one or other
                    assert row is not None
                    self.changes.add(Change(
                        what="bom", change="removed" if other is None else "added", path=definition,
                        old=one.quantity if one else None, new=other.quantity if other else None, because=tuple(because),
                    ))
                    continue
                for field in ("quantity", "make", "material"):
                    before, after = getattr(one, field), getattr(other, field)
                    if before != after:
                        because = self._row_changes(members)
                        causes |= because
                        self._add("bom", (definition, definition), (field, before, after), because)
                if one.number != other.number:
                    renumbered.append((definition, one, other))
        for definition, one, other in renumbered:
            because = self.changes.causes("bom", [*one.members, *other.members], ("bom.number",)) or causes
            self._add("bom", (definition, definition), ("number", one.number, other.number), because)
        self._prints()

    def _row_changes(self, members: Sequence[str]) -> dict[str, None]:
        """Return the user's changes that explain the changes in a row of the bill of materials.

        `members` are the paths of the parts that the row counts.
        """
        materials = [
            occurrence.material for side in (self.old, self.new) for path in members
            if (occurrence := side.occurrences.get(path)) is not None and occurrence.material is not None
        ]
        return {
            **self.changes.causes("component", members, (*MADE, *WEIGHED)), **self.changes.causes("parameter", members, ("params.",)),
            **self.changes.causes("bom", members, ("bom.",)), **self.changes.causes("material", materials, ("process.",)),
        }

    def _prints(self) -> None:
        causes = {
            root: None for change in self.changes.found if change.what in ("component", "parameter") for root in self.changes.roots(change)
        }
        for path in {**self.old.prints, **self.new.prints} if self.old.prints and self.new.prints else {}:
            one, other = self.old.prints.get(path), self.new.prints.get(path)
            if one != other:
                how: How = "added" if one is None else "removed" if other is None else "changed"
                self.changes.add(Change(what="file", change=how, path=path, because=tuple(causes) if how != "changed" else ()))
        olds, news = ({row.stem: row for row in side.rows if row.stem is not None} for side in (self.old, self.new))
        for stem in {**olds, **news}:
            before, after = olds.get(stem), news.get(stem)
            path = f"stl/{stem}.stl"
            if before is None or after is None:
                row = before or after
                assert row is not None
                self.changes.add(Change(
                    what="file", change="removed" if after is None else "added", path=path, because=tuple(self._row_changes(row.members)),
                ))
                continue
            # an equal definition with another shape means that the code of the part has changed
            because = self.changes.causes("geometry", [*before.members, *after.members])
            if because and self._is_reshaped(before, after):
                self.changes.add(Change(what="file", change="changed", path=path, because=tuple(because)))

    def _is_reshaped(self, old: Row, new: Row) -> bool:
        one, other = (side.occurrences[row.members[0]].shape for side, row in ((self.old, old), (self.new, new)))
        return one is not None and other is not None and one.box is not None and not (
            _nearly_equal(one.volume, other.volume) and _nearly_equal(one.area, other.area) and _nearly_equal(one.inertia, other.inertia)
            and _nearly_equal(one.box, other.box, _size(one.box))
        )

    def _outcomes(self) -> None:
        """Compare the results of the document tests of the old and the new robot."""
        if self.old.outcomes is None or self.new.outcomes is None:
            return
        news = {(outcome.test, outcome.where): outcome for outcome in self.new.outcomes}
        all_ = {
            root: None for change in self.changes.found
            if change.what not in ("bom", "file", "test", "sensor") and change.change != "renamed" for root in self.changes.roots(change)
        }
        for old in self.old.outcomes:
            new_test = self.pairing.path("test", old.test)
            where = ", ".join(self.pairing.path("mode" if k == 0 else "pose", word) or word for k, word in enumerate(old.where.split(", ")))
            new = news.get((new_test, where)) if new_test is not None else None
            if new is None or new_test is None:
                continue
            paths = (old.test, new_test)
            because = self.changes.causes("test", paths) | all_
            at = f" [{new.where}]" if new.where else ""
            if old.passed != new.passed:
                self._add("test", paths, (f"passed{at}", old.passed, new.passed), because)
            for name in {**old.measured, **new.measured}:
                before, after = old.measured.get(name), new.measured.get(name)
                if before is None or after is None or not _nearly_equal(before, after, 1e-2):  # ignores changes below about a nanometre
                    self._add("test", paths, (f"measured.{name}{at}", before, after), because)


def _masses(old: MassProperties, new: MassProperties, prefix: str) -> list[Difference]:
    """Return the differences between the mass properties of the old and the new body. If one body is massless, compare only the masses."""
    differences: list[Difference] = []
    if not _nearly_equal(old.mass, new.mass):
        differences.append((f"{prefix}mass", old.mass, new.mass))
    if old.mass or new.mass:
        if not _same(old.centre, new.centre):
            differences.append((f"{prefix}centre", old.centre, new.centre))
        if not _nearly_equal(old.inertia, new.inertia):
            differences.append((f"{prefix}inertia", old.inertia, new.inertia))
    return differences


def _reach(robot: Snapshot) -> float:
    """Return the distance [m] from the origin of the base to the farthest frame or mount of the robot at q = 0."""
    base = next(occurrence.place for occurrence in robot.occurrences.values() if occurrence.parent is None)
    assert base is not None
    back = base.inverse()
    return max(
        hypot(*(back @ place).translation)
        for occurrence in robot.occurrences.values() if occurrence.place is not None
        for place in (occurrence.place, *(occurrence.place @ mount for mount in occurrence.mounts.values()))
    )


def _nearly_equal(old: DisplayValue, new: DisplayValue, scale: float = 0.0) -> bool:
    """Return whether two values are equal within the numerical precision of the volume integrals that computed them."""
    if isinstance(old, tuple) and isinstance(new, tuple):
        scale = max(scale, largest(old), largest(new))
        return len(old) == len(new) and all(_nearly_equal(one, other, scale) for one, other in zip(old, new, strict=True))
    if isinstance(old, (int, float)) and isinstance(new, (int, float)):
        return abs(old - new) <= SHAPES * max(abs(old), abs(new), scale) or abs(old - new) < 1e-18
    return equal(old, new)


def _code_location(record: PartRecord | None) -> Span | None:
    """Return the location of the class of a part, or None if it is unknown."""
    return None if record is None or record.code is None else line_of(*record.code)


def _size(box: tuple[Sequence[float], Sequence[float]]) -> float:
    return max(b - a for a, b in zip(*box, strict=True))


def _same_pose(old: Pose, new: Pose) -> bool:
    return _same(old.translation, new.translation) and all(map(_same, old.rotation, new.rotation))


def _same(old: Sequence[float], new: Sequence[float]) -> bool:
    return all(abs(a - b) < 1e-9 for a, b in zip(old, new, strict=True))


def _display_pose(pose: Pose | None) -> DisplayValue:
    return None if pose is None else (tuple(pose.translation), tuple(rpy_of(pose.rotation)))


def _pair_rows(olds: list[Row], news: list[Row], path: Callable[[str], str | None]) -> list[tuple[Row | None, Row | None]]:
    """Match rows of the old and the new bill of materials that have the same part definition.

    Rows that have a part in common are matched first. The remaining rows are matched in order.
    """
    left, pairs = list(news), []
    rest: list[Row] = []
    for old in olds:
        members = {path(member) for member in old.members}
        same = next((new for new in left if members & set(new.members)), None)
        if same is None:
            rest.append(old)
        else:
            left.remove(same)
            pairs.append((old, same))
    both = min(len(rest), len(left))
    pairs += zip(rest[:both], left[:both], strict=True)
    return [*pairs, *((old, None) for old in rest[both:]), *((None, new) for new in left[both:])]


class Comparison(OneLineStruct):
    """The result of comparing two states of one robot: the changes in documents, followed by the consequences of these changes.

    `unknown` lists the kinds of information that were not compared. If pictures were requested, `pictures` maps the names `before`, `after`
    and `overlay` to PNG data. If the two states are the same mechanism with other frames, joint zeros or signs, `mechanism` describes them.
    `changes` then omits the changes that this description explains, which are in `explained`.
    """

    name: str
    changes: tuple[Change, ...]
    unknown: tuple[str, ...] = ()
    pictures: Mapping[str, bytes] = {}
    mechanism: str = ""
    explained: tuple[Change, ...] = ()


def compare(old: Snapshot, new: Snapshot, farthest: Farthest = lambda old, new: None) -> Comparison:
    """Compare the snapshots of the old and the new robot, and return the changes.

    The function `farthest` returns the distance between two surfaces. Without this function, surfaces are not compared.
    """
    pairing = NameMapping(old, new)
    changes = DocumentComparison(pairing).changes
    _Consequences(pairing, changes, farthest).all()
    ordered = sorted(changes.found, key=lambda change: change.caused)
    return Comparison(name=new.name, changes=tuple(ordered), unknown=tuple(sorted(old.lacks | new.lacks)))
