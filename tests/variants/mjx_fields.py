"""`python tests/variants/mjx_fields.py FIELDS.npz`: compare the fields of a batch in MJX under `jax.vmap` with MuJoCo models in place.
This script is not part of the tests. It needs `mujoco-mjx` and `jax`, and prints the differences."""

from __future__ import annotations

import dataclasses
import sys

import jax
import mujoco
import numpy as np
from mujoco import mjx

from thingc.batch import apply

STEPS = 50


def main(path: str) -> float:
    jax.config.update("jax_enable_x64", True)
    stored = np.load(path)
    count = len(stored["id"])
    own = {name: stored[name] for name in stored.files if name != "id"}
    model = mujoco.MjSpec.from_file(f"{path.removesuffix('.npz')}.mjz").compile()
    device_model = mjx.put_model(model)
    known = {field.name for field in dataclasses.fields(device_model)} | {"stat.meaninertia"}
    start, control = np.array(model.qpos0), np.full(model.nu, 0.2)

    def run(fields: dict[str, jax.Array]) -> jax.Array:
        variant = device_model.tree_replace(fields)
        data = mjx.make_data(model).replace(qpos=jax.numpy.asarray(start), ctrl=jax.numpy.asarray(control))
        return jax.lax.scan(lambda data, _: (mjx.step(variant, data), None), data, None, length=STEPS)[0].qpos

    found = np.asarray(jax.jit(jax.vmap(run))({name: jax.numpy.asarray(values) for name, values in own.items() if name in known}))
    worst = 0.0
    for index in range(count):
        apply(model, own, index)
        data = mujoco.MjData(model)
        data.qpos[:], data.ctrl[:] = start, control
        mujoco.mj_step(model, data, STEPS)
        worst = max(worst, float(np.abs(data.qpos - found[index]).max()))
    spread = float(np.ptp(found, axis=0).max())
    print(f"{count} variants, {STEPS} steps: at most {worst:.1e} apart; variants differ by up to {spread:.1e}")
    return worst


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]) > 1e-9)
