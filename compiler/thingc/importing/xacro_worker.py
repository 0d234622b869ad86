"""A process that expands one xacro file, and ends: xacro evaluates Python, so it does that within bounds and where it can write no file.

Every element of a file carries its place as an attribute before xacro sees it; macros copy it with the element, so that what comes out says
where each element was written.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import resource
import sys
from typing import Any
from xml.parsers import expat

from thingc.importing.packages import NotFound, Packages
from thingc.importing.xml_source import MARK, utf8_of

BYTES = 2_000_000_000


def main() -> int:
    """From a line of JSON (`path`, `packages`, `arguments`, `seconds` of the processor at most) to one: `text`, `files` and `packages` that
    were found; or a `fault` with its `file` and `line`."""
    asked = json.loads(sys.stdin.readline())
    resource.setrlimit(resource.RLIMIT_CPU, (asked["seconds"], asked["seconds"]))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    answer, sys.stdout = sys.stdout, sys.stderr
    print(json.dumps(_Expanding(asked["path"], asked["packages"]).expanded(asked["arguments"])), file=answer)
    return 0


class _Expanding:
    def __init__(self, path: str, packages: dict[str, str]) -> None:
        self.path, self.packages = path, Packages(path, packages, os.environ)
        self.files: list[str] = []
        self.found: dict[str, str] = {}

    def expanded(self, arguments: dict[str, str]) -> dict[str, object]:
        """The answer."""
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
            return {"fault": f"this is no well-formed XML: {expat.ErrorString(fault.code)}", "file": self.files[-1], "line": fault.lineno}
        except MemoryError:
            return {"fault": "it takes too much memory", "file": self.path, "line": 1}
        except RecursionError:
            return {"fault": "it calls itself without an end", "file": self.path, "line": 1}
        except Exception as fault:  # whatever expressions of others raise
            said, root = str(fault), fault
            while isinstance(getattr(root, "exc", None), Exception):
                root = root.exc  # type: ignore[attr-defined]
            if said.startswith("<class") or isinstance(root, OSError):
                said = str(root) if root is not fault and not isinstance(root, OSError) else str(fault.args[0])
            said = " ".join((said if str(root) else f"{type(root).__name__} {said}").split())
            top = next((one for one in reversed(xacro.filestack or []) if one), self.path)
            file, line = self._place(os.path.abspath(top), said)
            return {"fault": said, "file": file, "line": line}

    def _place(self, top: str, said: str) -> tuple[str, int]:
        """The file and line in which an expression, or a name, stands first that the message quotes; the first line of `top`, the file that
        is being expanded, where there is none."""
        quoted = sorted({one or other for one, other in re.findall(r"'([^']+)'|`([^`]+)`", said)}, key=len, reverse=True)
        files = list(dict.fromkeys([top, *self.files]))
        texts = {}
        for file in files:
            with contextlib.suppress(OSError), open(file, encoding="utf-8", errors="replace") as stream:
                texts[file] = stream.read().split("\n")
        for wanted in (*(f"${{{one}}}" for one in quoted), *quoted, *map(os.path.basename, quoted)):
            for file, lines in texts.items():
                for number, line in enumerate(lines, 1):
                    if wanted and wanted in line:
                        return file, number
        return top, 1

    def _find(self, name: str) -> str:
        """`$(find NAME)`."""
        try:
            self.found[name] = self.packages.package(name)
        except NotFound as fault:
            raise ValueError(f"{fault}; {fault.help}" if fault.help else str(fault)) from None
        return self.found[name]

    def _parse(self, text: object, filename: str) -> Any:
        """As `xacro.parse` does it, with the places."""
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
