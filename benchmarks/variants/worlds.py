"""Compare simulations in MuJoCo Warp and in MuJoCo: `python benchmarks/variants/worlds.py [--count N] [--steps N]`.

The first row contains N settings of the arm (`thingc.family(DOC).batched`). Each setting has one of sixteen pens and another mass. The
second row contains N settings of a crane with tendons (`thingc.family(DOC).mjx`), whose numbers JAX computes. MuJoCo Warp simulates all
settings at once on a GPU, or, if there is no GPU, on a CPU. Warp is imported from the environment that `make conformance` creates. MuJoCo
simulates one model per setting. All simulations start in the first keyframe, with every joint at 1 rad/s. The program prints the largest
difference of a joint position, and exits with 1 if a difference is more than 1e-5 rad. In its first run on a CPU, Warp needs some minutes
to compile its kernels.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import jax
import mujoco
import numpy as np

import thingc

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "benchmarks" / "conformance")]

from study import READERS  # noqa: E402

from families.crane import CRANE  # noqa: E402
from families.documents import WORKSPACE  # noqa: E402

BOUND = 1e-5
NAMES = ["length", "load", "skew", "stiff", "rubbing"]
LOW, HIGH = [0.2, 0.1, -0.002, 10.0, 0.0], [0.5, 0.9, 0.002, 50.0, 0.1]


def settings(index: int) -> dict[str, Any]:
    """Return settings with one of sixteen pens and a different mass for each index."""
    return {"pen_diameter": 0.008 + 0.0005 * (index % 16), "components.bus_board.mass": f"{5 + index} g"}


def start(model: mujoco.MjModel) -> mujoco.MjData:
    """Return the state in which a simulation starts."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qvel[:] = 1.0
    return data


def alone(models: Iterable[Any], steps: int) -> Any:
    """Simulate one model after the other in MuJoCo, and return the joint positions after every step (models, steps, coordinates)."""
    paths = []
    for model in models:
        data = start(model)
        path = []
        for _ in range(steps):
            mujoco.mj_step(model, data)
            path.append(data.qpos.copy())
        paths.append(path)
    return np.array(paths)


def together(model: Any, base: mujoco.MjModel, count: int, steps: int) -> Any:
    """Simulate all worlds of a model of MuJoCo Warp, and return their joint positions (worlds, steps, coordinates)."""
    import mujoco_warp

    data, path = mujoco_warp.put_data(base, start(base), nworld=count), []
    for _ in range(steps):
        mujoco_warp.step(model, data)
        path.append(data.qpos.numpy().copy())
    return np.array(path).transpose(1, 0, 2)


def import_warp() -> None:
    """Import MuJoCo Warp from the environment of `make conformance`. Raises `SystemExit` if MuJoCo Warp is not available."""
    folder = ROOT / "build" / "conformance"
    folder.mkdir(parents=True, exist_ok=True)
    (reader,) = (one for one in READERS if one.name == "warp")
    python = reader.environment(folder)
    if python is None:
        raise SystemExit(f"MuJoCo Warp is not available ({' '.join(reader.packages)})")
    sys.path += map(str, python.parents[1].glob("lib/python3*/site-packages"))  # all other packages are those of this environment
    import warp

    warp.config.log_level = warp.LOG_WARNING  # without a line for each kernel


def report(name: str, found: Any, expected: Any) -> bool:
    """Print the row of a robot, and return whether the results differ."""
    worst, spread = float(np.abs(found - expected).max()), float(np.ptp(expected[:, -1], axis=0).max())
    count, steps, _ = expected.shape
    print(f"{name}: {count} settings, {steps} steps: at most {worst:.1e} from MuJoCo (settings differ by up to {spread:.1e})", flush=True)
    return not worst <= BOUND


def main() -> int:
    """Simulate both robots in both programs, and compare the results. Return 1 if results differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=64, help="number of settings (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=100, help="number of steps of 2 ms (default: %(default)s)")
    parser.add_argument("--store", help="cache of built parts")
    arguments = parser.parse_args()
    count, steps = arguments.count, arguments.steps
    import_warp()
    many = [settings(index) for index in range(count)]
    with thingc.family(ROOT / "assemblies" / "arm.yaml", store=arguments.store, mode="bench") as family:
        (group,) = family.batched(many).groups
        differs = report("arm", together(group.warp(), group.model, count, steps), alone(family.models(many, share=True), steps))
    jax.config.update("jax_enable_x64", True)
    rows = np.random.default_rng(1).uniform(LOW, HIGH, (count, len(NAMES)))
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {**WORKSPACE, "crane.yaml": CRANE}.items():
            (Path(folder) / name).write_text(text)
        with thingc.family(Path(folder) / "crane.yaml", verify=0, mode="standing") as family:
            robots = family.mjx(NAMES)
            model, ok = robots.warp(rows)
            expected = alone(family.models(dict(zip(NAMES, row)) for row in rows.tolist()), steps)
            differs |= not ok.all() or report("crane", together(model, robots.mj_model, count, steps), expected)
    return differs


if __name__ == "__main__":
    sys.exit(main())
