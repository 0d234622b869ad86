"""Adapt MJCF models to MJX, the implementation of MuJoCo in JAX (`mjx.put_model`).

The lists of unsupported features are taken from the source code of MJX.

In this source code, `collision_driver.py` lists the supported pairs of shapes. `types.py` lists the supported options and kinds of
actuators.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.mjcf import adhesion_contacts
from thingc.targets.mjcf.compat.consumer import Consumer, Refusal, UnsupportedOptions
from thingc.targets.mjcf.compat.contact_pairs import ContactGeom, pairs
from thingc.targets.xml_writer import Element

UNSUPPORTED_PAIRS = frozenset(map(frozenset, (("cylinder", "box"), ("cylinder", "mesh"), ("ellipsoid", "box"), ("ellipsoid", "mesh"))))
"""Pairs of shapes between which MJX does not support contacts."""

UNSUPPORTED = UnsupportedOptions(solvers=("PGS",), enabled=("override", "energy", "fwdinv", "diagexact"))

SIDES = 20
"""Number of sides of the prism that replaces a cylinder.

With this number, the prism deviates from the cylinder by at most 1.2 % of the radius. MJX would warn about faces with more corners.
"""

FLUID = ("density", "viscosity", "wind")


def _adapt(robot: Robot, root: Element) -> Iterator[Loss]:
    if robot.base == "held" and len(robot.bodies) > 1:
        what = "the motion of the base: MJX does not move the children of a mocap body"
        yield Loss("mjcf", robot.mode.name, robot.mode.name, what, "omitted", robot.mode.origin)
    yield from _integrator(robot, root)
    yield from _prisms(root)
    _margins(root)
    _cones(root)
    if not _needed_adhesion(robot):
        yield from _adhesions(robot, root)


def _find_refusals(robot: Robot, root: Element) -> Iterator[Refusal]:
    needed = _needed_adhesion(robot)
    if needed:
        names = " and ".join(f"`{path}`" for path in needed)
        yield Refusal(
            what=f"the adhesion at {names} is not supported", origin=robot.mode.origin, path=robot.mode.name,
            hint="exclude the mode with `--mode`, or use another root",
        )
    yield from UNSUPPORTED.refusals(root)
    for delayed in (element for element in root.walk() if element.get("nsample")):
        yield Refusal(what="delays are not supported", origin=delayed.origin, path=delayed.get("name"), hint="remove `delay`")
    option = root.find_or_empty("option")
    if option.get("integrator") == "implicitfast":
        for name in FLUID:
            if any(float(value) for value in option.get(name, "0").split()):
                raw = option.raw[name].attribute
                what = f"`{name}` is not supported with `implicitfast`"
                yield Refusal(what=what, origin=raw.origin, path=name, hint=f"remove `{name}`")
    contacts = list(pairs(root))
    elliptic = option.get("cone") == "elliptic"
    if elliptic and not needed and all(first.element is None for first, _ in contacts):
        raw_cone = option.raw.get("cone")
        yield Refusal(
            what="elliptic cones are not supported without contacts",
            origin=robot.mode.origin if raw_cone is None else raw_cone.attribute.origin, path="cone",
            hint=f"load `scene_{robot.mode.name}.xml`, or write `cone: pyramidal` under `simulation`",
        )
    distinct: dict[object, tuple[ContactGeom, ContactGeom]] = {}
    for pair in contacts:
        distinct.setdefault(tuple(map(_kind, pair)), pair)
    for first, second in distinct.values():
        blamed = second if first.element is None else first
        assert blamed.element is not None
        name = blamed.element.get("name")
        for fault, key, hint in _faults(first, second, elliptic=elliptic):
            owner = next((geom.element for geom in (first, second) if geom.element is not None and key in geom.element.raw), blamed.element)
            raw_value = owner.raw.get(key)
            origin = raw_value.attribute.origin if raw_value is not None else owner.origin
            yield Refusal(what=fault, origin=origin, path=name.partition(":")[0], hint=f"{hint}, or exclude the pair")


def _faults(first: ContactGeom, second: ContactGeom, *, elliptic: bool) -> Iterator[tuple[str, str, str]]:
    """Yield the reasons why MJX rejects a contact between two geoms, the attributes that cause the rejections, and the help texts."""
    kinds = sorted((first.type, second.type))
    if frozenset(kinds) in UNSUPPORTED_PAIRS:
        yield f"contacts between {kinds[0]} and {kinds[1]} are not supported", "type", "choose another `collision`"
    if "mesh" in kinds and first.margin + second.margin:
        yield "`margin` is not supported for contacts of meshes", "margin", "remove `margin`"
    if elliptic and _condim(first, second) == 1:
        yield "frictionless contacts are not supported with elliptic cones", "condim", "write `cone: pyramidal` under `simulation`"


def _condim(first: ContactGeom, second: ContactGeom) -> int:
    """Return the dimension `condim` of a contact: the value of the geom with the higher priority, or else the larger value."""
    values = [geom.values for geom in (first, second)]
    ranked = sorted(((int(geom.get("priority", "0")), int(geom.get("condim", "3"))) for geom in values), reverse=True)
    return ranked[0][1] if ranked[0][0] > ranked[1][0] else max(condim for _, condim in ranked)


def _kind(geom: ContactGeom) -> tuple[object, ...]:
    """Return the properties of a geom that determine whether MJX rejects its contacts."""
    raw = bool(geom.element and geom.element.raw)
    return geom.type, geom.margin, geom.values.get("condim"), geom.values.get("priority"), raw


# --- harmless changes ------------------------------------------------------------------------------------------------------


def _integrator(robot: Robot, root: Element) -> Iterator[Loss]:
    option = root.find_or_empty("option")
    if option.get("integrator") == "implicit":
        option.attributes["integrator"] = "implicitfast"
        what = "the integrator `implicit`: MJX uses `implicitfast`"
        yield Loss("mjcf", robot.mode.name, robot.mode.name, what, "approximated", robot.mode.origin)


def _prisms(root: Element) -> Iterator[Loss]:
    """Replace a cylinder by a prism if the cylinder may collide with a box or a mesh.

    Because prisms are meshes, other cylinders may then collide with a mesh.
    """
    contacts = [pair for pair in pairs(root) if pair[0].element is not None]
    replaced: dict[int, ContactGeom] = {}
    while True:
        added = [
            geom for pair in contacts for geom in pair
            if geom.type == "cylinder" and id(geom.element) not in replaced
            and any(("mesh" if id(other.element) in replaced else other.type) in ("box", "mesh") for other in pair if other is not geom)
        ]
        if not added:
            break
        replaced |= {id(geom.element): geom for geom in added}
    sizes: dict[str, str] = {}
    for element in [element for element in root.walk() if id(element) in replaced]:
        size = replaced[id(element)].values["size"]
        mesh = sizes.setdefault(size, f"prism:{len(sizes)}")
        path = element.get("name").partition(":")[0]
        element.attributes = {
            ("mesh" if name == "size" else name): {"type": "mesh", "size": mesh}.get(name, value)
            for name, value in element.attributes.items()
        }
        what = f"the cylinder: a prism of {SIDES} sides in contacts of MJX"
        yield Loss("mjcf", None, path, what, "approximated", element.origin)
    if sizes:
        section = root.child("asset", before=("worldbody",))
        for size, name in sizes.items():
            radius, half = (float(value) for value in size.split()[:2])
            section.add("mesh", {"name": name, "vertex": prism(radius, half)})


def prism(radius: float, half: float) -> tuple[float, ...]:
    """Return the corners of a prism inside a cylinder about z, as a flat list of coordinates [m]."""
    turns = [2.0 * math.pi * side / SIDES for side in range(SIDES)]
    return tuple(value for z in (-half, half) for turn in turns for value in (radius * math.cos(turn), radius * math.sin(turn), z))


def _margins(root: Element) -> None:
    """Remove the margin of adhesive contacts from a model that has meshes. The margin is not needed, because MJX does not support adhesion
    actuators.
    """
    if any("mesh" in (first.type, second.type) and first.margin + second.margin for first, second in pairs(root)):
        for element in root.walk():
            geom = element.find("geom") if element.get("class") == adhesion_contacts.CLASS else None
            if element.tag == "default" and geom is not None and "margin" not in geom.raw:
                geom.attributes.pop("margin", None)


def _cones(root: Element) -> None:
    """Remove elliptic friction cones from a model in which contacts are impossible, even with the floor of the scene. MJX rejects elliptic
    cones if a model has no contacts.
    """
    option = root.find_or_empty("option")
    if option.get("cone") == "elliptic" and next(pairs(root), None) is None:
        del option.attributes["cone"]
        option.attributes.pop("impratio", None)


def _needed_adhesion(robot: Robot) -> list[str]:
    """Return the mounts whose active adhesion is needed to support the robot. Mounts on links that are fixed or held are omitted."""
    still = {closure.child for closure in robot.closures if closure.hold} | ({0} if robot.base in ("fixed", "held") else set())
    links = {robot.bodies[body].link for body in still}
    return [
        magnet.path for magnet in robot.assembly.adhesions
        if robot.adhesion.get(magnet.path, 0.0) > 0.0 and robot.assembly.link_of[magnet.occurrence] not in links
    ]


def _adhesions(robot: Robot, root: Element) -> Iterator[Loss]:
    """Remove adhesion actuators from a model, and remove their controls from keyframes. Yield an export loss for each removed actuator."""
    section = root.find("actuator")
    if section is None or not robot.assembly.adhesions:
        return
    kept_indices = [index for index, element in enumerate(section.children) if element.tag != "adhesion"]
    section.children = [section.children[index] for index in kept_indices]
    if not section.children:
        root.children.remove(section)
    for key in root.find_or_empty("keyframe").children:
        control = key.get("ctrl").split()
        key.attributes["ctrl"] = " ".join(control[index] for index in kept_indices if control)
        if not key.get("ctrl"):
            del key.attributes["ctrl"]
    for magnet in robot.assembly.adhesions:
        origin = robot.assembly.occurrences[magnet.occurrence].origin
        yield Loss("mjcf", None, magnet.path, "the adhesion: not supported by MJX", "omitted", origin)


MJX = Consumer(name="mjx", label="MJX", version="mujoco-mjx 3.17.0", adapt=_adapt, find_refusals=_find_refusals)
