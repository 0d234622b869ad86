"""`make pictures`: the reference geometry of stock parts, drawn by the renderer of `thingc render`.

Each picture shows a part from one or two sides. Reference solids are blue, and screws are orange. Some solids are drawn beside the part.
"""

from __future__ import annotations

import io
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from PIL import Image

from thingc.base.pose import Pose
from thingc.targets.render.frames import Mark, frame_mark
from thingc.targets.render.picture import Shot, picture, ready

WIDTH, HEIGHT = 560, 440


class Item(NamedTuple):
    """A named solid: a Python expression of `part`, drawn at an offset [mm] from its place."""

    name: str
    solids: str
    color: str = "blue"
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


class View(NamedTuple):
    """One side of a part: azimuth and elevation of the camera [deg], and the solids that it shows."""

    azimuth: float
    elevation: float
    items: tuple[Item, ...]


def screws(name: str, thickness: float = 3.0) -> Item:
    """Return the screws in a list of holes, through a plate of this thickness [mm]."""
    return Item(name, f"[hole({thickness:g}).body_hull for hole in part.{name}]", "orange")


PICTURES: dict[str, tuple[str, tuple[View, ...]]] = {
    "stock_dynamixel.png": ("thingc_stock.dynamixel:XM430", (
        View(230, -28, (
            screws("screws_horn", 5), screws("screws_left"), screws("screws_front"), screws("screws_top"),
            Item("boss_hull(8)", "part.boss_hull(8)"),
        )),
        View(50, 20, (
            screws("screws_idler", 5), screws("screws_right"), screws("screws_bottom"), Item("idler_hull(8)", "part.idler_hull(8)"),
            Item("case_hull()", "part.case_hull()", "blue", (-65, 0, 0)),
        )),
    )),
    "stock_bus_servos.png": ("thingc_stock.bus_servos:STS3215", (
        View(230, -28, (screws("screws_horn"), Item("case_hull()", "part.case_hull()", "blue", (55, 0, 0)))),
    )),
    "stock_servos.png": ("thingc_stock.servos:MG90S", (
        View(230, -24, (
            Item("case_hull()", "part.case_hull()", "blue", (30, 0, 0)), Item("pocket(6)", "part.pocket(6)", "blue", (-30, 0, 0)),
            Item("screws(1.8, 6)", "part.screws(1.8, 6)", "orange", (-30, 0, 0)),
        )),
    )),
    "stock_motors.png": ("thingc_stock.motors:Nema17", (View(230, -24, (screws("threads"),)),)),
    "stock_bearings.png": ("thingc_stock.bearings:Bearing", (View(230, -24, (Item("seat(8)", "part.seat(8)", "blue", (30, 0, 0)),)),)),
    "stock_fasteners.png": ("thingc_stock.fasteners:Screw", (
        View(230, -30, tuple(
            Item(name, f"part.{name}", "blue", (12.0 * (k + 1), 0, 0))
            for k, name in enumerate(("body_hull", "clearance_hull", "tapped_hull", "thread_hull"))
        )),
    )),
    "stock_magnets.png": ("thingc_stock.magnets:HoldingMagnet", (
        View(230, -28, (screws("screws_back"), Item("hull()", "part.hull()", "blue", (65, 0, 0)))),
    )),
    "stock_cells.png": ("thingc_stock.cells:CellTray", (
        View(230, -34, (
            Item("fixing(0, 6)", "part.fixing(0, 6).body_hull", "orange"), Item("fixing(1, 6)", "part.fixing(1, 6).body_hull", "orange"),
            Item("envelope()", "part.envelope()", "blue", (0, 90, 0)),
        )),
    )),
}
"""File names, with the part and its views."""

MATERIALS = """thingc: materials/1
materials:
  blue: {density: 1000 kg/m^3, color: "#3a78c3"}
  orange: {density: 1000 kg/m^3, color: "#e8792b"}
"""


def write(folder: Path) -> None:
    """Write all pictures to a folder."""
    ready()
    for name, (reference, views) in PICTURES.items():
        whole = Image.new("RGB", (WIDTH * len(views), HEIGHT))
        for index, view in enumerate(views):
            whole.paste(_drawn(reference, view), (index * WIDTH, 0))
        whole.quantize(128, kmeans=3, dither=Image.Dither.NONE).save(folder / name, optimize=True)


def _drawn(reference: str, view: View) -> Image.Image:
    """Return a part with its reference solids, built in a workspace of its own."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_workspace(folder, reference, view.items)
        command = [sys.executable, "-m", "thingc", "build", "stock.yaml", "--emit", "mjcf"]
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        command = [sys.executable, str(folder / "parts/reference.py")]
        centres = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
        built = folder / "build/stock/mjcf"
        png = picture(
            (built / "stock_still.xml").read_text(), {path.name: path.read_bytes() for path in (built / "assets").iterdir()}, pose=None,
            gravity=(0.0, 0.0, -9.81), marks=[_name(view, *one) for one in zip(view.items, centres, strict=True)],
            shot=Shot(size=(WIDTH, HEIGHT), azimuth=view.azimuth, elevation=view.elevation),
        )
    with Image.open(io.BytesIO(png)) as image:
        return image.convert("RGB")


def _write_workspace(folder: Path, reference: str, items: Sequence[Item]) -> None:
    module, _, part = reference.partition(":")
    (folder / "parts").mkdir()
    (folder / "parts/reference.py").write_text("\n\n".join((
        f"import json\n\nfrom build123d import Compound, Solid\nfrom {module} import {part}\n\npart = {part}()",
        "def shape(solids):\n    return Compound([solids] if isinstance(solids, Solid) else solids)",
        *(f"def solid_{k}():\n    return shape({item.solids})" for k, item in enumerate(items)),
        f"if __name__ == '__main__':\n    shapes = [{', '.join(f'solid_{k}()' for k in range(len(items)))}]\n"
        "    print(json.dumps([[list(solid.bounding_box().center()) for solid in one.solids()] for one in shapes]))\n",
    )))
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "colors.yaml").write_text(MATERIALS)
    lines = [
        f"  solid_{k}: {{part: 'reference:solid_{k}', material: {item.color}, at: {{in: part.origin, xyz: {x:g} {y:g} {z:g} mm}}}}"
        for k, item in enumerate(items) for x, y, z in [item.offset]
    ]
    (folder / "stock.yaml").write_text("\n".join((
        "thingc: assembly/1", "name: stock", "materials: [colors.yaml, thingc_stock.materials]", "components:",
        f"  part: {{part: '{reference}'}}", *lines, "modes:", "  still: {root: part, base: fixed, at: {xyz: 0 0 1 m}}", "",
    )))


def _name(view: View, item: Item, centres: Sequence[Sequence[float]]) -> Mark:
    """Return the name of an item, with a dot in the solid that is nearest to the camera, from the centres of its solids [mm]."""
    azimuth, elevation = math.radians(view.azimuth), math.radians(view.elevation)
    camera = (-math.cos(azimuth) * math.cos(elevation), -math.sin(azimuth) * math.cos(elevation), -math.sin(elevation))
    x, y, z = max(centres, key=lambda centre: sum(a * b for a, b in zip(centre, camera, strict=True)))
    dx, dy, dz = item.offset
    place = Pose(translation=((x + dx) / 1000.0, (y + dy) / 1000.0, (z + dz) / 1000.0))
    return frame_mark(label=item.name, body="part", pose=place, size=0.0)
