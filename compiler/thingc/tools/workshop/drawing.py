"""Write `drawing/NAME_MATERIAL_x2.svg` for each manufactured part: a sheet (A3) with views, overall sizes, and tables of holes and mounts.
The PDF file `drawing/NAME.pdf` contains all sheets.

The views are in first-angle projection: the top view is below the front view, and the view from the left is to the right of it.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Collection, Iterator, Mapping
from itertools import count, product
from string import ascii_uppercase

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import dist
from thingc.base.pose import Pose, Vector, add_scaled, axis_name, cross, dot
from thingc.base.safe_text import html_text
from thingc.geometry.features import HOLE, CentreLine, Cylinder, Features
from thingc.geometry.service import GeometryService
from thingc.targets import Artifacts, EmitRequest
from thingc.tools.workshop.curves import VIEWS, Point, Views
from thingc.tools.workshop.manufactured_parts import ManufacturedPart, compute_parts
from thingc.tools.workshop.pdf import with_pdf
from thingc.tools.workshop.svg_page import Box, Placement, SvgPage

WIDTH, HEIGHT = 420.0, 297.0
"""The size of the sheet [mm]."""
PRINT_STYLE = (
    f"<style>@page {{ size: {WIDTH}mm {HEIGHT}mm; margin: 0 }} body {{ margin: 0 }} "
    f"img {{ display: block; width: {WIDTH}mm; height: {HEIGHT}mm }}</style>"
)
"""The style of the page from which the PDF file is printed, with one sheet on each page."""
FRAME, COLUMN, TITLE = 10.0, 118.0, 44.0
"""The width of the border, the width of the column with tables, and the height of the title block [mm]."""
GAP, WIDEST_GAP = 24.0, 46.0
"""The smallest and the largest distance between views [mm]."""
SCALES = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""The scales of drawings (ISO 5455). The last scale is used for all larger parts."""

CAPTIONS = {
    "front": "Front (x to the right, z up)", "top": "Top (x to the right, y up)", "left": "Left (y to the left, z up)",
    "isometric": "Isometric (not to scale)",
}
"""The names of the views, with the directions of the axes of the part."""


class PartGeometry(FrozenStruct):
    """The views and the features of a part, which the CAD kernel computes."""

    views: Views
    features: Features


class Hole(FrozenStruct):
    """Cylinders on one axis: a hole with its counterbores. `view` is the view along the axis, or None for other directions."""

    cylinders: tuple[Cylinder, ...]
    view: str | None


def emit(request: EmitRequest) -> Artifacts:
    """Write a sheet for each part that is not bought, and a PDF file with all sheets. Parts without a B-rep are export losses."""
    parts, losses = compute_parts(request, "drawing", lambda breps: _compute_geometry(request.geometry, breps))
    sheets = dict(sorted((f"drawing/{part.file_name()}.svg", sheet(part, geometry, request.assembly.name)) for part, geometry in parts))
    artifacts = Artifacts(files={**sheets}, losses=tuple(losses))
    images = [f'<img src="data:image/svg+xml;base64,{b64encode(svg).decode()}">' for svg in sheets.values()]
    page = "\n".join([f"<!DOCTYPE html><title>{html_text(request.assembly.name)}: drawings</title>", PRINT_STYLE, *images])
    return with_pdf(artifacts, "drawing", page.encode(), request.assembly) if images else artifacts


def _compute_geometry(geometry: GeometryService, breps: Collection[str]) -> dict[str, PartGeometry]:
    views, features = geometry.search("thingc.tools.kernel.views:views_of", breps, Views), geometry.features(breps)
    return {brep: PartGeometry(views=views[brep], features=features[brep]) for brep in breps}


def sheet(part: ManufacturedPart, geometry: PartGeometry, robot: str) -> bytes:
    """Return the content of the sheet of a part."""
    record = part.first.record
    assert record is not None and record.box is not None
    page = SvgPage(WIDTH, HEIGHT, f"{part.label} ({robot})")
    page.rectangle((FRAME, FRAME, WIDTH - FRAME, HEIGHT - FRAME), "frame")
    scale, places = _placements(record.box)
    for name in VIEWS:
        view = geometry.views.by_name[name]
        page.path(places[name].path(view.hidden), "hidden")
        page.path(places[name].path(view.visible), "visible")
    _add_sizes(page, record.box, places)
    holes = _holes(geometry.features)
    page.taken += [_hole_box(hole, places[hole.view]) for hole in holes if hole.view is not None]
    for index, hole in enumerate(holes, 1):
        if hole.view is not None:
            _add_hole(page, hole, str(index), places[hole.view])
    for letter, mount in zip(_mount_letters(), record.mounts.values()):
        z = _z_axis(mount.pose)
        name = max(("front", "top", "left"), key=lambda name: round(abs(dot(z, VIEWS[name][0])), 9))
        point = places[name].point(_project(mount.pose.translation, name))
        if _on_sheet(point):
            page.circle(point, 0.7, "solid")
            page.label(point, letter, 0.7, boxed=True)
    _add_tables(page, part, holes)
    _add_title(page, part, robot, scale)
    return page.content()


def _z_axis(pose: Pose) -> Vector:
    (_, _, x), (_, _, y), (_, _, z) = pose.rotation
    return x, y, z


def _project(point: Vector, view: str) -> Point:
    """Return the coordinates of a point in a view [m]."""
    toward, right = VIEWS[view]
    length = dot(right, right) ** 0.5
    up = cross(toward, right)
    return dot(point, right) / length, dot(point, up) / dot(up, up) ** 0.5


def _bounds(box: tuple[Vector, Vector], view: str) -> tuple[Point, Point]:
    corners = [_project((x, y, z), view) for x, y, z in product(*zip(*box, strict=True))]
    return (min(x for x, _ in corners), min(y for _, y in corners)), (max(x for x, _ in corners), max(y for _, y in corners))


def _placements(box: tuple[Vector, Vector]) -> tuple[float, dict[str, Placement]]:
    """Return the scale of the drawing and the places of its views. The isometric view has its own scale."""
    width, depth, height = (1e3 * (high - low) for low, high in zip(*box, strict=True))
    room_x, room_y = WIDTH - 2 * FRAME - COLUMN, HEIGHT - 2 * FRAME
    across, down = width + depth, height + depth
    scale = next((one for one in SCALES if one * across + 3 * GAP <= room_x and one * down + 3 * GAP <= room_y), SCALES[-1])
    gap_x, gap_y = (min(WIDEST_GAP, (room - scale * used) / 3) for room, used in ((room_x, across), (room_y, down)))
    x, y = FRAME + gap_x, FRAME + gap_y
    right, below = x + scale * width + gap_x, y + scale * height + gap_y
    corners = {"front": (x, y + scale * height), "top": (x, below + scale * depth), "left": (right, y + scale * height)}
    places = {}
    for name, (left, bottom) in corners.items():
        low, _ = _bounds(box, name)
        places[name] = Placement(1e3 * scale, (left - 1e3 * scale * low[0], bottom + 1e3 * scale * low[1]))
    end_x, end_y = FRAME + room_x - 6.0, FRAME + room_y - 6.0
    free_cells = ((right, below, end_x, end_y), (FRAME + 6.0, below + scale * depth + gap_y / 2, end_x, end_y))
    low, high = _bounds(box, "isometric")
    sizes = (high[0] - low[0], high[1] - low[1])
    cell_scales = [min((cell[2] - cell[0]) / sizes[0], (cell[3] - cell[1]) / sizes[1]) for cell in free_cells]
    cell = free_cells[cell_scales.index(max(cell_scales))]
    isometric_scale = min(0.9 * max(cell_scales), 1e3 * scale)
    middle = tuple((low[k] + high[k]) / 2.0 for k in (0, 1))
    origin = ((cell[0] + cell[2]) / 2.0 - isometric_scale * middle[0], (cell[1] + cell[3]) / 2.0 + isometric_scale * middle[1])
    return scale, {**places, "isometric": Placement(isometric_scale, origin)}


def _on_sheet(point: Point) -> bool:
    """Return whether a point is beside the tables. Mounts and the origin can be far away from the part."""
    return FRAME < point[0] < WIDTH - FRAME - COLUMN and FRAME < point[1] < HEIGHT - FRAME


def _add_sizes(page: SvgPage, box: tuple[Vector, Vector], places: Mapping[str, Placement]) -> None:
    """Add the overall sizes and the names of the views."""
    sizes = [f"{round(1e3 * (high - low), 2):g}" for low, high in zip(*box, strict=True)]
    for name, size in (("front", sizes[0]), ("left", sizes[1]), ("top", None), ("isometric", None)):
        low, high = (places[name].point(point) for point in _bounds(box, name))
        page.text((low[0], low[1] + 5.0), CAPTIONS[name], "small")
        if name != "isometric" and _on_sheet(places[name].origin):
            page.origin(places[name].origin)
        if size is not None:
            page.dimension((low[0], high[1]), high, -9.0, size)
        if name == "front":
            page.dimension(low, (low[0], high[1]), -9.0, sizes[2])


def _holes(features: Features) -> list[Hole]:
    """Return the holes, grouped by axis: first those along z, then along y and x, and then the others."""
    axes: list[list[Cylinder]] = []
    for one in features.cylinders:
        if one.hollow and one.sweep >= HOLE:
            group = next((group for group in axes if _same_line(one.line, group[0].line)), None)
            if group is None:
                axes.append(group := [])
            group.append(one)
    names = ("top", "front", "left", None)
    holes = [Hole(cylinders=tuple(sorted(group, key=lambda one: one.radius)), view=_view_along(group[0].line.axis)) for group in axes]
    return sorted(holes, key=lambda hole: names.index(hole.view))


def _view_along(axis: Vector) -> str | None:
    return next((name for name in ("top", "front", "left") if abs(dot(axis, VIEWS[name][0])) > 1.0 - 1e-9), None)


def _same_line(one: CentreLine, other: CentreLine) -> bool:
    return dist(one.axis, other.axis) < 1e-6 and dist(one.point, other.point) < 1e-7


def _add_hole(page: SvgPage, hole: Hole, label: str, place: Placement) -> None:
    assert hole.view is not None
    x, y, right, bottom = _hole_box(hole, place)
    centre = ((x + right) / 2.0, (y + bottom) / 2.0)
    page.line((x - 1.5, centre[1]), (right + 1.5, centre[1]), kind="centre")
    page.line((centre[0], y - 1.5), (centre[0], bottom + 1.5), kind="centre")
    page.label(centre, label, (right - x) / 2.0, boxed=False)


def _hole_box(hole: Hole, place: Placement) -> Box:
    """Return the box around the widest circle of a hole on the page."""
    assert hole.view is not None
    x, y = place.point(_project(hole.cylinders[0].line.point, hole.view))
    radius = place.scale * hole.cylinders[-1].radius
    return x - radius, y - radius, x + radius, y + radius


def _mount_letters() -> Iterator[str]:
    """Yield A, B and so on to Z, and then A1, B1 and so on."""
    return (letter + (str(turn) if turn else "") for turn in count() for letter in ascii_uppercase)


def _add_tables(page: SvgPage, part: ManufacturedPart, holes: list[Hole]) -> None:
    record = part.first.record
    assert record is not None
    left, right, top, bottom = WIDTH - FRAME - COLUMN, WIDTH - FRAME, FRAME + 6.0, HEIGHT - FRAME - TITLE
    page.line((left, FRAME), (left, HEIGHT - FRAME), kind="frame")
    rows = [("Hole", "⌀", "x", "y", "z", "depth")]
    for index, hole in enumerate(holes, 1):
        rows += [(str(index), _mm(2.0 * one.radius), *_coordinate_texts(one), _depth(one, hole)) for one in hole.cylinders]
    mounts: list[tuple[str, ...]] = [("Mount", "name", "x", "y", "z", "direction")]
    for letter, (name, mount) in zip(_mount_letters(), record.mounts.items()):
        mounts.append((letter, name, *map(_mm, mount.pose.translation), _direction(_z_axis(mount.pose))))
    share = (bottom - top - 14.0) / (len(rows) + len(mounts))
    page.text((left + 2.0, top), "Holes [mm], from the origin of the part", "head")
    top = page.table((left + 1.0, top + 1.0), (10.0, 13.0, 26.0, 26.0, 26.0, 15.0), rows, top + 1.0 + share * len(rows))
    page.text((left + 2.0, top + 7.0), "Mounts [mm]: datums, with the direction out of the part", "head")
    page.table((left + 1.0, top + 8.0), (11.0, 40.0, 16.0, 16.0, 16.0, 17.0), mounts, bottom)
    page.line((left, bottom), (right, bottom), kind="frame")


def _coordinate_texts(cylinder: Cylinder) -> tuple[str, str, str]:
    """Format the coordinates of a hole. The coordinate along its axis is a range."""
    low, high = (add_scaled(cylinder.line.point, cylinder.line.axis, end) for end in (cylinder.lower, cylinder.upper))
    x, y, z = (_mm(a) if abs(a - b) < 1e-9 else f"{_mm(min(a, b))} to {_mm(max(a, b))}" for a, b in zip(low, high, strict=True))
    return x, y, z


def _depth(cylinder: Cylinder, hole: Hole) -> str:
    """Format the depth of a hole. A hole that ends at a narrower hole is a counterbore, which has a depth."""
    ends = {round(end, 7) for one in hole.cylinders if one.radius < cylinder.radius for end in (one.lower, one.upper)}
    is_counterbore = bool(ends & {round(cylinder.lower, 7), round(cylinder.upper, 7)})
    return "through" if cylinder.through and not is_counterbore else _mm(cylinder.upper - cylinder.lower)


def _direction(axis: Vector) -> str:
    return axis_name(axis) or " ".join(f"{round(value, 3) + 0.0:g}" for value in axis)


def _mm(length: float) -> str:
    return f"{round(1e3 * length, 3) + 0.0:.7g}"


def _add_title(page: SvgPage, part: ManufacturedPart, robot: str, scale: float) -> None:
    left, top = WIDTH - FRAME - COLUMN, HEIGHT - FRAME - TITLE
    mass = part.first.properties.mass
    cells = [
        ("Material", part.material or "not specified"), ("Mass", f"{1e3 * mass:.4g} g"), ("Quantity", str(part.quantity)),
        ("Scale", f"{scale:g} : 1" if scale >= 1.0 else f"1 : {1.0 / scale:g}"), ("Unit", "mm"), ("Robot", robot),
    ]
    page.text((left + 2.0, top + 3.5), "Part", "small")
    page.text((left + 2.0, top + 9.5), part.label, "large head")
    page.text((left + 2.0, top + 13.5), part.first.definition.label, "small")
    for index, (name, value) in enumerate(cells):
        x, y = left + COLUMN / 3.0 * (index % 3), top + 15.0 + 10.0 * (index // 3)
        page.rectangle((x, y, x + COLUMN / 3.0, y + 10.0))
        page.text((x + 2.0, y + 3.2), name, "small")
        page.text((x + 2.0, y + 8.0), value)
    y = top + 39.5
    page.text((left + 2.0, y + 1.0), "First-angle projection (ISO 128). Hidden edges are dashed.", "small")
    x = left + COLUMN - 22.0  # the symbol of the projection: a cone from the side, and from its small end
    page.line((x, y - 1.2), (x + 7.0, y - 2.4), (x + 7.0, y + 2.4), (x, y + 1.2), (x, y - 1.2))
    page.circle((x + 13.0, y), 2.4)
    page.circle((x + 13.0, y), 1.2)
