"""Data that the geometry worker reads from a part, actuators, and data files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import pytest
from bd_warehouse.fastener import Screw, SocketHeadCapScrew
from build123d import Box, Cylinder, Part, Pos, Sphere, Vector, extrude

from thingc import Actuator, Length, MountPoint, ParameterError, Range, Thing, asset
from thingc.geometry.things import assets, inspection
from thingc.geometry.things.inspection import Statement, build, is_part, parameters_of
from thingc.geometry.things.parameters import CallError, SignatureError


class Frame(Thing):
    """A Thing without geometry."""


class Block(Thing):
    def __init__(self, length: Annotated[Length, Range(10, 200)] = 60):
        super().__init__()
        self.body = Box(length, 20, 5)

    def result(self) -> Part:
        return self.body


class Slab(Block):
    def __init__(self, height: Length = 20):
        super().__init__(height * 2)


def peg(length: float, radius: float = 2, **more: Any) -> Part:
    """A peg.

    :param radius: of the peg
    """
    return Cylinder(radius, length)


def bare(length=3):
    return Cylinder(1, length) if length < 5 else "long"


def text(length: float) -> str:
    return "x"


def either(length: float) -> Part | Box:
    return Box(length, 1, 1)


def test_part_classes_shapes_and_functions_are_recognized() -> None:
    things = [Block, Slab, Frame]
    shapes = [Box, Sphere, SocketHeadCapScrew, Part]
    functions = [peg, bare, either, extrude]
    nothing = [Thing, Screw, text, len, print, 3, "x", None, math, Vector, Block(), Block.result, int]
    assert [is_part(candidate) for candidate in things] == ["thing"] * 3
    assert [is_part(candidate) for candidate in shapes] == ["shape"] * 4
    assert [is_part(candidate) for candidate in functions] == ["function"] * 4
    assert [is_part(candidate) for candidate in nothing] == [None] * 11 + ["function", None]


def test_parameters_of_shapes_and_functions() -> None:
    assert [(p.name, p.kind, p.required, p.doc) for p in parameters_of(Box)] == [
        ("length", "number", True, "box length"),
        ("width", "number", True, "box width"),
        ("height", "number", True, "box height"),
    ]
    screw = {p.name: (p.kind, p.choices) for p in parameters_of(SocketHeadCapScrew)}
    assert screw["size"] == ("text", ()) and screw["hand"] == ("choice", ("right", "left")) and "align" not in screw
    assert [(p.name, p.default, p.doc) for p in parameters_of(peg)] == [("length", None, ""), ("radius", 2.0, "of the peg")]
    with pytest.raises(SignatureError, match="^the annotation of `left` of `impossible` must be"):
        parameters_of(impossible)


def impossible(left: Part) -> Part:
    return left


def test_build_supports_things_shapes_and_functions() -> None:
    assert build(Block, {"length": 66}) is Block(66)
    box = build(Box, {"length": 1, "width": 2, "height": 3})
    assert isinstance(box, Thing) and isinstance(box.result(), Box) and box.result().volume == pytest.approx(6)
    assert repr(box) == "Box(length=1.0, width=2.0, height=3.0)"
    assert build(peg, {"length": 5}).result().volume == pytest.approx(20 * math.pi)
    assert inspection.bom_of(box) == {} and inspection.references_of(box) == () and inspection.mounts_of(box) == {}
    screw = build(SocketHeadCapScrew, {"size": "M3-0.5", "length": 8})
    assert inspection.bom_of(screw) == {"make": "buy"} and screw.result().volume > 0
    with pytest.raises(ParameterError, match="^`length` of `Box` must be a number, found 'x'$"):
        build(Box, {"length": "x", "width": 2, "height": 3})
    with pytest.raises(CallError, match="^`peg` needs `length`, a number$"):
        build(peg, {})
    with pytest.raises(TypeError, match="^`bare` must return a build123d shape, but returned 'long'$"):
        build(bare, {"length": 6})


class Told(Thing):
    """A Thing whose statements depend on its parameter."""

    bom = {"make": "print"}
    shared = 3

    def __init__(self, what: str = "good"):
        super().__init__("steel", "#888888")
        self.what = what
        self.left, self.right = Box(1, 1, 1), [Box(1, 1, 1)]
        self.hip = [MountPoint(Pos(1, 0, 0), "m3", 0.1)]
        self.tip = MountPoint(Pos(2, 0, 0))
        self._hidden = 3
        self.actuator = Actuator(kind="motor", stall_torque=2)

    def screw(self, length: float) -> Box:
        return Box(1, 1, length)

    @property
    def hull(self) -> Box:
        return Box(9, 9, 9)

    def mass(self) -> Any:
        return {"good": (0.082, "vendor"), "negative": -1, "text": "x", "source": (1, "guess"), "nan": math.nan}.get(self.what, 1)

    def centre(self) -> Any:
        return {"good": Vector(1, 2, 3), "two": [1, 2], "sourced": ((1, 2, 3), "measured")}.get(self.what)

    def matrix_of_inertia(self) -> Any:
        rows = [[1, 0.5, 0], [0.5, 2, 0], [0, 0, 3]]
        return {"good": (rows, "measured"), "skew": [[1, 1, 0], [0, 1, 0], [0, 0, 1]], "flat": [1, 2, 3]}.get(self.what)


def statements(thing: Thing) -> list[Statement | None]:
    """Statements of a Thing about mass, centre, matrix of inertia and density."""
    return [inspection.statement_of(thing, method) for method in ("mass", "centre", "matrix_of_inertia", "density")]


def test_statements_have_a_source() -> None:
    mass, centre, matrix, density = statements(Told())
    assert mass == Statement(value=0.082, source="vendor")
    assert centre == Statement(value=(1.0, 2.0, 3.0), source="stated")
    assert matrix == Statement(value=((1.0, 0.5, 0.0), (0.5, 2.0, 0.0), (0.0, 0.0, 3.0)), source="measured")
    assert density is None
    mass, centre, *_ = statements(Told("sourced"))
    assert (mass, centre) == (Statement(value=1.0), Statement(value=(1.0, 2.0, 3.0), source="measured"))
    assert statements(Frame()) == [None, None, None, None]


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("negative", "mass() of `Told` must be positive, found -1"),
        ("text", "mass() of `Told` must return a number, found 'x'"),
        ("nan", "mass() of `Told` must be finite, found nan"),
        ("source", "the source of mass() of `Told` must be one of 'measured', 'vendor', 'estimated', 'stated', found 'guess'"),
        ("two", "centre() of `Told` must return three numbers, found [1, 2]"),
        ("skew", "matrix_of_inertia() of `Told` must be symmetric, found [[1, 1, 0], [0, 1, 0], [0, 0, 1]]"),
        ("flat", "matrix_of_inertia() of `Told` must return three numbers, found 1"),
    ],
)
def test_invalid_statements_are_reported(what: str, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        statements(Told(what))
    assert str(caught.value) == message


def test_inspection_reads_material_bom_and_mounts() -> None:
    told = Told()
    assert inspection.material_of(told) == "steel" and inspection.color_of(told) == "#888888"
    assert inspection.bom_of(told) == {"make": "print"}
    assert inspection.actuator_of(told) == Actuator(kind="motor", stall_torque=2)
    assert inspection.actuator_of(Told) is None and inspection.actuator_of(Box) is None and inspection.actuator_of(peg) is None
    assert inspection.references_of(told) == ("what", "left", "right", "screw", "hull")
    assert [(name, mount.interface, mount.tolerance) for name, mount in inspection.mounts_of(told).items()] == [
        ("hip_0", "m3", 0.1), ("tip", None, None),
    ]
    assert [shape.volume for shape in inspection.shapes_of([told.left, told.hull])] == pytest.approx([1, 729])
    assert inspection.shapes_of(None) == () and inspection.shapes_of(told.left) == (told.left,)
    with pytest.raises(TypeError, match="^expected a build123d shape, found 3$"):
        inspection.shapes_of(3)  # type: ignore[arg-type]


def test_class_attributes_of_wrong_type_are_reported() -> None:
    class Wrong(Thing):
        actuator = "strong"  # type: ignore[assignment]

    for bom, reason in (
        (["buy"], r"must be a mapping, found \['buy'\]"), ({"number": 3}, "has an invalid number: expected a string, found 3"),
        ({"number": "3", "colour": "red"}, "has the unknown key `colour`; use `cost`, `link`, `make`, `name`, `number`, `picture`, `supp"),
        ({"cost": "12.50"}, "has an invalid cost: expected an amount and a currency, such as `12.50 EUR`, found '12.50'"),
        ({"cost": {"1": "1 EUR", "10": "0,9 EUR"}}, "has an invalid cost: .*, found '0,9 EUR'"), ({"cost": {}}, "has an invalid cost"),
        ({"cost": {0: "1 EUR"}}, "has an invalid quantity: expected a positive whole number, found '0'"),
        ({"make": "weld"}, "has an invalid make: expected `buy`, `print` or `machine`, found 'weld'"),
        ({"link": "www.example.com"}, "has an invalid link: expected a web address"), ({"picture": "motor.bmp"}, "has an invalid picture"),
    ):
        Wrong.bom = bom  # type: ignore[assignment]
        with pytest.raises(TypeError, match=f"^`bom` of `Wrong` {reason}"):
            inspection.bom_of(Wrong())
    right = {"number": "3", "name": "x", "supplier": "us", "make": "print", "link": "https://a.b", "picture": "motor.PNG"}
    Wrong.bom = {**right, "cost": {1: "12.50 EUR", 10: "9 EUR"}}
    assert inspection.bom_of(Wrong()) == {**right, "cost": {"1": "12.50 EUR", "10": "9 EUR"}}
    for part in (Wrong, Wrong()):
        with pytest.raises(TypeError, match="^`actuator` must be an Actuator, found 'strong'$"):
            inspection.actuator_of(part)


# --- actuator -------------------------------------------------------------------------------------------------------------------


def test_actuator_has_values_and_sources() -> None:
    drive = Actuator(
        kind="position", stall_torque=(4.1, "vendor"), no_load_speed=4.8, gear_ratio=353.5,
        rotor_inertia=(2e-8, "estimated"), kp=20,
    )
    assert (drive.stall_torque, drive.no_load_speed, drive.kp, drive.kv) == (4.1, 4.8, 20.0, None)
    assert dict(drive.sources) == {"stall_torque": "vendor", "rotor_inertia": "estimated"}
    assert drive.armature == pytest.approx(2e-8 * 353.5**2)
    assert Actuator(kind="motor").armature is None and Actuator(kind="motor").gear_ratio == 1.0
    assert drive != Actuator(kind="motor") and hash(Actuator(kind="motor")) == hash(Actuator(kind="motor"))
    with pytest.raises(AttributeError):
        drive.kp = 3.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "stepper"}, "the kind of an Actuator must be 'position', 'velocity' or 'motor', found 'stepper'"),
        ({"kind": "motor", "stall_torque": 0}, "`stall_torque` of an Actuator must be positive, found 0"),
        ({"kind": "motor", "kp": -1}, "`kp` of an Actuator must be at least 0, found -1"),
        ({"kind": "motor", "kv": "x"}, "`kv` of an Actuator must be a finite number, found 'x'"),
        ({"kind": "motor", "gear_ratio": math.inf}, "`gear_ratio` of an Actuator must be a finite number, found inf"),
        ({"kind": "motor", "gear_ratio": None}, "`gear_ratio` of an Actuator must be a finite number, found None"),
        (
            {"kind": "motor", "kp": (1, "guess")},
            "the source of `kp` of an Actuator must be one of 'measured', 'vendor', 'estimated', 'stated', found 'guess'",
        ),
        ({"kind": "motor", "kp": (1, 2, 3)}, "`kp` of an Actuator must be a number or (number, source), found (1, 2, 3)"),
    ],
)
def test_invalid_actuators_are_reported(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        Actuator(**arguments)
    assert str(caught.value) == message


# --- assets ---------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def recorded(tmp_path: Path) -> Iterator[list[str]]:
    looked_at: list[str] = []
    (tmp_path / "workspace" / "parts").mkdir(parents=True)
    assets.install(looked_at.append, [str(tmp_path / "workspace")])
    yield looked_at
    assets.install(None)


PART = '''
from thingc import Thing, asset

class Curve(Thing):
    def __init__(self, name="curve.txt"):
        self.points = asset(name).read_text()
'''


def test_assets_are_searched_beside_the_part_first(recorded: list[str], tmp_path: Path) -> None:
    """The part's folder is searched before the workspace, and all visited paths are recorded as dependencies."""
    workspace = tmp_path / "workspace"
    (workspace / "curve.txt").write_text("outer")
    (workspace / "parts" / "near.txt").write_text("near")
    scope: dict[str, Any] = {"__name__": __name__}
    exec(compile(PART, str(workspace / "parts" / "curve.py"), "exec"), scope)
    assert scope["Curve"]().points == "outer"
    assert recorded == [str(workspace / "parts" / "curve.txt"), str(workspace / "curve.txt")]   # absent there, found here
    recorded.clear()
    assert scope["Curve"]("near.txt").points == "near"
    assert scope["Curve"]("../curve.txt").points == "outer"
    assert recorded == [str(workspace / "parts" / "near.txt"), str(workspace / "curve.txt")]
    with pytest.raises(FileNotFoundError, match="^there is no data file `far.txt` next to the part's module or in the workspace$"):
        scope["Curve"]("far.txt")
    assert recorded[-2:] == [str(workspace / "parts" / "far.txt"), str(workspace / "far.txt")]


def test_symlinked_asset_is_recorded_with_its_target(recorded: list[str], tmp_path: Path) -> None:
    """Otherwise, a part that reads `latest.txt` would not be rebuilt when the link points to the next version."""
    workspace = tmp_path / "workspace"
    (workspace / "v1.txt").write_text("one")
    (workspace / "latest.txt").symlink_to("v1.txt")
    assert asset("latest.txt").read_text() == "one"
    assert recorded == [str(workspace / "latest.txt"), str(workspace / "v1.txt")]


def test_asset_accepts_a_file_to_search_beside(recorded: list[str], tmp_path: Path) -> None:
    (tmp_path / "workspace" / "data.txt").write_text("data")
    assert asset("data.txt") == tmp_path / "workspace" / "data.txt"
    (tmp_path / "beside.txt").write_text("beside")
    assert asset("beside.txt", beside=str(tmp_path / "module.py")).read_text() == "beside"


def test_assets_outside_the_workspace_are_rejected(recorded: list[str], tmp_path: Path) -> None:
    (tmp_path / "secret.txt").write_text("secret")
    with pytest.raises(ValueError, match="^asset.. expects a path inside the part's folder or the workspace, found `../secret.txt`$"):
        asset("../secret.txt")
    (tmp_path / "workspace" / "link.txt").symlink_to(tmp_path / "secret.txt")
    with pytest.raises(ValueError, match="expects a path inside the part's folder"):
        asset("link.txt")
    with pytest.raises(ValueError, match="^asset.. expects a path relative to the part's module or to the workspace, found `/etc/passwd`$"):
        asset("/etc/passwd")
    assert recorded == []


def test_asset_without_worker_uses_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "data.txt").write_text("data")
    monkeypatch.chdir(tmp_path)
    assert asset("data.txt").read_text() == "data"
