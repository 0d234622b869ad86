"""Compute the expected answers of all readers with MuJoCo, from the MJCF of the same mode. The MJCF contains every link, frame and joint
under its path.
"""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

CONFIGURATIONS = 50
STEPS = 50
HELD = ":held"
"""Suffix of MJCF bodies and sites that only hold a mount."""
PUSH = 0.2
"""Maximum initial speed of joints in the simulation steps [rad/s, m/s]."""


@dataclass(frozen=True)
class Question:
    """A question about a file. `request` is sent to the reader, and `answer` contains the expected values with the keys of the reader's
    answer.
    """

    name: str
    format: str
    request: dict[str, Any]
    answer: dict[str, Any]


@dataclass(frozen=True)
class Coordinate:
    """Coordinate number `axis` of the joint `name` in a file.

    In MJCF, the coordinate is the joint `path`. The joints in `others`, such as the slide of a screw, move with this joint by a factor.
    `zero` is the value of `path` at which the joint in the file is at 0. The coordinates of a ball joint are roll, pitch and yaw. The
    velocities of a ball joint are about the axes x, y and z of the parent.
    """

    name: str
    axis: int
    path: str
    others: tuple[tuple[str, float], ...] = ()
    zero: float = 0.0


FORMATS = {".urdf": "URDF", ".sdf": "SDF", ".xml": "MJCF", ".usda": "USD"}
"""The name of the format for each suffix."""


def question(file: Path, mjcf: Path, seed: int = 0, count: int = CONFIGURATIONS) -> Question:
    """Return a question about a URDF, SDF, USD or MJCF file, with `count` random configurations.

    Frames are relative to the root link. If the base is fixed, gravity is in the world frame. If the base is free, gravity is along the
    axes of the root link.
    """
    model, format = mujoco.MjModel.from_xml_path(str(mjcf)), FORMATS[file.suffix]
    tree = ElementTree.Element("none") if format == "USD" else ElementTree.parse(file).getroot()
    types = {joint.attrib["name"]: joint.attrib.get("type", "") for joint in tree.iter("joint") if "name" in joint.attrib}
    bodies = {model.body(k).name: ("body", k) for k in range(1, model.nbody) if not model.body(k).name.endswith(HELD)}
    # a `frame` component with the name of a link is the frame of that link
    own = {model.site(k).name: k for k in range(model.nsite) if not model.site(k).name.endswith(HELD)}
    sites = {_safe(name): ("site", k) for name, k in own.items() if name not in bodies}
    without: list[str] = []
    match format:
        case "URDF":
            coordinates = list(_of_urdf(model, types, file))
            links = {link.attrib["name"] for link in tree.iter("link")}
            frames = {_of_link(_safe(name), links): where for name, where in bodies.items()} | sites
        case "SDF":
            coordinates = list(_of_sdf(model, types, file))
            frames = {_safe(name): where for name, where in bodies.items()} | sites
            without = sorted(set(types) - {one.name for one in coordinates} - {"root"})
        case "USD":
            coordinates = list(_of_usd(model, file))
            frames = {_safe(name): where for name, where in bodies.items()} | sites
        case _:
            coordinates, frames = list(_of_mjcf(model)), bodies
    by_path = {one.path: one for one in coordinates}
    mimics = [_mimic(model, one, by_path) if format != "USD" or ":slide" not in one.path else None for one in coordinates]
    slides = [model.jnt_type[model.joint(one.path).id] == mujoco.mjtJoint.mjJNT_SLIDE for one in coordinates]
    names = [one.name for one in coordinates]
    q = _configurations(names, slides, mimics, np.random.default_rng(seed), count)
    on_joints = [k for k in range(model.nu) if model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_JOINT]
    driven = {model.joint(model.actuator_trnid[k][0]).name for k in on_joints}
    request = {
        "file": str(file), "frames": list(frames), "meshes": [_shape(name, format) for name in _meshes(model)], "joints": names,
        "axes": [one.axis for one in coordinates], "leaders": [one and one[0] for one in mimics], "without": without, "q": q.tolist(),
        "driven": [one.path in driven for one in coordinates], "gravity": model.opt.gravity.tolist(),
        "free": bool((model.jnt_type == mujoco.mjtJoint.mjJNT_FREE).any()),
    }
    zeros = np.array([one.zero for one in coordinates])
    answers = {**_answers(model, coordinates, frames, q + zeros), "mimic": mimics}
    if format in ("URDF", "USD"):
        answers["range"] = [_range(names, answers["range"], k, follows) for k, follows in enumerate(mimics)]
    if format == "SDF":  # mimic joints have no effort limit of their own
        answers["effort"] = [np.inf if follows and not own else own for own, follows in zip(answers["effort"], mimics, strict=True)]
    if format == "USD":  # only drives have effort limits
        answers["effort"] = [own if there else 0.0 for own, there in zip(answers["effort"], request["driven"], strict=True)]
    return Question(mjcf.stem, format, request, answers)


def stepped(one: Question) -> Question:
    """Return a question about an MJCF file that also asks for the joint positions after some simulation steps without contacts.

    The simulation begins in the initial state of the mode. Every independent joint has a random initial speed, and every drive has its
    control of the initial state.
    """
    model = mujoco.MjModel.from_xml_path(one.request["file"])
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qvel = np.random.default_rng(0).uniform(-PUSH, PUSH, model.nv)
    coupled = model.eq_type == mujoco.mjtEq.mjEQ_JOINT
    for joint in {*model.eq_obj1id[coupled], *model.eq_obj2id[coupled]}:
        data.qvel[model.jnt_dofadr[joint]] = 0.0  # different speeds would violate the equality constraint
    request = {**one.request, "steps": STEPS, "qvel": data.qvel.tolist()}
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
    return replace(one, request=request, answer={**one.answer, "steps": data.qpos.tolist()})


def _of_mjcf(model: mujoco.MjModel) -> Iterator[Coordinate]:
    """Yield the joint coordinates of an MJCF file."""
    for path in _moving(model):
        ball = model.jnt_type[model.joint(path).id] == mujoco.mjtJoint.mjJNT_BALL
        yield from (Coordinate(path, axis, path) for axis in range(3 if ball else 1))


def _of_urdf(model: mujoco.MjModel, types: dict[str, str], file: Path) -> Iterator[Coordinate]:
    """Yield the joint coordinates of a URDF file, in the order of the file."""
    paths = {_safe(path): path for path in _moving(model)}
    moving = [name for name, kind in types.items() if kind != "fixed"]
    if set(paths) != set(moving):
        raise ValueError(f"{file}: joints {sorted(set(paths) ^ set(moving))} are in one file only")
    return (Coordinate(name, 0, paths[name]) for name in moving)


def _of_sdf(model: mujoco.MjModel, types: dict[str, str], file: Path) -> Iterator[Coordinate]:
    """Yield the joint coordinates of an SDF file, in the order of the MJCF model. Joints that close loops are omitted.

    A universal joint has two coordinates.
    """
    paths, zero = _moving(model), _zeros(model, file)
    axes: dict[str, int] = {}
    for path in paths:
        whole = _safe(path)[:-2]
        name = whole if types.get(whole) == "universal" else _safe(path)
        if path.endswith(":slide"):
            continue
        if name not in types:
            raise ValueError(f"{file}: joint {name} is missing")
        if types[name] == "ball":
            yield from (Coordinate(name, axis, path) for axis in range(3))
            continue
        pitch = tuple((other, 1.0 / float(_polynomial(model, path)[1])) for other in paths if other == f"{path}:slide")
        yield Coordinate(name, axes.get(name, 0), path, pitch, zero.get(path, 0.0))
        axes[name] = axes.get(name, 0) + 1


def _of_usd(model: mujoco.MjModel, file: Path) -> Iterator[Coordinate]:
    """Yield the joint coordinates of a USD file, in the order of the MJCF model.

    The coordinates of a generic joint (D6) are first its slides and then its rotations, each in the order of the tree.
    """
    made = set(re.findall(r'def Physics\w*Joint "(\w+)"', file.read_text()))
    paths, axes = _moving(model), {}
    whole = {path: name if (name := _safe(path).removesuffix("_slide")) in made else name[:-2] for path in paths}
    for path in sorted(paths, key=lambda path: model.jnt_type[model.joint(path).id] == mujoco.mjtJoint.mjJNT_HINGE):
        axes[path] = sum(whole[other] == whole[path] for other in axes)
    for path in paths:
        if whole[path] not in made:
            raise ValueError(f"{file}: joint {whole[path]} is missing")
        ball = model.jnt_type[model.joint(path).id] == mujoco.mjtJoint.mjJNT_BALL
        yield from (Coordinate(whole[path], axes[path] + axis, path) for axis in range(3 if ball else 1))


def _moving(model: mujoco.MjModel) -> list[str]:
    return [model.joint(k).name for k in range(model.njnt) if model.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE]


def _zeros(model: mujoco.MjModel, file: Path) -> dict[str, float]:
    """Return the joint values of the MJCF model at which all joints of an SDF file are at 0, according to the manifest. Return an empty
    dictionary if all values are 0.
    """
    build = file.parents[2]
    losses = json.loads((build / "manifest.json").read_text())["losses"]
    mode = file.parent.name.removeprefix(f"{build.name}_")
    what = "the zero pose: position 0 of each joint in the file corresponds to the pose `(.*?)`"
    said = [re.match(what, loss["what"]) for loss in losses if (loss["target"], loss["mode"]) == ("sdf", mode)]
    poses = [one[1] for one in said if one]
    if not poses:
        return {}
    qpos = model.key(poses[0]).qpos
    return {path: float(qpos[model.joint(path).qposadr[0]]) for path in _moving(model)}


def _polynomial(model: mujoco.MjModel, path: str) -> Any:
    """Return the coefficients of the equality constraint of a mimic joint."""
    own = model.joint(path).id
    return next(
        model.eq_data[k] for k in range(model.neq) if model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and int(model.eq_obj1id[k]) == own
    )


Follows = tuple[str, float, float]
"""The leader of a mimic joint, the multiplier, and the offset."""


def _mimic(model: mujoco.MjModel, one: Coordinate, by_path: dict[str, Coordinate]) -> Follows | None:
    """Return the leader, multiplier and offset of a coordinate from the equality constraints of the MJCF model. Return None if the
    coordinate is independent.

    In MuJoCo, the rotation of a screw follows its slide. In the answers, a slide that is a coordinate follows the rotation.
    """
    own = model.joint(one.path).id
    for k in range(model.neq):
        if model.eq_type[k] != mujoco.mjtEq.mjEQ_JOINT:
            continue
        follower, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        offset, multiplier = (float(value) for value in model.eq_data[k][:2])
        screw = model.joint(leader).name.endswith(":slide")
        if screw and own == leader:
            return by_path[model.joint(follower).name].name, 1.0 / multiplier, 0.0
        if not screw and own == follower:
            led = by_path[model.joint(leader).name]
            return led.name, multiplier, offset + multiplier * led.zero - one.zero
    return None


def _range(names: list[str], ranges: list[list[float] | None], k: int, follows: Follows | None) -> list[float] | None:
    """Return the range of a joint. If a mimic joint has no range in MJCF, its range is computed from the range of its leader."""
    if ranges[k] is not None or follows is None:
        return ranges[k]
    leader, multiplier, offset = follows
    ends = ranges[names.index(leader)]
    return None if ends is None else sorted(multiplier * end + offset for end in ends)


def _configurations(
    names: list[str], prismatic: list[bool], mimics: list[Follows | None], rng: np.random.Generator, count: int,
) -> Any:
    """Return random joint configurations (count, joints). Rotations are between -pi and pi, and slides between -0.1 m and 0.1 m. Mimic
    joints have the values that follow from their leaders.
    """
    q = rng.uniform(-1.0, 1.0, (count, len(names))) * [0.1 if slides else np.pi for slides in prismatic]
    waiting = {k: one for k, one in enumerate(mimics) if one is not None}
    while waiting:
        follower = next(k for k, (leader, _, _) in waiting.items() if names.index(leader) not in waiting)
        leader, multiplier, offset = waiting.pop(follower)
        q[:, follower] = multiplier * q[:, names.index(leader)] + offset
    return q


def _answers(model: mujoco.MjModel, coordinates: list[Coordinate], frames: dict[str, tuple[str, int]], q: Any) -> dict[str, Any]:
    data = mujoco.MjData(model)
    balls = {one.path for one in coordinates if model.jnt_type[model.joint(one.path).id] == mujoco.mjtJoint.mjJNT_BALL}
    moves = np.zeros((model.nv, len(coordinates)))  # motion of MuJoCo's coordinates per coordinate
    for k, one in enumerate(coordinates):
        for path, ratio in ((one.path, 1.0), *one.others) if one.path not in balls else ():
            moves[model.joint(path).dofadr[0], k] = ratio
    poses, matrices, torques, centres, boxes = [], [], [], [], []
    for values in q:
        mujoco.mj_resetData(model, data)
        for k, one in enumerate(coordinates):
            if one.path in balls and one.axis == 0:  # MuJoCo's velocities of a ball are in the axes of the child
                turn, first = Rotation.from_euler("xyz", values[k : k + 3]), model.joint(one.path).dofadr[0]
                data.joint(one.path).qpos = turn.as_quat()[[3, 0, 1, 2]]
                moves[first : first + 3, k : k + 3] = turn.as_matrix().T
            for path, ratio in ((one.path, 1.0), *one.others) if one.path not in balls else ():
                data.joint(path).qpos = ratio * values[k]
        if model.nq and model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[:7] = (0, 0, 0, 1, 0, 0, 0)
        mujoco.mj_forward(model, data)
        boxes = boxes or [_box(data, k) for k in _meshes(model).values()]
        poses.append([_pose(data, *frame).tolist() for frame in frames.values()])
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        full -= np.diag(model.dof_armature)  # other formats do not contain the armature
        matrices.append((moves.T @ full @ moves).tolist())
        torques.append((moves.T @ data.qfrc_bias).tolist())
        centres.append(data.subtree_com[0].tolist())
    limited = [model.joint(one.path).limited[0] and one.path not in balls for one in coordinates]
    ranges = [(model.joint(one.path).range - one.zero).tolist() if there else None for one, there in zip(coordinates, limited, strict=True)]
    return {
        "frames": poses, "mass": float(model.body_mass.sum()), "mass_matrix": matrices, "torque": torques, "centre": centres,
        "meshes": boxes, "range": ranges, "effort": [_effort(model, model.joint(one.path).id) for one in coordinates],
    }


def _meshes(model: mujoco.MjModel) -> dict[str, int]:
    """Return the indices of all mesh geoms, by name."""
    return {model.geom(k).name: k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_MESH}


def _shape(name: str, format: str) -> str:
    """Return the name that a geom of MJCF has in another format. The name in MJCF is for example `hand/cap` or `hand/cap:collision_1`."""
    path, collides, number = name.partition(":collision")
    if format == "USD":
        return f"{'collisions' if collides else 'visuals'}/{_safe(path)}{number}"
    if format != "SDF":
        return name
    return f"{_safe(path)}_{'collision' if collides else 'visual'}{number}"


def _box(data: mujoco.MjData, geom: int) -> list[float]:
    """Return the smallest and the largest corner of the bounding box of a mesh in the world."""
    mesh = data.model.geom_dataid[geom]
    first, count = data.model.mesh_vertadr[mesh], data.model.mesh_vertnum[mesh]
    points = data.model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return [*points.min(axis=0).tolist(), *points.max(axis=0).tolist()]


def _effort(model: mujoco.MjModel, joint: int) -> float:
    """Return the effort limit of the drive of a joint. If the joint has no drive, return the effort limit of the joint, or 0 if it has no
    limit.
    """
    for k in range(model.nu):
        if model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_JOINT and model.actuator_trnid[k][0] == joint:
            motor = model.actuator_biastype[k] == mujoco.mjtBias.mjBIAS_NONE
            limited, bounds = (model.actuator_ctrllimited, model.actuator_ctrlrange) if motor else (
                model.actuator_forcelimited, model.actuator_forcerange
            )
            return float(bounds[k][1]) if limited[k] else np.inf
    return float(model.jnt_actfrcrange[joint][1]) if model.jnt_actfrclimited[joint] else 0.0


def _pose(data: mujoco.MjData, kind: str, index: int) -> Any:
    matrix = np.eye(4)
    position, rotation = (data.xpos, data.xmat) if kind == "body" else (data.site_xpos, data.site_xmat)
    matrix[:3, :3], matrix[:3, 3] = rotation[index].reshape(3, 3), position[index]
    return matrix


def _safe(path: str) -> str:
    """Convert an MJCF name to a name that is valid in the other formats."""
    return path.replace("/", "_").replace(":slide", "_slide")


def _of_link(name: str, links: set[str]) -> str:
    return f"{name}_frame" if f"{name}_frame" in links else name
