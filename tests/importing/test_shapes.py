"""Visual and collision shapes equal those of the source, compared with MuJoCo's own reading of the file."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy
import pytest

import thingc
from importing.imports import import_cleanly, write_import
from thingc.tools.importing.importing import Imported
from thingc.tools.importing.quantities import length, lengths

SOURCE = Path(__file__).parent / "robots" / "shapes.urdf"
ALL = '<mujoco><compiler fusestatic="false" discardvisual="false"/></mujoco></robot>'


@pytest.fixture(scope="module")
def imported() -> Imported:
    return import_cleanly(SOURCE)


def geoms(model: mujoco.MjModel) -> list[tuple[int, bool, list[float]]]:
    """Return for every geom its type, whether it collides, and its size, colour and pose at q = 0."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for k in range(model.ngeom):
        numbers = [round(float(one), 9) + 0.0 for one in (*model.geom_size[k], *data.geom_xpos[k], *data.geom_xmat[k])]
        found.append((int(model.geom_type[k]), bool(model.geom_contype[k]), numbers))
    return sorted(found)


def test_imported_shapes_match_mujoco(imported: Imported, tmp_path: Path) -> None:
    compiled = thingc.compile(write_import(imported, tmp_path))
    assert compiled.diagnostics == ()
    model = compiled.modes["source"].model()
    without = SOURCE.read_text().replace('<visual><geometry><sphere radius="0"/></geometry></visual>', "")
    theirs = mujoco.MjModel.from_xml_string(without.replace("</robot>", ALL))
    assert geoms(model) == geoms(theirs)
    for ours, other in ((model.body("base"), theirs.body("base")), (model.body("pole"), theirs.body("pole"))):
        lead = theirs.body("lead") if other.name == "pole" else None
        assert ours.mass[0] == pytest.approx(other.mass[0] + (lead.mass[0] if lead is not None else 0.0))
        centre = other.ipos if lead is None else (other.mass * other.ipos + lead.mass * (lead.pos + lead.ipos)) / (other.mass + lead.mass)
        assert ours.ipos == pytest.approx(centre)
    # two points of 1 kg with its inertia and 0.4 kg with none, d apart: m1 m2 / (m1 + m2) d^2 about each axis across it
    d = numpy.array([0.01, 0.02, 0.6])
    added = 0.4 / 1.4 * (d @ d * numpy.eye(3) - numpy.outer(d, d))
    assert sorted(model.body("pole").inertia) == pytest.approx(sorted(numpy.linalg.eigvalsh(0.02 * numpy.eye(3) + added)))
    assert model.site("lead").pos == pytest.approx([0.0, 0.0, 0.6])
    drawn = {tuple(numpy.round(model.geom_rgba[k], 2)) for k in range(model.ngeom) if not model.geom_contype[k]}
    materials = {tuple(numpy.round(model.mat_rgba[k], 2)) for k in range(model.nmat)}
    assert {(1.0, 0.5, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)} <= drawn | materials


def test_equal_visual_and_collision_are_written_once(imported: Imported) -> None:
    text = imported.files["shapes.yaml"].decode()
    assert '- {box: 200 300 400 mm, at: {xyz: 100 200 300 mm, rpy: 0.4 -0.3 0.2 rad}, color: "#ff8000"}' in text
    assert text.count("box:") == 1 and "- {sphere: {radius: 70 mm}, at: {xyz: 0 0 500 mm}, for: collision}" in text
    assert [(loss.what, loss.where.line) for loss in imported.losses] == [("a `<sphere>`", 9)]


@pytest.mark.parametrize(("value", "written"), [
    (0.1 + 0.2, "300 mm"), (0.07 * 100 / 175, "40 mm"), (1 / 3, "333.3333333333333 mm"), (0.1000000000000003, "100.0000000000003 mm"),
    (0.123456789012, "123.456789012 mm"), (0.12345678901234566, "123.45678901234566 mm"),
])
def test_rounding_in_the_last_digits_is_removed(value: float, written: str) -> None:
    assert length(value) == written
    assert float(written.removesuffix(" mm")) / 1000.0 == pytest.approx(value, rel=1e-15)


def test_vector_rounding_uses_the_largest_component() -> None:
    assert lengths((0.2 * math.cos(2 * math.pi / 3), 0.2 * math.sin(2 * math.pi / 3), 0.0)) == "-100 173.20508075688776 0 mm"
    assert length(-0.10000000000000007) == "-100.00000000000007 mm"
