"""A robot without CAD, in four documents: all masses are given explicitly."""

from __future__ import annotations

import textwrap
from pathlib import Path

ROBOT = """\
thingc: assembly/1
name: robot
parameters:
  reach: {value: 120 mm, min: 50 mm}
  count: 2
materials: [materials.yaml]
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}, mounts: {top: {}}}
  finger:
    repeat: {count: =count, as: i}
    assembly: finger.yaml
    parameters: {mass: =(i + 1) * 50 g}
  palm: {assembly: palm.yaml}
joints:
  lift: {type: fixed, parent: base.top, child: palm.seat}
  yaw:
    repeat: {count: =count, as: i}
    type: revolute
    parent: base.top
    child: finger_$i.seat
    limit: {lower: -90 deg, upper: 120 deg}
poses:
  out: {yaw_0: 30 deg}
modes:
  bench: {root: base, base: fixed, pose: out}
  held: {root: finger_1.seat, base: fixed}
"""
FINGER = """\
thingc: assembly/1
name: finger
parameters:
  mass: 50 g
components:
  bone: {frame: true, mass: =mass, inertia: {ixx: 1e-5 kg*m^2, iyy: 1e-5 kg*m^2, izz: 1e-5 kg*m^2}, mounts: {seat: {}}}
  tip: {frame: true, mass: 10 g, inertia: {ixx: 1e-6 kg*m^2, iyy: 1e-6 kg*m^2, izz: 1e-6 kg*m^2}, at: {in: bone.seat, xyz: [0, 0, 40 mm]}}
mounts: {seat: bone.seat}
"""
PALM = """\
thingc: assembly/1
name: palm
components:
  plate: {frame: true, mounts: {seat: {}}}
mounts: {seat: plate.seat}
"""
MATERIALS = """\
thingc: materials/1
materials:
  oak: {density: 700 kg/m^3}
"""
DOCUMENTS = {"robot.yaml": ROBOT, "finger.yaml": FINGER, "palm.yaml": PALM, "materials.yaml": MATERIALS}


def write(folder: Path) -> Path:
    """Write the documents and return the path of the robot document."""
    for name, text in DOCUMENTS.items():
        (folder / name).write_text(textwrap.dedent(text))
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    return folder / "robot.yaml"
