"""`thingc lsp` from the view of an editor: edits and published diagnostics."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from lsprotocol import types
from pygls.exceptions import JsonRpcException

from live.documents import ROBOT, write
from lsp.editor import Editor, lines
from thingc.driver.environment import Options
from thingc.tools.cli.main import main
from thingc.tools.lsp.analysis import OpenText, analyse

CHANGED = ROBOT.replace("count: 2", "count: 2\n  half: =reach / 2")
WHOLE = {"start": {"line": 0, "character": 0}, "end": {"line": 999, "character": 0}}
TYPED = ["", "", "x", "_", " ", "\n", ":", "{", "]", "- ", "=", "'", "#", "12 mm", "\U0001f916", "\u00e9", "components:\n"]
ODD = [
    "", "thingc", "\x00thingc: assembly/1", "thingc: assembly/1\n" + "a: [" * 3000, "thingc: assembly/1\nname: &a [*a]\n",
    "\ufeffthingc: assembly/1\n", "thingc: assembly/1\r\nname: a\rcomponents: {a\u2028: 1}\n", "thingc: assembly/1\nname: \ud800\n",
    "thingc: workspace/1\n", "thingc: variants/1\nassembly: robot.yaml\naxes: {reach: [1 mm, 60 mm]}\n", "%YAML 9\n", "- a\n",
    "thingc: variants/1\nassembly: x.yaml\n", "thingc: assembly/1\nname: a\nparameters: {a: =a + b, b: =a * 9**9**9**9}\n",
    "thingc: materials/1\nmaterials: {oak: {density: 1 mm}}\n",
]


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    return write(tmp_path)


def test_diagnostics_are_published_with_the_version(editor: Editor, robot: Path) -> None:
    assert editor.open(robot) == []
    found = editor.type(robot, ROBOT.replace("parent: base.top\n    child", "parent: bass.top\n    child"))
    assert lines(found) == ["19:13 TC302 this document has no component `bass`"]
    assert editor.type(robot, ROBOT) == []
    assert editor.type(robot, ROBOT + "\n") == []


def test_every_keystroke_of_a_random_session_is_answered(editor: Editor, robot: Path) -> None:
    """Text is inserted and deleted at random, sometimes faster than it is answered. The diagnostics of the last text equal those of a
    check."""
    chance = random.Random(15)
    text = ROBOT
    editor.open(robot)
    for number in range(240):
        at, kept = chance.randrange(len(text)), chance.choice([0, 0, 0, 1, 7])
        put = chance.choice(TYPED)
        text = text[:at] + put + text[at + kept:]
        if number % 40 == 39:
            text = ROBOT
        editor.type_ahead(robot, text)
        if number % 3:
            editor.said(robot)
        if number % 30 == 17:
            said = editor.said(robot)
            found = analyse(str(robot), {str(robot): OpenText(uri="", version=0, text=text)}, Options(lock=True)).findings
            there = [one for one in found if one.span is None or one.span.file == str(robot)]
            assert [one.code for one in said] == [one.code.code for one in there], text
    assert editor.said(robot) == []


@pytest.mark.parametrize("text", ODD)
def test_unusual_texts_are_handled(editor: Editor, robot: Path, text: str) -> None:
    path = robot.parent / "odd.yaml"
    found = editor.open(path, text)
    assert not any("failed" in one.message for one in found)
    everywhere = {"start": {"line": 0, "character": 0}, "end": {"line": 99, "character": 2**31 - 1}}
    asked = {"textDocument": {"uri": path.as_uri()}}
    editor.request("textDocument/formatting", {**asked, "options": {"tabSize": 2, "insertSpaces": True}})
    editor.request("textDocument/codeAction", {**asked, "range": everywhere, "context": {"diagnostics": []}})
    editor.close(path)


def test_ten_megabytes_are_refused_without_blocking(editor: Editor, robot: Path) -> None:
    path = robot.parent / "large.yaml"
    assert [one.code for one in editor.open(path, ROBOT + "# " + "x" * 10_000_000)] == ["TC108"]
    assert editor.open(robot) == []
    editor.close(path)


def test_foreign_files_and_unknown_requests_are_ignored(editor: Editor, tmp_path: Path) -> None:
    """Files of other tools, URIs that are not files, and unknown methods."""
    assert editor.open(tmp_path / "docker.yaml", "services: {web: [}\n") == []
    assert editor.open(tmp_path / "notes.txt", "thingc: assembly/1\n") == []
    with pytest.raises(JsonRpcException, match="Method Not Found"):
        editor.request("textDocument/moniker", {"textDocument": {"uri": "file:///x.yaml"}, "position": {"line": 0, "character": 0}})
    for uri in ("untitled:Untitled-1", "file://elsewhere/x.yaml", "nonsense", "file:///a%00b.yaml"):
        asked = {"textDocument": {"uri": uri}, "options": {"tabSize": 2, "insertSpaces": True}}
        assert editor.request("textDocument/formatting", asked) is None
    assert editor.open(tmp_path / "new.yaml", "thingc: assembly/1\nname: new\n") != []


def test_two_workspaces_are_independent(editor: Editor, tmp_path: Path) -> None:
    """Both contain the same file names; each document belongs to its own workspace."""
    robots = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        robots.append(write(tmp_path / name))
    (tmp_path / "two/finger.yaml").unlink()
    assert editor.open(robots[0]) == []
    assert lines(editor.open(robots[1])) == ["11:15 TC113 there is no file `finger.yaml`"]
    seen = len(editor.published)
    (tmp_path / "two/finger.yaml").write_text((tmp_path / "one/finger.yaml").read_text())  # by somebody else
    assert editor.wait(lambda one: one.uri == robots[1].as_uri() and not one.diagnostics, seen) == []


def test_unsaved_workspace_settings_are_used(editor: Editor, robot: Path) -> None:
    settings = robot.parent / "thingc.toml"
    assert editor.open(robot) == []
    assert editor.open(settings) == []
    assert lines(editor.type(settings, 'thingc = "workspace/1"\npart_timeout = "5 mm"\n')) != []
    assert editor.type(settings, 'thingc = "workspace/1"\n') == []


def test_invalid_messages_do_not_stop_the_server(shared_store: str) -> None:
    """No message ends the server or makes it print to standard error, and every request is answered."""
    hover = {"textDocument": {"uri": "file:///x.yaml"}, "position": {"line": 0, "character": 0}}
    sent: list[Any] = [
        {"id": 1, "method": "textDocument/hover", "params": hover}, {"method": "textDocument/didOpen", "params": {}},
        {"id": 2, "method": "initialize", "params": {"capabilities": {}}}, b"{nonsense", b"[" * 100_000,
        {"id": 3, "method": "textDocument/hover", "params": {"textDocument": 3}}, {"method": "$/cancelRequest", "params": {"id": 99}},
        {"method": "textDocument/didClose", "params": {"textDocument": {"uri": "file:///never_opened.yaml"}}},
        {"id": 4, "method": "textDocument/hover", "params": hover}, {"id": 5, "method": "thingc/unknown", "params": {}},
    ]
    ending = [{"id": 6, "method": "shutdown"}, {"method": "exit"}]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "thingc", "lsp", "--store", shared_store], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdin is not None and process.stdout is not None and process.stderr is not None
    answers: dict[int, Any] = {}
    for messages, wanted in ((sent, 5), (ending, 6)):
        for one in messages:
            body = one if isinstance(one, bytes) else json.dumps({"jsonrpc": "2.0", **one}).encode()
            process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        process.stdin.flush()
        while len(answers) < wanted:
            length = 0
            while line := process.stdout.readline().strip():
                length = int(line.partition(b": ")[2]) if line.startswith(b"Content-Length") else length
            answer = json.loads(process.stdout.read(length))
            if "id" in answer:
                answers[answer["id"]] = answer.get("error", {}).get("code")
    assert answers == {1: -32002, 2: None, 3: -32602, 4: None, 5: -32601, 6: None}
    assert process.wait(20.0) == 0 and process.stderr.read() == b""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_a_waiting_server(number: signal.Signals, shared_store: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "thingc", "lsp", "--store", shared_store], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        body = json.dumps({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {"capabilities": {}}}).encode()
        process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        process.stdin.flush()
        assert process.stdout.readline().startswith(b"Content-")
        for _ in range(10):  # Python only handles a signal after its next wait if the signal arrives immediately before this wait
            process.send_signal(number)
            with suppress(subprocess.TimeoutExpired):
                process.wait(2.0)
                break
        assert process.wait(0.0) == 130 and process.stderr.read() == b""


def test_missing_extra_is_reported(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["lsp"]) == 2
    said = capsys.readouterr().err
    assert "`thingc lsp` requires the package `pygls`" in said and "pip install 'thingc[lsp]'" in said


def _place(text: str, offset: int) -> dict[str, int]:
    before = text[:offset]
    return {"line": before.count("\n"), "character": len(before) - before.rfind("\n") - 1}


def test_completion_hover_and_hints_over_the_protocol(editor: Editor, robot: Path) -> None:
    capabilities = editor.told.capabilities
    assert capabilities.completion_provider is not None and "." in (capabilities.completion_provider.trigger_characters or [])
    document = {"uri": robot.as_uri()}
    assert editor.open(robot, CHANGED) == []
    answer: Any = editor.request("textDocument/inlayHint", {"textDocument": document, "range": WHOLE})
    assert [one.label for one in answer][:1] == ["= 60 mm"]
    place = _place(CHANGED, CHANGED.index("pose: out") + 7)
    answer = editor.request("textDocument/hover", {"textDocument": document, "position": place})
    assert answer.contents.value.startswith("**out**: yaw_0 30 deg")
    text = CHANGED.replace("child: palm.seat", "child: palm.")
    editor.type(robot, text)
    place = _place(text, text.index("child: palm.") + 12)
    answer = editor.request("textDocument/completion", {"textDocument": document, "position": place})
    first = answer.items[0]
    assert (first.label, first.sort_text, first.documentation.value) == ("seat", "0000", "Exported by `palm.yaml`: `plate.seat`.")
    assert first.text_edit == types.TextEdit(types.Range(types.Position(**place), types.Position(**place)), "seat")
