"""Documents without parts: they contain what affects a MuJoCo model, and need no CAD kernel."""

INERTIA = "inertia: {ixx: 0.01 kg*m^2, iyy: 0.02 kg*m^2, izz: 0.015 kg*m^2, ixy: 0.001 kg*m^2}"

EVERYTHING = f"""\
thingc: assembly/1
name: everything
parameters:
  load: {{value: 500 g, min: 10 g, max: 20 kg, doc: at the end of the arm}}
  length: {{value: 300 mm, min: 100 mm, max: 900 mm}}
  stiff: {{value: 50 N*m/rad, min: 1 N*m/rad}}
  teeth: {{value: 3, min: 1, max: 9}}
  heavy: {{value: false}}
defaults: {{joint: {{dynamics: {{damping: 0.1 N*m*s/rad}}}}}}
components:
  base: {{frame: true, mass: 2 kg, {INERTIA}, mounts: {{far: {{xyz: 400 0 0 mm}}, side: {{xyz: 0 200 0 mm}}}}}}
  arm:
    frame: true
    mass: =300 g/m * length
    com: [=length / 2, 0, 1 mm]
    {INERTIA}
    mounts: {{end: {{xyz: [=length, 0, 0]}}, middle: {{xyz: [=length / 2, 0, 0], rpy: 0 10 0 deg}}}}
  weight: {{frame: true, mass: =load, at: {{in: arm.end, xyz: 1 2 3 mm}}}}
  crank: {{frame: true, mass: 0.3 kg, {INERTIA}, mounts: {{pin: {{xyz: 100 0 0 mm}}}}}}
  coupler: {{frame: true, mass: 0.2 kg, {INERTIA}, mounts: {{pin: {{xyz: 400 0 0 mm}}}}}}
  rocker: {{frame: true, mass: 0.3 kg, {INERTIA}, mounts: {{pin: {{xyz: 100 0 0 mm}}}}}}
  eye: {{frame: true, mass: 0.1 kg, {INERTIA}}}
  wheel: {{frame: true, mass: 0.3 kg, {INERTIA}}}
  flap: {{frame: true, mass: 0.1 kg, {INERTIA}}}
  tool: {{assembly: tool.yaml, at: {{in: wheel.origin, xyz: 0 0 20 mm}}}}
joints:
  lift:
    type: revolute
    parent: base.side
    child: arm.origin
    limit: {{lower: -90 deg, upper: 90 deg, effort: 8 N*m, velocity: 5 rad/s}}
    drive: {{kind: position, kp: =stiff, effort: 8 N*m}}
  gear:
    type: revolute
    parent: arm.middle
    child: wheel.origin
    limit: {{lower: -3 rad, upper: 3 rad}}
    mimic: {{joint: lift, multiplier: =teeth / 3, offset: 0.1 rad}}
    dynamics: {{armature: 0.001 kg*m^2, stiffness: 0.5 N*m/rad, rest: 0.2 rad, friction: 0.01 N*m}}
  turn: {{type: continuous, parent: base.origin, child: crank.origin, drive: {{kind: velocity, kv: 2 N*m*s/rad}}}}
  rod: {{type: continuous, parent: crank.pin, child: coupler.origin}}
  swing: {{type: continuous, parent: base.far, child: rocker.origin}}
  pin: {{type: continuous, parent: coupler.pin, child: rocker.pin, loop: true}}
  neck: {{type: ball, parent: arm.end, child: eye.origin, limit: {{cone: 40 deg}}}}
  flip:
    type: revolute
    parent: base.side
    child: flap.origin
    limit: {{lower: 0 deg, upper: 50 deg}}
    drive: {{kind: motor, effort: 2 N*m}}
mounts: {{hook: weight.origin, stand: base.origin}}
sensors:
  imu: {{type: imu, at: weight.origin}}
  turning: {{type: joint, joint: lift}}
  pull: {{type: force, at: stand}}
  view: {{type: camera, at: eye.origin, fovy: 60 deg}}
poses:
  level: {{lift: 60 deg}}
  low: {{lift: -20 deg, turn: 5 deg}}
modes:
  standing: {{root: base, base: fixed, pose: level, at: {{rpy: 90 0 0 deg}}}}
  hanging: {{root: arm, base: held, pose: low}}
  loose: {{root: base, base: free, pose: level, at: {{xyz: 0 0 500 mm}}, gravity: 0 0 -1.6 m/s^2}}
  stuck:
    root: stand
    base: held
    pose: low
    gravity: wall
    hold: {{hook: here}}
    contacts: {{adhesion: {{stand: 300 N, hook: 20 N}}, exclude: [[arm, coupler]]}}
simulation: {{timestep: 2 ms, integrator: implicitfast}}
raw: {{mjcf: {{joint: {{lift: {{solreflimit: 0.01 1}}}}}}}}
tests:
  light: {{mass: {{max: 5 kg}}}}
"""
"""Loops, a mimic, a ball, drives of three kinds, sensors of four kinds, raw attributes, and bases of three kinds. One mode uses adhesion
and holds."""

TOOL = f"""\
thingc: assembly/1
name: tool
components: {{grip: {{frame: true, mass: 0.2 kg, {INERTIA}}}, finger: {{frame: true, mass: 0.05 kg, {INERTIA}}}}}
joints: {{close: {{type: revolute, parent: grip.origin, child: finger.origin, limit: {{lower: 0 deg, upper: 45 deg}}}}}}
"""

MANY = """\
thingc: variants/1
assembly: everything.yaml
name: many
sample:
  method: sobol
  count: 8
  seed: 7
  ranges: {length: [200 mm, 500 mm], load: [100 g, 900 g], joints.lift.limit.upper: [70 deg, 90 deg]}
keep: [mass <= 4.45 kg, length >= 210 mm]
modes: [standing]
pose: level
reach: {of: hook, from: stand}
"""

STRUNG = f"""\
thingc: assembly/1
name: strung
parameters:
  lever: {{value: 12 mm/rad, doc: of the cable about the pitch}}
  thickness: {{value: 20 mm, min: 5 mm}}
  reach: {{value: 60 mm, doc: how far from the post the rope comes from it}}
  drum: {{value: 25 mm, min: 5 mm}}
  axle: {{value: 70 mm, doc: where the drum is on the thigh}}
components:
  post:
    frame: true
    mass: 2 kg
    {INERTIA}
    mounts: {{top: {{xyz: 0 0 600 mm}}, tie: {{xyz: 50 0 500 mm}}, eye: {{xyz: [=reach, 20 mm, 500 mm]}}}}
  hip: {{frame: true}}
  thigh:
    frame: true
    mass: 0.8 kg
    com: [5 mm, 0, -100 mm]
    {INERTIA}
    mounts:
      knee: {{xyz: 0 0 -200 mm}}
      tie: {{xyz: 30 0 -90 mm}}
      drum: {{xyz: [=axle, 0 mm, -150 mm], rpy: 90 0 0 deg}}
      by: {{xyz: 300 0 -150 mm}}
  shank:
    link: true
    mass: 0.4 kg
    shapes:
      - {{box: [=thickness, =thickness, 160 mm], at: {{xyz: 0 0 -80 mm}}, friction: {{slide: 0.7}}}}
    mounts: {{end: {{xyz: 0 0 -180 mm}}, middle: {{xyz: 0 0 -60 mm}}}}
  foot: {{frame: true, mass: 0.1 kg, {INERTIA}}}
joints:
  roll:
    type: revolute
    parent: post.top
    child: hip.origin
    axis: [1, 0, 0]
    limit: {{lower: -60 deg, upper: 60 deg}}
    dynamics: {{damping: 0.2 N*m*s/rad, stiffness: 3 N*m/rad, rest: 5 deg}}
  pitch:
    type: revolute
    parent: hip.origin
    child: thigh.origin
    axis: [0, 1, 0]
    limit: {{lower: -90 deg, upper: 90 deg, effort: 12 N*m}}
    dynamics: {{friction: 0.02 N*m, armature: 0.003 kg*m^2}}
    drive: {{kind: position, kp: 30 N*m/rad, effort: 12 N*m}}
  knee:
    type: revolute
    parent: thigh.knee
    child: shank.origin
    axis: [0, 0.6, 0.8]
    offset: 4 deg
    limit: {{lower: -100 deg, upper: 100 deg}}
    dynamics: {{damping: 0.1 N*m*s/rad}}
  strut:
    type: prismatic
    parent: shank.end
    child: foot.origin
    mimic: {{joint: knee, polynomial: [5 mm, 9 mm/rad, -4 mm/rad^2, 1 mm/rad^3]}}
tendons:
  cable:
    joints: {{pitch: =lever, knee: -8 mm/rad}}
    limit: {{lower: -20 mm, upper: 25 mm}}
    dynamics: {{stiffness: 200 N/m, damping: 3 N*s/m, rest: 5 mm}}
    drive: {{kind: position, kp: 900 N/m, effort: 40 N}}
  band: {{joints: {{roll: 1, pitch: -0.5}}, dynamics: {{friction: 0.1 N*m}}}}
  rope:
    path:
      - post.eye
      - {{around: thigh.drum, cylinder: =drum, side: thigh.by}}
      - shank.end
      - {{pulley: 2}}
      - thigh.tie
      - {{around: shank.middle, sphere: 15 mm}}
      - shank.end
    dynamics: {{stiffness: 40 N/m}}
    drive: {{kind: position, kp: 60 N/m}}
mounts: {{stand: post.origin, sole: foot.origin}}
poses: {{bent: {{roll: 10 deg, pitch: 20 deg, knee: -30 deg}}}}
modes:
  standing: {{root: post, base: fixed, pose: bent}}
  footed: {{root: foot, base: free, pose: bent, at: {{xyz: 0 0 300 mm}}}}
raw:
  mjcf:
    add:
      tendon:
        - spatial: {{name: string, stiffness: 5, range: 0.01 0.9, in: [{{site: {{site: post.tie}}}}, {{site: {{site: thigh.tie}}}}]}}
      actuator:
        - general: {{name: winch, tendon: string, dyntype: filterexact, dynprm: 0.05, gainprm: 3}}
      sensor:
        - tendonpos: {{name: reach, tendon: string}}
"""
"""Joint axes, two joints on one body, springs with a rest position, a mimic with a polynomial, a link of shapes, tendons, and raw
additions."""

WORKSPACE = {
    "thingc.toml": 'thingc = "workspace/1"\n', "everything.yaml": EVERYTHING, "tool.yaml": TOOL, "many.yaml": MANY, "strung.yaml": STRUNG,
}
"""All documents, by file."""
