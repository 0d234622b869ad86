"""A workspace without CAD that uses names in every possible way: nested, repeated, by patterns, in tests, settings and rules."""

from __future__ import annotations

from pathlib import Path

WALKER = """\
thingc: assembly/1
name: walker

parameters:
  width: {value: 100 mm, min: 50 mm, max: 200 mm}   # between the hips
  half: "=width / 2"
  stance: 20 deg

materials: [paints.yaml]
defaults: {component: {material: red}}

components:
  body:
    frame: true
    mass: 1 kg
    inertia: &round {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}
    mounts:
      hip_0: {xyz: [=half, 0, 0], rpy: 90 0 0 deg}
      hip_1: {xyz: [=-half, 0, 0], rpy: 90 0 0 deg}
      "top": {xyz: 0 0 20 mm}
      mast: {xyz: 0 0 40 mm, rpy: 90 0 0 deg}
  leg:
    repeat: {count: 2, as: k}
    assembly: leg.yaml
    parameters: {length: "=max(width, k * 1 mm)"}
  toe:
    repeat: {count: 2}
    frame: true
    mass: 5 g
    at: {in: "leg_${i}.sole", xyz: [=i * 1 mm, 0, 0]}
  head: {assembly: head.toml, attach: {neck: body.top}}
  badge: {frame: true, mass: 1 g, material: 'blue', attach: {mount: origin, to: head.box.face}}
  tail: {frame: true, mass: 20 g, inertia: *round, mounts: {root_end: {rpy: -90 0 0 deg}}}
  flag: {frame: true, mass: 20 g, inertia: *round}

joints:
  hip:
    repeat: {count: 2, as: n}
    type: revolute
    parent: body.hip_$n
    child: leg_$n.socket
    limit: {lower: -60 deg, upper: 60 deg, effort: 3 N*m}
    drive: {kind: position, kp: 5 N*m/rad}
  wag:
    type: revolute
    parent: body.mast
    child: tail.root_end
    limit: {lower: -60 deg, upper: 60 deg}
    mimic: {joint: hip_0, multiplier: -1}
  sway: {type: universal, parent: tail.origin, child: flag.origin, limit: [{lower: -9 deg, upper: 9 deg}, {lower: -9 deg, upper: 9 deg}]}
transmissions: {swing: {actuator: {kind: motor, effort: 1 N*m}, joint: "sway[0]", ratio: 3}}
tendons: {stay: {joints: {hip_0: 10 mm/rad, "sway[0]": 5 mm/rad}, dynamics: {stiffness: 9 N/m}, drive: {kind: motor, effort: 5 N}}}
links: {trunk: body}
mounts: {crown: body.top, nose: head.face}

poses:
  rest: {hip_0: =stance, hip_1: =stance, leg_*: bent, head: up}
  stretch: {"leg_*.knee": 30 deg, "hip_[01]": 10 deg}
  twist: {"*knee": 20 deg, "sway[0]": 5 deg, leg_1.knee: 10 deg}

modes:
  stand:
    root: body
    base: free
    pose: rest
    poses: [stretch]
    actuators: [hip_*, leg_0.knee]
    contacts: {exclude: [[leg_*, head.box]], adhesion: {leg_0.sole: 10 N}}
    standing_on: [leg_*.sole]
  hang: {extends: bench, pose: twist}
  bench: {root: crown, base: fixed}

raw: {mjcf: {joint: {leg_0/knee: {solreflimit: 0.01 1}, sway_1: {solreflimit: 0.01 1}}, body: {trunk: {gravcomp: 1}},
  tendon: {stay: {margin: 0.01}}, actuator: {stay: {group: 1}},
  add: {tendon: [{fixed: {name: pull, in: [{joint: {joint: leg_0.knee, coef: 1}}]}}],
    sensor: [{framepos: {objtype: body, objname: trunk}}]}}}
sensors:
  tilt: {type: imu, at: crown}
  bend: {type: joint, joint: leg_0.knee}
  wag: {type: joint}
  strain: {type: tendon, tendon: stay}
names: {components: {tail: tail-1}, mounts: {nose: nose-1}, joints: {sway: sway-1}, tendons: {stay: stay-1}, actuators: {stay: pull-1},
  sensors: {"tilt:gyro": gyro}, poses: {stretch: long}}

tests:
  light: {mass: {of: leg_*, max: "=20 g * width / 1 mm"}}
  heads: {mass: {of: head.box, max: 1 kg}}
  tall: {reach: {of: nose, from: crown, max: 1 m}}
  there: {point: {mount: leg_0.sole, mode: ben*, at: [0, 0, 0], within: 1 m}}
  clear: {no_collision: {mode: stand, pose: [rest, "str*"], joints: {hip_0: all}, allow: [{pair: [leg_*, body], reason: they touch}]}}
  pulls: {torque_margin: {drive: hip_*, mode: bench, pose: all, min: 0.01}}
  steps: {drive_margin: {motion: step, drive: hip_*, mode: bench, min: 0.01}}

motions: {step: [{pose: rest, time: 0}, {pose: stretch, time: 1 s}]}
"""

LEG = """\
thingc: assembly/1
name: leg
parameters: {length: 80 mm}
materials: {chalk: {density: 900 kg/m^3}}
components:
  thigh:
    frame: true
    mass: 50 g
    material: chalk
    inertia: &i {ixx: 1e-4 kg*m^2, iyy: 1e-4 kg*m^2, izz: 1e-4 kg*m^2}
    mounts: {up: {xyz: 0 0 10 mm}, down: {xyz: [0, 0, =-length]}}
  shin: {frame: true, mass: 30 g, inertia: *i, mounts: {up: {}, foot: {xyz: [0, 0, =-length], rpy: 180 0 0 deg}}}
joints:
  knee: {type: revolute, parent: thigh.down, child: shin.up, limit: {lower: -90 deg, upper: 90 deg}, drive: {kind: motor, effort: 1 N*m}}
mounts: {socket: thigh.up, sole: shin.foot}
poses: {bent: {knee: 40 deg}}
"""

HEAD = """\
thingc = "assembly/1"
name = "head"

[components.box]
frame = true
mass = "100 g"

[components.box.mounts]   # both of them
face = { xyz = "0 10 0 mm" }
under = { rpy = "180 0 0 deg" }

[components.jaw]
frame = true
mass = "10 g"
inertia = { ixx = "1e-4 kg*m^2", iyy = "1e-4 kg*m^2", izz = "1e-4 kg*m^2" }

[joints.chew]
type = 'revolute'
parent = "box.face"
child = "jaw.origin"

[joints.chew.limit]
lower = "0 deg"
upper = "30 deg"

[mounts]
neck = "box.under"
face = 'jaw.origin'

[poses.up]
chew = "10 deg"
"""

PAINTS = """\
thingc: materials/1
materials:
  red: {density: 1000 kg/m^3}
  blue: {density: 1100 kg/m^3}
"""

STUDY = """\
thingc: variants/1
assembly: walker.yaml
name: study
parameters:
  width: [90 mm, 110 mm]
  joints.hip.limit.effort: [2 N*m, 3 N*m]
  components.leg.joints.knee.limit.upper: 80 deg
choices:
  components.badge.material: [red, blue]
  components.head.assembly: head.toml
keep: [width > 10 mm, mass < 50 kg, length.leg_0.knee < 1 m]
list:
  - {name: narrow, parameters: {stance: 10 deg, components.tail.mass: 30 g}}
modes: [bench]
pose: rest
reach: {of: nose, from: crown}
"""

FILES = {"walker.yaml": WALKER, "leg.yaml": LEG, "head.toml": HEAD, "paints.yaml": PAINTS, "study.yaml": STUDY, "thingc.toml": ""}


def write(folder: Path) -> Path:
    """Write the workspace into a folder and return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in FILES.items():
        (folder / name).write_text(text)
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    return folder
