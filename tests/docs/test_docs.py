"""The documentation says what the program does: documents check, commands print what is shown, tables equal the code."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

from docs.pages import PAGES, ROOT, WITH_LINKS, anchors, blocks, commands, documents, run, shows, table, unpack, without_fences
from thingc.diagnostics import Report, as_text
from thingc.workspace import Workspace

LANGUAGE = ROOT / "docs" / "language.md"
OUTPUTS = ROOT / "docs" / "outputs.md"
IDS = [page.name for page in PAGES]


@pytest.fixture
def here(page: Path, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The page's files in a folder, which is the working folder."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.chdir(unpack(page, tmp_path))
    return tmp_path


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_documents_of_a_page_are_right_and_commands_print_what_it_shows(page: Path, here: Path) -> None:
    for block in documents(page):
        assert block.file, f"{page.name}:{block.line}: a document needs a name: `# name.yaml`"
        if Path(block.file).name == "thingc.toml":
            report = Report()
            assert Workspace.find(str(here / block.file), report) is not None, as_text(report.diagnostics)
            continue
        printed = run(f"thingc check --strict {block.file}")
        assert printed == f"{block.file}: ok\n", f"{page.name}:{block.line}\n{printed}"
    for command, shown in commands(page):
        printed = run(command)
        assert shows(shown, printed), f"{page.name}: $ {command}\n{printed}"


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_part_that_a_page_shows_compiles_and_is_used(page: Path) -> None:
    python = [block for block in blocks(page) if block.language == "python"]
    for block in python:
        compile(block.text, f"{page.name}:{block.line}", "exec")
    text = page.read_text()
    for block in python:
        if block.file is not None:
            name = Path(block.file).stem
            assert re.search(rf"\b{name}:\w|python {re.escape(block.file)}", text), f"{page.name}: nothing uses {block.file}"


@pytest.mark.parametrize("page", WITH_LINKS, ids=[page.name for page in WITH_LINKS])
def test_links_resolve(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", without_fences(page)):
        if target.startswith("https://"):
            continue
        file, _, anchor = target.partition("#")
        there = (page.parent / file).resolve() if file else page
        assert there.exists(), f"{page.name}: {target}"
        assert not anchor or anchor in anchors(there), f"{page.name}: {target}"


def test_the_comparison_of_output_means_something() -> None:
    assert shows("a\n...\nd\n", "a\nb\nc\nd\n") and shows("a ... c", "a b c") and shows("...\nd", "a\nd")
    assert not shows("a\n...\nd\n", "a\nb\n") and not shows("a", "ab") and not shows("a ... c", "a\nc")


# --- language.md ---------------------------------------------------------------------------------------------------


def test_tables_of_keys_have_every_field_and_no_other() -> None:
    from pydantic import BaseModel

    from thingc.spec import assembly, materials, workspace

    models = {
        name: value for module in (assembly, materials, workspace) for name, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, BaseModel) and value.__module__ == module.__name__
    }
    text = LANGUAGE.read_text()
    said: set[str] = set()
    for marker in re.findall(r"<!-- (keys: [\w ]+) -->", text):
        rows = table(LANGUAGE, marker)
        for name in marker.removeprefix("keys: ").split():
            model = models[name]
            own = [model.model_fields[field].alias or field for field in model.__annotations__]
            assert [row[0].strip("`") for row in rows] == own, name
            for row in rows:
                required = model.model_fields[_field(model, row[0].strip("`"))].is_required()
                assert required == (row[2] == "an error") or (name, row[0]) in IN_OTHER_WORDS, (name, row)
            said.add(name)
    assert said == set(models)


IN_OTHER_WORDS = {("ModeSpec", "`root`"), ("DriveSpec", "`kp`")}
"""Required by a rule, not by the field itself (a mode may take its root from the one that it extends)."""


def _field(model: type, key: str) -> str:
    return next(name for name, field in model.model_fields.items() if key in (name, field.alias))  # type: ignore[attr-defined]


def test_choices_in_tables_are_those_of_the_models() -> None:
    """Every word of a `Literal` stands in its row, in backquotes (`mirror` and such: `x`, `y` or `z`)."""
    from typing import Literal, get_args, get_origin

    from thingc.spec import assembly, materials

    def words(annotation: object) -> set[str]:
        if get_origin(annotation) is Literal:
            return {word for word in get_args(annotation) if isinstance(word, str)}
        return {word for inner in get_args(annotation) for word in words(inner)}

    elsewhere = {("JointSpec", "type"), ("ComponentDefaults", "collision"), ("ModeSpec", "hold"), ("ModeSpec", "base")}
    for module in (assembly, materials):
        for marker in re.findall(r"<!-- (keys: [\w ]+) -->", LANGUAGE.read_text()):
            for name in marker.removeprefix("keys: ").split():
                model = getattr(module, name, None)
                if model is None or model.__module__ != module.__name__:
                    continue
                for row in table(LANGUAGE, marker):
                    key = row[0].strip("`")
                    if (name, key) not in elsewhere:
                        expected = words(model.model_fields[_field(model, key)].annotation)
                        assert expected <= set(re.findall(r"`([^`]+)`", row[1])), (name, key)


def test_units() -> None:
    from thingc.units import UNITS, parse_quantity

    said = {unit: row[0].partition(" (")[0] for row in table(LANGUAGE, "units") for unit in re.findall(r"`([^`]+)`", row[1])}
    assert said == {unit: dimension.words for unit, (_, _, dimension) in UNITS.items()}
    text = LANGUAGE.read_text()
    pairs = re.findall(r"(?:^- |, )`(1 \w+)` (?:is )?([\d.]+ \w+)", re.findall(r"^- `1 in` is.*$", text, re.MULTILINE)[0])
    assert len(pairs) == 6
    for one, other in pairs:
        assert parse_quantity(one).value == parse_quantity(other).value, (one, other)


def test_functions_of_expressions() -> None:
    from thingc.expressions import CONSTANTS, FUNCTIONS

    line = next(line for line in LANGUAGE.read_text().split("\n") if line.startswith("- Functions are"))
    listed, _, constants = line.partition("; the only constant is")
    assert set(re.findall(r"`(\w+)`", listed)) == set(FUNCTIONS)
    assert re.findall(r"`(\w+)`", constants)[:1] == list(CONSTANTS)


def test_kinds_of_joints() -> None:
    from thingc.joints import KINDS, LATER

    rows = table(LANGUAGE, "joint kinds")
    assert [row[0].strip("`") for row in rows] == list(KINDS)
    for row, kind in zip(rows, KINDS.values(), strict=True):
        assert row[1] == (kind.coordinate.words if kind.coordinate is not None else "none")
        assert row[3] == kind.limits
    reserved = re.search(r"\. (`cylindrical`.*) are reserved\.", LANGUAGE.read_text())
    assert reserved and set(re.findall(r"`(\w+)`", reserved.group(1))) == LATER


def test_gravity_and_raw_kinds_and_bounds() -> None:
    from thingc.emit import mjcf_raw
    from thingc.expressions.terms import MAX_DEPTH
    from thingc.load.documents import MAX_CHAIN
    from thingc.load.text import MAX_ALIAS_NODES, MAX_BYTES, MAX_LEVELS, MAX_NODES
    from thingc.resolve.modes import GRAVITY
    from thingc.resolve.repeats import MAX_OCCURRENCES, MAX_REPEAT
    from thingc.units import MAX_FACTORS, MAX_TEXT

    said = {row[0].strip("`"): tuple(map(float, row[1].strip("`").split())) for row in table(LANGUAGE, "gravity")}
    assert said == GRAVITY
    named, single, *_ = table(LANGUAGE, "raw")
    assert set(re.findall(r"`(\w+)`", named[1])) == set(mjcf_raw.NAMED)
    assert set(re.findall(r"`(\w+)`", single[1])) == set(mjcf_raw.SINGLE)
    numbers = [int(digits.replace(" ", "")) for row in table(LANGUAGE, "bounds") for digits in re.findall(r"\d[\d ]*\d|\d", row[1])]
    expected = [MAX_BYTES, MAX_LEVELS, MAX_NODES, MAX_ALIAS_NODES, MAX_TEXT, MAX_DEPTH, MAX_REPEAT, MAX_OCCURRENCES, MAX_CHAIN]
    assert numbers == expected
    assert f"At most {MAX_FACTORS} factors" in LANGUAGE.read_text()


@pytest.mark.parametrize("page", [LANGUAGE], ids=["language.md"])
def test_yaml_and_toml_of_the_small_example_are_one_document(page: Path, here: Path) -> None:
    assert run("thingc info crane.yaml --format json") == run("thingc info crane.toml --format json")


@pytest.mark.parametrize("page", [LANGUAGE], ids=["language.md"])
def test_what_is_not_built_yet_is_refused_as_such(page: Path, here: Path) -> None:
    head = "thingc: assembly/1\nname: x\nmaterials: [materials.yaml]\ncomponents:\n  a: {part: toy:Beam%s}\n  b: {part: toy:Beam}\njoints:\n"
    joint = "  j: {type: %s, parent: a.head, child: b.tail, limit: {lower: -1 rad, upper: 1 rad}%s}\n"
    plain = head % "" + joint % ("revolute", "")
    cases = [head % "" + joint % (kind, "") for kind in ("cylindrical", "universal", "ball", "planar", "screw")]
    cases += [head % ", mirror: x" + joint % ("revolute", "")]
    cases += [head % "" + joint % ("revolute", "") + (joint % ("revolute", ", loop: true")).replace("j:", "k:")]
    cases += [plain + f"modes: {{m: {{root: a, {key}}}}}\n" for key in ("hold: {b.head: here}", "cut: [j]", "base: planar", "base: ball")]
    cases += [plain + "sensors: {s: {type: imu, at: a.head}}\n", plain + "raw: {urdf: {joint: {j: {x: 1}}}}\n"]
    cases += ["thingc: variants/1\nassembly: crane.yaml\n"]
    for text in cases:
        (here / "x.yaml").write_text(text)
        printed = run("thingc check x.yaml")
        assert re.findall(r"^error\[(TC\d+)\]", printed, re.MULTILINE) == ["TC301"], text + printed
    (here / "x.yaml").write_text(plain)
    assert run("thingc check x.yaml") == "x.yaml: ok\n"


@pytest.mark.parametrize("page", [LANGUAGE], ids=["language.md"])
def test_a_nested_assembly_takes_no_override(page: Path, here: Path) -> None:
    values = {
        "material": "pla", "mass": "1 kg", "com": "0 0 0", "inertia": "{ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}",
        "collision": "box", "visual": "false", "process": "{walls: 3}", "bom": "{number: x}", "expect": "ignore",
    }
    assert [row[0].strip("`") for row in table(LANGUAGE, "keys: ComponentDefaults")] == list(values)
    for key, value in values.items():
        (here / "x.yaml").write_text(f"thingc: assembly/1\nname: x\ncomponents: {{leg: {{assembly: leg.yaml, {key}: {value}}}}}\n")
        assert f"`{key}` cannot be set on the nested assembly `leg`" in run("thingc check x.yaml"), key
