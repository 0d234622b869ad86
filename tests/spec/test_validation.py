"""`validate`: every error is reported once, at its position, in terms of the document."""

from __future__ import annotations

import json
import re
import textwrap
from pathlib import Path

import pytest

from thingc.base.diagnostics import Code, Report
from thingc.base.joints.kinds import KINDS
from thingc.documents.load.documents import Documents, load
from thingc.documents.spec import assembly, drives, link_shapes, materials, modes, poses, sensors, variants, workspace
from thingc.documents.spec.annotation_types import model_keys
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.foreign_keywords import keywords
from thingc.documents.spec.materials import MaterialsSpec
from thingc.documents.spec.validation import part_references, validate
from thingc.documents.workspace import Workspace

HEAD = "thingc: assembly/1\nname: x\ncomponents: {p: {part: a:B}}\n"


def load_document(folder: Path, text: str, others: dict[str, str] | None = None, name: str = "a.yaml") -> tuple[Documents, Report]:
    for file, content in {name: text, **(others or {})}.items():
        (folder / file).write_text(content, encoding="utf-8")
    report = Report()
    workspace = Workspace.find(str(folder / name), report)
    assert workspace is not None
    documents = load(str(folder / name), workspace, report, kinds=("assembly", "materials"))
    assert documents is not None, report.diagnostics
    return documents, report


def diagnostics_of(report: Report) -> list[tuple[Code, str, str | None, tuple[int, int, int]]]:
    return [
        (d.code, d.message, d.help,
         (d.span.line, d.span.column, d.span.end_column)) for d in report.sorted_diagnostics() if d.span is not None
    ]


def is_incomplete(documents: Documents, report: Report) -> bool:
    """Whether the document failed: it has no model, or parts of it are known to be omitted."""
    specs = validate(documents, report)
    return "a.yaml" not in specs or bool(specs.doubts["a.yaml"])


@pytest.mark.parametrize(("line", "code", "message", "help", "written"), [
    # names of keys
    ("descripton: x", Code.UNKNOWN_KEY, "unknown key `descripton`", "did you mean `description`?", "descripton"),
    ("links: {b-c: p}", Code.BAD_NAME, "`b-c` is not a valid name", "write, for example, `b_c`",
     "b-c"),
    ("mounts: {2nd: p.x}", Code.BAD_NAME, "`2nd` is not a valid name", "use letters, digits and `_` after a letter", "2nd"),
    ("simulation: {timesteps: 2 ms}", Code.UNKNOWN_KEY, "unknown key `timesteps` in `simulation`", "did you mean `timestep`?",
     "timesteps"),
    ("simulation: {timestep: 2 ms, timesteps: 1 ms}", Code.UNKNOWN_KEY, "unknown key `timesteps` in `simulation`",
     "remove the key, or use the existing key `timestep`", "timesteps"),
    ("simulation: {xyzzy: 1}", Code.UNKNOWN_KEY, "unknown key `xyzzy` in `simulation`",
     "known keys: `cone`, `impratio`, `integrator`, `timestep`", "xyzzy"),
    # types
    ("description: 5", Code.WRONG_TYPE, "expected a string, found the number `5`", 'write `"5"`', "5"),
    ("description: [a]", Code.WRONG_TYPE, "expected a string, found a list of 1 item", None, "[a]"),
    ("joints: [a]", Code.WRONG_TYPE, "expected a mapping, found a list of 1 item",
     "write a mapping: `joints: {NAME: ...}`", "[a]"),
    ("materials: m.yaml", Code.WRONG_TYPE, "expected a list or a mapping, found the string `m.yaml`", "write `[m.yaml]`", "m.yaml"),
    ("materials: [3]", Code.WRONG_TYPE, "expected a string, found the number `3`", 'write `"3"`', "3"),
    ("poses: {home: 3}", Code.WRONG_TYPE, "expected a mapping, found the number `3`",
     "write the positions of joints: `{JOINT: 3}`", "3"),
    ("simulation: fast", Code.WRONG_TYPE, "expected a mapping with `timestep`, `integrator`, `cone`, found the string `fast`", None,
     "fast"),
    ("modes: {b: root:plate}", Code.WRONG_TYPE, "expected a mapping with `root`, `base`, `at`, found the string `root:plate`",
     "add a space after the colon: `root: plate`", "root:plate"),
    ("raw: {mjcf: {a: [[1]]}}", Code.WRONG_TYPE,
     "expected a string, a number, a boolean, a list of these, or a mapping, found a list of 1 item", None, "[[1]]"),
    # choices
    ("simulation: {cone: eliptic}", Code.UNKNOWN_CHOICE, "expected `pyramidal` or `elliptic`, found the string `eliptic`",
     "did you mean `elliptic`?", "eliptic"),
    ("simulation: {integrator: 3}", Code.UNKNOWN_CHOICE,
     "expected `euler`, `rk4`, `implicit` or `implicitfast`, found the number `3`", None, "3"),
    # quantities
    ("simulation: {timestep: 2}", Code.BAD_UNIT, "a time needs a unit, found `2`", "write `2 s` or `2 ms`", "2"),
    ("simulation: {timestep: 2 mss}", Code.BAD_UNIT, "unknown unit `mss`; did you mean `ms`?", None, "mss"),
    ("simulation: {timestep: '2 mss'}", Code.BAD_UNIT, "unknown unit `mss`; did you mean `ms`?", None, "mss"),
    ("simulation: {timestep: 2 mm}", Code.WRONG_DIMENSION, "expected a time (such as 2 ms), found a length (`2 mm`)", None,
     "2 mm"),
    ("simulation: {timestep: fast}", Code.BAD_QUANTITY, "expected a time (such as `2 ms`), found the string `fast`",
     "an expression begins with `=`: `=fast`", "fast"),
    ("simulation: {timestep: true}", Code.WRONG_TYPE, "expected a time (such as `2 ms`), found `true`", None, "true"),
    ("simulation: {timestep: [1]}", Code.WRONG_TYPE, "expected a time (such as `2 ms`), found a list of 1 item", None, "[1]"),
    ("simulation: {timestep: =2 * (3}", Code.BAD_EXPRESSION, "the parenthesis `(` is not closed", "add `)`", "("),
    ("simulation: {timestep: =2 mss}", Code.BAD_UNIT, "unknown unit `mss`; did you mean `ms`?", None, "mss"),
    ("simulation: {impratio: 2 mm}", Code.WRONG_DIMENSION, "expected a number (such as 2), found a length (`2 mm`)", None,
     "2 mm"),
    ("poses: {home: {yaw: 30}}", Code.BAD_UNIT, "an angle or a length needs a unit, found `30`", "write `30 deg` or `30 mm`",
     "30"),
    ("poses: {home: {yaw: 3 g}}", Code.WRONG_DIMENSION,
     "expected an angle or a length (such as 30 deg or 120 mm), found a mass (`3 g`)", None, "3 g"),
    ("parameters: {a: 5 mmm}", Code.BAD_UNIT, "unknown unit `mmm`; did you mean `mm`?", None, "mmm"),
    ("parameters: {a: [1]}", Code.WRONG_TYPE, "expected a quantity, an expression, a boolean or a string, found a list of 1 item",
     None, "[1]"),
    ("parameters: {a: {value: 5 mmm, min: 1}}", Code.BAD_UNIT, "unknown unit `mmm`; did you mean `mm`?", None, "mmm"),
    ("parameters: {a: {valu: 5 mm}}", Code.UNKNOWN_KEY, "unknown key `valu` in `parameters.a`", "did you mean `value`?", "valu"),
    # vectors
    ("modes: {b: {at: {xyz: 0 0}}}", Code.BAD_QUANTITY, "expected three numbers and a unit, found two numbers (`0 0`)",
     "write, for example, `0 120 30 mm` or `[0, 120 mm, 30 mm]`", "0 0"),
    ("modes: {b: {at: {xyz: 0 0 4}}}", Code.BAD_UNIT, "a length needs a unit, found `0 0 4`", "write, for example, `0 0 4 mm`",
     "0 0 4"),
    ("modes: {b: {at: {xyz: 0 0 4 g}}}", Code.WRONG_DIMENSION, "expected a length (such as 120 mm), found a mass (`0 0 4 g`)",
     None, "0 0 4 g"),
    ("modes: {b: {at: {xyz: [0, 1 mm]}}}", Code.WRONG_LENGTH, "expected three values, each a length, found a list of 2 items",
     "write, for example, `[120 mm, 0, 0]`", "[0, 1 mm]"),
    ("modes: {b: {at: {xyz: [0, 1 mm, 2 g]}}}", Code.WRONG_DIMENSION,
     "expected a length (such as 120 mm), found a mass (`2 g`)", None, "2 g"),
    ("modes: {b: {at: {xyz: 5}}}", Code.WRONG_TYPE, "expected three values, each a length, found the number `5`",
     "write, for example, `0 120 30 mm` or `[120 mm, 0, 0]`", "5"),
    # unions: one diagnostic, of the branch that was meant
    ("modes: {b: {gravity: flor}}", Code.UNKNOWN_CHOICE, "expected `floor`, `wall` or `ceiling`, found the string `flor`",
     "did you mean `floor`?", "flor"),
    ("modes: {b: {gravity: 0 0 9.81 m/s}}", Code.WRONG_DIMENSION,
     "expected an acceleration (such as 9.81 m/s^2), found a velocity (`0 0 9.81 m/s`)", None, "0 0 9.81 m/s"),
    ("modes: {b: {gravity: [0, 0, 9.81]}}", Code.BAD_UNIT, "an acceleration needs a unit, found `9.81`", "write `9.81 m/s^2`",
     "9.81"),
    ("modes: {b: {hold: {a.b: their}}}", Code.UNKNOWN_CHOICE, "expected `here`, found the string `their`", "did you mean `here`?",
     "their"),
    ("modes: {b: {hold: {a.b: {xyy: 0 0 0}}}}", Code.UNKNOWN_KEY, "unknown key `xyy` in `modes.b.hold.a.b`",
     "did you mean `xyz`?", "xyy"),
    # lists
    ("modes: {b: {contacts: {exclude: [[a]]}}}", Code.WRONG_LENGTH, "expected a list of 2 items, found a list of 1 item", None, "[a]"),
    ("modes: {b: {contacts: {exclude: [[a, b, c]]}}}", Code.WRONG_LENGTH, "expected a list of 2 items, found a list of 3 items", None,
     "[a, b, c]"),
    ("modes: {b: {poses: home}}", Code.WRONG_TYPE, "expected a list, found the string `home`", "write `[home]`", "home"),
    # references
    ("links: {b: a/b}", Code.BAD_REFERENCE, "`a/b` is not a valid reference", "separate names with dots: `a.b`", "a/b"),
    ("links: {b: a..b}", Code.BAD_REFERENCE, "`a..b` is not a valid reference (missing name next to a `.`)", None, "."),
    ("links: {b: a.2b}", Code.BAD_REFERENCE, "`a.2b` is not a valid reference (invalid name `2b`)", None, "2b"),
    ("links: {b: 3}", Code.WRONG_TYPE, "expected a reference such as `plate.servo_seat`, found the number `3`", None, "3"),
    # nothing
    ("parameters:", Code.NO_VALUE, "`parameters` has no value",
     "write a value after the colon, indent the following lines, or remove the key", "parameters"),
    ("poses: {home: }", Code.NO_VALUE, "`home` has no value",
     "write a value after the colon, indent the following lines, or remove the key", "home"),
    ("description: ~", Code.NO_VALUE, "`description` has no value",
     "write a value after the colon, indent the following lines, or remove the key", "~"),
    ("materials: [a.yaml, ]\nmounts: {a: null}", None, None, None, None),
])
def test_assembly_faults_are_reported_once(
    tmp_path: Path, line: str, code: Code | None, message: str | None, help: str | None, written: str | None,
) -> None:
    documents, report = load_document(tmp_path, HEAD + line + "\n", {"m.yaml": "thingc: materials/1\nmaterials: {}\n"})
    report = Report()
    assert is_incomplete(documents, report)
    found = diagnostics_of(report)
    assert len(found) == 1, found
    if code is None:
        return
    assert found[0][:3] == (code, message, help)
    row, start, end = found[0][3]
    assert (HEAD + line).split("\n")[row - 1][start - 1 : end - 1] == written


@pytest.mark.parametrize(("body", "code", "message", "help", "written"), [
    ("{}", Code.BROKEN_RULE, "a component requires one of `part`, `file`, `assembly`, `link: true` or `frame: true`",
     "write, for example, `part: arm:BasePlate`", "c"),
    ("{part: a:B, frame: true}", Code.BROKEN_RULE,
     "a component must have exactly one of `part`, `file`, `assembly`, `link`, `frame`, found `part`, `frame`",
     "keep only one of these keys", "frame"),
    ("words", Code.WRONG_TYPE, "expected a mapping with `part`, `file`, `assembly`, found the string `words`", None, "words"),
    ("{prt: a:B}", Code.UNKNOWN_KEY, "unknown key `prt` in `components.c`", "did you mean `part`?", "prt"),
    ("{part: a:B, visual: yes}", Code.WRONG_TYPE, "expected a boolean, found the string `yes`", "write `true`", "yes"),
    ("{part: a:B, visual: 1}", Code.WRONG_TYPE, "expected a boolean, found the number `1`", None, "1"),
    ("{frame: false}", Code.UNKNOWN_CHOICE, "expected `true`, found `false`", None, "false"),
    ("{part: a:B, mass: 3}", Code.BAD_UNIT, "a mass needs a unit, found `3`", "write `3 g` or `3 kg`", "3"),
    ("{part: a:B, mass: {value: 3 mm, source: vendor}}", Code.WRONG_DIMENSION,
     "expected a mass (such as 120 g), found a length (`3 mm`)", None, "3 mm"),
    ("{part: a:B, mass: {value: 3 g}}", Code.MISSING_KEY, "the key `source` is missing in `components.c.mass`",
     "add the key `source` (`measured`, `vendor`, `estimated` or `repaired`)", "mass"),
    ("{part: a:B, mass: [3 g]}", Code.WRONG_TYPE, "expected a mass (such as `120 g`), found a list of 1 item", None, "[3 g]"),
    ("{part: a:B, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2}}", Code.MISSING_KEY, "the key `izz` is missing in `components.c.inertia`",
     "add the key `izz` (a moment of inertia)", "inertia"),
    ("{part: a:B, inertia: {value: {ixx: 1 g, iyy: 0, izz: 0}, source: vendor}}", Code.WRONG_DIMENSION,
     "expected a moment of inertia (such as 0.01 kg*m^2), found a mass (`1 g`)", None, "1 g"),
    ("{part: a:B, inertia: {ixx: 0, iyy: 0, izz: 0, ixy: 5}}", Code.BAD_UNIT, "a moment of inertia needs a unit, found `5`",
     "write `5 kg*m^2`", "5"),
    ("{part: a:B, inertia: 5}", Code.WRONG_TYPE,
     "expected a mapping with `value`, `source` or a mapping with `ixx`, `iyy`, `izz`, found the number `5`", None, "5"),
    ("{part: a:B, com: [0, 0]}", Code.WRONG_LENGTH, "expected three values, each a length, found a list of 2 items",
     "write, for example, `[120 mm, 0, 0]`", "[0, 0]"),
    ("{part: a:B, attach: {back: 3}}", Code.WRONG_TYPE, "expected a reference such as `plate.servo_seat`, found the number `3`",
     None, "3"),
    ("{part: a:B, attach: {mount: x, to: y.z, tun: 3 deg}}", Code.UNKNOWN_KEY, "unknown key `tun` in `components.c.attach`",
     "did you mean `turn`?", "tun"),
    ("{part: a:B, attach: back}", Code.WRONG_TYPE, "expected a mapping with `mount`, `to`, found the string `back`",
     "write `{my_mount: back}`", "back"),
    ("{part: a:B, repeat: {count: 2.5}}", Code.BAD_QUANTITY, "expected a whole number, found the number `2.5`", None, "2.5"),
    ("{part: a:B, repeat: {count: -1}}", Code.BAD_QUANTITY, "expected a whole number of at least 0, found the number `-1`", None,
     "-1"),
    ("{part: a:B, bom: {cost: 12.50}}", Code.WRONG_TYPE, "expected an amount and a currency, found the number `12.5`",
     "write, for example, `12.5 EUR`", "12.50"),
    ("{part: a:B, bom: {make: made}}", Code.UNKNOWN_CHOICE, "expected `buy`, `print` or `machine`, found the string `made`", None,
     "made"),
    ("{part: a:B, process: {infill: 15 mm}}", Code.WRONG_DIMENSION, "expected a number (such as 2), found a length (`15 mm`)",
     None, "15 mm"),
])
def test_component_faults_are_reported_once(
    tmp_path: Path, body: str, code: Code, message: str, help: str | None, written: str,
) -> None:
    text = f"thingc: assembly/1\nname: x\ncomponents:\n  c: {body}\n"
    documents, report = load_document(tmp_path, text)
    assert is_incomplete(documents, report)
    found = diagnostics_of(report)
    assert len(found) == 1, found
    assert found[0][:3] == (code, message, help)
    row, start, end = found[0][3]
    assert text.split("\n")[row - 1][start - 1 : end - 1] == written


JOINT_KINDS = " or ".join(", ".join(f"`{name}`" for name in KINDS).rsplit(", ", 1))
"""Joint kinds as listed in messages."""


@pytest.mark.parametrize(("body", "code", "message", "written"), [
    ("{type: revolut, parent: a.b, child: c.d}", Code.UNKNOWN_CHOICE,
     f"expected {JOINT_KINDS}, found the string `revolut`", "revolut"),
    ("{type: fixed, parent: a.b}", Code.MISSING_KEY, "the key `child` is missing in `joints.j`", "j"),
    ("{type: fixed, parent: a.b, chld: c.d}", Code.UNKNOWN_KEY, "unknown key `chld` in `joints.j`", "chld"),
    ("{type: fixed, parent: a.b, child: c.d, drive: {kind: position}}", Code.BROKEN_RULE,
     "a position drive requires `kp`", "drive"),
    ("{type: fixed, parent: a.b, child: c.d, drive: {kind: motr}}", Code.UNKNOWN_CHOICE,
     "expected `position`, `velocity` or `motor`, found the string `motr`", "motr"),
    ("{type: fixed, parent: a.b, child: c.d, limit: {effort: 3 kg}}", Code.WRONG_DIMENSION,
     "expected a torque or a force (such as 4.1 N*m or 300 N), found a mass (`3 kg`)", "3 kg"),
    ("{type: fixed, parent: a.b, child: c.d, limit: {velocity: 50 Hz}}", Code.WRONG_DIMENSION,
     "expected an angular velocity or a velocity (such as 46 rpm or 0.5 m/s), found a frequency (`50 Hz`)", "50 Hz"),
    ("{type: fixed, parent: a.b, child: c.d, mimic: {joint: j, multiplier: 3 g}}", Code.WRONG_DIMENSION,
     "expected a number, a length per angle or an angle per length (such as 2, 10 mm/rad or 10 rad/m), "
     "found a mass (`3 g`)", "3 g"),
])
def test_joint_faults_are_reported_once(tmp_path: Path, body: str, code: Code, message: str, written: str) -> None:
    text = f"{HEAD}joints:\n  j: {body}\n"
    documents, report = load_document(tmp_path, text)
    validate(documents, report)
    found = diagnostics_of(report)
    assert [entry[:2] for entry in found] == [(code, message)]
    row, start, end = found[0][3]
    assert text.split("\n")[row - 1][start - 1 : end - 1] == written


@pytest.mark.parametrize(("body", "message", "help"), [
    ("color: lavendar", "unknown colour `lavendar`", "did you mean `lavender`?"),
    ("color: '#12'", "`#12` is not a colour", 'write `"#rrggbb"` with hexadecimal digits'),
    ("color: #888", "`color` has no value", 'put the value in quotes: `"#888"`'),
    ("density: 5 g", "expected a density (such as 1270 kg/m^3), found a mass (`5 g`)", None),
    ("friction: {}", "the key `slide` is missing in `materials.m.friction`", "add the key `slide` (a number)"),
    ("friction: {slide: 1, torsion: 5 g}", "expected a length (such as 120 mm), found a mass (`5 g`)", None),
])
def test_material_faults_are_reported_once(tmp_path: Path, body: str, message: str, help: str | None) -> None:
    documents, report = load_document(tmp_path, f"thingc: materials/1\nmaterials:\n  m:\n    {body}\n")
    validate(documents, report)
    assert [entry[1:3] for entry in diagnostics_of(report)] == [(message, help)]


def test_missing_keys_are_reported_at_the_first_key(tmp_path: Path) -> None:
    documents, report = load_document(tmp_path, "thingc: assembly/1\n")
    validate(documents, report)
    assert diagnostics_of(report) == [
        (Code.MISSING_KEY, "the key `name` is missing in the document", "add the key `name` (a name)", (1, 1, 7)),
        (Code.MISSING_KEY, "the key `components` is missing in the document", "add the key `components` (a mapping)", (1, 1, 7)),
    ]
    documents, report = load_document(tmp_path, "thingc: assembly/1\nname: x\ncomponents: {}\n")
    validate(documents, report)
    assert diagnostics_of(report) == [(Code.WRONG_LENGTH, "expected at least one entry in `components`, found none", None, (3, 13, 15))]


def test_multiline_values_are_reported_at_their_key(tmp_path: Path) -> None:
    documents, report = load_document(tmp_path, HEAD + "description:\n  - a\n  - b\n")
    validate(documents, report)
    assert diagnostics_of(report) == [(Code.WRONG_TYPE, "expected a string, found a list of 2 items", None, (4, 1, 12))]


def test_all_faults_are_reported_with_their_path(tmp_path: Path) -> None:
    text = textwrap.dedent("""\
        thingc: assembly/1
        name: my arm
        components:
          a: {part: a:B, visual: yes, mass: 3}
          b: {at: {in: x.y, xyz: [0, 1 g, =1 +]}}
        joints:
          j: {type: hinge, parent: a, child: 5, limit: {lower: 30}}
    """)
    documents, report = load_document(tmp_path, text)
    validate(documents, report)
    assert [(d.path, d.code) for d in report.sorted_diagnostics()] == [
        ("name", Code.BAD_NAME), ("components.a.visual", Code.WRONG_TYPE), ("components.a.mass", Code.BAD_UNIT),
        ("components.b.at.xyz[1]", Code.WRONG_DIMENSION), ("components.b.at.xyz[2]", Code.BAD_EXPRESSION),
        ("joints.j.type", Code.UNKNOWN_CHOICE),
        ("joints.j.child", Code.WRONG_TYPE), ("joints.j.limit.lower", Code.BAD_UNIT),
    ]


def test_valid_document_gives_a_model_without_diagnostics(tmp_path: Path) -> None:
    documents, report = load_document(
        tmp_path,
        HEAD + "$schema: x.json\nmaterials: [m.yaml]\nposes: {home: {j: 30 deg, leg_*: folded, k: 0, l: =pi * 1 rad}}\n",
        {"m.yaml": "thingc: materials/1\nmaterials: {petg: {color: '#8Af', density: 1270 kg/m^3}}\n"},
    )
    specs = validate(documents, report)
    assert not report.diagnostics
    assert list(specs) == ["a.yaml", "m.yaml"]
    assembly, materials = specs["a.yaml"], specs["m.yaml"]
    assert isinstance(assembly, AssemblySpec)
    assert isinstance(materials, MaterialsSpec)
    assert materials.materials["petg"].color == "#88aaff"
    assert assembly.poses["home"]["leg_*"] == "folded"


def test_number_of_reported_faults_is_limited(tmp_path: Path) -> None:
    documents, report = load_document(tmp_path, HEAD + "".join(f"k{n}: 1\n" for n in range(300)))
    validate(documents, report)
    assert [d.code for d in report.diagnostics] == [Code.UNKNOWN_KEY] * 200 + [Code.TOO_LARGE]


def test_failed_and_cyclic_documents_are_omitted(tmp_path: Path) -> None:
    documents, report = load_document(tmp_path, HEAD.replace("{part: a:B}", "{assembly: b.yaml}"), {
        "b.yaml": HEAD.replace("{part: a:B}", "{assembly: c.yaml}, q: {assembly: d.yaml}"),
        "c.yaml": HEAD.replace("{part: a:B}", "{assembly: b.yaml}"), "d.yaml": HEAD.replace("name: x", "author: x"),
    })
    specs = validate(documents, report)
    assert list(specs) == ["a.yaml"]
    assert [d.code for d in report.diagnostics] == [Code.DOCUMENT_CYCLE, Code.MISSING_KEY, Code.UNKNOWN_KEY]


def test_part_references_are_in_document_order(tmp_path: Path) -> None:
    documents, report = load_document(
        tmp_path, "thingc: assembly/1\nname: x\ncomponents:\n  p: {part: a:B}\n  n: {assembly: b.yaml}\n  q: {part: c.d:E}\n",
        {"b.yaml": HEAD.replace("a:B", "f:G")},
    )
    found = part_references(validate(documents, report), documents)
    assert [(name, Path(span.file).name, span.line, span.column) for name, span in found] == [
        ("a:B", "a.yaml", 4, 13), ("c.d:E", "a.yaml", 6, 13), ("f:G", "b.yaml", 3, 24),
    ]


def test_toml_documents_are_validated(tmp_path: Path) -> None:
    text = 'thingc = "assembly/1"\nname = "x"\n[components.p]\npart = "a:B"\nmass = "12 mmm"\n[modes.b]\nrot = "p"\n'
    documents, report = load_document(tmp_path, text, name="a.toml")
    validate(documents, report)
    assert diagnostics_of(report) == [
        (Code.BAD_UNIT, "unknown unit `mmm`; did you mean `mm`?", None, (5, 12, 15)),
        (Code.UNKNOWN_KEY, "unknown key `rot` in `modes.b`", "did you mean `root`?", (7, 1, 4)),
    ]


def test_messages_contain_no_pydantic_terms(tmp_path: Path) -> None:
    """Every kind of value is tried at every place, with at most one diagnostic per wrong value."""
    base = textwrap.dedent("""\
        thingc: assembly/1
        name: x
        description: d
        parameters: {a: {value: 5 mm, min: 1 mm, doc: d}, b: 3}
        materials:
          m: {density: 1 kg/m^3, color: red, friction: {slide: 1, roll: 1 mm}, process: {kind: fdm, walls: 3, infill: 5 %}}
        defaults: {component: {material: m}, joint: {turn: 3 deg}}
        components:
          p:
            {part: a:B, params: {l: 5 mm}, mass: {value: 1 g, source: vendor}, com: 0 0 1 mm, visual: true, allow: {TC407: r},
            inertia: {ixx: 0, iyy: 0, izz: 0}, bom: {number: a, cost: 1 EUR, make: buy},
            mounts: {m: {xyz: 0 0 0, rpy: 0 0 0, interface: i}}}
          q: {frame: true, at: {in: p.a, xyz: 0 0 0, rpy: 0 0 0}, repeat: {count: 3, as: i}}
          r: {part: a:B, attach: {mount: a, to: p.b, turn: 3 deg, gap: 1 mm}}
        joints:
          j:
            {type: revolute, parent: a.b, child: c.d, limit: {lower: 0, upper: 1 deg, effort: 1 N, velocity: 1 rpm},
            allow: {TC407: r}, dynamics: {damping: 1 N*s/m, friction: 1 N, armature: 1 kg, stiffness: 1 N/m}, offset: 0, loop: false,
            drive: {kind: motor, kv: 1 N*m*s/rad}, mimic: {joint: k, multiplier: 1, offset: 0}}
        links: {l: p}
        mounts: {m: p.a}
        poses: {h: {j: 1 deg}}
        modes:
          b:
            {root: p, base: fixed, at: {xyz: 0 0 0}, gravity: floor, pose: h, poses: [h], actuators: [j], hold: {p.a: here},
            contacts: {exclude: [[p, q]], adhesion: {p.a: 1 N}}, cut: [j], simulation: {timestep: 1 ms}, extends: c, allow: {TC407: r}}
        raw: {mjcf: {a: 1}}
        allow: {TC407: r}
        sensors: {s: {type: camera, at: p.a, fovy: 3 deg}}
    """)
    documents, report = load_document(tmp_path, base)
    assert validate(documents, report)
    assert not report.diagnostics
    tree = documents.root.tree.plain()
    assert isinstance(tree, dict)
    def places(value: object, path: tuple[object, ...] = ()) -> list[tuple[object, ...]]:
        inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        return [path, *(found for key, item in inner for found in places(item, (*path, key)))]

    checked = 0
    for path in places(tree):
        if not path or path == ("thingc",):
            continue
        beside = {"thingc": tree["thingc"], "name": "x", "components": {"s": {"frame": True}}}
        beside[path[0]] = {path[1]: tree[path[0]][path[1]]} if len(path) > 1 and path[0] == "components" else tree[path[0]]
        for wrong in ("?!", 3.7, ["?!"], {"?!": 1}, "=("):
            changed = json.loads(json.dumps(beside))
            inner = changed
            for step in path[:-1]:
                inner = inner[step]
            inner[path[-1]] = wrong
            documents, _ = load_document(tmp_path, json.dumps(changed))
            report = Report()
            validate(documents, report)
            assert len(report.diagnostics) <= (6 if wrong == {"?!": 1} else 1), (path, wrong,
                [d.message for d in report.diagnostics])
            for d in report.diagnostics:
                for word in ("Input", "input", "valid", "function", "dict", "pydantic", "None", "null", "tuple", "instance",
                    "str"):
                    assert word not in re.sub("structure|string|is not a valid (name|reference)", "", d.message), (path, wrong, d.message)
            checked += len(report.diagnostics)
    assert checked > 300


def test_joint_kinds_are_not_foreign_keywords() -> None:
    """A joint kind must not be listed as a foreign keyword for another one."""
    taken = sorted({*keywords()[1]} & {*KINDS})
    assert not taken, f"{taken}: kinds now; take them out of the table `words` in compiler/thingc/documents/spec/foreign_keywords.toml"


def test_foreign_keywords_refer_to_existing_keys() -> None:
    rooms = (assembly, drives, link_shapes, materials, modes, poses, sensors, variants, workspace)
    for name, meant in keywords()[0].items():
        model = next(vars(room)[name] for room in rooms if name in vars(room))
        known = model_keys(model)
        for word, meaning in meant.items():
            assert word not in known, f"{word} is a key of {name} now"
            assert " " in meaning or meaning in known, f"{meaning} is no key of {name}"
