"""Slicing requests to the geometry service: cached by mesh and slicing, computed once, and never a reason to model a part again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from realize.conftest import Place, file_part, part
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.session import Session
from thingc.geometry.client import Workers
from thingc.geometry.lock.json_format import BadLock, read_record, record_values
from thingc.geometry.print_slices import SliceFailure, SliceResult, Slicing
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord
from thingc.geometry.record_json import record_from_json, record_to_json
from thingc.geometry.service import GeometryService
from thingc.model.resolve.resolver import Settings

HOW = Slicing(up=(0.0, 0.0, 1.0), layer=0.0002, line_width=0.00045, walls=3, top=4, bottom=4)

PARTS = """
    from build123d import Box, Pos
    from thingc import Length, MountPoint, Thing

    class Block(Thing):
        print = {"up": (0, -2, 0)}

        def __init__(self, width: Length = 20):
            super().__init__(material="petg")
            self.body = Box(width, 10, 6)

        def result(self):
            return self.body

    class Lying(Thing):
        print = {"up": (1, 0, 0)}

        def result(self):
            return Box(20, 15, 10)

    class Foil(Thing):
        def result(self):
            return Box(20, 20, 0.05)
"""


class Counted(Workers):
    """Workers that record their requests."""

    def __init__(self) -> None:
        super().__init__(2)
        self.asked: list[str] = []

    def run(self, requests: Any) -> Iterator[Any]:
        """Record the requests and run them."""

        def noted() -> Iterator[Any]:
            for request in requests:
                self.asked.append(request["op"])
                yield request

        return super().run(noted())


@pytest.fixture(scope="module")
def counted() -> Iterator[Counted]:
    made = Counted()
    yield made
    made.close()


@pytest.fixture
def spot(place: Place, counted: Counted) -> Place:
    counted.asked.clear()
    place.workers = counted
    place.write("parts/blocks.py", PARTS)
    return place


def sliced(service: GeometryService, definitions: Sequence[PartDefinition], *slicings: Slicing) -> dict[str, Any]:
    records = service.realize(definitions)
    return service.slice(definitions, records, {definition.text: slicings for definition in definitions})


def test_slicing_is_cached_and_does_not_model(spot: Place, counted: Counted) -> None:
    block = part("blocks:Block", width=0.02)
    with spot.service() as service:
        first = sliced(service, [block], HOW)[block.text]
        assert counted.asked == ["model", "slice"]
        assert isinstance(first.slices[HOW], SliceResult)
        assert sliced(service, [block], HOW)[block.text] is first, "the same record for the same question"
        both = sliced(service, [block], HOW, replace(HOW, walls=2))[block.text]
        assert counted.asked == ["model", "slice", "slice"]
        assert set(both.slices) == {HOW, replace(HOW, walls=2)}
        assert both.slices[replace(HOW, walls=2)].sparse.volume > both.slices[HOW].sparse.volume
    with spot.service() as later:
        again = sliced(later, [block], HOW)[block.text]
        assert counted.asked == ["model", "slice", "slice"]
        assert again.slices == first.slices
        assert later.decisions[block.text].reused


def test_last_slicing_is_repeated_when_modelling(spot: Place, counted: Counted) -> None:
    """A part that is modelled again is sliced by the same request. The result equals that of a separate request."""
    block, wide = part("blocks:Block", width=0.02), part("blocks:Block", width=0.03)
    with spot.service() as service:
        sliced(service, [block], HOW)
        found = sliced(service, [wide], HOW)[wide.text]
        assert counted.asked == ["model", "slice", "model"]
        sliced(service, [part("blocks:Block", width=0.04)])  # not printed any more
        sliced(service, [part("blocks:Block", width=0.05)], HOW)
        assert counted.asked[3:] == ["model", "model", "slice"]
    spot.store = type(spot.store)(f"{spot.store.root}-empty")
    with spot.service() as other:
        assert sliced(other, [wide], HOW)[wide.text].slices == found.slices and counted.asked[6:] == ["model", "slice"]


def test_likely_slicings_are_computed_while_modelling(spot: Place, counted: Counted) -> None:
    """The orientation comes from the part itself. The result equals that of a separate request."""
    block, lying, foil = part("blocks:Block", width=0.02), part("blocks:Lying"), part("blocks:Foil")
    on_its_side, wanted = replace(HOW, up=(1.0, 0.0, 0.0)), {block.text: [HOW], lying.text: [replace(HOW, up=(1.0, 0.0, 0.0))]}
    likely = {block.text: {(HOW, False)}, lying.text: {(HOW, True)}}
    with spot.service() as service:
        found = service.slice([foil, block, lying], service.realize([foil, block, lying], {}, lambda: likely), wanted)
        assert counted.asked == ["model"] * 3
    with spot.service() as later:
        assert not later.realize([foil, block, lying], {}, lambda: pytest.fail("nothing is modelled"))[foil.text].slices
    spot.store = type(spot.store)(f"{spot.store.root}-empty")
    with spot.service() as other:
        assert sliced(other, [block], HOW)[block.text].slices == found[block.text].slices
        assert sliced(other, [lying], on_its_side)[lying.text].slices == found[lying.text].slices


def test_equal_meshes_are_sliced_once(spot: Place, counted: Counted) -> None:
    """Two definitions with the same shape have the same mesh."""
    spot.write("parts/twins.py", PARTS)
    blocks = [part("blocks:Block", width=0.02), part("twins:Block", width=0.02)]
    with spot.service() as service:
        found = sliced(service, blocks, HOW)
        assert counted.asked.count("slice") == 1
        assert found[blocks[0].text].slices == found[blocks[1].text].slices


def test_slicing_failure_is_cached_with_its_reason(spot: Place, counted: Counted) -> None:
    foil = part("blocks:Foil")
    for _ in range(2):
        with spot.service() as service:
            assert sliced(service, [foil], HOW)[foil.text].slices == {HOW: SliceFailure(reason="the part is lower than one layer")}
    assert counted.asked.count("slice") == 1


def test_file_parts_are_sliced(spot: Place, root: Path) -> None:
    corners = [(0, 0, 0), (30, 0, 0), (0, 30, 0), (0, 0, 30)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    spot.write("corner.obj", "\n".join(lines))
    with spot.service() as service:
        found = sliced(service, [file_part("corner.obj")], HOW)["corner.obj"]
    assert 0.5 * 4.5e-6 < found.slices[HOW].mass_properties(0.15).mass < 4.5e-6


def test_failed_parts_are_not_sliced(spot: Place) -> None:
    missing = part("blocks:Nothing")
    with spot.service() as service:
        assert isinstance(sliced(service, [missing], HOW)[missing.text], PartFailure)


def test_print_orientation_of_a_thing(spot: Place) -> None:
    with spot.service() as service:
        block, foil = part("blocks:Block", width=0.02), part("blocks:Foil")
        records = service.realize([block, foil])
        held, plain = records[block.text], records[foil.text]
    assert isinstance(held, PartRecord) and isinstance(plain, PartRecord)
    assert (held.up, plain.up) == ((0.0, -1.0, 0.0), None)
    assert record_from_json(record_to_json(held, "/w"), "/w") == held


@pytest.mark.parametrize(("said", "words"), [
    ('{"up": (0, 0, 0)}', "must not be zero"), ('{"up": (0, 1)}', "must return three numbers"),
    ('{"down": (0, 0, 1)}', "must be a mapping such as"), ('(0, 0, 1)', "must be a mapping such as"),
])
def test_invalid_print_orientation_is_an_error(spot: Place, said: str, words: str) -> None:
    spot.write("parts/wrong.py", f"""
        from build123d import Box
        from thingc import Thing

        class Wrong(Thing):
            print = {said}

            def result(self):
                return Box(1, 1, 1)
    """)
    with spot.service() as service:
        found = service.realize([part("wrong:Wrong")])["wrong:Wrong"]
    assert isinstance(found, PartFailure)
    assert words in found.message


DOCUMENT = """
    thingc: assembly/1
    name: rig
    parameters: {infill: 15 %, walls: 3}
    materials: {petg: {density: 1000 kg/m^3}}
    components:
      block:
        part: blocks:Block
        process: {kind: fdm, walls: =walls, line_width: 0.45 mm, layer: 0.2 mm, top: 4, bottom: 4, infill: =infill}
"""


def test_new_infill_percentage_needs_no_worker(spot: Place) -> None:
    """The same slicing is reused in a session and in the next process, because the mass is linear in the percentage."""
    document = str(spot.write("rig.yaml", DOCUMENT))
    options = Options(store=spot.store.root)
    masses = {}
    with Session(document, options) as session:
        for infill in (15, 20, 40):
            found = session.compile(Settings(parameters={"infill": f"{infill} %"}))
            assert found.assembly is not None
            masses[infill] = found.assembly.occurrences[0].properties.mass
            assert found.assembly.occurrences[0].estimate == "layers"
    assert masses[20] - masses[15] == pytest.approx((masses[40] - masses[20]) / 4, rel=1e-9)
    with Environment(document, replace(options, parameters={"infill": "33 %"})) as environment:
        later = pipeline.compile(environment)
        assert later.assembly is not None and not later.report.diagnostics
        assert later.assembly.occurrences[0].properties.mass == pytest.approx(masses[20] + 13 * (masses[40] - masses[20]) / 20, rel=1e-9)
        assert environment.geometry._calls.workers is None, "a worker was started"
        assert not later.modelled


def test_lock_file_contains_slices(spot: Place) -> None:
    """The values equal those of the service; a modified lock file is rejected."""
    block = part("blocks:Block", width=0.02)
    with spot.service() as service:
        record = sliced(service, [block], HOW)[block.text]
    values = record_values(record)
    held = read_record(block.text, values, "r", None)
    assert held.up == record.up
    assert held.slices[HOW].mass_properties(0.15).mass == pytest.approx(record.slices[HOW].mass_properties(0.15).mass, rel=1e-11)
    (one,) = values["slices"]
    for key, wrong in {
        "solid": [-1.0, *one["solid"][1:]], "sparse": [*one["sparse"][:4], -1e-9, *one["sparse"][5:]], "joins": [1.0], "walls": 2.5,
        "up": [0, 0, 3], "layer": "0.2 mm",
    }.items():
        with pytest.raises(BadLock, match="expected"):
            read_record(block.text, {**values, "slices": [{**one, key: wrong}]}, "r", None)
    foil = part("blocks:Foil")
    with spot.service() as service:
        unsliced = sliced(service, [foil], HOW)[foil.text]
    assert read_record(foil.text, record_values(unsliced), "r", None).slices == unsliced.slices


