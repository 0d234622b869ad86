"""`thingc lock`, and the diagnostics for a lock file that is stale, broken, modified or incomplete."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from conformance.harness import Ran, thingc_here
from thingc.base.diagnostics import Severity
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.geometry.lock.json_format import BadLock, LockedSchema, read_value, schema_values
from thingc.geometry.record import ParameterSchema, PartSchema

_CORNERS = ((0, 0, 0), (10, 0, 0), (0, 10, 0), (0, 0, 10))
_FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
TETRAHEDRON = "solid t\n" + "".join(
    "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in (_CORNERS[k] for k in face)) + "endloop\nendfacet\n"
    for face in _FACES
) + "endsolid t\n"

UNKNOWN = "note[TC345]: `parts.lock.json` does not contain the geometry of 1 part"
ARM, MINCHW = "assemblies/arm.yaml", "assemblies/minchw/minchw.yaml"


def checked(folder: Path, *words: str) -> Ran:
    return thingc_here("check", "--no-code", *(words or (ARM,)), cwd=folder)


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) >= 1, f"{old!r} is not in {file}"
    file.write_text(text.replace(old, new, 1))


def test_lock_file_is_readable_and_reproducible(workspace: Path, locked: Path, shared_store: str, root: Path) -> None:
    text = (workspace / "parts.lock.json").read_text()
    (workspace / "parts.lock.json").unlink()
    assert thingc_here("lock", store=shared_store, cwd=workspace).code == 0
    assert (workspace / "parts.lock.json").read_text() == text
    assert str(locked) not in text and str(root) not in text and shared_store not in text
    held = json.loads(text)
    assert list(held["things"]) == sorted(held["things"])
    assert held["things"]["arm:BasePlate"]["parameters"]["size"] == {
        "kind": "length", "unit": "m", "default": 0.1, "minimum": 0.09, "maximum": 0.3, "doc": "edge of the plate",
    }
    assert max(len(line) for line in text.splitlines() if '"doc"' not in line) < 400  # a line is one thing


def test_lock_file_gives_the_same_robots_as_the_store(workspace: Path, shared_store: str) -> None:
    for document in (ARM, MINCHW):
        masses = []
        for options in (Options(store=shared_store), Options(lock=True, code=False)):
            with Environment(str(workspace / document), options) as environment:
                compilation = pipeline.compile(environment)
                assert not compilation.report.diagnostics and compilation.assembly is not None
                masses.append([
                    (one.path, one.properties.mass, *one.properties.centre, *(entry for row in one.properties.inertia for entry in row))
                    for one in compilation.assembly.occurrences
                ])
        for stored, held in zip(*masses, strict=True):
            assert stored[0] == held[0]
            assert held[1:] == pytest.approx(stored[1:], rel=1e-9, abs=1e-15)


def test_comments_and_docstrings_do_not_make_it_stale(workspace: Path, shared_store: str) -> None:
    part = workspace / "parts" / "arm.py"
    part.write_text("# a comment\n\n" + part.read_text())
    assert checked(workspace).code == 0
    assert thingc_here("lock", "--check", store=shared_store, cwd=workspace).code == 0


def test_integer_parameters_keep_their_bounds() -> None:
    whole = PartSchema(
        reference="gears:Gear", kind="thing", doc="", material=None, actuator=False, file="", line=0, parameters=(
            ParameterSchema(name="teeth", kind="count", required=False, default=12, minimum=0),
            ParameterSchema(name="shift", kind="integer", required=False, default=-3),
        ),
    )
    values = json.loads(json.dumps(schema_values(whole)))
    assert values["parameters"]["shift"] == {"kind": "integer", "default": -3}
    assert read_value(values, LockedSchema, "things").schema("gears:Gear", "things") == whole
    values["parameters"]["shift"]["default"] = -3.5
    with pytest.raises(BadLock, match="expected a whole number"):
        read_value(values, LockedSchema, "things").schema("gears:Gear", "things")


def test_stale_lock_is_reported_at_the_part(workspace: Path, shared_store: str) -> None:
    edit(workspace / "parts" / "arm.py", "shaft = Cylinder(diameter / 2, length)", "shaft = Cylinder(diameter * 0.5, length)")
    done = checked(workspace, "assemblies/end_effector.yaml", "--format", "json")
    assert done.code == 1
    diagnostics = json.loads(done.out)["diagnostics"]
    assert [(said["code"], said["file"], said["message"]) for said in diagnostics] == [
        ("TC341", "assemblies/end_effector.yaml", f"part `arm:{name}`: the code has changed since `parts.lock.json` was written")
        for name in ("Hand", "OmegaCap", "PenDummy")  # they share a module
    ]
    assert {said["notes"][0]["file"] for said in diagnostics} == {"parts/arm.py"}
    # Where code may run, the change is modelled and nothing is said.
    assert thingc_here("check", "assemblies/end_effector.yaml", store=shared_store, cwd=workspace).code == 0
    stale = thingc_here("lock", "--check", store=shared_store, cwd=workspace)
    assert stale.code == 1 and "the code of `arm:PenDummy` has changed" in stale.out
    assert re.search(r"--> parts\.lock\.json:\d+:5\n +\d+ |\"arm:PenDummy\"", stale.out)
    before = (workspace / "parts.lock.json").read_bytes()
    assert thingc_here("lock", store=shared_store, cwd=workspace).code == 0
    assert (workspace / "parts.lock.json").read_bytes() != before
    assert checked(workspace).code == 0


def test_lock_check_lists_changes(workspace: Path, shared_store: str) -> None:
    lock = workspace / "parts.lock.json"
    held = json.loads(lock.read_text())
    del held["things"]["arm:PenDummy"]
    held["things"]["arm:Ghost"] = held["things"]["arm:BasePlate"]
    held["things"]["arm:BasePlate"]["parameters"]["size"]["maximum"] = 0.4
    plate = held["things"]["arm:BasePlate"]["records"]["arm:BasePlate"]
    plate["volume"] *= 1.001
    plate["centre"] = [one * (1 + 1e-12) for one in plate["centre"]]  # what two machines may differ by
    lock.write_text(json.dumps(held, indent=1))
    done = thingc_here("lock", "--check", store=shared_store, cwd=workspace)
    assert done.code == 1
    assert "the part `arm:PenDummy` is missing" in done.out
    assert "the part `arm:Ghost` is removed or unused" in done.out
    assert "`parameters.size.maximum` of `arm:BasePlate` has changed" in done.out
    assert "`volume` of `arm:BasePlate` has changed" in done.out and "`centre`" not in done.out
    assert done.out.count("error[TC341]") == 4


def test_process_that_is_not_in_the_lock_file(workspace: Path, shared_store: str) -> None:
    """The slicing of a part is in the lock file. Another infill percentage needs no other slices, but another number of walls does."""
    arm = workspace / ARM
    edit(arm, "process: {infill: 30 %}", "process: {infill: 25 %}")
    assert checked(workspace).out == f"{ARM}: ok\n"
    edit(arm, "process: {infill: 25 %}", "process: {infill: 25 %, walls: 2}")
    done = checked(workspace)
    assert done.code == 0
    assert UNKNOWN in done.out
    assert "`arm:BasePlate`" in done.out
    with Environment(str(arm), Options(store=shared_store, lock=True)) as environment:  # where code may run, it is sliced
        compilation = pipeline.compile(environment)
        assert compilation.assembly is not None and not compilation.report.diagnostics
        plate = compilation.assembly.occurrences[0]
        assert plate.estimate == "layers"
    with Environment(str(arm), Options(store=shared_store)) as environment:
        build = pipeline.compile(environment)
        assert build.assembly is not None
        assert plate.properties.mass == pytest.approx(build.assembly.occurrences[0].properties.mass, rel=1e-9)


def test_parameters_that_are_not_in_the_lock_file(workspace: Path) -> None:
    arm = workspace / ARM
    edit(arm, "{part: arm:BasePlate,", "{part: arm:BasePlate, params: {size: 120 mm},")
    done = checked(workspace)
    assert done.code == 0
    assert UNKNOWN in done.out
    assert "`arm:BasePlate(size=120 mm)`" in done.out
    # What can be checked is checked: bounds from the schema, and the names of mounts.
    edit(arm, "size: 120 mm", "size: 1200 mm")
    assert "error[TC3" in (bounds := checked(workspace)).out and bounds.code == 1 and "at most 300 mm" in bounds.out.replace("0.3 m",
        "300 mm")
    edit(arm, "size: 1200 mm", "size: 120 mm")
    edit(arm, "servo_seat", "servo_seet")
    misspelt = checked(workspace)
    assert misspelt.code == 1 and "did you mean `servo_seat`?" in misspelt.out


def test_mount_names_that_depend_on_parameters_are_not_checked(workspace: Path, shared_store: str) -> None:
    (workspace / "parts" / "many.py").write_text(
        "from build123d import Box, Location\nfrom thingc import MountPoint, Thing\n\n\nclass Comb(Thing):\n    \"\"\"A comb.\"\"\"\n\n"
        "    def __init__(self, teeth: int = 2) -> None:\n        super().__init__(material='petg')\n"
        "        self.tooth = [MountPoint(Location()) for _ in range(teeth)]\n\n"
        "    def result(self) -> Box:\n        return Box(1, 1, 1)\n"
    )
    (workspace / "comb.yaml").write_text(
        "thingc: assembly/1\nname: comb\nmaterials: [assemblies/materials.yaml]\ncomponents:\n  comb: {part: 'many:Comb', material: petg}\n"
        "  tip: {frame: true, at: {in: comb.tooth_1}}\n"
    )
    made = thingc_here("lock", store=shared_store, cwd=workspace)
    assert made.code == 0, made
    edit(workspace / "comb.yaml", "material: petg", "material: petg, params: {teeth: 5}")
    edit(workspace / "comb.yaml", "tooth_1", "tooth_4")
    done = checked(workspace, "comb.yaml")
    assert done.code == 0 and "TC345" in done.out
    edit(workspace / "comb.yaml", "params: {teeth: 5}", "params: {teeth: 2}")
    assert "TC303" in checked(workspace, "comb.yaml").out


def test_file_parts_are_compared_with_the_lock_file(workspace: Path, shared_store: str) -> None:
    (workspace / "motor.stl").write_text(TETRAHEDRON)
    (workspace / "filed.yaml").write_text(
        "thingc: assembly/1\nname: filed\ncomponents:\n  motor: {file: motor.stl, mass: 1 kg}\n"
    )
    made = thingc_here("lock", store=shared_store, cwd=workspace)
    assert made.code == 0, made
    assert checked(workspace, "filed.yaml").code == 0
    (workspace / "motor.stl").write_text(TETRAHEDRON + "\n")
    done = checked(workspace, "filed.yaml")
    assert done.code == 1 and "TC341" in done.out
    (workspace / "other.yaml").write_text((workspace / "filed.yaml").read_text().replace("motor.stl", "new.stl"))
    (workspace / "new.stl").write_text(TETRAHEDRON)
    assert "TC343" in checked(workspace, "other.yaml").out


def test_file_is_locked_once_per_unit(workspace: Path, shared_store: str) -> None:
    (workspace / "motor.stl").write_text(TETRAHEDRON)
    text = "thingc: assembly/1\nname: filed\ncomponents:\n  motor: {file: motor.stl, unit: cm, mass: 1 kg}\n"
    (workspace / "filed.yaml").write_text(text + "  small: {file: motor.stl, mass: 1 g, at: {in: motor.origin}}\n")
    assert thingc_here("lock", store=shared_store, cwd=workspace).code == 0
    held = json.loads((workspace / "parts.lock.json").read_text())["files"]
    volumes = {key: one["record"]["volume"] for key, one in held.items()}
    assert volumes == pytest.approx({"motor.stl": 1e-6 / 6, "motor.stl(unit='cm')": 1e-3 / 6}, rel=1e-9)
    assert checked(workspace, "filed.yaml").code == 0
    (workspace / "filed.yaml").write_text(text.replace("cm", "m"))
    assert "TC343" in checked(workspace, "filed.yaml").out


BROKEN = {
    "empty": "", "no JSON": "{", "a list": "[]", "another version": '{"thingc": "lock/2"}', "no number": '{"thingc": "lock/1", "x": NaN}',
    "too large": '{"thingc": "lock/1", "x": 1e999}',
    "a key twice": '{"thingc": "lock/1", "thingc": "lock/1"}', "things are a list": '{"thingc": "lock/1", "things": []}',
    "a thing is a text": '{"thingc": "lock/1", "things": {"arm:PenDummy": "x"}}',
    "no hash": '{"thingc": "lock/1", "things": {"arm:PenDummy": {}}}',
    "a path outside": '{"thingc": "lock/1", "things": {"arm:PenDummy": {"code": "x", "reads": {"../x": "absent"}}}}',
    "surrogates": '{"thingc": "lock/1", "others": ["\\ud800", 1]}',
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_lock_file_is_a_diagnostic(name: str, workspace: Path) -> None:
    (workspace / "parts.lock.json").write_text(BROKEN[name])
    done = checked(workspace)
    assert done.code == 1 and "error[TC342]: `parts.lock.json` is invalid" in done.out and "Traceback" not in done.err


@pytest.mark.parametrize(("path", "value"), [
    (("parameters",), []), (("parameters", "size"), 1), (("parameters", "size", "kind"), "colour"), (("parameters", "size", "default"),
        "x"),
    (("parameters", "size", "maximum"), "x"), (("kind",), None), (("actuator",), 1), (("records", "arm:BasePlate"), []),
    (("records", "arm:BasePlate", "volume"), -1.0), (("records", "arm:BasePlate", "volume"), 10**400),
    (("records", "arm:BasePlate", "centre"), [0, 0]), (("records", "arm:BasePlate", "inertia"), None),
    (("records", "arm:BasePlate", "mounts"), {"servo_seat": {"pose": [1] * 12}}),
    (("records", "arm:BasePlate", "mass"), {"value": 1, "source": "guess"}),
    (("records", "arm:BasePlate", "actuator"), {"kind": "rocket"}), (("records", "arm:BasePlate", "expectations"), [["a"]]),
])
def test_modified_lock_file_is_a_diagnostic(path: tuple[str, ...], value: object, workspace: Path) -> None:
    lock = workspace / "parts.lock.json"
    held = json.loads(lock.read_text())
    at = held["things"]["arm:BasePlate"]
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    lock.write_text(json.dumps(held))
    done = checked(workspace)
    assert done.code == 1 and "error[TC342]: `parts.lock.json` is invalid at `things.arm:BasePlate" in done.out


def test_broken_lock_file_is_a_warning_if_code_may_run(workspace: Path, tmp_path: Path) -> None:
    (workspace / "parts.lock.json").write_text("{")
    with Environment(str(workspace / "assemblies" / "end_effector.yaml"), Options(store=str(tmp_path / "store"), lock=True)) as environment:
        compilation = pipeline.compile(environment)
        assert [d.code.code for d in compilation.report.diagnostics] == ["TC342"]
        assert compilation.report.diagnostics[0].severity is Severity.WARNING


def test_failing_part_is_not_locked(workspace: Path, shared_store: str) -> None:
    before = (workspace / "parts.lock.json").read_bytes()
    (workspace / "parts" / "torn.py").write_text("from thingc import Thing\n\n\nclass Torn(Thing):\n    x = 1 / 0\n")
    (workspace / "parts" / "short.py").write_text(
        "from build123d import Box\nfrom thingc import Length\n\n\ndef short(length: Length = 10):\n"
        "    if length > 50:\n        raise ValueError('too long')\n    return Box(length, 1, 1)\n"
    )
    (workspace / "assemblies" / "long.yaml").write_text(
        "thingc: assembly/1\nname: long\ncomponents: {rod: {part: short:short, params: {length: 60 mm}, mass: 1 g}}\n"
    )
    done = thingc_here("lock", store=shared_store, cwd=workspace)
    assert done.code == 1 and "`torn:Torn` cannot be locked: ZeroDivisionError" in done.err
    assert "`short:short(length=60 mm)` cannot be locked: ValueError: too long\n   --> parts/short.py:7:1\n" in done.err
    assert (workspace / "parts.lock.json").read_bytes() == before
