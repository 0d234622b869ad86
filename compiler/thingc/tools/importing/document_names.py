"""Choose the names of the elements of an imported robot in the generated document, and pair visual shapes with equal collision shapes."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence, Set
from functools import cached_property, partial
from itertools import count

from thingc.base.export_names import TAKEN, is_file_name
from thingc.base.grouping import group_by
from thingc.base.pose import Pose
from thingc.base.source import Path, Span
from thingc.documents.load.yaml_scalars import core_value
from thingc.documents.spec.name_types import RESERVED
from thingc.tools.importing.quantities import TURNS, same_place, was
from thingc.tools.importing.source_model import Attachment, SourceLink, SourceMotion, SourceRobot, SourceShape, SourceThing
from thingc.tools.importing.tree import by_parent, downwards
from thingc.tools.importing.update_import import PreviousImport

LONGEST = 100
"""Maximum number of characters of a name. Longer names are cut."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def plain_name(name: str, kind: str) -> str:
    """Convert a name to a valid document name, which consists of letters, digits and `_`.

    If the name does not start with a letter, the function prepends `kind`. If the name is reserved, or if YAML does not parse the name as a
    string, the function appends `kind`.
    """
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_")[:LONGEST] or kind
    if not _NAME.fullmatch(plain):
        plain = f"{kind}_{plain}"
    return f"{plain}_{kind}" if plain.lower() in RESERVED or not isinstance(core_value(plain), str) else plain


class UsedNames:
    """The document names that are in use, and the names in the set `enclosing`. Names that differ only in case count as equal.

    A further name takes constant time, because robots can have thousands of elements.
    """

    def __init__(self, names: Iterable[str] = (), enclosing: Container[str] = ()) -> None:
        self._lower, self._enclosing = {name.lower() for name in names}, enclosing
        self._numbers: defaultdict[str, Iterator[int]] = defaultdict(partial(count, 2))

    def __contains__(self, name: object) -> bool:
        return str(name).lower() in self._lower or name in self._enclosing

    def add(self, name: str) -> None:
        """Add a name that is in use."""
        self._lower.add(name.lower())

    def take(self, name: str, kind: str) -> str:
        """Convert a name to a valid document name that is not in use, and add this name."""
        plain = plain_name(name, kind)
        candidate = plain
        while candidate in self:
            candidate = f"{plain}_{next(self._numbers[plain])}"
        self.add(candidate)
        return candidate

    def take_all(self, names: Iterable[str], kind: str, earlier: Mapping[str, str] | None = None) -> dict[str, str]:
        """Map each of the names to a document name that is not in use, and add these names.

        A name in the mapping `earlier`, from an earlier import, keeps its document name. A valid name does not change, and has precedence
        over an equal name that results from a conversion.
        """
        unique_names, known = list(dict.fromkeys(names)), earlier or {}
        order = sorted(unique_names, key=lambda name: (name not in known, plain_name(name, kind) != name))
        taken = {name: self.take(known.get(name, name), kind) for name in order}
        return {name: taken[name] for name in unique_names}


class DocumentNaming:
    """The names of the elements of an imported robot in the generated document.

    Most attributes map a source name to a document name. `links` contains the links that become components, and `frames` the links that
    become mounts of their parents. `order` lists the attachments of the kinematic tree, starting at the root. `shown` lists the mounts that
    the document exports. `meshes` maps the mesh URIs of shapes to file paths. Elements keep their names from an `earlier` import. `moving`
    lists the joints. `places` maps key paths of the document to elements of the source, and is filled while the document is written.
    """

    def __init__(self, robot: SourceRobot, meshes: Mapping[str, str], earlier: PreviousImport | None) -> None:
        self.robot, self.meshes = robot, meshes
        self.name = plain_name(robot.name, "robot")
        self.link_of = {link.name: link for link in robot.links}
        self.below = by_parent(robot.attachments)
        self.order = tuple(downwards(robot.root, robot.attachments))
        self.above = {one.child: one for one in self.order}
        self.moving = [joint for one in self.order for joint in one.joints]
        self.places: dict[Path, Span] = {(): robot.where}
        used_links, (old_links, old_joints) = UsedNames(), ({}, {}) if earlier is None else (earlier.links, earlier.joints)
        names = used_links.take_all([robot.root, *(one.child for one in self.order)], "link", old_links)
        self.frames = {one.child: names[one.child] for one in self.order if self._is_mount(one)}
        self.links = {name: word for name, word in names.items() if name not in self.frames}
        self.points = self._points(used_links)
        sites = [site.name for link in robot.links for site in link.sites]
        self.sites = UsedNames(names.values()).take_all(sites, "mount", self._paths(sites))
        moving = [joint.name for joint in self.moving]
        self.joints = UsedNames().take_all(moving, "joint", old_joints)
        self.loops = UsedNames(self.joints.values()).take_all([loop.name for loop in robot.loops], "loop")
        # the mounts of joints and the exported mounts of a component must have different names
        self.shown = {*self.frames.values(), *self.sites.values()}
        used_mounts = UsedNames(self.shown)
        self.mounts = used_mounts.take_all(moving, "joint", self.joints)
        self.ends = used_mounts.take_all(self.loops.values(), "loop")
        self.magnets: dict[str, str] = {}
        for magnets in group_by(robot.adhesions, lambda one: one.link).values():
            # mounts of joints are not exported, so the mounts of two links can have the same name
            on = [one.name for one in magnets]
            self.magnets |= UsedNames(enclosing=used_mounts).take_all(on, "magnet", self._paths(on))
        used_mounts = UsedNames(self.magnets.values(), used_mounts)
        places = {one.name: (one.link, one.pose) for one in robot.sensors if one.kind == "camera" and one.link is not None}
        self.cameras = self._name_mounts(places, "camera", used_mounts)
        wraps = [step.around for one in robot.tendons for step in one.steps if step.around is not None]
        self.centres = self._name_mounts({one.name: (one.link, one.pose) for one in wraps}, "shape", used_mounts)
        joints = [*self.joints.values(), *self.loops.values()]
        self.tendons = UsedNames(joints).take_all([one.name for one in robot.tendons], "tendon")
        stems = [word.rpartition("_")[0] for word in (*joints, *self.tendons.values())]  # `wrist_0` is a drive of the differential `wrist`
        self.transmissions = UsedNames(stems).take_all([one.name for one in robot.transmissions], "transmission")
        used_sensors, self.sensors = UsedNames(), list[str]()
        for sensor in robot.sensors:
            things = self.joints if sensor.joint is not None else self.tendons if sensor.tendon is not None else self.sites
            self.sensors.append(used_sensors.take(things.get(sensor.name, sensor.name), "sensor"))
        motions: list[tuple[str, SourceMotion]] = [(self.joints[one.name], one) for one in self.moving]
        motions += [(self.tendons[one.name], one) for one in robot.tendons]
        self.driven = [(word, one.name, one.drive) for word, one in motions if one.drive is not None]
        drives = {word for name, word in (*self.joints.items(), *self.tendons.items()) if name != word}
        self.added = self._name_added(drives.union(word for word, _, _ in self.driven))
        self.poses = UsedNames().take_all([one.name for one in robot.poses], "pose")
        self.usual = {id(shape): name for link in self.links for shape, name in self._usual(link)}

    def entry(self, section: str, name: str, thing: SourceThing) -> str:
        """Return the line that begins an entry of a section of the document, and record the source location of the entry."""
        self.places[section, name] = thing.where
        return f"  {name}:{was(name, thing.name)}"

    @cached_property
    def turning(self) -> set[str]:
        """The source names of the joints whose coordinates are angles."""
        return {joint.name for joint in self.moving if joint.kind in TURNS}

    @cached_property
    def repeated(self) -> set[str | None]:
        """The source names that several shapes have."""
        named = Counter((link.name, shape.use, shape.name) for link in self.robot.links for shape in link.shapes)
        owners = Counter(name for _, name in {(link, name) for link, _, name in named})
        return {name for (_, _, name), count in named.items() if count > 1 or owners[name] > 1}

    @property
    def geared(self) -> set[str]:
        """The source names of the joints that have a transmission with one actuator."""
        return {one.joints[0] for one in self.robot.transmissions if len(one.joints) == 1}

    def _points(self, used: UsedNames) -> dict[str, str]:
        """Return component names for the point masses of the links that have a mass and shapes, but no inertia."""
        return {
            link.name: used.take(f"{self.links[link.name]}_mass", "link") for link in self.robot.links
            if link.weight is not None and not any(map(any, link.weight.properties.inertia)) and any(map(self.is_shown, link.shapes))
        }

    def _name_added(self, drives: Set[str]) -> dict[tuple[str, str], str]:
        """Return the names of the elements that are added to the MuJoCo model unchanged, keyed by section and source name.

        The names of drives in `drives` are not used for actuators.
        """
        added: dict[tuple[str, str], str] = {}
        used = UsedNames(drives)
        for element in self.robot.added:
            name = element.name
            if name and (not is_file_name(name) or element.section == "actuator" and name in drives):
                name = used.take(name, element.section)
            used.add(name)
            added[element.section, element.name] = name
        return added

    def _paths(self, names: Sequence[str]) -> dict[str, str]:
        """Return the mount names of the sites whose source names are paths, such as `hand/tip`.

        Models that thingc wrote contain such sites. The site `hand/tip` becomes the mount `tip` of the link `hand`, unless the name `tip`
        is taken or reserved.
        """
        links = {*self.links.values()}
        mounts = {name: name.rpartition("/")[2] for name in names if "/" in name and name.partition("/")[0] in links}
        counts = Counter([*names, *mounts.values()])
        return {name: mount for name, mount in mounts.items() if counts[mount] == 1 and mount.lower() not in RESERVED}

    def _name_mounts(self, places: Mapping[str, tuple[str, Pose]], kind: str, used: UsedNames) -> dict[str, str]:
        """Return the name of a mount for each pose in `places`. If a mount with the same pose exists, its name is returned.

        `places` maps source names to a link and a pose in the frame of the link.
        """
        existing = {
            name: next((word for word, at in self._shown_on(link) if same_place(at, pose)), None) for name, (link, pose) in places.items()
        }
        new_names = used.take_all([name for name, word in existing.items() if word is None], kind)
        return {name: word or new_names[name] for name, word in existing.items()}

    def _shown_on(self, link: str) -> Iterator[tuple[str, Pose]]:
        """Yield the name of each exported mount of a link, and the pose of the mount in the frame of the link."""
        yield from ((self.sites[site.name], site.pose) for site in self.link_of[link].sites)
        yield from ((self.frames[one.child], one.pose) for one in self.below.get(link, ()) if one.child in self.frames)

    def _is_mount(self, attachment: Attachment) -> bool:
        link = self.link_of[attachment.child]
        return not (attachment.joints or link.weight or link.shapes or attachment.child in self.below)

    def in_files(self) -> dict[str, dict[str, str]]:
        """Return the section `names` of the document, which maps document names to names in generated models for each kind of element.

        The section contains only elements whose source name differs from their default name in generated models. If two elements have the
        same source name, only the first element is included. Links precede sites.
        """
        moving = {one.name: self.loops[one.name] for one in self.robot.loops if one.kind != "fixed"}  # welds are not joints
        kinds: dict[str, list[tuple[str, str, str]]] = {  # entries: document name, source name, default name in models
            "components": [(word, name, word) for name, word in self.links.items()],
            "mounts": [(word, name, word) for name, word in (*self.frames.items(), *self.sites.items())],
            "joints": [(word, name, word) for name, word in (*self.joints.items(), *moving.items(), (self.robot.free_joint, "root"))],
            "tendons": [(word, name, word) for name, word in self.tendons.items()],
            "actuators": [(word, drive.name, name) for word, name, drive in self.driven],
            "equalities": [
                (word.rpartition(":")[0], name, word)
                for name, word in self._name_equalities().items() if word.endswith((":mimic", ":loop"))
            ],
            "sensors": [
                named for one, word in zip(self.robot.sensors, self.sensors, strict=True)
                for named in ([(f"{word}:{part}", of, f"{word}:{part}") for of, part in one.parts] or [(word, one.name, word)])
            ],
            "poses": [(word, name, word) for name, word in self.poses.items()],
        }
        names: dict[str, dict[str, str]] = {}
        for kind, things in kinds.items():
            used_names = {*TAKEN.get(kind, ()), *(self.links if kind == "mounts" else ())}
            for word, name, usual in things:
                if name not in used_names and name != usual and is_file_name(name):
                    names.setdefault(kind, {})[word] = name
                used_names.add(name)
        return names

    @cached_property
    def other_names(self) -> dict[str, dict[str, str]]:
        """The document names of sites, loops, tendons, actuators, equalities, sensors, poses and geoms.

        The result maps each kind of element to a mapping from source names to document names.
        """
        drives = {drive.name: word for word, _, drive in self.driven}
        magnets = {one.name: f"{self.links[one.link]}/{self.magnets[one.name]}" for one in self.robot.adhesions}
        parts = {of: f"{word}:{part}" for one, word in zip(self.robot.sensors, self.sensors, strict=True) for of, part in one.parts}
        second = {other: self.sites[site.name] for link in self.robot.links for site in link.sites for other in site.others}
        second |= {name: f"{self.links[link.name]}.origin" for link in self.robot.links for name in link.frames}
        kinds = {
            "sites": self.sites | second, "loops": self.loops, "tendons": self.tendons,
            "actuators": drives | magnets | self._of("actuator"), "equalities": self._name_equalities(),
            "sensors": parts | self._of("sensor"), "poses": self.poses,
        }
        kinds["geoms"] = {
            f"{link}/{shape.name}" if shape.name in self.repeated else shape.name: self.title(shape) or self.usual[id(shape)]
            for link in self.links for shape in self.link_of[link].shapes if self.is_shown(shape) and shape.name is not None
        }
        return {kind: dict(names) for kind, names in kinds.items() if names}

    def _usual(self, link: str) -> Iterator[tuple[SourceShape, str]]:
        """Yield each imported shape of a link, and the default name of the shape in generated models."""
        shown_shapes = [shape for shape in self.link_of[link].shapes if self.is_shown(shape)]
        for use in ("visual", "collision"):
            for number, shape in enumerate(shape for shape in shown_shapes if shape.use == use):
                usual = f"{self.links[link]}:{use}_{number}" if number else f"{self.links[link]}:{use}"
                yield shape, self.links[link] if usual.endswith(":visual") else usual

    def title(self, shape: SourceShape) -> str | None:
        """Return the source name of a shape if the document must specify this name, else None.

        A source name that several shapes have cannot be used, because names are unique in MuJoCo models.
        """
        name = shape.name
        return name if name is not None and name not in self.repeated and name != self.usual[id(shape)] and is_file_name(name) else None

    def _name_equalities(self) -> dict[str, str]:
        """Map the source name of each MuJoCo equality to the default name of the equality in generated models."""
        tied = {one.follows.name: f"{self.joints[one.name]}:mimic" for one in self.moving if one.follows}
        tied |= {one.equality: f"{self.loops[one.name]}:loop" for one in self.robot.loops} | self._of("equality")
        return {name: word for name, word in tied.items() if name}

    def _of(self, section: str) -> dict[str, str]:
        """Map the source names of the elements that are added to a section of the MuJoCo model to document names."""
        return {name: word for (of, name), word in self.added.items() if of == section}

    def items(self, link: SourceLink) -> Iterator[tuple[SourceShape, SourceShape | None]]:
        """Yield the items of the list `shapes` of a link. Each item consists of a shape, and of an equal collision shape or None.

        A visual shape and a collision shape become one item if they have the same kind, size, pose and mesh. The order of the visual shapes
        and the order of the collision shapes do not change.
        """
        shapes = [shape for shape in link.shapes if self.is_shown(shape)]
        collisions = [shape for shape in shapes if shape.use == "collision"]
        collision_of: dict[int, SourceShape] = {}
        for same_element in (True, False):  # first pair shapes from the same source element, and then other equal shapes
            for number, shape in enumerate(shapes):
                matching = [
                    one for one in collisions if _form(one) == _form(shape) and (one.where == shape.where or not same_element)
                    and ((name := self.title(shape)) in (None, (own_title := self.title(one))) or name.startswith(f"{own_title}:visual"))
                ]
                if shape.use == "visual" and number not in collision_of and matching:
                    collision_of[number] = matching[0]
                    collisions = [one for one in collisions if one is not matching[0]]
        place = {id(shape): number for number, shape in enumerate(shapes)}
        for number, shape in enumerate(shapes):
            collision = collision_of.get(number)
            while collisions and collision is not None and place[id(collisions[0])] < place[id(collision)]:
                yield collisions[0], collisions.pop(0)
            if shape.use == "visual":
                yield shape, collision
            elif collisions and collisions[0] is shape:
                yield shape, collisions.pop(0)

    def is_shown(self, shape: SourceShape) -> bool:
        """Return whether the document contains a shape of the source. Only meshes that were not imported are missing from the document."""
        return shape.mesh is None or shape.mesh in self.meshes


def _form(shape: SourceShape) -> tuple[object, ...]:
    """Return the kind, size, pose and mesh of a shape.

    A visual and a collision shape for which these values are equal become one item in the document.
    """
    return shape.kind, shape.size, shape.pose, shape.mesh
