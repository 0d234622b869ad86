"""Packages elsewhere on the import path: how they count as dependencies, and that their code is not followed.

The environment is a real virtual environment whose `.pth` file adds the packages of the current environment, thingc, and folders of the
test."""

from __future__ import annotations

import os
import py_compile
import subprocess
import sysconfig
import textwrap
import venv
from pathlib import Path

import pytest

import thingc
import thingc_stock

ARM = """
    from build123d import *
    from thingc import Thing

    class Plain(Thing):
        def result(self):
            return Box(1, 1, 1)

    class Shaped(Thing):
        def result(self):
            from company.shapes import width
            return Box(width(), 1, 1)

    class Loose(Thing):
        def result(self):
            import tables
            return Box(tables.WIDTH, 1, 1)
"""
ROBOT = """
    thingc: assembly/1
    name: robot
    materials: {pla: {density: 1240 kg/m^3}}
    defaults: {component: {material: pla}}
    components:
      plain: {part: arm:Plain}
      shaped: {part: arm:Shaped, at: {in: plain.origin, xyz: 0 0 10 mm}}
      loose: {part: arm:Loose, at: {in: plain.origin, xyz: 0 0 20 mm}}
"""
MANY = 1000


class Elsewhere:
    """A workspace, and next to it an environment with a package of `MANY` modules and an uninstalled module in site-packages."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.root = folder / "ws"
        self.company = folder / "src" / "company"
        self.write("ws/thingc.toml", 'thingc = "workspace/1"\n')
        self.write("ws/parts/arm.py", ARM)
        self.write("ws/robot.yaml", ROBOT)
        self.company.mkdir(parents=True)
        self.write("src/company/__init__.py", "from company import module_0\n")
        self.write("src/company/shapes.py", "from company.sizes import WIDTH\ndef width():\n    return WIDTH\n")
        self.write("src/company/sizes.py", "WIDTH = 2\n")
        for number in range(MANY):
            below = f"from company import module_{number + 1}\n" if number % 10 < 9 else ""
            self.company.joinpath(f"module_{number}.py").write_text(f"{below}class C{number}:\n    value = {number}\n")
        environment = folder / "venv"
        venv.create(environment, with_pip=False, symlinks=True)
        self.python = str(environment / "bin" / "python")
        self.packages = next(environment.glob("lib/python*/site-packages"))
        self.packages.joinpath("tables.py").write_text("WIDTH = 3\n")
        here = [sysconfig.get_paths()["purelib"], *(str(Path(str(one.__file__)).parent.parent) for one in (thingc, thingc_stock))]
        self.packages.joinpath("elsewhere.pth").write_text("\n".join([*here, str(folder / "src"), ""]))

    def write(self, name: str, text: str) -> None:
        """Write a dedented file below the folder."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))

    def thingc(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run the command in the workspace, with that environment."""
        env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        env.update(THINGC_STORE=str(self.folder / "store"), NO_COLOR="1")
        command = [self.python, "-P", "-m", "thingc", *arguments]
        return subprocess.run(command, cwd=self.root, env=env, capture_output=True, text=True, timeout=300)

    def reason(self, name: str) -> str:
        """Return why a part was last modelled; model it first if necessary."""
        said = self.thingc("why", "robot.yaml", name)
        assert said.returncode == 0, said
        line = said.stdout.splitlines()[1]
        return line.partition("modelled (")[2].rstrip(")") if line.startswith("reused") else line.removeprefix("modelled: ")

    def facts(self) -> int:
        """Return how many source files have been parsed as code of parts."""
        return len(list((self.folder / "store" / "facts").glob("*/*")))


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Elsewhere:
    """Return the workspace, whose parts have been modelled once."""
    made = Elsewhere(tmp_path_factory.mktemp("elsewhere"))
    py_compile.compile(str(made.company / "sizes.py"), doraise=True)  # as Python does when somebody imports it
    assert (made.thingc("check", "robot.yaml")).stdout == "robot.yaml: ok\n"
    return made


def test_external_packages_are_not_parsed(elsewhere: Elsewhere) -> None:
    assert elsewhere.facts() == 1  # that of `arm`


def test_loaded_module_counts_by_its_source(elsewhere: Elsewhere) -> None:
    sizes = elsewhere.company / "sizes.py"  # modelled with what had been compiled of it
    elsewhere.company.joinpath("module_500.py").write_text("value = 'of no part'\n")
    assert elsewhere.reason("shaped") == "first time"
    sizes.write_text("WIDTH = 40\n")
    assert elsewhere.reason("shaped") == f"file {sizes} changed"
    assert elsewhere.reason("plain") == "first time"


def test_uninstalled_module_counts_by_its_file(elsewhere: Elsewhere) -> None:
    elsewhere.packages.joinpath("tables.py").write_text("WIDTH = 30\n")
    assert elsewhere.reason("loose").startswith("tables changed from file:")


def test_listed_package_is_followed(elsewhere: Elsewhere) -> None:
    elsewhere.write("ws/thingc.toml", 'thingc = "workspace/1"\npackages = ["thingc_stock", "company"]\n')
    elsewhere.company.joinpath("module_0.py").write_text("")  # its nine followers are loaded no more
    new = "module `company` is new; module `company.module_0` is new; module `company.shapes` is new and 2 more"
    assert elsewhere.reason("shaped") == new
    assert 1 < elsewhere.facts() < 20
    elsewhere.company.joinpath("sizes.py").write_text("WIDTH = 40\nUNUSED = 7\n")
    assert elsewhere.reason("shaped") == "module `company.sizes` changed"
    elsewhere.company.joinpath("module_1.py").write_text("")  # which nobody imports any more
    assert elsewhere.reason("shaped") == "module `company.sizes` changed"


def test_init_of_listed_package_is_an_input(elsewhere: Elsewhere) -> None:
    """The package is on the import path, outside the part folders, so a cached run must check its `__init__.py`."""
    elsewhere.write("ws/thingc.toml", 'thingc = "workspace/1"\npackages = ["thingc_stock", "company"]\n')
    assert elsewhere.thingc("check", "robot.yaml").stdout == "robot.yaml: ok\n"
    elsewhere.company.joinpath("__init__.py").write_text("raise ValueError('not today')\n")
    said = elsewhere.thingc("check", "robot.yaml")
    assert said.returncode == 1 and "ValueError: not today" in said.stdout
