"""Slice a mesh with PrusaSlicer, and integrate the extruded material in the G-code."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

FILAMENT = 1.75
"""Diameter of the filament [mm] that the G-code assumes."""
BED = 400.0
"""Length of the sides of the print bed [mm]. Parts are placed in the middle of the bed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Print settings, with widths and heights in mm and an infill between 0 and 1. All other settings have PrusaSlicer's defaults."""

    walls: int
    lids: int
    infill: float
    layer: float = 0.2
    line_width: float = 0.45
    pattern: str = "stars"

    @property
    def ini(self) -> str:
        """Format the settings as a configuration file for PrusaSlicer. Skirt, brim and support are disabled, and the first layer has the
        same height and width as all other layers.
        """
        widths = ("", "first_layer_", "perimeter_", "external_perimeter_", "infill_", "solid_infill_", "top_infill_")
        said: dict[str, object] = {
            "layer_height": self.layer, "first_layer_height": self.layer, "perimeters": self.walls, "top_solid_layers": self.lids,
            "bottom_solid_layers": self.lids, "fill_density": f"{100 * self.infill:g}%", "fill_pattern": self.pattern,
            **{f"{width}extrusion_width": self.line_width for width in widths},
            "nozzle_diameter": self.line_width / 1.125, "filament_diameter": FILAMENT, "skirts": 0, "brim_width": 0,
            "support_material": 0, "retract_length": 0, "use_relative_e_distances": 1, "layer_gcode": "G92 E0",
            "bed_shape": f"0x0,{BED}x0,{BED}x{BED},0x{BED}", "max_print_height": BED,
        }
        return "".join(f"{key} = {value}\n" for key, value in said.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """The extruded material in the frame of the mesh: its volume [mm^3], its centre [mm], and its inertia about the centre at density 1
    [mm^5]. The volume is also given for each kind of line.
    """

    volume: float
    centre: tuple[float, ...]
    inertia: tuple[tuple[float, ...], ...]
    kinds: dict[str, float]


class NotSliced(Exception):
    """Raised if PrusaSlicer does not create G-code. The message is the error message of PrusaSlicer."""


def program() -> str | None:
    """Return the path of PrusaSlicer, or None if it is not installed."""
    return shutil.which("prusa-slicer")


def version() -> str:
    """Return the name and version of PrusaSlicer, as it writes them into files."""
    with tempfile.TemporaryDirectory() as folder:
        saved = Path(folder, "settings.ini")
        subprocess.run([str(program()), "--save", str(saved)], check=True, capture_output=True)
        words = saved.read_text().split()
    return " ".join(words[words.index("by") + 1 :][:2]).replace("+dfsg", "")


def printed(stl: bytes, settings: Settings, kept: Path | None = None) -> Printed:
    """Slice a binary STL file [mm] without rotating it, and return the extruded material. If the folder `kept` contains an earlier result
    for the same input, this result is returned.

    Raises `NotSliced` if PrusaSlicer cannot slice the mesh.
    """
    key = hashlib.sha256(stl + settings.ini.encode()).hexdigest()[:32]
    place = kept / f"{key}.json" if kept is not None else None
    if place is not None and place.exists():
        return Printed(**json.loads(place.read_text()))
    found = _integrated(_gcode(stl, settings), settings.layer, _shift(stl))
    if place is not None:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(json.dumps(asdict(found)))
    return found


def _gcode(stl: bytes, settings: Settings) -> str:
    with tempfile.TemporaryDirectory() as folder:
        mesh, ini, gcode = (Path(folder, name) for name in ("part.stl", "settings.ini", "part.gcode"))
        mesh.write_bytes(stl)
        ini.write_text(settings.ini)
        done = subprocess.run(
            [str(program()), "--load", str(ini), "--export-gcode", "--center", f"{BED / 2},{BED / 2}", "-o", str(gcode), str(mesh)],
            capture_output=True, text=True, check=False,
        )
        if not gcode.exists():
            raise NotSliced((done.stderr or done.stdout).strip()[:2000])
        return gcode.read_text()


def _shift(stl: bytes) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the position of the mesh's origin in the G-code (3,) [mm]. PrusaSlicer moves the mesh to the centre of the bed, with its
    bottom on the bed.
    """
    triangles = np.frombuffer(stl, offset=84, dtype=np.dtype([("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")]))
    corners = triangles["p"].reshape(-1, 3).astype(float)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return np.array([BED / 2 - (low[0] + high[0]) / 2, BED / 2 - (low[1] + high[1]) / 2, -low[2]])


def extrusions(lines: Iterable[str]) -> Iterator[tuple[float, float, float, float, float, float, str]]:
    """Yield each extruded line of G-code with relative extrusion. The items are x and y of both ends, z [mm], the volume [mm^3], and the
    kind of the line.
    """
    section = math.pi / 4 * FILAMENT**2
    x = y = z = 0.0
    kind = ""
    for line in lines:
        if line.startswith(";TYPE:"):
            kind = line[6:]
        if not line.startswith("G1 "):
            continue
        words = {word[0]: float(word[1:]) for word in line.partition(";")[0].split()[1:]}
        to_x, to_y, z = words.get("X", x), words.get("Y", y), words.get("Z", z)
        if words.get("E", 0.0) > 0.0 and (to_x, to_y) != (x, y):
            yield x, y, to_x, to_y, z, words["E"] * section, kind
        x, y = to_x, to_y


def _integrated(gcode: str, layer: float, shift: np.ndarray[Any, np.dtype[np.float64]]) -> Printed:
    """Integrate the extruded material. Each line is treated as a line of mass in the middle of its layer."""
    rows = list(extrusions(gcode.splitlines()))
    numbers = np.array([row[:6] for row in rows])
    middle = numbers[:, 4] - layer / 2
    a = np.stack([numbers[:, 0], numbers[:, 1], middle], axis=1) - shift
    b = np.stack([numbers[:, 2], numbers[:, 3], middle], axis=1) - shift
    volume = numbers[:, 5]
    centre = (volume[:, None] * (a + b)).sum(axis=0) / (2 * volume.sum())
    a, b = a - centre, b - centre
    second = np.einsum("i,ij,ik->jk", volume / 3, a, a) + np.einsum("i,ij,ik->jk", volume / 3, b, b)
    mixed = np.einsum("i,ij,ik->jk", volume / 6, a, b)
    second = second + mixed + mixed.T
    kinds: dict[str, float] = {}
    for row in rows:
        kinds[row[6]] = kinds.get(row[6], 0.0) + row[5]
    return Printed(
        volume=float(volume.sum()), centre=tuple(centre.tolist()),
        inertia=tuple(map(tuple, (np.trace(second) * np.eye(3) - second).tolist())), kinds=dict(sorted(kinds.items())),
    )
