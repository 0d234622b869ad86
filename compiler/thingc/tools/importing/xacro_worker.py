"""Expand a xacro file in a sandboxed process.

xacro evaluates Python expressions in the file, so xacro runs in a sandboxed child process. The child process can write only to a temporary
folder, read only the robot's folder and known packages, and cannot run programs. When the child process ends, all its subprocesses end,
too. Before xacro reads a file, this module adds an attribute with the source location to every element. Macros copy this attribute to the
output.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import sys
from collections.abc import Mapping, Sequence
from typing import Any
from xml.parsers import expat

from thingc.geometry.worker import children, process_tree, sandbox
from thingc.geometry.worker.scratch import Scratch
from thingc.tools.importing.packages import NotFound, Packages, within
from thingc.tools.importing.xml_source import MARK, utf8_of

BYTES = 2_000_000_000
FILE_BYTES = 1_000_000
"""Maximum size [bytes] of a temporary file, including the file with xacro's messages."""


def main() -> int:
    """Read a request as one line of JSON from standard input, expand the xacro file, and print the response as one line of JSON.

    The request contains `path`, `packages`, `arguments`, `seconds` (CPU time), and `timeout` [s]. The response contains `text`, `files` and
    `packages`, or an error `fault` with its `file` and `line`. If the child process ended early, the response contains the reason in
    `failed`.
    """
    request = json.loads(sys.stdin.readline())
    packages = Packages(request["path"], request["packages"], os.environ)
    readable = [*filter(os.path.isdir, (*packages.readable(), *sys.path, sys.prefix, sys.base_prefix, "/lib", "/lib64", "/usr/lib"))]
    process_tree.adopt_orphans()
    scratch = Scratch()
    child = children.fork_child(_expand, 0, scratch.make(), scratch.descriptors, readable)
    child.ask({**request, "id": 0, "readable": readable})
    answer = child.wait()
    scratch.close()
    invalid = {"failed": "crashed", "message": "an invalid answer"}
    print(json.dumps(answer if is_plausible(answer, [request["path"], *readable]) else invalid))
    return 0


def is_plausible(answer: Mapping[str, Any], readable: Sequence[str]) -> bool:
    """Return whether the xacro file may read all files that the response of the child process contains.

    thingc later reads these files outside the sandbox, and code in the xacro file may have forged the response.
    """
    files = [*answer.get("files", ()), *filter(None, [answer.get("file")])]
    return all(os.path.isfile(one) and any(within(one, folder) for folder in readable) for one in files)


def _expand(request: Mapping[str, Any]) -> dict[str, Any]:
    """Expand the xacro file of a request in the sandboxed child process."""
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (request["seconds"], request["seconds"]))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES))
    sandbox.begin(request["scratch"], request["readable"])
    return _Expanding(request["path"], request["packages"]).expand(request["arguments"])


class _Expanding:
    def __init__(self, path: str, packages: dict[str, str]) -> None:
        self.path, self.packages = path, Packages(path, packages, os.environ)
        self.files: list[str] = []
        self.found: dict[str, str] = {}

    def expand(self, arguments: dict[str, str]) -> dict[str, object]:
        """Expand the xacro file, and return the response for the parent process."""
        import xacro
        from xacro import substitution_args

        substitution_args._eval_find = substitution_args._eval_dict["find"] = self._find
        xacro.parse = self._parse
        try:
            xacro.init_stacks(self.path)
            document = self._parse(None, self.path)
            xacro.process_doc(document, mappings=arguments, verbosity=0)
            return {"text": document.documentElement.toxml(), "files": self.files, "packages": self.found}
        except expat.ExpatError as fault:
            return {"fault": f"invalid XML: {expat.ErrorString(fault.code)}", "file": self.files[-1], "line": fault.lineno}
        except MemoryError:
            return {"fault": "the file requires too much memory", "file": self.path, "line": 1}
        except RecursionError:
            return {"fault": "the file has infinite recursion", "file": self.path, "line": 1}
        except Exception as fault:  # expressions can raise any exception
            message, root = str(fault), fault
            while isinstance(getattr(root, "exc", None), Exception):
                root = root.exc  # type: ignore[attr-defined]
            if isinstance(root, OSError):
                message = str(fault.args[0] or f"`{root.filename}`: {(root.strerror or str(root)).lower()}")
            elif message.startswith("<class"):
                message = str(root if root is not fault else fault.args[0])
            message = " ".join((message if str(root) else f"{type(root).__name__} {message}").split())
            top = next((one for one in reversed(xacro.filestack or []) if one), self.path)
            file, line = self._place(os.path.abspath(top), message)
            return {"fault": message, "file": file, "line": line}

    def _place(self, top: str, message: str) -> tuple[str, int]:
        """Return the file and the line to report for an error message of xacro.

        The result is the line with the first occurrence of an expression or name in the message, or the first line of the file `top`.
        """
        quoted = sorted({one or other for one, other in re.findall(r"'([^']+)'|`([^`]+)`", message)}, key=len, reverse=True)
        texts = {}
        for file in dict.fromkeys([top, *self.files]):
            with contextlib.suppress(OSError), open(file, encoding="utf-8", errors="replace") as stream:
                texts[file] = stream.read().split("\n")
        for wanted in (*(f"${{{one}}}" for one in quoted), *quoted, *map(os.path.basename, quoted)):
            for file, lines in texts.items():
                for number, line in enumerate(lines, 1):
                    if wanted and wanted in line:
                        return file, number
        return top, 1

    def _find(self, name: str) -> str:
        """Evaluate the xacro expression `$(find NAME)`."""
        try:
            self.found[name] = self.packages.package(name)
        except NotFound as fault:
            raise ValueError(f"{fault}; {fault.help}" if fault.help else str(fault)) from None
        return self.found[name]

    def _parse(self, text: object, filename: str) -> Any:
        """Parse an XML file as `xacro.parse` does, and add an attribute with the source location to each element."""
        from xml.dom import minidom

        import xacro

        path = os.path.abspath(filename)
        try:
            with open(path, "rb") as stream:
                data = utf8_of(stream.read())
        except OSError as fault:
            xacro.filestack.pop()
            raise xacro.XacroException(f"cannot read `{filename}`: {(fault.strerror or str(fault)).lower()}", exc=fault) from None
        self.files.append(path)
        number, parts, at = len(self.files) - 1, list[bytes](), 0
        parser = expat.ParserCreate()
        parser.StartElementHandler = lambda tag, _: begun.append(
            (tag, parser.CurrentByteIndex, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1),
        )
        begun: list[tuple[str, int, int, int]] = []
        parser.Parse(data, True)
        for tag, start, line, column in begun:
            if not tag.startswith("xacro:"):
                end = start + 1 + len(tag.encode())
                parts += [data[at:end], f' {MARK}="{number}:{line}:{column}:{start}"'.encode()]
                at = end
        return minidom.parseString(b"".join([*parts, data[at:]]))


if __name__ == "__main__":
    sys.exit(main())
