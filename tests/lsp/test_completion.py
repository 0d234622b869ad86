"""Completion at the cursor: cases in which `│` is the cursor, and the two robots with values and keys removed."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from live.documents import FINGER, ROBOT, write
from lsp.documents import Documents, analysed
from thingc.base.diagnostics import Report
from thingc.base.source import MappingNode, Path as Keys, ScalarNode, Span, walk
from thingc.documents.load.documents import read_tree
from thingc.documents.load.text import Source
from thingc.tools.cli.main import main
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.completion import CompletionItem, items

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def sound(robot: Path, shared_store: str) -> dict[str, Analysis]:
    """Return the analyses of the robot and of its finger."""
    documents = Documents(shared_store)
    return {
        text: documents.analysis(path, text) for path, text in ((robot, ROBOT), (robot.with_name("finger.yaml"), FINGER))
    }


def at(text: str, found: str, marked: str) -> tuple[str, int]:
    """Return the text in which `found`, which occurs once, is replaced by `marked`, and the offset of the cursor in it."""
    assert text.count(found) == 1, found
    changed = text.replace(found, marked)
    return changed.replace("│", ""), changed.index("│")


def accepted(text: str, item: CompletionItem) -> str:
    return text[: item.start] + item.text + text[item.end :]


CASES: dict[str, tuple[str, str, list[str]]] = {
    # what stands in the robot, what it is replaced by, and what is offered first
    "kinds of joints": ("type: revolute", "type: │", ["fixed", "revolute", "continuous", "prismatic"]),
    "a mount, not of the other side": ("child: palm.seat", "child: │", ["finger_0.seat", "finger_1.seat", "palm.seat"]),
    "mounts behind a dot": ("child: palm.seat", "child: palm.│", ["seat", "origin", "plate.seat", "plate.origin"]),
    "mounts behind a dot, by the index": ("child: finger_$i.seat", "child: finger_$i.│", ["seat", "origin"]),
    "an item by the index": ("child: finger_$i.seat", "child: │", ["finger_$i.seat", "finger_0.seat", "finger_1.seat"]),
    "units of an angle": ("lower: -90 deg", "lower: -90 │", ["deg", "rad", "mrad", "rev"]),
    "units of a mass": ("mass: 1 kg", "mass: 1│", ["g", "kg", "mg", "t", "lb"]),
    "units of an inertia": ("ixx: 1e-3 kg*m^2", "ixx: 1e-3 │", ["kg*m^2", "g*cm^2"]),
    "keys of a limit, without those that are there": ("upper: 120 deg}", "upper: 120 deg, │}", ["effort", "velocity", "cone"]),
    "keys of a joint": ("    limit: {lower", "    │\n    limit: {lower", ["drive", "dynamics", "turn", "gap"]),
    "keys of a new component": ("  palm: {assembly: palm.yaml}", "  palm: {│}", ["part", "file", "assembly", "link", "frame", "attach"]),
    "keys of a component that is an assembly": (
        "palm: {assembly: palm.yaml}", "palm: {assembly: palm.yaml, │}", ["parameters", "attach", "at", "material"],
    ),
    "documents": ("assembly: palm.yaml", "assembly: │", ["finger.yaml", "palm.yaml"]),
    "parameters of a nested document": ("parameters: {mass: =(i + 1) * 50 g}", "parameters: {│}", ["mass"]),
    "names in an expression": ("mass: =(i + 1) * 50 g", "mass: =(│", ["i", "reach", "count", "min"]),
    "a unit in an expression": ("mass: =(i + 1) * 50 g", "mass: =(i + 1) * 50 │", ["mm", "deg", "g", "kg"]),
    "a parameter that fits": ("xyz: [0, 0, 40 mm]", "xyz: [0, 0, │]", []),
    "poses": ("pose: out", "pose: │", ["out"]),
    "joints in a pose": ("out: {yaw_0: 30 deg}", "out: {yaw_0: 30 deg, │}", ["yaw_1"]),
    "a value in a pose": ("yaw_0: 30 deg", "yaw_0: 30 │", ["deg", "rad"]),
    "modes": ("held: {root: finger_1.seat, base: fixed}", "held: {extends: │}", ["bench"]),
    "roots": ("root: base,", "root: │,", ["base", "finger_0", "finger_1", "palm"]),
    "materials": ("materials: [materials.yaml]", "materials: [│]", ["materials.yaml"]),
    "codes that may be allowed": ("joints:\n", "allow: {│}\njoints:\n", ["TC306", "TC347"]),
    "a material": ("palm: {assembly: palm.yaml}", "palm: {assembly: palm.yaml, material: │}", ["oak"]),
    "a half word": ("base: fixed, pose", "base: fi│, pose", ["fixed", "held", "free"]),
    "true or false": ("palm: {assembly: palm.yaml}", "palm: {assembly: palm.yaml, visual: │}", ["true", "false"]),
    "nothing in a comment": ("name: robot", "name: robot  # │", []),
    "a key behind a broken line": ("    limit: {lower", "    drive: [\n    │\n    limit: {lower", ["dynamics", "turn"]),
}


@pytest.mark.parametrize("name", CASES)
def test_first_completion_items(sound: dict[str, Analysis], name: str) -> None:
    found, marked, first = CASES[name]
    base = ROBOT if found in ROBOT else FINGER
    text, offset = at(base, found, marked)
    offered = [one.label for one in items(sound[base], text, offset)]
    assert offered[: len(first)] == first
    if not first:
        assert offered == []


TEXTS: dict[str, tuple[str, str, str, str]] = {
    # what stands in the robot, what it is replaced by, the item that is accepted, and what stands there then
    "a key in braces": ("upper: 120 deg}", "upper: 120 deg, eff│}", "effort", "upper: 120 deg, effort: }"),
    "a key of a mapping on a line": ("pose: out}", "pose: out}\n  new:\n    cont│", "contacts", "\n  new:\n    contacts:\n      "),
    "a key that is written again": ("type: revolute", "ty│: revolute", "type", "    type: revolute"),
    "a unit without a space": ("lower: -90 deg", "lower: -90│", "deg", "lower: -90 deg"),
    "a value behind the colon": ("type: revolute", "type:│", "revolute", "type: revolute\n"),
    "behind the dot alone": ("child: palm.seat", "child: palm.se│at", "seat", "child: palm.seat}"),
    "a function": ("mass: =(i + 1) * 50 g", "mass: =m│", "max", "mass: =max("),
    "a name in the middle": ("mass: =(i + 1) * 50 g", "mass: =re│ach * 2", "reach", "mass: =reach * 2"),
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_after_accepting_an_item(sound: dict[str, Analysis], name: str) -> None:
    found, marked, shown, after = TEXTS[name]
    text, offset = at(ROBOT, found, marked)
    item = next(one for one in items(sound[ROBOT], text, offset) if one.label == shown)
    assert after in accepted(text, item)
    assert "\n" not in text[item.start : item.end] and item.start <= offset <= item.end


TOML_ROBOT = """\
thingc = "assembly/1"
name = "arm"

[parameters]
reach = "120 mm"

[components]
base = {frame = true, mounts = {top = {}}}
arm = {frame = true, mounts = {seat = {}}}

[joints.lift]
type = "prismatic"
parent = "base.top"
child = "arm.seat"
limit = {lower = "0 mm", upper = "=reach"}
"""


@pytest.mark.parametrize(("kind", "offered"), [
    ("prismatic", {"m", "mm"}), ("screw", {"rad", "deg"}), ("cylindrical", {"m", "mm", "rad", "deg"}),
])
def test_units_of_a_limit_depend_on_the_joint_type(toml: tuple[Documents, Path], kind: str, offered: set[str]) -> None:
    documents, path = toml
    text, offset = at(TOML_ROBOT.replace("prismatic", kind), 'lower = "0 mm"', 'lower = "5 │')
    units = {one.label for one in items(documents.analysis(path, text), text, offset)}
    assert units & {"m", "mm", "rad", "deg", "kg", "N"} == offered


@pytest.mark.parametrize(("found", "marked", "shown", "after"), [
    ('type = "prismatic"', "type = │", "prismatic", 'type = "prismatic"'),
    ('parent = "base.top"', 'parent = "base.│"', "top", 'parent = "base.top"'),
    ('parent = "base.top"', 'parent = "base.│', "top", 'parent = "base.top'),
    ('lower = "0 mm"', 'lower = "5│"', "mm", 'lower = "5 mm"'),
    ('upper = "=reach"', "upper = │", "=reach", 'upper = "=reach"'),
    ('limit = {lower', "dri│\nlimit = {lower", "drive", "drive = \nlimit"),
    ("[joints.lift]", "[joi│", "joints", "[joints"),
], ids=["word", "mount", "open", "unit", "expression", "key", "header"])
def test_completion_in_toml(toml: tuple[Documents, Path], found: str, marked: str, shown: str, after: str) -> None:
    documents, path = toml
    text, offset = at(TOML_ROBOT, found, marked)
    item = next(one for one in items(documents.analysis(path, text), text, offset) if one.label == shown)
    assert after in accepted(text, item)


@pytest.fixture(scope="module")
def toml(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> tuple[Documents, Path]:
    folder = tmp_path_factory.mktemp("toml")
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    documents = Documents(shared_store)
    assert documents.analysis(folder / "arm.toml", TOML_ROBOT).model is not None
    return documents, folder / "arm.toml"


def test_document_that_never_parsed_offers_top_level_keys(robot: Path, shared_store: str) -> None:
    text = "thingc: assembly/1\nname: ]\n"
    offered = [one.label for one in items(analysed(shared_store, robot, text), text, len(text))]
    assert offered[:1] == ["components"] and "joints" in offered and "name" not in offered


def test_reported_codes_are_offered_first(robot: Path, shared_store: str) -> None:
    long = ROBOT.replace("upper: 120 deg", "upper: 120000 deg")
    analysis = analysed(shared_store, robot, long)
    assert {one.code.code for one in analysis.findings} == {"TC515"}
    text, offset = at(long, "joints:\n  lift: {", "joints:\n  lift: {allow: {│}, ")
    offered = [one.label for one in items(analysis, text, offset)]
    assert offered[:2] == ["TC515", "TC306"]


def test_completion_in_variants(robot: Path, shared_store: str) -> None:
    path = robot.with_name("sizes.yaml")
    text = "thingc: variants/1\nname: sizes\nassembly: robot.yaml\nparameters:\n  count: [1, 2]\n"
    analysis = analysed(shared_store, path, text)
    cut, offset = at(text, "assembly: robot.yaml", "assembly: │")
    assert [one.label for one in items(analysis, cut, offset)] == ["finger.yaml", "palm.yaml", "robot.yaml"]
    cut, offset = at(text, "  count: [1, 2]", "  count: [1, 2]\n  │")
    assert [one.label for one in items(analysis, cut, offset)] == ["reach"]


def test_edits_stay_on_the_line_of_the_cursor(sound: dict[str, Analysis]) -> None:
    """Random text is inserted at random places."""
    chance = random.Random(3)
    offered = 0
    for _ in range(250):
        begin = chance.randrange(len(ROBOT))
        typed = "".join(chance.choice(":{}[],'\"#-=. \n$&*|>ab1") for _ in range(chance.choice([0, 1, 1, 2, 3])))
        text = ROBOT[:begin] + typed + ROBOT[begin + chance.choice([0, 0, 1, 5, 40]) :]
        offset = begin + len(typed)
        for one in items(sound[ROBOT], text, offset):
            offered += 1
            assert one.start <= offset <= one.end and "\n" not in text[one.start : one.end], text[begin - 30 : begin + 30]
    assert offered > 300


def test_details_show_mount_poses_and_parameter_values(robot: Path, shared_store: str) -> None:
    moved = FINGER.replace("mounts: {seat: {}}", "mounts: {seat: {xyz: 0 10 0 mm, rpy: 90 0 0 deg}}")
    changed = moved.replace("mass: 50 g", "mass: =25 g * 2")
    path = robot.with_name("finger.yaml")
    documents = Documents(shared_store)
    text, offset = at(changed, "in: bone.seat", "in: bone.│")
    documents.analysis(path, changed)
    seat = next(one for one in items(documents.analysis(path, text), text, offset) if one.label == "seat")
    assert seat.detail == "(0, 10, 0) mm, z along -y"
    text, offset = at(changed, "mass: =mass", "mass: │")
    assert [(one.label, one.detail) for one in items(documents.analysis(path, text), text, offset)] == [("=mass", "50 g")]


def test_workers_are_requested_for_unknown_parts(tmp_path: Path) -> None:
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "frame.py").write_text("from thingc import Thing\n\nclass Bar(Thing):\n    pass\n")
    documents = Documents(str(tmp_path / "store"))
    text, offset = at("thingc: assembly/1\nname: a\ncomponents:\n  a: {frame: true}\n", "frame: true", "part: │")
    assert items(documents.analysis(tmp_path / "a.yaml", text), text, offset) == []
    assert documents.woken == 1


# --- the two robots ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def parts(shared_store: str) -> str:
    """Return a store with the parts of both robots and the schemas of their classes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THINGC_STORE", shared_store)
        for name in ("arm.yaml", "minchw/minchw.yaml"):
            assert main(["check", str(ROOT / "assemblies" / name)]) == 0
    return shared_store


def places(text: str) -> Iterator[tuple[Keys, str, int, int]]:
    """Yield every key and every value on a line: path, role, first character and end offset."""
    tree = read_tree("a.yaml", text.encode(), Report())
    assert tree is not None
    starts = Source("a.yaml", text).starts

    def ends(span: Span) -> tuple[int, int]:
        return starts[span.line - 1] + span.column - 1, starts[span.end_line - 1] + span.end_column - 1

    for path, node in walk(tree):
        if isinstance(node, MappingNode):
            for key, span in node.keys.items():
                yield (*path, key), "key", *ends(span)
        elif isinstance(node, ScalarNode) and node.span.line == node.span.end_line:
            yield path, "value", *ends(node.span)


OWN = {"components", "joints", "poses", "modes", "parameters", "mounts", "links", "tests", "sensors"}
"""Sections whose names are chosen by the document."""
CONSEQUENCES = {
    "TC525",  # a mount is shown by the name of another one: one may want to
    "TC348",  # in a mode that floats no drive holds the base
}
DOCUMENTS = ["end_effector.yaml", "minchw/leg.yaml", "minchw/minchw.yaml"]


@pytest.mark.parametrize("name", DOCUMENTS)
def test_removed_text_is_offered_and_accepted_items_are_valid(parts: str, name: str) -> None:
    """At each place of the robots, the key or name is removed and completion is requested. Then a sample of all items is accepted: no
    new finding may appear at that place."""
    path = ROOT / "assemblies" / name
    text = path.read_text()
    documents = Documents(parts)
    sound = documents.analysis(path, text)
    assert sound.findings == ()
    offers: list[tuple[Keys, str, CompletionItem]] = []
    asked = 0
    for keys, kind, start, end in places(text):
        cut = text[:start] + text[end:]
        offered = items(sound, cut, start)
        named = [one for one in offered if not one.label.startswith("=")]
        if kind == "value":
            offers += [(keys, cut, one) for one in offered]
        chosen = "*" in text[start:end] or (kind == "key" and len(keys) == 2 and keys[0] in OWN)
        if named and not chosen:
            asked += 1
            shown = f"{keys}: {[one.text for one in offered[:8]]}"
            assert any(accepted(cut, one) == text for one in offered), shown
            dot = text.rfind(".", start, end) + 1
            if kind == "value" and dot > start + 1 and text[start:end].count(".") == 1 and any("." in one.label for one in named):
                cut = text[:dot] + text[end:]
                assert any(accepted(cut, one) == text for one in items(sound, cut, dot)), f"behind the dot: {shown}"
    assert asked > 40
    for keys, cut, one in random.Random(name).sample(offers, 4):
        changed = accepted(cut, one)
        line = changed.count("\n", 0, one.start) + 1
        column = one.start - (changed.rfind("\n", 0, one.start) + 1) + 1
        place = Span(file=str(path), line=line, column=column, end_line=line, end_column=column + len(one.text))
        found = [
            f"{finding.code.code} {finding.message}" for finding in documents.analysis(path, changed).findings
            if finding.span is not None and place.holds(finding.span) and finding.code.code not in CONSEQUENCES
        ]
        assert found == [], f"{keys}: {one.text}"


def test_part_items_show_parameters_and_description(parts: str) -> None:
    text = (ROOT / "assemblies" / "arm.yaml").read_text()
    analysis = analysed(parts, ROOT / "assemblies" / "arm.yaml", text)
    cut, offset = at(text, "part: arm:BasePlate", "part: │")
    brace = next(one for one in items(analysis, cut, offset) if one.label == "arm:RotorBrace")
    assert brace.detail == "length, thickness"
    modules = [one.label.partition(":")[0] for one in items(analysis, cut, offset)]
    used = {"arm", "thingc_stock.dynamixel", "thingc_stock.fasteners"}
    first = [module for module in modules if module in used]
    assert modules[: len(first)] == first  # modules that the document has parts of already
    assert brace.description.startswith("One of the two sides of an arm link")
    cut, offset = at(text, "parent: yaw_servo.rotor", "parent: yaw_servo.│")
    rotor = next(one for one in items(analysis, cut, offset) if one.label == "rotor")
    assert rotor.detail == "(0, 0, 19) mm, z along +z"
    cut, offset = at(text, "attach: {seat: plate.servo_screw_$i}", "attach: {seat: plate.│}")
    assert "servo_screw_$i" in [one.label for one in items(analysis, cut, offset)]
