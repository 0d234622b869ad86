"""Simulate an episode of a robot: set the initial state of the robot, apply actions, switch between modes, and compute rewards."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from thingc.batch.gym.drive_effects import DriveEffects
from thingc.batch.gym.env_options import EnvRules
from thingc.batch.gym.rewards import Array, StepInfo
from thingc.batch.results import FamilyError, require_known
from thingc.driver.testing.settle_simulation import BAD
from thingc.targets.mjcf.drives import start_delays

if TYPE_CHECKING:
    from thingc.modes import Modes


def known_options(options: Mapping[str, Any] | None, known: Sequence[str]) -> dict[str, Any]:
    """Check the options that were passed to `reset`, and return them as a dict. Raises `FamilyError` for an unknown option."""
    if options is not None and not isinstance(options, Mapping):
        raise FamilyError(f"expected `options` to be a mapping from names to values, found `{options}`")
    options = dict(options or {})
    for name in options:
        require_known(name, known, f"`reset` has no option `{name}`", what="options")
    return options


def as_actions(actions: Any, shape: tuple[int, ...] | None) -> Array:
    """Convert actions to a numpy array of floats. Raises `FamilyError` if the actions are not numbers or do not have the given shape."""
    try:
        numbers = np.asarray(actions, np.float64)
    except (TypeError, ValueError):
        raise FamilyError(f"expected actions of numbers, found `{actions}`") from None
    if numbers.shape != shape:
        raise FamilyError(f"expected actions of shape {shape}, found {numbers.shape}")
    return numbers


class ModeSimulation:
    """The MuJoCo model of a robot in the mode `name`.

    For each control of the model, `controls` contains its index in an action. `spans` contains the lower and the upper bounds of the
    controls. `effects` simulates the model.
    """

    def __init__(self, name: str, model: mujoco.MjModel, controls: Any, *, undelayed: bool = False) -> None:
        self.name = name
        self.model = model
        self.controls = controls
        self.spans = spans_of(model, np)
        self.effects = DriveEffects(model, undelayed=undelayed)


class Episode:
    """An episode of one robot. `simulations` and `states` contain the simulation and the MuJoCo data for each mode.

    `robot` switches between the modes.

    To start an episode, call the method `begin`. For each action, then call the methods `ask`, `run` and `judge`. The method `run` executes
    the simulation. Several episodes can run in parallel threads. `variant` is the variant that the episode simulates.
    """

    def __init__(
        self, simulations: Sequence[ModeSimulation], states: Sequence[mujoco.MjData], variant: Any, rules: EnvRules,
        robot: Modes | None = None,
    ) -> None:
        self.simulations = simulations
        self.states = states
        self.robot = robot
        self.variant = variant
        self.mode = 0
        self.steps = 0
        self.unstable = False
        self.refused: str | None = None
        self.start: Array = np.zeros(0)
        self.action: Array = np.zeros(0)
        self._rules = rules
        self._delayed: deque[Array] = deque(maxlen=1)
        self._source = np.random.default_rng(0)
        self._before: Array = np.zeros(0)
        self._started = 0.0

    @property
    def model(self) -> mujoco.MjModel:
        """The MuJoCo model of the current mode."""
        return self.simulations[self.mode].model

    @property
    def data(self) -> mujoco.MjData:
        """The MuJoCo data of the current mode."""
        return self.states[self.mode]

    def begin(self, source: np.random.Generator, name: str, size: int = 0) -> None:
        """Start the episode in the first mode: set the initial state, and add random noise to it.

        `source` is the random generator for the noise. `name` is the name of the variant, which is used in error messages. `size` is the
        number of elements of an action. Raises `UnknownVariant` if the initial pose does not exist.
        """
        for number, (simulation, data) in enumerate(zip(self.simulations, self.states, strict=True)):
            _reset(simulation.model, data, self._rules.pose if number == 0 else None, name)
        self.mode = self.steps = 0
        self.refused, self._source, self.action = None, source, np.zeros(size)
        if self._rules.noise:
            away = source.uniform(-self._rules.noise, self._rules.noise, self.model.nv)
            mujoco.mj_integratePos(self.model, self.data.qpos, away, 1.0)
        mujoco.mj_forward(self.model, self.data)
        self.start = np.array(self.data.qpos)
        first, last = self._rules.delays
        self._delayed = deque(maxlen=1 + (first if first == last else int(source.integers(first, last + 1))))

    def ask(self, action: Array, mode: int = 0) -> None:
        """Set the action for the next call of `run`.

        If `mode` is not the current mode, switch to the mode `mode` first. `mode` is the index of a mode. The shape of `action` is (nu,),
        or longer. The interval [-1, 1] of an action is mapped to the range of each control, or to `action_offset` plus or minus
        `action_scale`. If the switch is refused, the attribute `refused` contains the reason. Raises `FamilyError` for NaN, because MuJoCo
        would replace NaN by 0.
        """
        if np.isnan(action).any():
            raise FamilyError(f"expected an action of numbers, found {action}")
        self.refused = self._switch(mode) if mode != self.mode else None
        self.action = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        self._delayed.append(self.action)
        if len(self._delayed) == self._delayed.maxlen:
            self._control(self._delayed[0])
        self._push()
        self._before, self._started = np.array(self.data.subtree_com[0]), self.data.time

    def _control(self, action: Array) -> None:
        """Compute the controls of the current mode from an action, and write the controls to the MuJoCo data."""
        own, rules = self.simulations[self.mode], self._rules
        low, high = own.spans
        if rules.action_scale is None:
            self.data.ctrl[:] = low + (action[own.controls] + 1.0) / 2.0 * (high - low)
            return
        scaled = action * np.asarray(rules.action_scale)
        offset = own.model.key_ctrl[0] if rules.action_offset is None and own.model.nkey else np.zeros(own.model.nu)
        if rules.action_offset is not None:
            offset = np.broadcast_to(np.asarray(rules.action_offset, np.float64), action.shape)[own.controls]
        self.data.ctrl[:] = np.clip(offset + scaled[own.controls], low, high)

    def _switch(self, mode: int) -> str | None:
        """Switch the robot to the mode with this index. Return None after a switch, or the reason if the switch is refused."""
        from thingc.modes import ModesError

        old, new, rules = self.simulations[self.mode], self.simulations[mode], self._rules
        if rules.may_switch is not None and not rules.may_switch(self.data, old.name, new.name):
            return f"`may_switch` does not allow a switch from `{old.name}` to `{new.name}`"
        assert self.robot is not None
        try:
            self.robot.switch((old.name, self.data), (new.name, self.states[mode]), on_motion=rules.on_motion)
        except ModesError as fault:
            return str(fault)
        mujoco.mj_forward(new.model, self.states[mode])
        self.mode = mode
        self.start = np.array(new.model.key_qpos[0] if new.model.nkey else new.model.qpos0)
        return None

    def _push(self) -> None:
        """If the option `push` requires a push for this action, apply a random horizontal force to a random body during the action."""
        if self._rules.push is None:
            return
        every, impulse = self._rules.push
        model, forces = self.model, self.data.xfrc_applied
        forces[:] = 0.0
        if self.steps % every == every - 1:
            angle = self._source.uniform(0.0, 2.0 * np.pi)
            body = self._source.choice(np.flatnonzero((model.body_mass > 0.0) & (model.body_mocapid < 0)))
            seconds = self._rules.frame_skip * model.opt.timestep
            forces[body, :3] = np.array([np.cos(angle), np.sin(angle), 0.0]) * impulse / seconds

    def run(self) -> None:
        """Simulate the robot for the duration of one action."""
        data, effects = self.data, self.simulations[self.mode].effects
        effects.step(data, self._rules.frame_skip, self._source)
        self.steps += 1
        self.unstable = any(data.warning[kind].number for kind in BAD)  # MuJoCo has reset a simulation with NaN or very large numbers
        if not self.unstable:
            effects.forward(data)

    def judge(self) -> tuple[float, bool, bool, Mapping[str, Any]]:
        """Return the reward of the last action, a flag for termination, a flag for truncation, and further information.

        An episode is terminated if the option `terminated` returns True, or if the simulation is unstable (reward 0). Raises `FamilyError`
        if the reward or the result of `terminated` is invalid.
        """
        infos: dict[str, Any] = {} if self.refused is None else {"refused": self.refused}
        if self.robot is not None:
            infos["mode"] = self.simulations[self.mode].name
        if self.unstable:
            return 0.0, True, False, {**infos, "unstable": True}
        done = StepInfo(
            model=self.model, data=self.data, variant=self.variant,
            action=self.action[: self.model.nu] if self.robot is None else self.action, before=self._before,
            after=np.array(self.data.subtree_com[0]), seconds=self.data.time - self._started, start=self.start,
            mode=self.simulations[self.mode].name, refused=self.refused,
        )
        ended = self._rules.terminated is not None and _flag(self._rules.terminated(done))
        return _number(self._rules.reward_function(done)), ended, self.steps >= self._rules.max_steps, infos


def _number(reward: Any) -> float:
    """Convert the return value of a reward function to a float. Raises `FamilyError` for NaN and other invalid values.

    Without this exception, training would continue with the invalid reward.
    """
    try:
        number = float(reward)
    except (TypeError, ValueError):
        number = math.nan
    if math.isnan(number):
        raise FamilyError(f"expected `reward` to return a number, found `{reward}`")
    return number


def _flag(ended: Any) -> bool:
    """Convert the return value of the function `terminated` to a boolean. Raises `FamilyError` for an array of several values."""
    try:
        return bool(ended)
    except (TypeError, ValueError):
        raise FamilyError(f"expected `terminated` to return True or False, found `{ended}`") from None


def _reset(model: mujoco.MjModel, data: mujoco.MjData, pose: str | None, name: str) -> None:
    if pose is None and not model.nkey:
        mujoco.mj_resetData(model, data)
    else:
        mujoco.mj_resetDataKeyframe(model, data, 0 if pose is None else _keyframe(model, pose, name))
    start_delays(model, data)


def _keyframe(model: mujoco.MjModel, pose: str, name: str) -> int:
    names = [model.key(k).name for k in range(model.nkey)]
    require_known(pose, names, f"variant `{name}` has no pose `{pose}`", what="poses")
    return names.index(pose)


def spans_of(model: Any, xp: Any) -> Any:
    """Return an array (2, nu) with the lower and the upper bounds of all controls of a model of MuJoCo or MJX.

    For a control without limits, the bounds are -1 and 1. `xp` is the module `numpy` or `jax.numpy`.
    """
    return xp.where(model.actuator_ctrllimited[:, None], model.actuator_ctrlrange, np.array([-1.0, 1.0])).T
