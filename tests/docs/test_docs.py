"""The documentation matches the program: documents are valid, commands print the shown output, and tables match the code."""

from __future__ import annotations

import json
import re
import sys
import textwrap
from pathlib import Path

import pytest

from docs.pages import (
    COMMAND_PAGES,
    DECISIONS,
    LANGUAGE,
    OUTPUTS,
    PAGES,
    ROOT,
    WITH_LINKS,
    anchors,
    blocks,
    commands,
    documents,
    leaves,
    meant_to_be_wrong,
    paragraphs,
    run,
    shows,
    table,
    typed,
    unpack,
    without_fences,
)
from thingc.base.diagnostic_output import as_text
from thingc.base.diagnostics import Report
from thingc.batch import batch
from thingc.documents.workspace import Workspace
from variants.robots import InThisProcess

pytestmark = pytest.mark.slow

IDS = [page.relative_to(ROOT).as_posix().removeprefix("docs/") for page in PAGES]


@pytest.fixture
def here(page: Path, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Unpack the files of the page into a folder and use it as working folder."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setattr(batch, "LocalExecutor", InThisProcess)  # a runner takes longer to start than the variants of a page
    monkeypatch.chdir(unpack(page, tmp_path))
    return tmp_path


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_documents_are_valid_and_commands_print_shown_output(page: Path, here: Path) -> None:
    for block in documents(page):
        assert block.file, f"{page.name}:{block.line}: a document needs a name: `# name.yaml`"
        if Path(block.file).name == "thingc.toml":
            report = Report()
            assert Workspace.find(str(here / block.file), report) is not None, as_text(report.diagnostics)
            continue
        if block.line > leaves(page):
            continue  # it does not exist yet; the page's own commands say whether it is right
        if meant_to_be_wrong(block):
            assert any(command.endswith(f" {block.file}") for command, _ in commands(page)), f"{page.name}:{block.line}"
            continue
        printed = run(f"thingc check --strict {block.file}")
        assert printed == f"{block.file}: ok\n", f"{page.name}:{block.line}\n{printed}"
    for block in blocks(page):
        if block.file is not None and block.line > leaves(page):
            Path(block.file).write_text(block.text)
        for command, shown in typed(block):
            printed = run(command)
            assert shows(shown, printed), f"{page.name}: $ {command}\n{printed}"


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_shown_parts_compile_and_are_used(page: Path) -> None:
    python = [block for block in blocks(page) if block.language == "python"]
    for block in python:
        compile(block.text, f"{page.name}:{block.line}", "exec")
    text = page.read_text()
    for block in python:
        if block.file is not None:
            name = Path(block.file).stem
            used = re.search(rf"\b{name}:\w|python {re.escape(block.file)}|^import {name}$", text, re.MULTILINE)
            assert used, f"{page.name}: nothing uses {block.file}"


@pytest.mark.parametrize("page", WITH_LINKS, ids=[page.relative_to(ROOT).as_posix() for page in WITH_LINKS])
def test_links_resolve(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", re.sub("`[^`\\n]*`", "", without_fences(page))):
        if target.startswith("https://"):
            continue
        file, _, anchor = target.partition("#")
        there = (page.parent / file).resolve() if file else page
        assert there.exists(), f"{page.name}: {target}"
        assert not anchor or anchor in anchors(there), f"{page.name}: {target}"


def test_output_comparison_can_fail() -> None:
    assert shows("a\n...\nd\n", "a\nb\nc\nd\n") and shows("a ... c", "a b c") and shows("...\nd", "a\nd")
    assert not shows("a\n...\nd\n", "a\nb\n") and not shows("a", "ab") and not shows("a ... c", "a\nc")


# --- language/ -----------------------------------------------------------------------------------------------------


def _language() -> str:
    """Return the text of all language pages."""
    return "\n".join(page.read_text() for page in sorted(LANGUAGE.glob("*.md")))


def _language_paragraphs() -> list[str]:
    return [line for page in sorted(LANGUAGE.glob("*.md")) for line in paragraphs(page)]


def test_key_tables_match_the_fields_of_the_models() -> None:
    from pydantic import BaseModel

    from thingc.documents.checks import kinds
    from thingc.documents.spec import (
        assembly,
        calibration,
        drives,
        interfaces,
        link_shapes,
        mass,
        materials,
        modes,
        motions,
        names,
        poses,
        repeats,
        sensors,
        tendons,
        tests,
        transmissions,
        variants,
        workspace,
    )

    checks = [sys.modules[kind.model.__module__] for kind in kinds().values()]
    rooms = (
        assembly, calibration, drives, interfaces, link_shapes, materials, modes, motions, names, poses, repeats, sensors, mass, tendons,
        tests, transmissions, *checks, variants, workspace,
    )
    models = {
        name: value for module in rooms
        for name, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, BaseModel) and value.__module__ == module.__name__ and not name.startswith("_")
    }
    text = _language()
    said: set[str] = set()
    for marker in re.findall(r"<!-- (keys: [\w ]+) -->", text):
        rows = table(LANGUAGE, marker)
        for name in marker.removeprefix("keys: ").split():
            model = models[name]
            own = [model.model_fields[field].alias or field for field in model.__annotations__]
            assert [row[0].strip("`") for row in rows] == own, name
            for row in rows:
                required = model.model_fields[_field(model, row[0].strip("`"))].is_required()
                assert required == (row[2] == "required") or (name, row[0]) in IN_OTHER_WORDS, (name, row)
            said.add(name)
    assert said == set(models)


IN_OTHER_WORDS = {("ModeSpec", "`root`"), ("DriveSpec", "`kp`")}
"""Required by a rule, not by the field itself. For example, a mode may inherit its root from the mode that it extends."""


def test_generated_key_tables_describe_types_and_defaults() -> None:
    names = ("PointTest", "NoCollisionTest", "DriveMarginTest", "GroundClearanceTest", "SettlesTest", "WithinSpec")
    cells = {(name, row[0].strip("`")): row[1:] for name in names for row in table(LANGUAGE, f"keys: {name}")}
    assert cells["PointTest", "angle"] == ["an angle", "1 deg", "the largest allowed angle between the z axis of the mount and `direction`"]
    assert cells["WithinSpec", "x"] == ["2 lengths", "none", "smallest and largest x coordinate"]
    assert cells["NoCollisionTest", "joints"][:2] == ["`all` or joints or mapping", "none"]
    assert cells["NoCollisionTest", "allow"][:2] == ["list of mappings", "none"]
    assert cells["NoCollisionTest", "certify"][:2] == ["boolean or `references`", "`false`"]
    assert cells["NoCollisionTest", "certify"][2].endswith("designed for.") and cells["DriveMarginTest", "drive"][:2] == ["joints", "all"]
    assert cells["GroundClearanceTest", "except"][:2] == ["components", "none"] and cells["SettlesTest", "floor"][1] == "`true`"


def _field(model: type, key: str) -> str:
    return next(name for name, field in model.model_fields.items() if key in (name, field.alias))  # type: ignore[attr-defined]


def test_choices_in_tables_match_the_models() -> None:
    """Every value of a `Literal` must be in its row, in backquotes (`mirror` and such: `x`, `y` or `z`)."""
    from typing import Literal, get_args, get_origin

    from thingc.documents.spec import assembly, drives, interfaces, link_shapes, mass, materials, sensors, variants

    def words(annotation: object) -> set[str]:
        if get_origin(annotation) is Literal:
            return {word for word in get_args(annotation) if isinstance(word, str)}
        return {word for inner in get_args(annotation) for word in words(inner)}

    elsewhere = {("JointSpec", "type"), ("ComponentDefaults", "collision"), ("ModeSpec", "hold"), ("ModeSpec", "base")}
    elsewhere |= {("TargetChoicesSpec", key) for key in ("mjcf", "urdf", "sdf", "usd")}
    elsewhere |= {("SensorSpec", key) for key in ("type", "noise", "cutoff")} | {("CollisionSpec", "modes")}
    for module in (assembly, drives, interfaces, link_shapes, materials, sensors, mass, variants):
        for marker in re.findall(r"<!-- (keys: [\w ]+) -->", _language()):
            for name in marker.removeprefix("keys: ").split():
                model = getattr(module, name, None)
                if model is None or model.__module__ != module.__name__:
                    continue
                for row in table(LANGUAGE, marker):
                    key = row[0].strip("`")
                    if (name, key) not in elsewhere:
                        expected = words(model.model_fields[_field(model, key)].annotation)
                        assert expected <= set(re.findall(r"`([^`]+)`", row[1])), (name, key)


def test_sensor_table_matches_the_code() -> None:
    from thingc.base.sensor_kinds import SENSORS

    rows = table(LANGUAGE, "sensors")
    said = {row[0].strip("`"): (set(re.findall(r"`(\w+)`", row[1])), re.findall(r"`(\w+)`", row[2])) for row in rows}
    kinds = {
        kind.name: ({key for group in kind.needs for key in group} or {*kind.may}, [one.name for one in kind.readings])
        for kind in SENSORS.values()
    }
    assert list(said.items()) == list(kinds.items())


def test_unit_table_matches_the_code() -> None:
    from thingc.base.units import UNITS, parse_quantity

    said = {unit: row[0].partition(" (")[0] for row in table(LANGUAGE, "units") for unit in re.findall(r"`([^`]+)`", row[1])}
    assert said == {unit: dimension.words for unit, (_, _, dimension) in UNITS.items()}
    line = next(line for line in _language_paragraphs() if line.startswith("- `1 in` is"))
    pairs = re.findall(r"(?:^- |, )`(1 \w+)` (?:is )?([\d.]+ \w+)", line)
    assert len(pairs) == 6
    for one, other in pairs:
        assert parse_quantity(one).value == parse_quantity(other).value, (one, other)


def test_expression_functions_match_the_code() -> None:
    from thingc.documents.expressions.terms import CONSTANTS, FUNCTIONS

    line = next(line for line in _language_paragraphs() if line.startswith("- Expressions support the functions"))
    functions, _, constants = line.partition(", and the constant")
    assert set(re.findall(r"`(\w+)`", functions)) == set(FUNCTIONS)
    assert re.findall(r"`(\w+)`", constants)[:1] == list(CONSTANTS)


def test_statements_about_expressions_and_quantities() -> None:
    from thingc.base.units import ANGLE, ANGULAR_VELOCITY, FREQUENCY, LENGTH, NUMBER, Quantity, fits, parse_quantity
    from thingc.base.vector_text import parse_vector
    from thingc.documents.expressions.evaluation import evaluate
    from thingc.documents.expressions.parsing import parse_expression
    from thingc.documents.expressions.terms import ExpressionError

    names: dict[str, Quantity | bool | str] = {"reach": parse_quantity("120 mm"), "i": Quantity(3.0), "light": True}

    def value(text: str) -> object:
        return evaluate(parse_expression(text), names)

    assert value("=reach / 2 + 8 mm") == Quantity(0.068, LENGTH) and value("=2 * 8 mm") == Quantity(0.016, LENGTH)
    assert value("=8 mm*i") == Quantity(0.024, LENGTH) and value("=light") is True and value("=reach > 1 m") is False
    assert value("=atan2(reach, reach)").dimension == ANGLE and value("=sin(90 deg)") == Quantity(1.0, NUMBER)  # type: ignore[attr-defined]
    for wrong in ("=reach + 3", "=1 < 2 < 3", "=sin(1)", "=reach ** 40", "=exp(1)"):
        with pytest.raises(ExpressionError):
            value(wrong)
    assert not fits(ANGULAR_VELOCITY, FREQUENCY) and not fits(parse_quantity("1 mm/rad").dimension, LENGTH)
    assert parse_quantity("2 N*m*s").fits(parse_quantity("2 N*m*s/rad").dimension)
    assert [part.value for part in parse_vector("0 120 30 mm")] == [0.0, 0.12, 0.03] and parse_vector("0 0 0")[0].value == 0.0
    for one, other in (("9.81 m/s²", "9.81 m/s^2"), ("2 N·m", "2 N*m"), ("2 mm**2", "2 mm^2")):
        assert parse_quantity(one) == parse_quantity(other)


def test_joint_type_table_matches_the_code() -> None:
    from typing import get_args

    from thingc.base.joints.kinds import KINDS, JointType

    rows = table(LANGUAGE, "joint kinds")
    assert [row[0].strip("`") for row in rows] == list(KINDS)
    for row, kind in zip(rows, KINDS.values(), strict=True):
        assert row[1] == (", ".join(twist.coordinate.words for twist in kind.twists) or "none")
        assert row[3] == kind.limits
    assert list(get_args(JointType)) == list(KINDS)


def test_gravity_raw_and_limit_tables_match_the_code() -> None:
    from thingc.base.units import MAX_FACTORS, MAX_TEXT
    from thingc.documents import workspace
    from thingc.documents.expressions.terms import MAX_DEPTH
    from thingc.documents.load.documents import MAX_CHAIN
    from thingc.documents.load.text import MAX_ALIAS_NODES, MAX_ALL_BYTES, MAX_BYTES, MAX_LEVELS, MAX_NODES
    from thingc.geometry import mesh_bounds
    from thingc.geometry.worker.kernel.mesh_files import MOST as MOST_OF_PART
    from thingc.model.resolve import raw_protected
    from thingc.model.resolve.assembly import MAX_DEFINITIONS
    from thingc.model.resolve.contacts import MAX_EXCLUDED
    from thingc.model.resolve.modes import GRAVITY, MAX_EXTENDED
    from thingc.model.resolve.repeats import MAX_OCCURRENCES, MAX_REPEAT
    from thingc.targets.mjcf import raw
    said = {row[0].strip("`"): tuple(map(float, row[1].strip("`").split())) for row in table(LANGUAGE, "gravity")}
    assert said == GRAVITY
    named, single, *_ = table(LANGUAGE, "raw")
    assert set(re.findall(r"`(\w+)`", named[1])) == set(raw.NAMED)
    assert set(re.findall(r"`(\w+)`", single[1])) == set(raw.SINGLE)
    said_of = [set(re.findall(r"`(\w+)`", row[0])) for row in table(LANGUAGE, "raw-fixed")]
    assert said_of == [{"name", *raw_protected.CLASSES}, set(raw_protected.REFERRING), set(raw_protected.MOTION), set(raw_protected.PLACE),
                       set(raw_protected.SECTIONS["compiler"])]
    cells = [row[1] for row in table(LANGUAGE, "bounds")]
    numbers = [int(digits.replace(" ", "")) for cell in cells for digits in re.findall(r"\d[\d ]*\d|\d", cell)]
    expected = [MAX_BYTES, MAX_LEVELS, MAX_NODES, MAX_ALIAS_NODES, MAX_TEXT, MAX_DEPTH, MAX_REPEAT, MAX_OCCURRENCES, MAX_CHAIN]
    expected += [MAX_ALL_BYTES, MAX_DEFINITIONS, MAX_EXTENDED, MAX_EXCLUDED, workspace.MAX_BYTES]
    expected += [mesh_bounds.LARGEST, mesh_bounds.MOST, MOST_OF_PART, mesh_bounds.INSTANCES]
    assert numbers == expected
    assert f"At most {MAX_FACTORS} factors" in "\n".join(_language_paragraphs())


@pytest.mark.parametrize("page", [LANGUAGE / "index.md"], ids=["index.md"])
def test_yaml_and_toml_examples_are_equal(page: Path, here: Path) -> None:
    assert run("thingc info crane.yaml --format json") == run("thingc info crane.toml --format json")


@pytest.mark.parametrize("page", [LANGUAGE / "nested.md"], ids=["nested.md"])
def test_nested_assembly_accepts_no_overrides(page: Path, here: Path) -> None:
    values = {
        "material": "pla", "mass": "1 kg", "com": "0 0 0", "inertia": "{ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}",
        "collision": "box", "visual": "false", "process": "{walls: 3}", "print": "{up: [0, 0, 1]}", "bom": "{number: x}",
    }
    assert [row[0].strip("`") for row in table(LANGUAGE, "keys: ComponentDefaults")] == list(values)
    for key, value in values.items():
        component = f"leg: {{assembly: leg.yaml, {key}: {value}}}"
        (here / "x.yaml").write_text(f"thingc: assembly/1\nname: x\ncomponents: {{{component}}}\n")
        assert f"`{key}` cannot be set on the nested assembly `leg`" in run("thingc check x.yaml"), key


# --- things.md -----------------------------------------------------------------------------------------------------


def test_things_page_matches_the_code() -> None:
    import inspect

    from thingc.geometry.things import parameters
    from thingc.geometry.things.actuator import Actuator
    from thingc.geometry.things.thing import Thing

    things = ROOT / "docs" / "things.md"
    named = {word for row in table(things, "annotations") for word in re.findall(r"`(\w+)", row[0])}
    vocabulary = {name for name, value in vars(parameters).items() if "Kind(" in repr(value) and name[0].isupper()}
    assert named == vocabulary | {"float", "int", "bool", "str", "Literal"}
    overrides = [row[0].strip("`()") for row in table(things, "overrides")]
    assert overrides == ["mass", "centre", "matrix_of_inertia", "density"] and all(hasattr(Thing, name) for name in overrides)
    fields = [name for name in inspect.signature(Actuator.__init__).parameters if name != "self"]
    assert [row[0].strip("`") for row in table(things, "actuator")] == fields


# --- outputs/, commands/ -------------------------------------------------------------------------------------------


def _same_shape(shown: object, real: object, path: str) -> None:
    """Assert that a JSON sample has the keys of the actual output; `"..."` as a key or an item stands for further entries."""
    if isinstance(shown, dict):
        assert isinstance(real, dict), path
        keys = set(shown) - {"..."}
        assert keys <= set(real) and ("..." in shown or keys == set(real)), (path, set(shown), set(real))
        for key in keys:
            _same_shape(shown[key], real[key], f"{path}.{key}")
    elif isinstance(shown, list):
        assert isinstance(real, list), path
        items = [item for item in shown if item != "..."]
        for item, other in zip(items, real, strict=False):
            _same_shape(item, other, f"{path}[]")
        assert len(items) <= len(real), path
    elif shown is None or real is None:
        assert shown is real, path
    else:
        assert type(shown) is type(real), (path, shown, real)


@pytest.mark.parametrize("page", [OUTPUTS / "index.md"], ids=["index.md"])
def test_json_samples_match_the_output(page: Path, here: Path) -> None:
    text = "\n".join(one.read_text() for one in sorted(OUTPUTS.glob("*.md")))
    samples = dict(re.findall(r"<!-- shape: ([\w.]+) -->\n```json\n(.*?)```", text, re.DOTALL))
    two_bases = "  plate: {frame: true}\n  other: {frame: true}\n"
    (here / "robot.yaml").write_text(f"thingc: assembly/1\nname: r\ncomponents:\n{two_bases}")
    build = json.loads(run("thingc build assemblies/arm.yaml --emit mjcf --emit bom --format json"))
    wrong = json.loads(run("thingc check robot.yaml --format json"))
    real = {
        "modes.json": json.loads((here / "build/arm/modes.json").read_text()),
        "joint_order.json": json.loads((here / "build/arm/joint_order.json").read_text()),
        "manifest.json": json.loads((here / "build/arm/manifest.json").read_text()),
        "diagnostics": {"diagnostics": [entry for entry in wrong["diagnostics"] if entry["notes"]][:1]},
        "build": {**build, "modelled": []},
        "info": json.loads(run("thingc info assemblies/arm.yaml --format json")),
        "collision": json.loads(run("thingc collision assemblies/end_effector.yaml --format json")),
        "sensitivity": json.loads(run("thingc sensitivity assemblies/arm.yaml --by reach --of mass --format json")),
        "test": json.loads(run("thingc test assemblies/arm.yaml --only weight --format json")),
        "parts": json.loads(run("thingc parts arm:RotorBrace --format json")),
    }
    real["build"]["reused"] = [*build["modelled"], *build["reused"]]
    assert set(samples) == set(real)
    for name, sample in samples.items():
        _same_shape(json.loads(sample), real[name], name)
    link_shapes = set(re.findall(r"^(\S+?)(?:  |$)", blocks(page)[0].text, re.MULTILINE))
    folder = here / "build/arm"
    for path in folder.rglob("*"):
        if path.is_file():
            name = path.relative_to(folder).as_posix()
            general = re.sub(r"^(mjcf/(?:arm|scene)_)\w+", r"\1MODE", name).replace("mjcf/arm_", "mjcf/NAME_")
            assert general in link_shapes | {"bom.json"} or name.startswith("mjcf/assets/"), name


def test_bom_columns_match_the_code() -> None:
    from thingc.targets.bom.emit import COLUMNS

    assert [row[0].strip("`") for row in table(OUTPUTS, "bom")] == list(COLUMNS)


def test_every_command_page_lists_all_options() -> None:
    from thingc.tools.cli.main import COMMANDS, parser_for

    index = (COMMAND_PAGES / "index.md").read_text()
    assert re.findall(r"^\| \[`thingc (\S+?)[` ].*\]\((\w+)\.md\)", index, re.MULTILINE) == [(name, name) for name in COMMANDS]
    assert {page.stem for page in COMMAND_PAGES.glob("*.md")} == {*COMMANDS, "index"}
    for command in COMMANDS:
        own = parser_for(command)[1]
        assert own is not None
        examples = re.findall(rf"^  (?:thingc {command}\b|pip install 'thingc\[{command}\]')", own.format_help(), re.MULTILINE)
        assert examples, f"the docstring of {command}.py contains no example for the help"
        actions = [action for action in own._actions if action.help != "==SUPPRESS==" and action.dest != "help"]
        text = (COMMAND_PAGES / f"{command}.md").read_text()
        made = text.partition("<!-- generated: options -->\n")[2].partition("<!-- /generated -->")[0]
        cells = re.findall(r"^\| (`.*?`) \| ", made, re.MULTILINE)
        options = [tuple(re.findall(r"`(-[\w-]+)", cell)) for cell in cells if cell.startswith("`-")]
        assert options == [tuple(action.option_strings) for action in actions if action.option_strings], f"{command}: run make docs"
        assert len(cells) == len(actions)


# --- python.md, diagnostics.md, CONTRIBUTING.md ----------------------------------------------------------------------


def test_python_page_lists_all_arguments_and_attributes() -> None:
    import inspect

    import thingc

    page = ROOT / "docs" / "python.md"
    assert [row[0].strip("`") for row in table(page, "compile")] == list(inspect.signature(thingc.compile).parameters)
    for name in ("Compiled", "CompiledMode"):
        public = {attribute for attribute in dir(getattr(thingc, name)) if not attribute.startswith("_")}
        assert {row[0].strip("`()") for row in table(page, name)} == public
    of_families = {attribute for attribute in dir(thingc.RobotFamily) if not attribute.startswith("_")} | {"name", "modes", "mode"}
    assert {re.sub(r"[(].*", "", row[0].strip("`")) for row in table(page, "RobotFamily")} == of_families


def test_generated_pictures_are_up_to_date() -> None:
    import runpy

    docs = ROOT / "docs"
    drawn = {
        name: runpy.run_path(str(docs / script))["picture"]
        for name, script in (("mate.svg", "mate_picture.py"), ("drive_margin.svg", "motion_picture.py"))
    }
    drawn |= runpy.run_path(str(docs / "concept_pictures.py"))["DRAWN"]
    for name, draw in drawn.items():
        assert (docs / "pictures" / name).read_text() == draw(), f"{name}: run make docs"


CONTRIBUTING = ROOT / "CONTRIBUTING.md"


def _recipe(heading: str) -> dict[str, object]:
    """Return the names that the Python block under a heading defines."""
    section = CONTRIBUTING.read_text().partition(f"## {heading}\n")[2].partition("\n## ")[0]
    (block,) = re.findall(r"^   ```python\n(.*?)^   ```$", section, re.MULTILINE | re.DOTALL)
    names: dict[str, object] = {}
    exec(textwrap.dedent(block), names)
    return names


def test_joint_type_recipe_works() -> None:
    from thingc.base.joints import kinds
    from thingc.base.joints.twist import pose_after
    from thingc.base.pose import make_translation

    text = (ROOT / "CONTRIBUTING.md").read_text().partition("## A new joint kind")[2]
    (kind,) = eval(textwrap.dedent(text.partition("```python\n")[2].partition("```")[0]), vars(kinds))
    assert isinstance(kind, kinds.JointKind) and pose_after(kind.twists, (0.5,)) == make_translation(0.0, 0.0, 0.5) and kind.moves


def test_target_recipe_works(tmp_path: Path) -> None:
    from emit.small_robot import assembly, request
    from thingc.geometry.store.local import Store

    store = Store(str(tmp_path))
    robot = assembly(store)
    written = _recipe("A new target")["emit"](request(robot, store)).files  # type: ignore[operator]
    lines = written["weights.csv"].decode().split("\n")
    assert lines[0] == "link,mass" and len(lines) == len(robot.links) + 2


def test_quick_fix_recipe_works() -> None:
    from thingc.base.diagnostics import Code
    from thingc.base.source import Span
    from thingc.base.suggestions import Suggestion

    (words,) = re.findall(r"``help=(Suggestion\(.+\))``", CONTRIBUTING.read_text())
    report = Report()
    report.add(
        Code.BAD_QUANTITY, "a decimal comma", Span(file="/a.yaml", line=1, column=1, end_line=1, end_column=7),
        help=eval(words, {"Suggestion": Suggestion}),
    )
    (fix,) = report.diagnostics[0].fixes
    assert (fix.written, fix.replacement) == ("1,5 mm", "1.5 mm")


def test_paths_in_contributing_exist() -> None:
    named = re.findall(r"`((?:compiler|tests|docs|parts|schemas)/[\w./]*)", CONTRIBUTING.read_text())
    assert len(named) > 15
    for path in named:
        if not re.search("[A-Z]{4}", path):
            assert (ROOT / path).exists(), path


PACKAGE = ROOT / "compiler" / "thingc"


def _missing_paths(page: Path) -> list[str]:
    """Return the code paths on a page that do not exist. Paths start in the package, or with a folder of the repository."""
    drawn = "".join(re.findall(r"```.*?```", page.read_text(), re.DOTALL))
    named = re.findall(r"`([\w./]+)`", without_fences(page)) + re.findall(r"\b(?!parts|build)[a-z]+/[\w./]*\w", drawn)
    paths = {name for name in named if name.endswith((".py", "/")) or "/" in name and (PACKAGE / name.split("/")[0]).exists()}
    return sorted(path for path in paths if not ((ROOT if path.startswith(("compiler/", "tests/", "docs/")) else PACKAGE) / path).exists())


def test_architecture_page_is_complete_and_short() -> None:
    page = ROOT / "ARCHITECTURE.md"
    text = page.read_text()
    assert _missing_paths(page) == []
    entries = {path.name + "/" * path.is_dir() for path in PACKAGE.iterdir()} - {"__pycache__/"}
    assert len(entries) == 12 and sorted(entry for entry in entries if f"`{entry}`" not in text) == []
    folders = {path.name for path in PACKAGE.iterdir() if path.is_dir()} - {"__pycache__"}
    assert set(re.findall(r"^\*\*`(\w+)/`: ", text, re.MULTILINE)) == folders, "one paragraph in `Rooms` for each"
    assert len(text.split()) <= 2500, "a reader has ten minutes"


@pytest.mark.parametrize("page", sorted(DECISIONS.glob("0*.md")), ids=lambda page: page.stem)
def test_decision_is_short_listed_and_names_existing_files(page: Path) -> None:
    text = page.read_text()
    assert re.findall(r"^#+ .*", text, re.MULTILINE)[1:] == ["## Context", "## Decision", "## Consequences"]
    assert 60 <= len(text.split()) <= 150 and _missing_paths(page) == []
    title = text.partition("\n")[0].removeprefix("# ")
    assert f"- [{page.name[:4]}]({page.name}): {title}\n" in (DECISIONS / "README.md").read_text()
