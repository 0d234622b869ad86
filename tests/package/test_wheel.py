"""The wheel and the sdist: their files and metadata, reproducible builds, and installations from both."""

from __future__ import annotations

import json
import os
import re
import subprocess
import tarfile
import tomllib
import zipfile
from email.message import Message
from email.parser import BytesParser
from pathlib import Path

import mujoco
import pytest

import thingc
from package.installed import ROOT, Installed, build, run_module

pytestmark = pytest.mark.slow

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
INFO = f"thingc-{thingc.__version__}.dist-info"


@pytest.fixture(scope="module")
def wheel(dist: Path) -> Path:
    return dist / f"thingc-{thingc.__version__}-py3-none-any.whl"


@pytest.fixture(scope="module")
def sdist(dist: Path) -> Path:
    return dist / f"thingc-{thingc.__version__}.tar.gz"


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    with zipfile.ZipFile(wheel) as archive:
        return BytesParser().parsebytes(archive.read(f"{INFO}/METADATA"))


def sources(*folders: str) -> dict[str, bytes]:
    """Return the files in some folders of the repository by path, including new files."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *folders]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")[:-1]
    return {name: (ROOT / name).read_bytes() for name in names if (ROOT / name).exists()}


def test_build_ignores_folder_times_and_umask(dist: Path, sdist: Path, tmp_path: Path) -> None:
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    copy = (tmp_path / sdist.name.removesuffix(".tar.gz")).rename(tmp_path / "elsewhere")
    for path in (copy, *copy.rglob("*")):
        path.chmod(0o700 if path.is_dir() else 0o600)
        os.utime(path, (1.5e9, 1.5e9))
    build(copy, tmp_path / "again")
    assert sorted(path.name for path in dist.iterdir()) == sorted(path.name for path in (tmp_path / "again").iterdir())
    for path in dist.iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes(), path.name


def test_wheel_contains_exactly_the_files_of_both_packages(wheel: Path) -> None:
    """The files include pages of the viewer, templates of workspaces (also hidden ones), examples of diagnostics, stock parts and
    `py.typed`."""
    expected = {name.partition("/")[2]: data for name, data in sources("compiler/thingc", "parts/thingc_stock").items()}
    with zipfile.ZipFile(wheel) as archive:
        found = {name: archive.read(name) for name in archive.namelist() if not name.startswith(INFO)}
        assert archive.read(f"{INFO}/licenses/LICENSE") == (ROOT / "LICENSE").read_bytes()
        stamps = {entry.date_time for entry in archive.infolist()}
    assert found == expected
    assert stamps == {(2023, 11, 14, 22, 13, 20)}
    for name in (
        "thingc/py.typed", "thingc/targets/html/page/viewer.js", "thingc/tools/templates/common/dot_gitignore",
        "thingc/tools/reporting/examples.json", "thingc_stock/materials.yaml",
    ):
        assert name in found


def test_sdist_contains_the_sources_without_pictures(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    others = {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "PKG-INFO", ".gitignore"}
    assert names == {*sources("compiler/thingc", "parts/thingc_stock"), *others}


def test_metadata(metadata: Message) -> None:
    assert (metadata["Name"], metadata["Version"]) == ("thingc", thingc.__version__)
    assert (metadata["License-Expression"], metadata["License-File"]) == ("Apache-2.0", "LICENSE")
    assert metadata["Requires-Python"] == PROJECT["requires-python"]
    assert set(metadata.get_all("Provides-Extra", [])) == set(PROJECT["optional-dependencies"])
    required = [line for line in metadata.get_all("Requires-Dist", []) if "extra ==" not in line]
    assert len(required) == len(PROJECT["dependencies"])
    versions = re.findall(r"Python :: (3\.\d+)$", "\n".join(metadata.get_all("Classifier", [])), re.MULTILINE)
    assert versions == ["3.11", "3.12", "3.13", "3.14"]


def test_links_in_the_description_are_absolute(metadata: Message) -> None:
    """PyPI shows the README without the repository. The repository has a tag for each version."""
    targets, written = (re.findall(r"\]\(([^)]+)\)", text) for text in (metadata.get_payload(), (ROOT / "README.md").read_text()))
    assert len(targets) == len(written) > 40 and all(target.startswith("https://") for target in targets)
    prefixes = re.compile(rf"https://(raw\.githubusercontent\.com/thingc/thingc|github\.com/thingc/thingc/blob)/v{thingc.__version__}/(.+)")
    own = [match[2] for target in targets if (match := prefixes.match(target))]
    assert len(own) > 30 and all((ROOT / path.partition("#")[0]).exists() for path in own)
    assert {Path(path).suffix for path in own if "raw." in path or path.startswith("docs/pictures/")} <= {".png", ".svg"}


def test_pip_builds_the_same_wheel_from_the_sdist(wheel: Path, sdist: Path, tmp_path: Path) -> None:
    """Therefore, the next test also covers an installation from the sdist."""
    run_module("pip", "wheel", "--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", str(tmp_path), str(sdist))
    assert (tmp_path / wheel.name).read_bytes() == wheel.read_bytes()


def test_installed_thingc_creates_and_builds_a_robot(installed: Installed, tmp_path: Path) -> None:
    rover = tmp_path / "rover"
    code = "import sys, thingc, thingc_stock; print(thingc.__file__, *thingc_stock.__path__, *sys.path, sep='\\n')"
    places = installed.run(tmp_path, "python", "-P", "-c", code).splitlines()
    assert all(Path(place).is_relative_to(installed.packages) for place in places[:2])
    assert not any(Path(place).is_relative_to(ROOT / "compiler") or Path(place) == ROOT / "parts" for place in places)

    assert installed.run(tmp_path, "thingc", "--version") == f"thingc {thingc.__version__}\n"
    installed.run(tmp_path, "thingc", "new", "rover", "--template", "empty")
    installed.run(rover, "thingc", "build", "--strict", "rover.yaml", "--emit", "mjcf,html,ros", "--jobs", "1")
    model = mujoco.MjModel.from_xml_path(str(rover / "build/rover/mjcf/scene_standing.xml"))
    assert model.nu == 1 and (rover / "build/rover/html/rover.html").stat().st_size > 500_000
    assert "TC101" in installed.run(tmp_path, "thingc", "explain", "TC101")
    code = "import json; from thingc.tools.schemas.general_schema import json_schema; print(json.dumps(json_schema('assembly')))"
    committed = json.loads((ROOT / "schemas/assembly-1.json").read_text(encoding="utf-8"))
    assert {**json.loads(installed.run(tmp_path, "python", "-c", code)), "$id": committed["$id"]} == committed
