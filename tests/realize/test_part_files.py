"""Parts that are files: in the unit that the document says where the file does not say its own."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from build123d import Box, export_brep, export_step, export_stl

from thingc.realize.record import PartDefinition, PartRecord, definition_text

SIDES = (2.0, 3.0, 4.0)
"""Of the box in every file, in the file's own numbers."""

METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
"""The international units [m]."""


def filed(name: str, unit: str | None) -> PartDefinition:
    given = {} if unit is None else {"unit": unit}
    return PartDefinition(
        reference=name, kind="file", parameters=tuple(given.items()), text=definition_text(name, dict(given), {}), label=name,
    )


@pytest.fixture(scope="module")
def folder(module_place: Any) -> Path:
    """A box in every format."""
    root: Path = module_place.root
    box = Box(*SIDES)
    export_step(box, root / "box.step")
    export_brep(box, root / "box.brep")
    export_stl(box, root / "box.stl")
    corners = [(x, y, z) for x in (-1.0, 1.0) for y in (-1.5, 1.5) for z in (-2.0, 2.0)]
    quads = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    (root / "box.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {a} {b} {c} {d}\n" for a, b, c, d in quads)
    )
    space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in corners)
    faces = "".join(
        f'<triangle v1="{a - 1}" v2="{b - 1}" v3="{c - 1}"/>' for q in quads for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))
    )
    with zipfile.ZipFile(root / "box.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", (
            f'<model unit="inch" xmlns="{space}"><resources><object id="1" type="model"><mesh><vertices>{vertices}</vertices>'
            f'<triangles>{faces}</triangles></mesh></object></resources><build><item objectid="1"/></build></model>'
        ))
    return root


@pytest.mark.parametrize("name", ["box.stl", "box.obj", "box.brep"])
def test_numbers_without_a_unit_have_that_of_the_document(name: str, folder: Path, module_place: Any) -> None:
    wanted = {unit: filed(name, unit) for unit in (None, *METRES)}
    with module_place.service() as service:
        found = service.realize(list(wanted.values()))
    for unit, definition in wanted.items():
        record = found[definition.text]
        assert isinstance(record, PartRecord), record
        sides = np.array(SIDES) * METRES[unit or "mm"]
        np.testing.assert_allclose(np.subtract(*reversed(record.box or ())), sides, rtol=1e-6)
        assert record.volume == pytest.approx(sides.prod(), rel=1e-6)
        assert record.inertia[0][0] == pytest.approx(sides.prod() / 12 * (sides[1] ** 2 + sides[2] ** 2), rel=1e-6)
        assert record.area == pytest.approx(2 * (sides.prod() / sides).sum(), rel=1e-6)
    assert {definition.text for definition in wanted.values()} >= {name, f"{name}(unit='m')"}


@pytest.mark.parametrize(("name", "unit"), [("box.step", "mm"), ("box.3mf", "in")])
def test_files_that_say_their_unit_are_believed(name: str, unit: str, folder: Path, module_place: Any) -> None:
    with module_place.service() as service:
        record = service.realize([filed(name, None)])[name]
    assert isinstance(record, PartRecord), record
    np.testing.assert_allclose(np.subtract(*reversed(record.box or ())), np.array(SIDES) * METRES[unit], rtol=1e-6)
