"""Compare simulations of arms in MuJoCo Warp and in MuJoCo: `python benchmarks/variants/worlds.py [--count N] [--steps N]`.

N settings of the arm become one model with arrays (`thingc.family(DOC).batched`). Each setting has one of sixteen pens and another mass.
MuJoCo Warp simulates all arms at once on a CPU, in the environment that `make conformance` creates. MuJoCo simulates one model per arm. All
simulations start in the first keyframe, with every joint at 1 rad/s. The program prints the largest difference of a joint position, and
exits with 1 if it is more than 1e-5 rad. In its first run, Warp needs some minutes to compile its kernels.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import thingc

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
MODE = "bench"
BOUND = 1e-5


def settings(index: int) -> dict[str, Any]:
    """Return settings with one of sixteen pens and a different mass for each index."""
    return {"pen_diameter": 0.008 + 0.0005 * (index % 16), "components.bus_board.mass": f"{5 + index} g"}


def alone(model: mujoco.MjModel, steps: int) -> Any:
    """Simulate one arm in MuJoCo, and return its joint positions after every step (steps, coordinates)."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qvel[:] = 1.0
    found = []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found)


def together(model: mujoco.MjModel, fields: Mapping[str, Any], count: int, steps: int) -> Any:
    """Simulate all arms in MuJoCo Warp, and return their joint positions (arms, steps, coordinates). Raises `SystemExit` if MuJoCo Warp is
    not available.
    """
    sys.path.insert(0, str(ROOT / "benchmarks" / "conformance"))
    from study import READERS

    folder = ROOT / "build" / "conformance"
    folder.mkdir(parents=True, exist_ok=True)
    (reader,) = (one for one in READERS if one.name == "warp")
    python = reader.environment(folder)
    if python is None:
        raise SystemExit(f"MuJoCo Warp is not available ({' '.join(reader.packages)})")
    with tempfile.TemporaryDirectory() as scratch:
        files = [str(Path(scratch) / name) for name in ("model.mjb", "fields.npz", "found.npy")]
        mujoco.mj_saveModel(model, files[0])
        np.savez(files[1], **fields)
        words = [str(python), str(HERE / "step_worlds.py"), *files, str(count), str(steps)]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)  # Warp prints a line for every kernel
        return np.load(files[2])


def main() -> int:
    """Simulate the arms in both programs, and compare the results. Return 1 if the results differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=64, help="number of arms (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=100, help="number of steps of 2 ms (default: %(default)s)")
    parser.add_argument("--store", help="cache of built parts")
    arguments = parser.parse_args()
    many = [settings(index) for index in range(arguments.count)]
    with thingc.family(ROOT / "assemblies" / "arm.yaml", store=arguments.store, mode=MODE) as family:
        batches = family.batched(many)
        own = np.array([alone(model, arguments.steps) for model in family.models(many, share=True)])
    (group,) = batches.groups
    found = together(group.model, group.fields, arguments.count, arguments.steps)
    worst = float(np.abs(found - own).max())
    spread = float(np.ptp(own[:, -1], axis=0).max())
    print(f"{arguments.count} arms, {group.model.nmesh} meshes, {arguments.steps} steps: no coordinate further than {worst:.1e} rad from "
          f"that of its own model (arms are up to {spread:.1e} rad apart)")
    return 0 if worst <= BOUND else 1


if __name__ == "__main__":
    sys.exit(main())
