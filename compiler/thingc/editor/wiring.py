"""Tells editors which schema belongs to which document: VS Code for YAML, Taplo for TOML. What else these files say stays."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Sequence

from thingc.diagnostics import Code, Report
from thingc.editor import folder, jsonc
from thingc.load import Source

VSCODE = ".vscode/settings.json"
TAPLO = ".taplo.toml"
YAML_SCHEMAS = "yaml.schemas"
BEGIN = "# >>> written by `thingc schema`"
END = "# <<< written by `thingc schema`"


def wire(root: str, documents: Sequence[str], report: Report) -> list[str]:
    """Name the schemas of these documents (paths in the workspace) in the settings of editors; the files that were written.

    A file that cannot be understood is left alone, and that is reported. Raises OSError where one cannot be written.
    """
    yaml = sorted(name for name in documents if not name.endswith(".toml"))
    toml = sorted(name for name in documents if name.endswith(".toml"))
    return [name for name, done in ((VSCODE, _vscode(root, yaml, report)), (TAPLO, _taplo(root, toml, report))) if done]


def pattern_of(document: str, others: Sequence[str]) -> str | list[str]:
    """What means this document and none of the others: a pattern of an editor fits the end of a path."""
    longer = [other for other in others if other.endswith(f"/{document}")]
    return [document, *(f"!{other}" for other in longer)] if longer else document


def _vscode(root: str, documents: Sequence[str], report: Report) -> bool:
    path = os.path.join(root, VSCODE)
    text = _text(path, report)
    if text is None:
        return False
    ours = {f"./{folder.schema_path(name)}": pattern_of(name, documents) for name in documents}
    try:
        known = jsonc.read(text).plain if text.strip("\ufeff \t\r\n") else {}
        merged = jsonc.with_members(text, YAML_SCHEMAS, ours) if ours else text
        stale = [key for key in known.get(YAML_SCHEMAS, {}) if folder.SCHEMAS in key and key not in ours]
        merged = jsonc.without_members(merged, YAML_SCHEMAS, stale)
    except jsonc.NotJson as fault:
        source = Source(path, text)
        report.add(
            Code.EDITOR_SETTINGS, f"`{VSCODE}` is no JSON with comments, and is left as it is: {fault}",
            source.span(fault.offset, fault.offset + 1), help="mend it, or use --no-wire and name the schemas there yourself",
        )
        return False
    return merged != text and folder.write_text(path, merged)


def _taplo(root: str, documents: Sequence[str], report: Report) -> bool:
    path = os.path.join(root, TAPLO)
    text = _text(path, report)
    if text is None:
        return False
    before, begin, rest = text.partition(BEGIN)
    mine, end, after = rest.partition(END)
    if begin and not end:
        before, after = text, ""
    block = "".join(
        f"\n[[rule]]\ninclude = [{_quoted(name)}]\n\n[rule.schema]\nenabled = true\n"
        f"path = {_quoted('./' + folder.schema_path(name))}\n" for name in documents
    )
    block = f"{BEGIN}\n{block}\n{END}" if documents else ""
    if begin and end:
        merged = f"{before}{block}{after}" if block else before.rstrip("\n") + "\n" * bool(before.strip()) + after.lstrip("\n")
    elif block:
        merged = f"{text.rstrip()}\n\n{block}\n" if text.strip() else f"{block}\n"
    else:
        return False
    try:
        tomllib.loads(text.removeprefix("\ufeff"))
        tomllib.loads(merged.removeprefix("\ufeff"))
    except tomllib.TOMLDecodeError as fault:
        place = Source(path, text).span(0, 0)
        report.add(
            Code.EDITOR_SETTINGS, f"`{TAPLO}` is no TOML, and is left as it is: {str(fault)[0].lower()}{str(fault)[1:]}", place,
            help="mend it, or use --no-wire and name the schemas there yourself",
        )
        return False
    return folder.write_text(path, merged)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _text(path: str, report: Report) -> str | None:
    """The text of a file, empty where there is none; None where it is no text, which is reported."""
    try:
        with open(path, encoding="utf-8", newline="") as stream:
            return stream.read()
    except FileNotFoundError:
        return ""
    except UnicodeDecodeError:
        report.add(Code.NOT_UTF8, f"`{os.path.basename(path)}` is not UTF-8 text, and is left as it is", None)
        return None
