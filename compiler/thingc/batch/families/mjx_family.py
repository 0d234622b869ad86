"""Compute MJX models (MuJoCo in JAX) of a family of robots as a pure function of numbers in the document (`pip install thingc[jax]`)."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from thingc.batch.families.jax_function import as_array, jax_function
from thingc.batch.families.warp_model import put_warp
from thingc.batch.mujoco_arrays.entries import INERTIAL, NotAnArrayEntry, NumberPlaces, affect_constants
from thingc.batch.results import FamilyError

try:
    import jax
    import jax.numpy as jnp
    import mujoco
    from mujoco import mjx
    from mujoco.mjx._src import math
except ImportError as fault:  # pragma: no cover - reported with a help text
    raise ImportError("MJX models require MJX: `pip install thingc[jax]`") from fault

from thingc.batch.families.mjx_constants import Fields, bounds, principal_axes, with_constants

if TYPE_CHECKING:
    from thingc.batch.families.function import FamilyFunction
    from thingc.batch.families.mjspec_recompile import ModelTemplate
    from thingc.batch.families.models import ModelsOfMode

IGNORED = ("key_", "numeric_data", "stat.", "actuator_delay")
"""Prefixes of the names of fields that do not affect a simulation in MJX."""
OPTIONS = ("opt.timestep", "opt.gravity")
"""The names of options that can differ between MJX models. MJX fixes all other options when it converts a model."""
BLOCK = 1024
"""Number of rows that are computed at once. In larger batches, the CPU backend of jaxlib 0.10.2 can block forever on two cores."""
NEARBY = 1e-6
"""Relative change of a number at `start` for which the compiler must make the same decisions, at least in one direction."""
FRICTION = ("dof_frictionloss", "tendon_frictionloss")


class FamilyMjx:
    """A function from values of the numbers `names` to MJX models, in one mode and with fixed values of all other settings.

    `start` `(n,)` contains the values of the numbers in the document. `base` is the MJX model for `start`, and `mj_model` is the `MjModel`
    from which it was converted. `varied` contains the names of the fields that can differ between the MJX models. All other fields, such as
    keyframes, have the same values as in `base`. `drives_vary` is True if custom data or delays of drives depend on the numbers, and
    `start_varies` if the first keyframe does.
    """

    def __init__(self, models: ModelsOfMode, function: FamilyFunction, dtype: str, delays: bool) -> None:
        if dtype == "float32" and jax.config.jax_enable_x64:  # type: ignore[attr-defined]
            raise FamilyError("MJX uses 64-bit numbers if they are enabled in JAX", "omit `dtype`, or disable `jax_enable_x64`")
        if not function.names:
            raise FamilyError("expected at least one item in `names`", "for a single robot, use `mjx.put_model(family.model(settings))`")
        settings, parsed = function._item(function.start)
        self._places = [parsed.names.index(name) for name in function.names]
        plan, reason = models.template_at(parsed)
        if plan is not None and plan.exchange is not None:
            plan, reason = models.template_at(replace(parsed, values=self._next_values(parsed.values)))
        lost = [name for name in function.names if plan is None or plan.free.count(parsed.names.index(name)) == 0]
        if plan is None or lost:
            raise FamilyError(f"MJX cannot vary {', '.join(lost)}: {reason}", "set the value with `at`, or use `models`")
        self.names, self.start, self.units, self.bounds = function.names, function.start, function.units, function.bounds
        self._plan, self._values = plan, parsed.values
        variables = self._variables(parsed.values)
        places = [plan.free.index(at) for at in self._places]
        lost = [name for name, place in zip(self.names, places) if variables is None or not self._varies(variables, place)]
        if variables is None or lost:
            raise FamilyError(
                f"MJX cannot vary {', '.join(lost)}: nearby values change the structure of the model",
                "write another start value in the document, such as a value greater than 0, set the value with `at`, or use `models`",
            )
        by = places if plan.exchange is None else range(len(variables))
        self._start, self._run = variables, jax_function(plan.program, by, variables, dtype, "models")
        self.mj_model: mujoco.MjModel = next(iter(models.each([(settings, parsed)], share=False)))
        self._read_template(plan.template)
        self.base = self._put_base(models.mode, delays)
        self._data = mjx.make_data(self.mj_model)
        self._fields_of_row = jax.jit(self._fields)  # JAX traces the function once
        self._fields_of_rows = jax.jit(jax.vmap(self._fields_of_row))
        for name in self._writes:
            if not isinstance(attrgetter(name)(self.base), jax.Array) or (name.startswith("opt.") and name not in OPTIONS):
                raise self._fixed_error(f"MJX converts `{name}` to a constant")

    def __repr__(self) -> str:
        return f"FamilyMjx({', '.join(self.names)} -> {', '.join(self.varied)})"

    @cached_property
    def varied(self) -> tuple[str, ...]:
        """The names of the model fields that depend on the numbers."""
        return tuple(jax.eval_shape(self._fields_of_row, self._to_variables(self.start[None])[0][0])[0])

    def model(self, p: Any) -> tuple[mjx.Model, Any]:
        """Return the MJX model for the values `p` `(n,)` of the numbers, and a boolean that is True if these values are valid.

        This method is a pure function, which can be used with `jit`, `vmap` and `grad`. If the values are refused or require other
        decisions of the compiler than `start`, the boolean is False and the model is undefined. Raises `FamilyError` if parts depend on the
        numbers, because a pure function cannot build parts.
        """
        if self._plan.exchange is not None:
            raise FamilyError(f"a pure function cannot build the parts that depend on {', '.join(self.names)}", "use `batch`")
        fields, ok = self._fields_of_row(p)
        return self.base.tree_replace(fields), ok

    def batch(self, p: npt.ArrayLike) -> tuple[mjx.Model, mjx.Model, Any]:
        """Return one batched model with the MJX models for all rows of `p` `(k, n)`, which contain values of the numbers.

        Also return a model with the axes for `in_axes` of `jax.vmap`, and an array of flags `(k,)` that are True for valid rows. In the
        batched model, the fields in `varied` have a leading axis. All other fields are shared by all rows. Parts that depend on the numbers
        are built first.
        """
        rows = as_array(p, f"rows of {len(self.names)} numbers ({', '.join(self.names)})")
        if rows.ndim != 2 or rows.shape[1] != len(self.names):
            raise FamilyError(f"expected an array of shape (k, {len(self.names)}) for {', '.join(self.names)}, found {rows.shape}")
        rows, built = self._to_variables(rows)
        fields, ok = self._in_blocks(rows)
        axes = jax.tree_util.tree_map(lambda _: None, self.base)
        return self.base.tree_replace(fields), axes.tree_replace(dict.fromkeys(fields, 0)), ok & built

    def warp(self, p: npt.ArrayLike) -> tuple[Any, Any]:
        """Return a `mujoco_warp.Model` with one world for each row of `p` `(k, n)`, and flags `(k,)` that are True for valid rows.

        The arrays are those of the method `batch`. Raises `FamilyError` if MuJoCo Warp cannot simulate these rows with one model.
        """
        model, _, ok = self.batch(p)
        return put_warp(self.mj_model, {name: attrgetter(name)(model) for name in self.varied}), ok

    def put(self, model: mjx.Model, state: mujoco.MjData | mjx.Data) -> tuple[mjx.Model, mjx.Data]:
        """Return an MJX model and MJX data with the same state as an `MjData` or as other MJX data.

        In MJX, moving a mocap body does not move the children of this body. For this reason, the pose of a held base is also written to the
        returned model.
        """
        data = state if isinstance(state, mjx.Data) else mjx.put_data(self.mj_model, state)
        held = np.flatnonzero(self.mj_model.body_mocapid >= 0)
        if not len(held):
            return model, data
        return model.tree_replace({
            "body_pos": model.body_pos.at[..., held, :].set(data.mocap_pos),
            "body_quat": model.body_quat.at[..., held, :].set(data.mocap_quat),
        }), data

    # --- implementation -------------------------------------------------------------------------------------------------

    def _in_blocks(self, rows: Any) -> tuple[Fields, Any]:
        """Return the fields and flags of all rows, computed in blocks of equal size, so that JAX compiles only once."""
        if len(rows) <= BLOCK:
            return self._fields_of_rows(rows)  # type: ignore[no-any-return]
        padded = jnp.concatenate([rows, jnp.repeat(rows[-1:], -len(rows) % BLOCK, axis=0)])
        blocks = [self._fields_of_rows(block) for block in padded.reshape(-1, BLOCK, rows.shape[1])]
        return jax.tree_util.tree_map(lambda *own: jnp.concatenate(own)[: len(rows)], *blocks)  # type: ignore[no-any-return]

    def _to_variables(self, rows: Any) -> tuple[Any, Any]:
        """Replace the rows `(k, n)` of values by rows with all variables of the plan, if parts depend on the values.

        Also return flags `(k,)` that are False for rows whose parts cannot be built, or require another plan. Such rows get the variables
        for `start`.
        """
        if self._plan.exchange is None:
            return jnp.asarray(rows), True
        settings = np.tile(self._values, (len(rows), 1))
        settings[:, self._places] = rows
        self._plan.prepare(settings.tolist())
        rows = [self._variables(values) for values in settings.tolist()]
        return jnp.asarray([row or self._start for row in rows]), np.array([row is not None for row in rows])

    def _variables(self, values: Sequence[float]) -> tuple[float, ...] | None:
        """Return the values of the variables of the plan for the values of all settings, or None if the plan does not apply.

        A parameter that has its default value is omitted from the name of the part. The plan does not apply to this exact value, but to
        the next floating-point number, with the same part up to rounding errors.
        """
        for candidate in (values, self._next_values(values)):
            with suppress(ArithmeticError, ValueError):
                if variables := self._plan.to_variables(candidate):
                    return variables
        return None

    def _varies(self, variables: Sequence[float], place: int) -> bool:
        """Return whether the plan applies if a variable is slightly smaller or slightly greater."""
        step = NEARBY * (abs(variables[place]) or 1.0)
        for value in (variables[place] - step, variables[place] + step):
            with suppress(ArithmeticError, ValueError):
                if self._plan.program.run(*variables[:place], value, *variables[place + 1 :]) is not None:
                    return True
        return False

    def _next_values(self, values: Sequence[float]) -> tuple[float, ...]:
        """Replace the values of the numbers `names` by the next floating-point numbers."""
        return tuple(float(np.nextafter(value, np.inf)) if place in self._places else value for place, value in enumerate(values))

    def _read_template(self, template: ModelTemplate) -> None:
        """Find the elements of model fields that contain the numbers of the XML template."""
        model, root = self.mj_model, ElementTree.fromstring(template.slotted)
        named = {model.geom(geom).name for geom in range(model.ngeom)}
        for above in root.iter():
            for geom in [geom for geom in above.findall("geom") if geom.get("class") == "visual" and geom.get("name") not in named]:
                above.remove(geom)  # visual geometry, which this model omits
        if moving := [geom.get("name") for geom in root.iter("geom") if geom.get("mesh") in template.meshes]:
            raise FamilyError(
                f"MJX cannot vary the mesh of the geom `{moving[0]}` with {', '.join(self.names)}",
                "use a primitive such as `collision: box` for the component, or use `models`",
            )
        try:
            self._numbers = NumberPlaces(root, template.places, model, geometry=True)
        except NotAnArrayEntry as fault:
            raise self._fixed_error(f"MuJoCo uses `{fault.attribute}` at compile time") from None
        every = self._numbers.writes
        self._writes = {name: write for name, write in every.items() if not name.startswith(IGNORED)}
        self.start_varies = any(name.startswith("key_") and min(write.at) < getattr(model, name)[0].size for name, write in every.items())
        self.drives_vary = not every.keys().isdisjoint(("numeric_data", "actuator_delay"))
        self.ratios = [
            (model.actuator(actuator.get("name", "")).id, template.places.get(ratio), ratio)
            for actuator in root.iterfind("actuator/*") if (ratio := actuator.get("dampratio")) is not None
        ]
        self._recomputes = bool(self.ratios) or affect_constants(self._numbers.add_mass_fields(self._writes), model)
        self._sized = self._rows("geom_size")
        moved = sorted({*self._rows("geom_pos"), *self._rows("geom_quat")})
        self._meshes = np.array([geom for geom in moved if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH], dtype=int)

    def _rows(self, name: str) -> list[int]:
        """Return the indices of those rows of a field that contain an element that depends on a number."""
        write = self._writes.get(name)
        return [] if write is None else sorted(set((write.at // getattr(self.mj_model, name).shape[1]).tolist()))

    def _fixed_error(self, why: str) -> FamilyError:
        return FamilyError(f"MJX cannot vary a constant with {', '.join(self.names)}: {why}", "set the values with `at`, or use `models`")

    def _put_base(self, mode: str, delays: bool) -> mjx.Model:
        """Convert the MuJoCo model for `start` to an MJX model in which the fields that depend on numbers can be replaced."""
        model = copy.copy(self.mj_model)
        if not model.nv:
            raise FamilyError(f"MJX does not support mode `{mode}`, in which nothing moves", "choose another mode, or use `models`")
        if model.nhistory and not delays:
            raise FamilyError("MJX does not support the `delay` of drives", "use `at={\"joints.NAME.drive.delay\": 0}`")
        for name in FRICTION:
            if name in self._writes:  # MJX has constraints only for joints with friction in the model that it converts
                getattr(model, name)[self._writes[name].at] = 1.0
        bias = model.actuator_biasprm.copy()
        if "actuator_biasprm" in self._writes:
            bias.flat[self._writes["actuator_biasprm"].at] = 1.0
        limited = np.flatnonzero((bias[:, 2] != 0.0) & (model.actuator_forcelimited != 0))
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST and len(limited):
            raise FamilyError(
                f"MJX and MuJoCo apply the damping of `{model.actuator(limited[0]).name}` differently with `implicitfast`",
                "use `at={\"simulation.integrator\": \"euler\"}`, or remove the effort or the damping of the drive"
            )
        try:
            base = mjx.put_model(model)
            if model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC and not mjx.make_data(base)._impl.contact.dist.size:
                model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL  # MJX fails with elliptic cones if there are no contacts
                base = mjx.put_model(model)
        except NotImplementedError as fault:
            help = "open the family with `compat=\"mjx\"`, or choose another mode"
            if "ELLIPTIC" in str(fault):  # a contact without friction, which `compat` does not change
                help = "use `at={\"simulation.cone\": \"pyramidal\"}`"
            raise FamilyError(f"MJX does not support a feature of mode `{mode}`: {fault}", help) from None
        return base.tree_replace({name: jnp.asarray(getattr(self.mj_model, name)) for name in FRICTION if name in self._writes})

    def _field_in_xml(self, name: str) -> Any:
        """Return the values of a field of `base`.

        For geoms with meshes, return the poses in the XML instead. MuJoCo's compiler combines these poses with the poses of the meshes.
        """
        value = attrgetter(name)(self.base)
        if name not in ("geom_pos", "geom_quat") or not len(self._meshes):
            return value
        offsets, turns = self._mesh_poses()
        turned = jax.vmap(math.quat_mul)(self.base.geom_quat[self._meshes], jax.vmap(math.quat_inv)(turns))
        shifted = self.base.geom_pos[self._meshes] - jax.vmap(math.rotate)(offsets, turned)
        return value.at[self._meshes].set(turned if name == "geom_quat" else shifted)

    def _mesh_poses(self) -> tuple[Any, Any]:
        meshes = self.mj_model.geom_dataid[self._meshes]
        return jnp.asarray(self.mj_model.mesh_pos[meshes]), jnp.asarray(self.mj_model.mesh_quat[meshes])

    def _fields(self, p: Any) -> tuple[Fields, Any]:
        """Return the values of all fields that differ from `base`, and a boolean that is True if the values of the numbers are valid."""
        numbers, ok = self._run(p)
        fields: Fields = {}
        for name, write in self._writes.items():
            old = self._field_in_xml(name)
            fields[name] = old.reshape(-1).at[write.at].set(numbers[write.columns] * write.signs).reshape(old.shape)
        if len(self._numbers.bodies):
            table = jnp.concatenate([numbers, jnp.asarray(self._numbers.constants, dtype=numbers.dtype)])[self._numbers.inertials]
            moments, axes = jax.vmap(principal_axes)(table[:, np.array([[4, 7, 8], [7, 5, 9], [8, 9, 6]])])
            for name, values in zip(INERTIAL, (table[:, 0], table[:, 1:4], moments, axes)):
                fields[name] = getattr(self.base, name).at[self._numbers.bodies].set(values)
        self._shape(fields)
        model = self.base.tree_replace(fields)
        if self._recomputes:
            ratios = [(actuator, float(word) if column is None else numbers[column]) for actuator, column, word in self.ratios]
            fields |= with_constants(model, self._data, ratios, self._numbers.relaxed)
        return fields, ok & self._wraps_alike(model)

    def _shape(self, fields: Fields) -> None:
        """Add the bounding volumes of geoms whose size depends on numbers, and the poses of geoms with meshes, to `fields`."""
        if self._sized:
            radii, boxes = self.base.geom_rbound, self.base.geom_aabb
            for geom in self._sized:
                radius, half = bounds(int(self.mj_model.geom_type[geom]), fields["geom_size"][geom])
                radii, boxes = radii.at[geom].set(radius), boxes.at[geom, 3:].set(half)
            fields["geom_rbound"], fields["geom_aabb"] = radii, boxes
        if len(self._meshes):
            offsets, turns = self._mesh_poses()
            own = {name: fields.get(name, self._field_in_xml(name)) for name in ("geom_pos", "geom_quat")}
            turned = own["geom_quat"][self._meshes]
            fields["geom_pos"] = own["geom_pos"].at[self._meshes].add(jax.vmap(math.rotate)(offsets, turned))
            fields["geom_quat"] = own["geom_quat"].at[self._meshes].set(jax.vmap(math.quat_mul)(turned, turns))

    def _wraps_alike(self, model: mjx.Model) -> Any:
        """Return True if every tendon wraps around its geoms on the same side as in `base`.

        MJX determines the side of a tendon only when it converts a model.
        """
        wraps = np.flatnonzero(np.isin(self.mj_model.wrap_type, (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER)))
        geoms, sides = self.mj_model.wrap_objid[wraps], np.round(self.mj_model.wrap_prm[wraps]).astype(int)
        squares = jnp.sum((model.site_pos[sides] - model.geom_pos[geoms]) ** 2, axis=1)
        inside = (squares < model.geom_size[geoms, 0] ** 2) & (sides >= 0)
        return jnp.all(inside == self.base._impl.is_wrap_inside[: len(wraps)])
