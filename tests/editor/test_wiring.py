"""Settings of editors: merged, never overwritten. The oracle for JSON with comments is a stripping reader and `json`."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from editor.running import ROOT, thingc
from thingc.diagnostics import Code, Report
from thingc.editor import jsonc
from thingc.editor.wiring import pattern_of, wire

COMMENTED = """\
// How this team edits.
{
    "editor.rulers": [100], // not 80
    /* the schemas of
       other tools */
    "yaml.schemas": {
        "https://json.schemastore.org/github-workflow.json": ".github/workflows/*.yml", // CI
    },
    "files.trimTrailingWhitespace": true,
}
"""


def plain(text: str) -> Any:
    """JSON with comments, by taking them and trailing commas out: strings first, so that `//` inside of one stays."""
    token = re.compile(r'"(?:\\.|[^"\\])*"|//[^\n]*|/\*.*?\*/', re.DOTALL)
    bare = token.sub(lambda found: found.group() if found.group()[0] == '"' else " ", text)
    quoted = re.compile(r'"(?:\\.|[^"\\])*"|,(?=\s*[}\]])')
    return json.loads(quoted.sub(lambda found: "" if found.group() == "," else found.group(), bare))


def settings(folder: Path) -> Path:
    return folder / ".vscode" / "settings.json"


def written(folder: Path, text: str, documents: list[str]) -> str:
    settings(folder).parent.mkdir(exist_ok=True)
    settings(folder).write_bytes(text.encode())
    report = Report()
    wire(str(folder), documents, report)
    assert not report.diagnostics
    return settings(folder).read_bytes().decode()


def test_comments_and_other_settings_stay_byte_for_byte(tmp_path: Path) -> None:
    found = written(tmp_path, COMMENTED, ["a/arm.yaml"])
    assert found == COMMENTED.replace("""// CI
    },""", """// CI
        "./.thingc/schema/a/arm.yaml.json": "a/arm.yaml",
    },""")
    assert wire(str(tmp_path), ["a/arm.yaml"], Report()) == [], "the second time nothing is written"


def test_documents_that_are_gone_are_taken_out_again(tmp_path: Path) -> None:
    both = written(tmp_path, COMMENTED, ["a/arm.yaml", "b.yaml"])
    assert plain(both)["yaml.schemas"]["./.thingc/schema/b.yaml.json"] == "b.yaml"
    assert written(tmp_path, both, ["a/arm.yaml"]) == written(tmp_path, COMMENTED, ["a/arm.yaml"])
    assert written(tmp_path, both, []) == COMMENTED


@pytest.mark.parametrize(
    "text",
    ["", "{}", "{\n}\n", '{"a": 1}', '{\r\n\t"a": {"yaml.schemas": 1}\r\n}\r\n', "// nothing\n{ /* here */ }\n"],
)
def test_any_settings_may_be_there_before(tmp_path: Path, text: str) -> None:
    found = written(tmp_path, text, ["arm.yaml", "leg.yml"])
    before = plain(text) if text else {}
    assert plain(found) == {**before, "yaml.schemas": {
        "./.thingc/schema/arm.yaml.json": "arm.yaml", "./.thingc/schema/leg.yml.json": "leg.yml",
    }}
    for comment in ("// nothing", "/* here */"):
        assert (comment in text) == (comment in found)
    assert ("\r\n" in text) == ("\r\n" in found)


@pytest.mark.parametrize("text", ['{"a": }', "[1]", '{"yaml.schemas": "x"}', '{"a": 1 "b": 2}', "{'a': 1}", '{"a": 1}}', '{"a": "\n"}'])
def test_what_is_no_settings_is_left_alone(tmp_path: Path, text: str) -> None:
    settings(tmp_path).parent.mkdir()
    settings(tmp_path).write_text(text)
    report = Report()
    assert wire(str(tmp_path), ["arm.yaml"], report) == []
    assert [d.code for d in report.diagnostics] == [Code.EDITOR_SETTINGS]
    assert settings(tmp_path).read_text() == text


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3), max_leaves=12,
)


@given(st.dictionaries(st.text(max_size=8), JSON, max_size=4), st.sampled_from([None, 2, "\t"]), st.data())
def test_members_come_and_go(before: dict[str, Any], indent: Any, data: st.DataObject) -> None:
    before.pop("yaml.schemas", None)
    text = json.dumps(before, indent=indent, ensure_ascii=False)
    names = data.draw(st.lists(st.text(max_size=5), unique=True, min_size=1, max_size=4))
    members = {name: f"{name}.yaml" for name in names}
    found = jsonc.with_members(text, "yaml.schemas", members)
    assert json.loads(found) == {**before, "yaml.schemas": members}
    assert jsonc.with_members(found, "yaml.schemas", members) == found
    gone = data.draw(st.lists(st.sampled_from(names), unique=True))
    left = jsonc.without_members(found, "yaml.schemas", gone)
    assert json.loads(left) == {**before, "yaml.schemas": {name: text for name, text in members.items() if name not in gone}}


@given(st.text(alphabet='{}[]",:/*\\ \n1atrue', max_size=30))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        value = jsonc.read(text)
    except jsonc.NotJson as fault:
        assert 0 <= fault.offset <= len(text)
    else:
        assert value.plain == plain(text)


def test_a_pattern_means_one_document_alone() -> None:
    names = ["arm.yaml", "old/arm.yaml", "old/older/arm.yaml", "farm.yaml"]
    assert pattern_of("arm.yaml", names) == ["arm.yaml", "!old/arm.yaml", "!old/older/arm.yaml"]
    assert pattern_of("old/arm.yaml", names) == "old/arm.yaml"


# --- TOML -------------------------------------------------------------------------------------------------------------

TOML_ROBOT = """\
thingc = "assembly/1"
name = "plain"

[components]
plate = {part = "arm:BasePlate"}
servo = {part = "thingc_stock.dynamixel:XM430", attach = {back = "plate.servo_seat"}}
"""

TAPLO = """\
# ours
exclude = ["build/**"]

[[rule]]
include = ["other.toml"]
[rule.formatting]
align_entries = true
"""


@pytest.fixture
def toml_robot(tmp_path: Path, shared_store: str) -> Path:
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')
    (tmp_path / "parts").mkdir()
    shutil.copy(ROOT / "parts" / "arm.py", tmp_path / "parts")
    (tmp_path / "plain.toml").write_text(TOML_ROBOT)
    (tmp_path / ".taplo.toml").write_text(TAPLO)
    thingc(tmp_path, shared_store, "schema")
    return tmp_path


def test_taplo_gets_rules_and_keeps_its_own(toml_robot: Path) -> None:
    text = (toml_robot / ".taplo.toml").read_text()
    assert text.startswith(TAPLO)
    rules = tomllib.loads(text)["rule"]
    assert rules[0] == tomllib.loads(TAPLO)["rule"][0]
    assert {"include": ["plain.toml"], "schema": {"enabled": True, "path": "./.thingc/schema/plain.toml.json"}} in rules
    assert wire(str(toml_robot), ["plain.toml", "thingc.toml"], Report()) == []
    (toml_robot / ".taplo.toml").write_text(text + "\n[formatting]\nindent_tables = true\n")
    wire(str(toml_robot), [], Report())
    assert tomllib.loads((toml_robot / ".taplo.toml").read_text()) == {
        **tomllib.loads(TAPLO), "formatting": {"indent_tables": True},
    }


def test_a_taplo_file_that_is_none_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / ".taplo.toml").write_text("[[rule\n")
    report = Report()
    assert wire(str(tmp_path), ["arm.toml"], report) == []
    assert [d.code for d in report.diagnostics] == [Code.EDITOR_SETTINGS]
    assert (tmp_path / ".taplo.toml").read_text() == "[[rule\n"


def lint(modules: Path, folder: Path) -> tuple[int, str]:
    done = subprocess.run(
        ["node", str(modules / "@taplo" / "cli" / "dist" / "cli.js"), "lint", "plain.toml", "thingc.toml"], cwd=folder,
        capture_output=True, text=True, timeout=120,
    )
    return done.returncode, done.stdout + done.stderr


def test_taplo_itself_agrees(node_modules: Path, toml_robot: Path) -> None:
    code, said = lint(node_modules, toml_robot)
    assert code == 0, said
    robot = toml_robot / "plain.toml"
    robot.write_text(TOML_ROBOT.replace('"arm:BasePlate"', '"arm:BasePlate", params = {siz = "120 mm"}'))
    code, said = lint(node_modules, toml_robot)
    assert code != 0 and "siz" in said
    robot.write_text(TOML_ROBOT.replace("plate.servo_seat", "plate.servo_sea"))
    code, said = lint(node_modules, toml_robot)
    assert code != 0 and "plate.servo_sea" in said
