"""Masses of parts printed in layers: requested slicings, precedence of stated values, and the fallback without a slicing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from graph.builder import (
    PETG,
    DeclaredValue,
    Process,
    assembly,
    box,
    box_inertia,
    component,
    faults,
    linked,
    material,
    said,
    stated,
    warnings,
)
from thingc.geometry.print_slices import Moments, SliceFailure, SliceResult, Slicing
from thingc.geometry.record import PartRecord, PartSchema
from thingc.model.assembly.mass import likely_slicings, slicings_of
from thingc.model.assembly.types import Occurrence

SIZE = (0.1, 0.06, 0.04)
VOLUME = 0.1 * 0.06 * 0.04
PRINTED = Process(kind="fdm", walls=3, line_width=0.00045, layer=0.0002, top=4, bottom=5, infill=0.15)
HOW = Slicing(up=(0.0, 0.0, 1.0), layer=0.0002, line_width=0.00045, walls=3, top=4, bottom=5, overlap=0.25, bridge_flow=1.0)

SCHEMA = PartSchema(reference="p:Box", kind="thing", doc="", parameters=(), material="petg", actuator=False, file="p.py", line=1)


def fraction_of_box(share: float, lift: float = 0.0) -> Moments:
    """A fraction of the box's matter, distributed like the box and shifted up by `lift` [m]."""
    volume = share * VOLUME
    a, b, c = (volume * size * size / 12 for size in SIZE)
    return Moments.of([volume, 0, 0, volume * lift, a, b, c + volume * lift * lift, 0, 0, 0])


SLICED = SliceResult(solid=fraction_of_box(0.4, lift=0.01), joins=fraction_of_box(0.05, lift=0.01), sparse=fraction_of_box(0.5, lift=0.01))


def printed(*, process: Process = PRINTED, slices: dict[Slicing, Any] | None = None, **over: Any) -> Occurrence:
    record = box("p:Box", SIZE, slices={HOW: SLICED} if slices is None else slices, **over.pop("record", {}))
    model = assembly("a", [component("part", "p:Box", **over)], materials=(material("petg", 1270.0, process=process),))
    return linked(model, record).occurrences[0]


@pytest.mark.parametrize("infill", [0.05, 0.15, 0.5, 0.999])
def test_mass_from_slicing(infill: float) -> None:
    """All three terms are distributed like the box, 10 mm above its centre, so their sum is as well."""
    found = printed(process=replace(PRINTED, infill=infill))
    share = 0.45 + 0.5 * infill
    assert found.properties.mass == pytest.approx(1270 * VOLUME * share, rel=1e-12)
    assert found.properties.centre == pytest.approx((0.0, 0.0, 0.01), abs=1e-12)
    assert np.array(found.properties.inertia) == pytest.approx(1270 * share * box_inertia(SIZE), rel=1e-9)
    assert (found.mass_source, found.estimate) == ("estimated", "layers")


def test_zero_and_full_infill() -> None:
    assert printed(process=replace(PRINTED, infill=0.0)).properties.mass == pytest.approx(1270 * VOLUME * 0.4)
    full = printed(process=replace(PRINTED, infill=1.0))
    assert (full.properties.mass, full.properties.centre) == (pytest.approx(1270 * VOLUME, rel=1e-15), (0.0, 0.0, 0.0))
    assert (full.mass_source, full.estimate) == ("derived", None)


def test_skin_estimate_by_option_and_process_kind() -> None:
    area = 2 * (0.1 * 0.06 + 0.06 * 0.04 + 0.1 * 0.04)
    skin = area * 3 * 0.00045
    for process in (replace(PRINTED, estimate="skin"), replace(PRINTED, kind="resin"), replace(PRINTED, kind=None)):
        found = printed(process=process)
        assert found.properties.mass == pytest.approx(1270 * (skin + 0.15 * (VOLUME - skin)))
        assert (found.properties.centre, found.mass_source, found.estimate) == ((0.0, 0.0, 0.0), "estimated", "skin")
    assert printed(process=replace(PRINTED, kind="resin", estimate="layers")).estimate == "layers"


def test_stated_values_override_slicing() -> None:
    """A mass scales the inertia of the print and keeps its centre. A stated centre or inertia replaces the computed one."""
    shape = np.array(printed().properties.inertia) / printed().properties.mass
    for found in (printed(mass=stated(0.2, source="measured")), printed(record={"mass": DeclaredValue(value=0.2, source="measured")})):
        assert (found.properties.mass, found.mass_source, found.estimate) == (0.2, "measured", None)
        assert found.properties.centre == pytest.approx((0.0, 0.0, 0.01))
        assert np.array(found.properties.inertia) == pytest.approx(0.2 * shape)
    moved = printed(com=stated(0.0, 0.001, 0.0))
    assert moved.properties.centre == (0.0, 0.001, 0.0)
    assert (moved.properties.mass, moved.estimate) == (pytest.approx(1270 * VOLUME * 0.525), "layers")
    own = printed(inertia=stated(1e-5, 2e-5, 2.5e-5, 0.0, 0.0, 0.0))
    assert np.array(own.properties.inertia) == pytest.approx(np.diag([1e-5, 2e-5, 2.5e-5]))


def asked(process: Process, *components: Any, **record: Any) -> set[Slicing]:
    """Slicings requested for the box, which must equal the slicings predicted before its geometry is known."""
    made = box("p:Box", SIZE, **record)
    model = assembly("a", components or [component("part", "p:Box")], materials=(material("petg", process=process),))
    found = slicings_of(model, {"p:Box": made}).get("p:Box", set())
    likely = likely_slicings(model, {"p:Box": SCHEMA}).get("p:Box", set())
    assert found == {replace(one, up=made.up or one.up) if own_up else one for one, own_up in likely} or made.volume == 0.0
    return found


def test_requested_slicing_follows_the_process() -> None:
    assert asked(PRINTED) == {HOW}
    assert asked(replace(PRINTED, overlap=0.1, bridge_flow=0.8)) == {replace(HOW, overlap=0.1, bridge_flow=0.8)}
    assert asked(replace(PRINTED, overlap=0.0)) == {replace(HOW, overlap=0.0)}
    assert asked(replace(PRINTED, infill=0.7)) == {HOW}, "the percentage is no part of it"
    for process in (
        replace(PRINTED, infill=1.0), replace(PRINTED, infill=None), replace(PRINTED, estimate="skin"), replace(PRINTED, kind="cast"),
        replace(PRINTED, top=None), replace(PRINTED, layer=0.0005),
    ):
        assert asked(process) == set()
    assert asked(PRINTED, volume=0.0) == set()


def test_component_print_direction_overrides_the_thing() -> None:
    assert asked(PRINTED, up=(1.0, 0.0, 0.0)) == {replace(HOW, up=(1.0, 0.0, 0.0))}
    assert asked(PRINTED, component("part", "p:Box", up=(0.0, 1.0, 0.0)), up=(1.0, 0.0, 0.0)) == {replace(HOW, up=(0.0, 1.0, 0.0))}


def test_equal_copies_share_a_slicing() -> None:
    copies = [component(f"part_{k}", "p:Box") for k in range(3)]
    assert asked(PRINTED, *copies) == {HOW}
    others = [component("lying", "p:Box", up=(0.0, 1.0, 0.0)), component("thick", "p:Box", process=Process(walls=5))]
    assert asked(PRINTED, *copies, *others) == {HOW, replace(HOW, up=(0.0, 1.0, 0.0)), replace(HOW, walls=5)}


def test_unsliceable_part_uses_skin_with_a_warning() -> None:
    record = box("p:Box", SIZE, slices={HOW: SliceFailure(reason="the mesh is not closed")})
    model = assembly("a", [component("part", "p:Box", line=7)], materials=(material("petg", process=PRINTED),))
    report = warnings(model, record)
    assert said(report) == [(
        "UNSLICED",
        "`part` (`p:Box`) cannot be sliced: the mesh is not closed",
        "fix the part, or set `process: {estimate: skin}` in the component",
        7,
    )]
    quiet = assembly("a", [component("part", "p:Box", process=Process(estimate="skin"))], materials=(material("petg", process=PRINTED),))
    assert not warnings(quiet, record).diagnostics
    stated_mass = assembly("a", [component("part", "p:Box", mass=stated(0.1))], materials=(material("petg", process=PRINTED),))
    assert not warnings(stated_mass, record).diagnostics


def test_missing_process_values_are_reported_together() -> None:
    bare = material("petg", process=Process(kind="fdm", walls=3, line_width=0.00045, infill=0.15))
    model = assembly("a", [component("part", "p:Box", process=Process(layer=0.0002))], materials=(bare,))
    assert [message for _, message, _, _ in said(faults(model, box("p:Box", SIZE)))] == [
        "the print process of `petg` lacks `layer`, `top` and `bottom`",
    ]
    own = assembly("a", [component("part", "p:Box", process=replace(PRINTED, top=None, bottom=None))], materials=(PETG,))
    assert [message for _, message, _, _ in said(faults(own, box("p:Box", SIZE)))] == [
        "the print process of `part` lacks `top` and `bottom`",
    ]


def test_layer_above_line_width_is_an_error() -> None:
    high = component("part", "p:Box", process=Process(layer=0.001), line=9)
    model = assembly("a", [high], materials=(material("petg", process=PRINTED),))
    assert said(faults(model, box("p:Box", SIZE))) == [(
        "HIGH_LAYERS", "`layer` (1 mm) exceeds `line_width` (0.45 mm)",
        "write, for example, `layer: 0.2 mm, line_width: 0.45 mm`", 9,
    )]


def test_records_compare_by_slices() -> None:
    one, other = box("p:Box", SIZE, slices={HOW: SLICED}), box("p:Box", SIZE)
    assert isinstance(one, PartRecord)
    assert one != other
