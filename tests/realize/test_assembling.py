"""STEP files of assemblies, read back with the CAD kernel: names, colours, poses and shared shapes."""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from thingc.base.pose import Pose, make_translation, turned_z
from thingc.geometry.client import Workers, begin_once
from thingc.geometry.record import AssemblyFailed, Placed
from thingc.geometry.worker.kernel.step_order import sort_styles, without_noise

PARTS = """
    from build123d import *
    from thingc import Thing

    class Block(Thing):
        def result(self):
            return Pos(1, 0, 0) * Box(30, 20, 10)

    class Pair(Thing):
        def result(self):
            return [Box(10, 10, 10), Pos(20, 0, 0) * Box(10, 10, 10)]

    class Rod(Thing):
        def result(self):
            return Cylinder(3, 40)
"""


@pytest.fixture(scope="module")
def instances(module_place: Any, define: Callable[..., Any]) -> list[Placed]:
    """Return two blocks and a rod in nested groups."""
    module_place.write("parts/parts_.py", PARTS)
    with module_place.service() as service:
        found = service.realize([define("parts_:Block"), define("parts_:Rod"), define("parts_:Pair")])
    block, rod, pair = (found[f"parts_:{name}"] for name in ("Block", "Rod", "Pair"))
    return [
        Placed(path="plate", definition="parts_:Block", brep=block.brep, pose=Pose(), color="#ff8000"),
        Placed(path="hand/cap", definition="parts_:Block", brep=block.brep, pose=make_translation(0.1, 0, 0.05) @ turned_z(math.pi / 2),
               color="#0040ff"),
        Placed(path="hand/inner/rod", definition="Gehäuse Ø5 it's 𝒳.step", brep=rod.brep, pose=make_translation(0, 0, 0.2), color=None),
        Placed(path="two", definition="parts_:Pair", brep=pair.brep, pose=make_translation(0, 0, 0.3), color="#102030"),
        Placed(path="other", definition="parts_:Pair", brep=pair.brep, pose=make_translation(0, 0, 0.4), color="#102030"),
    ]


def leaves(path: Path) -> tuple[dict[str, tuple[Any, str | None]], set[str]]:
    """Return the leaf instances by path with their placed shape and colour, and the names of the definitions."""
    from OCP.collections import Sequence_TDF_Label
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_Label
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

    document = TDocStd_Document(TCollection_ExtendedString("x"))
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    reader.ReadFile(str(path))
    assert reader.Transfer(document)
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    found: dict[str, tuple[Any, str | None]] = {}
    definitions: set[str] = set()

    def name_of(label: Any) -> str:
        attribute = TDataStd_Name()
        assert label.FindAttribute(TDataStd_Name.GetID_s(), attribute)
        return str(attribute.Get().ToExtString())

    def walk(label: Any, path: str, location: Any) -> None:
        parts = Sequence_TDF_Label()
        XCAFDoc_ShapeTool.GetComponents_s(label, parts)
        for index in range(1, parts.Length() + 1):
            component = parts.Value(index)
            target = TDF_Label()
            assert XCAFDoc_ShapeTool.GetReferredShape_s(component, target)
            placed = location.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(component))
            own = f"{path}/{name_of(component)}" if path else name_of(component)
            if XCAFDoc_ShapeTool.IsAssembly_s(target):
                walk(target, own, placed)
                continue
            definitions.add(name_of(target))
            color, kind = Quantity_Color(), XCAFDoc_ColorType.XCAFDoc_ColorSurf
            has = colors.GetInstanceColor(XCAFDoc_ShapeTool.GetShape_s(component), kind, color) or all(
                colors.GetColor(solid, kind, color) for solid in solids_of(XCAFDoc_ShapeTool.GetShape_s(target))
            )
            shade = None
            if has:
                channels = color.Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)
                shade = "#" + "".join(f"{round(255 * channel):02x}" for channel in channels)
            found[own] = (XCAFDoc_ShapeTool.GetShape_s(target).Located(placed), shade)

    roots = Sequence_TDF_Label()
    shapes.GetFreeShapes(roots)
    assert roots.Length() == 1
    assert name_of(roots.Value(1)) == "robot"
    walk(roots.Value(1), "", TopLoc_Location())
    return found, definitions


def solids_of(shape: Any) -> list[Any]:
    from OCP.TopAbs import TopAbs_SOLID
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, TopAbs_SOLID)
    found = []
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def centre_of(shape: Any) -> tuple[float, float, float]:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    point = properties.CentreOfMass()
    return point.X(), point.Y(), point.Z()


def test_step_file_round_trip(module_place: Any, instances: list[Placed], tmp_path: Path) -> None:
    with module_place.service() as service:
        made = service.assemble("robot", instances)()
    data = module_place.store.read(made.sha256)
    assert len(data) == made.size
    path = tmp_path / "robot.step"
    path.write_bytes(data)
    found, definitions = leaves(path)
    assert list(found) == ["plate", "hand/cap", "hand/inner/rod", "two", "other"]
    assert definitions == {"parts_:Block", "Gehäuse Ø5 it's 𝒳.step", "parts_:Pair"}
    # ISO 10303-21, 6.4.3.3: U+00E4, U+00D8, U+1D4B3
    assert b"PRODUCT('Geh\\X2\\00E4\\X0\\use \\X2\\00D8\\X0\\5 it''s \\X4\\0001D4B3\\X0\\.step'," in data and data.isascii()
    assert {name: color for name, (_, color) in found.items()} == {
        "plate": "#ff8000", "hand/cap": "#0040ff", "hand/inner/rod": None, "two": "#102030", "other": "#102030",
    }
    # the centre of a block is 1 mm along its own x
    assert centre_of(found["plate"][0]) == pytest.approx((1, 0, 0), abs=1e-6)
    assert centre_of(found["hand/cap"][0]) == pytest.approx((100, 1, 50), abs=1e-6)
    assert centre_of(found["hand/inner/rod"][0]) == pytest.approx((0, 0, 200), abs=1e-6)
    assert centre_of(found["other"][0]) == pytest.approx((10, 0, 400), abs=1e-6)
    assert len(re.findall(rb"MANIFOLD_SOLID_BREP", data)) == 4
    header = data[: data.index(b"ENDSEC")].decode()
    assert "2000-01-01T00:00:00" in header
    assert "thingc" in header
    assert "Open CASCADE" not in header
    for word in (str(tmp_path), module_place.store.root, tempfile.gettempdir()):
        assert word.encode() not in data


def test_step_bytes_are_equal_across_processes(
    module_place: Any, instances: list[Placed], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel writes styles in the order of memory addresses, which differ between processes."""
    from thingc.geometry.store.local import Store

    monkeypatch.setattr("thingc.geometry.client.begin_once", begin_once)  # a process for each file
    many = [
        replace(instance, path=f"row_{k}/{instance.path}", pose=make_translation(0, k / 10, 0) @ instance.pose, color=f"#{k:02x}80{j:02x}")
        for k in range(6) for j, instance in enumerate(instances)
    ]
    with module_place.service() as service:
        found = [service.assemble("robot", many)()]
    store = module_place.store
    try:
        for k in range(2):
            module_place.store = Store(str(tmp_path / str(k)))
            for blob in {instance.brep for instance in instances}:
                module_place.store.put(store.read(blob))
            with module_place.service(workers=Workers(1)) as service:
                found.append(service.assemble("robot", many)())
    finally:
        module_place.store = store
    assert len(set(found)) == 1


def test_step_bytes_do_not_depend_on_style_order() -> None:
    styles = b"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION"
    head, tail = b"HEADER;\nENDSEC;\nDATA;\n#1 = A('#3;',#2);\n#2 = B();\n", b"ENDSEC;\nEND-ISO-10303-21;\n"
    one = (
        b"#3 = " + styles + b"('',(#4,#6),#1);\n#4 = STYLE('it''s #6;',#5);\n#5 = RED();\n#6 = STYLE('',#7);\n"
        b"#7 = BLUE(1.,\n  2.);\n#8 = " + styles + b"('',(#9),#2);\n#9 = STYLE('',#5);\n"
    )
    other = (
        b"#3 = " + styles + b"('',(#4),#2);\n#4 = STYLE('',#5);\n#5 = RED();\n"
        b"#6 = " + styles + b"('',(#8,#7),#1);\n#7 = STYLE('it''s #6;',#5);\n#8 = STYLE('',#9);\n#9 = BLUE(1.,2.);\n"
    )
    first = sort_styles(head + one + tail)
    assert first == sort_styles(head + other + tail) == sort_styles(first)
    assert first.startswith(head)
    assert first.endswith(tail)
    assert first.count(styles) == 2
    assert b"STYLE('it''s #6;'," in first
    assert sort_styles(head + tail) == head + tail


def test_coordinate_noise_is_rounded_to_zero() -> None:
    line = b"#9=CARTESIAN_POINT('1.5E-17 it''s',(0.25,1.97215226305253E-31,-9.6E-17,2.E-15,1.E-07,-3.E-14,1.5E+20));"
    assert without_noise(line) == b"#9=CARTESIAN_POINT('1.5E-17 it''s',(0.25,0.,0.,0.,1.E-07,-3.E-14,1.5E+20));"


def test_unchanged_assembly_starts_no_process(module_place: Any, instances: list[Placed], monkeypatch: pytest.MonkeyPatch) -> None:
    with module_place.service() as service:
        first = service.assemble("robot", instances)()
    untouched = Workers(1)
    import thingc.geometry.client as client

    monkeypatch.setattr(client, "begin_once", lambda *_: pytest.fail("a process was started"))
    with module_place.service(workers=untouched) as service:
        assert service.assemble("robot", instances)() == first
    assert not untouched.running


def test_other_requests_are_answered_while_the_file_is_written(module_place: Any, instances: list[Placed]) -> None:
    """Both use the same workers, which answer in any order."""
    with module_place.service(timeout=30.0) as service:
        waits = [service.assemble(name, instances) for name in ("first", "second")]
        for brep in sorted({instance.brep for instance in instances}):
            assert service.features([brep])[brep].planes
        written = [wait() for wait in reversed(waits)]
    for name, file in zip(("second", "first"), written, strict=True):
        assert f"PRODUCT('{name}'".encode() in module_place.store.read(file.sha256)


def test_missing_blob_fails_the_assembly(module_place: Any, instances: list[Placed]) -> None:
    broken = [Placed(path="a", definition="d", brep="0" * 64, pose=Pose(), color=None)]
    with module_place.service() as service, pytest.raises(AssemblyFailed) as caught:
        service.assemble("robot", broken)()
    assert caught.value.name == "robot"
    assert "does not contain a valid blob" in caught.value.detail
