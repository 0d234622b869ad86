"""Extract the fields of MJX models, so that models can be compared."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from operator import attrgetter

import jax
import mujoco
import numpy as np
from mujoco import mjx

UNUSED = ("key_", "meanmass", "meansize", "extent", "center")
"""Prefixes of the fields that MJX does not use."""


def leaves(model: mjx.Model) -> dict[str, np.ndarray]:
    """Return every array of an MJX model by name. Inertias are converted to matrices, because the order and the signs of principal axes are
    arbitrary.
    """
    found = {}
    for prefix, group in (("", model), ("opt.", model.opt), ("stat.", model.stat)):
        for field in dataclasses.fields(group):
            value = getattr(group, field.name)
            if isinstance(value, jax.Array | np.ndarray) and not field.name.startswith(UNUSED):
                found[prefix + field.name] = np.asarray(value)
    matrices = np.array([mujoco_matrix(quat) for quat in found.pop("body_iquat")])
    found["body_iquat"] = np.einsum("bij,bj,bkj->bik", matrices, found["body_inertia"], matrices)
    found["dof_hasfrictionloss"] = np.asarray(model._impl.dof_hasfrictionloss)
    return found


def mujoco_matrix(quat: np.ndarray) -> np.ndarray:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(quat, dtype=np.float64))
    return matrix.reshape(3, 3)


def one_of(model: mjx.Model, varied: Iterable[str], row: int) -> mjx.Model:
    """Return one model of a batch of MJX models."""
    return model.tree_replace({name: np.asarray(attrgetter(name)(model))[row, ...] for name in varied})
