"""The key `allow` of documents, by which a user suppresses warnings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from thingc.base.diagnostics import Allowance, Code
from thingc.base.source import Document, Node, Path, Span, node_at
from thingc.base.suggestions import did_you_mean
from thingc.base.units import shorten
from thingc.documents.spec.fields import FieldValidator, describe, fault

if TYPE_CHECKING:
    from thingc.documents.spec.assembly import AssemblySpec

_BY_CODE = {code.code: code for code in Code}

ALLOWABLE = {code.code: code.title for code in Code if code.warned_by is not None}
"""Codes of all warnings that can be suppressed, with their titles."""


def _warning_code(value: Any) -> str:
    """Validate the diagnostic code of a suppressed warning."""
    if not isinstance(value, str):
        raise fault("type", f"expected the code of a warning such as `TC407`, found {describe(value)}")
    if value in ALLOWABLE:
        return value
    if value in _BY_CODE:
        raise fault("choice", f"`allow` cannot suppress `{value}`", help=f"run `thingc explain {value}` for details")
    raise fault("choice", f"unknown warning code `{shorten(value)}`", help=did_you_mean(value, ALLOWABLE, what="warnings"))


def _reason(value: Any) -> str:
    """Validate the reason for suppressing a warning."""
    if isinstance(value, str) and value.strip():
        return value
    raise fault("type", f"expected a reason, found {describe(value)}", help="explain why the warning does not apply")


_REASON_SCHEMA = {"type": "string", "pattern": r"\S"}

Allow = dict[
    Annotated[str, FieldValidator(_warning_code, "the code of a warning", {"type": "string", "examples": ["TC407"]})],
    Annotated[str, FieldValidator(_reason, "a reason", _REASON_SCHEMA)],
]


def allow() -> Any:
    """Return the pydantic field `allow`, whose JSON Schema lists all possible codes with their titles."""
    return Field(default={}, examples=[{"TC407": "the idler carries no rotor"}], json_schema_extra={
        "properties": {code: {**_REASON_SCHEMA, "description": f"{title}."} for code, title in ALLOWABLE.items()},
        "additionalProperties": False,
    })


def allowances(spec: AssemblySpec, document: Document) -> Iterator[Allowance]:
    """Yield all entries of the key `allow` in a document: of the document itself, its components, its joints and its modes.

    An entry of a mode also suppresses the warning in all modes that extend this mode.
    """
    yield from _allowances_of(spec.allow, document, (), [()])
    for name, component in spec.components.items():
        yield from _allowances_of(component.allow, document, ("components", name))
    for name, joint in spec.joints.items():
        yield from _allowances_of(joint.allow, document, ("joints", name))
    extending: dict[str, list[str]] = {}
    for name, mode in spec.modes.items():
        if mode.extends is not None:
            extending.setdefault(mode.extends, []).append(name)
    for name, mode in spec.modes.items():
        if mode.allow:
            covered: list[Path] = [("modes", extending_mode) for extending_mode in _with_extending_modes(extending, name)]
            yield from _allowances_of(mode.allow, document, ("modes", name), covered)


def _allowances_of(entries: Mapping[str, str], document: Document, path: Path, covered: list[Path] | None = None) -> Iterator[Allowance]:
    """Yield the entries of the mapping `allow` of the element at `path`.

    The entries suppress warnings at the paths `covered`, by default only at `path`.
    """
    for code, reason in entries.items():
        yield Allowance(
            code=_BY_CODE[code], reason=reason, where=document.span((*path, "allow", code), key=True), path=".".join(map(str, path)),
            nodes=tuple(_location_of(document, element_path) for element_path in (covered or [path])),
        )


def _location_of(document: Document, path: Path) -> tuple[Span, Node]:
    node = node_at(document.tree, path)
    assert node is not None, path
    return (document.span(path, key=True) if path else node.span), node


def _with_extending_modes(extending: Mapping[str, list[str]], name: str) -> list[str]:
    """Return a mode and all modes that extend it, directly or indirectly. `extending` maps a mode to the modes that extend it directly."""
    modes = {name: None}
    stack = [name]
    while stack:
        for extending_mode in extending.get(stack.pop(), ()):
            if extending_mode not in modes:
                modes[extending_mode] = None
                stack.append(extending_mode)
    return list(modes)
