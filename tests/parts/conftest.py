"""The arm, assembled with a chain of matrices, as an independent reference for placements: it reads no document and uses no compiler
pass. Lengths are in mm. A mate is the product X_PC = X_PA Rz(turn + q) M inv(X_CB), with the matrix M written out."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from thingc.geometry.worker.lazy_build123d import import_cheaply

ROOT = Path(__file__).parents[2]
for folder in ("parts", "compiler"):
    if str(ROOT / folder) not in sys.path:
        sys.path.insert(0, str(ROOT / folder))
import_cheaply("build123d")  # modules of tests use it, and a worker imports it in the same way, in half of the time

M = np.array([[0.0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])

POSES = {
    "home": (30.0, -60.0, 120.0, -30.0),
    "stretched": (0.0, 0.0, 0.0, 0.0),
    "folded": (0.0, -150.0, 125.0, 0.0),
    "writing": (0.0, -40.0, 98.8, -58.8),
}
"""The poses in assemblies/arm.yaml: yaw, shoulder, elbow, wrist [deg]."""


def matrix(location) -> np.ndarray:
    """Return the homogeneous matrix [mm] of a build123d Location, read from the transformation of the CAD kernel."""
    t = location.wrapped.Transformation()
    return np.array([[t.Value(i, j) for j in range(1, 5)] for i in range(1, 4)] + [[0.0, 0, 0, 1]])


def about_z(degrees: float) -> np.ndarray:
    """Return a rotation about z."""
    a = np.radians(degrees)
    return np.array([[np.cos(a), -np.sin(a), 0, 0], [np.sin(a), np.cos(a), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def mount_frame(thing, mount: str) -> np.ndarray:
    """Return the frame of a mount of a Thing. `screw_3` is the third element of a list."""
    name, _, number = mount.rpartition("_")
    found = getattr(thing, mount, None) if not number.isdigit() else getattr(thing, name)[int(number)]
    return matrix(found.location)


@dataclass(frozen=True)
class Placed:
    """A part of the arm: its Thing, its pose in the frame of the plate, and its link."""

    name: str
    thing: object
    pose: np.ndarray
    link: str


@dataclass(frozen=True)
class Mated:
    """A row of the arm: `name` is attached with its mount `mine` to the mount `theirs` of `parent`, rotated. `joint` is the number of
    the joint, or None."""

    name: str
    thing: object
    mine: str
    parent: str
    theirs: str
    link: str
    turn: float = 0.0
    joint: int | None = None


def lines(reach: float = 100.0, pen: float = 15.0) -> Iterator[Mated]:
    """Return the rows of the arm after the plate, as in assemblies/arm.yaml."""
    import arm
    from thingc_stock.dynamixel import XM430
    from thingc_stock.fasteners import Screw

    servo, brace = XM430(), arm.RotorBrace(length=reach, thickness=max(3.0, reach / 40))
    yield Mated("yaw_servo", servo, "back", "plate", "servo_seat", "base")
    for k in range(8):
        yield Mated(f"plate_screw_{k}", Screw("M2.5", 8), "seat", "plate", f"servo_screw_{k}", "base")
    yield Mated("bracket", arm.YawPitchBracket(), "yaw_seat", "yaw_servo", "rotor", "bracket", joint=0)
    yield Mated("shoulder_servo", servo, "bottom", "bracket", "shoulder_seat", "bracket")
    yield Mated("humerus", brace, "rotor_seat", "shoulder_servo", "rotor", "humerus", turn=90.0, joint=1)
    yield Mated("elbow_servo", servo, "bottom", "humerus", "servo_seat", "humerus")
    yield Mated("humerus_idler", brace, "servo_seat", "elbow_servo", "bottom", "humerus", turn=180.0)
    yield Mated("forearm", brace, "rotor_seat", "elbow_servo", "rotor", "forearm", joint=2)
    yield Mated("wrist_servo", servo, "bottom", "forearm", "servo_seat", "forearm")
    yield Mated("forearm_idler", brace, "servo_seat", "wrist_servo", "bottom", "forearm", turn=180.0)
    yield Mated("hand/fixture", arm.Hand(pen), "rotor_seat", "wrist_servo", "rotor", "hand", joint=3)
    yield Mated("hand/cap", arm.OmegaCap(pen), "seat", "hand/fixture", "cap_seat", "hand")
    for k in range(2):
        yield Mated(f"hand/cap_screw_{k}", Screw("M3", 8), "seat", "hand/cap", f"screw_{k}", "hand")
    yield Mated("hand/pen", arm.PenDummy(diameter=pen), "grip", "hand/cap", "pen", "hand")


def put_together(q: tuple[float, ...], reach: float = 100.0, pen: float = 15.0) -> dict[str, Placed]:
    """Return every part of the arm with its pose in the frame of the plate, at the joint angles `q` [deg]."""
    import arm

    placed = {"plate": Placed("plate", arm.BasePlate(), np.eye(4), "base")}
    for line in lines(reach, pen):
        parent = placed[line.parent]
        angle = line.turn + (q[line.joint] if line.joint is not None else 0.0)
        here = parent.pose @ mount_frame(parent.thing, line.theirs) @ about_z(angle) @ M
        placed[line.name] = Placed(line.name, line.thing, here @ np.linalg.inv(mount_frame(line.thing, line.mine)), line.link)
    return placed


def as_manifold(shapes):
    """Convert the meshes (0.05 mm) of solids to one manifold3d solid."""
    import manifold3d

    pieces = []
    for solid in shapes if isinstance(shapes, (list, tuple)) else [shapes]:
        vertices, triangles = solid.tessellate(0.05, 0.2)
        mesh = manifold3d.Mesh(np.array([tuple(v) for v in vertices], dtype=np.float32), np.array(triangles, dtype=np.uint32))
        mesh.merge()
        piece = manifold3d.Manifold(mesh)
        assert piece.status() == manifold3d.Error.NoError, piece.status()
        pieces.append(piece)
    return pieces


@pytest.fixture(scope="session")
def meshes():
    """A function from a Thing to its mesh, which is created once."""
    made = {}

    def mesh(thing):
        if thing not in made:
            made[thing] = as_manifold(thing.result())[0]
        return made[thing]

    return mesh


@pytest.fixture(scope="session")
def pieces():
    """A function from a Thing to the meshes of its collision pieces, or of its hull, which are created once."""
    made = {}

    def collide(thing):
        if thing not in made:
            own = thing.collision()
            made[thing] = as_manifold(own) if own else [as_manifold(thing.result())[0].hull()]
        return made[thing]

    return collide
