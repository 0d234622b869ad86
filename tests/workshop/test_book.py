"""Assembly instructions, read as HTML: the order of steps against parts that can only be assembled in one order."""

from __future__ import annotations

import base64
import json
import subprocess
import sys
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from thingc.base.diagnostics import Diagnostic
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.targets.render import picture
from thingc.targets.render.picture import NoGraphics
from thingc.tools.cli.main import main
from thingc.tools.workshop import book
from thingc.tools.workshop.assembly_steps import sections

PARTS = '''\
from build123d import *
from thingc import MountPoint, Thing

class Case(Thing):
    """An open box with a floor, a core and a rim."""
    def __init__(self):
        super().__init__()
        self.floor = MountPoint(Location((0, 0, 3)))
        self.rim = MountPoint(Location((0, 0, 30)))
        self.foot = MountPoint(Location((0, 0, 0), (180, 0, 0)))

    def result(self):
        walls = Pos(0, 0, 15) * Box(60, 60, 30) - Pos(0, 0, 18) * Box(50, 50, 30)
        return walls - [Pos(x, 0, 25) * Cylinder(1.2, 20) for x in (27.5, -27.5)]

class Lid(Thing):
    def __init__(self):
        super().__init__()
        self.seat = MountPoint(Location((0, 0, 0), (180, 0, 0)))
        self.below = MountPoint(Location((0, 0, 0), (180, 0, 0)))
        self.hole = [MountPoint(Location((x, 0, 3)), interface="m2-head") for x in (27.5, -27.5)]

    def result(self):
        return Pos(0, 0, 1.5) * Box(60, 60, 3) - [Pos(x, 0, 1.5) * Cylinder(1.2, 3) for x in (27.5, -27.5)]

class Core(Thing):
    bom = {"name": "Core <b>", "make": "buy", "number": "C-1", "cost": "2.50 EUR"}

    def __init__(self):
        super().__init__()
        self.base = MountPoint(Location((0, 0, 0), (180, 0, 0)))

    def result(self):
        return Pos(0, 0, 10) * Box(40, 40, 20)

class Weight(Thing):
    """It hangs below the lid, between the walls and above the core."""
    def __init__(self):
        super().__init__()
        self.top = MountPoint(Location((0, 0, 0)))

    def result(self):
        return Pos(0, 0, -2.5) * Box(20, 20, 5)

class Cage(Thing):
    """Bars around a space of 20 mm, 10 mm apart."""
    def __init__(self):
        super().__init__()
        self.middle = MountPoint(Location((0, 0, 0)))

    def result(self):
        bars = [Rot(*turn) * Pos(x, y, 0) * Box(2, 2, 24) for turn in ((0, 0, 0), (90, 0, 0), (0, 90, 0)) for x in (11, 0, -11)
                for y in (11, 0, -11) if (x, y) != (0, 0)]
        return bars[0] + bars[1:]

class Ball(Thing):
    def __init__(self):
        super().__init__()
        self.heart = MountPoint(Location((0, 0, 0), (180, 0, 0)))

    def result(self):
        return Sphere(8)
'''
BOX = """\
thingc: assembly/1
name: box
materials: {pla: {density: 1240 kg/m^3}, steel: {density: 7850 kg/m^3}}
defaults: {component: {material: pla}}
components:
  case: {part: pieces:Case}
  lid: {part: pieces:Lid, attach: {seat: case.rim}}
  screw:
    repeat: {count: 2}
    part: thingc_stock.fasteners:Screw
    params: {size: M2, length: 10 mm}
    attach: {seat: lid.hole_$i}
    collision: none
    allow: {TC407: in the wall}
  core: {part: pieces:Core, attach: {base: case.floor}}
  weight: {part: pieces:Weight, attach: {top: lid.below}}
mounts: {foot: case.foot}
"""
ROBOT = """\
thingc: assembly/1
name: robot
materials: {pla: {density: 1240 kg/m^3}}
defaults: {component: {material: pla}}
components:
  cage: {part: pieces:Cage}
  ball: {part: pieces:Ball, attach: {heart: cage.middle}}
  sensor: {frame: true, mass: 5 g, at: {in: cage.origin, xyz: 0 0 30 mm}}
  left: {assembly: box.yaml, attach: {mount: foot, to: cage.origin, gap: 40 mm}}
  right: {assembly: box.yaml}
joints:
  hinge: {type: revolute, parent: cage.middle, child: right.foot, gap: 100 mm, limit: {lower: 0 deg, upper: 90 deg}}
"""
SCENE = """\
thingc: assembly/1
name: robot
materials: {pla: {density: 1240 kg/m^3}, steel: {density: 7850 kg/m^3}}
defaults: {component: {material: pla}}
components:
  room: {frame: true}
  left: {assembly: pair.yaml, at: {in: room.origin, xyz: 0 300 0 mm}}
  right: {assembly: pair.yaml, at: {in: room.origin, xyz: 0.5 -300 0 mm, rpy: 0 0 90 deg}}
  on_floor: {part: pieces:Core, at: {in: room.origin}}
  long_0:
    part: thingc_stock.fasteners:Screw
    params: {length: 14 mm}
    attach: {mount: seat, to: on_floor.origin, gap: 50 mm}
  long_1:
    part: thingc_stock.fasteners:Screw
    params: {length: 14 mm}
    attach: {mount: seat, to: on_floor.origin, gap: 90 mm, turn: 45 deg}
  short: {part: thingc_stock.fasteners:Screw, at: {in: on_floor.base, rpy: 180 0 0 deg}, allow: {TC520: inside}}
"""
PAIR = """\
thingc: assembly/1
name: pair
materials: {pla: {density: 1240 kg/m^3}}
defaults: {component: {material: pla}}
components:
  core: {part: pieces:Core}
  lid: {part: pieces:Lid, at: {in: core.origin, xyz: 0 0 25 mm}}
"""


class Page(HTMLParser):
    """The texts of list items and notes by step, the headings, and the pictures."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.heads: list[str] = []
        self.steps: dict[str, list[str]] = {}
        self.images: dict[str, bytes] = {}
        self.cells: list[str] = []
        self._open: list[str] = []
        self._classes: list[str | None] = []
        self.feed(text)
        assert self._open == [], "every element is closed"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag == "img":
            kind, _, data = (given["src"] or "").partition(",")
            assert kind == "data:image/png;base64"
            self.images[given["alt"] or ""] = base64.b64decode(data)
        elif tag != "meta":
            self._open.append(tag)
            self._classes.append(given.get("class"))
            if tag in ("li", "p") and self.steps:
                self.steps[[*self.steps][-1]].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag
        self._classes.pop()

    def handle_data(self, data: str) -> None:
        if not self._open:
            return
        if self._open[-1] == "h2":
            self.heads.append(data)
        elif self._classes[-1] == "number":
            self.steps[data] = []
        elif self.steps and {"li", "p"} & {*self._open}:
            self.steps[[*self.steps][-1]][-1] += data
        elif self._open[-1] == "td":
            self.cells.append(data)


def command(folder: Path, store: str) -> list[str]:
    """Write the robot, and return the command that builds it without the targets."""
    (folder / "parts").mkdir(exist_ok=True)
    (folder / "parts/pieces.py").write_text(PARTS)
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "box.yaml").write_text(BOX)
    (folder / "robot.yaml").write_text(ROBOT)
    return ["build", str(folder / "robot.yaml"), "--store", store, "-o", str(folder / "out"), "--force", "--emit"]


def read(folder: Path) -> Page:
    return Page((folder / "out/robot/book/robot.html").read_text())


SMALLER = """
import os
os.environ.setdefault("MUJOCO_GL", "egl")  # the studio imports MuJoCo
from thingc.targets.render import studio
from thingc.tools.cli import main
from thingc.tools.workshop import book_pictures
book_pictures.SIZE = (320, 240)
lamps = studio.lamps
studio.lamps = lambda camera, normal, counts: lamps(camera, normal, (2, 2))
raise SystemExit(main.main())
"""
"""`thingc`, with pictures of a quarter of the size and few lamps: without a graphics card, all pictures of the book take ten seconds."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Page:
    """The page of a build that also writes MuJoCo models. It runs in a new process, because MuJoCo selects its renderer when it is
    imported. The parts are built by the CAD kernel of this process."""
    folder = tmp_path_factory.mktemp("book")
    build = command(folder, shared_store)
    assert main(["check", str(folder / "robot.yaml"), "--store", shared_store]) == 0
    subprocess.run([sys.executable, "-c", SMALLER, *build, "mjcf,book"], check=True)
    return read(folder)


def test_nested_assemblies_come_first_and_the_core_before_the_lid(page: Page) -> None:
    assert page.heads == ["Parts", "1. group lid (build 2)", "2. box (build 2)", "3. robot"]
    assert [page.steps[f"2.{k}"] for k in (1, 2, 3, 4)] == [
        ["1 × Case (No. 3)"], ["1 × Core <b> (No. C-1)", "core.base on case.floor"],
        ["1 × group lid, from chapter 1", "lid.seat on case.rim"],
        ["2 × Screw (No. 7)", "screw_0.seat on lid.hole_0; screw_1.seat on lid.hole_1"],
    ]
    assert "2.5" not in page.steps


def test_parts_below_the_lid_are_attached_to_it_first(page: Page) -> None:
    assert [page.steps[f"1.{k}"] for k in (1, 2)] == [["1 × Lid (No. 4)"], ["1 × Weight (No. 5)", "weight.top on lid.below"]]
    assert "1.3" not in page.steps


def test_blocked_pieces_name_the_parts_in_their_way(page: Page) -> None:
    steps = {text[0].partition(" (")[0]: text[1:] for number, text in page.steps.items() if number.startswith("3.")}
    assert steps["1 × Ball"] == ["ball.heart on cage.middle", "Insertion along the axes of the mount is blocked: fit together with cage."]
    notes = [text for number, text in page.steps.items() if any("is blocked" in line for line in text)]
    assert len(notes) == 1


def test_joints_and_frames_are_listed(page: Page) -> None:
    outer = [text for number, text in page.steps.items() if number.startswith("3.")]
    assert outer[0] == ["1 × Cage (No. 1)"]
    joint = "joint hinge (revolute) must move freely"
    assert ["1 × box, from chapter 2", "right/case.foot at 0, 0, 100 mm from cage.middle", joint] in outer
    assert ["1 × box, from chapter 2", "left/case.foot at 0, 0, 40 mm from cage.origin"] in outer
    assert outer[1][0].startswith("1 × sensor") and len(outer) == 5


def test_the_bill_of_materials_has_prices(page: Page) -> None:
    assert {"Core <b>", "2.50 EUR", "5.00 EUR", "Screw (length=10 mm, size='M2')"} <= {*page.cells}


def test_new_parts_are_orange_in_the_pictures(page: Page) -> None:
    pictures = {name: np.asarray(Image.open(BytesIO(data))).astype(int) for name, data in page.images.items() if name.startswith("step")}
    assert {*pictures} == {f"step {number}" for number, text in page.steps.items() if "sensor" not in text[0]}
    for name, shown in pictures.items():
        red, green, blue = np.moveaxis(shown, 2, 0)
        new, grey = (red > 1.5 * green) & (green > blue), abs(red - blue) < 12
        assert shown.shape == (240, 320, 3) and new.sum() > 125 and grey.sum() > 5000, name


@pytest.fixture
def _no_graphics(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise NoGraphics("no EGL", "install it")

    for module in (book, picture):
        monkeypatch.setattr(module, "ready", fail)


@pytest.mark.usefixtures("_no_graphics")
def test_offsets_are_relative_to_mounts_and_equal_names_have_parameters(tmp_path: Path, shared_store: str) -> None:
    build = command(tmp_path, shared_store)
    (tmp_path / "robot.yaml").write_text(SCENE)
    (tmp_path / "pair.yaml").write_text(PAIR)
    assert main([*build, "book"]) == 0
    page = read(tmp_path)
    assert [text for number, text in page.steps.items() if number.startswith("2.")] == [
        ["2 × pair, from chapter 1",
         "left/core.origin at 0, 300, 0 mm from room.origin; "
         "right/core.origin at 0.5, -300, 0 mm from room.origin, rotated by 0, 0, 90 deg (roll, pitch, yaw)"],
        ["1 × Core <b> (No. C-1)", "on_floor.origin on room.origin"],
        ["2 × Screw (length=14 mm) (No. 2)",
         "long_0.seat at 0, 0, 50 mm from on_floor.origin; long_1.seat at 0, 0, 90 mm from on_floor.origin, "
         "rotated by 0, 0, 45 deg (roll, pitch, yaw)"],
        ["1 × Screw (No. 3)", "short.origin on on_floor.base, rotated by 180, 0, 0 deg (roll, pitch, yaw)"],
    ]
    assert {"Screw", "Screw (length=14 mm)", "Lid"} <= {*page.cells}


@pytest.mark.usefixtures("_no_graphics")
def test_without_graphics_the_page_has_no_pictures(tmp_path: Path, shared_store: str) -> None:
    assert main([*command(tmp_path, shared_store), "book"]) == 0
    page = read(tmp_path)
    assert page.images == {} and page.steps["2.1"] == ["1 × Case (No. 3)"]
    losses = json.loads((tmp_path / "out/robot/manifest.json").read_text())["losses"]
    assert [one["what"] for one in losses if one["target"] == "book"] == [
        "pictures (no EGL)", "PDF file (Chromium is not installed)",
    ]


LOOSE = """\
thingc: assembly/1
name: robot
materials: {pla: {density: 1240 kg/m^3}}
defaults: {component: {material: pla}}
components:
  core: {part: pieces:Core}
  ball: {part: pieces:Ball, at: {in: core.base, xyz: 100 0 0 mm}}
  weight: {part: pieces:Weight, at: {in: core.base, xyz: 0 100 0 mm}}
  cube: {part: pieces:Core, at: {in: core.base, xyz: -100 0 0 mm}}
"""


def ordered(folder: Path, store: str, text: str) -> tuple[list[list[str]], list[Diagnostic]]:
    """Return the names of the pieces of each step of the last section, and the errors."""
    command(folder, store)
    (folder / "robot.yaml").write_text(text)
    with Environment(str(folder / "robot.yaml"), Options(store=store)) as environment:
        compilation = pipeline.compile(environment)
        if compilation.assembly is None or compilation.report.failed:
            return [], compilation.report.sorted_diagnostics()
        found = sections(compilation.assembly, environment.store, compilation.report)
        return [[piece.name for piece in step.pieces] for step in found[-1].steps], compilation.report.sorted_diagnostics()


@pytest.fixture(scope="module")
def pieces(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pieces")


@pytest.mark.parametrize(("order", "steps"), [
    ("[]", ["core", "ball", "weight", "cube"]),
    ("[cube, ball, weight]", ["core", "cube", "ball", "weight"]),
    ("[weight, ball]", ["core", "weight", "ball", "cube"]),
    ("['c*', ball]", ["core", "cube", "ball", "weight"]),
])
def test_document_states_the_order(pieces: Path, shared_store: str, order: str, steps: list[str]) -> None:
    assert ordered(pieces, shared_store, f"{LOOSE}order: {order}\n") == ([[name] for name in steps], [])


@pytest.mark.parametrize(("text", "said", "marked"), [
    (BOX + "order: [case, lid, core]\n", "`lid` blocks the insertion of `core`", "core"),
    (BOX + "order: [weight, lid]\n", "`weight` is listed before the supporting component `lid`", "weight"),
    (BOX + "order: [lid, core, lid]\n", "`lid` is listed twice", "lid"),
    (BOX + "order: [lidd]\n", "no component `lidd`", "lidd"),
    (ROBOT + "order: [left.core]\n", "`left.core` is a component of a nested document", "left.core"),
])
def test_impossible_orders_are_errors(pieces: Path, shared_store: str, text: str, said: str, marked: str) -> None:
    _, found = ordered(pieces, shared_store, text)
    (error,) = found
    span = error.span
    assert said in error.message and error.help and span is not None and span.line == len(text.splitlines())
    assert text.splitlines()[-1][span.column - 1 :].startswith(marked)
