"""Adapt the general JSON Schema of a kind of document to one document.

The adapted schema validates names from other files: parameters and mounts of parts, parameters of nested documents, and materials of
material documents. The schema suggests names in the document itself, but does not reject other names, because the schema does not contain
new names before the user saves the document.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Mapping

from pydantic import BaseModel

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import quote_names
from thingc.base.units import ANGLE, LENGTH
from thingc.documents.checks import kinds
from thingc.documents.spec.annotation_types import model_keys
from thingc.documents.spec.fields import REFERENCE_PATTERN
from thingc.documents.spec.name_types import RefersTo
from thingc.geometry.record import PartSchema
from thingc.tools.schemas.document_facts import DocumentFacts, JointFacts, Names, WrittenComponent
from thingc.tools.schemas.parameter_schemas import DocumentSymbols, Schema, documentation, one_of, parameters_schema, part_schema, quantity

OPEN = r"[*?\[$]"
"""Regular expression of the special characters in name patterns and indices.

Only the compiler validates references with these characters.
"""
MAX_CHECKED = 500
"""Maximum number of names in one regular expression. Larger groups of names are not validated."""


class SchemaContext(FrozenStruct):
    """The names from other files that a document can use. The names have the form in which the document contains references.

    `parts` contains the schemas of available parts, and `usual` their default mounts. `assemblies` and `materials` are other documents.
    """

    parts: Mapping[str, PartSchema] = {}
    usual: Mapping[str, Names] = {}
    assemblies: Mapping[str, DocumentSymbols] = {}
    materials: Mapping[str, DocumentSymbols] = {}


def narrow(general: Schema, facts: DocumentFacts, around: SchemaContext) -> Schema:
    """Adapt a copy of `general`, the JSON Schema of all assembly documents, to one assembly document."""
    return _Narrowing(copy.deepcopy(general), facts, around).narrow_all()


def params_name(reference: str) -> str:
    """Return the key in `$defs` under which the schema of a part's parameters is stored."""
    return f"params of {reference}"


def mounts_name(reference: str) -> str:
    """Return the key in `$defs` under which the schema of a part's default mounts is stored."""
    return f"mounts of {reference}"


def _ref(name: str) -> Schema:
    escaped = name.replace("~", "~0").replace("/", "~1").replace("%", "%25").replace(" ", "%20")
    return {"$ref": f"#/$defs/{escaped}"}


class _Narrowing:
    """Adapts a JSON Schema to one document. Each method adapts the schema of one section of the document."""

    def __init__(self, schema: Schema, facts: DocumentFacts, around: SchemaContext) -> None:
        self.schema = schema
        self.definitions: Schema = schema["$defs"]
        self.properties: Schema = schema["properties"]
        self.facts = facts
        self.around = around

    def narrow_all(self) -> Schema:
        self._references()
        self._materials()
        self._parts()
        self._components()
        self._joints()
        self._poses()
        self._modes()
        self._sensors()
        self._tests()
        return self.schema

    # --- helpers -----------------------------------------------------------------------------------------------

    def _field(self, model: str, key: str) -> Schema:
        schema: Schema = self.definitions[model]["properties"][key]
        return schema

    def _put(self, model: str, key: str, new: Schema) -> None:
        """Replace the JSON Schema of a field, but preserve its title and description."""
        old = self._field(model, key)
        texts: Schema = {one: old[one] for one in ("title", "description") if one in old}
        self.definitions[model]["properties"][key] = {**texts, **new}

    def _offer(self, model: str, key: str, choices: Iterable[tuple[str, str]]) -> None:
        self._put(model, key, one_of(choices))

    def _plain(self, model: str, title: str) -> Schema:
        """Return a reference to the JSON Schema of a pydantic model. `title` becomes the title of the schema.

        The description is moved from the definition to the returned schema, because in the definition it would hide the descriptions of
        named values.
        """
        self.definitions[model]["title"] = title
        return {**_ref(model), "title": title, "description": self.definitions[model].pop("description", "")}

    # --- references --------------------------------------------------------------------------------------------

    def _references(self) -> None:
        known = [*self._known_mounts()]
        self.definitions["mount"] = one_of(self.facts.mounts.items(), title="Mount", **({"allOf": known} if known else {}))
        mounts = {name: f"`{text}`, exported by this document." for name, text in self.facts.exports.items()}
        self.definitions["frame"] = one_of({**self.facts.components, **mounts, **self.facts.mounts}.items(), title="Component or mount")
        self.definitions["component"] = one_of(self.facts.components.items(), title="Component")
        self._put("AttachSpec", "mount", {"type": "string"})
        for model, key in (("AtSpec", "in"), ("AttachSpec", "to"), ("JointSpec", "parent"), ("JointSpec", "child")):
            self._put(model, key, _ref("mount"))
        _set_each(self.properties["mounts"], _ref("mount"))
        _set_each(self.properties["links"], _ref("component"))
        for model, key in (("JointSpec", "drive"), ("JointDefaults", "drive"), ("TransmissionSpec", "actuator")):
            drives = [(name, piece.what) for piece in self.facts.pieces if piece.actuator for name in piece.items]
            inline = [branch for branch in self._field(model, key)["anyOf"] if branch.get("type") != "string"]
            self._put(model, key, {"anyOf": [*inline, one_of(drives)]})

    def _known_mounts(self) -> Iterable[Schema]:
        """Yield a schema with a pattern for each group of components with equal, known mounts.

        A reference to one of these components must match the pattern.
        """
        groups: dict[tuple[tuple[str, ...], bool], list[WrittenComponent]] = {}
        for piece in self.facts.pieces:
            mounts = tuple(sorted(name for name in piece.mounts if "." not in name))
            if piece.sure and len(mounts) <= MAX_CHECKED:
                groups.setdefault((mounts, piece.assembly), []).append(piece)
        for (mounts, assembly), pieces in groups.items():
            names = f"({'|'.join(piece.pattern for piece in pieces)})"
            # a reference into a nested assembly can have more levels, such as `hand.cap.pen`; a reference to a part has one level
            other = rf"^(?!{names}\.[^.]*$)" if assembly else rf"^(?!{names}\.)"
            description = f"`{pieces[0].name}` ({pieces[0].label})" if len(pieces) == 1 else f"`{pieces[0].label}`"
            yield {
                "pattern": rf"{other}|^{names}\.({'|'.join(mounts)})$|{OPEN}",
                "patternErrorMessage": f"unknown mount of {description}; available mounts: {quote_names(mounts, 12)}",
            }

    # --- materials ---------------------------------------------------------------------------------------------

    def _materials(self) -> None:
        names = self.facts.materials
        choice = one_of(names.items())
        if self.facts.materials_sure and len(names) <= MAX_CHECKED:
            choice["pattern"] = rf"^({'|'.join(sorted(names))})$"
            choice["patternErrorMessage"] = f"unknown material; available materials: {quote_names(sorted(names), 12)}"
        for model in ("ComponentDefaults", "ComponentSpec"):
            self._put(model, "material", choice)
        choices = [(name, one.description or one.name or "A document.") for name, one in self.around.materials.items()]
        for branch in self.properties["materials"]["anyOf"]:
            if branch.get("type") == "array":
                branch["items"] = one_of(choices)

    # --- parts and components ----------------------------------------------------------------------------------

    def _parts(self) -> None:
        """Adapt the JSON Schema of a component to the part or assembly that the component uses."""
        assemblies = self.around.assemblies.items()
        self._offer("ComponentSpec", "part", ((reference, documentation(part)) for reference, part in self.around.parts.items()))
        self._offer("ComponentSpec", "assembly", ((name, one.description or one.name or "An assembly.") for name, one in assemblies))
        rules: list[Schema] = []
        for reference, part in self.around.parts.items():
            self.definitions[params_name(reference)] = part_schema(part, self.facts.parameters)
        for reference in self.around.parts:
            then: Schema = {"params": _ref(params_name(reference))}
            mounts = self.around.usual.get(reference)
            if mounts:
                self.definitions[mounts_name(reference)] = self._attach(mounts, sure=False)
                then["attach"] = _ref(mounts_name(reference))
            needs = self.definitions[params_name(reference)].get("required")
            rules.append(_if("part", reference, {"properties": then, **({"required": ["params"]} if needs else {})}))
        for name, symbols in self.around.assemblies.items():
            modes = {"mode": one_of((mode, f"A mode of `{name}`.") for mode in symbols.modes)} if symbols.modes else {}
            rules.append(_if("assembly", name, {"properties": {"parameters": parameters_schema(name, symbols), **modes}}))
        for section in ("params", "parameters"):  # a description of all values hides the descriptions of parameters
            self._put("ComponentSpec", section, {"type": "object"})
        self._put("ComponentSpec", "attach", {"type": "object", **_full_or_short({"additionalProperties": _ref("mount")}, {})})
        if rules:
            self.definitions["ComponentSpec"]["allOf"] = rules

    def _attach(self, mounts: Names, *, sure: bool) -> Schema:
        """Return the JSON Schema of the key `attach` of a component with the given mounts.

        In the short form of `attach`, the mounts are keys. In the full form, a mount is the value of the key `mount`.
        """
        short: Schema = {"properties": {name: {**_ref("mount"), "description": text} for name, text in mounts.items()}}
        full = one_of(mounts.items())
        if sure:
            # the compiler validates names such as `hip_$i` and `cap.pen`
            short |= {"patternProperties": {rf"{OPEN}|\.": True}, "additionalProperties": False, "maxProperties": 1}
            full["pattern"] = rf"^({'|'.join(re.escape(name) for name in sorted(mounts))})$|{OPEN}|\."
            full["patternErrorMessage"] = f"unknown mount; available mounts: {quote_names(sorted(mounts), 12)}"
        return {"type": "object", **_full_or_short(short, mounts, mount=full)}

    def _components(self) -> None:
        """Adapt the JSON Schema of the existing components to their mounts.

        The rules for a component apply only while the component uses the same part.
        """
        section = self.properties["components"]
        known: Schema = {}
        for piece in self.facts.pieces:
            mounts = [name for name in piece.mounts if "." not in name]
            description = f"{piece.what}\n\nMounts: {quote_names(mounts, 30)}."
            known[piece.name] = {**self._component(piece), "title": piece.name, "description": description}
        section["properties"] = known
        _set_each(section, self._plain("ComponentSpec", "Component"))

    def _component(self, piece: WrittenComponent) -> Schema:
        if piece.source is None or not piece.sure:
            return _ref("ComponentSpec")
        key, text = piece.source
        name = f"{piece.label} here"
        properties = self._attach(piece.mounts, sure=True)
        if self.definitions.setdefault(name, properties) != properties:  # the component has additional mounts
            name = f"{piece.name} here"
            self.definitions[name] = properties
        return {**_ref("ComponentSpec"), **_if(key, text, {"properties": {"attach": _ref(name)}})}

    # --- joints, poses, modes, sensors --------------------------------------------------------------------------

    def _joints(self) -> None:
        self._offer("MimicSpec", "joint", [(name, joint.what) for name, joint in self.facts.joints.items() if joint.own])
        section = self.properties["joints"]
        _set_each(section, self._plain("JointSpec", "Joint"))
        section["properties"] = {
            name: {**_ref("JointSpec"), "title": name, "description": joint.what}
            for name, joint in self.facts.joints.items() if joint.own
        }

    def _poses(self) -> None:
        settable = {name: joint for name, joint in self.facts.joints.items() if joint.settable}
        _each(self.properties["poses"])["properties"] = {
            **{
                name: {"title": name, "description": f"A pose of the document nested as `{name}`.", **one_of((one, "") for one in poses)}
                for name, poses in self.facts.nested_poses.items() if poses
            },
            **{name: {**_coordinate(joint), "title": name, "description": joint.what} for name, joint in settable.items()},
        }

    def _modes(self) -> None:
        poses, modes = self.facts.poses.items(), self.facts.modes.items()
        joints = [(name, joint.what) for name, joint in self.facts.joints.items()]
        self._put("ModeSpec", "root", _ref("frame"))
        self._offer("ModeSpec", "pose", poses)
        self._offer("MotionPoseSpec", "pose", poses)
        self._offer("DriveMarginTest", "motion", self.facts.motions.items())
        self._offer("ModeSpec", "extends", modes)
        self._put("ModeSpec", "poses", {"type": "array", "items": one_of(poses)})
        for key in ("actuators", "cut"):
            self._put("ModeSpec", key, {"type": "array", "items": one_of(joints)})
        self.definitions["ContactsSpec"]["properties"]["exclude"]["items"]["items"] = _ref("component")
        frames = {**self.facts.exports, **self.facts.mounts}
        for model, key in (("ModeSpec", "hold"), ("ContactsSpec", "adhesion")):
            section = self._field(model, key)
            self.definitions[key] = _each(section)
            _set_each(section, _ref(key))
            section["properties"] = {name: _ref(key) for name in frames}

    def _sensors(self) -> None:
        mounts = {name: f"`{text}`, exported by this document." for name, text in self.facts.exports.items()}
        mount = _ref("mount")
        if mounts:
            mount = {"anyOf": [one_of(mounts.items(), pattern=rf"^({'|'.join(mounts)})$"), _ref("mount")]}
        for model, key in (("SensorSpec", "at"), ("SensorSpec", "in"), ("AroundSpec", "around"), ("AroundSpec", "side")):
            self._put(model, key, mount)
        for key in ("of", "with"):
            self._put("SensorSpec", key, _ref("component"))
        self._offer("SensorSpec", "joint", [(name, joint.what) for name, joint in self.facts.joints.items()])

    def _tests(self) -> None:
        """Adapt the schema of the section `tests` to the names in the document.

        References in lists refer to components. The types of other references specify whether they refer to components or to mounts. Keys
        for poses, modes and joints have the same names in all kinds of tests.
        """
        joints = [(name, joint.what) for name, joint in self.facts.joints.items()]
        choices: dict[str, list[tuple[str, str]]] = {
            "pose": [*self.facts.poses.items(), ("all", "All keyframes of the mode.")], "mode": list(self.facts.modes.items()),
            "drive": [*joints, ("*", "All drives.")],
        }
        models: dict[str, type[BaseModel]] = {kind.model.__name__: kind.model for kind in kinds().values()}
        self.definitions["shown"] = one_of({**self.facts.exports, **self.facts.mounts}.items(), title="Mount")
        for name in [name for name in self.definitions if name.endswith("Test") or name == "AllowSpec"]:
            fields = self.definitions[name]["properties"]
            for key, written in list(fields.items()):
                if written.get("pattern") == REFERENCE_PATTERN:
                    names = model_keys(models[name])[key][0].names
                    self._put(name, key, _ref("component" if names == RefersTo("component") else "shown"))
                elif written.get("items", {}).get("pattern") == REFERENCE_PATTERN:
                    written["items"] = _ref("component")
            for key in [key for key in choices if key in fields]:
                choice = one_of(choices[key])
                self._put(name, key, {"anyOf": [choice, {"type": "array", "items": choice, "minItems": 1}]})
            if "joints" in fields:
                mapping = next(one for one in fields["joints"].get("anyOf", [fields["joints"]]) if one.get("type") == "object")
                swept = _each(mapping)
                mapping["properties"] = {joint: {**swept, "description": text} for joint, text in joints}


def _each(section: Schema) -> Schema:
    """Return the JSON Schema of the values of a mapping whose keys are arbitrary names."""
    named = section.get("patternProperties")
    schema: Schema = section["additionalProperties"] if named is None else next(iter(named.values()))
    return schema


def _set_each(section: Schema, value: Schema) -> None:
    """Set the JSON Schema of the values of a mapping whose keys are arbitrary names. Keys in `properties` have their own schemas."""
    section.pop("patternProperties", None)
    section["additionalProperties"] = value


def _if(key: str, text: str, then: Schema) -> Schema:
    return {"if": {"properties": {key: {"const": text}}, "required": [key]}, "then": then}


def _full_or_short(short: Schema, mounts: Iterable[str], *, mount: Schema | None = None) -> Schema:
    """Combine the JSON Schemas of the full form `{mount: back, to: plate.servo_seat}` and the short form `{back: plate.servo_seat}`.

    A mapping with the key `mount` or `to` has the full form, unless this key is the name of a mount.
    """
    words = [word for word in ("mount", "to") if word not in mounts]
    full: Schema = dict(_ref("AttachSpec"))
    if mount is not None:
        full = {"allOf": [full, {"properties": {"mount": mount}}]}
    brief = {**short, "properties": {**short.get("properties", {})}}
    if "mount" in words:
        text = "A mount of this component, in the full form of a mate: `{mount: back, to: plate.servo_seat, turn: 90 deg}`."
        brief["properties"]["mount"] = {"type": "string", "description": text}
    return brief if not words else {"if": {"anyOf": [{"required": [word]} for word in words]}, "then": full, "else": brief}


def _coordinate(joint: JointFacts) -> Schema:
    if joint.angle is None:  # the joint has several coordinates, is a ball, or is unknown
        return {"anyOf": [{"type": ["string", "array", "object"]}, {"const": 0}]}
    return quantity(ANGLE if joint.angle else LENGTH)
