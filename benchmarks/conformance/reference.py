"""What every reader must answer: MuJoCo on the MJCF of the same mode, which has every link, frame and joint by its path."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

CONFIGURATIONS = 50


@dataclass(frozen=True)
class Question:
    """A file, what is asked of it, and the answers: `request` goes to the reader, `answer` has the same keys as what it gives back."""

    name: str
    request: dict[str, Any]
    answer: dict[str, Any]


def question(urdf: Path, mjcf: Path, seed: int = 0) -> Question:
    """Of one URDF file. Frames are seen from the root link; gravity acts in the world of a base that is fixed, else in the root's axes."""
    tree = ElementTree.parse(urdf).getroot()
    links = {link.attrib["name"] for link in tree.iter("link")}
    joints = {joint.attrib["name"]: joint for joint in tree.iter("joint") if joint.attrib["type"] != "fixed"}
    model = mujoco.MjModel.from_xml_path(str(mjcf))
    paths = {_safe(model.joint(k).name): model.joint(k).name for k in range(model.njnt) if model.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE}
    if set(paths) != set(joints):
        raise ValueError(f"{urdf}: joints {sorted(set(paths) ^ set(joints))} are in one file only")
    frames = {_of_link(_safe(model.body(k).name), links): ("body", k) for k in range(1, model.nbody)}
    bodies = {model.body(k).name for k in range(model.nbody)}  # a `frame` component that names its link is the link's own frame
    frames |= {_safe(model.site(k).name): ("site", k) for k in range(model.nsite) if model.site(k).name not in bodies}
    names = list(joints)
    mimics = [_mimic(model, paths[name]) for name in names]
    prismatic = [joints[name].attrib["type"] == "prismatic" for name in names]
    q = _configurations(names, prismatic, mimics, np.random.default_rng(seed))
    request = {
        "file": str(urdf), "frames": list(frames), "joints": names, "q": q.tolist(), "gravity": model.opt.gravity.tolist(),
        "free": bool((model.jnt_type == mujoco.mjtJoint.mjJNT_FREE).any()),
    }
    answers = {**_answers(model, [paths[name] for name in names], frames, q), "mimic": mimics}
    answers["range"] = [_range(names, answers["range"], k, follows) for k, follows in enumerate(mimics)]
    return Question(urdf.stem, request, answers)


Follows = tuple[str, float, float]
"""The joint that one follows, the multiplier [per unit of its q], and the offset."""


def _mimic(model: mujoco.MjModel, path: str) -> Follows | None:
    """What a joint follows, by the equalities of MJCF. Of a screw MuJoCo has the turn follow the slide: the other way round here."""
    own = model.joint(path).id
    for k in range(model.neq):
        if model.eq_type[k] != mujoco.mjtEq.mjEQ_JOINT:
            continue
        follower, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        offset, multiplier = (float(one) for one in model.eq_data[k][:2])
        screw = model.joint(leader).name.endswith(":slide")
        if screw and own == leader:
            return _safe(model.joint(follower).name), 1.0 / multiplier, 0.0
        if not screw and own == follower:
            return _safe(model.joint(leader).name), multiplier, offset
    return None


def _range(names: list[str], ranges: list[list[float] | None], k: int, follows: Follows | None) -> list[float] | None:
    """That of a joint; of a follower that MJCF leaves without one, as far as its leader's takes it."""
    if ranges[k] is not None or follows is None:
        return ranges[k]
    leader, multiplier, offset = follows
    ends = ranges[names.index(leader)]
    return None if ends is None else sorted(multiplier * end + offset for end in ends)


def _configurations(names: list[str], prismatic: list[bool], mimics: list[Follows | None], rng: np.random.Generator) -> Any:
    """Joints within half a turn or 0.1 m, those that mimic where their leader has them."""
    q = rng.uniform(-1.0, 1.0, (CONFIGURATIONS, len(names))) * [0.1 if slides else np.pi for slides in prismatic]
    waiting = {k: one for k, one in enumerate(mimics) if one is not None}
    while waiting:
        follower = next(k for k, (leader, _, _) in waiting.items() if names.index(leader) not in waiting)
        leader, multiplier, offset = waiting.pop(follower)
        q[:, follower] = multiplier * q[:, names.index(leader)] + offset
    return q


def _answers(model: mujoco.MjModel, paths: list[str], frames: dict[str, tuple[str, int]], q: Any) -> dict[str, Any]:
    data = mujoco.MjData(model)
    dofs = [model.joint(path).dofadr[0] for path in paths]
    poses, matrices, torques, centres = [], [], [], []
    for values in q:
        mujoco.mj_resetData(model, data)
        for path, value in zip(paths, values, strict=True):
            data.joint(path).qpos = value
        if model.nq and model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[:7] = (0, 0, 0, 1, 0, 0, 0)
        mujoco.mj_forward(model, data)
        poses.append([_pose(data, *frame).tolist() for frame in frames.values()])
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        full -= np.diag(model.dof_armature)  # URDF has none
        matrices.append(full[np.ix_(dofs, dofs)].tolist())
        torques.append(data.qfrc_bias[dofs].tolist())
        centres.append(data.subtree_com[0].tolist())
    return {
        "frames": poses, "mass": float(model.body_mass.sum()), "mass_matrix": matrices, "torque": torques, "centre": centres,
        "range": [model.joint(path).range.tolist() if model.joint(path).limited[0] else None for path in paths],
    }


def _pose(data: mujoco.MjData, kind: str, index: int) -> Any:
    matrix = np.eye(4)
    position, rotation = (data.xpos, data.xmat) if kind == "body" else (data.site_xpos, data.site_xmat)
    matrix[:3, :3], matrix[:3, 3] = rotation[index].reshape(3, 3), position[index]
    return matrix


def _safe(path: str) -> str:
    """A name of MJCF as URDF has it."""
    return path.replace("/", "_").replace(":slide", "_slide")


def _of_link(name: str, links: set[str]) -> str:
    return f"{name}_frame" if f"{name}_frame" in links else name
