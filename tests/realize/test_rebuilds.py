"""Which parts an edit rebuilds: counted with `modelled`, never by timing."""

from __future__ import annotations

import json
import shutil
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import thingc
from realize.conftest import modelled_parts
from thingc.geometry.client import Workers
from thingc.geometry.key import versions
from thingc.geometry.record import PartFailure, PartRecord

ARM = """
    from build123d import *
    from thingc import Length, Thing
    from shapes import plate

    class Base(Thing):
        def __init__(self, width: Length = 30):
            super().__init__()
            self.body = plate(width)

        def result(self):
            return self.body

    class Derived(Base):
        def __init__(self):
            super().__init__(width=12)
"""
LONELY = """
    from build123d import *
    from thingc import Thing

    class Lonely(Thing):
        def result(self):
            return Box(1, 2, 3)
"""
SHAPES = """
    from build123d import *

    def plate(width):
        return Box(width, 10, 2)

    def unused():
        return 1
"""
FILES = {"arm": ARM, "lonely": LONELY, "shapes": SHAPES}
TEXTS = ("arm:Base", "arm:Derived", "lonely:Lonely")


def realize(place: Any, definitions: list[Any]) -> tuple[list[str], dict[str, Any], dict[str, str]]:
    """Return which parts were modelled, the records and the reasons, as in a new process."""
    with place.service() as service:
        found = service.realize(definitions)
        assert sorted(service.decisions) == sorted(found)
        reasons = {text: decision.reason for text, decision in service.decisions.items()}
        return sorted(modelled_parts(service)), found, reasons


@pytest.fixture(scope="module")
def before(module_place: Any, define: Callable[..., Any]) -> dict[str, Any]:
    """Return the records of the unchanged files, modelled once."""
    for name, text in FILES.items():
        module_place.write(f"parts/{name}.py", text)
    modelled, records, reasons = realize(module_place, [define(text) for text in TEXTS])
    assert modelled == sorted(TEXTS) and set(reasons.values()) == {"first time"}
    return records


@pytest.mark.parametrize(
    ("file", "old", "new", "modelled", "different"),
    [
        ("lonely", "class Lonely", "# a comment\n\n    class Lonely", [], []),
        ("lonely", "Box(1, 2, 3)", "Box(1, 2, 4)", ["lonely:Lonely"], ["lonely:Lonely"]),
        ("arm", "width=12", "width=13", ["arm:Derived"], ["arm:Derived"]),
        ("arm", "__init__()\n", "__init__(material='pla')\n", ["arm:Base", "arm:Derived"], ["arm:Base", "arm:Derived"]),
        ("shapes", "10, 2)", "10, 3)", ["arm:Base", "arm:Derived"], ["arm:Base", "arm:Derived"]),
        ("shapes", "return 1", "return 2", [], []),
    ],
)
def test_code_edits_rebuild_only_affected_parts(
    module_place: Any, before: dict[str, Any], define: Callable[..., Any], file: str, old: str, new: str, modelled: list[str],
    different: list[str],
) -> None:
    definitions = [define(text) for text in TEXTS]
    module_place.write(f"parts/{file}.py", FILES[file].replace(old, new))
    again, after, reasons = realize(module_place, definitions)
    module_place.write(f"parts/{file}.py", FILES[file])
    assert again == modelled
    for text in TEXTS:
        unchanged = "no dependency changed since it was modelled (first time)"
        assert reasons[text] == (f"module `{file}` changed" if text in modelled else unchanged)
        same = (after[text].volume, after[text].meshes, after[text].material) == (
            before[text].volume, before[text].meshes, before[text].material
        )
        assert same == (text not in different)
    assert realize(module_place, definitions)[0] == []  # the records of before are still there


def test_class_line_follows_comments(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/lonely.py", LONELY)
    _, before, _ = realize(place, [define("lonely:Lonely")])
    place.write("parts/lonely.py", "\n\n\n" + LONELY)
    modelled, after, _ = realize(place, [define("lonely:Lonely")])
    assert modelled == []
    assert after["lonely:Lonely"].code[1] == before["lonely:Lonely"].code[1] + 3


def test_new_parameters_make_a_new_part(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/shapes.py", SHAPES)
    place.write("parts/arm.py", ARM)
    realize(place, [define("arm:Base", width=0.03)])
    modelled, found, reasons = realize(place, [define("arm:Base", width=0.03), define("arm:Base", width=0.042)])
    assert modelled == ["arm:Base(width=0.042)"]
    assert reasons["arm:Base(width=0.042)"] == "parameters are new"
    assert found["arm:Base(width=0.042)"].volume == pytest.approx(0.042 * 0.01 * 0.002, rel=1e-12)


READERS = """
    import json
    import os
    from pathlib import Path
    from build123d import *
    from thingc import Thing, asset

    HERE = Path(__file__).parent

    class FromStep(Thing):
        def result(self):
            return import_step(HERE / "body.step").solids()[0]

    class FromBrep(Thing):
        def result(self):
            return import_brep(str(HERE / "body.brep"))

    class FromStl(Thing):
        def result(self):
            return Mesher().read(HERE / "body.stl")[0]

    class FromKernel(Thing):
        def result(self):
            from OCP.STEPControl import STEPControl_Reader
            reader = STEPControl_Reader()
            reader.ReadFile(str(HERE / "kernel.step"))
            reader.TransferRoots()
            return Solid(reader.OneShape())

    class FromJson(Thing):
        def result(self):
            return Box(*json.loads((HERE / "size.json").read_text()))

    class FromAsset(Thing):
        def __init__(self):
            super().__init__()
            self.body = Box(*json.loads(asset("asset.json").read_text()))

        def result(self):
            return self.body

    class Optional(Thing):
        def result(self):
            return Box(1, 1, 9) if os.path.exists(HERE / "tall.flag") else Box(1, 1, 1)

    class Tried(Thing):
        def result(self):
            try:
                with open(HERE / "tried.txt") as stream:
                    return Box(1, 1, float(stream.read()))
            except FileNotFoundError:
                return Box(1, 1, 2)

    class Listing(Thing):
        def result(self):
            return Box(1, 1, 1 + len(os.listdir(HERE / "layers")))

    class Chain(Thing):
        def result(self):
            return Box(1, 1, float((HERE / (HERE / "which.txt").read_text().strip()).read_text()))

    class Dynamic(Thing):
        def result(self):
            import importlib
            return Box(1, 1, importlib.import_module("hid" + "den").SIZE)

    class Own(Thing):
        def result(self):
            import tempfile
            with tempfile.TemporaryDirectory() as folder:
                path = os.path.join(folder, "x.txt")
                Path(path).write_text("3")
                return Box(1, 1, float(Path(path).read_text()))

    class Itself(Thing):
        def result(self):
            return Box(1, 1, Path(__file__).read_text().count("a remark for Itself"))

    class Reader(Thing):
        def result(self):
            assert Path(__file__).resolve().exists() and os.path.getsize(__file__)
            return Box(1, 2, 3)
"""
ALL = (
    "FromStep", "FromBrep", "FromStl", "FromKernel", "FromJson", "FromAsset", "Optional", "Tried", "Listing", "Chain", "Dynamic",
    "Own", "Itself", "Reader",
)


@pytest.fixture(scope="module")
def geometry(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with bodies of two heights in every format, written by build123d in another process."""
    import subprocess
    import sys

    folder = tmp_path_factory.mktemp("geometry")
    script = (
        "import sys; from thingc.geometry.worker.lazy_build123d import import_cheaply; import_cheaply('build123d')\n"
        "from build123d import *\n"
        "for h in (5, 6):\n"
        "    b = Box(10, 10, h); f = sys.argv[1] + f'/{h}'\n"
        "    export_step(b, f + '.step'); export_brep(b, f + '.brep'); export_stl(b, f + '.stl')\n"
        "    m = Mesher(); m.add_shape(b); m.write(f + '.3mf')\n"
    )
    subprocess.run([sys.executable, "-c", script, str(folder)], check=True)
    return folder


@pytest.fixture(scope="module")
def readers(module_place: Any, geometry: Path, define: Callable[..., Any]) -> dict[str, Any]:
    """Return the reader parts, modelled once with every file in its initial state."""
    module_place.write("parts/readers.py", READERS)
    module_place.write("parts/hidden.py", "SIZE = 4\n")
    files = {"size.json": "[1, 2, 3]", "asset.json": "[1, 2, 3]", "which.txt": "a.txt", "a.txt": "7", "layers/one": ""}
    for name, text in files.items():
        module_place.write(f"parts/{name}", text)
    for suffix in ("step", "brep", "stl"):
        (module_place.parts / f"body.{suffix}").write_bytes((geometry / f"5.{suffix}").read_bytes())
    (module_place.parts / "kernel.step").write_bytes((geometry / "5.step").read_bytes())
    modelled, found, _ = realize(module_place, [define(f"readers:{name}") for name in ALL])
    assert modelled == sorted(f"readers:{name}" for name in ALL)
    assert [record for record in found.values() if isinstance(record, PartFailure)] == []
    assert found["readers:FromStl"].volume == pytest.approx(5e-7, rel=1e-6)
    return found


def test_no_change_rebuilds_nothing(readers: dict[str, Any], module_place: Any, define: Callable[..., Any]) -> None:
    assert realize(module_place, [define(f"readers:{name}") for name in ALL])[0] == []


@pytest.mark.parametrize(
    ("name", "file", "content", "volume", "reason"),
    [
        ("FromStep", "body.step", "6.step", 6e-7, "file parts/body.step changed"),
        ("FromBrep", "body.brep", "6.brep", 6e-7, "file parts/body.brep changed"),
        ("FromStl", "body.stl", "6.stl", 6e-7, "file parts/body.stl changed"),
        ("FromKernel", "kernel.step", "6.step", 6e-7, "file parts/kernel.step changed"),
        ("FromJson", "size.json", b"[1, 2, 4]", 8e-9, "file parts/size.json changed"),
        ("FromAsset", "asset.json", b"[1, 2, 4]", 8e-9, "file parts/asset.json changed"),
        ("Optional", "tall.flag", b"", 9e-9, "file parts/tall.flag appeared"),
        ("Tried", "tried.txt", b"3", 3e-9, "file parts/tried.txt appeared"),
        ("Listing", "layers/two", b"", 3e-9, "folder parts/layers contains other files"),
        ("Chain", "a.txt", b"8", 8e-9, "file parts/a.txt changed"),
        ("Dynamic", "hidden.py", b"SIZE = 5\n", 5e-9, "file parts/hidden.py changed"),
        ("Itself", "readers.py", f"{textwrap.dedent(READERS)}# a remark for Itself\n".encode(), 2e-9, "file parts/readers.py changed"),
    ],
)
def test_changed_file_rebuilds_only_its_readers(
    readers: dict[str, Any], module_place: Any, geometry: Path, define: Callable[..., Any],
    name: str, file: str, content: str | bytes, volume: float, reason: str,
) -> None:
    path = module_place.parts / file
    before = path.read_bytes() if path.exists() else None
    path.write_bytes((geometry / content).read_bytes() if isinstance(content, str) else content)
    try:
        definitions = [define(f"readers:{one}") for one in ALL]
        modelled, found, reasons = realize(module_place, definitions)
        assert modelled == [f"readers:{name}"]
        assert reasons[f"readers:{name}"] == reason
        assert found[f"readers:{name}"].volume == pytest.approx(volume, rel=1e-6)
        assert realize(module_place, definitions)[0] == []
    finally:
        path.unlink() if before is None else path.write_bytes(before)
    assert realize(module_place, definitions)[0] == []  # the earlier answer is kept beside the later one


def test_chained_file_reads_are_tracked(readers: dict[str, Any], module_place: Any, define: Callable[..., Any]) -> None:
    which = module_place.write("parts/which.txt", "b.txt")
    try:
        modelled, found, _ = realize(module_place, [define("readers:Chain")])
        assert isinstance(found["readers:Chain"], PartFailure)
        assert modelled == ["readers:Chain"]
        module_place.write("parts/b.txt", "6")  # appears: the failure was for want of it
        modelled, found, _ = realize(module_place, [define("readers:Chain")])
        assert modelled == ["readers:Chain"]
        assert found["readers:Chain"].volume == pytest.approx(6e-9)
    finally:
        which.write_text("a.txt")


@pytest.mark.parametrize("suffix", ["step", "brep", "stl", "3mf", "obj"])
def test_file_parts_are_rebuilt_when_the_file_changes(place: Any, geometry: Path, define_file: Callable[[str], Any], suffix: str) -> None:
    def put(height: int) -> None:
        target = place.root / f"body.{suffix}"
        if suffix == "obj":
            z = height / 2
            corners = [(x, y, s * z) for s in (-1, 1) for y in (-5, 5) for x in (-5, 5)]
            faces = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"]
            lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {face}" for face in faces]
            target.write_text("\n".join(lines))
        else:
            target.write_bytes((geometry / f"{height}.{suffix}").read_bytes())

    put(5)
    definition = define_file(f"body.{suffix}")
    modelled, found, _ = realize(place, [definition])
    record = found[definition.text]
    assert isinstance(record, PartRecord), record
    assert record.volume == pytest.approx(5e-7, rel=1e-6)
    assert record.area == pytest.approx(2 * (1e-4 + 2 * 5e-5), rel=1e-6)
    assert record.meshes["print"].closed
    assert realize(place, [definition])[0] == []
    put(6)
    modelled, found, reasons = realize(place, [definition])
    assert modelled == [definition.text]
    assert reasons[definition.text] == f"file body.{suffix} changed"
    assert found[definition.text].volume == pytest.approx(6e-7, rel=1e-6)


def test_hollow_mesh_keeps_its_cavity(place: Any, define_file: Callable[[str], Any]) -> None:
    def cube(half: float, inwards: bool, first: int) -> tuple[list[str], list[str]]:
        corners = [(x * half, y * half, z * half) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
        faces = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]
        turned = [face[::-1] if inwards else face for face in faces]
        return [f"v {x} {y} {z}" for x, y, z in corners], ["f " + " ".join(str(i + first) for i in face) for face in turned]

    outer, inner = cube(5, False, 0), cube(2, True, 8)
    (place.root / "hollow.obj").write_text("\n".join(outer[0] + inner[0] + outer[1] + inner[1]))
    _, found, _ = realize(place, [define_file("hollow.obj")])
    assert found["hollow.obj"].volume == pytest.approx(1e-6 - 6.4e-8, rel=1e-9)
    assert found["hollow.obj"].inertia[0][0] == pytest.approx((10**5 - 4**5) / 6 * 1e-15, rel=1e-9)


def test_invalid_file_parts(place: Any, define_file: Callable[[str], Any]) -> None:
    (place.root / "open.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (place.root / "text.step").write_text("no step")
    definitions = [define_file(name) for name in ("open.obj", "text.step", "gone.step", "../outside.step")]
    with place.service() as service:
        found = service.realize(definitions)
    assert {text: failure.kind for text, failure in found.items()} == {
        "open.obj": "invalid", "text.step": "invalid", "gone.step": "missing", "../outside.step": "refused",
    }
    assert found["open.obj"].message == "the surface is not closed (3 edges belong to only one triangle)"
    assert found["gone.step"].candidates == ("open.obj", "text.step")


def test_unrelated_sources_do_not_shadow_libraries(place: Any, define: Callable[..., Any], monkeypatch: Any) -> None:
    place.write("parts/dask/readme.txt", "no package")
    place.write("parts/scipy.py", "raise RuntimeError('not the library')")
    place.write("build123d.py", "raise RuntimeError('the working folder is no place for imports')")
    text = "from build123d import *\nfrom thingc import Thing\nclass A(Thing):\n    def result(self):\n"
    lines = "        import scipy.optimize, sklearn\n        return extrude(make_hull(Rectangle(1, 1).edges()), 1)\n"
    place.write("parts/arm.py", text + lines)
    monkeypatch.chdir(place.root)
    _, found, _ = realize(place, [define("arm:A")])
    assert isinstance(found["arm:A"], PartRecord), found["arm:A"]


def test_packages_as_part_modules(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/robot/__init__.py", "from .leg import Leg\n")
    place.write("parts/robot/leg.py", "from . import sizes\nfrom thingc import Thing\nfrom build123d import Box\n"
                "class Leg(Thing):\n    def result(self):\n        return Box(sizes.A, 1, 1)\n")
    place.write("parts/robot/sizes.py", "A = 2\nB = 3\n")
    place.write("parts/plain/foot.py", "from robot.sizes import B\nfrom thingc import Thing\nfrom build123d import Box\n"
                "class Foot(Thing):\n    def result(self):\n        return Box(B, 1, 1)\n")
    definitions = [define("robot:Leg"), define("robot.leg:Leg"), define("plain.foot:Foot")]
    modelled, found, _ = realize(place, definitions)
    assert [found[d.text].volume for d in definitions] == pytest.approx([2e-9, 2e-9, 3e-9])
    place.write("parts/robot/sizes.py", "A = 2\nB = 4\n")
    assert realize(place, definitions)[0] == ["plain.foot:Foot", "robot.leg:Leg", "robot:Leg"]


def test_module_that_becomes_a_package_is_rebuilt(place: Any, define: Callable[..., Any]) -> None:
    """`Path(__file__).parent` changes, so the part reads another file."""
    place.write("parts/arm.py", "from pathlib import Path\nfrom build123d import Box\nfrom thingc import Thing\nclass A(Thing):\n"
                "    def result(self):\n        return Box(1, 1, float((Path(__file__).parent / 'size.txt').read_text()))\n")
    place.write("parts/size.txt", "2")
    place.write("parts/arm/size.txt", "3")
    assert realize(place, [define("arm:A")])[1]["arm:A"].volume == pytest.approx(2e-9)
    (place.parts / "arm.py").rename(place.parts / "arm" / "__init__.py")
    modelled, found, reasons = realize(place, [define("arm:A")])
    assert modelled == ["arm:A"] and reasons["arm:A"] == "module `arm` changed"
    assert found["arm:A"].volume == pytest.approx(3e-9)


def test_schemas_are_cached_by_code(place: Any, tmp_path: Path) -> None:
    place.write("parts/shapes.py", SHAPES)
    place.write("parts/arm.py", ARM)
    untouched = Workers(1)
    with place.service() as service:
        first = service.describe(["arm:Base", "arm:Derived"])
    place.write("parts/arm.py", "\n    # moved" + ARM)
    with place.service(workers=untouched) as service:
        second = service.describe(["arm:Base", "arm:Derived"])
    assert not untouched.running
    assert second["arm:Base"].line == first["arm:Base"].line + 1
    assert second["arm:Base"].parameters == first["arm:Base"].parameters
    place.write("parts/arm.py", ARM.replace("Length = 30", "Length = 31"))
    with place.service() as service:
        third = service.describe(["arm:Base", "arm:Derived"])
    assert third["arm:Base"].parameters[0].default == 0.031
    assert json.dumps(third["arm:Derived"].doc) == '""'


@pytest.mark.parametrize("changed", ["geometry/worker/kernel/integrals.py", "base/inertia.py"])
def test_changed_compiler_source_changes_the_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str) -> None:
    monkeypatch.setattr(versions, "OWN_FOLDER", str(tmp_path))
    for room in ("base", "geometry"):
        shutil.copytree(Path(thingc.__file__).parent / room, tmp_path / room)
    before = versions.compiler_version.__wrapped__()
    module = tmp_path / changed
    module.write_text(module.read_text() + "# another one\n")
    assert versions.compiler_version.__wrapped__() != before
