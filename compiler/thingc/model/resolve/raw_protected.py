"""Tables of attributes that `raw` cannot set, because they identify an element, refer to an element, or determine other values.

For these values, documents have other keys, which apply to all output formats. The file `modes.json`, keyframes and poses also depend on
these values.
"""

from __future__ import annotations

from collections.abc import Mapping

REFERRING = frozenset({
    "actuator", "body", "body1", "body2", "camera", "cranksite", "file", "flex", "geom", "geom1", "geom2", "hfield", "instance", "joint",
    "joint1", "joint2", "jointinparent", "material", "mesh", "objname", "objtype", "plugin", "refname", "refsite", "reftype", "site",
    "site1", "site2", "slidersite", "subtree1", "subtree2", "target", "tendon", "tendon1", "tendon2", "texture",
})
"""Attributes that contain the name of another element, the name of a file, or the kind of a referenced element."""

NAMING = REFERRING - {"file", "instance", "material", "mesh", "objtype", "plugin", "reftype", "texture"} | {"name", "sidesite"}
"""Attributes of added elements that contain the name of an element in the document."""

CLASSES = frozenset({"class", "childclass"})

MOTION = frozenset({"type", "axis", "pos", "ref"})
"""Attributes of a joint that define its motion or the zero of its coordinate."""

PLACE = frozenset({"pos", "quat", "axisangle", "euler", "xyaxes", "zaxis", "fromto", "mocap"})
"""Attributes of a body or a site that define its pose."""

SECTIONS: Mapping[str, Mapping[str, str]] = {
    "compiler": {
        "angle": "write angles in radians",
        "assetdir": "remove the attribute",
        "fusestatic": "combine two links with a fixed joint or `attach`",
        "meshdir": "remove the attribute",
        "strippath": "remove the attribute",
    },
}
"""Attributes that affect names, files or units of the whole model, each with the help text that suggests a replacement."""

SAID_BY: Mapping[str, str] = {
    "actuator": "set `drive:` of the joint",
    "body": "rename the link under `links:`",
    "camera": "define the camera under `sensors:`",
    "equality": "set `mimic:` or `loop: true` on the joint",
    "geom": "set `material:`, `visual:` or `collision:` of the component",
    "joint": "define the joint under `joints:`",
    "key": "rename the pose under `poses:`",
    "material": "set `material:` of the component, or `color:` of the material",
    "mesh": "set `part:`, `visual:` or `collision:` of the component",
    "numeric": "rename the joint under `joints:`",
    "sensor": "define the sensor under `sensors:`",
    "site": "rename the mount under `mounts:`",
    "tendon": "define the tendon under `tendons:`",
}
"""Help texts that explain where a document specifies names of elements and references to elements, by kind of element."""


EVERYWHERE: Mapping[str, str] = {
    "name": "rename links under `links:`, and joints under `joints:`", "type": "set `type:` of the joint",
    "parent": "set `parent:` of the joint", "child": "set `child:` of the joint", "mimic": "set `mimic:` of the joint",
    "origin": "change mounts, `attach:` or `at:`", "pose": "change mounts, `attach:` or `at:`",
    **dict.fromkeys(("axis", "xyz"), "change the mounts of the joint, or its `axis:`"),
    "inertial": "set `mass:` and `inertia:` of the component",
    "screw_thread_pitch": "set `lead:` of the joint", "geometry": "set `visual:` or `collision:` of the component",
}
"""Help texts for elements and attributes of URDF and SDF that are properties of the robot in every format."""

_MASS, _MOUNTS = EVERYWHERE["inertial"], EVERYWHERE["axis"]

EVERYWHERE_IN_USD: Mapping[str, str] = {
    **dict.fromkeys(("mass", "centerOfMass", "diagonalInertia", "principalAxes", "density"), _MASS),
    **dict.fromkeys(("body0", "body1", "localPos0", "localPos1", "localRot0", "localRot1", "axis"), _MOUNTS),
    **dict.fromkeys(("jointEnabled", "excludeFromArticulation"), EVERYWHERE["type"]),
    **dict.fromkeys(("rigidBodyEnabled", "kinematicEnabled"), "set `base:` of the mode"),
}
"""Help texts for attributes of USD (without the prefix `physics:`) that are properties of the robot in every format."""

BEGINNINGS_IN_USD: Mapping[str, str] = {
    "xformOp": EVERYWHERE["pose"], "newton:mimic": EVERYWHERE["mimic"], "physxMimicJoint:": EVERYWHERE["mimic"],
}
"""Help texts for attributes of USD that begin with these prefixes."""


def fixed_in_all(target: str, path: tuple[str, ...]) -> tuple[str, str] | None:
    """Return the reason why `raw` cannot set an attribute of URDF, SDF or USD, and the key to use instead.

    Return None if `raw` can set the attribute.

    A protected attribute would make the robot differ between formats. In SDF, an `axis` also contains values that are not protected. In
    USD, the name of an attribute can be preceded by its type.
    """
    for key in path[-1:] if target == "usd" else path[2:]:
        name = key.rpartition(" ")[2]
        instead = _instead_in_usd(name) if target == "usd" else None if (key, target) == ("axis", "sdf") else EVERYWHERE.get(key)
        if instead is not None:
            return f"`raw` cannot set `{name}` of a {path[0]}", instead
    return None


def _instead_in_usd(name: str) -> str | None:
    """Return the document key that sets the value of a USD attribute, or None if the attribute is not protected."""
    if name.startswith("physics:"):
        return EVERYWHERE_IN_USD.get(name.removeprefix("physics:"))
    return next((instead for beginning, instead in BEGINNINGS_IN_USD.items() if name.startswith(beginning)), None)


def find_protected(path: tuple[str, ...]) -> tuple[str, str] | None:
    """Return the reason why `raw` cannot set an attribute of MJCF, and the key to use instead. Return None if `raw` can set the attribute.

    `path` contains the keys below `mjcf`, for example `("body", "arm", "name")`.
    """
    kind, attribute = path[0] if path else "", path[-1] if path else ""
    if len(path) == 2 and kind in SECTIONS:
        instead = SECTIONS[kind].get(attribute)
        return None if instead is None else (f"`raw` cannot set `{attribute}` of `{kind}`", instead)
    if kind == "default" and len(path) == 4:
        kind = path[2]
    elif kind not in SAID_BY or len(path) != 3:
        return None
    what = f"`raw` cannot set `{attribute}` of {'an' if kind[:1] in 'ae' else 'a'} {kind}"
    instead = SAID_BY.get(kind, "use the keys of the document instead")
    if attribute == "name":
        return f"{what} (other elements refer to the name)", instead
    if attribute in CLASSES:
        return what, f"set the attributes of the {kind} itself, or those of its class under `default:`"
    if attribute in REFERRING:
        return f"{what} (a reference to another element)", instead
    if kind == "joint" and attribute in MOTION:
        return f"{what} (poses depend on the attribute)", instead
    if kind in ("body", "site") and attribute in PLACE:
        instead = "change `attach:`, `at:`, or the `parent:`, `child:` and `turn:` of the joint" if kind == "body" else "change the mount"
        return f"{what} (poses and modes depend on the attribute)", instead
    return None
