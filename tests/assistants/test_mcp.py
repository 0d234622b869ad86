"""`thingc mcp`, with the client of the package `mcp`. Each tool returns the output of the command, writes only in the folder, and runs
no code of an untrusted folder."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import anyio
import numpy as np
import psutil
import pytest
from PIL import Image
from ruamel.yaml import YAML

from editor.language_server import wait_until
from thingc.driver import edit_document
from thingc.tools.cli.main import COMMANDS, main
from thingc.tools.cli.render import SHOT
from thingc.tools.templates import files_of

if TYPE_CHECKING:  # every test process would import it, for half a second
    from mcp.types import CallToolResult, ListToolsResult

ROOT = Path(__file__).resolve().parents[2]
SKILL = ROOT / "skills/thingc/SKILL.md"
READ, WRITE = {"check", "info", "explain", "parts", "render"}, {"set", "add"}
BROKEN = """\
thingc: assembly/1
name: broken
materials: [thingc_stock.materials]
components:
  post: {part: shapes:Post}
  boom: {part: shapes:Boom, attach: {hub: plat.top}}
"""
SMALLER = """
import os
os.environ.setdefault("MUJOCO_GL", "egl")  # the studio imports MuJoCo
from thingc.targets.render import studio
from thingc.targets.render.picture import Shot
from thingc.tools.cli import main, render
render.SHOT = Shot(size=(320, 240))
lamps = studio.lamps
studio.lamps = lambda camera, normal, counts: lamps(camera, normal, (2, 2))
raise SystemExit(main.main())
"""
"""`thingc`, whose default picture is a sixteenth as large and has few lamps: without a graphics card, each takes seconds."""
Call = Callable[..., "CallToolResult"]


@pytest.fixture
def rover(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A workspace of two parts and a joint, in a folder with other files."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(tmp_path)
    assert main(["new", "rover", "--template", "empty"]) == 0
    (tmp_path / "rover/broken.yaml").write_text(BROKEN)
    (tmp_path / "other.yaml").write_text((tmp_path / "rover/rover.yaml").read_text())
    monkeypatch.chdir(tmp_path / "rover")
    return tmp_path / "rover"


def called(tool: str, given: dict[str, Any], *, trusted: bool = True) -> CallToolResult:
    """Call a tool of a server in this process."""
    from mcp import Client

    from thingc.tools.mcp.server import Tools, create_server

    async def work() -> CallToolResult:
        async with Client(create_server(Tools(trusted=trusted))) as client:
            return await client.call_tool(tool, given)

    return anyio.run(work)


def served(
    rover: Path, *calls: tuple[str, dict[str, Any]], words: Sequence[str] = ("--trusted",), command: Sequence[str] = ("-m", "thingc"),
) -> list[CallToolResult]:
    """Call tools of a server in a separate process, in which MuJoCo is not yet imported with another renderer."""
    from mcp import Client, StdioServerParameters

    async def work() -> list[CallToolResult]:
        server = StdioServerParameters(
            command=sys.executable, args=["-P", *command, "mcp", "-C", str(rover), *words], cwd=rover.parent, env={**os.environ},
        )
        async with Client(server) as client:
            assert client.server_info is not None and client.server_info.name == "thingc"
            return [await client.call_tool(tool, given) for tool, given in calls]

    return anyio.run(work)


def codes(result: CallToolResult) -> list[str]:
    assert result.structured_content is not None and json.loads(result.content[0].text) == result.structured_content  # type: ignore[union-attr]
    return [one["code"] for one in result.structured_content["diagnostics"]]


def printed(*words: str) -> Any:
    """Return the output of a command in a separate process."""
    return json.loads(subprocess.run([sys.executable, "-P", "-m", "thingc", *words, "--format", "json"], capture_output=True).stdout)


def test_five_tools_read_and_two_write(rover: Path) -> None:
    from mcp import Client

    from thingc.tools.mcp.server import Tools, create_server

    async def work() -> ListToolsResult:
        async with Client(create_server(Tools(trusted=False))) as client:
            return await client.list_tools()

    tools = {tool.name: tool for tool in anyio.run(work).tools}
    assert tools.keys() == READ | WRITE and tools.keys() <= COMMANDS.keys()
    for name, tool in tools.items():
        assert tool.description and tool.annotations is not None and tool.annotations.read_only_hint == (name in READ)
        required = set(tool.input_schema.get("required", []))
        others = {"check": set(), "explain": {"code"}, "parts": set(), "set": {"document", "values"}, "add": {"what", "name"}}
        assert required == others.get(name, {"document"})


def test_unknown_arguments_and_invalid_paths_are_errors(rover: Path) -> None:
    wrong = called("check", {"document": "rover.yaml"})
    assert wrong.is_error and "`check` has no argument `document`: did you mean `documents`?" in wrong.content[0].text  # type: ignore[union-attr]
    assert "U+0000" in called("check", {"documents": ["a\0b"]}).content[0].text  # type: ignore[union-attr]


@pytest.mark.slow
def test_results_equal_the_output_of_commands(rover: Path) -> None:
    for tool, given, words in (
        ("check", {"documents": ["rover.yaml"]}, ["check", "rover.yaml"]),
        ("check", {}, ["check"]),
        ("info", {"document": "rover.yaml", "parameters": {"length": "200 mm"}}, ["info", "rover.yaml", "-p", "length=200 mm"]),
        ("explain", {"code": "302"}, ["explain", "TC302"]),
        ("parts", {"part": ["shapes:Post"]}, ["parts", "shapes:Post"]),
        ("parts", {"part": ["shapes", "thingc_stock.magnets"]}, ["parts", "shapes", "thingc_stock.magnets"]),
    ):
        result = called(tool, given)
        assert not result.is_error and result.structured_content == printed(*words), tool
    assert called("info", {"document": "rover.yaml"}).structured_content != called(
        "info", {"document": "rover.yaml", "parameters": {"length": "200 mm"}},
    ).structured_content


@pytest.mark.slow
def test_picture_shows_the_pose(rover: Path) -> None:
    def picture(result: CallToolResult) -> np.ndarray[Any, Any]:
        assert codes(result) == []
        image = result.content[1]
        assert image.type == "image" and image.mime_type == "image/png"
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(image.data))).convert("RGB"), dtype=int)

    document = {"document": "rover.yaml"}
    *drawn, unknown = served(
        rover, ("render", document), ("render", {**document, "pose": "level", "elevation": 0, "mounts_of": ["boom"]}),
        ("render", {**document, "pose": "levle"}), command=("-c", SMALLER),
    )
    raised, level = map(picture, drawn)
    assert SHOT.size == (1280, 960) and raised.shape == (240, 320, 3) and np.ptp(raised) > 100
    assert np.abs(raised - level).max() > 100
    assert sorted(path.name for path in rover.iterdir() if path.suffix == ".png") == []
    assert unknown.is_error and "did you mean `level`?" in unknown.content[0].text  # type: ignore[union-attr]


@pytest.mark.slow
def test_values_are_set_and_comments_stay(rover: Path) -> None:
    before = (rover / "rover.yaml").read_text()
    values = {"length": "150 mm", "joints.swing.limit.upper": "80 deg"}
    preview = called("set", {"document": "rover.yaml", "values": values, "preview": True})
    assert not preview.is_error and (rover / "rover.yaml").read_text() == before
    result = called("set", {"document": "rover.yaml", "values": values})
    assert not result.is_error and result.structured_content is not None
    assert {one["path"]: (one["before"], one["after"]) for one in result.structured_content["set"]}["parameters.length.value"] == (
        "120 mm", "150 mm",
    )
    after = (rover / "rover.yaml").read_text()
    told = YAML(typ="safe").load(after)
    assert told["parameters"]["length"]["value"] == "150 mm" and told["joints"]["swing"]["limit"]["upper"] == "80 deg"
    assert [line for line in before.splitlines() if line not in after.splitlines()] != [] and after.count("#") == before.count("#")
    assert sum(one != other for one, other in zip(before.splitlines(), after.splitlines(), strict=True)) == 2


@pytest.mark.slow
def test_elements_are_added(rover: Path) -> None:
    for given in (
        {"what": "part", "name": "Flag", "on": "boom.tip"},
        {"what": "mode", "name": "hung", "root": "boom.tip", "base": "free"},
        {"what": "test", "name": "light", "kind": "mass"},
        {"what": "assembly", "name": "hat", "on": "post.table_0", "component": "cap"},
    ):
        result = called("add", {**given, "to": "rover.yaml"})
        assert not result.is_error, result.content
    told = YAML(typ="safe").load((rover / "rover.yaml").read_text())
    assert told["components"]["flag"]["attach"] == {"bottom": "boom.tip"} and told["modes"]["hung"]["base"] == "free"
    assert "light" in told["tests"] and told["components"]["cap"]["assembly"] == "hat.yaml" and (rover / "hat.yaml").exists()
    assert "class Flag(Thing)" in (rover / "parts/flag.py").read_text()
    assert codes(called("check", {"documents": ["rover.yaml"]})) == []


def test_invalid_document_is_reported_and_not_changed(rover: Path) -> None:
    checked = called("check", {"documents": ["broken.yaml"]})
    assert not checked.is_error and codes(checked) == codes(called("info", {"document": "broken.yaml"})) == ["TC302"]
    assert checked.structured_content is not None and checked.structured_content["diagnostics"][0]["line"] == 6
    for tool, given in (
        ("info", {"document": "broken.yaml"}), ("render", {"document": "broken.yaml"}),
        ("set", {"document": "broken.yaml", "values": {"components.post.params.height": "100 mm"}}),
        ("add", {"what": "mode", "name": "m", "to": "broken.yaml"}),
        ("set", {"document": "rover.yaml", "values": {"length": "1 m"}}),  # more than the maximum
        ("set", {"document": "missing.yaml", "values": {"a": "1"}}), ("explain", {"code": "TC000"}),
        ("parts", {"part": ["shapes:Psot"]}),
    ):
        before = {path.name: path.read_bytes() for path in rover.glob("*.yaml")}
        result = called(tool, given)
        assert result.is_error and codes(result) != [], tool
        assert {path.name: path.read_bytes() for path in rover.glob("*.yaml")} == before


def test_files_outside_the_folder_are_errors(rover: Path) -> None:
    (rover / "link.yaml").symlink_to(rover.parent / "other.yaml")
    (rover / "up").symlink_to(rover.parent)
    before = (rover.parent / "other.yaml").read_bytes()
    for path in ("../other.yaml", str(rover.parent / "other.yaml"), "link.yaml", "up/other.yaml", "parts/../../other.yaml", ".."):
        for tool, given in (
            ("check", {"documents": ["rover.yaml", path]}), ("info", {"document": path}), ("render", {"document": path}),
            ("parts", {"workspace": path}), ("set", {"document": path, "values": {"length": "150 mm"}}),
            ("add", {"what": "mode", "name": "m", "to": path, "root": "post"}),
        ):
            result = called(tool, given)
            assert result.is_error and "is outside the folder of the server" in result.content[0].text, (tool, path)  # type: ignore[union-attr]
    for name in ("../new.yaml", "up/new.yaml"):
        assert called("add", {"what": "assembly", "name": name}).is_error
    assert (rover.parent / "other.yaml").read_bytes() == before and not (rover.parent / "new.yaml").exists()


def test_arguments_are_not_options(rover: Path) -> None:
    (rover / "broken.yaml").write_text(BROKEN.replace("post:", "psot:").replace("part:", "prat:"))
    before = (rover / "broken.yaml").read_bytes()
    assert called("check", {"documents": ["broken.yaml", "--fix"]}).is_error
    assert called("set", {"document": "broken.yaml", "values": {"--diff": "1"}}).is_error
    assert called("explain", {"code": "--help"}).is_error and called("parts", {"part": ["--workspace=/"]}).is_error
    assert called("add", {"what": "mode", "name": "--to=rover.yaml"}).is_error
    assert (rover / "broken.yaml").read_bytes() == before


@pytest.mark.slow
def test_no_code_of_an_untrusted_folder_runs(rover: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules that thingc imports itself would leave a file if they were found in the folder. The geometry service must not be created."""
    mark = rover.parent / "ran"
    for module in ("json", "conftest", "sitecustomize", "thingc"):
        (rover / f"{module}.py").write_text(f"open({str(mark)!r}, 'w')\n")
    reads: list[tuple[str, dict[str, Any]]] = [
        ("check", {"documents": ["rover.yaml"]}), ("info", {"document": "rover.yaml"}), ("parts", {}),
    ]
    writes: list[tuple[str, dict[str, Any]]] = [
        ("set", {"document": "rover.yaml", "values": {"joints.swing.limit.upper": "80 deg"}}),
        ("add", {"what": "mode", "name": "hung", "to": "rover.yaml", "root": "boom.tip", "base": "free"}),
    ]
    assert main(["lock"]) == 0
    expected = called("info", {"document": "rover.yaml"}).structured_content["mass"]

    def fail(*given: Any, **more: Any) -> None:
        raise AssertionError("code would run")

    monkeypatch.setattr("thingc.geometry.service.GeometryService.__init__", fail)
    for tool, given in (*reads, *writes):
        result = called(tool, given, trusted=False)
        assert not result.is_error and codes(result) == [], (tool, result.content)
        if tool == "info":
            assert result.structured_content["mass"] == pytest.approx(expected, rel=1e-9)
        if tool == "parts":
            posts = [one for one in result.structured_content["parts"] if one["reference"] == "shapes:Post"]
            assert posts == [{"reference": "shapes:Post", "doc": "A post on a foot, with a pin at the top that carries another part."}]
            mounts = called("parts", {"part": ["shapes:Post"]}, trusted=False).structured_content["parts"][0]["mounts"]
            assert {"ground", "pin", "table_0"} <= mounts.keys()
    part = {"what": "part", "to": "rover.yaml", "on": "boom.tip"}
    refused = [("render", {"document": "rover.yaml"}), ("add", {**part, "name": "shapes:Post"}), ("add", {**part, "name": "Flag"})]
    for tool, given in refused:
        assert called(tool, given, trusted=False).is_error, tool
    (rover / "parts/shapes.py").write_text((rover / "parts/shapes.py").read_text().replace("= 90", "= 91"))
    for tool, given in (*reads, writes[0], *refused):
        assert codes(called(tool, given, trusted=False)) != [], f"{tool}: the lock is not up to date"
    (rover / "robot.xacro").write_text('<robot name="a"><link name="${1 + 1}"/></robot>')
    assert "Python expressions" in called("info", {"document": "robot.xacro"}, trusted=False).content[0].text  # type: ignore[union-attr]
    (rover / "parts.lock.json").unlink()
    for tool, given in (*reads, writes[0]):
        assert codes(called(tool, given, trusted=False)) == ["TC340"], f"{tool}: there is no lock"
    assert not mark.exists() and not (rover / "parts/flag.py").exists()


@pytest.mark.parametrize("tool", ["set", "add"])
def test_concurrent_change_is_not_overwritten(rover: Path, tool: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """An editor saves the file after the tool has read it, and before it writes."""
    document, saved = rover / "rover.yaml", (rover / "rover.yaml").read_text() + "# an edit\n"
    replace = edit_document.document_change

    def save(*given: Any) -> Any:
        document.write_text(saved)
        return replace(*given)

    monkeypatch.setattr("thingc.driver.edit_document.document_change", save)
    monkeypatch.setattr("thingc.tools.cli.add.document_change", save)
    result = called(*{
        "set": ("set", {"document": "rover.yaml", "values": {"length": "150 mm"}}),
        "add": ("add", {"what": "mode", "name": "hung", "to": "rover.yaml", "root": "boom.tip", "base": "free"}),
    }[tool])
    assert result.is_error and "changed while this command ran" in result.content[0].text  # type: ignore[union-attr]
    assert document.read_text() == saved


@pytest.mark.slow
@pytest.mark.parametrize("trusted", [False, True])
def test_server_over_standard_input_and_output(rover: Path, shared_store: str, trusted: bool) -> None:
    """The server runs in a separate process. The output of part code does not disturb the protocol."""
    (rover / "parts/shapes.py").write_text("print('hello')\n" + (rover / "parts/shapes.py").read_text())
    document = {"document": "rover.yaml"}
    results = served(
        rover, ("check", {"documents": ["rover.yaml"]}), ("info", document), ("render", {**document, "pose": "levle"}),
        ("explain", {"code": "TC302"}),
        words=["--store", shared_store, *(["--trusted"] if trusted else [])],
    )
    assert [result.is_error for result in results] == [False, not trusted, True, False]
    assert ("did you mean `level`?" if trusted else "--trusted") in results[2].content[0].text  # type: ignore[union-attr]
    assert ("TC340" in codes(results[0])) != trusted


def test_signal_ends_a_waiting_server(rover: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "thingc", "mcp"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        params = {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "t", "version": "1"}}
        process.stdin.write(json.dumps({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": params}).encode() + b"\n")
        process.stdin.flush()
        assert json.loads(process.stdout.readline())["id"] == 1
        process.send_signal(signal.SIGTERM)
        assert process.wait(20.0) == 130 and process.stderr.read() == b""


@pytest.mark.slow
def test_signal_interrupts_a_command(rover: Path) -> None:
    """While a part is built, its worker ends as well."""
    text = (rover / "parts/shapes.py").read_text()
    slow = "class Slow(Boom):\n    def result(self):\n        time.sleep(300)\n"
    (rover / "parts/shapes.py").write_text(f"{text}\n\nimport time\n\n\n{slow}")
    (rover / "slow.yaml").write_text("thingc: assembly/1\nname: slow\ncomponents: {a: {part: shapes:Slow}}\n")
    request = {"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {
        "protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "t", "version": "1"},
    }}
    call = {"jsonrpc": "2.0", "id": 2, "method": "tools/call", "params": {"name": "check", "arguments": {"documents": ["slow.yaml"]}}}
    words = [sys.executable, "-P", "-m", "thingc", "mcp", "--trusted"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdin is not None and process.stdout is not None
        for message in (request, {"jsonrpc": "2.0", "method": "notifications/initialized"}, call):
            process.stdin.write(json.dumps(message).encode() + b"\n")
        process.stdin.flush()
        assert json.loads(process.stdout.readline())["id"] == 1

        def running() -> list[psutil.Process]:
            children = psutil.Process(process.pid).children(recursive=True)
            return [child for child in children if "thingc.geometry.worker.server" in child.cmdline()]

        wait_until(running, 60.0)
        workers = running()
        assert workers != []
        process.send_signal(signal.SIGTERM)
        assert process.wait(20.0) == 130
        assert psutil.wait_procs(workers, timeout=20.0)[1] == []


def test_missing_extra_is_reported(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["mcp"]) == 2
    told = capsys.readouterr().err
    assert "`thingc mcp` requires the package `mcp`" in told and "pip install 'thingc[mcp]'" in told


@pytest.mark.slow
def test_skill_is_valid(rover: Path) -> None:
    """Its document has no diagnostics, its commands and options exist, and new workspaces contain it."""
    text = SKILL.read_text()
    assert files_of("arm", "my_robot")[".claude/skills/thingc/SKILL.md"].decode() == text
    head = YAML(typ="safe").load(text.split("---")[1])
    assert head["name"] == "thingc" and len(head["description"]) < 1024
    document = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)[0]
    (rover / "my_robot.yaml").write_text(document)
    assert codes(called("check", {"documents": ["my_robot.yaml"], "strict": True})) == []
    commands = set(re.findall(r"`thingc (\w+)", text))
    assert commands <= COMMANDS.keys() and {"check", "explain", "info", "parts", "render", "set", "add"} <= commands
    for command in sorted(commands):
        options = {word for line in re.findall(rf"`thingc\s+{command}([^`]*)`", text) for word in re.findall(r"--[a-z-]+", line)}
        from thingc.tools.cli.main import parser_for

        parser = parser_for(command)[1]
        assert parser is not None and options <= {word for action in parser._actions for word in action.option_strings}, command


def test_extra_is_declared() -> None:
    import tomllib

    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert extras["mcp"][0].startswith("mcp>=") and extras["mcp"][0] in extras["dev"]
    assert shutil.which("thingc", path=os.path.dirname(sys.executable)) is not None
