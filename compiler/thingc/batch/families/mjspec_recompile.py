"""Recompile a MuJoCo model with other numbers and meshes, from an XML template or from an `MjSpec`.

An `MjSpec` is faster, because MuJoCo does not need to parse the XML again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from thingc.batch.mujoco_arrays.entries import walk
from thingc.batch.plans.tape import slot
from thingc.batch.plans.text_templates import NumberSlots, TextTemplate
from thingc.batch.plans.trace_compilation import TraceResult

if TYPE_CHECKING:
    import mujoco

    from thingc.targets.artifact import StoredArtifact


class ModelTemplate:
    """The XML of a MuJoCo model with slots, into which numbers and names of meshes can be inserted.

    `outputs` contains the numbers for the slots, in the order in which the method `text` expects their values. `why` is the reason why the
    faster `Arrays` cannot be used. If parts depend on numbers, the XML also has the slots `meshes` for the names of meshes of these parts.
    `slotted` is the XML text with slots. `places` maps each slot to the index of its value. `plain` is the XML text with the numbers of the
    traced compilation, and `assets` contains the meshes of this compilation.
    """

    def __init__(self, trace: TraceResult, why: str = "", meshes: Sequence[str] = ()) -> None:
        self.why = why
        self.slotted: str
        self.assets: Mapping[str, StoredArtifact]
        self.slotted, self.assets = trace.result
        self._meshes = {name: f"mesh:{place}" for place, name in enumerate(meshes)}
        if meshes:
            named = rf'(?<=")({"|".join(map(re.escape, meshes))})(?=(?:\.obj)?")'
            self.slotted = re.sub(named, lambda name: slot(self._meshes[name[1]]), self.slotted)
        self.meshes = frozenset(map(slot, self._meshes.values()))
        self._template = TextTemplate(self.slotted)
        self._numbers = NumberSlots(trace.tape, (name for name in self._template.slots if name not in self._meshes.values()))
        self.outputs = self._numbers.outputs
        self.places = {slot(name): place for place, name in enumerate(self._numbers.names)}
        self.plain = self.text([number.value for number in self.outputs], meshes)

    def text(self, values: Sequence[float], meshes: Sequence[str] = ()) -> str:
        """Insert values and names of meshes into the slots, and return the XML.

        Numbers are formatted in the same way as in a compilation.
        """
        return self._template.fill({**self._numbers.format_values(values), **dict(zip(self._meshes.values(), meshes, strict=True))})


_INERTIAL = {"pos": "ipos", "mass": "mass", "fullinertia": "fullinertia"}
"""For each attribute of the element `inertial`, the name of the corresponding attribute of `MjsBody`."""
_KINDS = ("body", "geom", "site", "joint", "key")
"""Kinds of elements that can be found by name, and whose attributes have the same names in `MjSpec`."""


class NotInMjSpec(Exception):
    """Raised if a slot has no counterpart in `MjSpec`, or if a value in the `MjSpec` differs from the value in the XML."""


class RecompiledSpec:
    """An `MjSpec` that is created from a model template, and whose numbers and meshes can be changed.

    `text` is the XML of the template with some values inserted. `meshes` contains the names of the mesh files in `files`. Raises
    `NotInMjSpec` if the number of a slot does not appear unchanged in the `MjSpec`, and `ValueError` if MuJoCo rejects the XML.
    """

    def __init__(self, template: ModelTemplate, text: str, meshes: Sequence[str], files: mujoco.MjVfs) -> None:
        import mujoco

        self._spec = mujoco.MjSpec.from_string(text, vfs=files)
        places = [
            (kind, name, attribute, self._entries(kind, name, attribute, specified, gaps))
            for kind, name, attribute, specified, gaps in _gaps(template, ElementTree.fromstring(text))
        ]
        self._spec.compile(files)  # this may remove visual elements
        elements = ((getattr(self._spec, kind)(name), attribute, entries) for kind, name, attribute, entries in places)
        self._places = [(element, attribute, entries) for element, attribute, entries in elements if element is not None]
        order = {name: k for k, name in enumerate(meshes)}
        self._meshes = [(mesh, order[mesh.name]) for mesh in self._spec.meshes if mesh.name in order]
        self._geoms = [(geom, order[geom.meshname]) for geom in self._spec.geoms if geom.meshname in order]

    def _entries(self, kind: str, name: str, attribute: str, specified: Sequence[str], gaps: Sequence[int | None]) -> list[int | float]:
        """Return a list with one item for each element of an attribute of the `MjSpec`.

        For a slot, the item is the index of its value (an `int`); for any other element, it is a number (a `float`).
        """
        entry = getattr(self._spec, kind)(name)
        value: Any = getattr(entry, attribute, None) if entry is not None else None
        try:
            numbers = [float(number) for number in ([value] if isinstance(value, float) else value)]
            texts = [float(text) for text in specified]
        except (TypeError, ValueError):
            raise NotInMjSpec(f"{kind}.{attribute}") from None
        if numbers[: len(texts)] != texts:
            raise NotInMjSpec(f"{kind}.{attribute}")
        return [*(number if gap is None else gap for number, gap in zip(texts, gaps, strict=True)), *numbers[len(texts):]]

    def model(self, values: Sequence[float], meshes: Sequence[str], files: mujoco.MjVfs) -> mujoco.MjModel:
        """Change the numbers and meshes of the `MjSpec`, and compile the `MjSpec` to a model.

        Raises `ValueError` if MuJoCo rejects the model.
        """
        for element, attribute, entries in self._places:
            numbers = [values[entry] + 0.0 if type(entry) is int else entry for entry in entries]
            setattr(element, attribute, numbers if len(numbers) > 1 else numbers[0])
        for mesh, place in self._meshes:
            if mesh.name != meshes[place]:
                mesh.name, mesh.file = meshes[place], f"{meshes[place]}.obj"
        for geom, place in self._geoms:
            geom.meshname = meshes[place]
        model: mujoco.MjModel = self._spec.compile(files)
        return model


def _gaps(template: ModelTemplate, root: ElementTree.Element) -> list[tuple[str, str, str, list[str], list[int | None]]]:
    """Return a list of all slots for numbers in the XML with the root element `root`.

    Each list item contains the kind and the name of the element, the attribute, and the words of the attribute. The last field of a list
    item contains the index of the value for each word, or None for a word that is not a slot.
    """
    gaps_of_attribute = []
    for (element, above), (attributes, _) in zip(walk(ElementTree.fromstring(template.slotted)), walk(root), strict=True):
        for attribute, value in element.attrib.items():
            gaps = [template.places.get(text) for text in value.split()]
            if not any(gap is not None for gap in gaps):
                continue
            kind, named = ("body", above) if element.tag == "inertial" else (element.tag, attributes)
            attribute_of = _INERTIAL.get(attribute) if element.tag == "inertial" else attribute
            if kind not in _KINDS or attribute_of is None or not named.get("name"):
                raise NotInMjSpec(f"{element.tag}.{attribute}")
            gaps_of_attribute.append((kind, named.get("name", ""), attribute_of, attributes.get(attribute, "").split(), gaps))
    return gaps_of_attribute
