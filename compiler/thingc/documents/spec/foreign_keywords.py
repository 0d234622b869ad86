"""What other formats, other programs and other habits call what documents say: words of URDF, SDFormat, MJCF, ROS, printing and CAD,
and what takes their place here.

`KEYS` has keys, by the model of a mapping; `WORDS` has values of choices; `WHOLE` are mappings that people write as their values alone.
"""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel

from thingc.base.suggestions import Suggestion
from thingc.base.units import shortened
from thingc.documents.spec import assembly, drives, link_shapes, mass, materials, modes, poses, sensors, variants, workspace
from thingc.documents.spec.annotation_types import model_keys, one_of

_PLACE = "a component is placed by `attach: {my_mount: other.mount}`, by `at: {in: other.mount, xyz: 0 0 9 mm}`, or as the child of a joint"
_MOUNTS = "the mounts say where a joint is: `parent: component.mount`, `child: component.mount`"
_SHAPE = (
    "geometry is a `part` (a class in Python), a `file` (STEP, STL and others), a list of `shapes` (`link: true`), or none: `frame: true`"
)
_MATERIAL = "that is of the material: name one in `material`, and write its `density` and `color` under `materials`"
_RPY = "an orientation is `rpy`, extrinsic roll, pitch and yaw as in URDF: `rpy: 0 0 90 deg`, or `quat: [w, x, y, z]`"
_XYZ = "write the three of them: `xyz: 0 0 10 mm`"
_MODES = "each of `modes` says it: `modes: {standing: {root: COMPONENT, base: fixed, gravity: floor}}`"
_DRIVE = "a joint says what moves it: `drive: COMPONENT` with an actuator, or `drive: {kind: position, kp: 20 N*m/rad}`"
_ROTOR = "`armature` is the inertia of the rotor as the joint feels it: times the gear ratio squared"
_GEAR = "a drive is what acts at the joint, behind the gear; `gear_ratio` is of an `Actuator` in Python"

_TURN_KEYS = {
    **dict.fromkeys(("euler", "rotation", "rot", "orientation"), "rpy"),
    "quaternion": "quat", **dict.fromkeys(("axisangle", "zaxis", "xyaxes", "normal"), _RPY),
}
_POSE_KEYS = {
    **dict.fromkeys(("pos", "position", "translation", "location", "offset"), "xyz"),
    **dict.fromkeys(("x", "y", "z"), _XYZ), **_TURN_KEYS,
}

KEYS: Mapping[type[BaseModel], Mapping[str, str]] = {
    assembly.JointDefaults: {
        **dict.fromkeys(("range", "bounds", "position_limits"), "where it stops is `limit: {lower: -90 deg, upper: 90 deg}`"),
        **dict.fromkeys(("actuator", "motor", "servo", "transmission", "driven_by"), "drive"),
        "frictionloss": "dry friction is `dynamics: {friction: 0.1 N*m}`",
    },
    assembly.JointSpec: {
        **dict.fromkeys(("origin", "xyz", "rpy", "pose", "pos", "location", "anchor"), _MOUNTS),
        **dict.fromkeys(("from", "base", "parent_link", "link1", "body1"), "parent"),
        **dict.fromkeys(("to", "child_link", "link2", "body2"), "child"),
        **dict.fromkeys(("kind", "class", "joint_type"), "type"),
        **dict.fromkeys(
            ("initial", "home", "default", "q0", "value"),
            "where a joint starts is said by a pose, `poses: {home: {JOINT: 30 deg}}`, and by the `pose` of a mode",
        ),
        **dict.fromkeys(("ref", "zero"), "offset"),
    },
    assembly.LimitSpec: {
        **dict.fromkeys(("min", "low", "minimum", "from"), "lower"), **dict.fromkeys(("max", "high", "maximum", "to"), "upper"),
        **dict.fromkeys(("torque", "force", "max_torque", "max_force"), "effort"), **dict.fromkeys(("speed", "max_speed"), "velocity"),
    },
    drives.DynamicsSpec: {
        **dict.fromkeys(("frictionloss", "coulomb", "stiction"), "friction"), "viscous": "damping",
        **dict.fromkeys(("rotor_inertia", "inertia"), _ROTOR), **dict.fromkeys(("spring", "spring_stiffness"), "stiffness"),
        **dict.fromkeys(("springref", "spring_reference", "equilibrium"), "rest"),
    },
    drives.DriveSpec: {
        **dict.fromkeys(("type", "mode"), "kind"), **dict.fromkeys(("p", "gain", "stiffness", "position_gain"), "kp"),
        **dict.fromkeys(("d", "kd", "damping", "velocity_gain"), "kv"),
        **dict.fromkeys(("torque", "force", "max_torque", "max_force", "stall_torque", "forcerange"), "effort"),
        **dict.fromkeys(("speed", "max_speed", "no_load_speed"), "velocity"), **dict.fromkeys(("rotor_inertia", "inertia"), _ROTOR),
        **dict.fromkeys(("i", "ki"), "drives have a position gain `kp` and a velocity gain `kv`, and no integral one"),
        **dict.fromkeys(("gear", "gear_ratio", "ratio", "reduction"), _GEAR),
        **dict.fromkeys(("component", "part", "servo", "motor"), "a component that drives is named alone: `drive: yaw_servo`"),
        "joint": "a drive stands in its joint and names none",
    },
    assembly.ComponentSpec: {
        **dict.fromkeys(("class", "thing", "module"), "part"), **dict.fromkeys(("mesh", "stl", "step", "cad", "filename", "path"), "file"),
        **dict.fromkeys(("triangles", "max_faces", "decimate", "simplify"), "faces"),
        **dict.fromkeys(("include", "document", "subassembly", "sub_assembly", "robot"), "assembly"),
        **dict.fromkeys(("args", "arguments", "kwargs"), "params"), **dict.fromkeys(("count", "copies", "instances"), "repeat"),
        **dict.fromkeys(("geoms", "visuals", "collisions"), "shapes"),
        **dict.fromkeys(("geometry", "box", "cylinder", "sphere", "shape", "size", "dimensions", "type", "kind"), _SHAPE),
        **dict.fromkeys(("parent", "origin", "pose", "pos", "position", "location", "placement", "transform", "translation", "on"), _PLACE),
        "weight": "mass", "inertial": "`mass`, `com` and `inertia` stand in the component itself",
        **dict.fromkeys(("color", "colour", "rgba", "density", "friction"), _MATERIAL),
        **dict.fromkeys(("joint", "joints"), "joints stand under `joints` of the document: `{type: revolute, parent: ..., child: ...}`"),
        **dict.fromkeys(("children", "child", "components"), "a component says what it sits on, not what sits on it"),
        **dict.fromkeys(("actuator", "servo", "motor", "drive"), "the joint that it moves names it: `drive: COMPONENT`"),
        "name": "a component is called by its key",
    },
    poses.PoseSpec: _POSE_KEYS, assembly.TurnSpec: _TURN_KEYS,
    assembly.AtSpec: dict.fromkeys(("frame", "parent", "to", "of", "on", "mount", "component"), "in"),
    assembly.AttachSpec: {
        **dict.fromkeys(("offset", "distance"), "gap"), **dict.fromkeys(("angle", "rotation", "yaw"), "turn"),
        **dict.fromkeys(("mine", "my", "from", "child"), "mount"), **dict.fromkeys(("on", "target", "parent", "other"), "to"),
    },
    link_shapes.ShapeSpec: {
        **dict.fromkeys(("pos", "position", "xyz", "rpy", "origin", "pose", "offset"), "it is said under `at`: `at: {xyz: 0 0 10 mm}`"),
        **dict.fromkeys(("rgba", "colour"), "color"), **dict.fromkeys(("purpose", "use", "kind", "type"), "for"),
        **dict.fromkeys(("size", "geometry"), "each shape has its own key: `box`, `sphere`, `cylinder`, `capsule`, `ellipsoid`, `plane`"),
    },
    link_shapes.LongSpec: {**dict.fromkeys(("height", "h", "l"), "length"), "r": "radius", "diameter": "write half of it: `radius: 20 mm`"},
    link_shapes.RoundSpec: {"r": "radius", "diameter": "write half of it: `radius: 20 mm`"},
    assembly.ParameterSpec: {
        **dict.fromkeys(("default", "val"), "value"),
        **dict.fromkeys(("minimum", "lower"), "min"), **dict.fromkeys(("maximum", "upper"), "max"),
        **dict.fromkeys(("description", "comment", "help"), "doc"), **dict.fromkeys(("range", "bounds"), "its bounds are `min` and `max`"),
        **dict.fromkeys(("unit", "units", "type"), "the unit stands in the value: `value: 120 mm`"),
    },
    assembly.RepeatSpec: {**dict.fromkeys(("n", "times", "number"), "count"), **dict.fromkeys(("index", "var", "name", "id"), "as")},
    assembly.MimicSpec: {**dict.fromkeys(("ratio", "factor", "gear", "scale"), "multiplier"), **dict.fromkeys(("of", "follows"), "joint")},
    assembly.BomSpec: {
        **dict.fromkeys(("price",), "cost"), **dict.fromkeys(("vendor", "manufacturer", "shop"), "supplier"),
        **dict.fromkeys(("part_number", "order_number", "sku", "mpn"), "number"),
    },
    modes.SimulationSpec: {
        **dict.fromkeys(("dt", "step", "time_step"), "timestep"),
        "gravity": "a mode says it: `modes: {standing: {gravity: floor}}`",
        **dict.fromkeys(("iterations", "solver", "tolerance"), "what MuJoCo alone knows is written under `raw: {mjcf: {option: {...}}}`"),
    },
    modes.ModeSpec: {
        **dict.fromkeys(("type", "fixed_base", "mount"), "base"), **dict.fromkeys(("start", "initial", "keyframe", "home"), "pose"),
        **dict.fromkeys(("keyframes", "keys"), "poses"), **dict.fromkeys(("parent", "base_link", "frame", "link", "component"), "root"),
        **dict.fromkeys(("drives", "motors"), "actuators"), **dict.fromkeys(("weld", "pinned"), "hold"), "fixed": "write `base: fixed`",
        **dict.fromkeys(("inherits", "like"), "extends"),
    },
    modes.ContactsSpec: {
        **dict.fromkeys(("ignore", "disable", "disabled"), "exclude"), **dict.fromkeys(("magnets", "suction"), "adhesion"),
    },
    assembly.AssemblySpec: {
        **dict.fromkeys(("parts", "bodies", "elements", "objects", "children"), "components"),
        **dict.fromkeys(("variables", "constants", "properties", "args", "arguments", "params"), "parameters"),
        **dict.fromkeys(("keyframes", "states", "configurations"), "poses"), **dict.fromkeys(("title", "model", "robot"), "name"),
        **dict.fromkeys(("actuators", "motors", "drives", "transmissions", "actuator", "transmission"), _DRIVE),
        **dict.fromkeys(("gravity", "world", "base", "root", "scene", "contacts"), _MODES),
        **dict.fromkeys(
            ("include", "includes", "import", "imports", "assemblies"), "a nested document is a component: `hand: {assembly: hand.yaml}`",
        ),
        **dict.fromkeys(("unit", "units"), "every value has its own unit: `120 mm`"),
        "version": "the first key says it: `thingc: assembly/1`",
        **dict.fromkeys(("mjcf", "mujoco"), "what MuJoCo alone knows is written under `raw: {mjcf: ...}`"),
        "variants": "variants are a document of their own, which begins with `thingc: variants/1`",
    },
    materials.MaterialSpec: {
        "rho": "density", **dict.fromkeys(("colour", "rgba"), "color"), **dict.fromkeys(("infill", "walls", "layer"), "process"),
        **dict.fromkeys(("mu", "slide"), "friction"),
    },
    materials.ProcessSpec: {
        **dict.fromkeys(("type", "method"), "kind"), **dict.fromkeys(("perimeters", "wall_count"), "walls"),
        **dict.fromkeys(("layer_height",), "layer"), **dict.fromkeys(("nozzle", "extrusion_width"), "line_width"),
    },
    materials.FrictionSpec: {**dict.fromkeys(("mu", "sliding", "static", "coulomb"), "slide"), "rolling": "roll", "torsional": "torsion"},
    sensors.SensorSpec: {
        **dict.fromkeys(("link", "body", "site", "mount", "frame", "parent", "component", "on"), "at"), "kind": "type",
        **dict.fromkeys(("fov", "vfov"), "fovy"),
    },
    variants.VariantsSpec: {
        **dict.fromkeys(("grid", "axes", "variables"), "parameters"), **dict.fromkeys(("rules", "filter", "constraints"), "keep"),
        **dict.fromkeys(("robot", "document", "base"), "assembly"),
    },
    variants.AxisSpec: {
        **dict.fromkeys(("start", "min", "lower"), "from"), **dict.fromkeys(("stop", "end", "max", "upper"), "to"),
        **dict.fromkeys(("steps", "n", "num"), "count"),
    },
    workspace.WorkspaceSpec: {**dict.fromkeys(("path", "paths", "part_folders"), "parts"), **dict.fromkeys(("out", "output"), "build")},
}
"""By the model of a mapping (and those derived from it) what people write there, and the key or the sentence that stands for it."""

_TURNS, _SLIDES = ("revolute", "continuous"), ("prismatic",)
FREE = "a robot that floats is a mode: `modes: {adrift: {root: COMPONENT, base: free}}`"

WORDS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("hinge", "rotary", "rotational", "rotation", "rotate", "turn", "pivot", "swivel", "angular", "servo_joint"), _TURNS),
    **dict.fromkeys(("pin", "wheel", "bearing", "axle"), ("continuous", "revolute")),
    **dict.fromkeys(("slide", "slider", "linear", "sliding", "translational", "translation", "rail"), _SLIDES),
    **dict.fromkeys(("weld", "welded", "rigid", "static", "bolted", "anchored", "world"), ("fixed",)),
    **dict.fromkeys(("spherical", "ball_and_socket", "ball_joint"), ("ball",)), **dict.fromkeys(("helical", "lead_screw"), ("screw",)),
    **dict.fromkeys(("floating", "float", "freejoint", "6dof", "floating_base"), ("free",)),
    "mocap": ("held",),
    **dict.fromkeys(("servo", "pd", "pid", "position_servo"), ("position",)), **dict.fromkeys(("speed", "intvelocity"), ("velocity",)),
    **dict.fromkeys(("torque", "effort", "force", "direct"), ("motor", "force")),
    **dict.fromkeys(("convex", "convex_hull", "convexhull", "true", "yes"), ("hull", "true")),
    **dict.fromkeys(("false", "no", "off", "nothing"), ("none",)), **dict.fromkeys(("decomposition", "coacd", "vhacd"), ("decompose",)),
    **dict.fromkeys(("primitive", "primitives", "own"), ("part",)), **dict.fromkeys(("trimesh", "stl", "exact"), ("mesh",)),
    **dict.fromkeys(("ground", "flat", "horizontal", "down", "earth"), ("floor",)),
    **dict.fromkeys(("upside_down", "inverted"), ("ceiling",)),
    **dict.fromkeys(("current", "now", "there", "true"), ("here", "hull")),
    **dict.fromkeys(("rk", "runge_kutta", "rungekutta"), ("rk4",)), **dict.fromkeys(("elliptical", "cone"), ("elliptic",)),
    **dict.fromkeys(("accelerometer", "gyro", "gyroscope", "velocimeter"), ("imu",)),
    **dict.fromkeys(("rgb", "rgbd", "depth", "image"), ("camera",)), **dict.fromkeys(("encoder", "joint_state", "position"), ("joint",)),
    **dict.fromkeys(("ft", "force_torque", "wrench", "contact", "touch"), ("force",)),
    **dict.fromkeys(("printed", "fff", "3d_print", "3d_printed"), ("fdm", "print")), **dict.fromkeys(("sla", "dlp"), ("resin",)),
    **dict.fromkeys(("cnc", "milled", "turned"), ("machined", "machine")), **dict.fromkeys(("purchased", "stock"), ("bought", "buy")),
    **dict.fromkeys(("bought", "purchase"), ("bought", "buy")), **dict.fromkeys(("grid", "random"), ("uniform",)),
    **dict.fromkeys(("latin_hypercube", "latin"), ("lhs",)), **dict.fromkeys(("datasheet", "data_sheet", "catalogue"), ("vendor",)),
    **dict.fromkeys(("weighed", "scale"), ("measured",)), **dict.fromkeys(("guess", "guessed", "cad", "computed"), ("estimated",)),
}
"""Words for values, in lower case, and the choices that they may mean, the likeliest first; only some of them are choices at a place."""

FLOATING = frozenset({"floating", "float", "free", "freejoint", "6dof", "floating_base"})
"""Types of joints elsewhere that are the base of a mode here."""

WHOLE: Mapping[type[BaseModel], tuple[str, ...]] = {
    assembly.LimitSpec: ("lower", "upper"), modes.WorldAtSpec: ("xyz",), modes.HoldSpec: ("xyz",), assembly.MountSpec: ("xyz",),
    assembly.MimicSpec: ("joint",), assembly.RepeatSpec: ("count",), assembly.AtSpec: ("in",), modes.ModeSpec: ("root",),
    mass.InertiaMatrix: ("ixx", "iyy", "izz"), drives.DriveSpec: ("kind",), drives.DynamicsSpec: ("damping",),
    materials.MaterialSpec: ("density",), materials.FrictionSpec: ("slide",), materials.ProcessSpec: ("kind",),
    sensors.SensorSpec: ("type",), modes.ContactsSpec: ("exclude",), link_shapes.RoundSpec: ("radius",),
    link_shapes.LongSpec: ("radius", "length"),
}
"""Mappings that people write as a value or a list of values, and the keys that those are of."""


def key_for(model: type[BaseModel], key: str) -> str | None:
    """The key, or the sentence, that stands for `key` in a mapping of this model; None where nobody knows it."""
    for one in model.__mro__:
        known = KEYS.get(one, {}).get(key.lower().replace("-", "_"))
        if known is not None:
            return known
    return None


def choice_hint(word: str, choices: list[str]) -> str | None:
    """What to write for a word of elsewhere that is none of the choices; None where nobody knows it."""
    plain = word.lower().replace("-", "_").replace(" ", "_")
    names = [one for one in WORDS.get(plain, ()) if one in choices]
    if names:
        return Suggestion(f"here it is called {one_of(names)}", (word, names[0]) if len(names) == 1 else None)
    return FREE if plain in FLOATING and "revolute" in choices else None


def written_whole(model: type[BaseModel], texts: list[str], value: object) -> str | None:
    """The mapping of this model that a person meant who wrote a value, or a list, in its place (`texts` are its scalars); None where
    nobody can tell."""
    keys = WHOLE.get(model)
    if keys is None or not texts or not all(texts) or isinstance(value, bool):
        return None
    if keys == ("xyz",):
        return f"{{xyz: [{', '.join(texts)}]}}" if len(texts) == 3 else f"{{xyz: {shortened(texts[0])}}}" if len(texts) == 1 else None
    needed = sum(required for _, required in model_keys(model).values())
    if not max(needed, 1 if len(keys) < 2 else 2) <= len(texts) <= len(keys):
        return None
    return "{" + ", ".join(f"{key}: {shortened(text, 40)}" for key, text in zip(keys, texts)) + "}"
