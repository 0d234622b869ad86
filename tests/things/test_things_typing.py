"""Types of the authoring API, as type checkers and a plain `import thingc` see them."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

SOURCE = '''\
from __future__ import annotations

from typing import Annotated, Literal

from build123d import Box, Location, Part, Pos
from typing_extensions import reveal_type

from thingc import Actuator, Count, Length, MountPoint, Range, Ratio, Thing, asset


class Horn(Thing):
    def __init__(self, radius: Length = 10):
        super().__init__(material="steel")
        self.body = Box(radius, radius, 2)
        self.seat = MountPoint(Pos(0, 0, 1))


class Servo(Thing):
    actuator = Actuator(kind="position", stall_torque=(4.1, "vendor"), kp=20)

    def __init__(
        self, width: Annotated[Length, Range(10, 60)] = 30, holes: Count = 4, side: Literal["left", "right"] = "left"
    ):
        super().__init__(material="aluminium")
        self.rotor = MountPoint(Location((0, 0, 17)))
        self.horn_ref = Horn().move(Pos(0, 0, 17))
        self.spots = [Pos(x, 0, 0) for x in range(holes)]

    def screw(self, length: Length) -> Horn:
        return Horn(length)

    def mass(self) -> float:
        return 0.082


class Bracket(Thing):
    def __init__(self, infill: Ratio = 0.15):
        super().__init__()
        self.servo_ref = Servo().move(Location((0, 0, 30)))
        reveal_type(self.servo_ref)  # type: Servo
        reveal_type(self.servo_ref.rotor.location)  # type: Location
        reveal_type(self.servo_ref.horn_ref.body)  # type: Box
        reveal_type(self.servo_ref.screw(5).body)  # type: Box
        reveal_type(self.servo_ref.adjust(width__add=0.2).rotor)  # type: MountPoint
        reveal_type(self.servo_ref.spots)  # type: list[Pos]
        reveal_type(asset("horn.step"))  # type: Path
        cap: Horn = MountPoint(Location()).align(Horn().seat)
        reveal_type(cap.body)  # type: Box

    def result(self) -> Part:
        return self.servo_ref.horn_ref.body


Servo(width=31.5, holes=6)
Servo(width="wide")  # error
Servo(side="middle")  # error
Servo(wdith=3)  # error
Servo().rotr  # error
Servo().horn = 3  # error
Servo().move(3)  # error
Servo().rotor.align(Horn())  # error
Actuator(kind="stepper")  # error
'''
REVEALED = {number: line.split("# type: ")[1] for number, line in enumerate(SOURCE.splitlines(), 1) if "# type: " in line}
ERRORS = {number for number, line in enumerate(SOURCE.splitlines(), 1) if line.endswith("# error")}


def outcome(lines: list[tuple[int, str, str]]) -> tuple[dict[int, str], set[int]]:
    """Revealed types by line, without their modules, and the lines with errors."""
    revealed = {}
    for line, severity, message in lines:
        if severity != "error":
            found = re.search(r'(?:is|Revealed type is) "([^"]*)"$', message)
            assert found, message
            revealed[line] = re.sub(r"[\w.]+\.(\w+)", r"\1", found.group(1))
    return revealed, {line for line, severity, _ in lines if severity == "error"}


def without_colour() -> dict[str, str]:
    return {**os.environ, "NO_COLOR": "1", "TERM": "dumb", "MYPY_FORCE_COLOR": "0"}


@pytest.mark.slow
def test_mypy_infers_types_of_moved_things(root: Path, tmp_path: Path) -> None:
    """The strict settings of the repository are used, so its mypy cache of thingc and build123d can be reused."""
    (tmp_path / "typed_part.py").write_text(SOURCE)
    ran = subprocess.run(
        [sys.executable, "-m", "mypy", "--no-error-summary", str(tmp_path / "typed_part.py")], cwd=root, capture_output=True, text=True,
        env=without_colour(),
    )
    found = re.findall(r"typed_part\.py:(\d+): (\w+): (.*?)(?:  \[[\w-]+\])?$", ran.stdout, re.MULTILINE)
    assert ran.stderr == ""
    assert outcome([(int(line), severity, message) for line, severity, message in found]) == (REVEALED, ERRORS)


@pytest.mark.slow
def test_pyright_infers_types_of_moved_things(root: Path, tmp_path: Path) -> None:
    try:
        started = subprocess.run([sys.executable, "-m", "pyright", "--version"], capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        pytest.skip("pyright cannot fetch its engine here")
    if started.returncode != 0:
        pytest.skip("pyright cannot start here")
    (tmp_path / "typed_part.py").write_text(SOURCE)
    settings = {"extraPaths": [str(root / "compiler")], "typeCheckingMode": "standard"}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    ran = subprocess.run(
        [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable, "-p", str(tmp_path)],
        cwd=tmp_path, capture_output=True, text=True, env=without_colour(),
    )
    found = json.loads(ran.stdout)["generalDiagnostics"]
    assert outcome([
        (one["range"]["start"]["line"] + 1, one["severity"], one["message"]) for one in found
    ]) == (REVEALED, ERRORS)


def test_import_does_not_load_the_kernel() -> None:
    code = (
        "import sys, thingc; from thingc import Length, Range, Actuator\n"
        "assert 'Thing' in dir(thingc)\n"
        "print(sorted({name.split('.')[0] for name in sys.modules} & {'build123d', 'OCP', 'numpy'}))\n"
        "try:\n    thingc.Thong\nexcept AttributeError as error:\n    print(error)\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\nmodule `thingc` has no attribute `Thong`\n"


def test_all_exported_names_exist() -> None:
    import thingc

    for name in thingc.__all__:
        found = getattr(thingc, name)
        of = found.__name__ if isinstance(found, ModuleType) else found.__module__
        assert of.startswith("thingc") or name in {"Length", "Angle", "Mass", "Count", "Ratio", "MATE"}
