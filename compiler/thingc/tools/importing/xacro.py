"""xacro made URDF, by a process of its own, with the place of every element in the files that it was written in."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

from thingc.base.diagnostics import Code, Report
from thingc.base.source import line_of
from thingc.base.suggestions import did_you_mean
from thingc.geometry.worker.sandbox import OUTSIDE
from thingc.tools.importing.xml_source import MOST_BYTES

SECONDS = 60
"""Of the processor, and five times as long by the clock."""
PATIENCE = 30.0
"""How much longer [s] to wait for the process that watches over this."""
_ARGUMENTS = tuple(map(re.compile, (r"<xacro:arg\s[^>]*?\bname\s*=\s*[\"']([^\"']+)", r"\$\(arg\s+([^\s)]+)", r"\barg\([\"']([^\"']+)")))
"""How a file says that it has an argument, and uses it."""


def expanded(path: str, arguments: Mapping[str, str], packages: Mapping[str, str], report: Report) -> tuple[bytes, list[str]] | None:
    """The URDF of a xacro file, an absolute path, with `arguments` for its `$(arg NAME)`, whose elements are marked with their places in
    the files that come with it; None where it cannot be expanded, which has been reported. `packages` are folders by name."""
    if find_spec("xacro") is None:
        report.add(
            Code.COMMAND_LINE, "xacro is a language of its own, which is read with another package", None,
            help=f"pip install 'thingc[import]'; or write `xacro {path} > robot.urdf`, and import that",
        )
        return None
    limits = {"seconds": SECONDS, "timeout": 5.0 * SECONDS}
    asked = json.dumps({"path": path, "packages": dict(packages), "arguments": dict(arguments), **limits})
    command = [sys.executable, "-P", "-m", "thingc.tools.importing.xacro_worker"]
    try:
        done = subprocess.run(command, input=f"{asked}\n", capture_output=True, text=True, timeout=5.0 * SECONDS + PATIENCE)
        answer = json.loads(done.stdout)
    except (subprocess.TimeoutExpired, ValueError):
        answer = {"failed": "crashed", "words": "the process ended"}
    fault = answer.get("fault")
    if "failed" in answer:
        how = answer["words"] or f"it took longer than {5 * SECONDS} s"
        fault = f"xacro ended without an answer ({how}); it has {SECONDS} s and 2 GB"
    elif answer.get("left"):
        fault = "its expressions start processes that go on when it is expanded"
    text = "" if fault is not None else _by_packages(answer["text"], answer["packages"])
    if fault is None and len(text) > MOST_BYTES:
        fault = f"it becomes more than {MOST_BYTES:,} bytes of URDF"
    if fault is not None:
        where = line_of(answer.get("file", path), answer.get("line", 1))
        help = "`--package NAME=DIR` allows to read a folder" if OUTSIDE in fault else "`$(arg NAME)` is given with `--arg NAME=VALUE`"
        report.add(Code.SOURCE_XML, f"xacro cannot expand this: {fault}", where, help=help)
        return None
    return (text.encode(), answer["files"]) if _are_known(arguments, answer["files"], report) else None


def _are_known(arguments: Mapping[str, str], files: Sequence[str], report: Report) -> bool:
    """Whether the files have each of the arguments; xacro passes over others, which are reported. What YAML uses that is loaded, nobody
    knows."""
    texts = [Path(file).read_text(encoding="utf-8", errors="replace") for file in files]
    if any("load_yaml" in text for text in texts):
        return True
    known = {name for text in texts for pattern in _ARGUMENTS for name in pattern.findall(text)}
    for name in (one for one in arguments if one not in known):
        help = did_you_mean(name, sorted(known), what="arguments") or "leave it out"
        report.add(Code.COMMAND_LINE, f"--arg {name}: the file has no such argument", None, help=help)
    return known >= arguments.keys()


def _by_packages(text: str, folders: Mapping[str, str]) -> str:
    """What `$(find NAME)` has become is `package://NAME` again: no path of this machine stands in what is written."""
    for name, folder in sorted(folders.items(), key=lambda one: -len(one[1])):
        for before in ("file://", ""):
            text = text.replace(f'"{before}{folder}/', f'"package://{name}/')
    return text
