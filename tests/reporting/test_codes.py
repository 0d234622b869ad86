"""Every code has a meaning, a wrong and a right example that are what they say, a current page, and `thingc explain` for it.

Examples are cases (`tests/cases/codes`), so that what is said of them is checked word for word there. Here it is checked that
the wrong one shows its code and nothing else, and that the right one does not: by `check`, and by the wrong one's own command
where that is a build.
"""

from __future__ import annotations

import json
import re
import runpy
import shlex
from functools import cache
from pathlib import Path

import pytest

from thingc.base.diagnostics import Code
from thingc.tools.cli.main import COMMANDS, main
from thingc.tools.reporting.explain import explained, find, near, sections

pytestmark = pytest.mark.usefixtures("one_kernel")

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT / "tests" / "cases" / "codes"
GENERATE = runpy.run_path(str(ROOT / "docs" / "generate.py"))
IN_WORDS = {
    "UNREADABLE", "LIBRARY", "INCOMPLETE", "UNREACHED", "MJCF_WARNING", "STEP_FAILED", "SAME_FILE", "UNEXPECTED",
    "UNSTATED", "OUTPUT", "NO_GRAPHICS", "INTERNAL", "VARIANT_DIED", "VARIANT_HUNG", "VARIANT_RAISED", "RUNNERS", "CLUSTER", "BATCH_LOCKED",
    "BATCH_UNFINISHED", "BATCH_CHANGED", "TOO_COSTLY", "WORKING_FOLDER", "SOURCE_XML", "SOURCE_VALUE", "SOURCE_TREE",
    "SOURCE_INERTIA", "SOURCE_DOUBT", "SOURCE_FILE", "SOURCE_CONFLICT",
}
"""Codes that no document on a healthy machine brings about: their pages say in words when it happens."""

CODES = sorted(Code, key=lambda code: code.code)
SHOWN = [code for code in CODES if code.name not in IN_WORDS]
AGAIN = "run `python docs/generate.py`"


@cache
def of(code: Code, side: str) -> tuple[Path, str]:
    """The document of an example, and what is said of it with the exit code."""
    stem = code.code if side == "wrong" else f"{code.code}.right"
    names = (f"{stem}.yaml", f"{stem}.toml", f"{code.code}/{side}/robot.yaml")
    there = [path for name in names for path in CASES.glob(f"*/{name}")]
    assert len(there) == 1, f"{code.code} has no {side} example in tests/cases/codes, see CONTRIBUTING.md, `A new check`"
    return there[0], there[0].with_suffix(".txt").read_text()


@pytest.mark.parametrize("code", CODES, ids=lambda code: code.code)
def test_every_code_has_a_meaning_in_sentences(code: Code) -> None:
    meaning = GENERATE["meanings"]().get(code.code)
    assert meaning, f"write a sentence for {code.code} into docs/codes/meanings.toml, see CONTRIBUTING.md, `A new check`"
    assert meaning.endswith(".") and len(meaning) > 30 and meaning not in (code.title, code.cure)


def test_there_is_no_meaning_of_a_code_that_is_none() -> None:
    assert set(GENERATE["meanings"]()) <= {code.code for code in Code}


@pytest.mark.parametrize("code", SHOWN, ids=lambda code: code.code)
def test_the_wrong_example_shows_its_code_and_no_other(code: Code) -> None:
    _, said = of(code, "wrong")
    heads = re.findall(r"^(?:error|warning|note)\[(TC\d+)\]", said, re.MULTILINE)
    assert set(heads) == {code.code}


@pytest.mark.parametrize("code", SHOWN, ids=lambda code: code.code)
def test_the_right_example_is_right(code: Code) -> None:
    document, said = of(code, "right")
    assert said.endswith("exit 0\n") and not re.search(r"TC\d{3}\]", said)
    wrong, _ = of(code, "wrong")
    assert document.read_text() != wrong.read_text(errors="replace") or code.name in FILES_DIFFER


FILES_DIFFER = {
    "WORKSPACE_FOLDER", "PART_EMPTY", "PART_UNREADABLE", "NO_LOCK", "LOCK_STALE", "LOCK_BROKEN", "NOT_LOCKED", "NOT_LOOKED_AT",
    "NO_RESULT", "APART", "PART_WRITES", "PART_LEFT", "PART_SWARMED", "PART_STARVED", "NOT_TWICE",
}
"""Codes whose two examples differ in another file than the document."""


def _built() -> list[Code]:
    """Codes whose wrong example is a build."""
    paths = {code: [CASES / f"{code.code}.yaml", CASES / code.code / "wrong" / "robot.yaml"] for code in SHOWN}
    first = {code: [p.read_text("latin-1") for p in found if p.exists()] for code, found in paths.items()}
    return [code for code, texts in first.items() if any(text.startswith("# $ thingc build") for text in texts)]


@pytest.mark.parametrize("code", _built(), ids=lambda code: code.code)
def test_the_right_example_builds_where_the_wrong_one_does_not(
    code: Code, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    wrong, _ = of(code, "wrong")
    right, _ = of(code, "right")
    words = shlex.split(wrong.read_text().partition("\n")[0].removeprefix("# $ thingc "))
    assert "_out" in words and wrong.name in words
    exits = []
    for document in (wrong, right):
        monkeypatch.chdir(document.parent)
        again = [{"_out": str(tmp_path), wrong.name: document.name}.get(word, word) for word in words]
        exits.append(main(again))
        assert (code.code in capsys.readouterr().err) == (document == wrong)
    assert exits == [1, 0]


def test_codes_in_words_are_those_without_an_example() -> None:
    with_example = {path.name[:5] for path in CASES.glob("*/TC*")}
    assert with_example == {code.code for code in SHOWN}


def test_pages_and_what_explain_reads_are_current() -> None:
    files = GENERATE["generated"]()
    stale = [str(path.relative_to(ROOT)) for path, text in files.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    assert stale == [], AGAIN
    assert set((ROOT / "docs" / "codes").glob("TC*.md")) <= set(files), AGAIN


def test_the_table_leads_to_every_page() -> None:
    table = (ROOT / "docs" / "diagnostics.md").read_text()
    linked = re.findall(r"^\| \[(TC\d+)\]\(codes/(TC\d+)\.md\) \|", table, re.MULTILINE)
    assert linked == [(code.code, code.code) for code in CODES]


@pytest.mark.parametrize("code", CODES, ids=lambda code: code.code)
def test_a_page_shows_both_examples_to_the_letter(code: Code) -> None:
    page = (ROOT / "docs" / "codes" / f"{code.code}.md").read_text()
    assert page.startswith(f"# {code.code}: {code.title}\n") and code.cure in page
    for target in re.findall(r"\]\(([^)\s]+)\)", page):
        assert (ROOT / "docs" / "codes" / target).exists(), target
    assert re.findall(r"^## (\w+)$", page, re.MULTILINE) == ([] if code.name in IN_WORDS else ["Wrong", "Right"])
    if code.name not in IN_WORDS:
        wrong, said = of(code, "wrong")
        right, _ = of(code, "right")
        assert wrong.read_text(errors="replace").rstrip("\n") in page and right.read_text().rstrip("\n") in page
        assert re.sub(r"\n*exit \d\n$", "", said) in page


# --- thingc explain ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", CODES, ids=lambda code: code.code)
def test_explain_says_what_the_page_says(code: Code, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", code.code]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"{code.code}: {code.title}\n") and f"Cure: {code.cure}\n" in printed
    meaning = GENERATE["meanings"]()[code.code]
    assert meaning in printed
    assert main(["explain", code.code, "--format", "json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["code"], answer["title"], answer["cure"], answer["meaning"]) == (code.code, code.title, code.cure, meaning)
    for side in ("wrong", "right"):
        if code.name in IN_WORDS:
            assert answer[side] is None
            continue
        document, said = of(code, side)
        text = document.read_text(errors="replace")
        assert next(iter(answer[side]["files"].items())) == (document.name, text)
        assert re.sub(r"\n*exit \d\n$", "", said) == answer[side]["said"]
        assert all(f"  | {line}".rstrip() in printed for line in text.rstrip("\n").split("\n"))
        assert f"  $ {answer[side]['command']}\n" in printed


def test_explain_takes_a_code_in_any_case_and_without_its_letters(capsys: pytest.CaptureFixture[str]) -> None:
    answers = []
    for word in ("TC302", "tc302", "302", "unknown_component"):
        assert main(["explain", word]) == 0
        answers.append(capsys.readouterr().out)
    assert len(set(answers)) == 1 and answers[0].startswith("TC302: unknown component\n")
    assert find("TC3") is None and find("") is None and find("30") is None


@pytest.mark.parametrize(("word", "meant"), [
    ("TC319", "TC318"), ("tc599", "TC601"), ("3022", "TC302"), ("mount", "TC303"), ("Duplicate_Kye", "TC104"), ("zzz", None), ("", None),
])
def test_an_unknown_code_brings_those_near_it(word: str, meant: str | None, capsys: pytest.CaptureFixture[str]) -> None:
    codes = [code.code for code in near(word)]
    assert (meant in codes) if meant is not None else (codes == [] or word == "")
    assert main(["explain", word]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and f"there is no code `{word}`" in printed.err
    assert "run `thingc explain` for a list of codes" in printed.err or "near it: " in printed.err


def test_explain_alone_lists_every_code_by_section(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain"]) == 0
    printed = capsys.readouterr().out
    assert re.findall(r"^  (TC\d+)  ", printed, re.MULTILINE) == [code.code for code in CODES]
    headings = re.findall(r"^(TC\dxx): (.+)$", printed, re.MULTILINE)
    assert [heading for heading, _ in headings] == [f"{title[:3]}xx" for title, _ in sections()]
    assert main(["explain", "--format", "json"]) == 0
    assert [entry["code"] for entry in json.loads(capsys.readouterr().out)["codes"]] == [code.code for code in CODES]
    assert "explain" in COMMANDS and explained(Code.INTERNAL)["wrong"] is None
