"""Environments in MJX for robots of a family: pure JAX functions in which actions can switch modes (`pip install thingc[jax]`).

    from thingc.batch.gym.mjx_env import MjxEnv

    env = MjxEnv(family, ["load"], ["front_foot", "rear_foot"], reward=lambda step: step.velocity[0])
    models, axes, ok = env.batch(rows)
    states = jax.vmap(env.reset, in_axes=(axes, 0))(models, jax.random.split(jax.random.key(7), len(rows)))
    states = jax.jit(jax.vmap(env.step, in_axes=(axes, 0, 0, 0)))(models, states, actions, modes)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from thingc.batch.families.jax_function import as_array, as_vector
from thingc.batch.families.results import NoModel
from thingc.batch.gym.drive_effects import DriveEffects
from thingc.batch.gym.episode import spans_of
from thingc.batch.results import FamilyError
from thingc.batch.run_options import as_names, at_least, require_functions
from thingc.modes.frames import pose, quaternion_of, rotation_of
from thingc.modes.mjdata import inertia_rows, inertias_in, map_model
from thingc.modes.state import State
from thingc.modes.switching import change_root

try:
    import jax
    import jax.numpy as jnp
    from jax.custom_batching import custom_vmap
    from mujoco import mjx
    from mujoco.mjx._src.forward import _integrate_pos
except ImportError as fault:  # pragma: no cover - reported with a help text
    raise ImportError("environments in JAX require MJX: `pip install thingc[jax]`") from fault

from thingc.modes.jax import STEPS, enter

if TYPE_CHECKING:
    from thingc.batch.families.family import RobotFamily
    from thingc.batch.families.mjx_family import FamilyMjx
    from thingc.modes import Mode

OBSERVATION = "`observation` to return an array of numbers"
MOVING = ("body_pos", "body_quat", "jnt_pos", "jnt_axis", "site_pos", "site_quat", "qpos0")
"""Names of model fields that move links, joints and mounts. Mode switches treat these fields as constants."""
ENTERED = ("time", "qpos", "qvel", "mocap_pos", "mocap_quat", "qacc_warmstart")
"""Names of the fields of MJX data that a mode switch changes."""

INTEGRATORS = {mjx.IntegratorType.EULER: mjx.euler, mjx.IntegratorType.RK4: mjx.rungekutta4, mjx.IntegratorType.IMPLICITFAST: mjx.implicit}
"""The functions with which `mjx.step` integrates."""


class MjxState(NamedTuple):
    """The state of one robot in an `MjxEnv`.

    Attributes:
        data: The MJX data of each mode. Only the data of the current mode are valid.
        mode: The index of the current mode.
        steps: Number of actions since the start of the episode.
        observation: The observation after the last action.
        reward: The reward of the last action.
        terminated: True if the function `terminated` returned True or the simulation is unstable (reward 0).
        truncated: True if the episode has reached `max_steps` actions.
        refused: True if the mode switch that the last action requested was refused.
        commands: The past controls of delayed drives, with a row for each simulation step and a column for each actuator.
        key: The key of the noise of the drives.
    """

    data: tuple[mjx.Data, ...]
    mode: jax.Array
    steps: jax.Array
    observation: jax.Array
    reward: jax.Array
    terminated: jax.Array
    truncated: jax.Array
    refused: jax.Array
    commands: jax.Array
    key: jax.Array


class MjxStep(NamedTuple):
    """The argument of the functions that compute rewards, observations, and whether an episode ends.

    Attributes:
        data: The MJX data after the action.
        robot: The `State` of the robot after the action. Its arrays have the same shapes in every mode. If the robot has ball joints or
            free joints, or the mode has a planar or ball base, `robot` is None.
        mode: The index of the mode, which is a Python constant.
        action: The action in [-1, 1].
        velocity: The mean velocity (3,) of the centre of mass during the action [m/s].
        gravity: The direction (3,) of gravity in the axes of the root link of the first mode.
    """

    data: mjx.Data
    robot: Any
    mode: int
    action: jax.Array
    velocity: jax.Array
    gravity: jax.Array


class MjxEnv:
    """An environment in MJX that simulates robots of a family. The robots differ in the values of the numbers that `names` lists.

    The methods `reset` and `step` are pure functions for a single robot, which can be used with `jit`, `vmap` and `grad`. The method
    `batch` returns the models of many robots.

    Args:
        family: The family of robots.
        names: The numbers in the document in which robots differ. With several modes, these numbers cannot move links, joints or mounts.
        modes: The modes between which actions can switch (if empty: the mode of the family). Episodes start in the first mode, in its
            first keyframe.
        reward: A function of an `MjxStep`.
        terminated: A function of an `MjxStep` that returns True to end an episode.
        observation: A function of an `MjxStep` (default: `default_observation`).
        frame_skip: Number of simulation steps per action.
        max_steps: Number of actions per episode.
        noise: Maximum random change of each degree of freedom at the start [rad or m].
        on_motion: The behaviour if the new mode holds a link that moves, see `thingc.modes.jax.switch`.
        at: Further settings of the robots.
        floor: Whether models include the floor of the scene.
        dtype: `"float32"` if JAX does not use 64-bit numbers.

    Raises `FamilyError` for features that MJX or mode switches in JAX do not support, and `UnknownChoice` for an unknown mode.
    """

    def __init__(
        self, family: RobotFamily, names: Sequence[str] | str, modes: Sequence[str] | str, *, reward: Callable[[MjxStep], Any],
        terminated: Callable[[MjxStep], Any] | None = None, observation: Callable[[MjxStep], Any] | None = None, frame_skip: int = 5,
        max_steps: int = 1000, noise: float = 0.0, on_motion: Literal["drop", "impact"] = "impact", at: Mapping[str, Any] | None = None,
        floor: bool = True, dtype: str = "float64",
    ) -> None:
        at_least(1, frame_skip=frame_skip, max_steps=max_steps)
        at_least(0, whole=False, noise=noise)
        require_functions("an `MjxStep`", reward=reward, terminated=terminated, observation=observation)
        self.modes = as_names(modes=modes) or (family.mode,)
        robot = family.modes(at or {}, *self.modes)  # in this order, from which that of the joints follows, as in `make_env`
        if isinstance(robot, NoModel):
            raise FamilyError(robot.reason)
        self._worlds = tuple(
            _World(robot[mode], family.mjx(names, mode=mode, at=at, floor=floor, dtype=dtype, delays=True)) for mode in self.modes
        )
        self._delay = max(int(world.effects.counts.max(initial=0)) for world in self._worlds)
        options = {(world.family.mj_model.opt.timestep, world.family.mj_model.opt.integrator) for world in self._worlds}
        varies = len(options) > 1 or "opt.timestep" in self._worlds[0].family.varied
        if self._delay and (varies or any(kind == mjx.IntegratorType.RK4 for _, kind in options)):
            raise FamilyError("in MJX, drives with a `delay` require the same time step, and not `rk4` as integrator", "use `make_vec_env`")
        if self._worlds[0].family.start_varies:
            what = f"the first keyframe of mode `{self.modes[0]}` depends on {', '.join(self._worlds[0].family.names)}"
            raise FamilyError(what, "use `at` to fix these values, or use `make_vec_env`")
        if len(self.modes) > 1:
            for world in self._worlds:
                world.check_switches()
        self.actuators = tuple(dict.fromkeys(name for world in self._worlds for name in world.map.actuators))
        if observation is None and (unread := next((world.unread for world in self._worlds if world.unread), "")):
            raise FamilyError(f"the default observation does not support {unread}", "use `observation`")
        self._reward, self._terminated = reward, terminated
        self._observation = default_observation(len(self.modes)) if observation is None else observation
        self._frame_skip, self._max_steps, self._noise, self._on_motion = frame_skip, max_steps, noise, on_motion
        self._controls = [np.array([self.actuators.index(name) for name in world.map.actuators], dtype=int) for world in self._worlds]
        self._exists = np.array([[name in world.map.actuators for name in self.actuators] for world in self._worlds])

    @property
    def action_size(self) -> int:
        """The number of elements of an action. An action has one element for each actuator of any mode, in the order of `actuators`."""
        return len(self.actuators)

    def models(self, p: Any) -> tuple[tuple[mjx.Model, ...], Any]:
        """For values `p` `(n,)` of the numbers, return the MJX models of a robot in all modes, and a flag for valid values.

        This method is a pure function.
        """
        models, ok = zip(*(world.family.model(p) for world in self._worlds), strict=True)
        return models, jnp.all(jnp.stack(ok))

    def batch(self, p: npt.ArrayLike) -> tuple[Any, Any, jax.Array]:
        """Return batched MJX models of many robots, for rows `(k, n)` with values of the numbers.

        Also return the axes of these models for `in_axes` of `jax.vmap`, and an array of flags `(k,)` that are True for valid rows.
        """
        models, axes, ok = zip(*(world.family.batch(p) for world in self._worlds), strict=True)
        return models, axes, jnp.all(jnp.stack(ok), axis=0)

    def reset(self, models: Sequence[mjx.Model], key: jax.Array) -> MjxState:
        """Return the state of a robot at the start of an episode. `models` contains the MJX model of the robot in each mode."""
        data = [mjx.make_data(model).replace(ctrl=jnp.asarray(own.control)) for own, model in zip(self._worlds, models, strict=True)]
        commands = jnp.zeros((self._delay, self.action_size)).at[:, self._controls[0]].set(data[0].ctrl)
        first, model = self._worlds[0].family.mj_model, models[0]
        qpos, mocap = (first.key_qpos[0], (first.key_mpos[0], first.key_mquat[0])) if first.nkey else (first.qpos0, None)
        offsets = jax.random.uniform(key, (first.nv,), minval=-self._noise, maxval=self._noise)
        start = data[0].replace(qpos=_integrate_pos(model.jnt_type, jnp.asarray(qpos, offsets.dtype), offsets, jnp.asarray(1.0)))
        if mocap is not None and first.nmocap:
            start = start.replace(mocap_pos=jnp.asarray(mocap[0]).reshape(-1, 3), mocap_quat=jnp.asarray(mocap[1]).reshape(-1, 4))
        data[0] = mjx.forward(*self._worlds[0].family.put(model, start))
        nothing, false = jnp.zeros(()), jnp.zeros((), dtype=bool)
        step_info = self._step_info(0, models[0], data[0], jnp.zeros(self.action_size), data[0].subtree_com[0])
        zero = jnp.zeros((), dtype=int)
        observation, key = as_array(self._observation(step_info), OBSERVATION), jax.random.fold_in(key, 1)
        return MjxState(tuple(data), zero, zero, observation, nothing, false, false, false, commands, key)

    def step(self, models: Sequence[mjx.Model], state: MjxState, action: jax.Array, mode: Any = 0) -> MjxState:
        """Apply an action to a robot, and return its new state. `mode` is the index of the mode to which the robot switches first.

        The shape of `action` is `(action_size,)`. The interval [-1, 1] of an action is mapped to the range of each control. A switch is
        refused if there is no such mode, or if the robot is not where the new mode holds it. A new episode does not start automatically. To
        choose between `state` and the state of a new `reset`, use `jnp.where(state.terminated, ...)`. Raises `FamilyError` for an action of
        another shape, and for a mode that is not an integer.
        """
        action = jnp.clip(as_vector(action, self.action_size), -1.0, 1.0)
        mode = as_array(mode, "`mode` to be the index of a mode")
        if mode.shape != () or mode.dtype.kind not in "iu":
            raise FamilyError(f"expected `mode` to be the index of a mode, found {mode}")
        centre = jnp.stack([data.subtree_com[0] for data in state.data])[state.mode]
        data, current, refused = self._switch_mode(models, state, mode)
        results: Any = (state.observation, state.reward, state.terminated, state.commands)
        for number, (model, data_of_mode) in enumerate(zip(models, data, strict=True)):
            stepped = partial(self._step_mode, number, model, data_of_mode, action, centre, state)
            data[number], results = _update(current == number, stepped, (data_of_mode, results))
        steps, (observation, reward, ended, past) = state.steps + 1, results
        return MjxState(tuple(data), current, steps, observation, reward, ended, steps >= self._max_steps, refused, past, state.key)

    # --- implementation -------------------------------------------------------------------------------------------------

    def _switch_mode(self, models: Sequence[mjx.Model], state: MjxState, mode: Any) -> tuple[list[mjx.Data], Any, Any]:
        """Switch the robot to the mode with the index `mode`.

        Return the MJX data of all modes, the index of the current mode, and a flag that is True if the switch was refused.
        """
        data, refused = list(state.data), (mode < 0) | (mode >= len(self.modes))
        for number in range(len(self.modes) if len(self.modes) > 1 else 0):
            enters = (mode == number) & (state.mode != number)
            old = {name: getattr(data[number], name) for name in ENTERED}
            fields, refused = _update(enters, partial(self._enter_mode, number, models, state), (old, refused))
            data[number] = data[number].replace(**fields)
        return data, jnp.where(refused, state.mode, mode), refused

    def _enter_mode(self, number: int, models: Sequence[mjx.Model], state: MjxState) -> tuple[dict[str, jax.Array], jax.Array]:
        """Return the MJX data `ENTERED` of a mode after a switch to it from another mode, and whether the switch is refused."""
        new, model, data = self._worlds[number], models[number], state.data[number]
        others = [
            (old, old.read(model, own), own) for old, model, own in zip(self._worlds, models, state.data, strict=True) if old is not new
        ]
        place = jnp.where(state.mode > number, state.mode - 1, state.mode)  # in `others`

        def current(values: Iterable[Any]) -> Any:
            return jax.tree_util.tree_map(lambda *leaves: jnp.stack(leaves)[place], *values)

        moved = current(change_root(robot, old.mode, new.mode, jnp, steps=STEPS) for old, robot, _ in others)
        robot, _, _ = enter(moved, new.mode, self._on_motion, inertias=new.inertias(model))
        valid = jnp.isfinite(robot.base).all()
        started = current(old.accelerations(own.qacc_warmstart, new) for old, _, own in others)
        entered = new.write(robot, data).replace(time=current(own.time for _, _, own in others), qacc_warmstart=started)
        return {name: jnp.where(valid, getattr(entered, name), getattr(data, name)) for name in ENTERED}, ~valid

    def _step_mode(
        self, number: int, model: mjx.Model, data: mjx.Data, action: jax.Array, centre: jax.Array, state: MjxState,
    ) -> tuple[mjx.Data, tuple[Any, Any, Any, Any]]:
        """Simulate one action of a robot in a single mode. `state` is the state before the action.

        Return the MJX data, and a tuple of the observation, the reward, a flag that is True if the episode is terminated, and the past
        controls of all actuators.
        """
        world, columns = self._worlds[number], self._controls[number]
        low, high = spans_of(model, jnp)
        past = jnp.where(jnp.asarray(self._exists)[state.mode][columns], state.commands[:, columns], data.ctrl)
        model, data = world.family.put(model, data.replace(ctrl=low + (action[columns] + 1.0) / 2.0 * (high - low)))
        data, past = self._simulate(world.effects, model, data, past, jax.random.fold_in(state.key, state.steps))
        info = self._step_info(number, model, data, action, centre)
        unstable = ~jnp.isfinite(data.qpos).all()
        ended = unstable
        if self._terminated is not None:
            ended |= _convert_result(self._terminated(info), "`terminated` to return True or False", state.terminated)
        observation = _convert_result(self._observation(info), OBSERVATION, state.observation)
        reward = _convert_result(self._reward(info), "`reward` to return a number", state.reward)
        return data, (observation, jnp.where(unstable, 0.0, reward), ended, state.commands.at[:, columns].set(past))

    def _simulate(
        self, effects: DriveEffects, model: mjx.Model, data: mjx.Data, past: jax.Array, key: jax.Array,
    ) -> tuple[mjx.Data, jax.Array]:
        """Return MJX data after `frame_skip` simulation steps, with the results of `mjx.forward` for the final state.

        A step consists of `mjx.forward` and an integration. The final `mjx.forward` is an iteration without integration, so that JAX
        compiles `mjx.forward` only once. Also return the past controls `past` after these steps.
        """
        integrate, control = INTEGRATORS[model.opt.integrator], data.ctrl

        def iterate(carried: tuple[mjx.Data, jax.Array], step: jax.Array) -> tuple[tuple[mjx.Data, jax.Array], None]:
            own, past = carried
            sent, is_last = jnp.concatenate([past, control[None]]), step == self._frame_skip
            if effects.acts:
                noise = effects.noise * jax.random.normal(jax.random.fold_in(key, step), control.shape)
                acting = sent[len(past) - effects.counts, np.arange(len(control))] + jnp.where(is_last, 0.0, noise)
                placed = mjx.transmission(model, mjx.tendon(model, mjx.com_pos(model, mjx.kinematics(model, own))))
                speed = placed._impl.actuator_moment @ own.qvel
                own = own.replace(ctrl=effects.limit(model, placed.actuator_length, speed, acting, jnp))
            own = mjx.forward(model, own)
            return jax.lax.cond(is_last, lambda: (own, past), lambda: (integrate(model, own), sent[1:])), None

        (data, past), _ = jax.lax.scan(iterate, (data, past), jnp.arange(self._frame_skip + 1))
        return data.replace(ctrl=control), past

    def _step_info(self, number: int, model: mjx.Model, data: mjx.Data, action: jax.Array, centre: jax.Array) -> MjxStep:
        world, seconds = self._worlds[number], model.opt.timestep * self._frame_skip
        root = world.family.mj_model.body(self._worlds[0].mode.root_link).id
        down = data.xmat[root].T @ model.opt.gravity
        size = jnp.linalg.norm(model.opt.gravity)
        velocity = (data.subtree_com[0] - centre) / seconds
        robot = None if world.unread else world.read(model, data)
        return MjxStep(data, robot, number, action, velocity, down / jnp.where(size == 0.0, 1.0, size))


def default_observation(modes: int) -> Callable[[MjxStep], jax.Array]:
    """Return a function that computes the default observation from an `MjxStep`.

    The observation contains the positions and velocities of all joints, the direction of gravity, and a one-hot encoding of the mode.
    """
    return lambda step: jnp.concatenate([step.robot.q, step.robot.v, step.gravity, jnp.eye(modes)[step.mode]])


def _convert_result(value: Any, expected: str, last: jax.Array) -> jax.Array:
    """Convert a value that a function of the user has returned to an array with the shape and type of `last`, the value before the action.

    Raises `FamilyError` for a value of another shape or kind. `expected` describes the value in the message.
    """
    array = as_array(value, expected)
    if array.shape != last.shape or not np.can_cast(array.dtype, last.dtype, "same_kind"):
        raise FamilyError(f"expected {expected}, found {jax.typeof(array)}", f"return a value of type {jax.typeof(last)}")
    return array.astype(last.dtype)


class _World:
    """A mode of the robot, together with the MJX models for this mode.

    `unread` contains the features of the mode for which the state of the robot cannot be read from MJX data, or is empty.
    """

    def __init__(self, mode: Mode, family: FamilyMjx) -> None:
        self.mode = mode
        self.family = family
        self.map = map_model(mode, family.mj_model)
        self.control = family.mj_model.key_ctrl[0] if family.mj_model.nkey else np.zeros(family.mj_model.nu)
        self.effects = DriveEffects(family.mj_model, undelayed=True)  # MJX does not delay controls, so the environment does
        family.base = family.base.tree_replace({"opt.disableflags": mjx.DisableBit(family.mj_model.opt.disableflags)})
        if self.effects.acts and family.drives_vary:
            what = f"the deadband, noise, delay or torque-speed line of a drive depends on {', '.join(family.names)}"
            raise FamilyError(what, "use `at` to fix these values, or use `make_vec_env`")
        self.unread = "a planar or ball base" if mode.part is not None else (
            "ball joints or free joints" if any(joint.ball is not None for joint in mode.joints) else "")
        self._inertias = inertia_rows(mode, family.mj_model)
        self._root = family.mj_model.body(mode.root_link).id

    def check_switches(self) -> None:
        """Raise `FamilyError` if the mode has features that mode switches in MJX do not support."""
        mode, moving = self.mode, [name for name in MOVING if name in self.family.varied]
        if moving:
            raise FamilyError(
                f"switches between modes do not support a variable `{moving[0]}`, which depends on {', '.join(self.family.names)}",
                "use `at` to fix the numbers that move links, joints or mounts",
            )
        lacks = self.unread or ("mounts under `hold`" if mode.holds else "actuators with activations" if self.family.mj_model.na else "")
        if lacks:
            raise FamilyError(f"switches in MJX do not support {lacks} (mode `{mode.name}`)", "use `make_vec_env`")

    def read(self, model: mjx.Model, data: mjx.Data) -> State[jax.Array]:
        """Return the state of the robot in MJX data of this mode. The arrays of the state have the same shapes in every mode."""
        twist: Any = jnp.zeros(6)
        if self.mode.base == "free":
            at, moving = self.map.base
            position, quaternion, twist = data.qpos[at[:3]], data.qpos[at[3:]], data.qvel[moving]
        elif self.mode.base == "held":
            position, quaternion = data.mocap_pos[self.map.mocap], data.mocap_quat[self.map.mocap]
        else:
            position, quaternion = model.body_pos[self._root], model.body_quat[self._root]
        rows, positions, speeds = self.map.addresses.to_read
        q, v = (jnp.zeros(len(self.mode.coordinates)).at[rows].set(own) for own in (data.qpos[positions], data.qvel[speeds]))
        return State(pose(rotation_of(quaternion, jnp), position, jnp), twist, q, v)

    def write(self, robot: State[Any], data: mjx.Data) -> mjx.Data:
        """Return a copy of MJX data of this mode in which the robot has the state `robot`."""
        addresses = self.map.addresses
        rows, positions, speeds = addresses.to_write
        qpos, qvel = data.qpos.at[positions].set(addresses.ratio * robot.q[rows]), data.qvel.at[speeds].set(addresses.ratio * robot.v[rows])
        position, quaternion = robot.base[:3, 3], quaternion_of(robot.base[:3, :3], jnp)
        if self.mode.base == "free":
            at, moving = self.map.base
            qpos, qvel = qpos.at[at].set(jnp.concatenate([position, quaternion])), qvel.at[moving].set(robot.twist)
        elif self.mode.base == "held":
            data = data.replace(
                mocap_pos=data.mocap_pos.at[self.map.mocap].set(position), mocap_quat=data.mocap_quat.at[self.map.mocap].set(quaternion),
            )
        return data.replace(qpos=qpos, qvel=qvel)

    def inertias(self, model: mjx.Model) -> Any:
        """Return the inertias of all links in an MJX model of this mode."""
        return inertias_in(model, self._inertias, jnp)

    def accelerations(self, values: jax.Array, new: _World) -> jax.Array:
        """Convert the accelerations `qacc_warmstart` of this mode, with which MuJoCo's solver starts, to those of the mode `new`.

        The accelerations of the base are set to 0.
        """
        pairs = [(joint[1], new.map.joints[name][1]) for name, joint in self.map.joints.items() if name in new.map.joints]
        old_rows, new_rows = np.array(pairs, dtype=int).reshape(-1, 2).T
        return jnp.zeros(new.family.mj_model.nv, values.dtype).at[new_rows].set(values[old_rows])


@custom_vmap
def _is_any(condition: jax.Array) -> jax.Array:
    """Return whether a condition is true for at least one robot. Inside `vmap`, all robots of the batch are considered."""
    return condition


@_is_any.def_vmap
def _is_any_of(size: int, batched: Sequence[bool], conditions: jax.Array) -> tuple[jax.Array, bool]:
    return _is_any(conditions.any(axis=0)), False  # again for an outer `vmap`


def _update(condition: Any, compute: Callable[[], Any], old: Any) -> Any:
    """Return `compute()` if the condition is true, otherwise `old`.

    Unlike a condition for each robot, for which `vmap` computes both cases, nothing is computed if the condition is false for all robots.
    """
    return jax.lax.cond(_is_any(condition), lambda: jax.tree_util.tree_map(partial(jnp.where, condition), compute(), old), lambda: old)
