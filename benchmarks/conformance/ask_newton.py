"""Read USD and URDF with Newton: `python ask_newton.py REQUESTS ANSWERS`. Newton computes in single precision.

Newton expresses the coordinates of a ball joint in the axes of the joint, whereas the request uses the axes of the child.
"""

from __future__ import annotations

import sys
from importlib.metadata import version

import newton
import numpy as np
import warp
from asking import frames_of_usd
from newton import JointTargetMode, JointType
from scipy.spatial.transform import Rotation

warp.config.quiet = True


def answer(asked):
    builder = newton.ModelBuilder()
    usd = asked["file"].endswith(".usda")
    if usd:
        builder.add_usd(asked["file"], skip_mesh_approximation=True)
    else:
        builder.add_urdf(asked["file"], floating=asked["free"])
    model = builder.finalize(device="cpu")
    bodies = {label.rpartition("/")[2]: k for k, label in enumerate(model.body_label)}
    joints = {label.rpartition("/")[2]: k for k, label in enumerate(model.joint_label)}
    places = frames_of_usd(asked["file"], asked["frames"]) if usd else {name: (name, np.eye(4)) for name in asked["frames"]}
    types, starts, dofs_at = model.joint_type.numpy(), model.joint_q_start.numpy(), model.joint_qd_start.numpy()
    mass, centres = model.body_mass.numpy().astype(float), model.body_com.numpy().astype(float)
    gravity = model.gravity.numpy()[0].astype(float) if usd else np.array(asked["gravity"])  # URDF does not specify gravity
    dofs = [int(dofs_at[joints[name]]) + axis for name, axis in zip(asked["joints"], asked["axes"])]
    turns = np.eye(model.joint_dof_count)
    axes = {}
    for k in joints.values():
        if types[k] == JointType.BALL:
            axes[k] = Rotation.from_quat(model.joint_X_c.numpy()[k][3:]).as_matrix()
            turns[dofs_at[k] : dofs_at[k] + 3, dofs_at[k] : dofs_at[k] + 3] = axes[k].T
    in_tree = [k for k in range(model.joint_count) if model.joint_articulation.numpy()[k] >= 0]
    inside = sum(int(dofs_at[k + 1] - dofs_at[k]) for k in in_tree)  # coordinates of loop joints come after the tree joints
    moved = turns[:inside, dofs]
    children = model.joint_child.numpy()[: model.joint_count]
    state = model.state()
    poses, matrices, torques, middles, boxes = [], [], [], [], []
    for values in asked["q"]:
        q = model.joint_q.numpy().copy()
        if asked["free"] and types[0] == JointType.FREE:
            q[:7] = (0, 0, 0, 0, 0, 0, 1)
        for k, (name, axis, value) in enumerate(zip(asked["joints"], asked["axes"], values)):
            joint = joints[name]
            if joint not in axes:
                q[starts[joint] + axis] = value
            elif axis == 0:
                turn = Rotation.from_euler("xyz", values[k : k + 3]).as_matrix()
                q[starts[joint] : starts[joint] + 4] = Rotation.from_matrix(axes[joint].T @ turn @ axes[joint]).as_quat()
        state.joint_q.assign(q)
        newton.eval_fk(model, state.joint_q, model.joint_qd, state)
        at = [matrix(one) for one in state.body_q.numpy().astype(float)]
        boxes = boxes or [box(model, at, name) for name in asked["meshes"] if usd]
        poses.append([(at[bodies[body]] @ inside).tolist() for body, inside in places.values()])
        points = [(pose @ [*centre, 1])[:3] for pose, centre in zip(at, centres)]
        middles.append((mass @ np.array(points) / mass.sum()).tolist())
        full = newton.eval_mass_matrix(model, state).numpy()[0].astype(float)[:inside, :inside]
        full -= np.diag(model.joint_armature.numpy()[:inside])  # the expected mass matrix does not include the armature
        matrices.append((moved.T @ full @ moved).tolist())
        jacobian = newton.eval_jacobian(model, state).numpy()[0].astype(float)
        pull = sum(mass[children[k]] * gravity @ jacobian[6 * row : 6 * row + 3, :inside] for row, k in enumerate(in_tree))
        torques.append((-pull @ moved).tolist())
    low, high = model.joint_limit_lower.numpy(), model.joint_limit_upper.numpy()
    driven, efforts = model.joint_target_mode.numpy(), model.joint_effort_limit.numpy()
    answers = {
        "frames": poses, "mass": float(mass.sum()), "mass_matrix": matrices, "torque": torques, "centre": middles,
        "range": [[float(low[dof]), float(high[dof])] for dof in dofs],
        "mimic": mimics(model, asked, joints),
    }
    if usd:
        answers["meshes"] = boxes
        answers["effort"] = [float(efforts[dof]) if driven[dof] != JointTargetMode.NONE else 0.0 for dof in dofs]
    return answers


def mimics(model, asked, joints):
    """Return the leader, the multiplier and the offset of each joint coordinate."""
    names = {k: name for name, k in joints.items()}
    leaders, numbers = model.joint_mimic_joint.numpy(), model.joint_mimic_coeffs.numpy().astype(float)
    found = {name: (names[leaders[k]], numbers[k][1], numbers[k][0]) for name, k in joints.items() if leaders[k] >= 0}
    return [found.get(name) for name in asked["joints"]]


def box(model, bodies, name):
    """Return the smallest and the largest corner of the bounding box of a mesh in the world. The mesh is given by its name."""
    found = [k for k, label in enumerate(model.shape_label) if f"{label.removesuffix('/mesh')}/".endswith(f"/{name}/")]
    if len(found) != 1:
        raise ValueError(f"{len(found)} shapes are called {name}")
    X_WS = bodies[model.shape_body.numpy()[found[0]]] @ matrix(model.shape_transform.numpy()[found[0]].astype(float))
    points = model.shape_source[found[0]].vertices * model.shape_scale.numpy()[found[0]] @ X_WS[:3, :3].T + X_WS[:3, 3]
    return [*points.min(axis=0).tolist(), *points.max(axis=0).tolist()]


def matrix(transform):
    """Convert a transform of Warp to a 4 x 4 matrix."""
    pose = np.eye(4)
    pose[:3, 3], pose[:3, :3] = transform[:3], Rotation.from_quat(transform[3:]).as_matrix()
    return pose


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("newton"), sys.argv)
