"""Find those elements of a MuJoCo model's arrays that contain the numbers of an MJCF file unchanged."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element

import numpy as np

from thingc.base.frozen_struct import FrozenStruct

if TYPE_CHECKING:
    import mujoco


class NotAnArrayEntry(Exception):
    """Raised if MuJoCo's compiler changes a number, so that none of the model's arrays contains this number unchanged.

    `attribute` is the attribute that contains the number, such as `geom.pos`.
    """

    def __init__(self, attribute: str) -> None:
        super().__init__(attribute)
        self.attribute = attribute


Entry = tuple[str, int, float]
"""An element of a field of `MjModel`: the field name, the flat index, and the sign (1 or -1) by which the number is multiplied.

Options have field names such as `opt.timestep`, and statistics have field names such as `stat.extent`.
"""

INERT = frozenset((
    "jnt_range", "jnt_actfrcrange", "jnt_stiffness", "dof_damping", "dof_frictionloss", "actuator_ctrlrange", "actuator_forcerange",
    "actuator_gainprm", "actuator_biasprm", "actuator_delay", "tendon_range", "tendon_stiffness", "tendon_damping", "tendon_frictionloss",
    "tendon_lengthspring", "key_qpos", "key_qvel", "key_ctrl", "key_mpos", "key_mquat", "numeric_data", "opt.timestep",
    "opt.gravity", "stat.center", "stat.extent", "eq_data", "geom_friction", "site_pos", "site_quat", "qpos_spring",
))
"""Names of fields that do not affect the constants that MuJoCo computes."""
TENSED = frozenset(("qpos_spring", "site_pos"))
"""Names of fields in `INERT` that affect the computed constants of models with tendons, because tendon lengths depend on these fields."""

INERTIAL = ("body_mass", "body_ipos", "body_inertia", "body_iquat")
"""Names of the fields that contain the mass properties of a body."""

_FIELDS = {
    ("joint", "damping"): "dof_damping", ("joint", "frictionloss"): "dof_frictionloss", ("joint", "armature"): "dof_armature",
    ("joint", "stiffness"): "jnt_stiffness", ("joint", "range"): "jnt_range", ("joint", "pos"): "jnt_pos",
    ("joint", "actuatorfrcrange"): "jnt_actfrcrange", ("joint", "springref"): "qpos_spring", ("equality", "polycoef"): "eq_data",
    ("body", "pos"): "body_pos", ("body", "quat"): "body_quat", ("site", "pos"): "site_pos", ("site", "quat"): "site_quat",
    ("key", "qpos"): "key_qpos", ("key", "ctrl"): "key_ctrl", ("key", "mpos"): "key_mpos", ("key", "mquat"): "key_mquat",
    ("geom", "friction"): "geom_friction", ("numeric", "data"): "numeric_data",
    ("tendon", "range"): "tendon_range", ("tendon", "stiffness"): "tendon_stiffness", ("tendon", "damping"): "tendon_damping",
    ("tendon", "frictionloss"): "tendon_frictionloss", ("tendon", "armature"): "tendon_armature",
    ("tendon", "springlength"): "tendon_lengthspring", ("actuator", "ctrlrange"): "actuator_ctrlrange",
    ("actuator", "forcerange"): "actuator_forcerange", ("actuator", "delay"): "actuator_delay",
}
"""Fields that contain numbers unchanged, by kind of element and attribute."""
_GEOMETRY = {
    ("geom", "pos"): "geom_pos", ("geom", "quat"): "geom_quat", ("geom", "size"): "geom_size", ("camera", "pos"): "cam_pos",
    ("camera", "quat"): "cam_quat",
}
"""Fields with numbers from which MuJoCo's compiler also computes other fields, by element and attribute."""
_GAINS = {
    ("position", "kp"): (("actuator_gainprm", 0, 1.0), ("actuator_biasprm", 1, -1.0)),
    ("position", "kv"): (("actuator_biasprm", 2, -1.0),),
    ("velocity", "kv"): (("actuator_gainprm", 0, 1.0), ("actuator_biasprm", 2, -1.0)),
}
_GROUPS = {"option": "opt", "statistic": "stat"}
_KINDS = {**dict.fromkeys(("position", "velocity", "motor", "adhesion"), "actuator"), **dict.fromkeys(("fixed", "spatial"), "tendon")}
"""For MJCF tags whose accessor in `MjModel` has a different name, the name of this accessor."""


class Write(FrozenStruct, kw_only=False, eq=False):
    """The elements of a model field that depend on numbers, as arrays of flat indices, columns of the numbers, and signs."""

    at: np.ndarray[Any, np.dtype[np.int_]]
    columns: np.ndarray[Any, np.dtype[np.int_]]
    signs: np.ndarray[Any, np.dtype[np.float64]]


class NumberPlaces:
    """The elements of the fields of a compiled model that depend on the numbers for which an MJCF file has tokens.

    The arguments and exceptions are the same as for the function `places`.

    Attributes:
        writes: The elements that contain numbers unchanged, by the name of the field.
        names: The names of the bodies whose mass properties depend on numbers. `bodies` contains their indices.
        inertials: An array (bodies, 10) of columns for mass, centre of mass and inertia. The columns after those of the numbers refer to
            `constants`.
        relaxed: The indices of tendons whose spring length is not specified. Their springs are relaxed if the springs of joints are.
    """

    def __init__(self, root: Element, tokens: Mapping[str, int], model: mujoco.MjModel, *, geometry: bool = False) -> None:
        entries, inertials = places(root, tokens, model, geometry=geometry)
        self.writes = {name: Write(*map(np.array, zip(*rows, strict=True))) for name, rows in sorted(entries.items())}
        self.names = list(inertials)
        self.bodies = np.array([model.body(name).id for name in inertials], dtype=int)
        texts = [text for properties in inertials.values() for attribute in properties for text in attribute]
        self.constants = np.array([0.0 if text in tokens else float(text) for text in texts])
        self.inertials = np.array([tokens.get(text, len(tokens) + k) for k, text in enumerate(texts)], dtype=int).reshape(-1, 10)
        self.relaxed = [model.tendon(item.get("name", "")).id for item in root.iterfind("tendon/*") if "springlength" not in item.attrib]

    def add_mass_fields(self, fields: Collection[str]) -> frozenset[str]:
        """Return `fields`, together with the names of all fields with mass properties if mass properties depend on numbers."""
        return frozenset(fields) | frozenset(INERTIAL if self.names else ())


def affect_constants(fields: frozenset[str], model: mujoco.MjModel) -> bool:
    """Return whether the constants that MuJoCo computes depend on one of these fields of a model."""
    return not fields <= (INERT - TENSED if model.ntendon else INERT)


def places(
    root: Element, tokens: Mapping[str, int], model: mujoco.MjModel, *, geometry: bool = False,
) -> tuple[dict[str, list[tuple[int, int, float]]], dict[str, list[list[str]]]]:
    """Find the array elements that contain the numbers for which an MJCF file has tokens.

    Return the array elements by field: the flat index, the index of the token whose number the element contains, and the sign. Also return
    a mapping from body names to mass properties: the words for mass, centre of mass and inertia of an `inertial` that contains tokens.
    `model` is the compiled model of the file. With `geometry`, the result includes numbers of geoms, cameras and free bodies from which
    MuJoCo computes other fields. Raises `NotAnArrayEntry` if no array contains a number unchanged.
    """
    entries: dict[str, list[tuple[int, int, float]]] = {}
    inertials: dict[str, list[list[str]]] = {}
    for element, above in walk(root):
        for attribute, value in element.attrib.items():
            numbers = value.split()
            if not any(number in tokens for number in numbers):
                continue
            if element.tag == "inertial":
                if "fullinertia" not in element.attrib:
                    raise NotAnArrayEntry(f"inertial.{attribute}")
                inertials[above.get("name", "")] = [element.get(name, "").split() for name in ("mass", "pos", "fullinertia")]
                continue
            for k, number in enumerate(numbers):
                for field, index, sign in _places(model, element, above, attribute, k, geometry) if number in tokens else ():
                    entries.setdefault(field, []).append((index, tokens[number], sign))
    return entries, inertials


def walk(root: Element) -> Iterator[tuple[Element, Element]]:
    """Yield every element of an XML tree together with its parent."""
    return ((element, above) for above in root.iter() for element in above)


def _places(model: Any, element: Element, above: Element, attribute: str, k: int, geometry: bool) -> list[Entry]:
    tag = element.tag
    unknown = NotAnArrayEntry(f"{tag}.{attribute}")
    if tag in _GROUPS:
        value = getattr(getattr(model, _GROUPS[tag]), attribute, None)
        if value is None or isinstance(value, int):
            raise unknown
        return [(f"{_GROUPS[tag]}.{attribute}", k, 1.0)]
    if above.tag == "fixed" and attribute == "coef":
        return [_at(model, "wrap_prm", int(model.tendon_adr[model.tendon(above.get("name", "")).id]) + list(above).index(element), 0)]
    name = element.get("name")
    kind = "equality" if tag == "joint" and element.get("joint1") else _KINDS.get(tag, tag)
    try:
        owner = getattr(model, kind)(name) if name else None
    except (AttributeError, KeyError):
        owner = None
    if owner is not None and (tag, attribute) in _GAINS:
        return [_at(model, field, owner.id, column, sign) for field, column, sign in _GAINS[tag, attribute]]
    field = _FIELDS.get((kind, attribute)) or (_GEOMETRY.get((kind, attribute)) if geometry else None)
    free = tag == "body" and element.find("freejoint") is not None
    if owner is None or field is None or (free and not geometry):
        raise unknown
    if field.startswith("dof_"):
        first, count = int(model.jnt_dofadr[owner.id]), {0: 6, 1: 3}.get(int(model.jnt_type[owner.id]), 1)
        return [(field, first + dof, 1.0) for dof in range(count)]
    if field == "qpos_spring":
        return [(field, int(model.jnt_qposadr[owner.id]), 1.0)]
    if field == "numeric_data":
        return [(field, int(model.numeric_adr[owner.id]) + k, 1.0)]
    if field == "tendon_lengthspring" and len(element.get(attribute, "").split()) == 1:
        return [_at(model, field, owner.id, column) for column in (0, 1)]
    first = int(model.jnt_qposadr[model.body_jntadr[owner.id]]) + (3 if attribute == "quat" else 0) if free else 0
    return [_at(model, field, owner.id, k), *((other, first + k, 1.0) for other in ("qpos0", "qpos_spring") if free)]


def _at(model: Any, field: str, row: int, column: int, sign: float = 1.0) -> Entry:
    array = getattr(model, field)
    return field, row * (array.size // len(array)) + column, sign
