"""Add contact pairs, equalities, actuators and sensors to the generated MuJoCo model if the document format cannot express them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence, Set
from typing import Literal

from thingc.tools.importing.mjcf.compiled_source import SOLIMP, SOLREF, CompiledSource, differing, floats, numbers
from thingc.tools.importing.mjcf.tendons import Tendons
from thingc.tools.importing.source_model import SourceAdded, SourceTarget

AT_JOINT, AT_PARENT, AT_CRANK, AT_TENDON, AT_SITE = 0, 1, 2, 3, 4
OF_TENDONS = 3
DYNAMICS = ("none", "integrator", "filter", "filterexact", "muscle")
GAINS, BIASES = ("fixed", "affine", "muscle"), ("none", "affine", "muscle")
Kind = Literal["body", "joint", "geom", "site", "tendon", "actuator"]
OBJECTS: dict[int, Kind] = {1: "body", 2: "body", 3: "joint", 5: "geom", 6: "site", 18: "tendon", 19: "actuator"}
"""Maps values of MuJoCo's enum `mjtObj` to kinds of elements to which a sensor can refer."""
REFERRING = ("site", "joint", "tendon", "actuator", "body", "geom", "subtree", "objname", "refname")
"""Attributes of MuJoCo sensors that refer to an element. The names can have the suffix 1 or 2."""
INERTIAL, OF_AXES = 1, ("framequat", "framexaxis", "frameyaxis", "framezaxis")
"""The object type of inertial frames, whose axes MuJoCo recomputes, and the sensor types whose readings depend on these axes."""


class Added:
    """Collects MuJoCo elements that a document cannot express. These elements are copied unchanged to the generated MuJoCo model.

    `kept` contains the indices of imported joints, sites, geoms and actuators, and `tendons` are the imported tendons. `heads` maps each
    body to the first body of its link. An element can refer to a body only if this body is the only body with mass in its link, because
    merging bodies changes the inertial frame.
    """

    def __init__(self, original: CompiledSource, kept: Mapping[str, Set[int]], tendons: Tendons, heads: Mapping[int, int]) -> None:
        self.original, self.model, self.tendons = original, original.model, tendons.of
        masses = Counter(heads[body] for body in heads if self.model.body_mass[body] > 0.0)
        whole = {head for head in heads.values() if masses[head] < 2}  # merging bodies changes the frame of the inertia
        self.kept: dict[str, Set[int]] = {**kept, "tendon": tendons.of.keys(), "body": whole}
        self.elements: list[SourceAdded] = []

    def _target(self, kind: Kind, number: int) -> SourceTarget | None:
        """Return a reference to the element with the given kind and index, or None if the element is not imported."""
        return SourceTarget(kind=kind, name=self.original.names[kind][number]) if number in self.kept[kind] else None

    def _add(
        self, section: Literal["contact", "equality", "actuator", "sensor"], tag: str, number: int,
        attributes: Sequence[tuple[str, str | SourceTarget | None]],
    ) -> bool:
        """Add an element to the MuJoCo model if all elements that it refers to are imported. Return whether the element was added."""
        resolved = tuple((key, value) for key, value in attributes if value is not None)
        if len(resolved) < len(attributes):
            return False
        original = self.original
        pair = original.spec.pairs[number] if section == "contact" else None
        self.elements.append(SourceAdded(
            section=section, tag=tag, name=original.names[section][number] if pair is None else pair.name, attributes=resolved,
            where=original.where(section, number) if pair is None else original.flat.place(pair.info),
        ))
        return True

    def actuator(self, number: int) -> bool:
        """Add an actuator to the MuJoCo model if its target is imported. Return whether the actuator was added.

        `number` is the index of the actuator in the compiled model.
        """
        model, acts_on = self.model, self._acts_on(number)
        words = [
            names[at] if (at := int(getattr(model, f"actuator_{word}type")[number])) < len(names) else ""
            for word, names in (("dyn", DYNAMICS), ("gain", GAINS), ("bias", BIASES))
        ]
        if not acts_on or not all(words) or model.actuator_plugin[number] >= 0:
            return False
        attributes = [*zip(("dyntype", "gaintype", "biastype"), words, strict=True)]
        attributes += self.original.texts(number, {name: f"actuator_{name}" for name in ("dynprm", "gainprm", "biasprm", "gear")})
        for word in ("ctrl", "force", "act"):
            if (bounds := self.original.bounds(f"actuator_{word}", number)) is not None:
                attributes.append((f"{word}range", numbers(bounds)))
        if any(floats(model.actuator_lengthrange[number])):
            attributes += self.original.texts(number, {"lengthrange": "actuator_lengthrange"})
        if int(model.actuator_trntype[number]) == AT_CRANK:
            attributes += self.original.texts(number, {"cranklength": "actuator_cranklength"})
        usual = {"dyntype": "none", "gaintype": "fixed", "biastype": "none", "gear": "1 0 0 0 0 0"}
        return self._add("actuator", "general", number, (*acts_on, *differing(attributes, usual)))

    def _acts_on(self, number: int) -> Sequence[tuple[str, SourceTarget | None]]:
        """Return the XML attributes that specify the target of an actuator, or an empty list for an unsupported type of actuator."""
        kind, ends = int(self.model.actuator_trntype[number]), [int(one) for one in self.model.actuator_trnid[number]]
        if kind == AT_TENDON:
            return [("tendon", self._target("tendon", ends[0]))]
        if kind in (AT_JOINT, AT_PARENT) and int(self.model.jnt_type[ends[0]]) > 1:
            return [("joint", self._target("joint", ends[0]))]
        keys = {AT_SITE: ("site", "refsite"), AT_CRANK: ("cranksite", "slidersite")}.get(kind, ())
        return [(key, self._target("site", site)) for key, site in zip(keys, ends, strict=True) if site >= 0] if keys else []

    def equality(self, number: int) -> bool:
        """Add an equality constraint between tendons to the MuJoCo model. Return whether the equality was added.

        MuJoCo measures the lengths in an equality relative to the reference pose. In a document, the reference pose is q = 0. If an
        imported joint has another reference pose, the equality is not added.
        """
        model = self.model
        ends = [at for at in (int(model.eq_obj1id[number]), int(model.eq_obj2id[number])) if at >= 0]
        referred = any(model.qpos0[model.jnt_qposadr[joint]] for joint in self.kept["joint"] if int(model.jnt_type[joint]) > 1)
        if referred or int(model.eq_type[number]) != OF_TENDONS:
            return False
        values = [("polycoef", numbers(model.eq_data[number][:5]))]
        values += self.original.texts(number, {"solref": "eq_solref", "solimp": "eq_solimp"})
        tendons = [(f"tendon{k}", self._target("tendon", at)) for k, at in enumerate(ends, 1)]
        return self._add("equality", "tendon", number, (*tendons, *differing(values, {"solref": SOLREF, "solimp": SOLIMP})))

    def pair(self, number: int) -> bool:
        """Add a contact pair to the MuJoCo model if both geoms are imported.

        The attributes of the pair include inherited values. Return whether the pair was added.
        """
        model, place = self.model, int(self.original.spec.pairs[number].id)
        ends = [(f"geom{k}", self._target("geom", int(getattr(model, f"pair_geom{k}")[place]))) for k in (1, 2)]
        names = ["friction", "solref", "solreffriction", "solimp", "margin", "gap"]
        if not any(model.pair_solreffriction[place]):
            names.remove("solreffriction")
        values = self.original.texts(place, {"condim": "pair_dim"} | {name: f"pair_{name}" for name in names})
        return self._add("contact", "pair", number, (*ends, *values))

    def sensor(self, number: int) -> bool:
        """Add a sensor to the MuJoCo model if all elements that it refers to are imported. Return whether the sensor was added."""
        model, element, attributes = self.model, self.original.element("sensor", number), list[tuple[str, str | SourceTarget | None]]()
        for name, value in element.attributes.items():
            if name.rstrip("12") in REFERRING:
                second = name == "refname" or name.endswith("2") or name == "site" and "objname" in element.attributes
                of, thing = (int(getattr(model, f"sensor_{'ref' if second else 'obj'}{what}")[number]) for what in ("type", "id"))
                turned = of == INERTIAL and (second or element.tag in OF_AXES)
                attributes.append((name, None if turned or of not in OBJECTS else self._target(OBJECTS[of], thing)))
            elif name != "name":
                attributes.append((name, value))
        return element.tag != "plugin" and self._add("sensor", element.tag, number, attributes)
