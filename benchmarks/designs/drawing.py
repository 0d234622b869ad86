"""Generate random designs of MInchW: random values of its parameters, and random edits of its documents, as a user might make them."""

from __future__ import annotations

import functools
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
MINCHW, LEG, MATERIALS = "minchw.yaml", "leg.yaml", "materials.yaml"
FOLDER = Path("assemblies") / "minchw"

ASTRAY = 0.05
"""Probability that a value is outside of its range."""

OWN = 0.5
"""Probability that a leg has a length of its own."""

EDITED = 0.15
"""Probability that a design contains a given edit."""

BRACE = (2.4, 6.0)
"""Range of the thickness of `ThighBrace` [mm], for which the document does not declare bounds."""

HIGHEST = 106.0
"""Largest angle of a knee [deg] in the poses of the document."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """An edit of a document. The edit replaces the string `old`, which must occur exactly once in `file`, by `new`."""

    name: str
    file: str
    old: str
    new: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A random design of the robot.

    `parameters` contains strings as for the option `-p`. `broken` lists the rules that the design violates on purpose: the expected
    diagnostic code, and a word of its message.
    """

    number: int
    parameters: dict[str, str]
    edits: tuple[Edit, ...]
    broken: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        return ", ".join([*(f"{name}={value}" for name, value in self.parameters.items()), *(f"{e.name}: {e.new!r}" for e in self.edits)])


@functools.cache
def ranges() -> dict[str, tuple[float, float]]:
    """Return the range [mm] of each parameter of the robot. The ranges of the leg lengths come from the document of the leg."""
    robot, leg = (yaml.safe_load((ROOT / FOLDER / file).read_text())["parameters"] for file in (MINCHW, LEG))
    declared = {name: one if isinstance(one, dict) else leg["leg_length"] for name, one in robot.items()}
    return {name: (_millimetres(one["min"]), _millimetres(one["max"])) for name, one in declared.items()}


def _millimetres(text: str) -> float:
    number, unit = text.split()
    if unit != "mm":
        raise ValueError(f"the study draws lengths in mm, found `{text}`")
    return float(number)


def design(number: int, seed: int) -> Design:
    """Create the random design with this number. The result depends only on the number and the seed."""
    source = random.Random(f"{seed}/{number}")
    parameters: dict[str, str] = {}
    broken: list[tuple[str, str]] = []
    for name, (low, high) in ranges().items():
        if name in ("front_leg", "rear_leg") and source.random() >= OWN:
            continue
        value = _drawn(source, low, high)
        parameters[name] = f"{value} mm"
        if not low <= value <= high:
            # The length of a single leg is checked in the document of the leg, under the name that it has there.
            broken.append(("TC315", "leg_length") if "leg" in name and name != "leg_length" else ("TC803", name))
    edits = []
    for draw in EDITS:
        if source.random() < EDITED:
            edit, rule = draw(source)
            edits.append(edit)
            if rule is not None:
                broken.append(rule)
    return Design(number=number, parameters=parameters, edits=tuple(edits), broken=tuple(broken))


def _drawn(source: random.Random, low: float, high: float) -> float:
    """Return a random value. Usually the value is inside the range, but it can be at an end or outside by at most a tenth of the width."""
    if source.random() < ASTRAY:
        beyond = (high - low) * source.uniform(0.001, 0.1)
        return round(source.choice((low - beyond, high + beyond)), 3)
    if source.random() < 0.1:
        return source.choice((low, high))
    return round(source.uniform(low, high), 2)


Drawn = tuple[Edit, tuple[str, str] | None]


def _brace(source: random.Random) -> Drawn:
    leg = source.choice(("front", "rear"))
    value = _drawn(source, *BRACE)
    old = f"{{leg_length: ={leg}_leg, wall: =wall}}"
    edit = Edit(name="brace thickness", file=MINCHW, old=old, new=old.replace("}", f", brace_thickness: {value} mm}}"))
    return edit, None if BRACE[0] <= value <= BRACE[1] else ("TC315", "thickness")


def _printed(source: random.Random) -> Drawn:
    old = "process: {kind: fdm, walls: 3, line_width: 0.45 mm, layer: 0.2 mm, top: 4, bottom: 4, infill: 15 %}\n  abs"
    walls, infill = source.randint(1, 8), source.choice((0, 5, 40, 80, 100))
    new = old.replace("walls: 3", f"walls: {walls}").replace("15 %", f"{infill} %")
    return Edit(name="walls and infill", file=MATERIALS, old=old, new=new), None


def _density(source: random.Random) -> Drawn:
    old = 'density: 1270 kg/m^3\n    color: "#e8e6e1"'
    value = source.choice((round(source.uniform(400, 8000)), 0)) if source.random() < 0.3 else round(source.uniform(900, 1500))
    edit = Edit(name="density", file=MATERIALS, old=old, new=old.replace("1270", str(value)))
    return edit, None if value > 0 else ("TC315", "density")


def _material(source: random.Random) -> Drawn:
    old = "    material: petg_white\n    attach: {servo_seat"
    name = source.choice(("abs", "aluminium", "steel", "petg", "nylon"))
    edit = Edit(name="material", file=LEG, old=old, new=old.replace("petg_white", name))
    return edit, None if name != "nylon" else ("TC306", "nylon")


def _mass(source: random.Random) -> Drawn:
    value = -5 if source.random() < 0.2 else round(source.uniform(1, 200), 1)
    edit = Edit(name="mass", file=MINCHW, old="mass: {value: 58 g,", new=f"mass: {{value: {value} g,")
    return edit, None if value > 0 else ("TC315", "mass")


def _inertia(source: random.Random) -> Drawn:
    """Return a random edit of the inertia of a foot. The moments are invalid if one moment is larger than the sum of the other two."""
    moments = sorted(round(source.uniform(10, 60), 1) for _ in range(3))
    words = ", ".join(f"{axis}: {value} kg*mm^2" for axis, value in zip(("ixx", "iyy", "izz"), moments, strict=True))
    old = "    attach: {servo_seat: ankle_servo.bottom}"
    edit = Edit(name="inertia", file=LEG, old=old, new=f"{old}\n    inertia: {{{words}}}")
    return edit, None if moments[2] <= moments[0] + moments[1] else ("TC506", "foot")


def _limit(source: random.Random) -> Drawn:
    value = round(source.uniform(90, 130), 1)
    edit = Edit(name="knee limit", file=LEG, old="upper: 115 deg", new=f"upper: {value} deg")
    return edit, None if value >= HIGHEST else ("TC601", "knee")


def _hold(source: random.Random) -> Drawn:
    """Return a random edit that moves the rear foot in the mode `bridge`. The solver decides whether the pose is possible."""
    old = """["=6 mm - 207.31 mm - body_length - (front_leg + rear_leg) * cos(100 deg)", 0, 8 mm]
        rpy: 0 3 180 deg"""
    new = old.replace("6 mm", f"{source.randint(-200, 60)} mm").replace("0, 8", f"{source.randint(-15, 15)} mm, {source.randint(-30, 60)}")
    return Edit(name="hold", file=MINCHW, old=old, new=new.replace("rpy: 0 3", f"rpy: 0 {source.randint(-20, 20)}")), None


def _collision(source: random.Random) -> Drawn:
    shape = source.choice(("hull", "box", "capsule", "mesh", "none"))
    return Edit(name="collision", file=LEG, old="component: {collision: part}", new=f"component: {{collision: {shape}}}"), None


def _simulation(source: random.Random) -> Drawn:
    steps, integrator = source.choice((0.5, 1, 4)), source.choice(("euler", "rk4", "implicit"))
    old = "timestep: 2 ms, integrator: implicitfast"
    return Edit(name="simulation", file=MINCHW, old=old, new=f"timestep: {steps} ms, integrator: {integrator}"), None


def _adhesion(source: random.Random) -> Drawn:
    value = source.choice((0, 50, 800))
    old = "contacts: {adhesion: {rear.sole: 300 N}}"
    return Edit(name="adhesion", file=MINCHW, old=old, new=old.replace("300", str(value))), None if value > 0 else ("TC315", "adhesion")


EDITS: tuple[Callable[[random.Random], Drawn], ...] = (
    _brace, _printed, _density, _material, _mass, _inertia, _limit, _hold, _collision, _simulation, _adhesion,
)


def workspace(folder: Path) -> None:
    """Copy the documents and parts of the repository to a folder, where they can be edited."""
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", folder)


def write(one: Design, folder: Path) -> Path:
    """Write the documents of a design to a workspace, and return the path of the robot's document. Raises `ValueError` if the string of an
    edit does not occur exactly once.
    """
    texts = {file: (ROOT / FOLDER / file).read_text(encoding="utf-8") for file in (MINCHW, LEG, MATERIALS)}
    for edit in one.edits:
        if texts[edit.file].count(edit.old) != 1:
            raise ValueError(f"{edit.old!r} stands {texts[edit.file].count(edit.old)} times in {edit.file}, expected once")
        texts[edit.file] = texts[edit.file].replace(edit.old, edit.new)
    for file, text in texts.items():
        (folder / FOLDER / file).write_text(text, encoding="utf-8")
    return folder / FOLDER / MINCHW
