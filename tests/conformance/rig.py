"""A small robot of boxes and cylinders: its documents, and where everything must be by hand-written matrices.

Nothing here is of the compiler. Lengths in metres, angles in radians; X_AB is the pose of frame B in frame A.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SOLIDS = '''
    """Boxes and cylinders whose mass, centre and inertia are in every textbook."""

    from build123d import Box, Cylinder, Location, Plane, Pos

    from thingc import Length, MountPoint, Thing


    class Block(Thing):
        """A box from (-5, -2, 0) mm on: its centre is nowhere near its origin."""

        def __init__(self, x: Length = 40, y: Length = 30, z: Length = 20):
            super().__init__(material="pine")
            self.body = Pos(x / 2 - 5, y / 2 - 2, z / 2) * Box(x, y, z)
            self.top = MountPoint(Location(Plane((x / 4, y / 3, z), x_dir=(0.6, 0.8, 0), z_dir=(0, 0, 1))))
            self.under = MountPoint(Location(Plane((1, 2, 0), x_dir=(-0.8, 0.6, 0), z_dir=(0, 0, -1))))

        def result(self):
            return self.body


    class Rod(Thing):
        """A cylinder along z from the origin on."""

        def __init__(self, radius: Length = 5, length: Length = 50):
            super().__init__(material="pine")
            self.body = Pos(0, 0, length / 2) * Cylinder(radius, length)
            self.foot = MountPoint(Location(Plane((0, 0, 0), x_dir=(0.28, 0.96, 0), z_dir=(0, 0, -1))))
            self.head = MountPoint(Location(Plane((0, 0, length), x_dir=(0.96, -0.28, 0), z_dir=(0, 0, 1))))
            self.flank = MountPoint(Location(Plane((radius, 0, length / 3), x_dir=(0, 0.6, 0.8), z_dir=(1, 0, 0))))

        def result(self):
            return self.body
'''

MATERIALS = """
    thingc: materials/1
    materials:
      pine: {density: 500 kg/m^3, color: burlywood}
      brass: {density: 8500 kg/m^3, color: "#b5a642"}
"""

GRIP = """
    thingc: assembly/1
    name: grip
    parameters: {reach: 20 mm}
    materials: [materials.yaml]
    components:
      palm: {part: solids:Block, params: {x: 24 mm, y: 16 mm, z: 6 mm}}
      jaw: {part: solids:Block, params: {x: 12 mm, y: 10 mm, z: =reach}}
      finger: {part: solids:Rod, params: {radius: 2 mm, length: =reach}, material: brass}
    joints:
      open:
        type: revolute
        parent: palm.top
        child: jaw.under
        turn: -20 deg
        limit: {lower: -90 deg, upper: 90 deg}
      extend:
        type: prismatic
        parent: jaw.top
        child: finger.foot
        offset: 1.5 mm
        mimic: {joint: open, multiplier: 10 mm/rad, offset: 2 mm}
    mounts: {seat: palm.under, tip: finger.head}
    poses:
      closed: {open: 20 deg}
"""

RIG = """
    thingc: assembly/1
    name: rig
    parameters:
      span: {value: 60 mm, min: 20 mm, max: 200 mm}
    materials: [materials.yaml]
    defaults:
      component: {material: pine}
    components:
      base: {part: solids:Block, params: {x: 80 mm, y: 60 mm, z: 12 mm}}
      post:
        part: solids:Rod
        params: {radius: 6 mm, length: =span}
        material: brass
        attach: {mount: foot, to: base.top, turn: 35 deg, gap: 2 mm}
      shelf:
        part: solids:Block
        params: {x: 30 mm, y: 20 mm, z: 8 mm}
        at: {in: post.flank, xyz: 3 4 5 mm, rpy: 20 -40 70 deg}
      peg:
        repeat: {count: 3, as: i}
        part: solids:Rod
        params: {radius: =2 mm + i * 1 mm, length: 10 mm}
        at: {in: base.origin, xyz: [=i * 20 mm, 5 mm, 0], rpy: [180 deg, 0, =i * 10 deg]}
      boom: {part: solids:Rod, params: {radius: 4 mm, length: =2 * span}}
      slider: {part: solids:Block, params: {x: 10 mm, y: 12 mm, z: 14 mm}}
      grip: {assembly: grip.yaml, parameters: {reach: =span / 2}}
      tool:
        part: solids:Rod
        params: {radius: 1 mm, length: 25 mm}
        attach: {foot: grip.tip}
      plumb:
        frame: true
        mass: 7 g
        at: {in: grip.jaw.top, xyz: 1 2 3 mm}
    joints:
      swing:
        type: revolute
        parent: post.head
        child: boom.foot
        turn: 15 deg
        gap: 3 mm
        offset: 25 deg
        limit: {lower: -120 deg, upper: 100 deg}
        dynamics: {armature: 0.001 kg*m^2}
      slide:
        type: prismatic
        parent: boom.flank
        child: slider.under
        turn: -30 deg
        gap: 1 mm
        offset: 4 mm
        limit: {lower: -10 mm, upper: 30 mm}
      wrist:
        type: continuous
        parent: boom.head
        child: grip.seat
        offset: -50 deg
    mounts: {tip: tool.head}
    poses:
      up: {swing: 30 deg, slide: 12 mm, wrist: 200 deg, grip: closed}
    modes:
      table: {root: base, pose: up, at: {xyz: 100 -50 20 mm, rpy: 10 20 30 deg}}
      gripped: {root: grip.tip, base: held}
      loose: {root: boom, base: free, at: {xyz: 0 0 300 mm, rpy: 0 90 0 deg}}
      pegged: {root: peg_1.foot, gravity: wall}
"""

DOCUMENTS = {"parts/solids.py": SOLIDS, "materials.yaml": MATERIALS, "grip.yaml": GRIP, "rig.yaml": RIG}

M: Array = np.array([[0.0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
MM, DEG = 1e-3, np.pi / 180


def shift(x: float, y: float, z: float) -> Array:
    found = np.eye(4)
    found[:3, 3] = x, y, z
    return found


def about(axis: str, angle: float) -> Array:
    """A turn about x, y or z."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    found = np.eye(4)
    found[j, j] = found[k, k] = np.cos(angle)
    found[k, j], found[j, k] = np.sin(angle), -np.sin(angle)
    return found


def urdf(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> Array:
    """Extrinsic roll, pitch, yaw."""
    return shift(*xyz) @ about("z", rpy[2]) @ about("y", rpy[1]) @ about("x", rpy[0])


def frame(origin: tuple[float, float, float], x: tuple[float, float, float], z: tuple[float, float, float]) -> Array:
    """A mount at `origin` with its x and z axes."""
    found = np.eye(4)
    found[:3, 0], found[:3, 1], found[:3, 2], found[:3, 3] = x, np.cross(z, x), z, origin
    return found


def mate(X_PA: Array, X_CB: Array, turn: float = 0.0, gap: float = 0.0, motion: Array | None = None) -> Array:
    """X_PC = X_PA Rz(turn) Tz(gap) X_J M inv(X_CB)."""
    return X_PA @ about("z", turn) @ shift(0, 0, gap) @ (np.eye(4) if motion is None else motion) @ M @ np.linalg.inv(X_CB)


@dataclass(frozen=True)
class Block:
    """A box of `size` [m] and density [kg/m^3], as in `SOLIDS`."""

    size: tuple[float, float, float]
    density: float = 500.0

    @property
    def mass(self) -> float:
        return self.density * float(np.prod(self.size))

    @property
    def centre(self) -> Array:
        x, y, z = self.size
        return np.array([x / 2 - 5 * MM, y / 2 - 2 * MM, z / 2])

    @property
    def inertia(self) -> Array:
        x, y, z = self.size
        return self.mass / 12 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])

    @property
    def top(self) -> Array:
        return frame((self.size[0] / 4, self.size[1] / 3, self.size[2]), (0.6, 0.8, 0), (0, 0, 1))

    @property
    def under(self) -> Array:
        return frame((1 * MM, 2 * MM, 0), (-0.8, 0.6, 0), (0, 0, -1))


@dataclass(frozen=True)
class Rod:
    """A cylinder, as in `SOLIDS`."""

    radius: float
    length: float
    density: float = 500.0

    @property
    def mass(self) -> float:
        return self.density * np.pi * self.radius**2 * self.length

    @property
    def centre(self) -> Array:
        return np.array([0, 0, self.length / 2])

    @property
    def inertia(self) -> Array:
        across = (3 * self.radius**2 + self.length**2) / 12
        return self.mass * np.diag([across, across, self.radius**2 / 2])

    @property
    def foot(self) -> Array:
        return frame((0, 0, 0), (0.28, 0.96, 0), (0, 0, -1))

    @property
    def head(self) -> Array:
        return frame((0, 0, self.length), (0.96, -0.28, 0), (0, 0, 1))

    @property
    def flank(self) -> Array:
        return frame((self.radius, 0, self.length / 3), (0, 0.6, 0.8), (1, 0, 0))


@dataclass(frozen=True)
class Lump:
    """A mass at a point."""

    mass: float

    @property
    def centre(self) -> Array:
        return np.zeros(3)

    @property
    def inertia(self) -> Array:
        return np.zeros((3, 3))


def bodies(span: float = 60 * MM) -> dict[str, Block | Rod | Lump]:
    """Every occurrence of the rig."""
    brass = 8500.0
    return {
        "base": Block((80 * MM, 60 * MM, 12 * MM)),
        "post": Rod(6 * MM, span, brass),
        "shelf": Block((30 * MM, 20 * MM, 8 * MM)),
        **{f"peg_{i}": Rod((2 + i) * MM, 10 * MM) for i in range(3)},
        "boom": Rod(4 * MM, 2 * span),
        "slider": Block((10 * MM, 12 * MM, 14 * MM)),
        "grip/palm": Block((24 * MM, 16 * MM, 6 * MM)),
        "grip/jaw": Block((12 * MM, 10 * MM, span / 2)),
        "grip/finger": Rod(2 * MM, span / 2, brass),
        "tool": Rod(1 * MM, 25 * MM),
        "plumb": Lump(7e-3),
    }


LINKS = {
    "base": ("base", "post", "shelf", "peg_0", "peg_1", "peg_2"),
    "boom": ("boom",),
    "slider": ("slider",),
    "grip/palm": ("grip/palm",),
    "grip/jaw": ("grip/jaw", "plumb"),
    "grip/finger": ("grip/finger", "tool"),
}
"""The occurrences of every link; the first gives it name and frame."""

JOINTS = ("grip/extend", "grip/open", "slide", "swing", "wrist")


def extension(opening: float) -> float:
    """What `grip/extend` does when `grip/open` is at an angle."""
    return 10 * MM * opening + 2 * MM


def placed(q: Mapping[str, float], span: float = 60 * MM) -> dict[str, Array]:
    """The pose of every occurrence in the frame of `base`."""
    b = bodies(span)
    X = {"base": np.eye(4)}
    X["post"] = mate(b["base"].top, b["post"].foot, 35 * DEG, 2 * MM)
    X["shelf"] = X["post"] @ b["post"].flank @ urdf((3 * MM, 4 * MM, 5 * MM), (20 * DEG, -40 * DEG, 70 * DEG))
    for i in range(3):
        X[f"peg_{i}"] = urdf((i * 20 * MM, 5 * MM, 0), (np.pi, 0, i * 10 * DEG))
    turn = about("z", q["swing"] + 25 * DEG)
    X["boom"] = X["post"] @ mate(b["post"].head, b["boom"].foot, 15 * DEG, 3 * MM, turn)
    along = shift(0, 0, q["slide"] + 4 * MM)
    X["slider"] = X["boom"] @ mate(b["boom"].flank, b["slider"].under, -30 * DEG, 1 * MM, along)
    turn = about("z", q["wrist"] - 50 * DEG)
    X["grip/palm"] = X["boom"] @ mate(b["boom"].head, b["grip/palm"].under, motion=turn)
    X["grip/jaw"] = X["grip/palm"] @ mate(b["grip/palm"].top, b["grip/jaw"].under, -20 * DEG, motion=about("z", q["grip/open"]))
    along = shift(0, 0, q["grip/extend"] + 1.5 * MM)
    X["grip/finger"] = X["grip/jaw"] @ mate(b["grip/jaw"].top, b["grip/finger"].foot, motion=along)
    X["tool"] = X["grip/finger"] @ mate(b["grip/finger"].head, b["tool"].foot)
    X["plumb"] = X["grip/jaw"] @ b["grip/jaw"].top @ shift(1 * MM, 2 * MM, 3 * MM)
    return X


def rooted(mode: str, span: float = 60 * MM) -> tuple[str, Array]:
    """The occurrence that carries a mode's root, and its pose in the world."""
    b = bodies(span)
    return {
        "table": ("base", urdf((100 * MM, -50 * MM, 20 * MM), (10 * DEG, 20 * DEG, 30 * DEG))),
        "gripped": ("grip/finger", M @ np.linalg.inv(b["grip/finger"].head)),
        "loose": ("boom", urdf((0, 0, 300 * MM), (0, 90 * DEG, 0))),
        "pegged": ("peg_1", M @ np.linalg.inv(b["peg_1"].foot)),
    }[mode]


def added(parts: Mapping[str, Array], span: float = 60 * MM) -> tuple[float, Array, Array]:
    """Mass, centre and inertia about the centre of occurrences at given poses: sums and the parallel-axis theorem."""
    b = bodies(span)
    mass = sum(b[name].mass for name in parts)
    centres = {name: X[:3, :3] @ b[name].centre + X[:3, 3] for name, X in parts.items()}
    centre = sum(b[name].mass * c for name, c in centres.items()) / mass
    inertia = np.zeros((3, 3))
    for name, X in parts.items():
        d = centres[name] - centre
        inertia += X[:3, :3] @ b[name].inertia @ X[:3, :3].T + b[name].mass * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, centre, inertia
