"""Create models of MuJoCo Warp that simulate a different robot of a family in each world (`pip install mujoco-warp`)."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import fields as fields_of
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.batch.mujoco_arrays.equality import owner_of
from thingc.batch.results import FamilyError
from thingc.batch.shared_model import apply

if TYPE_CHECKING:
    import mujoco

COMBINED = ("actuator_damping", "actuator_dampingpoly", "opt.impratio")
"""Names of fields that MuJoCo Warp combines with other fields when it converts a model."""
DAMPED = ("dof_damping", "dof_dampingpoly", "tendon_damping", "tendon_dampingpoly", "actuator_gear")
"""Names of fields that MuJoCo Warp combines with the damping of actuators, if any actuator has damping."""
IGNORED = ("key_", "dof_length")
"""Prefixes of the names of fields that affect only the start of a simulation, or the option `sleep`."""
ENABLING = ("tendon_", "actuator_", "opt.")
"""Prefixes of the names of fields. If the values in the model are 0, MuJoCo Warp can skip computations, in all worlds."""


def put_warp(model: mujoco.MjModel, fields: Mapping[str, Any]) -> Any:
    """Convert a MuJoCo model to a `mujoco_warp.Model`, in which each array in `fields` has one row per world.

    The keys of `fields` are names of fields of `MjModel`, and the shape of an array is (worlds, *shape of the field). Keyframes and fields
    that MuJoCo Warp does not use are not converted. Raises `FamilyError` for a field that must be equal in all worlds.
    """
    try:
        import mujoco_warp
    except ImportError as fault:  # pragma: no cover - reported with a help text
        raise ImportError("MuJoCo Warp is not installed: `pip install mujoco-warp`, with the version of `mujoco`") from fault
    import warp

    kinds: dict[str, Any] = {kind.name: kind.type for kind in fields_of(mujoco_warp.Model)}
    kinds |= {f"opt.{kind.name}": kind.type for kind in fields_of(kinds["opt"])}
    rows = {name: np.asarray(values) for name, values in fields.items() if getattr(kinds.get(name), "shape", ("",))[0] == "*"}
    damped = model.actuator_damping.any() or model.actuator_dampingpoly.any()
    shared = {*(kinds.keys() - rows.keys()), *COMBINED, *(DAMPED if damped else ())}
    for name in fields:
        if name in shared and not name.startswith(IGNORED):
            raise FamilyError(f"MuJoCo Warp uses the same `{name}` in all worlds", "create a model for each value of this field")
    base = copy.copy(model)
    apply(base, {name: np.abs(values).max(axis=0, keepdims=True) for name, values in rows.items() if name.startswith(ENABLING)}, 0)
    found = mujoco_warp.put_model(base, {name: len(values) for name, values in rows.items() if "." not in name})
    for name, values in rows.items():
        owner, field = owner_of(found, name)
        array = getattr(owner, field)
        setattr(owner, field, warp.array(values.reshape(len(values), *array.numpy().shape[1:]), dtype=array.dtype))
    return found
