"""The MCP server. The server exchanges messages of the Model Context Protocol (MCP) with an assistant over standard input and output.

Each public method of `Tools` is a tool. A tool runs a command of thingc in this process, and its result is the JSON output of the command.
The package mcp derives the parameters of a tool from the signature of the method. To add a tool, write a method and add the method to
`create_server`. Tools are coroutines without `await`, so that they run one at a time in the main thread, which receives signals.
"""

from __future__ import annotations

import base64
import inspect
import io
import json
import os
import sys
import tempfile
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import redirect_stdout
from typing import Any, Literal

from mcp.server.mcpserver import MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp.types import CallToolResult, ImageContent, TextContent, ToolAnnotations

from thingc.base.diagnostics import Code
from thingc.base.suggestions import did_you_mean
from thingc.tools.cli import console, signals
from thingc.tools.cli.main import main

INSTRUCTIONS = """\
thingc compiles documents (YAML or TOML) and Python parts to robots. Paths are relative to the folder of the server; files outside it are
refused. After every change of a document, use `check`. To understand a code such as TC302, use `explain`. Write values with units, such as
`120 mm`.
"""
PATHS = frozenset({"to", "workspace"})
"""The options whose values are paths."""


class Tools:
    """The tools of the server. They use the files in the working folder.

    If the folder is not trusted, no code of the workspace runs: parts are read from `parts.lock.json`. `options` are options of all
    commands that use parts, such as `--store=DIR`. The function `run` runs a command and returns the exit code.
    """

    def __init__(self, *, trusted: bool, options: Sequence[str] = (), run: Callable[[list[str]], int] = main) -> None:
        self._folder = os.path.realpath(os.getcwd())
        self._trusted = trusted
        self._options = options
        self._run_command = run

    async def check(self, documents: list[str] | None = None, strict: bool = False) -> CallToolResult:
        """Report all errors and warnings of documents, with their lines, help and fixes. The default is all documents of the folder.

        A document is an assembly, materials or variants document (YAML or TOML), a robot file (.urdf, .xacro, .sdf, .xml), or a folder.
        """
        return self._run("check", {"strict": strict}, paths=documents or ["."])

    async def info(self, document: str, parameters: dict[str, str] | None = None) -> CallToolResult:
        """Return the masses, links, joints and modes of a robot in SI units, and the source of each mass.

        `parameters` sets parameters of the document for this call only, for example {"reach": "120 mm"}.
        """
        return self._run("info", {"parameter": parameters}, paths=[document])

    async def explain(self, code: str) -> CallToolResult:
        """Explain a diagnostic code such as TC302, with a wrong and a right example."""
        return self._run("explain", {}, words=[code])

    async def parts(self, part: list[str] | None = None, workspace: str = ".") -> CallToolResult:
        """List the available parts. With `part`, also list their parameters, mounts and reference geometry.

        `part` contains names of parts, modules or packages, such as `thingc_stock.servos:MG90S` or `thingc_stock.servos`.
        """
        result = self._run("parts", {"workspace": workspace}, words=part or [])
        if part:
            return result
        data: dict[str, Any] = result.structured_content
        brief = [{"reference": one["reference"], "doc": one["doc"].partition("\n")[0]} for one in data.get("parts", ())]
        return _result({**data, "parts": brief}, failed=result.is_error is True)

    async def render(
        self, document: str, mode: str | None = None, pose: str | None = None, azimuth: float | None = None, elevation: float | None = None,
        mounts_of: list[str] | None = None, joints: bool = False,
    ) -> CallToolResult:
        """Render a picture of a robot in a mode and a pose, by default the first mode in its start pose.

        `azimuth` [deg] is the view direction: 0 along x, 90 along y. A negative `elevation` [deg] looks down. `mounts_of` draws all mounts
        of the given components (x red, y green, z blue), and `joints` draws the joint axes.
        """
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "robot.png")
            view = {"azimuth": azimuth, "elevation": elevation, "mounts_of": mounts_of, "joints": joints}
            result = self._run("render", {"output": path, "mode": mode, "pose": pose, **view}, paths=[document])
            if not result.is_error:
                with open(path, "rb") as stream:
                    picture = base64.b64encode(stream.read()).decode()
                result.content.append(ImageContent(type="image", data=picture, mime_type="image/png"))
        return result

    async def set_values(self, document: str, values: dict[str, str], preview: bool = False) -> CallToolResult:
        """Set values in a document. Comments and layout are preserved. If the document would have errors, nothing is written.

        `values` maps paths of values, or names of parameters, to new values, for example {"reach": "120 mm", "joints.elbow.limit.upper":
        "90 deg", "components.foot.part": "feet:Wide"}. With `preview`, the values are checked, but not written.
        """
        return self._run("set", {"diff": preview}, paths=[document], words=[f"{path}={value}" for path, value in values.items()])

    async def add(
        self, what: Literal["part", "assembly", "mode", "joint", "test"], name: str, to: str | None = None, on: str | None = None,
        by: str | None = None, at: str | None = None, component: str | None = None, param: dict[str, str] | None = None, new: bool = False,
        root: str | None = None, base: str | None = None, standing_on: list[str] | None = None, pose: str | None = None,
        gravity: str | None = None, type: str | None = None, parent: str | None = None, child: str | None = None, loop: bool = False,
        kind: str | None = None,
    ) -> CallToolResult:
        """Add an element to the document `to`. If the document would then have errors, nothing is written.

        - part: `name` is `module:Class`, or the name of a class to create. The new component `component` is attached by its mount `by` to
          the mount `on`, such as `base.top`, or placed at the frame `at`. `param` sets parameters. `new` creates a class in any case.
        - assembly: `name` is the name of a nested document, existing or new. The other arguments are those of a part.
        - mode: `root` is a component or a mount, and `base` is fixed, held or free. `standing_on` lists mounts on the floor. `gravity` is
          wall, ceiling or three accelerations.
        - joint: `type` (default: revolute) between the mounts `parent` and `child`. `loop` closes a loop instead of placing the child.
        - test: `kind` is the kind of the test, such as mass.
        """
        given = {key: value for key, value in locals().items() if key not in ("self", "what", "name", "component")}
        return self._run("add", {**given, "name": component}, words=[what, name], inside=[name])

    def _run(
        self, command: str, given: Mapping[str, Any], *, paths: Sequence[str] = (), words: Sequence[str] = (), inside: Sequence[str] = (),
    ) -> CallToolResult:
        """Run a command and return its JSON output. `given` contains options, and `paths` and `words` are arguments of the command.

        The paths in `paths`, `inside` and the options `PATHS` must be in the folder.
        """
        with redirect_stdout(io.StringIO()) as printed:
            try:
                for path in inside:
                    self._relative(path)
                options = [*self._code(command), *self._to_words(given), *(self._options if command != "explain" else ())]
                code = self._run_command([command, "--format=json", *options, "--", *map(self._relative, paths), *words])
            except console.WrongCommandLine as fault:
                console.print_found([fault.diagnostic], "json", stream=sys.stdout, debug=False)
                code = console.USAGE
        return _result(json.loads(printed.getvalue()), failed=code == console.USAGE or code != 0 and command != "check")

    def _code(self, command: str) -> list[str]:
        """Return the option that forbids to run code of the workspace, if the folder is not trusted. Raises `WrongCommandLine`."""
        if self._trusted or command == "explain":
            return []
        if command == "render":
            message = "`render` requires a trusted folder"
            raise console.WrongCommandLine(message, "start the server with --trusted")
        return ["--no-code"]

    def _to_words(self, settings: Mapping[str, Any]) -> list[str]:
        """Convert options to words of a command line, for example `{"mounts_of": ["hand"]}` to `--mounts-of=hand`."""
        words = list[str]()
        for name, value in settings.items():
            option = f"--{name.replace('_', '-')}"
            if isinstance(value, Mapping):
                words += [f"{option}={key}={one}" for key, one in value.items()]
            elif isinstance(value, list):
                words += [f"{option}={one}" for one in value]
            elif isinstance(value, bool) or value is None:
                words += [option] if value else []
            else:
                words.append(f"{option}={self._relative(value) if name in PATHS else value}")
        return words

    def _relative(self, path: str) -> str:
        """Return the path relative to the folder. Raises `WrongCommandLine` if the path is outside the folder, also through a link."""
        if "\0" in path:
            raise console.WrongCommandLine("a path contains the character U+0000", "remove the character")
        inside = os.path.relpath(os.path.realpath(os.path.join(self._folder, path)), self._folder)
        if inside.split(os.sep)[0] == os.pardir:
            message = f"`{path}` is outside the folder of the server (`{self._folder}`)"
            raise console.WrongCommandLine(message, "use a file in the folder of the server", Code.OUTSIDE_WORKSPACE)
        return inside


def _result(data: dict[str, Any], *, failed: bool) -> CallToolResult:
    text = json.dumps(data, ensure_ascii=False)
    return CallToolResult(content=[TextContent(type="text", text=text)], structured_content=data, is_error=failed)


class _Server(MCPServer):
    """A server that refuses unknown arguments. The class `MCPServer` ignores such arguments."""

    async def call_tool(self, name: str, arguments: dict[str, Any], context: Any = None) -> Any:
        """Call a tool. Raises `ToolError` for an argument that the tool does not have."""
        known = next((tool.input_schema["properties"] for tool in await self.list_tools() if tool.name == name), arguments)
        for word in arguments.keys() - known.keys():
            raise ToolError(f"`{name}` has no argument `{word}`: {did_you_mean(word, known, what='arguments')}")
        return await super().call_tool(name, arguments, context)


def create_server(tools: Tools) -> MCPServer:
    """Create the server, with five tools that read and two that write."""
    from thingc import __version__

    server = _Server("thingc", instructions=INSTRUCTIONS, version=__version__, log_level="CRITICAL")
    read: list[Callable[..., Awaitable[CallToolResult]]] = [tools.check, tools.info, tools.explain, tools.parts, tools.render]
    for tool in (*read, tools.set_values, tools.add):
        hints = ToolAnnotations(read_only_hint=tool in read, destructive_hint=False, open_world_hint=False)
        server.add_tool(tool, tool.__name__.removesuffix("_values"), description=inspect.getdoc(tool), annotations=hints)
    return server


def serve(*, trusted: bool, options: Sequence[str]) -> None:
    """Run the server until the assistant disconnects. A signal interrupts the current command, and ends the process."""
    signals.leave_at_once()
    create_server(Tools(trusted=trusted, options=options, run=_run_interruptible)).run()


def _run_interruptible(words: list[str]) -> int:
    signals.install_handlers()
    code = main(words)
    if code == signals.INTERRUPTED:
        os._exit(code)
    signals.leave_at_once()
    return code
