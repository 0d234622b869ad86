"""Declare MuJoCo Warp as a consumer of MJCF models. MuJoCo Warp reads all models that thingc writes.

Only raw attributes can set the options that MuJoCo Warp does not support (see `put_model` in its `io.py`).
"""

from __future__ import annotations

from collections.abc import Iterator

from thingc.model.robot.types import Robot
from thingc.targets.mjcf.compat.consumer import Consumer, Refusal, UnsupportedOptions, nothing_lost
from thingc.targets.xml_writer import Element

LACKS = UnsupportedOptions(solvers=("PGS",), enabled=("override", "fwdinv", "diagexact", "ipc"), disabled=("midphase", "autoreset"))


def _refuses(robot: Robot, root: Element) -> Iterator[Refusal]:
    yield from LACKS.refusals(root)


WARP = Consumer(name="warp", label="MuJoCo Warp", version="mujoco-warp 3.17.0", suit=nothing_lost, refuses=_refuses)
