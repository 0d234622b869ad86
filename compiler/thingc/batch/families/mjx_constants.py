"""Compute in JAX the fields of a model that MuJoCo's compiler derives from other fields, such as `body_invweight0`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src import math

MANY = 100
"""Maximum number of rotations for finding principal axes. Usually, 8 rotations are enough."""
EQUAL = 1e-9
"""Relative difference up to which two principal moments are treated as equal."""

Fields = dict[str, Any]
"""A mapping from names of model fields, such as `body_mass` or `stat.meaninertia`, to arrays."""


def bounds(kind: int, size: Any) -> tuple[Any, Any]:
    """Return the bounding sphere radius and the half sizes of the bounding box of a geom, as in `geom_rbound` and `geom_aabb`.

    `kind` is MuJoCo's type of the geom, and `size` is its size as in `geom_size`.
    """
    radius, half = size[0], size[1]
    match mujoco.mjtGeom(kind):
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return radius, jnp.stack([radius, radius, radius])
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return radius + half, jnp.stack([radius, radius, radius + half])
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return jnp.sqrt(radius * radius + half * half), jnp.stack([radius, radius, half])
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return jnp.max(size), size
        case _:
            return jnp.sqrt(jnp.sum(size * size)), size


def with_constants(model: mjx.Model, data: mjx.Data, ratios: Sequence[tuple[int, Any]], relaxed: Sequence[int]) -> Fields:
    """Compute the fields of a model that MuJoCo's function `mj_setConst` computes from other fields.

    `ratios` contains pairs of an actuator index and a damping ratio, from which the damping of the actuator is computed. `relaxed` contains
    the indices of tendons whose spring length is not specified.
    """
    places = jax.vmap(partial(_forward_positions, model, data))(jnp.stack([model.qpos0, model.qpos_spring] if relaxed else [model.qpos0]))
    composite = mjx.crb(model, jax.tree_util.tree_map(lambda leaf: leaf[0], places))
    inertia = jnp.diag(mjx.full_m(model, composite))
    placed = mjx.transmission(model, mjx.tendon_armature(model, composite))
    matrix = mjx.full_m(model, placed)
    fields: Fields = {"body_subtreemass": _subtree_sums(model) @ model.body_mass, "dof_M0": inertia, "tendon_length0": placed.ten_length}
    if model.nv:
        inverse = _invert(matrix)
        fields["stat.meaninertia"] = jnp.mean(jnp.diag(matrix))
        fields["body_invweight0"], fields["dof_invweight0"] = _inverse_weights(model, placed, inverse)
        fields["tendon_invweight0"] = jnp.einsum("ti,ij,tj->t", placed._impl.ten_J, inverse, placed._impl.ten_J)
        moments = placed._impl.actuator_moment
        fields["actuator_acc0"] = _lengths(moments @ inverse)
        if ratios:
            fields["actuator_biasprm"] = _apply_damping_ratios(model, jnp.einsum("ai,ij,aj->a", moments, inverse, moments), ratios)
    if model.ncam:
        fields |= _cameras(model, placed)
    if relaxed:
        chosen = np.array(relaxed)
        fields["tendon_lengthspring"] = model.tendon_lengthspring.at[chosen].set(places.ten_length[1, chosen, None])
    return fields


def _invert(matrix: Any) -> Any:
    """Return the inverse of a mass matrix. One step of iterative refinement removes most of the rounding errors of the factorization."""
    identity, exact = jnp.eye(len(matrix), dtype=matrix.dtype), partial(jnp.matmul, precision="highest")
    inverse = jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(matrix), True), identity)
    return inverse + exact(inverse, identity - exact(matrix, inverse))


def _forward_positions(model: mjx.Model, data: mjx.Data, qpos: Any) -> mjx.Data:
    """Return MJX data with the positions of all bodies and tendons at `qpos`.

    The bodies of held links are at the positions that the model specifies.
    """
    mocap_bodies = np.flatnonzero(model.body_mocapid >= 0)
    data = data.replace(qpos=qpos, mocap_pos=model.body_pos[mocap_bodies], mocap_quat=model.body_quat[mocap_bodies])
    return mjx.tendon(model, mjx.com_pos(model, mjx.kinematics(model, data)))


def _subtree_sums(model: mjx.Model) -> Any:
    """Return a matrix `(bodies, bodies)` that sums values of bodies over each subtree.

    The product of this matrix and the values of all bodies contains one sum for each subtree.
    """
    sums = np.eye(model.nbody)
    for body in range(model.nbody - 1, 0, -1):
        sums[model.body_parentid[body]] += sums[body]
    return sums


def _inverse_weights(model: mjx.Model, data: mjx.Data, inverse: Any) -> tuple[Any, Any]:
    """Return two arrays with MuJoCo's inverse weights, which are means of diagonal elements of the inverse inertia.

    The first array contains two values for each body, for translation and rotation. The second array contains one value for each degree of
    freedom.
    """
    moves = (_subtree_sums(model).T > 0)[:, model.dof_bodyid].astype(float)  # whether each degree of freedom moves each body
    turns, offsets = data.cdof[:, :3], data.xipos - data.subtree_com[model.body_rootid]
    shifts = data.cdof[:, 3:] + jnp.cross(turns[None], offsets[:, None])
    bodies = jnp.stack([
        jnp.einsum("bik,ij,bjk->b", jacobian, inverse, jacobian) / 3.0
        for jacobian in (shifts * moves[:, :, None], turns[None] * moves[:, :, None])
    ], axis=1)
    means = np.zeros((model.nv, model.nv))
    for joint, first in enumerate(model.jnt_dofadr):
        kind = mujoco.mjtJoint(model.jnt_type[joint])
        width = 3 if kind in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL) else 1
        count = 6 if kind == mujoco.mjtJoint.mjJNT_FREE else width
        for start in range(first, first + count, width):
            means[start : start + width, start : start + width] = 1.0 / width
    freedoms = means @ jnp.diag(inverse)
    slides = model.body_simple == 2  # for a body that only slides, MuJoCo uses the mass
    single = 1.0 / jnp.maximum(model.body_mass, mujoco.mjMINVAL)
    bodies = jnp.where(slides[:, None], jnp.stack([single, jnp.zeros_like(single)], axis=1), bodies)
    return bodies, jnp.where(slides[model.dof_bodyid], single[model.dof_bodyid], freedoms)


def _lengths(rows: Any) -> Any:
    """Return the Euclidean norm of each row of an array. The derivative of the norm of a zero row is defined as 0."""
    squares = jnp.sum(rows * rows, axis=1)
    return jnp.where(squares > 0.0, jnp.sqrt(jnp.where(squares > 0.0, squares, 1.0)), 0.0)


def _cameras(model: mjx.Model, data: mjx.Data) -> Fields:
    bodies = model.cam_bodyid
    offsets = jax.vmap(math.rotate)(model.cam_pos, data.xquat[bodies])
    targets = np.where(model.cam_targetbodyid >= 0, model.cam_targetbodyid, bodies)
    turned = jax.vmap(math.quat_mul)(data.xquat[bodies], model.cam_quat)
    return {
        "cam_pos0": offsets, "cam_poscom0": data.xpos[bodies] + offsets - data.subtree_com[targets],
        "cam_mat0": jax.vmap(math.quat_to_mat)(turned),
    }


def _apply_damping_ratios(model: mjx.Model, weights: Any, ratios: Sequence[tuple[int, Any]]) -> Any:
    """Return the field `actuator_biasprm` with the damping of actuators whose damping ratio is specified.

    The damping is computed from the damping ratio, and from the inverse inertia that the actuator moves.
    """
    bias = model.actuator_biasprm
    for actuator, ratio in ratios:
        bias = bias.at[actuator, 2].set(-2.0 * ratio * jnp.sqrt(model.actuator_gainprm[actuator, 0] / weights[actuator]))
    return bias


@jax.custom_jvp
def principal_axes(matrix: Any) -> tuple[Any, Any]:
    """Return the principal moments of an inertia matrix `(3, 3)` in descending order, and the quaternion of the principal axes.

    The moments are computed by Jacobi rotations. If two moments are equal, the axes are not differentiable with respect to a change that
    couples the two axes. In this case, the derivative of the axes is defined as 0.
    """
    tolerance = float(np.finfo(matrix.dtype).eps) * jnp.trace(matrix)
    rows, columns = jnp.array([0, 0, 1]), jnp.array([1, 2, 2])

    def rotate_by(quaternion: Any) -> Any:
        axes = math.quat_to_mat(quaternion)
        return axes.T @ matrix @ axes

    def turn_once(state: tuple[Any, Any]) -> tuple[Any, Any]:
        count, quaternion = state
        inertia = rotate_by(quaternion)
        choice = jnp.argmax(jnp.abs(inertia[rows, columns]))
        row, column = rows[choice], columns[choice]
        entry = inertia[row, column]
        tau = (inertia[column, column] - inertia[row, row]) / (2.0 * jnp.where(entry == 0.0, 1.0, entry))
        tangent = jnp.where(tau >= 0.0, 1.0, -1.0) / (jnp.abs(tau) + jnp.sqrt(1.0 + tau * tau))
        half = 0.5 * jnp.arctan(tangent) * jnp.where(choice == 1, 1.0, -1.0)
        turn = jnp.zeros_like(quaternion).at[3 - choice].set(jnp.sin(half)).at[0].set(jnp.cos(half))
        small = jnp.abs(entry) <= tolerance
        return jnp.where(small, MANY, count + 1), jnp.where(small, quaternion, math.normalize(math.quat_mul(quaternion, turn)))

    start = (0, jnp.array([1.0, 0.0, 0.0, 0.0], dtype=matrix.dtype))
    _, quaternion = jax.lax.while_loop(lambda state: state[0] < MANY, turn_once, start)
    moments = jnp.diag(rotate_by(quaternion))
    for first, axis in ((0, 3), (1, 1), (0, 3)):
        swaps, pair = moments[first] < moments[first + 1], jnp.array([first, first + 1])
        turn = jnp.zeros_like(quaternion).at[jnp.array([0, axis])].set(0.5 ** 0.5)
        quaternion = jnp.where(swaps, math.normalize(math.quat_mul(quaternion, turn)), quaternion)
        moments = jnp.where(swaps, moments.at[pair].set(moments[pair[::-1]]), moments)
    return moments, quaternion


@principal_axes.defjvp
def _principal_axes_jvp(primals: tuple[Any], tangents: tuple[Any]) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    moments, quaternion = principal_axes(*primals)
    axes = math.quat_to_mat(quaternion)
    change = axes.T @ tangents[0] @ axes

    def rate(i: int, j: int) -> Any:
        gap = moments[j] - moments[i]
        equal = jnp.abs(gap) <= EQUAL * moments[0]
        return change[i, j] * jnp.where(equal, 0.0, 1.0 / jnp.where(equal, 1.0, gap))

    spin = jnp.stack([jnp.zeros_like(moments[0]), rate(2, 1), rate(0, 2), rate(1, 0)])
    return (moments, quaternion), (jnp.diag(change), 0.5 * math.quat_mul(quaternion, spin))
