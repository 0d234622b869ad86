"""Documents of packages: `materials: [thingc_stock.materials]` is found without importing anything, and has the same name on every
machine."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bd_materials
import pytest
import yaml

from conformance.harness import thingc, thingc_here
from load.test_documents import HEAD, read, said, write
from thingc.base.diagnostics import Code, Report
from thingc.documents.load.discovery import packaged_documents
from thingc.documents.workspace import Workspace

SETTINGS = 'thingc = "workspace/1"\npackages = ["thingc_stock", "nuts", "missing"]\n'
NUTS = "thingc: materials/1\nmaterials: {nickel: {density: 8900 kg/m^3}}\n"
TRAP = "raise SystemExit('the package was imported')\n"
ASSEMBLY = HEAD + "materials: [{}]\ncomponents: {{t: {{frame: true, mass: 1 g}}}}\n"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of installed packages with `nuts`, in an environment inside the workspace, like a `.venv`."""
    site = tmp_path / ".venv" / "lib" / "site-packages"
    write(site, {
        "nuts/__init__.py": TRAP, "nuts/metals.yaml": NUTS, "nuts/inner/__init__.py": TRAP, "nuts/inner/soft.toml":
        'thingc = "materials/1"\n[materials.felt]\ndensity = "200 kg/m^3"\n', "nuts/robot.yaml": ASSEMBLY.format("nuts.metals"),
        "nuts/notes.yaml": "shopping: [milk]\n", "bolts/__init__.py": "", "bolts/metals.yaml": NUTS,
    })
    (site / "nuts" / "away.yaml").symlink_to("/etc/passwd")
    monkeypatch.setattr("thingc.base.installed_packages.import_path", lambda: (str(site), *sys.path))
    return site


@pytest.mark.parametrize(("text", "file"), [("nuts.metals", "nuts/metals.yaml"), ("nuts.inner.soft", "nuts/inner/soft.toml")])
def test_document_of_an_installed_package_is_found(tmp_path: Path, installed: Path, text: str, file: str) -> None:
    documents, report = read(tmp_path, {"thingc.toml": SETTINGS, "a.yaml": ASSEMBLY.format(text)})
    assert documents is not None and not report.diagnostics
    assert list(documents.by_path) == ["a.yaml", text]
    found = documents.find_referenced(documents.root, text)
    assert found is not None and found.path == str(installed / file)
    assert str(installed / file) in documents.files


def test_part_folder_takes_precedence_over_packages(tmp_path: Path, installed: Path) -> None:
    documents, report = read(tmp_path, {
        "thingc.toml": SETTINGS, "parts/nuts/__init__.py": TRAP, "parts/nuts/metals.yml": NUTS, "a.yaml": ASSEMBLY.format("nuts.metals"),
    })
    assert documents is not None and not report.diagnostics
    assert list(documents.by_path) == ["a.yaml", "parts/nuts/metals.yml"]
    assert str(tmp_path / "parts/nuts/metals.yaml") in documents.files  # it would have been taken


@pytest.mark.parametrize(("text", "code", "message", "help"), [
    ("nuts.metal", Code.MISSING_FILE, "there is no document `nuts.metal` in the package `nuts`",
     "did you mean `nuts.metals`?"),
    ("nuts.away", Code.MISSING_FILE, "there is no document `nuts.away` in the package `nuts`",
     # a link out of the package
     "did you mean `nuts.metals`?"),
    ("missing.metals", Code.MISSING_FILE, "the package `missing` is not installed", "install the package `missing`"),
    ("bolts.metals", Code.FILE_TYPE, "expected a materials document (.yaml, .yml, .toml), found `bolts.metals`",
     "did you mean `nuts.metals`?"),  # installed, and not allowed
    ("metals.txt", Code.FILE_TYPE, "expected a materials document (.yaml, .yml, .toml), found `metals.txt`", None),
    ("nuts.robot", Code.WRONG_KIND, "expected a materials document, found `nuts.robot` of kind `assembly`", None),
])
def test_invalid_package_names_are_reported(
    tmp_path: Path, installed: Path, text: str, code: Code, message: str, help: str | None,
) -> None:
    _, report = read(tmp_path, {"thingc.toml": SETTINGS, "a.yaml": ASSEMBLY.format(text)})
    assert said(report) == [(code, message, help, ("a.yaml", 3, 13))]


def test_packaged_documents_are_listed(tmp_path: Path, installed: Path) -> None:
    write(tmp_path, {"thingc.toml": SETTINGS, "parts/own/plates.yaml": NUTS, "parts/own/robot.yaml": ASSEMBLY.format("own.plates")})
    workspace = Workspace.find(str(tmp_path / "a.yaml"), Report())
    assert workspace is not None
    assert list(packaged_documents(workspace)) == ["nuts.metals", "own.plates", "thingc_stock.materials"]


def test_stock_materials_are_complete() -> None:
    """Every material has all properties that a part needs. Densities are compared with another library, if it has the material."""
    path = Path(__file__).resolve().parents[2] / "parts/thingc_stock/materials.yaml"
    materials = yaml.safe_load(path.read_text())["materials"]
    compared = 0
    for name, one in materials.items():
        density = float(one["density"].removesuffix(" kg/m^3"))
        assert one["color"] and 0.0 < one["friction"]["slide"] <= 1.0, name
        if name.partition("_")[0] in bd_materials.material_names():
            compared += 1
            assert density == pytest.approx(bd_materials.resolve(name.partition("_")[0]).material.density, rel=0.05), name
    assert len(materials) > 35 and compared > 15


def test_commands_support_packaged_documents(tmp_path: Path, shared_store: str) -> None:
    """`check` with and without code, the manifest of a build, and up-to-date checks include them."""
    write(tmp_path, {
        "a.yaml": HEAD + "materials: [thingc_stock.materials]\ncomponents: {s: {part: 'plates:Plate', material: brass}}\n",
        "parts/plates.py": "from build123d import Box\n\nfrom thingc import Thing\n\n\nclass Plate(Thing):\n"
        "    def __init__(self):\n        super().__init__()\n\n    def result(self):\n        return Box(10, 10, 10)\n",
    })
    run = {"store": shared_store, "cwd": tmp_path}
    assert thingc_here("lock", **run).code == 0
    assert thingc_here("check", "a.yaml", **run).out == "a.yaml: ok\n"
    program = str(Path(sys.executable).with_name("thingc"))  # `python -m` looks into the working folder first, and is refused
    done = subprocess.run([program, "check", "--no-code", "a.yaml"], cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout == "a.yaml: ok\n", done
    assert "x: 8.50 g" in thingc_here("info", "a.yaml", **run).out
    assert thingc_here("build", "a.yaml", "--emit", "bom", **run).code == 0
    assert '"thingc_stock.materials": "' in (tmp_path / "build/x/manifest.json").read_text()
    assert "is up to date" in thingc("build", "a.yaml", "--emit", "bom", **run).err
