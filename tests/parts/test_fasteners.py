"""Screws, compared with the screw of bd_warehouse, and with numbers of the standards. ISO 4762:2004 table 1 (head diameter of knurled
heads, head height, socket), ISO 273:1979 (clearance holes), ISO 261 (pitch)."""

from __future__ import annotations

from math import pi, sqrt

import pytest
from bd_warehouse.fastener import SocketHeadCapScrew
from build123d import Location, Pos

from thingc import ParameterError
from thingc_stock.fasteners import HEAD_PLAY, Screw

#        d    pitch  dk     k    s    t     fine medium coarse  tap drill
TABLE = {
    "M2": (2.0, 0.4, 3.98, 2.0, 1.5, 1.0, 2.2, 2.4, 2.6, 1.6),
    "M2.5": (2.5, 0.45, 4.68, 2.5, 2.0, 1.1, 2.7, 2.9, 3.1, 2.05),
    "M3": (3.0, 0.5, 5.68, 3.0, 2.5, 1.3, 3.2, 3.4, 3.6, 2.5),
    "M4": (4.0, 0.7, 7.22, 4.0, 3.0, 2.0, 4.3, 4.5, 4.8, 3.3),
}
SIZES = pytest.mark.parametrize("size", TABLE)


@SIZES
def test_dimensions_equal_those_of_the_standards(size):
    d, pitch, dk, k, s, t, fine, medium, coarse, tap = TABLE[size]
    screw = Screw(size, 10)
    assert (screw.diameter, screw.pitch, screw.head_diameter, screw.head_height) == (d, pitch, dk, k)
    assert (screw.socket_width, screw.socket_depth, screw.tap_diameter) == (s, t, tap)
    assert [Screw(size, 10, fit).clearance_diameter for fit in ("Close", "Normal", "Loose")] == [fine, medium, coarse]
    assert screw.bom == {"make": "buy"}


@SIZES
def test_volume_equals_formula_and_bd_warehouse(size):
    d, pitch, dk, k, s, t = TABLE[size][:6]
    screw = Screw(size, 10)
    solid = screw.result()
    hexagon = sqrt(3) / 2 * s**2
    assert solid.is_valid and len(solid.solids()) == 1
    head = pi / 4 * dk**2 * k - hexagon * t
    assert solid.volume == pytest.approx(head + pi / 4 * (d - 0.649519 * pitch) ** 2 * 10, rel=1e-6)
    theirs = SocketHeadCapScrew(f"{size}-{pitch:g}", length=10, simple=True)  # its shank has the root diameter, its head is round
    root = theirs.volume - head
    assert 0 < pi / 4 * (d - 1.3 * pitch) ** 2 * 10 - 0.05 * head < root < solid.volume - head
    assert theirs.clearance_hole_diameters["Normal"] == screw.clearance_diameter
    assert theirs.tap_hole_diameters["Soft"] == screw.tap_diameter


@SIZES
def test_hulls_contain_the_screw(size):
    d, _, dk, k, *_, medium, _, tap = TABLE[size]
    screw = Screw(size, 10)
    assert screw.body_hull.volume == pytest.approx(pi / 4 * (d**2 * 10 + dk**2 * k))
    assert screw.tapped_hull.volume == pytest.approx(pi / 4 * tap**2 * 10)
    assert screw.clearance_hull.volume == pytest.approx(pi / 4 * (medium**2 * 10 + (dk + 2 * HEAD_PLAY) ** 2 * (k + 10)))
    left = screw.body_hull.cut(screw.clearance_hull)
    assert sum(solid.volume for solid in left.solids()) == pytest.approx(0, abs=1e-9)
    for hull, below, above in ((screw.body_hull, -10, k), (screw.tapped_hull, -10, 0), (screw.clearance_hull, -10, k + 10)):
        box = hull.bounding_box()
        assert [tuple(box.min)[2], tuple(box.max)[2]] == pytest.approx([below, above], abs=1e-6)
        assert hull.is_valid


def test_mounts_point_out_of_the_screw():
    screw = Screw("M3", 8)
    for mount, height, out in ((screw.seat, 0, -1), (screw.tip, -8, -1), (screw.drive, 3, 1)):
        assert tuple(mount.location.position) == pytest.approx((0, 0, height))
        assert tuple(mount.location.z_axis.direction) == pytest.approx((0, 0, out))
    assert (screw.seat.interface, screw.drive.interface) == ("m3-head", "hex-2.5")


def test_hulls_move_with_the_screw():
    screw = Screw("M3", 8).move(Pos(10, 0, 0) * Location((0, 0, 0), (0, 90, 0)))
    box = screw.tapped_hull.bounding_box()
    assert tuple(box.min) == pytest.approx((2, -1.25, -1.25), abs=1e-6)
    assert tuple(box.max) == pytest.approx((10, 1.25, 1.25), abs=1e-6)
    assert screw.tapped_hull.volume == pytest.approx(pi / 4 * 2.5**2 * 8)


def test_equal_screws_are_equal_and_invalid_ones_are_errors():
    assert Screw("M3", 8) is Screw(size="M3", length=8.0)
    with pytest.raises(ParameterError, match="`size` of `Screw` must be one of 'M1.6', 'M2', .*, found 'M7'"):
        Screw("M7")
    with pytest.raises(ParameterError, match="`length` of `Screw` must be at least 1 mm, found 0 mm"):
        Screw("M3", 0)


def test_collision_pieces_are_head_and_shank(pieces):
    head, shank = pieces(Screw("M3", 8))
    assert head.volume() == pytest.approx(pi / 4 * 5.68**2 * 3, rel=0.02)
    assert shank.volume() == pytest.approx(pi / 4 * 9 * 8, rel=0.04)
