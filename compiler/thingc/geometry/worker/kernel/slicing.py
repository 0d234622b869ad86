"""Cuts a part into the layers that a printer lays, and adds up what is laid into each: in a child of the worker. Lengths in mm.

It goes the way of PrusaSlicer 2.5 (its settings' names are in brackets; where a document has no key for one, its default counts), with
regions in place of paths:

1. A line of width w in a layer of height h has a cross section of s h, where s = w - h (1 - pi/4): a rectangle with half circles for
   ends [Flow]. Lines that fill lie s apart.
2. The walls are as many lines inside the outline; what is left inside is the core, if it is at least one line wide. A narrower rest
   goes to the walls [perimeter_generator = arachne].
3. The core is filled, a little into the walls [infill_overlap]. What lies open above or below is filled solid, and 3 mm around it; so
   are pieces of a layer of less than 70 mm^2 [solid_infill_below_area].
4. So is what lies within `top` layers below an opening and within `bottom` layers above one [discover_horizontal_shells]; pieces too
   narrow to be laid (under 6 lines) are made wider. The rest is sparse.
5. What is laid over air or over sparse infill is a bridge: of round strands as thick as the nozzle, 0.05 mm apart [thick_bridges].
   So are lines of walls that lie beside what is below by half a nozzle [overhangs].
6. Lines of sparse infill end half a line from its border, and are joined along it (see `JOINED`).
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
from thingc.geometry.store.local import Store
from thingc.geometry.worker.kernel.meshing import Triangles, read_stl

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_LAYERS = 20_000
"""More than any printer lays: somebody's layer is too thin by a unit."""

NOZZLE = 1.0 / 1.125
"""The diameter of the nozzle over the width of a line, which slicers choose so where nobody says [auto_extrusion_width]."""
SOLID_BELOW = 70.0
"""Area [mm^2] up to which a piece of infill is laid solid [solid_infill_below_area]."""
AROUND = 3.0
"""How far [mm] open surfaces are filled solid beyond their edge [EXTERNAL_INFILL_MARGIN]."""
STRAND_GAP = 0.05
"""Between two strands of a bridge [mm] [BRIDGE_EXTRA_SPACING]."""
FILLABLE = 0.6
"""Of a line: the least width of a core that is filled [INSET_OVERLAP_TOLERANCE]."""
ANCHOR = 3.0
"""Of a nozzle: half the least width of a bridge over sparse infill [bridge_over_infill]."""

JOINED = 0.32
"""The share of the border of sparse infill along which lines are joined. Where three families of parallel lines end at a border
[fill_pattern = stars], the gaps between neighbouring ends are closed one after the other, the shortest first, where both are still free
[connect_infill]: this is the mean share over all directions of the border (`benchmarks/prints/joined.py`)."""

_UPRIGHT = 1e-6
"""The cosine of the angle between a wall's normal and the bed up to which the wall is upright."""
_EXACT = 1e-5
"""Heights [mm] that differ by less are one."""
_JUST_BELOW = 1e-3
"""Of a layer: a surface exactly in a plane of cutting belongs to what is above it."""
_SIMPLE = 1e-3
"""How far [mm] an outline may be off the cut of the mesh."""

Region: TypeAlias = CrossSection
NOTHING = CrossSection()


class NotSliced(Exception):
    """A part that cannot be cut into layers: the reason, in words that follow its name."""


def slice_stored(sha256: str, how: Slicing, store: Store) -> dict[str, Any]:
    """What is printed of a mesh in the store (STL, mm): a `SliceResult` or `SliceFailure` as JSON."""
    try:
        result: SliceResult | SliceFailure = slice_part(read_stl(store.read(sha256)), how)
    except NotSliced as fault:
        result = SliceFailure(reason=str(fault))
    plain: dict[str, Any] = to_builtins(result)
    return plain


def slice_part(mesh: Triangles, how: Slicing) -> SliceResult:
    """What is printed of a closed mesh [mm]. Raises `NotSliced`."""
    turn = _turned_up(how.up)
    vertices = np.ascontiguousarray(mesh.vertices @ turn.T)
    lengths = _Lengths(how)
    outlines, heights = _outlines(vertices, mesh.faces, lengths.layer)
    flat = _flat(_Slicer(how, lengths).layers(outlines), JOINED * lengths.spacing)
    total = _raised(flat, heights, lengths.layer).sum(axis=0)
    solid, joins, sparse = (_moments(sums, turn) for sums in total)
    if not solid.volume > 0.0:
        raise NotSliced("is thinner than a line")
    return SliceResult(solid=solid, joins=joins, sparse=sparse)


def _turned_up(up: tuple[float, float, float]) -> NDArray[np.float64]:
    """A rotation (3, 3) that takes `up` to z; the identity for z."""
    z = np.array(up, dtype=np.float64)
    z /= np.linalg.norm(z)
    least = np.eye(3)[int(np.argmin(np.abs(z)))]
    y = np.cross(z, least)
    y /= np.linalg.norm(y)
    return np.stack([np.cross(y, z), y, z])


# --- outlines ---------------------------------------------------------------------------------------------------------


def _outlines(vertices: NDArray[np.float64], faces: NDArray[np.int64], layer: float) -> tuple[list[Region], NDArray[np.float64]]:
    """The cut in the middle of each layer, from the bed up, and its height (n,). Where the walls are upright, the same object."""
    solid = Manifold(Mesh64(vertices, np.ascontiguousarray(faces, dtype=np.uint64)))
    if solid.status() != Error.NoError or solid.is_empty():
        raise NotSliced("has a mesh that is not closed")
    bed, top = float(vertices[:, 2].min()), float(vertices[:, 2].max())
    count = math.ceil((top - bed - _EXACT) / layer - 0.5)  # the slicer stops where the middle of a layer is above the part
    if count < 1:
        raise NotSliced("is lower than one layer")
    if count > MOST_LAYERS:
        raise NotSliced(f"would have {count} layers")
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
    """A number for each cut; cuts with the same number are equal, because between them all walls are upright and nothing begins."""
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
    upright = np.cumsum(change) == 0  # of the slab above each level
    slab = np.searchsorted(levels, cuts, side="right") - 1
    return np.where(upright[slab], slab, len(levels) + np.arange(len(cuts)))


# --- layers -----------------------------------------------------------------------------------------------------------


class _Lengths:
    """What a slicing comes to in mm: the spacing of lines, the nozzle, the strands of bridges, and what these are laid with in
    proportion to the region that they cover (`bridge` of infill, `overhang` of walls)."""

    def __init__(self, how: Slicing) -> None:
        self.layer = how.layer * 1e3
        self.width = how.line_width * 1e3
        self.spacing = self.width - self.layer * (1.0 - math.pi / 4.0)
        if not self.spacing > 0.0:
            raise NotSliced("has layers too high for its lines")
        self.nozzle = self.width * NOZZLE
        self.strand = self.nozzle * math.sqrt(how.bridge_flow)
        section = math.pi / 4.0 * self.strand**2
        self.bridge = section / ((self.strand + STRAND_GAP) * self.layer)
        self.overhang = section / (self.spacing * self.layer)
        self.rounding = (self.width - self.spacing) / 2.0
        self.spanned = math.floor(self.strand / self.layer + _EXACT)  # layers that a strand sinks into


class _Slicer:
    """From outlines to what is laid. Functions of regions only, so that each is worked out once for equal layers."""

    def __init__(self, how: Slicing, lengths: _Lengths) -> None:
        self.how = how
        self.lengths = lengths
        self.once = _Once()

    def layers(self, outlines: list[Region]) -> list[_Laid]:
        """What is laid in each layer."""
        once = self.once
        above = [*outlines[1:], NOTHING]
        below = [NOTHING, *outlines[:-1]]
        cores = [once(self.core, outline) for outline in outlines]
        filled = [once(self.filled, core) for core in cores]
        bottoms = [once(self.opening, *pair) for pair in zip(outlines, below, strict=True)]
        tops = [once(self.uncovered, *both) for both in zip(outlines, above, bottoms, strict=True)]
        kinds = [once(self.kinds, *three) for three in zip(filled, tops, bottoms, strict=True)]
        lids = [once(_either, top, kind.top) for top, kind in zip(tops, kinds, strict=True)]
        floors = [once(_either, bottom, kind.bottom) for bottom, kind in zip(bottoms, kinds, strict=True)]
        solid = [
            once(
                self.shells, kind.inside, kind.small,
                *(lid for lid in lids[index + 1 : index + self.how.top] if not lid.is_empty()),
                *(floor for floor in floors[max(0, index + 1 - self.how.bottom) : index] if not floor.is_empty()),
            )
            for index, kind in enumerate(kinds)
        ]
        sparse = [once(_without, kind.inside, one) for kind, one in zip(kinds, solid, strict=True)]
        walls = [once(self.walls, outline, core) for outline, core in zip(outlines, cores, strict=True)]
        return [
            once(
                self.laid, walls[index], inside, kind, sparse[index], below[index] if index else None,
                *sparse[max(0, index - self.lengths.spanned) : index],
            )
            for index, (kind, inside) in enumerate(zip(kinds, solid, strict=True))
        ]

    def core(self, outline: Region) -> Region:
        """What is left inside the walls, where at least one more line would fit."""
        lengths = self.lengths
        left = _grown(outline, -(lengths.rounding + self.how.walls * lengths.spacing))
        return _opened(left, lengths.spacing / 2.0)

    def walls(self, outline: Region, core: Region) -> Region:
        """What walls cover. Lines are rounded: outermost there is less than the outline."""
        return _without(_grown(outline, -self.lengths.rounding), core)

    def filled(self, core: Region) -> Region:
        """What infill may cover: wide enough to be filled, with the overlap."""
        half = FILLABLE / 2.0 * self.lengths.spacing
        return _grown(_grown(core, -half), half + self.how.overlap * self.lengths.spacing)

    def opening(self, outline: Region, other: Region) -> Region:
        """What another layer leaves open of this one; no hairlines."""
        return _opened(_without(outline, other), self.lengths.width / 10.0)

    def uncovered(self, outline: Region, above: Region, bottom: Region) -> Region:
        """What is open above. Where it is open below, too, it is a bottom."""
        return _without(self.opening(outline, above), bottom)

    def kinds(self, filled: Region, top: Region, bottom: Region) -> _Kinds:
        """The infill of a layer in kinds."""
        within = _without(_without(filled, top), bottom)
        wide_bottom = self.around(bottom, filled)
        wide_top = _without(self.around(top, filled), wide_bottom)
        open_somewhere = _either(wide_bottom, wide_top)
        small = [piece for piece in within.decompose() if piece.area() <= SOLID_BELOW]
        return _Kinds(
            top=wide_top, bottom=wide_bottom, inside=_without(within, open_somewhere),
            small=_without(CrossSection.compose(small), open_somewhere) if small else NOTHING,
        )

    def around(self, opening: Region, filled: Region) -> Region:
        """What is filled solid because something is open: that, and some way around it."""
        there = _both(opening, filled)
        if there.is_empty():
            return NOTHING
        beside = self.opening(filled, there)
        if beside.is_empty():
            return filled
        x, y, u, v = beside.bounds()
        near = CrossSection.square((u - x + 4.0 * AROUND, v - y + 4.0 * AROUND)).translate((x - 2.0 * AROUND, y - 2.0 * AROUND))
        return _either(there, _both(_grown(_both(there, near), AROUND, JoinType.Square), filled))  # to grow all of a layer takes long

    def shells(self, inside: Region, small: Region, *lids: Region) -> Region:
        """What of the inside is solid: small pieces, and what is below or above one of these lids."""
        regions = [small]
        for lid in lids:
            regions += self.once(self.shell, inside, lid)
        return CrossSection.batch_boolean(regions, OpType.Add) if len(regions) > 1 else small

    def shell(self, inside: Region, lid: Region) -> tuple[Region, Region]:
        """What of the inside is below or above a lid, and what is laid beside that where it is too narrow to be laid."""
        new = _both(lid, inside)
        if new.is_empty():
            return NOTHING, NOTHING
        margin = 3.0 * self.lengths.width
        narrow = _without(new, _opened(new, margin, miter=5.0))
        return new, _both(_grown(narrow, margin, JoinType.Round), inside)

    def bridge(self, solid: Region, *below: Region) -> Region:
        """What of the solid inside lies over sparse infill in all layers that its strands sink into."""
        over = solid
        for sparse in below:
            over = _both(over, sparse)
        return _both(_opened(over, ANCHOR * self.lengths.strand), solid) if below else NOTHING

    def overhang(self, walls: Region, below: Region) -> Region:
        """What of the walls lies beside the layer below."""
        return _without(walls, _grown(below, self.lengths.nozzle / 2.0))

    def laid(self, walls: Region, inside: Region, kind: _Kinds, sparse: Region, below: Region | None, *spanned: Region) -> _Laid:
        """What is laid in a layer; `below` is the outline of the layer below (None: the bed), `spanned` what is sparse in those that the
        strands of a bridge sink into."""
        once, lengths = self.once, self.lengths
        lines = _grown(sparse, -lengths.spacing / 2.0)  # where lines of sparse infill run
        if below is None:
            return _Laid(solid=((1.0, walls), (1.0, inside), (1.0, kind.top), (1.0, kind.bottom)), lines=lines)
        over, bridge = once(self.overhang, walls, below), once(self.bridge, inside, *spanned)
        return _Laid(lines=lines, solid=(
            (1.0, walls), (1.0, inside), (1.0, kind.top), (lengths.bridge, kind.bottom),
            (lengths.overhang - 1.0, over), (lengths.bridge - 1.0, bridge),
        ))


class _Kinds:
    """The infill of one layer: open above and below (with the margin around them), inside, and of that the small pieces."""

    __slots__ = ("bottom", "inside", "small", "top")

    def __init__(self, *, top: Region, bottom: Region, inside: Region, small: Region) -> None:
        self.top = top
        self.bottom = bottom
        self.inside = inside
        self.small = small


class _Laid(FrozenStruct):
    """A layer: regions that are laid `solid`, each with how much there is in proportion to what would fill it, and where `lines` of sparse
    infill run."""

    solid: tuple[tuple[float, Region], ...]
    lines: Region


class _Once:
    """Answers of pure functions by the identity of their arguments, which it keeps alive."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], tuple[tuple[Any, ...], Any]] = {}

    def __call__(self, function: Callable[..., Any], *regions: Any) -> Any:
        key = (function, *map(id, regions))
        if key not in self._known:
            self._known[key] = (regions, function(*regions))
        return self._known[key][1]


# --- regions ----------------------------------------------------------------------------------------------------------


def _some(region: Region) -> Region:
    """The region; where it is empty always the same one, so that what follows from it is worked out once."""
    return NOTHING if region.is_empty() else region


def _grown(region: Region, by: float, join: JoinType = JoinType.Miter, miter: float = 2.0) -> Region:
    """With a border of width `by` around it, or within it for a negative one."""
    if region.is_empty() or by == 0.0:
        return region
    if by < 0.0:
        x, y, u, v = region.bounds()
        if min(u - x, v - y) <= -2.0 * by:  # nothing is left; to find that out takes long
            return NOTHING
    return _some(region.offset(by, join, miter, 8))


def _opened(region: Region, by: float, miter: float = 2.0) -> Region:
    """Without what is narrower than twice `by`."""
    return _grown(_grown(region, -by, miter=miter), by, miter=miter)


def _both(a: Region, b: Region) -> Region:
    return _some(a ^ b) if not (a.is_empty() or b.is_empty()) else NOTHING


def _either(a: Region, b: Region) -> Region:
    return a + b if not (a.is_empty() or b.is_empty()) else b if a.is_empty() else a


def _without(a: Region, b: Region) -> Region:
    if a is b:
        return NOTHING
    return _some(a - b) if not (a.is_empty() or b.is_empty()) else a


# --- moments ----------------------------------------------------------------------------------------------------------

_RAISED = (0, 1, 2, 0, 3, 4, 5, 1, 2, 0)
"""Of which plane moment each moment of a layer is made (see `_raised`)."""
_ROUNDING = 1e-12
"""Of a part's size: what is less is rounding."""


_Integrals: TypeAlias = "dict[int, NDArray[np.float64]]"
"""Of regions, by their identity, the integrals of 1, x, y, xx, xy, yy (6,); those that are not there are zero."""


def _flat(layers: list[_Laid], joined: float) -> NDArray[np.float64]:
    """For each layer the integrals of 1, x, y, xx, xy, yy over what is laid solid, over joins (a share `joined` [mm] of the border along
    lines), and over sparse lines at 100 % (n, 3, 6)."""
    every = [region for layer in layers for region in (layer.lines, *(region for _, region in layer.solid))]
    over, along = _integrals(every, border=False), _integrals([layer.lines for layer in layers], border=True)
    nothing = np.zeros(6)
    flat = np.zeros((len(layers), 3, 6))
    for layer, of_layer in zip(layers, flat, strict=True):
        for factor, region in layer.solid:
            of_layer[0] += factor * over.get(id(region), nothing)
        of_layer[1] = joined * along.get(id(layer.lines), nothing)
        of_layer[2] = over.get(id(layer.lines), nothing)
    return flat


def _integrals(regions: list[Region], *, border: bool) -> _Integrals:
    """Over regions, by Green's theorem along their edges, or along their `border`; of all at once."""
    whole = [region for region in {id(region): region for region in regions}.values() if not region.is_empty()]
    if not whole:
        return {}
    rings = [[np.asarray(ring, dtype=np.float64) for ring in region.to_polygons()] for region in whole]
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
    return {id(region): some for region, some in zip(whole, sums, strict=True)}


def _raised(flat: NDArray[np.float64], middles: NDArray[np.float64], layer: float) -> NDArray[np.float64]:
    """The integrals of 1, x, y, z, xx, xy, yy, xz, yz, zz over layers (n, 3, 10) from those over their planes (n, 3, 6), whose heights are
    `middles` (n,)."""
    factors = np.ones((len(middles), 1, len(_RAISED)))
    factors[:, 0, (3, 7, 8)] = middles[:, None]
    factors[:, 0, 9] = middles * middles + layer * layer / 12.0
    return np.asarray(layer * (flat[:, :, _RAISED] * factors))


def _moments(sums: NDArray[np.float64], turn: NDArray[np.float64]) -> Moments:
    """In metres, in the part's frame; zero for what is rounding."""
    one, x, y, z, xx, xy, yy, xz, yz, zz = sums
    first = turn.T @ np.array([x, y, z])
    second = turn.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn
    largest = float(np.trace(second))
    first[np.abs(first) <= _ROUNDING * math.sqrt(abs(one) * largest)] = 0.0
    second[np.abs(second) <= _ROUNDING * largest] = 0.0
    products = [0.5 * (second[i, j] + second[j, i]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return Moments.of([float(value) for value in (one * 1e-9, *(first * 1e-12), *(product * 1e-15 for product in products))])
