"""Material in the layers of solids whose regions have a formula. Lengths are in mm; the settings are the defaults of PrusaSlicer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold
from msgspec.structs import replace

from thingc.base.pose import Vector
from thingc.geometry.print_slices import Moments, SliceResult, Slicing
from thingc.geometry.store.meshes import exact_arrays
from thingc.geometry.worker.kernel.meshing import Triangles, double
from thingc.geometry.worker.kernel.slicing import JOINED, NotSliced, slice_part

HOW = Slicing(up=(0.0, 0.0, 1.0), layer=0.0002, line_width=0.00045, walls=3, top=4, bottom=4)
SPACING = 0.45 - 0.2 * (1 - math.pi / 4)  # of lines 0.45 mm wide and 0.2 mm high
ROUND = (0.45 - SPACING) / 2  # what the rounded side of the outermost line lacks
BRIDGE = math.pi / 4 * 0.4**2 / (0.45 * 0.2)  # strands of a 0.4 mm nozzle, 0.45 mm apart


def mesh(solid: Manifold) -> Triangles:
    found = solid.to_mesh64()
    return Triangles(np.asarray(found.vert_properties)[:, :3].copy(), np.asarray(found.tri_verts, dtype=np.int64))


def box(*size: float, at: Vector = (0.0, 0.0, 0.0)) -> Triangles:
    return mesh(Manifold.cube(size, True).translate(at))


def volume(moments: Moments) -> float:
    """Return the volume in mm^3."""
    return moments.volume * 1e9


def test_box_has_walls_solid_layers_and_infill() -> None:
    """100 layers of 40 x 30: the 4 lowest and the 4 highest are solid. The lowest of the top layers lies on sparse infill."""

    def area(inset: float) -> float:
        return (40 - 2 * inset) * (30 - 2 * inset)

    walls = ROUND + 3 * SPACING
    filled = area(walls - 0.25 * SPACING)
    inset = walls - 0.25 * SPACING + SPACING / 2
    found = slice_part(box(40, 30, 20), HOW)
    assert volume(found.sparse) == pytest.approx(92 * 0.2 * area(inset), rel=1e-9)
    assert volume(found.joins) == pytest.approx(92 * 0.2 * JOINED * SPACING * 2 * (40 + 30 - 4 * inset), rel=1e-9)
    solid = 100 * (area(ROUND) - area(walls)) + 7 * filled + BRIDGE * filled
    assert volume(found.solid) == pytest.approx(0.2 * solid, rel=1e-9)
    centre = found.mass_properties(0.15).centre
    assert centre[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
    lift = 0.2 * filled * (BRIDGE - 1) * (10 - 0.7)  # the bridge is the only thing that is not alike above and below
    assert centre[2] == pytest.approx(1e-3 * lift / volume(found.solid.plus(found.joins).plus(found.sparse, 0.15)), rel=1e-6)


def test_slicing_without_walls_and_solid_layers() -> None:
    block = box(40, 30, 20)
    bare = slice_part(block, replace(HOW, walls=0, top=0, bottom=0))
    # no walls, no lids: only the first and the last layer are laid solid, because they are open
    inset = ROUND + 0.25 * SPACING
    assert volume(bare.sparse) == pytest.approx(98 * 0.2 * (40 - 2 * inset) * (30 - 2 * inset), rel=1e-9)


@pytest.mark.parametrize(("height", "layers"), [(0.79, 4), (0.71, 4), (0.69, 3), (0.9, 4), (0.91, 5)])
def test_layer_exists_if_its_middle_is_inside(height: float, layers: int) -> None:
    found = slice_part(box(30, 30, height), HOW)
    one = slice_part(box(30, 30, 0.2), HOW)
    assert volume(found.solid) == pytest.approx(layers * volume(one.solid), rel=1e-9)


def test_bridge_over_air_uses_strands() -> None:
    """The top of a table has four layers, which lie over air except above the legs."""
    leg = Manifold.cube((10, 20, 10))
    table = Manifold.cube((60, 20, 0.8)).translate((0, 0, 10)) + leg + leg.translate((50, 0, 0))
    flat = replace(HOW, bridge_flow=0.25)
    thick, thin = slice_part(mesh(table), HOW), slice_part(mesh(table), flat)
    # per layer over air: the span and 3 mm on either side of it, but for the walls and the rims of lids inside
    assert volume(thick.solid) - volume(thin.solid) > 0.2 * 40 * 17 * (BRIDGE - math.pi / 4 * 0.2**2 / (0.25 * 0.2))


SOLIDS: dict[str, Manifold] = {
    "block": Manifold.cube((30, 20, 10), True).translate((3, 1, 5)),
    "ball": Manifold.sphere(12, 48).translate((0, 0, 12)),
    "cone": Manifold.cylinder(20, 12, 2, 48),
    "tilted": Manifold.cube((20, 12, 8), True).rotate((20, 30, 10)),
    "tube": Manifold.cylinder(20, 15, 15, 96) - Manifold.cylinder(20, 12, 12, 96),
    "two": Manifold.cube((10, 10, 10)) + Manifold.cube((5, 5, 5)).translate((20, 0, 0)),
}


def exact(solid: Manifold) -> tuple[float, Any, Any]:
    """Return volume, centre and principal moments of a mesh at density 1, by tetrahedra from the origin (Tonon 2004)."""
    found = solid.to_mesh64()
    corners = np.asarray(found.vert_properties)[:, :3][np.asarray(found.tri_verts, dtype=np.int64)]
    size = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    total = size.sum()
    centre = (size[:, None] * corners.sum(axis=1) / 4).sum(axis=0) / total
    sums = corners.sum(axis=1)
    second = np.einsum("i,ijk->jk", size / 20, np.einsum("ij,ik->ijk", sums, sums) + np.einsum("inj,ink->ijk", corners, corners))
    second -= total * np.outer(centre, centre)
    return total, centre, np.linalg.eigvalsh(np.trace(second) * np.eye(3) - second)


@pytest.mark.parametrize("name", SOLIDS)
def test_thin_layers_converge_to_the_exact_solid(name: str) -> None:
    """With walls only, of lines with little rounding, volume, centre and moments equal those of the solid to 1e-3."""
    layer = 1.25e-5 if name in ("block", "tube", "two") else 3e-5  # what is prismatic takes no time
    fine = replace(HOW, layer=layer, line_width=2 * layer, walls=4000)
    found = slice_part(mesh(SOLIDS[name]), fine).mass_properties(0.15)
    total, centre, moments = exact(SOLIDS[name])
    assert found.mass * 1e9 == pytest.approx(total, rel=1e-3)
    assert np.array(found.centre) * 1e3 == pytest.approx(centre, abs=0.01)
    assert np.linalg.eigvalsh(np.array(found.inertia) * 1e15) == pytest.approx(moments, rel=2e-3)


@pytest.mark.parametrize("up", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.6, 0.8), (0.0, 0.0, -1.0)])
def test_up_direction_rotates_the_part(up: Vector) -> None:
    """Slicing along `up` equals slicing the rotated part along z, transformed back to the part's frame."""
    solid = Manifold.cube((30, 20, 10)) - Manifold.cylinder(30, 4, 4, 48).translate((8, 8, -5))
    z = np.array(up)
    y = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    y /= np.linalg.norm(y)
    turn = np.stack([np.cross(y, z), y, z])
    turned = solid.transform(np.hstack([turn, np.zeros((3, 1))]))
    found = slice_part(mesh(solid), replace(HOW, up=up)).mass_properties(0.2)
    expected = slice_part(mesh(turned), HOW).mass_properties(0.2)
    assert found.mass == pytest.approx(expected.mass, rel=1e-5)
    assert np.array(found.centre) == pytest.approx(turn.T @ np.array(expected.centre), abs=1e-7)
    assert np.array(found.inertia) == pytest.approx(turn.T @ np.array(expected.inertia) @ turn, abs=1e-6 * expected.inertia[0][0])


def test_print_orientation_changes_the_mass() -> None:
    plate = box(60, 60, 3)
    flat, upright = slice_part(plate, HOW), slice_part(plate, replace(HOW, up=(1.0, 0.0, 0.0)))
    assert upright.mass_properties(0.15).mass > 1.05 * flat.mass_properties(0.15).mass


def test_position_does_not_change_the_result() -> None:
    near, far = slice_part(box(30, 20, 10), HOW).mass_properties(0.15), slice_part(
        box(30, 20, 10, at=(500.0, -300.0, 40.0)), HOW,
    ).mass_properties(0.15)
    assert far.mass == pytest.approx(near.mass, rel=1e-9)
    assert np.array(far.centre) - np.array(near.centre) == pytest.approx([0.5, -0.3, 0.04], abs=1e-9)
    assert np.array(far.inertia) == pytest.approx(np.array(near.inertia), rel=1e-6, abs=1e-15)


def test_slices_are_smooth_functions_of_a_length() -> None:
    """Edges of solid areas coincide with edges of the layers below. Rounding must not decide whether a sliver between them is widened."""
    hole = Manifold.cylinder(30, 3, 3, 36).rotate((90, 0, 0))
    sums = []
    for length in 30.0123 + 1e-3 * np.arange(7):
        wall = Manifold.cube((40, 5.1, 20)).translate((0, length - 5.1, 0))
        bracket = Manifold.cube((40, length, 5)) + wall - hole.translate((20, length + 10, 12))
        stored = Triangles(*exact_arrays(double(mesh(bracket.rotate((0, 0, 31.3))))))
        found = slice_part(stored, HOW)
        sums.append([found.solid.volume, found.joins.volume, found.sparse.volume])
    assert (np.abs(np.diff(sums, 2, axis=0)) <= 1e-8 * np.array(sums[0])).all()


def test_upright_and_leaning_walls_agree() -> None:
    """Equal layers are computed once; this is compared with a slightly sheared part that has no equal layers."""
    solid = SOLIDS["tube"] + Manifold.cube((6, 6, 20)).translate((9, 9, 0))
    leaning = solid.warp_batch(lambda points: points + np.outer(points[:, 2], [1e-5, 0, 0]))
    short, long = slice_part(mesh(solid), HOW), slice_part(mesh(leaning), HOW)
    for one, other in zip((short.solid, short.joins, short.sparse), (long.solid, long.joins, long.sparse), strict=True):
        assert one.volume == pytest.approx(other.volume, rel=2e-3)


def test_parts_that_cannot_be_sliced() -> None:
    with pytest.raises(NotSliced, match="lower than one layer"):
        slice_part(box(20, 20, 0.09), HOW)
    with pytest.raises(NotSliced, match="thinner than one printed line"):
        slice_part(box(20, 0.02, 5), HOW)
    with pytest.raises(NotSliced, match="more than 20000 layers"):
        slice_part(box(20, 20, 20), replace(HOW, layer=2e-7, line_width=4e-7))
    open_box = box(20, 20, 20)
    with pytest.raises(NotSliced, match="the mesh is not closed"):
        slice_part(Triangles(open_box.vertices, open_box.faces[:-1]), HOW)


def test_mass_is_linear_in_infill() -> None:
    """Without infill there are no joins."""
    found = slice_part(box(40, 30, 20), HOW)
    masses = [found.mass_properties(infill).mass for infill in (0.1, 0.2, 0.4)]
    assert masses[1] - masses[0] == pytest.approx((masses[2] - masses[1]) / 2, rel=1e-12)
    assert found.mass_properties(0.0).mass == found.solid.volume


def test_moments_of_two_bodies_add_up() -> None:
    """Two points of mass 1 and 3 at x = 0 and x = 4: the centre is 3, the moment about it is 1 * 9 + 3 * 1."""
    one = Moments.of([1.0, *[0.0] * 9])
    other = Moments.of([3.0, 12.0, 0, 0, 48.0, 0, 0, 0, 0, 0])
    twice = Moments.of([2 * value for value in other.numbers])
    both = SliceResult(solid=one, joins=Moments(), sparse=twice).mass_properties(0.5)
    assert (both.mass, both.centre[0]) == (4.0, 3.0)
    assert both.inertia[1][1] == both.inertia[2][2] == pytest.approx(12.0)
    assert Moments.of(other.numbers) == other
    assert Moments().properties.mass == 0.0
