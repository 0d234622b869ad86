"""Slice a part into printed layers, and sum the material of the layers, in a child process of the worker. Lengths are in mm.

The module implements the method of PrusaSlicer 2.5, with regions instead of paths. Names of PrusaSlicer's settings and functions are in
brackets. If a document does not set a value, the default of PrusaSlicer applies.

A line of width w in a layer of height h is a rectangle with semicircular ends. The cross section is s h, with s = w - h (1 - pi/4) [Flow].
Infill lines have the spacing s. The walls are the given number of lines inside the outline. The region inside the walls is called the core
if it is at least one line wide. Narrower regions are added to the walls [perimeter_generator = arachne].

The core is filled, and the infill overlaps the walls [infill_overlap]. Regions that are open above or below are solid, with a margin of 3
mm. Pieces of a layer with less than 70 mm^2 are also solid [solid_infill_below_area]. Regions are also solid if an opening is at most `top`
layers above them or at most `bottom` layers below them [discover_horizontal_shells]. Pieces of these regions that are narrower than 6 lines
are widened. The remaining regions of the core are sparse.

Material over air or over sparse infill is printed as a bridge. A bridge consists of round strands that are as thick as the nozzle, with
gaps of 0.05 mm [thick_bridges]. Wall lines that extend beyond the layer below by half a nozzle are overhangs [overhangs]. Lines of sparse
infill end half a line from the border of the sparse region, and are connected along this border (see `JOINED`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from manifold3d import CrossSection, Error, JoinType, Manifold, Mesh64, OpType
from msgspec import to_builtins

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.print_slices import Moments, SliceFailure, SliceResult, Slicing
from thingc.geometry.print_support import PrintSolid
from thingc.geometry.store.local import Store
from thingc.geometry.store.meshes import exact_arrays
from thingc.geometry.worker.kernel.meshing import Triangles

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_LAYERS = 20_000
"""Maximum number of layers of a part. If a part has more layers, the unit of the layer height is probably wrong."""

NOZZLE = 1.0 / 1.125
"""Default diameter of the nozzle, relative to the width of a line (PrusaSlicer: `auto_extrusion_width`)."""
SOLID_BELOW = 70.0
"""Pieces of infill with at most this area [mm^2] are always solid (PrusaSlicer: `solid_infill_below_area`)."""
AROUND = 3.0
"""Width [mm] of the solid margin around open surfaces (PrusaSlicer: `EXTERNAL_INFILL_MARGIN`)."""
STRAND_GAP = 0.05
"""Gap [mm] between two strands of a bridge (PrusaSlicer: `BRIDGE_EXTRA_SPACING`)."""
FILLABLE = 0.6
"""Smallest width of a core that gets infill, relative to the line spacing (PrusaSlicer: `INSET_OVERLAP_TOLERANCE`)."""
ANCHOR = 3.0
"""Half of the smallest width of a bridge over sparse infill, relative to the width of a strand (PrusaSlicer: `bridge_over_infill`)."""
SAFETY = 1e-5
"""Additional width [mm] of regions that are removed, because slivers that result from rounding would be widened (PrusaSlicer:
`ClipperSafetyOffset`).
"""

JOINED = 0.32
"""Fraction of the border of sparse infill along which infill lines are connected.

Three families of parallel infill lines end at the border (PrusaSlicer: `fill_pattern = stars`). If the ends of two neighbouring lines are
both free, PrusaSlicer connects them, the shortest gap first (`connect_infill`). The value is the mean over all directions of the border,
computed by `benchmarks/prints/joined.py`.
"""

_UPRIGHT = 1e-6
"""A wall counts as vertical if the z component of its unit normal is at most this value."""
_EXACT = 1e-5
"""Heights count as equal if they differ by less than this value [mm]."""
_JUST_BELOW = 1e-3
"""Offset of a cutting plane, relative to the height of a layer. With this offset, a surface exactly in the cutting plane belongs to the
part above the plane.
"""
_SIMPLE = 1e-3
"""Largest deviation [mm] of a simplified outline from the cut through the mesh."""

Region: TypeAlias = CrossSection
NOTHING = CrossSection()


class NotSliced(Exception):
    """Raised if a part cannot be sliced. Messages append the reason to the name of the part."""


def slice_stored(sha256: str, slicing: Slicing, store: Store) -> dict[str, Any]:
    """Slice a mesh in the store, whose coordinates are 64-bit floats [mm]. Return a `SliceResult` or a `SliceFailure` as a JSON value."""
    try:
        result: SliceResult | SliceFailure = slice_part(Triangles(*exact_arrays(store.read(sha256))), slicing)
    except NotSliced as fault:
        result = SliceFailure(reason=str(fault))
    plain: dict[str, Any] = to_builtins(result)
    return plain


def slice_part(mesh: Triangles, slicing: Slicing) -> SliceResult:
    """Slice a closed mesh [mm], and compute the material of the printed part. Raises `NotSliced` if the part cannot be sliced."""
    turn = _turned_up(PrintSolid(mesh.vertices, mesh.faces).least_support()[0] if slicing.up == "auto" else slicing.up)
    vertices = np.ascontiguousarray(mesh.vertices @ turn.T)
    lengths = _Lengths(slicing)
    outlines, heights = _outlines(vertices, mesh.faces, lengths.layer)
    flat = _flat(_Slicer(slicing, lengths).layers(outlines), JOINED * lengths.spacing)
    total = _integrate_layers(flat, heights, lengths.layer).sum(axis=0)
    solid, joins, sparse = (_moments(sums, turn) for sums in total)
    if not solid.volume > 0.0:
        raise NotSliced("the part is thinner than one printed line")
    return SliceResult(solid=solid, joins=joins, sparse=sparse)


def _turned_up(up: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return a rotation `(3, 3)` that rotates `up` to z. If `up` is already z, the result is the identity."""
    z = np.array(up, dtype=np.float64)
    z /= np.linalg.norm(z)
    least = np.eye(3)[int(np.argmin(np.abs(z)))]
    y = np.cross(z, least)
    y /= np.linalg.norm(y)
    return np.stack([np.cross(y, z), y, z])


# --- outlines ---------------------------------------------------------------------------------------------------------


def _outlines(vertices: NDArray[np.float64], faces: NDArray[np.int64], layer: float) -> tuple[list[Region], NDArray[np.float64]]:
    """Cut a mesh with a plane in the middle of each layer, from the print bed upwards. Return the outlines of the cuts, and the heights
    (n,) of the cutting planes.

    Equal cuts between vertical walls are represented by the same object.
    """
    solid = Manifold(Mesh64(vertices, np.ascontiguousarray(faces, dtype=np.uint64)))
    if solid.status() != Error.NoError or solid.is_empty():
        raise NotSliced("the mesh is not closed")
    bed, top = float(vertices[:, 2].min()), float(vertices[:, 2].max())
    count = math.ceil((top - bed - _EXACT) / layer - 0.5)  # PrusaSlicer stops where the middle of a layer is above the part
    if count < 1:
        raise NotSliced("the part is lower than one layer")
    if count > MOST_LAYERS:
        raise NotSliced(f"the part has more than {MOST_LAYERS} layers")
    middles = np.asarray(bed + layer * (np.arange(count) + 0.5), dtype=np.float64)
    cuts = middles - _JUST_BELOW * layer
    known: dict[int, Region] = {}
    outlines: list[Region] = []
    for cut, slab in zip(cuts.tolist(), _slabs(vertices, faces, cuts).tolist(), strict=True):
        if slab not in known:
            known[slab] = solid.slice(cut).simplify(_SIMPLE)
        outlines.append(known[slab])
    return outlines, middles


def _slabs(vertices: NDArray[np.float64], faces: NDArray[np.int64], cuts: NDArray[np.float64]) -> NDArray[np.int64]:
    """Assign a number to each cut through the mesh. Cuts with the same number have equal outlines.

    Two cuts are equal if all walls between them are vertical and no surface begins between them.
    """
    corners = vertices[faces]
    heights = np.round(corners[:, :, 2] / _EXACT) * _EXACT
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    leaning = (np.abs(normal[:, 2]) > _UPRIGHT * length) & (length > 0.0)
    levels = np.unique(heights)
    begins = np.searchsorted(levels, heights[leaning].min(axis=1))
    ends = np.searchsorted(levels, heights[leaning].max(axis=1))
    change = np.zeros(len(levels) + 1, dtype=np.int64)
    np.add.at(change, begins, 1)
    np.add.at(change, ends, -1)
    upright = np.cumsum(change) == 0  # values for the slab above each level
    slab = np.searchsorted(levels, cuts, side="right") - 1
    return np.where(upright[slab], slab, len(levels) + np.arange(len(cuts)))


# --- layers -----------------------------------------------------------------------------------------------------------


class _Lengths:
    """The lengths [mm] that the print settings define, such as line widths.

    `bridge` (for infill) and `overhang` (for walls) are the amounts of material of a bridge, relative to the region that it covers.
    """

    def __init__(self, how: Slicing) -> None:
        self.layer = how.layer * 1e3
        self.width = how.line_width * 1e3
        self.spacing = self.width - self.layer * (1.0 - math.pi / 4.0)
        if not self.spacing > 0.0:
            raise NotSliced("the layer height is too large for the line width")
        self.nozzle = self.width * NOZZLE
        self.strand = self.nozzle * math.sqrt(how.bridge_flow)
        section = math.pi / 4.0 * self.strand**2
        self.bridge = section / ((self.strand + STRAND_GAP) * self.layer)
        self.overhang = section / (self.spacing * self.layer)
        self.rounding = (self.width - self.spacing) / 2.0
        self.spanned = math.floor(self.strand / self.layer + _EXACT)  # number of layers that a strand passes through


class _Slicer:
    """Computes the material of layers from the outlines of the layers. All methods are pure functions of regions. If layers are equal,
    their material is computed only once.
    """

    def __init__(self, how: Slicing, lengths: _Lengths) -> None:
        self.how = how
        self.lengths = lengths
        self.cached = _RegionCache()

    def layers(self, outlines: list[Region]) -> list[_LayerMaterial]:
        """Return the printed material of each layer."""
        cached = self.cached
        above = [*outlines[1:], NOTHING]
        below = [NOTHING, *outlines[:-1]]
        cores = [cached(self.core, outline) for outline in outlines]
        filled = [cached(self.infill_region, core) for core in cores]
        bottoms = [cached(self.opening, *pair) for pair in zip(outlines, below, strict=True)]
        tops = [cached(self.uncovered_region, *both) for both in zip(outlines, above, bottoms, strict=True)]
        kinds = [cached(self.kinds, *three) for three in zip(filled, tops, bottoms, strict=True)]
        lids = [cached(_either, top, kind.top) for top, kind in zip(tops, kinds, strict=True)]
        floors = [cached(_either, bottom, kind.bottom) for bottom, kind in zip(bottoms, kinds, strict=True)]
        solid = [
            cached(
                self.shells, kind.inside, kind.small,
                *(lid for lid in lids[index + 1 : index + self.how.top] if not lid.is_empty()),
                *(floor for floor in floors[max(0, index + 1 - self.how.bottom) : index] if not floor.is_empty()),
            )
            for index, kind in enumerate(kinds)
        ]
        sparse = [cached(_subtract, kind.inside, one) for kind, one in zip(kinds, solid, strict=True)]
        walls = [cached(self.walls, outline, core) for outline, core in zip(outlines, cores, strict=True)]
        return [
            cached(
                self.layer_material, walls[index], inside, kind, sparse[index], below[index] if index else None,
                *sparse[max(0, index - self.lengths.spanned) : index],
            )
            for index, (kind, inside) in enumerate(zip(kinds, solid, strict=True))
        ]

    def core(self, outline: Region) -> Region:
        """Return the region inside the walls of a layer. Parts of this region that are narrower than a line are removed."""
        lengths = self.lengths
        inside = _grow(outline, -(lengths.rounding + self.how.walls * lengths.spacing))
        return _remove_narrow(inside, lengths.spacing / 2.0)

    def walls(self, outline: Region, core: Region) -> Region:
        """Return the region that the walls cover. The region is smaller than the outline, because lines have round corners."""
        return _subtract(_grow(outline, -self.lengths.rounding), core)

    def infill_region(self, core: Region) -> Region:
        """Return the region that infill may cover: the parts of the core that are wide enough, with the overlap into the walls."""
        half = FILLABLE / 2.0 * self.lengths.spacing
        return _grow(_grow(core, -half), half + self.how.overlap * self.lengths.spacing)

    def opening(self, outline: Region, other: Region) -> Region:
        """Return the part of a layer that another layer does not cover. Very narrow pieces of this part are removed."""
        return _remove_narrow(_subtract(outline, other), self.lengths.width / 10.0)

    def uncovered_region(self, outline: Region, above: Region, bottom: Region) -> Region:
        """Return the region of a layer that the layer above does not cover. A region that is open above and below counts as bottom."""
        return _subtract(self.opening(outline, above), bottom)

    def kinds(self, filled: Region, top: Region, bottom: Region) -> _InfillRegions:
        """Return the infill regions of a layer, grouped by kind."""
        within = _subtract(_subtract(filled, top), bottom)
        wide_bottom = self.solid_around(bottom, filled)
        wide_top = _subtract(self.solid_around(top, filled), wide_bottom)
        open_somewhere = _either(wide_bottom, wide_top)
        small = [piece for piece in within.decompose() if piece.area() <= SOLID_BELOW]
        return _InfillRegions(
            top=wide_top, bottom=wide_bottom, inside=_subtract(within, open_somewhere),
            small=_subtract(CrossSection.compose(small), open_somewhere) if small else NOTHING,
        )

    def solid_around(self, opening: Region, filled: Region) -> Region:
        """Return the region that is solid because of an opening. The solid region consists of the opening and a margin around it."""
        inside = _both(opening, filled)
        if inside.is_empty():
            return NOTHING
        outside = self.opening(filled, inside)
        if outside.is_empty():
            return filled
        x, y, u, v = outside.bounds()
        box = CrossSection.square((u - x + 4.0 * AROUND, v - y + 4.0 * AROUND)).translate((x - 2.0 * AROUND, y - 2.0 * AROUND))
        return _either(inside, _both(_grow(_both(inside, box), AROUND, JoinType.Square), filled))  # growing the whole layer is slow

    def shells(self, inside: Region, small: Region, *lids: Region) -> Region:
        """Return the inner region of a layer that is printed solid. The solid region consists of small pieces, and of the regions below or
        above the lids.
        """
        regions = [small]
        for lid in lids:
            regions += self.cached(self.shell, inside, lid)
        return CrossSection.batch_boolean(regions, OpType.Add) if len(regions) > 1 else small

    def shell(self, inside: Region, lid: Region) -> tuple[Region, Region]:
        """Return the part of the inner region that is below or above a lid.

        If this part is too narrow to print, it is widened. Also return the region that was added.
        """
        new = _both(lid, inside)
        if new.is_empty():
            return NOTHING, NOTHING
        margin = 3.0 * self.lengths.width
        narrow = _subtract(new, _grow(_grow(new, -margin, miter=5.0), margin + SAFETY, miter=5.0))
        return new, _both(_grow(narrow, margin, JoinType.Round), inside)

    def bridge(self, solid: Region, *below: Region) -> Region:
        """Return the region of a layer that is printed as a bridge: the solid inner region above sparse infill.

        In this region, all layers through which the strands of the bridge pass must be sparse.
        """
        above_sparse = solid
        for sparse in below:
            above_sparse = _both(above_sparse, sparse)
        return _both(_remove_narrow(above_sparse, ANCHOR * self.lengths.strand), solid) if below else NOTHING

    def overhang(self, walls: Region, below: Region) -> Region:
        """Return the part of the walls of a layer that the layer below does not support."""
        return _subtract(walls, _grow(below, self.lengths.nozzle / 2.0))

    def layer_material(
        self, walls: Region, inside: Region, kind: _InfillRegions, sparse: Region, below: Region | None, *spanned: Region,
    ) -> _LayerMaterial:
        """Return the printed material of a layer.

        `below` is the outline of the layer below, or None above the print bed. `spanned` contains the sparse regions of the layers through
        which the strands of a bridge pass.
        """
        cached, lengths = self.cached, self.lengths
        lines = _grow(sparse, -lengths.spacing / 2.0)  # the region of the lines of sparse infill
        if below is None:
            return _LayerMaterial(solid=((1.0, walls), (1.0, inside), (1.0, kind.top), (1.0, kind.bottom)), lines=lines)
        overhang, bridge = cached(self.overhang, walls, below), cached(self.bridge, inside, *spanned)
        return _LayerMaterial(lines=lines, solid=(
            (1.0, walls), (1.0, inside), (1.0, kind.top), (lengths.bridge, kind.bottom),
            (lengths.overhang - 1.0, overhang), (lengths.bridge - 1.0, bridge),
        ))


class _InfillRegions(FrozenStruct):
    """The infill regions of a layer by kind. The kinds are the regions that are open above or below (with their margins), the inner region,
    and its small pieces.
    """

    top: Region
    bottom: Region
    inside: Region
    small: Region


class _LayerMaterial(FrozenStruct):
    """The printed material of one layer.

    `solid` contains regions, each with the amount of material relative to a region that is completely filled. `lines` is the region that
    contains sparse infill lines.
    """

    solid: tuple[tuple[float, Region], ...]
    lines: Region


class _RegionCache:
    """A cache for pure functions. The cache keys are the identities of the arguments. The cache also stores references to the arguments, so
    that their identities remain valid.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], tuple[tuple[Any, ...], Any]] = {}

    def __call__(self, function: Callable[..., Any], *regions: Any) -> Any:
        key = (function, *map(id, regions))
        if key not in self._known:
            self._known[key] = (regions, function(*regions))
        return self._known[key][1]


# --- regions ----------------------------------------------------------------------------------------------------------


def _some(region: Region) -> Region:
    """Return a region unchanged, except for an empty region. For every empty region, return the same object, so that results for empty
    regions are cached.
    """
    return NOTHING if region.is_empty() else region


def _grow(region: Region, by: float, join: JoinType = JoinType.Miter, miter: float = 2.0) -> Region:
    """Grow a region by a border of width `by`, or shrink it if `by` is negative."""
    if region.is_empty() or by == 0.0:
        return region
    if by < 0.0:
        x, y, u, v = region.bounds()
        if min(u - x, v - y) <= -2.0 * by:  # the result is empty, and computing it is slow
            return NOTHING
    return _some(region.offset(by, join, miter, 8))


def _remove_narrow(region: Region, by: float) -> Region:
    """Remove the parts of a region that are narrower than twice `by`."""
    return _grow(_grow(region, -by), by)


def _both(a: Region, b: Region) -> Region:
    return _some(a ^ b) if not (a.is_empty() or b.is_empty()) else NOTHING


def _either(a: Region, b: Region) -> Region:
    return a + b if not (a.is_empty() or b.is_empty()) else b if a.is_empty() else a


def _subtract(a: Region, b: Region) -> Region:
    if a is b:
        return NOTHING
    return _some(a - b) if not (a.is_empty() or b.is_empty()) else a


# --- moments ----------------------------------------------------------------------------------------------------------

_RAISED = (0, 1, 2, 0, 3, 4, 5, 1, 2, 0)
"""Index of the moment of a plane region for each moment of a layer (see `_integrate_layers`)."""
_ROUNDING = 1e-12
"""Numbers up to this value, relative to the size of the part, count as rounding errors."""


_Integrals: TypeAlias = "dict[int, NDArray[np.float64]]"
"""A cache of integrals over regions. For each region (by identity), it contains the integrals of 1, x, y, xx, xy and yy as an array (6,).
If a region is missing, its integrals are zero.
"""


def _flat(layers: list[_LayerMaterial], join_width: float) -> NDArray[np.float64]:
    """Compute the integrals of 1, x, y, xx, xy and yy over the material of each layer, as an array (n, 3, 6).

    The second axis contains solid material, joins and sparse lines at 100 % infill. Joins are `join_width` [mm] wide, along the border of
    the lines.
    """
    every = [region for layer in layers for region in (layer.lines, *(region for _, region in layer.solid))]
    areas, borders = _integrals(every, border=False), _integrals([layer.lines for layer in layers], border=True)
    nothing = np.zeros(6)
    flat = np.zeros((len(layers), 3, 6))
    for layer, of_layer in zip(layers, flat, strict=True):
        for factor, region in layer.solid:
            of_layer[0] += factor * areas.get(id(region), nothing)
        of_layer[1] = join_width * borders.get(id(layer.lines), nothing)
        of_layer[2] = areas.get(id(layer.lines), nothing)
    return flat


def _integrals(regions: list[Region], *, border: bool) -> _Integrals:
    """Compute integrals over the areas of regions. If `border` is True, compute line integrals along their boundaries instead.

    The integrals of all regions are computed at once, by applying Green's theorem to their edges.
    """
    distinct = [region for region in {id(region): region for region in regions}.values() if not region.is_empty()]
    if not distinct:
        return {}
    rings = [[np.asarray(ring, dtype=np.float64) for ring in region.to_polygons()] for region in distinct]
    corners = np.concatenate([ring for some in rings for ring in some])
    ends = np.cumsum([len(ring) for some in rings for ring in some])
    following = np.arange(1, len(corners) + 1)
    following[ends - 1] = [0, *ends[:-1]]
    (x, y), (u, v) = corners.T, corners[following].T
    weight, divisors = (np.hypot(u - x, v - y), (1, 2, 2, 3, 6, 3)) if border else (x * v - u * y, (2, 6, 6, 12, 24, 12))
    terms = weight * np.stack([
        np.ones(len(x)), x + u, y + v, x * x + x * u + u * u, 2.0 * x * y + x * v + u * y + 2.0 * u * v, y * y + y * v + v * v,
    ])
    sizes = [sum(map(len, some)) for some in rings]
    sums = np.add.reduceat(terms, np.cumsum([0, *sizes[:-1]]), axis=1).T / divisors
    return {id(region): some for region, some in zip(distinct, sums, strict=True)}


def _integrate_layers(flat: NDArray[np.float64], middles: NDArray[np.float64], layer: float) -> NDArray[np.float64]:
    """Compute the volume integrals of 1, x, y, z, xx, xy, yy, xz, yz and zz over each layer, as an array (n, 3, 10).

    `flat` contains the area integrals of the layers (n, 3, 6), and `middles` contains the heights of their middle planes (n,).
    """
    factors = np.ones((len(middles), 1, len(_RAISED)))
    factors[:, 0, (3, 7, 8)] = middles[:, None]
    factors[:, 0, 9] = middles * middles + layer * layer / 12.0
    return np.asarray(layer * (flat[:, :, _RAISED] * factors))


def _moments(sums: NDArray[np.float64], turn: NDArray[np.float64]) -> Moments:
    """Convert integrals in mm to moments in metres, expressed in the frame of the part. Rounding errors are set to zero."""
    one, x, y, z, xx, xy, yy, xz, yz, zz = sums
    first = turn.T @ np.array([x, y, z])
    second = turn.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn
    largest = float(np.trace(second))
    first[np.abs(first) <= _ROUNDING * math.sqrt(abs(one) * largest)] = 0.0
    second[np.abs(second) <= _ROUNDING * largest] = 0.0
    products = [0.5 * (second[i, j] + second[j, i]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return Moments.of([float(value) for value in (one * 1e-9, *(first * 1e-12), *(product * 1e-15 for product in products))])
