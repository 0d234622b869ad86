"""SARIF logs are valid against the OASIS schema in another implementation, and contain every location and message."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import jsonschema
import pytest

from reporting.reports import every_shape, on_one_line, repository
from thingc.base.diagnostics import Code, Severity
from thingc.tools.reporting.ci_formats import as_sarif

SCHEMA = json.loads((Path(__file__).parent / "sarif-2.1.0-rtm.5.json").read_text())
VALIDATOR = jsonschema.Draft4Validator(SCHEMA, format_checker=jsonschema.Draft4Validator.FORMAT_CHECKER)


def checked(text: str) -> dict[str, Any]:
    """Return the only run of a log, after checking the schema, all indices and all URIs."""
    log = json.loads(text)
    VALIDATOR.validate(log)
    (run,) = log["runs"]
    driver = run["tool"]["driver"]
    for result in run["results"]:
        assert driver["rules"][result["ruleIndex"]]["id"] == result["ruleId"]
    (invocation,) = run["invocations"]
    for kind in ("toolConfigurationNotifications", "toolExecutionNotifications"):
        for notification in invocation.get(kind, []):
            descriptor = notification["descriptor"]
            assert driver["notifications"][descriptor["index"]]["id"] == descriptor["id"]
    for place in places(run):
        location = place["artifactLocation"]
        split = urlsplit(location["uri"])
        assert location["uri"].isascii() and not any(character in location["uri"] for character in ' "<>\\^`{|}')
        assert not split.query and not split.fragment
        assert (split.scheme, location.get("uriBaseId")) in (("", "%SRCROOT%"), ("file", None))
        assert location.get("uriBaseId") is None or location["uriBaseId"] in run["originalUriBaseIds"]
    return dict(run)


def places(run: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        location["physicalLocation"] for result in run["results"]
        for location in (*result["locations"], *result.get("relatedLocations", []))
    ]


def test_schema_rejects_invalid_sarif() -> None:
    log = {"version": "2.1.0", "runs": [{"tool": {"driver": {"name": "x"}}, "results": [{"ruleId": "TC1", "message": {"text": "x"}}]}]}
    VALIDATOR.validate(log)
    for wrong in ({"level": "fatal"}, {"message": "x"}, {"column": 3}, {"locations": [{"region": {"startLine": 0}}]}):
        log["runs"][0]["results"][0] = {"message": {"text": "x"}, **wrong}  # type: ignore[index]
        with pytest.raises(jsonschema.ValidationError):
            VALIDATOR.validate(log)


def test_log_contains_all_diagnostics(tmp_path: Path) -> None:
    folder = repository(tmp_path)
    diagnostics = every_shape(folder)
    run = checked(as_sarif(diagnostics, base=str(folder), version="1.2.3", documentation="https://example.org/codes/"))
    assert run["tool"]["driver"]["version"] == "1.2.3"
    placed = [d for d in diagnostics if d.span is not None]
    assert len(run["results"]) == len(placed)
    for result, diagnostic in zip(run["results"], placed):
        assert diagnostic.span is not None
        assert (result["ruleId"], result["level"]) == (diagnostic.code.code, diagnostic.severity.value)
        assert result["message"]["text"].startswith(on_one_line(diagnostic.message))
        assert diagnostic.help is None or diagnostic.help in result["message"]["text"]
        location = result["locations"][0]["physicalLocation"]
        read = unquote(location["artifactLocation"]["uri"].removeprefix("file://"))
        assert (folder / read).resolve() == Path(diagnostic.span.file).resolve()
        region = location["region"]
        assert region["startLine"] == diagnostic.span.line
        if "startColumn" in region:
            end = (region["endLine"], region["endColumn"])
            assert (region["startColumn"], end) == (diagnostic.span.column, (diagnostic.span.end_line, diagnostic.span.end_column))
        related = [entry["message"]["text"] for entry in result.get("relatedLocations", [])]
        assert related == [note.message for note in diagnostic.notes if note.span is not None]
        assert all(note.message in result["message"]["text"] for note in diagnostic.notes if note.span is None)
    invocation = run["invocations"][0]
    assert not invocation["executionSuccessful"]
    assert [n["descriptor"]["id"] for n in invocation["toolConfigurationNotifications"]] == [Code.COMMAND_LINE.code]
    assert [n["descriptor"]["id"] for n in invocation["toolExecutionNotifications"]] == [Code.INTERNAL.code]


def test_rules_are_complete_and_link_to_their_pages(tmp_path: Path, root: Path) -> None:
    folder = repository(tmp_path)
    run = checked(as_sarif(every_shape(folder), base=str(folder), version="1", documentation="https://example.org/codes"))
    rules = {rule["id"]: rule for rule in run["tool"]["driver"]["rules"]}
    assert set(rules) == {"TC303", "TC401", "TC511"}
    assert rules["TC303"]["name"] == "UnknownMount"
    assert rules["TC303"]["shortDescription"] == {"text": "Unknown mount"}
    assert rules["TC303"]["fullDescription"] == {"text": Code.UNKNOWN_MOUNT.cure}
    for code, rule in rules.items():
        base, _, page = rule["helpUri"].rpartition("/")
        assert (base, page) == ("https://example.org/codes", f"{code}.md") and (root / "docs" / "codes" / page).exists()
    without = checked(as_sarif(every_shape(folder), base=str(folder), version="1"))
    assert all("helpUri" not in rule for rule in without["tool"]["driver"]["rules"])


def test_fingerprint_does_not_depend_on_line_numbers(tmp_path: Path) -> None:
    from msgspec.structs import replace

    folder = repository(tmp_path)
    said = [d for d in every_shape(folder) if d.span is not None]
    moved = [replace(d, span=replace(d.span, line=d.span.line + 9, end_line=d.span.end_line + 9)) for d in said if d.span is not None]
    before, after = (
        [r["partialFingerprints"] for r in checked(as_sarif(found, base=str(folder), version="1"))["results"]] for found in (said, moved)
    )
    assert before == after
    assert len({json.dumps(fingerprint) for fingerprint in before}) == len(before)
    twice = checked(as_sarif([said[1], moved[1]], base=str(folder), version="1"))["results"]
    assert twice[0]["partialFingerprints"] != twice[1]["partialFingerprints"]


def test_empty_log_is_a_successful_run() -> None:
    run = checked(as_sarif([], base="/", version="1"))
    assert run["results"] == [] and run["invocations"] == [{"executionSuccessful": True}]


def test_columns_count_unicode_code_points(tmp_path: Path) -> None:
    """The default of SARIF is UTF-16 code units; spans count characters."""
    assert checked(as_sarif([], base=str(tmp_path), version="1"))["columnKind"] == "unicodeCodePoints"
    text = "name: two # \U0001f9be\n"
    assert len(text) != len(text.encode("utf-16-le")) // 2


def test_warnings_do_not_fail_the_run(tmp_path: Path) -> None:
    folder = repository(tmp_path)
    warnings = [d for d in every_shape(folder) if d.severity is Severity.WARNING]
    assert checked(as_sarif(warnings, base=str(folder), version="1"))["invocations"][0]["executionSuccessful"]
