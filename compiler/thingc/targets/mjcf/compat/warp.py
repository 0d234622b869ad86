"""Declare MuJoCo Warp as a consumer of MJCF models. MuJoCo Warp reads all models that thingc writes.

Only raw attributes can set the options that MuJoCo Warp does not support (see `put_model` in its `io.py`).
"""

from __future__ import annotations

from thingc.targets.mjcf.compat.consumer import Consumer, UnsupportedOptions

UNSUPPORTED = UnsupportedOptions(solvers=("PGS",), enabled=("override", "fwdinv", "diagexact", "ipc"), disabled=("midphase", "autoreset"))

WARP = Consumer(name="warp", label="MuJoCo Warp", version="mujoco-warp 3.17.0", find_refusals=lambda _, root: UNSUPPORTED.refusals(root))
