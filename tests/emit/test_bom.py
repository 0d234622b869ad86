"""The bill of materials, compared with written-out tables and manual counts."""

from __future__ import annotations

import csv
import io
import json
from itertools import count
from pathlib import Path

import pytest
from msgspec.structs import replace

import thingc
from emit.small_robot import assembly, petg, request
from thingc.base.safe_text import format_cell
from thingc.documents.load import csv_tree
from thingc.documents.spec.catalog import CatalogRow
from thingc.geometry.lock import json_format
from thingc.geometry.record import PartDefinition, PartRecord
from thingc.geometry.record_json import record_from_json, record_to_json
from thingc.geometry.store.local import Store
from thingc.model.assembly.hag import Definition
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.model.resolve.types import BomEntry, Overrides, Process
from thingc.targets.bom.emit import COLUMNS, csv_text, emit, items, make_of


@pytest.fixture
def whole(tmp_path: Path) -> Assembly:
    return assembly(Store(str(tmp_path)))


def with_changes(whole: Assembly, path: str, **more: object) -> Assembly:
    return replace(whole, occurrences=tuple(replace(o, **more) if o.path == path else o for o in whole.occurrences))  # type: ignore[arg-type]


def written(whole: Assembly, tmp_path: Path) -> tuple[str, list[dict[str, object]]]:
    files = emit(request(whole, Store(str(tmp_path)))).files
    assert list(files) == ["bom.csv", "bom.json"]
    table, entries = files["bom.csv"], files["bom.json"]
    assert isinstance(table, bytes) and isinstance(entries, bytes)
    return table.decode(), json.loads(entries)


def test_csv_table_matches_expected_text(whole: Assembly, tmp_path: Path) -> None:
    """`bom.csv` of the small robot equals a written-out table."""
    table, _ = written(whole, tmp_path)
    assert table == """\
number,name,definition,quantity,make,material,mass,mass_source,supplier,cost,total,link,picture
1,Plate,arm:Plate,1,print,petg,0.0762,derived,,,,,
2,Brace,arm:Brace(length=0.12),2,print,petg,0.018288,derived,,,,,
3,Palm,arm:Palm,1,print,petg,0.016256,derived,,,,,
4,Cap,arm:Cap,1,print,petg,0.00254,derived,,,,,
5,motor,cad/motor.step,1,print,petg,0.2,measured,,,,,
6,XM430,stock:XM430,2,buy,,0.082,vendor,Robotis,289 EUR,578 EUR,,
7,board,frame,1,buy,,0.012,measured,,,,,
"""


def test_json_and_csv_have_equal_rows(whole: Assembly, tmp_path: Path) -> None:
    """`bom.json` has the rows of `bom.csv`, with numbers as numbers and empty cells as null."""
    table, entries = written(whole, tmp_path)
    rows = list(csv.DictReader(io.StringIO(table)))
    assert [list(entry) for entry in entries] == [list(COLUMNS)] * len(rows)
    assert [{k: "" if v is None else str(v) for k, v in entry.items()} for entry in entries] == rows
    assert isinstance(entries[0]["quantity"], int) and isinstance(entries[0]["mass"], float)
    assert entries[0]["supplier"] is None


def test_quantities_and_masses_add_up(whole: Assembly) -> None:
    """Quantities add up to the number of occurrences, and masses to the mass of the robot. Only the marker has no row."""
    rows = items(whole)
    assert sum(row.quantity for row in rows) == len(whole.occurrences) - 1, "the marker alone is nothing to have in hand"
    mass = sum(row.quantity * row.mass for row in rows)
    assert mass == pytest.approx(sum(o.properties.mass for o in whole.occurrences), rel=1e-12)


@pytest.mark.parametrize("more", [
    {"material": replace(petg(), name="steel")},
    {"properties": None},
    {"mass_source": "measured"},
    {"bom": BomEntry(supplier="a friend")},
    {"bom": BomEntry(make="machine")},
    {"bom": BomEntry(number="B-7")},
])
def test_different_attributes_make_separate_rows(whole: Assembly, more: dict[str, object]) -> None:
    """Two equal braces get separate rows if material, mass, mass source or an entry of `bom` differs."""
    brace = next(o for o in whole.occurrences if o.path == "brace_b")
    if "properties" in more:
        more = {"properties": replace(brace.properties, mass=0.5)}
    rows = [row for row in items(with_changes(whole, "brace_b", **more)) if row.name == "Brace"]
    assert [row.quantity for row in rows] == [1, 1]


def test_make_is_derived_from_process_and_overrides(whole: Assembly) -> None:
    """`make` comes from the `bom` of the document, the Thing, the process of the override or material, and last from the print file."""
    def make(path: str, **more: object) -> str:
        return make_of(next(o for o in with_changes(whole, path, **more).occurrences if o.path == path))

    assert make("plate") == "print"
    assert make("plate", material=None) == "print", "it has a print file, so it can be printed"
    assert make("plate", material=petg("CNC")) == "machine"
    assert make("plate", material=petg("sls")) == "print"
    assert make("plate", overrides=Overrides(process=Process(kind="milling"))) == "machine"
    assert make("plate", overrides=Overrides(process=Process(kind="bought"))) == "buy"
    assert make("plate", overrides=Overrides(process=Process(walls=4)), material=petg("laser")) == "machine", "merged"
    assert make("plate", bom=BomEntry(make="buy")) == "buy"
    assert make("servo_a") == "buy", "the Thing says so"
    assert make("servo_a", bom=BomEntry(make="print")) == "print", "the document beats the Thing"
    assert make("board") == "buy"
    assert make("board", bom=BomEntry(make="machine")) == "machine"


def test_explicit_numbers_are_kept(whole: Assembly) -> None:
    """Generated numbers skip the numbers that the document specifies."""
    whole = with_changes(whole, "hand/cap", bom=BomEntry(number="2"))
    whole = with_changes(whole, "board", bom=BomEntry(number="E-100"))
    assert [(row.number, row.name) for row in items(whole)] == [
        ("1", "Plate"), ("3", "Brace"), ("4", "Palm"), ("2", "Cap"), ("5", "motor"), ("6", "XM430"), ("E-100", "board"),
    ]


def test_marker_with_bom_entry_has_a_row(whole: Assembly) -> None:
    """A frame without mass gets a row if it has a `bom` entry."""
    whole = with_changes(whole, "marker", bom=BomEntry(supplier="sticker shop"))
    assert [(row.name, row.make, row.mass) for row in items(whole) if row.name == "marker"] == [("marker", "buy", 0.0)]


def test_name_from_thing_is_used(whole: Assembly) -> None:
    """A name in the `bom` of a Thing is the name of the row."""
    servo = next(o for o in whole.occurrences if o.path == "servo_a")
    assert servo.record is not None
    stated = replace(servo.record, bom={**servo.record.bom, "name": "XM430-W350-R"})
    assert "XM430-W350-R" in [row.name for row in items(with_changes(whole, "servo_a", record=stated))]


def test_mirrored_printed_part_has_its_own_row(whole: Assembly) -> None:
    """A printed part and its mirror image are two rows."""
    brace = next(o for o in whole.occurrences if o.path == "brace_b")
    assert isinstance(brace.component.definition, PartDefinition)
    image = Definition.of(brace.component.definition.mirror_image("y"))
    rows = [row for row in items(with_changes(whole, "brace_b", definition=image)) if row.name.startswith("Brace")]
    assert [(row.name, row.definition, row.quantity) for row in rows] == [
        ("Brace", "arm:Brace(length=0.12)", 1), ("Brace (mirror=y)", "arm:Brace(length=0.12, mirror=y)", 1),
    ]


def test_mirrored_bought_part_shares_the_row(whole: Assembly) -> None:
    """A bought part and its mirror image are one row, with the definition of the part."""
    servo = next(o for o in whole.occurrences if o.path == "servo_b")
    assert isinstance(servo.component.definition, PartDefinition)
    image = Definition.of(servo.component.definition.mirror_image("y"))
    rows = [row for row in items(with_changes(whole, "servo_b", definition=image)) if row.name == "XM430"]
    assert [(row.name, row.definition, row.quantity) for row in rows] == [("XM430", "stock:XM430", 2)]


def test_items_of_a_repeat_share_a_row(whole: Assembly) -> None:
    """Items of a repeat, and components with the same explicit number, are merged. Similar names such as `fuse` and `fuse_holder` are
    not."""
    board, indices = next(o for o in whole.occurrences if o.path == "board"), count()

    def item(name: str, key: str, number: str | None = None) -> Occurrence:
        named = replace(board.component, name=name, key=key)
        return replace(board, component=named, bom=BomEntry(number=number), index=next(indices))

    pieces = (item("cell_0", "cell"), item("cell_1", "cell"), item("nut_left", "nut_left", "M3"), item("nut_right", "nut_right", "M3"))
    rows = items(replace(whole, occurrences=(*pieces, item("fuse", "fuse"), item("fuse_holder", "fuse_holder"))))
    assert [(row.number, row.name, row.quantity) for row in rows] == [
        ("1", "cell", 2), ("M3", "nut_left", 2), ("2", "fuse", 1), ("3", "fuse_holder", 1),
    ]


def test_special_characters_round_trip_through_csv(whole: Assembly, tmp_path: Path) -> None:
    """Quotes, umlauts and separators round-trip; a newline is escaped, so each row is one line."""
    awkward = 'Müller, "Söhne"\nGmbH; Köln'
    table, entries = written(with_changes(whole, "board", bom=BomEntry(supplier=awkward)), tmp_path)
    assert [row["supplier"] for row in csv.DictReader(io.StringIO(table, newline=""))][-1] == 'Müller, "Söhne"\\nGmbH; Köln'
    assert len(table.splitlines()) == len(entries) + 1, "a row is a line"
    assert entries[-1]["supplier"] == awkward


FORMULAS = (
    "=1+1", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", " =1", "=cmd|' /C calc'!A0", '=HYPERLINK("http://example.org")', "-2+3+cmd|'x'!A0",
    "\uff1d1+1", "+49 170 1234567", "-0x10", "1e5=", "--1",
)


@pytest.mark.parametrize("text", FORMULAS)
def test_formulas_are_escaped_in_cells(text: str) -> None:
    """Text that a spreadsheet would evaluate is prefixed with a quote, as OWASP recommends against CSV injection: text that begins with
    `=`, `+`, `-`, `@`, a tab or a carriage return."""
    written = format_cell(text)
    if text[0].isdigit():
        assert written == text
    else:
        assert written.startswith(("'", "\\"))
        assert not written.startswith(tuple("=+-@\t\r\uff1d"))


@pytest.mark.parametrize(("value", "written"), [
    (-0.5, "-0.5"), ("-0.5", "-0.5"), ("+3", "+3"), ("-1e-9", "-1e-9"), (-3, "-3"), (float("-inf"), "-inf"), ("-.5", "-.5"), (0.1, "0.1"),
    (None, ""), (True, "true"), ("a-b", "a-b"), ("", ""), ("M3=M3", "M3=M3"),
])
def test_numbers_are_not_escaped(value: object, written: str) -> None:
    """Signed numbers, booleans and harmless text are written without a prefix."""
    assert format_cell(value) == written


ROBOT = """\
thingc: assembly/1
name: robot
catalog: shop/catalog.csv
components:
  base: {frame: true, mass: 1 kg, bom: {number: B-1, cost: {"10": 9.80 EUR, "1": 12.50 EUR}}}
  left: {assembly: gripper.yaml, at: {in: base.origin, xyz: 100 0 0 mm}, bom: {as: one, number: RG2}}
  right: {assembly: gripper.yaml, mirror: x, at: {in: base.origin, xyz: -100 0 0 mm}, bom: {as: one, number: RG2, cost: 3000 EUR}}
  screw: {frame: true, repeat: {count: 12}, at: {in: base.origin}, mass: 1 g, bom: {number: M3x10}}
  few: {frame: true, at: {in: base.origin}, mass: 1 g, bom: {number: reel, supplier: a friend}}
"""
GRIPPER = """\
thingc: assembly/1
name: gripper
components:
  palm: {frame: true, mass: 200 g, bom: {number: M3x10}}
  finger: {frame: true, mass: 50 g, at: {in: palm.origin, xyz: 0 0 40 mm}}
"""
CATALOG = """\
number,supplier,cost,quantity,link,picture\r
RG2,OnRobot,2500 EUR,,https://onrobot.com/rg2,rg2.png\r
M3x10,"Screws, Inc.",0.10 EUR,,,\r
M3x10,,0.07 EUR,12,,\r
M3x10,,0.01 EUR,13,,\r
reel,Wires,4 EUR,100,,\r
"""


def bill(folder: Path, catalog: str = CATALOG, robot: str = ROBOT) -> tuple[list[dict[str, str]], list[str]]:
    """Write the documents, compile, and return the rows of `bom.csv` and the errors with their positions."""
    (folder / "shop").mkdir(exist_ok=True)
    (folder / "shop" / "rg2.png").write_bytes(b"png")
    for name, text in (
        ("thingc.toml", 'thingc = "workspace/1"\n'), ("robot.yaml", robot), ("gripper.yaml", GRIPPER), ("shop/catalog.csv", catalog),
    ):
        (folder / name).write_text(text, encoding="utf-8", newline="")
    try:
        built = thingc.compile(str(folder / "robot.yaml"))
    except thingc.CompileError as error:
        spans = [(one.code.code, one.span) for one in error.diagnostics if one.span is not None]
        return [], [f"{code} {Path(span.file).name}:{span.line}:{span.column}" for code, span in spans]
    return list(csv.DictReader(io.StringIO(csv_text(items(built.assembly))))), []


def test_catalog_price_depends_on_quantity(tmp_path: Path) -> None:
    """The catalog row with the largest minimum quantity that is reached applies: 12 screws cost 0.07 EUR each. A cost that requires 100
    pieces is not used."""
    rows, found = bill(tmp_path)
    assert found == []
    by_number = {row["number"]: row for row in rows if row["definition"] != "gripper(mirror=x)"}
    screws = by_number["M3x10"]
    assert (screws["quantity"], screws["cost"], screws["total"], screws["supplier"]) == ("12", "0.07 EUR", "0.84 EUR", "Screws, Inc.")
    assert (by_number["B-1"]["cost"], by_number["B-1"]["total"]) == ("12.50 EUR", "12.50 EUR")
    assert (by_number["reel"]["cost"], by_number["reel"]["supplier"]) == ("", "a friend")


def test_bought_assembly_is_one_row(tmp_path: Path) -> None:
    """A nested assembly with `as: one` is one row with the total mass of its parts, which have no rows. A mirrored one with another cost
    has its own row."""
    rows, _ = bill(tmp_path)
    left, right = (row for row in rows if row["number"] == "RG2")
    assert (left["definition"], left["quantity"], left["make"], left["mass"]) == ("gripper", "1", "buy", "0.25")
    assert (left["total"], left["link"], left["picture"]) == ("2500 EUR", "https://onrobot.com/rg2", "shop/rg2.png")
    assert (right["definition"], right["total"]) == ("gripper(mirror=x)", "3000 EUR")
    assert len(rows) == 5, "the parts of a bought assembly have no rows"
    alike, _ = bill(tmp_path, robot=ROBOT.replace("mirror: x, ", "").replace(", cost: 3000 EUR", ""))
    assert next((row["quantity"], row["total"]) for row in alike if row["number"] == "RG2") == ("2", "5000 EUR")


@pytest.mark.parametrize(("right", "inner", "expected"), [
    ("", "bom: {as: one, number: RG2}", "arm.yaml:5: move"),
    ("", "bom: {as: one}", "arm.yaml:5: move"),
    ("", "as: lump, bom: {as: one, number: RG2}", "arm.yaml:5: move"),
    ("", "as: lump, bom: {as: one, make: buy}", "arm.yaml:5: move"),
    ("", "bom: {as: one, number: RG2}, allow: {TC580: the gripper is symmetric}", ""),
    ("", "bom: {as: one, number: RG2, make: print}", ""),
    ("", "mirror: x, bom: {as: one, number: RG2}", ""),
    ("", "as: lump", ""),
    ("", "at: {in: wrist.origin}", ""),
    ("assembly: gripper.yaml, bom: {as: one}, ", "bom: {as: one, number: RG2}", "robot.yaml:6: remove"),
    ("assembly: gripper.yaml, bom: {as: one, number: RG2-L}, ", "bom: {as: one, number: RG2}", ""),
])
def test_mirror_image_of_bought_assembly_is_a_warning(right: str, inner: str, expected: str, tmp_path: Path) -> None:
    """The arm on the right side is a mirror image, and so is its gripper, or the gripper itself is on the right side. The gripper keeps the
    order number, because it may be symmetric."""
    placed = inner if inner.startswith("at:") else f"{inner}, at: {{in: wrist.origin}}"
    arm = (
        "thingc: assembly/1\nname: arm\ncomponents:\n  wrist: {frame: true, mass: 1 kg}\n"
        f"  gripper: {{assembly: gripper.yaml, {placed}}}\n"
    )
    robot = ROBOT.partition("  left:")[0].replace("catalog: shop/catalog.csv\n", "") + (
        "  left: {assembly: arm.yaml, at: {in: base.origin}}\n"
        f"  right: {{{right or 'assembly: arm.yaml, '}mirror: x, at: {{in: base.origin}}}}\n"
    )
    gripper = GRIPPER.replace("palm: {frame: true,", "palm: {link: true, shapes: [{box: 10 20 30 mm}],")
    for name, text in (("thingc.toml", 'thingc = "workspace/1"\n'), ("robot.yaml", robot), ("gripper.yaml", gripper), ("arm.yaml", arm)):
        (tmp_path / name).write_text(text)
    built = thingc.compile(str(tmp_path / "robot.yaml"))
    found = [(one, one.span) for one in built.diagnostics if one.code.code == "TC580"]
    texts = [f"{Path(span.file).name}:{span.line}: {str(one.help).partition(' ')[0]}" for one, span in found if span is not None]
    assert texts == [expected] * bool(expected)
    if "number: RG2" in inner and not right:
        rows = csv.DictReader(io.StringIO(csv_text(items(built.assembly))))
        assert [row["number"] for row in rows if "gripper" in row["name"]] == ["RG2"] * 2


MOTORS = """\
from build123d import Box
from thingc import Thing

class Motor(Thing):
    bom = {
        "number": "M-1", "supplier": "us", "cost": {10: "9.80 EUR", 2: "12 EUR", 1: "12.50 EUR"}, "link": "https://us.example/m1",
        "picture": "PICTURE",
    }
    def result(self):
        return Box(10, 10, 10)
    def mass(self):
        return 0.1
"""


def motors(folder: Path, store: str, text: str, picture: str = "motor.png") -> list[dict[str, str]]:
    """Return the rows of `bom.csv` for components of the class `Motor`, whose picture is in the folder of its module."""
    (folder / "parts").mkdir()
    for name, content in (("thingc.toml", 'thingc = "workspace/1"\n'), ("parts/motors.py", MOTORS.replace("PICTURE", picture)),
                          ("parts/motor.png", "png"), ("catalog.csv", "number,cost,quantity\nM-1,8 EUR,1\nM-1,6 EUR,9\n")):
        (folder / name).write_text(content)
    (folder / "robot.yaml").write_text(f"thingc: assembly/1\nname: robot\ncomponents:\n  base: {{frame: true}}\n{text}")
    built = thingc.compile(str(folder / "robot.yaml"), store=store)
    return list(csv.DictReader(io.StringIO(csv_text(items(built.assembly)))))


@pytest.mark.parametrize(("count", "more", "price"), [
    (9, "", "12 EUR"), (10, "", "9.80 EUR"), (10, ", bom: {cost: 7 EUR}", "7 EUR"), (9, "}\ncatalog: catalog.csv #", "6 EUR"),
])
def test_part_classes_have_prices_by_quantity_and_pictures(tmp_path: Path, shared_store: str, count: int, more: str, price: str) -> None:
    """Values of the document take precedence over those of the catalog, and these over those of the class."""
    text = f"  motor: {{part: motors:Motor, repeat: {{count: {count}}}, at: {{in: base.origin}}{more}}}\n"
    (row,) = motors(tmp_path, shared_store, text)
    assert (row["number"], row["quantity"], row["cost"], row["supplier"]) == ("M-1", str(count), price, "us")
    assert (row["link"], row["picture"]) == ("https://us.example/m1", "parts/motor.png")


def test_picture_of_a_part_class_is_a_file_of_the_workspace(tmp_path: Path, shared_store: str) -> None:
    with pytest.raises(thingc.CompileError, match="other.png"):
        motors(tmp_path, shared_store, "  motor: {part: motors:Motor, at: {in: base.origin}}\n", "other.png")


def test_prices_of_a_part_class_survive_the_lock_file() -> None:
    record = PartRecord(text="motors:Motor", bom={"cost": {"1": "12.50 EUR", "10": "9.80 EUR"}, "make": "buy"})
    values = json.loads(json.dumps(json_format.record_values(record)))
    assert json_format.read_record("motors:Motor", values, "parts", None).bom == record.bom
    assert record_from_json(record_to_json(record, "/w"), "/w").bom == record.bom


@pytest.mark.parametrize(("catalog", "found"), [
    ("number;cost\nRG2;1 EUR\n", ["TC103 catalog.csv:1:1"]),
    ("number,cost\nRG2,1 EUR,x\n", ["TC103 catalog.csv:2:11"]),
    ('number,cost\nRG2,"1 EUR\n', ["TC103 catalog.csv:2:1"]),
    ("number,price,cost,cost\n", ["TC201 catalog.csv:1:8", "TC104 catalog.csv:1:19"]),
    ("", ["TC117 catalog.csv:1:1"]),
    ("number,cost,quantity,link\nRG2,1,0,www.x.y\n", ["TC208 catalog.csv:2:5", "TC203 catalog.csv:2:7", "TC203 catalog.csv:2:9"]),
    ("number,picture\nRG2,none.png\n", ["TC113 catalog.csv:2:5"]),
    ("number,cost\nRG2,1 EUR\nRG2,2 EUR\n", ["TC311 catalog.csv:3:1"]),
    ("number,quantity,supplier\nRG2,,a\nRG2,10,b\n", ["TC311 catalog.csv:3:8"]),
    ("supplier\na\nb\n", ["TC202 catalog.csv:1:1"]),
])
def test_catalog_errors_point_to_the_cell(tmp_path: Path, catalog: str, found: list[str]) -> None:
    """Each fault in a catalog is reported with the line and column of its cell."""
    assert bill(tmp_path, catalog)[1] == found


def test_as_one_is_required_and_only_valid_for_assemblies(tmp_path: Path) -> None:
    """A BOM number of a nested assembly without `as: one` (TC335), and `as: one` on a component that is not an assembly (TC212), are
    errors."""
    assert bill(tmp_path, robot=ROBOT.replace("{as: one, number: RG2}", "{number: RG2}"))[1] == ["TC335 robot.yaml:6:74"]
    assert bill(tmp_path, robot=ROBOT.replace("bom: {number: B-1,", "bom: {as: one, number: B-1,"))[1] == ["TC212 robot.yaml:5:35"]


def test_catalog_reader_and_model_have_equal_columns() -> None:
    """The CSV reader of catalogs accepts exactly the fields of `CatalogRow`."""
    assert tuple(CatalogRow.model_fields) == csv_tree.COLUMNS
