"""Every code has a page with its meaning and with a wrong and a right example that are verified; `thingc explain` shows the same.

`REGENERATE=1 pytest tests/reporting/test_codes.py` writes the output of the examples into the pages: review it as a user would."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import code_pages
import pytest
from code_pages import path_of, read_page, unpack, with_output
from generate import generated

from cases.test_cases import said
from thingc.base.diagnostics import Code
from thingc.tools.cli.console import USAGE_CODES
from thingc.tools.cli.main import COMMANDS, main
from thingc.tools.reporting.explain import find, sections, similar_codes

ROOT = Path(__file__).resolve().parents[2]
CODES = sorted(Code, key=lambda code: code.code)
AGAIN = "run `python docs/generate.py`"

ELSEWHERE = {
    "INCOMPLETE": "tests/graph/test_link_faults.py",  # what earlier passes should have caught
    "UNREACHED": "tests/robot/test_spanning_tree.py",
    "INTERNAL": "tests/cases/test_folders.py",
    "TOO_COSTLY": "tests/safety/test_bounds.py",  # takes its time
    "NO_GRAPHICS": "tests/cli/test_render.py",  # a machine without EGL
    "LIBRARY": "tests/resolve/test_components.py",  # a machine without the library
    "MJCF_WARNING": "tests/mjcf/test_mjcf_check.py",  # depends on the version of MuJoCo
    "SAME_FILE": "tests/emit/test_stl.py",  # two part files of one name on one file system
    "PRINT_SIZE": "tests/workshop/test_plates.py",  # the size depends on the printer in the workspace file
    "STEP_FAILED": "tests/emit/test_step.py",  # a kernel that fails
    "UNSTATED": "tests/cases/test_folders.py",  # a package that is installed
    "UNREADABLE": "tests/cases/test_folders.py",  # files and folders that no repository keeps
    "OUTPUT": "tests/cases/test_folders.py",
    "VARIANT_DIED": "tests/variants/test_faults.py",  # what happens while variants are built
    "VARIANT_HUNG": "tests/variants/test_faults.py",
    "VARIANT_RAISED": "tests/variants/test_faults.py",
    "RUNNERS": "tests/variants/test_faults.py",
    "BATCH_LOCKED": "tests/variants/test_faults.py",
    "BATCH_UNFINISHED": "tests/variants/test_faults.py",
    "BATCH_CHANGED": "tests/variants/test_batch.py",
    "CLUSTER": "tests/variants/test_cluster.py",  # other machines
    "UNEXPECTED": "tests/cases/test_folders.py",
    "WORKING_FOLDER": "tests/cases/test_folders.py",
    "SOURCE_XML": "tests/importing/wrong/syntax.txt",  # files of other formats
    "SOURCE_VALUE": "tests/importing/wrong/values.txt",
    "SOURCE_TREE": "tests/importing/wrong/tree.txt",
    "SOURCE_INERTIA": "tests/importing/wrong/inertias.txt",
    "SOURCE_FILE": "tests/importing/test_meshes.py",
    "SOURCE_DOUBT": "tests/importing/test_inertias.py",
    "SOURCE_CONFLICT": "tests/importing/test_updates.py",
    "SOURCE_LOSS": "tests/importing/test_check_files.py",
}
"""Codes that no document on a normal machine causes, and the files that test them. Their pages have no examples."""

_SPOKEN = {"UNREACHED": "is not connected to the root of mode"}


SHOWN = [code for code in CODES if code.name not in ELSEWHERE]
SIDES = ("wrong", "right")


def test_every_code_has_a_page_with_a_meaning() -> None:
    assert [code.code for code in CODES if not path_of(code).exists()] == [], AGAIN
    meanings = {code: read_page(code).meaning for code in CODES}
    assert [code.code for code, meaning in meanings.items() if not (meaning.endswith(".") and len(meaning) > 30)] == []
    unsaid = [code.code for code, meaning in meanings.items() if meaning in (code.title, code.cure)]
    assert unsaid == [], "say what the code means"
    copied = [code.code for code, meaning in meanings.items() if [*meanings.values()].count(meaning) > 1]
    assert copied == [], "explain each code by itself"


def test_every_code_has_an_example_or_another_test() -> None:
    for code in CODES:
        if code.name in ELSEWHERE:
            text = (ROOT / ELSEWHERE[code.name]).read_text()
            spoken = (f"Code.{code.name}", f'"{code.name}"', code.code, _SPOKEN.get(code.name, "\0"))
            assert any(word in text for word in spoken), code.name
    assert [code.code for code in CODES if tuple(read_page(code).examples) != (() if code.name in ELSEWHERE else SIDES)] == []


@pytest.mark.parametrize("code", SHOWN, ids=lambda code: code.code)
def test_page_examples_print_the_shown_output(
    code: Code, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The wrong example reports only its code. The right one does not report it, also with the command of the wrong one."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.setenv("COLUMNS", "100")
    page = read_page(code)
    wrong, right = (page.examples[side] for side in SIDES)
    for side, example in page.examples.items():
        unpack(page, side, tmp_path / side)
        monkeypatch.chdir(tmp_path / side)
        printed, exit_code = said(shlex.split(example.command)[1:])
        if os.environ.get("REGENERATE"):
            path_of(code).write_text(with_output(path_of(code).read_text(), example, printed))
        again = f"if it is right: REGENERATE=1 .venv/bin/pytest tests/reporting -k 'examples and {code.code}', and read it"
        assert printed == read_page(code).examples[side].printed, again
        heads = re.findall(r"^(error|warning|note)\[(TC\d+)\]", printed, re.MULTILINE)
        assert {head for _, head in heads} == ({code.code} if side == "wrong" else set())
        failed = side == "wrong" and ("--strict" in example.command or any(severity == "error" for severity, _ in heads))
        assert exit_code == (0 if not failed else 2 if code in USAGE_CODES else 1)
    assert right.files and all(text != wrong.files.get(name) for name, text in right.files.items()), "leave out files that are the same"
    if wrong.command.startswith("thingc build"):
        command = wrong.command.replace(f"{code.code}.yaml", f"{code.code}.right.yaml")
        printed, exit_code = said(shlex.split(command)[1:])
        assert exit_code == 0 and code.code not in re.findall(r"\[(TC\d+)\]", printed)


def test_no_page_exists_for_an_unknown_code() -> None:
    assert set((ROOT / "docs" / "codes").glob("TC*.md")) == {path_of(code) for code in CODES}, AGAIN


def test_generated_pages_are_up_to_date() -> None:
    files = generated()
    stale = [str(path.relative_to(ROOT)) for path, text in files.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    assert stale == [], AGAIN


def test_pages_define_the_entries_of_codes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "codes"
    shutil.copytree(code_pages.PAGES, folder)
    monkeypatch.setattr(code_pages, "PAGES", folder)
    (folder / "TC417.md").unlink()
    text = "# TC418: dark \"part\"\n<!-- Code.DARK, Stage.BUILD -->\n\nThe part is dark.\n\n**Fix.** Add light.\n"
    (folder / "TC418.md").write_text(text)
    lines = code_pages.current_codes().splitlines()
    at = lines.index('    DARK = ("TC418", "dark \\"part\\"", "Add light.", Stage.BUILD)')
    assert '"TC416"' in lines[at - 1] and not any('"TC417"' in line for line in lines)
    (folder / "TC418.md").write_text(text.replace("Add light.", "Add more light. " * 8 + "Wait."))
    assert '        "TC418", "dark \\"part\\"",' in code_pages.current_codes().splitlines()
    for old, new, error in (("DARK", "SIZE", AssertionError), ("BUILD", "NIGHT", KeyError), ("TC418", "TC999", AssertionError)):
        (folder / "TC418.md").write_text(text.replace(old, new))
        with pytest.raises(error):
            code_pages.current_codes()


def test_table_links_to_every_page() -> None:
    table = (ROOT / "docs" / "diagnostics.md").read_text()
    linked = re.findall(r"^\| \[(TC\d+)\]\(codes/(TC\d+)\.md\) \|", table, re.MULTILINE)
    assert linked == [(code.code, code.code) for code in CODES]


def test_links_of_code_pages_resolve() -> None:
    links = {(code.code, target) for code in CODES for target in re.findall(r"\]\(([^)\s#]+)", path_of(code).read_text())}
    assert {link for link in links if not (ROOT / "docs" / "codes" / link[1]).exists()} == set()


# --- thingc explain ------------------------------------------------------------------------------------------------


def test_explain_shows_the_content_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    for code in CODES:
        assert main(["explain", code.code]) == 0
        printed = capsys.readouterr().out
        assert printed.startswith(f"{code.code}: {code.title}\n") and f"Fix: {code.cure}\n" in printed
        page = read_page(code)
        assert page.meaning in printed
        assert main(["explain", code.code, "--format", "json"]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert (answer["code"], answer["title"], answer["cure"], answer["meaning"]) == (code.code, code.title, code.cure, page.meaning)
        examples = {side: page.examples.get(side) for side in SIDES}
        assert {side: answer[side] for side in SIDES} == {
            side: example and {"files": example.files, "command": example.command, "said": example.printed.rstrip("\n")}
            for side, example in examples.items()
        }, code
        for example in filter(None, examples.values()):
            assert all(f"  | {line}".rstrip() in printed for text in example.files.values() for line in text.rstrip("\n").split("\n"))
            assert f"  $ {example.command}\n" in printed


def test_explain_accepts_several_spellings_of_a_code(capsys: pytest.CaptureFixture[str]) -> None:
    answers = []
    for word in ("TC302", "tc302", "302", "unknown_component"):
        assert main(["explain", word]) == 0
        answers.append(capsys.readouterr().out)
    assert len(set(answers)) == 1 and answers[0].startswith("TC302: unknown component\n")
    assert find("TC3") is None and find("") is None and find("30") is None


@pytest.mark.parametrize(("word", "meant"), [
    ("TC319", "TC318"), ("tc599", "TC601"), ("3022", "TC302"), ("mount", "TC303"), ("Duplicate_Kye", "TC104"), ("zzz", None), ("", None),
])
def test_unknown_code_suggests_similar_ones(word: str, meant: str | None, capsys: pytest.CaptureFixture[str]) -> None:
    codes = [code["code"] for code in similar_codes(word)]
    assert (meant in codes) if meant is not None else (codes == [] or word == "")
    assert main(["explain", word]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and f"there is no code `{word}`" in printed.err
    assert "run `thingc explain` for a list of codes" in printed.err or "similar codes: " in printed.err


def test_explain_without_arguments_lists_all_codes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain"]) == 0
    printed = capsys.readouterr().out
    assert re.findall(r"^  (TC\d+)  ", printed, re.MULTILINE) == [code.code for code in CODES]
    headings = re.findall(r"^(TC\dxx): (.+)$", printed, re.MULTILINE)
    assert [heading for heading, _ in headings] == [f"{title[:3]}xx" for title, _ in sections()]
    assert main(["explain", "--format", "json"]) == 0
    assert [entry["code"] for entry in json.loads(capsys.readouterr().out)["codes"]] == [code.code for code in CODES]
    internal = find("INTERNAL")
    assert "explain" in COMMANDS and internal is not None and internal["wrong"] is None


@pytest.mark.parametrize("words", [[], ["TC302"], ["TC651"], ["nothing_like_it"]], ids=lambda words: " ".join(words) or "all")
def test_explain_has_no_heavy_imports(words: list[str]) -> None:
    program = "import sys; from thingc.tools.cli.main import main; main(sys.argv[1:]); print([*sys.modules], file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", program, "explain", *words], capture_output=True, text=True, check=True)
    assert "thingc.tools.reporting.explain" in done.stderr and "pydantic" not in done.stderr
