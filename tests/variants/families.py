"""Batches for tests: pendulums (masses and lengths), boards (geometry), sliders on a floor (contacts), and arms with one or two joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from thingc.batch import run
from thingc.driver.environment import Options
from variants.robots import InThisProcess, workspace

SOME = """
    thingc: variants/1
    assembly: pendulum.yaml
    name: some
    parameters:
      length: [200 mm, 300 mm, 400 mm]
      bob: {from: 100 g, to: 400 g, count: 4}
    reach: {of: bob, from: top}
    keep: ["length * bob < 0.15 m*kg", "mass > 2.25 kg"]
"""

BOARDS = """
    thingc: variants/1
    assembly: stand.yaml
    name: boards
    parameters: {side: [40 mm, 50 mm, 60 mm]}
"""

SLIDER = """
    thingc: assembly/1
    name: slider
    parameters:
      load: {value: 1 kg, max: 9 kg}
      height: {value: 100 mm, max: 1 m}
      damping: {value: 0.5 N*s/m, max: 99 N*s/m}
      strength: {value: 30 N, max: 99 N}
      side: {value: 40 mm, min: 10 mm, max: 100 mm}
    materials:
      light: {density: 500 kg/m^3}
    defaults: {component: {collision: box}}
    components:
      plate: {part: plates:Square, params: {side: =side}}
      pole: {part: plates:Square}
      weight:
        frame: true
        mass: =load
        inertia: {ixx: 0.001 kg*m^2, iyy: 0.001 kg*m^2, izz: 0.001 kg*m^2}
        at: {in: pole.top, xyz: [0, 0, =height]}
    joints:
      slide:
        type: prismatic
        parent: plate.top
        child: pole.origin
        limit: {lower: 0, upper: 100 mm}
        dynamics: {damping: =damping}
        drive: {kind: position, kp: 200 N/m, effort: =strength}
    poses: {up: {slide: 50 mm}}
    modes:
      lying: {root: plate, base: free, at: {xyz: 0 0 60 mm}, pose: up}
"""

SLIDERS = """
    thingc: variants/1
    assembly: slider.yaml
    name: sliders
    sample: {method: sobol, count: 8, seed: 4, ranges: {load: [0.1 kg, 3 kg], height: [0, 200 mm], damping: [0.1 N*s/m, 9 N*s/m]}}
    parameters: {strength: [20 N, 40 N, 60 N]}
"""

ARM = """
    thingc: assembly/1
    name: arm
    components:
      foot: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
      chain: {assembly: one.yaml}
    joints:
      hip:
        type: revolute
        parent: foot.origin
        child: chain.in
        limit: {lower: -90 deg, upper: 90 deg}
        drive: {kind: position, kp: 5 N*m/rad, effort: 6 N*m}
    modes: {standing: {root: foot, base: fixed}}
"""

ONE = """
    thingc: assembly/1
    name: one
    components:
      rod: {frame: true, mass: 1 kg, com: 100 0 0 mm, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
    mounts: {in: rod.origin}
"""

TWO = """
    thingc: assembly/1
    name: two
    components:
      rod:
        frame: true
        mass: 1 kg
        com: 100 0 0 mm
        inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}
        mounts: {end: {xyz: 200 0 0 mm}}
      tip: {frame: true, mass: 200 g, inertia: {ixx: 0.001 kg*m^2, iyy: 0.001 kg*m^2, izz: 0.001 kg*m^2}}
    joints:
      elbow:
        type: revolute
        parent: rod.end
        child: tip.origin
        limit: {lower: -90 deg, upper: 90 deg}
        drive: {kind: position, kp: 5 N*m/rad, effort: 2 N*m}
    mounts: {in: rod.origin}
"""

ARMS = """
    thingc: variants/1
    assembly: arm.yaml
    name: arms
    choices: {components.chain.assembly: [one.yaml, two.yaml]}
"""


def documents(folder: Path) -> Path:
    """Create a workspace that contains all of them."""
    return workspace(folder, some=SOME, boards=BOARDS, slider=SLIDER, sliders=SLIDERS, arm=ARM, one=ONE, two=TWO, arms=ARMS)


def built(folder: Path, store: str, name: str, **options: Any) -> Path:
    """Build the batch with this name, and return its folder."""
    return Path(run(str(documents(folder) / f"{name}.yaml"), options=Options(store=store), executor=InThisProcess(), **options).folder)


def arrays(model: mujoco.MjModel) -> dict[str, bytes]:
    """Return all arrays of a model."""
    found = {name: getattr(model, name) for name in dir(model) if not name.startswith("_")}
    return {name: value.tobytes() for name, value in found.items() if isinstance(value, np.ndarray)}
