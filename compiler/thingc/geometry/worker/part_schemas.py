"""Describe part classes in a child of the worker: their parameters and other facts that do not require building a part."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Collection, Sequence
from typing import Any

from thingc.geometry.record import ParameterSchema, PartSchema
from thingc.geometry.record_json import to_json
from thingc.geometry.things.inspection import actuator_of, code_location, lacking_result, parameters_of, syntax_of
from thingc.geometry.worker.kernel import convert
from thingc.geometry.worker.part_session import NoPart, PartSession, RequestContext, kind_of


def describe(references: Sequence[str], placed: Collection[str], context: RequestContext) -> dict[str, Any]:
    """Return the schemas or failures of part classes in one module: `{"answers": {reference: ...}, "reads": [...]}`.

    The locations of the classes in `placed` are already known. The classes in `placed` are not searched, because the search is slow.
    """
    answers: dict[str, Any] = {}
    mentioned: list[str | None] = []
    with PartSession(context) as session:
        for reference in references:
            try:
                schema = _schema(session, reference, placed=reference in placed)
                answers[reference] = {"schema": to_json(schema, context.root)}
            except BaseException as fault:
                failure = session.failure(reference, fault)
                mentioned.append(failure.file)
                answers[reference] = {"failure": to_json(failure, context.root)}
        session.stop()
        return {"answers": answers, "reads": session.reads(*mentioned)}


def _schema(session: PartSession, reference: str, *, placed: bool) -> PartSchema:
    part = session.part(reference)
    kind = kind_of(part, reference)
    parameters = tuple(_parameter(parameter) for parameter in parameters_of(part))
    if (fault := lacking_result(part)) is not None:
        message, place = fault
        raise NoPart("resultless", f"`{reference}` {message}", place=place)
    file, line = ("", 1) if placed else _code_location(part, kind)
    return PartSchema(
        reference=reference, kind=kind, doc=inspect.cleandoc(part.__doc__ or ""), parameters=parameters,
        material=_default_material(part), actuator=actuator_of(part) is not None, file=file, line=line,
    )


def _code_location(part: Any, kind: str) -> tuple[str, int]:
    """Return the file and the line where a class or function is defined."""
    if (place := code_location(part)) is not None:
        return place
    code = inspect.unwrap(part.__init__).__code__ if kind == "thing" and hasattr(part.__init__, "__code__") else None
    return (code.co_filename, code.co_firstlineno) if code is not None else ("", 1)


def _default_material(part: Any) -> str | None:
    """Return the material that a class passes to `super().__init__(material="petg")`. The material is read from the source code of the
    class.

    Return None if the argument is not a literal. The part record, in contrast, always contains the material.
    """
    for family in getattr(part, "__mro__", ()):
        if "__init__" not in vars(family) or family.__module__.startswith(("thingc.", "build123d.")):
            continue
        tree = syntax_of(vars(family)["__init__"])
        if tree is None:
            return None
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "__init__":
                value = next((keyword.value for keyword in node.keywords if keyword.arg == "material"), None)
                if value is not None:
                    return value.value if isinstance(value, ast.Constant) and isinstance(value.value, str) else None
    return None


def _parameter(parameter: Any) -> ParameterSchema:
    kind = parameter.kind
    minimum, maximum = (None if bound is None else convert.to_si(kind, bound) for bound in (parameter.minimum, parameter.maximum))
    return ParameterSchema(
        name=parameter.name, kind=kind, required=parameter.required,
        default=None if parameter.required else convert.to_si(kind, parameter.default),
        minimum=minimum, maximum=maximum,  # type: ignore[arg-type]
        choices=tuple(convert.to_si(kind, choice) for choice in parameter.choices), doc=parameter.doc or "",
    )
