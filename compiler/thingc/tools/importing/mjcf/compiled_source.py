"""Compile an MJCF source with MuJoCo, and find the name and the source location of each element. Redundant sites are removed."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from thingc.base.inertia import MassProperties
from thingc.base.pose import NO_POSE, Pose, rotation_of
from thingc.base.source import Span
from thingc.model.assembly.mass import stated_inertia
from thingc.tools.importing.document_names import plain_name
from thingc.tools.importing.mjcf.flattened_source import FlattenedSource
from thingc.tools.importing.quantities import same_place
from thingc.tools.importing.source_model import Raw
from thingc.tools.importing.xml_source import SourceElement

WORLD = 0
KINDS = ("body", "joint", "geom", "site", "camera", "actuator", "sensor", "equality", "tendon")
ROUNDED = 1e-14
"""Tolerance for comparing vectors of numbers, relative to the largest absolute value."""
_ALIKE = 1e-9
MANY = {"body": "bodies", "equality": "equalities"}
SOLREF, SOLIMP = "0.02 1", "0.9 0.95 0.001 0.5 2"
"""MuJoCo's default values of `solref` and `solimp`, which define the softness of constraints."""
SITE = 6
SPHERE, CYLINDER, STEP = 4, 5, 3
"""Values of `mjtWrap`: a tendon wraps around a sphere or a cylinder, or passes through a site."""
AT_SITE, AT_CRANK = 4, 2
OF_LOOP = re.compile(r":(parent|child|held)(_1)?")
"""Suffixes in the names of sites that thingc writes for closed loops and held components."""


class CompiledSource:
    """A MuJoCo model before compilation (`spec`) and after compilation (`model`).

    The arguments of methods are indices of elements in `model`. All elements have names. Names that are missing in the source are
    generated. `geoms_of`, `sites_of` and `joints_of` contain the indices of the geoms, sites and joints of each body. `frames_of` contains,
    for each body, the sites that coincide with the frame of the body. `second_names` maps the name of a site to those of its duplicates.
    """

    def __init__(self, flat: FlattenedSource, spec: Any, model: Any) -> None:
        self.flat, self.spec, self.model = flat, spec, model
        self.losses = flat.losses
        self.geoms_of, self.sites_of, self.joints_of = (
            _by_body(bodies, model.nbody) for bodies in (model.geom_bodyid, model.site_bodyid, model.jnt_bodyid)
        )
        self.written = {kind: {one.id: one for one in getattr(spec, MANY.get(kind, f"{kind}s"))} for kind in KINDS}
        self.names: dict[str, dict[int, str]] = {}
        self.bodies = self._names("body", lambda one: "body")
        self.bodies[WORLD] = "world"
        self.joints = self._names("joint", lambda one: f"{one.parent.name or 'body'}_joint")
        self.geoms = self._names("geom", lambda one: f"{one.parent.name or 'body'}_geom")
        self.sites = self._names("site", lambda one: f"{one.parent.name or 'body'}_site")
        self.second_names: dict[str, list[str]] = {}
        self._leave_out_doubles()
        self.tendons = self._names("tendon", lambda one: "tendon")
        self.actuators = self._names("actuator", lambda one: one.target or "actuator")
        self.sensors = self._names("sensor", lambda one: one.objname or "sensor")
        self.cameras = self._names("camera", lambda one: "camera")
        self.equalities = self._names("equality", lambda one: f"{one.name1}_to_{one.name2}")
        self.custom: dict[str, dict[str, tuple[float, ...]]] = {}
        self._read_numbers()

    def _read_numbers(self) -> None:
        """Read the velocity limits of joints and the properties of actuators that MJCF does not support.

        thingc writes them to custom `<numeric>` elements with names such as `elbow:velocity`. Other `<numeric>` elements are recorded as
        losses.
        """
        for one in self.spec.numerics:
            name, _, key = one.name.rpartition(":")
            data, size = floats(one.data), {"velocity": 1, "stall": 2, "deadband": 1, "noise": 1}.get(key)
            if len(data) == size and min(data) > 0.0 and name in (self.joints if key == "velocity" else self.actuators).values():
                self.custom.setdefault(name, {})[key] = data
            else:
                self.losses.note(f"the number `{one.name}`", "documents cannot store custom data", self.flat.place(one.info))

    def _leave_out_doubles(self) -> None:
        """Remove redundant sites: duplicates of other sites, sites that coincide with the frame of their body, and ends of closed loops.

        References to a duplicate are replaced by references to the original site.
        """
        model, names = self.model, self.sites
        poses = {site: pose_of(model.site_pos[site], model.site_quat[site]) for site in names}
        used, joined = {*_used_sites(model)}, {*_connected_sites(model)}
        closed = {site for site in joined - used if OF_LOOP.search(names[site])}
        frames, kept = set[int](), [list[int]() for _ in self.sites_of]
        for site in (site for site in range(model.nsite) if site not in closed):
            name, pose, body = names[site], poses[site], int(model.site_bodyid[site])
            others, named = kept[body], plain_name(self.bodies[body], "link")
            other = next((one for one in others if _is_second(name, names[one], named) and same_place(poses[one], pose)), None)
            of_body = name in (self.bodies[body], named) or name == f"{named}/origin" and not int(model.body_parentid[body])
            if other is not None:
                self.second_names.setdefault(names[other], []).append(name)
                names[site] = names[other]
            elif of_body and site not in used and same_place(pose, NO_POSE):
                frames.add(site)
            else:
                others.append(site)
        self.frames_of = [[site for site in sites if site in frames] for sites in self.sites_of]
        self.sites_of = kept

    def _names(self, kind: str, made_up: Any) -> dict[int, str]:
        """Return the names of all elements of the given kind, keyed by the index of the element."""
        used_names = {one.name for one in self.written[kind].values()}
        names = self.names[kind] = dict[int, str]()
        counts: Counter[str] = Counter()
        for number, one in sorted(self.written[kind].items()):
            word = name = one.name or made_up(one)
            while not one.name and name in used_names:
                counts[word] += 1
                name = f"{word}_{counts[word] + 1}"
            used_names.add(name)
            names[number] = name
        return names

    def where(self, kind: str, number: int, attribute: str | None = None) -> Span:
        """Return the location in the MJCF source of the element with the given kind and index."""
        return self.flat.place(self.written[kind][number].info, attribute)

    def lose(self, kind: str, number: int, what: str, why: str) -> None:
        """Record an import loss at the source location of an element."""
        self.losses.note(what, why, self.where(kind, number))

    def element(self, kind: str, number: int) -> SourceElement:
        """Return the XML element in the source for an element of the compiled model.

        Return the root element if the source location is unknown.
        """
        return self.flat.element(self.written[kind][number].info)

    def mass_properties(self, body: int) -> MassProperties:
        """Return the mass properties of a body in the frame of the body."""
        model, (a, b, c) = self.model, floats(self.model.body_inertia[body])
        principal = MassProperties(mass=float(model.body_mass[body]), inertia=((a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c)))
        properties = principal.seen_from(pose_of(model.body_ipos[body], model.body_iquat[body]))
        full = floats(self.written["body"][body].fullinertia)
        if all(map(math.isfinite, full)):  # prefer the values in the source, because MuJoCo rotates them twice
            written, least = stated_inertia(full), _ALIKE * max(map(abs, full))
            if all(abs(one - other) <= least for one, other in zip(sum(written, ()), sum(properties.inertia, ()), strict=True)):
                return replace(properties, inertia=written)
        return properties

    def bounds(self, name: str, number: int) -> tuple[float, float] | None:
        """Return the lower and upper bound of an element's range, such as `actuator_ctrl`, or None if the element is unlimited."""
        if not getattr(self.model, f"{name}limited")[number]:
            return None
        low, high = floats(getattr(self.model, f"{name}range")[number])
        return low, high

    def texts(self, number: int, arrays: Mapping[str, str]) -> list[tuple[str, str]]:
        """Return the XML attributes of an element. `arrays` maps their names to arrays of the compiled model."""
        return [(name, numbers(getattr(self.model, array)[number])) for name, array in arrays.items()]

    def lose_nonlinear(self, kind: str, number: int, arrays: Mapping[str, int]) -> None:
        """Record an import loss if a joint or tendon has nonlinear damping or stiffness. `arrays` maps array names to rows."""
        for array, index in arrays.items():
            polynomial = getattr(self.model, array, None)  # older versions of MuJoCo have no such arrays
            if polynomial is not None and any(floats(polynomial[index])):
                what = f"nonlinear damping or stiffness of {kind} `{self.names[kind][number]}`"
                self.lose(kind, number, what, "damping and stiffness in a document are numbers")

    def frame(self, written: Any) -> Pose:
        """Return the pose of an element relative to its body, as specified in the source.

        Poses of enclosing `<frame>` elements are included.
        """
        pose, frame = self._own(written), written.frame
        while frame is not None:
            pose, frame = self._own(frame) @ pose, frame.frame
        return pose

    def _own(self, written: Any) -> Pose:
        quat = written.quat
        if int(written.alt.type):
            compiler = written.compiler
            quat = self.spec.resolve_orientation(degree=compiler.degree, sequence=compiler.eulerseq, orientation=written.alt)
        return pose_of(written.pos, quat)


def _by_body(bodies: Iterable[Any], count: int) -> list[list[int]]:
    """Return the indices of the elements of each body, in ascending order."""
    by_body: list[list[int]] = [[] for _ in range(count)]
    for number, body in enumerate(bodies):
        by_body[int(body)].append(number)
    return by_body


def floats(values: Any) -> tuple[float, ...]:
    """Convert an array or a number to a tuple of floats, and replace -0 by 0."""
    return tuple(float(one) + 0.0 for one in (values if isinstance(values, Iterable) else (values,)))


def pose_of(pos: Any, quat: Any) -> Pose:
    """Convert a position [m] and a nonzero quaternion (w, x, y, z) to a pose."""
    (x, y, z), (w, i, j, k) = floats(pos), floats(quat)
    return NO_POSE if (w, x, y, z, i, j, k) == (1.0, *(0.0,) * 6) else Pose(rotation=rotation_of((w, i, j, k)), translation=(x, y, z))


def numbers(values: Any) -> str:
    """Format numbers as the value of an XML attribute.

    Each number has as few digits as possible without changing its double-precision value.
    """
    return " ".join(repr(int(one)) if one == int(one) and abs(one) < 1e15 else repr(one) for one in floats(values))


def differing(attributes: Sequence[tuple[str, str]], otherwise: dict[str, str]) -> Raw:
    """Return the attributes of an element that differ from the default values `otherwise` by more than rounding errors."""
    return tuple((name, value) for name, value in attributes if not _alike(value, otherwise.get(name, "")))


def _alike(one: str, other: str) -> bool:
    if one == other:
        return True
    try:
        these, those = [float(word) for word in one.split()], [float(word) for word in other.split()]
    except ValueError:
        return False
    near = ROUNDED * max(map(abs, (*these, *those)), default=0.0)
    return len(these) == len(those) and all(abs(a - b) <= near for a, b in zip(these, those, strict=True))


def _is_second(name: str, other: str, body: str) -> bool:
    """Return whether thingc may have written the site named `name` as a duplicate of the site named `other`."""
    return "/" in name and ("/" not in other or name.startswith(f"{body}/")) or name.endswith(":volume")


def _used_sites(model: Any) -> Iterator[int]:
    """Yield the indices of the sites to which sensors, tendons and actuators refer."""
    for kind, thing in (("objtype", "objid"), ("reftype", "refid")):
        at = zip(getattr(model, f"sensor_{kind}"), getattr(model, f"sensor_{thing}"), strict=True)
        yield from (int(number) for of, number in at if int(of) == SITE)
    for kind, number, side in zip(model.wrap_type, model.wrap_objid, model.wrap_prm, strict=True):
        if int(kind) == STEP:
            yield int(number)
        elif int(kind) in (SPHERE, CYLINDER):
            yield int(side)
    for kind, ends in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
        if int(kind) in (AT_SITE, AT_CRANK):
            yield from map(int, ends)


def _connected_sites(model: Any) -> Iterator[int]:
    """Yield the indices of the sites to which equality constraints refer."""
    for kind, *ends in zip(model.eq_objtype, model.eq_obj1id, model.eq_obj2id, strict=True):
        if int(kind) == SITE:
            yield from map(int, ends)
