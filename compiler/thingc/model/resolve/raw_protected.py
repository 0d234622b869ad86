"""Attributes that `raw` cannot set: those that identify an element or refer to one, and those on which other values depend.

Documents have their own keys for these, for all modes at once; `modes.json`, keyframes and poses rely on them.
"""

from __future__ import annotations

from collections.abc import Mapping

REFERRING = frozenset({
    "actuator", "body", "body1", "body2", "camera", "cranksite", "file", "flex", "geom", "geom1", "geom2", "hfield", "instance", "joint",
    "joint1", "joint2", "jointinparent", "material", "mesh", "objname", "objtype", "plugin", "refname", "refsite", "reftype", "site",
    "site1", "site2", "slidersite", "subtree1", "subtree2", "target", "tendon", "tendon1", "tendon2", "texture",
})
"""Attributes whose value is the name of another element or of a file, or the kind of a referenced element."""

NAMING = REFERRING - {"file", "instance", "material", "mesh", "objtype", "plugin", "reftype", "texture"} | {"name", "sidesite"}
"""Attributes of added elements that contain a name of an element in the document."""

CLASSES = frozenset({"class", "childclass"})

MOTION = frozenset({"type", "axis", "pos", "ref"})
"""Attributes of a joint that define its motion, and the zero of its coordinate."""

PLACE = frozenset({"pos", "quat", "axisangle", "euler", "xyaxes", "zaxis", "fromto", "mocap"})
"""Attributes of a body or a site that define its pose."""

SECTIONS: Mapping[str, Mapping[str, str]] = {
    "compiler": {
        "angle": "angles in the model are in radians: write yours in them, too",
        "assetdir": "meshes are found where the build puts them",
        "fusestatic": "every link stays a body: join two with a fixed joint, or with `attach`",
        "meshdir": "meshes are found where the build puts them",
        "strippath": "meshes are found where the build puts them",
    },
}
"""Attributes of sections on which names, files and units of the whole model depend, and what to use instead."""

SAID_BY: Mapping[str, str] = {
    "actuator": "drives are named after their joints: write `drive:` there",
    "body": "bodies are the links: name them under `links:`",
    "camera": "write the camera under `sensors:`",
    "equality": "write `mimic:` or `loop: true` of the joint",
    "geom": "write `material:`, `visual:` or `collision:` of the component",
    "joint": "write the joint under `joints:`, with its name, `type:`, mounts and `offset:`",
    "key": "keyframes are named after the poses: rename the pose under `poses:`",
    "material": "materials are made of the colours of components: write `material:` or the `color:` of the material",
    "mesh": "meshes are those of the parts: write `part:`, `visual:` or `collision:` of the component",
    "numeric": "velocity limits are named after their joints: rename the joint under `joints:`",
    "sensor": "write the sensor under `sensors:`",
    "site": "sites are the mounts: name them under `mounts:`",
    "tendon": "write the tendon under `tendons:`",
}
"""Where a document specifies names and references of elements, by kind of element."""


EVERYWHERE: Mapping[str, str] = {
    "name": "name links under `links:`, and joints where they are written", "type": "write `type:` of the joint",
    "parent": "write `parent:` of the joint", "child": "write `child:` of the joint", "mimic": "write `mimic:` of the joint",
    "origin": "write mounts, `attach:` or `at:`", "pose": "write mounts, `attach:` or `at:`",
    **dict.fromkeys(("axis", "xyz"), "write the mounts of the joint, or its `axis:`"),
    "inertial": "write `mass:` and `inertia:` of the component",
    "screw_thread_pitch": "write `lead:` of the joint", "geometry": "write `visual:` or `collision:` of the component",
}
"""Properties of a robot that are part of every format, by element or attribute of URDF and SDF, and what to use instead."""

_MASS, _MOUNTS = EVERYWHERE["inertial"], EVERYWHERE["axis"]

EVERYWHERE_IN_USD: Mapping[str, str] = {
    **dict.fromkeys(("mass", "centerOfMass", "diagonalInertia", "principalAxes", "density"), _MASS),
    **dict.fromkeys(("body0", "body1", "localPos0", "localPos1", "localRot0", "localRot1", "axis"), _MOUNTS),
    **dict.fromkeys(("jointEnabled", "excludeFromArticulation"), EVERYWHERE["type"]),
    **dict.fromkeys(("rigidBodyEnabled", "kinematicEnabled"), "write `base:` of the mode"),
}
"""The same for attributes of USD, without their `physics:`."""

BEGINNINGS_IN_USD: Mapping[str, str] = {
    "xformOp": EVERYWHERE["pose"], "newton:mimic": EVERYWHERE["mimic"], "physxMimicJoint:": EVERYWHERE["mimic"],
}
"""The same for attributes of USD with these prefixes."""


def fixed_in_all(target: str, path: tuple[str, ...]) -> tuple[str, str] | None:
    """Return why `raw` cannot set an attribute of URDF, SDF or USD, as in `fixed`: the robot would differ from that in other formats.

    In SDF, an `axis` also contains values that are not geometric; in USD, a type may precede the name.
    """
    for key in path[-1:] if target == "usd" else path[2:]:
        name = key.rpartition(" ")[2]
        instead = _instead_in_usd(name) if target == "usd" else None if (key, target) == ("axis", "sdf") else EVERYWHERE.get(key)
        if instead is not None:
            return f"`raw` cannot set `{name}` of a {path[0]}: it would be another robot than in other formats", instead
    return None


def _instead_in_usd(name: str) -> str | None:
    """Return what to use instead of an attribute of USD, or None."""
    if name.startswith("physics:"):
        return EVERYWHERE_IN_USD.get(name.removeprefix("physics:"))
    return next((instead for beginning, instead in BEGINNINGS_IN_USD.items() if name.startswith(beginning)), None)


def fixed(path: tuple[str, ...]) -> tuple[str, str] | None:
    """Return why `raw` cannot set an attribute of MJCF, and what to use instead; None if it can.

    The path is below the target (`("body", "arm", "name")`).
    """
    kind, attribute = path[0] if path else "", path[-1] if path else ""
    if len(path) == 2 and kind in SECTIONS:
        instead = SECTIONS[kind].get(attribute)
        return None if instead is None else (f"`raw` cannot set `{attribute}` of `{kind}`: the whole model rests on it", instead)
    if kind == "default" and len(path) == 4:
        kind = path[2]
    elif kind not in SAID_BY or len(path) != 3:
        return None
    what = f"`raw` cannot set `{attribute}` of {'an' if kind[:1] in 'ae' else 'a'} {kind}"
    instead = SAID_BY.get(kind, "write it in the document's own words")
    if attribute == "name":
        return f"{what}: other elements, poses and `modes.json` know it by its name", instead
    if attribute in CLASSES:
        instead = f"write the attributes of the {kind} itself, or those of its class under `default:`"
        return f"{what}: it belongs to the classes that it was given", instead
    if attribute in REFERRING:
        return f"{what}: it says which other element is meant", instead
    if kind == "joint" and attribute in MOTION:
        return f"{what}: poses and `modes.json` know its coordinate by it", instead
    if kind in ("body", "site") and attribute in PLACE:
        instead = "write `attach:`, `at:`, or the `parent:`, `child:` and `turn:` of the joint" if kind == "body" else "write the mount"
        return f"{what}: poses, other modes and `modes.json` know where it is", instead
    return None
