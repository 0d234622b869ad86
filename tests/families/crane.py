"""Robots without parts for MJX."""

CRANE = """\
thingc: assembly/1
name: crane
parameters:
  length: {value: 300 mm, min: 100 mm, max: 900 mm}
  load: {value: 500 g, min: 10 g, max: 20 kg}
  radius: {value: 20 mm, min: 5 mm}
  skew: {value: 1 g*m^2}
  stiff: {value: 30 N*m/rad}
  rubbing: {value: 0 N*m, min: 0 N*m}
components:
  base:
    link: true
    mass: 2 kg
    shapes: [{box: [=4 * radius, 100 mm, 60 mm]}, {sphere: {radius: =radius}, at: {xyz: [=radius, 0, 80 mm]}}]
    mounts: {top: {xyz: 0 0 100 mm}, tie: {xyz: [=radius, 0, 200 mm]}}
  arm:
    link: true
    mass: =300 g/m * length
    com: [=length / 2, 0, 1 mm]
    inertia: {ixx: 0.01 kg*m^2, iyy: 0.02 kg*m^2, izz: 0.015 kg*m^2, ixy: =skew}
    shapes: [{capsule: {radius: =radius, length: =length}, at: {xyz: [=length / 2, 0, 0], rpy: 0 90 0 deg}}]
    mounts: {end: {xyz: [=length, 0, 0]}, middle: {xyz: [=length / 2, 10 mm, 0], rpy: 0 10 0 deg}}
  weight: {frame: true, mass: =load, at: {in: arm.end, xyz: 1 2 3 mm}}
  hook:
    link: true
    mass: 0.3 kg
    shapes: [{cylinder: {radius: =radius, length: =length / 4}}, {ellipsoid: [=radius, 30 mm, 40 mm], at: {xyz: [0, =radius, 0]}}]
joints:
  lift:
    type: revolute
    parent: base.top
    child: arm.origin
    axis: [0, 1, 0]
    limit: {lower: -90 deg, upper: 90 deg}
    dynamics: {damping: 0.1 N*m*s/rad, friction: =rubbing, stiffness: 2 N*m/rad, rest: 5 deg}
    drive: {kind: position, kp: =stiff}
  slide:
    type: prismatic
    parent: arm.middle
    child: hook.origin
    axis: [0, 0, 1]
    limit: {lower: -50 mm, upper: 50 mm}
    dynamics: {armature: 0.1 kg}
    drive: {kind: position, kp: =stiff / (1 m^2/rad), effort: 8 N}
tendons: {cable: {joints: {lift: 0.1 m/rad, slide: 1}, dynamics: {armature: 0.2 kg}}}
sensors: {view: {type: camera, at: arm.end, fovy: 60 deg}}
modes:
  standing: {root: base, base: fixed, at: {rpy: 0 0 20 deg}, contacts: &apart {exclude: [[base, hook]]}}
  adrift: {root: base, base: free, at: {xyz: [0, 0, =length]}, contacts: *apart}
  carried: {root: base, base: held, contacts: *apart}
raw:
  mjcf:
    actuator: {lift: {dampratio: 0.7}}
    add:
      tendon: [{spatial: {name: string, stiffness: 5, in: [{site: {site: base.tie}}, {site: {site: arm.end}}]}}]
"""
"""The numbers of this robot affect every kind of model field that can change in MJX."""

LEVER = """\
thingc: assembly/1
name: lever
parameters:
  length: {value: 300 mm, min: 100 mm, max: 900 mm}
  load: {value: 500 g, min: 10 g, max: 20 kg}
  stiff: {value: 50 N*m/rad}
  damping: {value: 0.2 N*m*s/rad}
components:
  base: {frame: true, mass: 2 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  arm:
    frame: true
    mass: =300 g/m * length
    com: [=length / 2, 0, 0]
    inertia: {ixx: 0.001 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.002 kg*m^2}
    mounts: {end: {xyz: [=length, 0, 0]}}
  weight: {frame: true, mass: =load, at: {in: arm.end}}
joints:
  lift:
    type: continuous
    parent: base.origin
    child: arm.origin
    axis: [0, 1, 0]
    dynamics: {damping: =damping}
    drive: {kind: position, kp: =stiff, effort: 8 N*m}
modes:
  standing: {root: base, base: fixed, at: {xyz: 10 0 0 mm}}
  carried: {root: base, base: held}
simulation: {cone: elliptic}
"""

BEAM = """\
thingc: assembly/1
name: beam
parameters: {length: {value: 200 mm, min: 50 mm}, thickness: 30 mm, load: {value: 0.5 kg, min: 0.1 kg}}
materials: {wood: {density: 450 kg/m^3}}
components:
  base: {link: true, mass: 2 kg, shapes: [{box: [100 mm, 100 mm, 60 mm]}], mounts: {top: {xyz: 0 0 40 mm}}}
  beam: {part: "beams:Beam", params: {length: =length, thickness: =thickness}, material: wood, collision: box}
  weight: {frame: true, mass: =load, at: {in: beam.end, xyz: 0 0 10 mm}}
joints:
  lift:
    type: revolute
    parent: base.top
    child: beam.hinge
    axis: [0, 1, 0]
    limit: {lower: -90 deg, upper: 90 deg}
    drive: {kind: position, kp: 20 N*m/rad}
modes: {standing: {root: base, base: fixed}}
"""
"""A robot with a part that the CAD kernel builds. The parameters of the document have the defaults of the part."""

BEAMS = '''\
from typing import Annotated

from build123d import Box, Location, Pos

from thingc import Length, MountPoint, Range, Thing


class Beam(Thing):
    """A beam along x.

    Args:
        length: length of the beam
        thickness: its height and width
    """

    def __init__(self, length: Annotated[Length, Range(50, 900)] = 200, thickness: Length = 30):
        super().__init__()
        self.hinge = MountPoint(Location((0, 0, 0)))
        self.end = MountPoint(Location((length, 0, 0)))
        beam, hole = Box(length, thickness, thickness), Box(length / 4, thickness, thickness / 3)
        self.body = Pos(length / 2, 0, 0) * (beam - hole)

    def result(self):
        """Return the beam with a hole."""
        return self.body
'''
