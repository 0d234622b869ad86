"""Keywords of other formats and programs (URDF, SDFormat, MJCF, ROS, printing, CAD), with the corresponding keys and values of thingc.

`KEYS` contains keys of other formats, grouped by the document model in which users write them. `WORDS` contains values of other formats
that users write in place of a choice of thingc. `WHOLE` contains mappings for which users often write only a single value.
"""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel

from thingc.base.suggestions import Hint, Suggestion
from thingc.base.units import shortened
from thingc.documents.spec import assembly, drives, link_shapes, mass, materials, modes, poses, sensors, variants, workspace
from thingc.documents.spec.annotation_types import model_keys, one_of

_PLACE = "place a component by `attach: {my_mount: other.mount}`, by `at: {in: other.mount, xyz: 0 0 9 mm}`, or as the child of a joint"
_MOUNTS = "mounts determine the place of a joint: `parent: component.mount`, `child: component.mount`"
_SHAPE = (
    "define geometry by `part` (a Python class), `file` (STEP, STL and others) or `shapes` with `link: true`; "
    "use `frame: true` for a component without geometry"
)
_MATERIAL = "this belongs to a material: set `material`, and define its `density` and `color` under `materials`"
_RPY = "write an orientation as `rpy` (extrinsic roll, pitch and yaw, as in URDF), such as `rpy: 0 0 90 deg`, or as `quat: [w, x, y, z]`"
_XYZ = "write all three: `xyz: 0 0 10 mm`"
_MODES = "set it in each mode: `modes: {standing: {root: COMPONENT, base: fixed, gravity: floor}}`"
_DRIVE = "define drives on joints: `drive: COMPONENT` with an actuator, or `drive: {kind: position, kp: 20 N*m/rad}`"
_ROTOR = "use `armature`: the rotor inertia at the joint, multiplied by the gear ratio squared"
_GEAR = "a drive acts at the joint, after the gear; set `gear_ratio` of an `Actuator` in Python"

_TURN_KEYS = {"rpy": "euler rotation rot orientation", "quat": "quaternion", _RPY: "axisangle zaxis xyaxes normal"}

_KEYS: Mapping[type[BaseModel], Mapping[str, str]] = {
    assembly.JointDefaults: {
        "set its limits by `limit: {lower: -90 deg, upper: 90 deg}`": "range bounds position_limits",
        "drive": "actuator motor servo transmission driven_by", "set dry friction by `dynamics: {friction: 0.1 N*m}`": "frictionloss",
    },
    assembly.JointSpec: {
        _MOUNTS: "origin xyz rpy pose pos location anchor", "parent": "from base parent_link link1 body1",
        "child": "to child_link link2 body2", "type": "kind class joint_type",
        "define the start position in a pose, `poses: {home: {JOINT: 30 deg}}`, and select it by `pose` of a mode":
            "initial home default q0 value",
        "offset": "ref zero",
    },
    assembly.LimitSpec: {
        "lower": "min low minimum from", "upper": "max high maximum to", "effort": "torque force max_torque max_force",
        "velocity": "speed max_speed",
    },
    drives.DynamicsSpec: {
        "friction": "frictionloss coulomb stiction", "damping": "viscous", _ROTOR: "rotor_inertia inertia",
        "stiffness": "spring spring_stiffness", "rest": "springref spring_reference equilibrium",
    },
    drives.DriveSpec: {
        "kind": "type mode", "kp": "p gain stiffness position_gain", "kv": "d kd damping velocity_gain",
        "effort": "torque force max_torque max_force stall_torque forcerange", "velocity": "speed max_speed no_load_speed",
        _ROTOR: "rotor_inertia inertia", "drives have a position gain `kp` and a velocity gain `kv`, but no integral gain": "i ki",
        _GEAR: "gear gear_ratio ratio reduction",
        "to use a component as the drive, write only its name: `drive: yaw_servo`": "component part servo motor",
        "a drive is part of its joint and does not refer to one": "joint",
    },
    assembly.ComponentSpec: {
        "part": "class thing module", "file": "mesh stl step cad filename path", "faces": "triangles max_faces decimate simplify",
        "assembly": "include document subassembly sub_assembly robot", "params": "args arguments kwargs",
        "repeat": "count copies instances", "shapes": "geoms visuals collisions",
        _SHAPE: "geometry box cylinder sphere shape size dimensions type kind",
        _PLACE: "parent origin pose pos position location placement transform translation on", "mass": "weight",
        "write `mass`, `com` and `inertia` directly in the component": "inertial", _MATERIAL: "color colour rgba density friction",
        "define joints under `joints` of the document: `{type: revolute, parent: ..., child: ...}`": "joint joints",
        "a component refers to its parent, not to its children": "children child components",
        "set it on the joint that it moves: `drive: COMPONENT`": "actuator servo motor drive",
        "the key is the name of the component": "name",
    },
    poses.PoseSpec: {"xyz": "pos position translation location offset", _XYZ: "x y z", **_TURN_KEYS},
    assembly.TurnSpec: _TURN_KEYS,
    assembly.AtSpec: {"in": "frame parent to of on mount component"},
    assembly.AttachSpec: {
        "gap": "offset distance", "turn": "angle rotation yaw", "mount": "mine my from child", "to": "on target parent other",
    },
    link_shapes.ShapeSpec: {
        "set it under `at`: `at: {xyz: 0 0 10 mm}`": "pos position xyz rpy origin pose offset", "color": "rgba colour",
        "for": "purpose use kind type",
        "each shape has its own key: `box`, `sphere`, `cylinder`, `capsule`, `ellipsoid`, `plane`": "size geometry",
    },
    link_shapes.LongSpec: {"length": "height h l", "radius": "r", "write half the value: `radius: 20 mm`": "diameter"},
    link_shapes.RoundSpec: {"radius": "r", "write half the value: `radius: 20 mm`": "diameter"},
    assembly.ParameterSpec: {
        "value": "default val", "min": "minimum lower", "max": "maximum upper", "doc": "description comment help",
        "use `min` and `max` for bounds": "range bounds", "write the unit in the value: `value: 120 mm`": "unit units type",
    },
    assembly.RepeatSpec: {"count": "n times number", "as": "index var name id"},
    assembly.MimicSpec: {"multiplier": "ratio factor gear scale", "joint": "of follows"},
    assembly.BomSpec: {"cost": "price", "supplier": "vendor manufacturer shop", "number": "part_number order_number sku mpn"},
    modes.SimulationSpec: {
        "timestep": "dt step time_step", "set it in a mode: `modes: {standing: {gravity: floor}}`": "gravity",
        "write MuJoCo-specific options under `raw: {mjcf: {option: {...}}}`": "iterations solver tolerance",
    },
    modes.ModeSpec: {
        "base": "type fixed_base mount", "pose": "start initial keyframe home", "poses": "keyframes keys",
        "root": "parent base_link frame link component", "actuators": "drives motors", "hold": "weld pinned",
        "write `base: fixed`": "fixed", "extends": "inherits like",
    },
    modes.ContactsSpec: {"exclude": "ignore disable disabled", "adhesion": "magnets suction"},
    assembly.AssemblySpec: {
        "components": "parts bodies elements objects children", "parameters": "variables constants properties args arguments params",
        "poses": "keyframes states configurations", "name": "title model robot",
        _DRIVE: "actuators motors drives transmissions actuator transmission", _MODES: "gravity world base root scene contacts",
        "add a nested document as a component: `hand: {assembly: hand.yaml}`": "include includes import imports assemblies",
        "write the unit in each value: `120 mm`": "unit units", "write it in the first key: `thingc: assembly/1`": "version",
        "write MuJoCo-specific attributes under `raw: {mjcf: ...}`": "mjcf mujoco",
        "define variants in a separate document that starts with `thingc: variants/1`": "variants",
    },
    materials.MaterialSpec: {"density": "rho", "color": "colour rgba", "process": "infill walls layer", "friction": "mu slide"},
    materials.ProcessSpec: {
        "kind": "type method", "walls": "perimeters wall_count", "layer": "layer_height", "line_width": "nozzle extrusion_width",
    },
    materials.FrictionSpec: {"slide": "mu sliding static coulomb", "roll": "rolling", "torsion": "torsional"},
    sensors.SensorSpec: {"at": "link body site mount frame parent component on", "type": "kind", "fovy": "fov vfov"},
    variants.VariantsSpec: {"parameters": "grid axes variables", "keep": "rules filter constraints", "assembly": "robot document base"},
    variants.AxisSpec: {"from": "start min lower", "to": "stop end max upper", "count": "steps n num"},
    workspace.WorkspaceSpec: {"parts": "path paths part_folders", "build": "out output"},
}
"""Keys of other formats, grouped by the key of thingc that replaces them, or by a sentence that explains the replacement."""

KEYS: Mapping[type[BaseModel], Mapping[str, str]] = {
    model: {word: meant for meant, words in table.items() for word in words.split()} for model, table in _KEYS.items()
}
"""Keys of other formats by document model, each with the key of thingc that replaces it, or with a sentence that explains the replacement.
"""

FREE = "define a floating robot as a mode: `modes: {adrift: {root: COMPONENT, base: free}}`"

_WORDS = {
    "revolute continuous": "hinge rotary rotational rotation rotate turn pivot swivel angular servo_joint",
    "continuous revolute": "pin wheel bearing axle", "prismatic": "slide slider linear sliding translational translation rail",
    "fixed": "weld welded rigid static bolted anchored world", "ball": "spherical ball_and_socket ball_joint",
    "screw": "helical lead_screw", "free": "floating float freejoint 6dof floating_base", "held": "mocap",
    "position": "servo pd pid position_servo", "velocity": "speed intvelocity", "motor force": "torque effort force direct",
    "hull true": "convex convex_hull convexhull yes", "here hull": "true current now there", "none": "false no off nothing",
    "decompose": "decomposition coacd vhacd", "part": "primitive primitives own", "mesh": "trimesh stl exact",
    "floor": "ground flat horizontal down earth", "ceiling": "upside_down inverted", "rk4": "rk runge_kutta rungekutta",
    "elliptic": "elliptical cone", "imu": "accelerometer gyro gyroscope velocimeter", "camera": "rgb rgbd depth image",
    "joint": "encoder joint_state position", "force": "ft force_torque wrench contact touch",
    "fdm print": "printed fff 3d_print 3d_printed", "resin": "sla dlp", "machined machine": "cnc milled turned",
    "bought buy": "purchased stock bought purchase", "uniform": "grid random", "lhs": "latin_hypercube latin",
    "vendor": "datasheet data_sheet catalogue", "measured": "weighed scale", "estimated": "guess guessed cad computed",
}
"""Values of other formats, grouped by the choices of thingc that they can mean."""

WORDS: Mapping[str, tuple[str, ...]] = {word: tuple(meant.split()) for meant, words in _WORDS.items() for word in words.split()}
"""Values of other formats in lower case, with the choices of thingc that they can mean. The most likely choice comes first.

A choice is suggested only where it is valid.
"""

FLOATING = frozenset({"floating", "float", "free", "freejoint", "6dof", "floating_base"})
"""Joint types of other formats that mean a free base of a mode in thingc."""

WHOLE: Mapping[type[BaseModel], tuple[str, ...]] = {
    assembly.LimitSpec: ("lower", "upper"), modes.WorldAtSpec: ("xyz",), modes.HoldSpec: ("xyz",), assembly.MountSpec: ("xyz",),
    assembly.MimicSpec: ("joint",), assembly.RepeatSpec: ("count",), assembly.AtSpec: ("in",), modes.ModeSpec: ("root",),
    mass.InertiaMatrix: ("ixx", "iyy", "izz"), drives.DriveSpec: ("kind",), drives.DynamicsSpec: ("damping",),
    materials.MaterialSpec: ("density",), materials.FrictionSpec: ("slide",), materials.ProcessSpec: ("kind",),
    sensors.SensorSpec: ("type",), modes.ContactsSpec: ("exclude",), link_shapes.RoundSpec: ("radius",),
    link_shapes.LongSpec: ("radius", "length"),
}
"""Models of mappings for which users often write a single value or a list of values, with the keys of these values."""


def key_for(model: type[BaseModel], key: str) -> str | None:
    """Return the key of thingc that replaces a key of another format, or a sentence that explains the difference.

    Return None for an unknown key.
    """
    for one in model.__mro__:
        known = KEYS.get(one, {}).get(key.lower().replace("-", "_"))
        if known is not None:
            return known
    return None


def choice_hint(word: str, choices: list[str]) -> Hint | None:
    """Return a hint for a value of another format that was written in place of one of the choices, or None."""
    plain = word.lower().replace("-", "_").replace(" ", "_")
    names = [one for one in WORDS.get(plain, ()) if one in choices]
    if names:
        return Suggestion(f"use {one_of(names)}", (word, names[0]) if len(names) == 1 else None)
    return FREE if plain in FLOATING and "revolute" in choices else None


def written_whole(model: type[BaseModel], texts: list[str], value: object) -> str | None:
    """Return the text of the mapping that the user probably intended by a single value or a list, or None.

    `texts` contains the source texts of the scalars in the value.
    """
    keys = WHOLE.get(model)
    if keys is None or not texts or not all(texts) or isinstance(value, bool):
        return None
    if keys == ("xyz",):
        return f"{{xyz: [{', '.join(texts)}]}}" if len(texts) == 3 else f"{{xyz: {shortened(texts[0])}}}" if len(texts) == 1 else None
    needed = sum(required for _, required in model_keys(model).values())
    if not max(needed, 1 if len(keys) < 2 else 2) <= len(texts) <= len(keys):
        return None
    return "{" + ", ".join(f"{key}: {shortened(text, 40)}" for key, text in zip(keys, texts)) + "}"
