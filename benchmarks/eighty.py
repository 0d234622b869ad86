"""Measure the cost of importing and building a URDF file, compared to MuJoCo's own reader. The file has 80 links, each with a mesh of 50
000 triangles.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy
import trimesh

from costs import cost

LINKS = 80
ROUND, HIGH = 250, 101
"""Number of vertices around the axis, and number of rows of vertices from pole to pole. A mesh has 2 * 250 * 100 triangles."""


def write_eighty(folder: Path) -> Path:
    """Write a URDF file with a chain of 80 links, and return its path. Each link has a mesh [m] for display and collision."""
    (folder / "meshes").mkdir(parents=True)
    lines = ['<robot name="eighty">', '  <mujoco><compiler discardvisual="false" strippath="false"/></mujoco>']
    for number in range(LINKS):
        _dented(number).export(folder / "meshes" / f"link_{number}.stl")
        mesh = f'<geometry><mesh filename="meshes/link_{number}.stl"/></geometry>'
        inertial = '<mass value="0.5"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/>'
        lines.append(f'  <link name="link_{number}"><inertial>{inertial}</inertial>'
                     f'<visual>{mesh}</visual><collision>{mesh}</collision></link>')
    for number in range(1, LINKS):
        lines.append(f'  <joint name="joint_{number}" type="revolute"><parent link="link_{number - 1}"/><child link="link_{number}"/>'
                     '<origin xyz="0.15 0 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="5" velocity="3"/></joint>')
    file = folder / "eighty.urdf"
    file.write_text("\n".join([*lines, "</robot>", ""]))
    return file


def _dented(number: int) -> trimesh.Trimesh:
    """Return a closed egg-shaped mesh with a radius of 5 cm [m]. The surface has waves that depend on the number."""
    around, down = numpy.meshgrid(numpy.linspace(0.0, 2.0 * numpy.pi, ROUND, endpoint=False), numpy.linspace(0.0, numpy.pi, HIGH)[1:-1])
    radius = 0.05 + 0.002 * numpy.sin((5 + number % 7) * down) * numpy.cos((3 + number % 11) * around) + 1e-5 * number
    rings = numpy.stack((radius * numpy.sin(down) * numpy.cos(around), radius * numpy.sin(down) * numpy.sin(around),
                         1.2 * radius * numpy.cos(down)), axis=-1).reshape(-1, 3)
    at = numpy.arange(len(rings)).reshape(HIGH - 2, ROUND)
    right = numpy.roll(at, -1, axis=1)
    upper, upper_right, lower, lower_right = at[:-1].ravel(), right[:-1].ravel(), at[1:].ravel(), right[1:].ravel()
    top, bottom = len(rings), len(rings) + 1
    faces = numpy.concatenate((
        numpy.stack((upper, lower, upper_right), axis=1), numpy.stack((upper_right, lower, lower_right), axis=1),
        numpy.stack((numpy.full(ROUND, top), at[0], right[0]), axis=1),
        numpy.stack((numpy.full(ROUND, bottom), right[-1], at[-1]), axis=1),
    ))
    return trimesh.Trimesh(numpy.vstack((rings, [(0.0, 0.0, 0.06), (0.0, 0.0, -0.06)])), faces, process=False)


def rows(thingc: str, folder: Path, environment: dict[str, str], unit: float) -> list[tuple[str, float, str, float | None]]:
    """Return a name, value, unit and upper bound for each measurement. `unit` is the reference time I [s]. Each command runs only once,
    because it takes long.
    """
    file = write_eighty(folder / "eighty")
    theirs = cost([sys.executable, "-c", f"import mujoco; mujoco.MjModel.from_xml_path({str(file)!r})"], folder, environment)
    empty = cost([sys.executable, "-c", "import mujoco"], folder, environment)
    reading = theirs.wall - empty.wall
    document = "eighty_thingc/eighty.yaml"
    imported = cost([thingc, "import", str(file), "-o", "eighty_thingc"], folder, environment)
    cost([thingc, "set", document, "modes.source.at={xyz: 0 0 200 mm}"], folder, environment)  # places the robot above the floor
    unverified = cost([thingc, "build", document, "--emit", "urdf", "--store", "eighty_store"], folder, environment)
    built = cost([thingc, "build", document], folder, environment)
    time.sleep(2.5)  # hashes of recently changed files are not cached
    cost([thingc, "build", document], folder, environment)
    same = cost([thingc, "build", document], folder, environment)
    cost([thingc, "set", document, "joints.joint_7.limit.upper=0.9 rad"], folder, environment)
    checked = cost([thingc, "check", document], folder, environment)
    return [
        ("80 meshes: MuJoCo reads the source", reading, "s", None),
        ("80 meshes: MuJoCo, memory", theirs.memory, "MB", None),
        ("80 meshes: import", imported.wall, "s", None),
        ("80 meshes: import, first build", imported.wall + built.wall, "s", 5.0 * reading + 0.5 * unit),
        ("80 meshes: import, memory", imported.memory, "MB", 400.0),
        ("80 meshes: URDF alone, memory", unverified.memory, "MB", 400.0),
        ("80 meshes: first build, memory", built.memory, "MB", 400.0),
        ("80 meshes: build, nothing changed", same.wall / unit, "I", 0.05),
        ("80 meshes: check, one value edited", checked.wall / unit, "I", 0.15),
    ]
