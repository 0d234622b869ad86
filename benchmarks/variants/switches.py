"""Measure mode switches of MInchW and the arm; a part of `make gradients`.

Each row is a pair of modes. The motion of the new root link is either removed (`drop`) or stopped by an impact (`impact`). The column
`steps` is the time of `Modes.switch` between two `MjData` objects, in simulation steps of the old mode. The column `jax` is the speed of
`thingc.modes.jax` for many worlds at once, relative to calls of `Modes.switch` one after the other. With several thousand worlds, the
arrays of an impact exceed the caches of most processors, and the column becomes smaller. The column `error` is the largest difference
between the two results, relative to the largest number of the result or to 1. For modes with additional holds, the difference is also
divided by the condition number of the Jacobian of the held link, because rounding errors grow with this number in postures that are nearly
singular.

The last rows measure an environment in MJX (`MjxEnv`) whose actions switch between two modes of a small robot. These rows show the time of
a step, and the largest difference from the observations of the same environment in MuJoCo (`make_env`). The time is relative to the mean
time of two environments that have only one of the modes each, because a step of a free robot takes longer than a step of a held robot.

All times are CPU times. The program exits with 1 if a result exceeds its bound.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import jax
import mujoco
import numpy as np

import thingc
from thingc.batch.gym.family_env import make_env
from thingc.batch.gym.mjx_env import MjxEnv
from thingc.modes import Mode, Modes
from thingc.modes.frames import pose, rotation_of
from thingc.modes.jax import State, switch

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from families.documents import WORKSPACE  # noqa: E402
from families.mjx_env import MODES, TWO_FEET  # noqa: E402

PAIRS = {
    "assemblies/arm.yaml": [("drawing", "adrift"), ("adrift", "drawing")],
    "assemblies/minchw/minchw.yaml": [
        ("front_foot", "rear_foot"), ("front_foot", "crawl"), ("crawl", "rear_foot"), ("rear_foot", "bridge"),
    ],
}
LOADS = (0.1, 0.9)
SHARE, OBSERVED = 2.2, 1e-10
ERROR, RATIOS = 1e-13, {"drop": 50.0, "impact": 50.0}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1024, help="worlds (default: %(default)s)")
    count = parser.parse_args().count
    jax.config.update("jax_enable_x64", True)
    missed = report_switches({str(ROOT / document): pairs for document, pairs in PAIRS.items()}, count)
    missed += report_environment(1024)
    for one in missed:
        print(f"MISSED {one}")
    return bool(missed)


def report_switches(documents: Mapping[str, Sequence[tuple[str, str]]], count: int) -> list[str]:
    """Print the rows of pairs of modes of each document. Return the names of the rows that exceed their bounds."""
    missed = []
    print(f"{'':36} {'us':>6} {'steps':>6} {'jax us':>7} {'jax':>6} {'error':>8}")
    for document, pairs in documents.items():
        built = thingc.compile(document, modes=sorted({mode for pair in pairs for mode in pair})).modes
        robot = Modes.parse(next(iter(built.values())).files["modes.json"])
        for (old, new), on_motion in itertools.product(pairs, RATIOS):
            one, other = (mujoco.MjData(built[name].model()) for name in (old, new))
            if one.model.nkey:
                mujoco.mj_resetDataKeyframe(one.model, one, 0)
            one.qvel[:] = 0.1
            job = lambda: robot.switch((old, one), (new, other), on_motion=on_motion)  # noqa: B023, E731
            alone = seconds_of(job, 200)
            steps = alone / seconds_of(lambda: mujoco.mj_step(one.model, one), 1000)  # noqa: B023
            together, ratio, error = in_jax(robot, robot[old], robot[new], on_motion, count)
            name = f"{old} -> {new}, {on_motion}"
            print(f"{name:36} {1e6 * alone:6.0f} {steps:6.1f} {1e6 * together:7.2f} {ratio:5.0f}x {error:8.1e}", flush=True)
            if ratio < RATIOS[on_motion] or error > ERROR:
                missed.append(name)
    for on_motion, bound in RATIOS.items():
        print(f"{f'must, {on_motion}':36} {'':6} {'':6} {'':7} {bound:5.0f}x {ERROR:8.0e}", flush=True)
    return missed


def report_environment(count: int) -> list[str]:
    """Print the cost and the error of an environment with two modes in MJX. Return a description of each result that exceeds its bound."""
    actions, still, half, error = np.zeros((count, 1)), np.zeros(count, int), np.arange(count) % 2, 0.0
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {**WORKSPACE, "feet.yaml": TWO_FEET}.items():
            (Path(folder) / name).write_text(text)
        with thingc.family(Path(folder) / "feet.yaml", verify=0) as family:
            one = {mode: partial(begun[0], begun[1], actions, still) for mode in MODES for begun in [begin(family, [mode], count)]}
            step, states = begin(family, MODES, count)
            mixed = step(states, actions, half)
            both = {
                "all robots in the first mode": partial(step, states, actions, still),
                "robots in both modes": partial(step, mixed, actions, half), "all robots switch": partial(step, mixed, actions, 1 - half),
            }
            seconds = seconds_of_each({**one, **both})
            world = make_env(family, settings=[{"load": LOADS[0]}], modes=MODES, floor=False)
            world.reset(seed=1)
            for number in range(20):
                actions, mode = np.full((count, 1), 0.1 * np.sin(number)), number // 5 % 2
                states = step(states, actions, np.full(count, mode))
                seen = world.step({"mode": mode, "joints": actions[0]})[0]
                error = max(error, float(np.abs(states.observation[0] - seen).max()))
    mean = sum(seconds[mode] for mode in MODES) / len(MODES)
    print(f"environment of one mode in MJX: {', '.join(f'{1e6 * seconds[mode] / count:.1f}' for mode in MODES)} us per robot")
    for name in both:
        print(f"environment of two modes in MJX, {name}: {seconds[name] / mean:.2f} of one mode (must {SHARE:.1f})", flush=True)
    print(f"environment of two modes in MJX: error {error:.1e} (must {OBSERVED:.0e})", flush=True)
    return [*(name for name in both if seconds[name] > SHARE * mean), *(["error"] if error > OBSERVED else [])]


def begin(family: thingc.RobotFamily, modes: Sequence[str], count: int) -> tuple[Callable[..., Any], Any]:
    """Return the function that steps many robots in some modes, and their states at the start of an episode."""
    env = MjxEnv(family, ["load"], modes, reward=lambda step: step.velocity[0], floor=False)
    models, axes, _ = env.batch(np.linspace(*LOADS, count)[:, None])
    states = jax.jit(jax.vmap(env.reset, in_axes=(axes, 0)))(models, jax.random.split(jax.random.key(1), count))
    return partial(jax.jit(jax.vmap(env.step, in_axes=(axes, 0, 0, 0))), models), states


def seconds_of_each(jobs: Mapping[str, Callable[[], Any]]) -> dict[str, float]:
    """Return the least time of each job of JAX in 20 rounds, so that other programs slow all jobs down alike."""
    found: dict[str, list[float]] = {name: [] for name in jobs}
    for job in jobs.values():
        settled(job)
    for _ in range(20):
        for name, job in jobs.items():
            before = time.process_time()
            settled(job)
            found[name].append(time.process_time() - before)
    return {name: min(times) for name, times in found.items()}


def settled(job: Callable[[], Any]) -> None:
    """Run a JAX function, and wait for its result."""
    jax.block_until_ready(job())


def seconds_of(job: Callable[[], Any], times: int) -> float:
    """Return the shortest CPU time [s] per call, in seven series of calls."""
    found = []
    job()
    for _ in range(7):
        before = time.process_time()
        for _ in range(times):
            job()
        found.append((time.process_time() - before) / times)
    return min(found)


def in_jax(robot: Modes, old: Mode, new: Mode, on_motion: Any, count: int) -> tuple[float, float, float]:
    """Return the time [s] per world in JAX, the speed relative to numpy, and the largest difference between the results."""
    rng, joints = np.random.default_rng(1), len(old.coordinates)
    poses = np.array([pose(rotation_of(rng.normal(size=4)), rng.normal(size=3)) for _ in range(count)])
    twists = rng.normal(size=(count, 6)) * (old.base == "free")
    given = State(poses, twists, rng.uniform(-1, 1, (count, joints)), rng.normal(size=(count, joints)))
    worlds = jax.device_put(given)
    run = jax.jit(jax.vmap(lambda state: switch(state, old, new, on_motion)))
    together = seconds_of(lambda: jax.block_until_ready(run(worlds)), 1) / count
    found, removed, impulses = run(worlds)
    states = [old.robot_state(State(*(values[k] for values in given))) for k in range(50)]
    alone = seconds_of(lambda: [robot.switch(state, new.name, on_motion=on_motion) for state in states], 1) / len(states)
    error = 0.0
    for k, state in enumerate(states):
        result = robot.switch(state, new.name, on_motion=on_motion)
        expected = (*new.arrays(result.state), result.removed, result.impulse)
        jacobians = new.jacobians(result.state)
        condition = max([1.0, *(float(np.linalg.cond(jacobians[hold.link][:, 6:])) for hold in new.holds)])
        for value, exact in zip((*(values[k] for values in found), removed[k], impulses[k]), expected, strict=True):
            error = max(error, float(np.abs(value - exact).max() / max(1.0, np.abs(exact).max()) / condition))
    return together, alone / together, error


if __name__ == "__main__":
    sys.exit(main())
