"""Read the parameters of a part from the signature of its `__init__` or function, and convert the arguments of a call to canonical values.
"""

from __future__ import annotations

import inspect
import re
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Union

from thingc.geometry.things import parameters as vocabulary
from thingc.geometry.things.parameters import CallError, Kind, Parameter, ParameterError, Range, SignatureError, Value, suggestion

_GOOGLE = re.compile(r"\*{0,2}(\w+)\s*(?:\([^)]*\))?\s*:\s*(.*)$")
_NUMPY = re.compile(r"\*{0,2}(\w+)\s*(?::.*)?$")
_REST_FIELD = re.compile(r":param\s+(?:[^:]*\s)?(\w+)\s*:\s*(.*)$")


def argument_docs(docstring: str | None) -> dict[str, str]:
    """Parse the descriptions of arguments in a docstring, as one line of text for each argument name.

    The result is empty if the docstring does not describe arguments.
    """
    if not docstring:
        return {}
    lines = inspect.cleandoc(docstring).split("\n")
    texts: dict[str, list[str]] = {}
    for start, line in enumerate(lines):
        if line.strip() in ("Args:", "Arguments:", "Parameters:"):
            _parse_indented(lines[start + 1:], texts)
        elif line.strip() == "Parameters" and start + 1 < len(lines) and re.fullmatch(r"-{3,}", lines[start + 1].strip()):
            _parse_numpy(lines[start + 2:], texts)
    if ":param" in docstring:
        _parse_rest(lines, texts)
    return {name: " ".join(" ".join(parts).split()) for name, parts in texts.items()}


def _parse_indented(lines: list[str], texts: dict[str, list[str]]) -> None:
    """Parse an `Args:` section in Google style. The entries have the same indentation, and continuation lines are indented more deeply.

    The section ends at the first line with less indentation.
    """
    indent: int | None = None
    entry: list[str] | None = None
    for line in lines:
        if not line.strip():
            continue
        depth = len(line) - len(line.lstrip())
        if indent is None:
            indent = depth
        if depth < indent or depth == 0:
            return
        match = _GOOGLE.match(line.strip()) if depth == indent else None
        if match:
            entry = texts.setdefault(match.group(1), [])
            entry.append(match.group(2))
        elif entry is not None:
            entry.append(line.strip())


def _parse_numpy(lines: list[str], texts: dict[str, list[str]]) -> None:
    """Parse a parameter section in numpy style. The names are not indented, and the descriptions are indented. The section ends at the next
    underlined heading.
    """
    entries: list[list[str]] = []
    for number, line in enumerate(lines):
        if not line.strip():
            continue
        if line[0].isspace():
            for entry in entries:
                entry.append(line.strip())
            continue
        following = lines[number + 1].strip() if number + 1 < len(lines) else ""
        if re.fullmatch(r"-{3,}", following):
            return
        names = line.split(":", 1)[0]
        entries = [texts.setdefault(name.strip().lstrip("*"), []) for name in names.split(",") if _NUMPY.match(name.strip())]


def _parse_rest(lines: list[str], texts: dict[str, list[str]]) -> None:
    """Parse reST fields such as `:param x: text`. Continuation lines are indented."""
    entry: list[str] | None = None
    for line in lines:
        match = _REST_FIELD.match(line.strip())
        if match:
            entry = texts.setdefault(match.group(1), [])
            entry.append(match.group(2))
        elif line.strip().startswith(":") or not line.strip() or not line[0].isspace():
            entry = None
        elif entry is not None:
            entry.append(line.strip())


_PLAIN = {float: "number", int: "integer", bool: "flag", str: "text"}
_KNOWN = {name: getattr(vocabulary, name) for name in ("Length", "Angle", "Mass", "Count", "Ratio", "Range")}


@dataclass(frozen=True, slots=True, kw_only=True)
class Signature:
    """The parameters of a class or function, in the order of their declaration. `owner` is the name of the class or function.

    The first `positional` parameters can be passed as positional arguments.
    """

    owner: str
    parameters: tuple[Parameter, ...]
    positional: int

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the parameters in the order of their declaration."""
        return tuple(parameter.name for parameter in self.parameters)

    def get(self, name: str) -> Parameter | None:
        """Return the parameter with the given name, or None if there is no such parameter."""
        return next((parameter for parameter in self.parameters if parameter.name == name), None)

    def bind(self, args: Sequence[object], kwargs: Mapping[str, object]) -> dict[str, Value]:
        """Convert the arguments of a call to canonical values for all parameters, in the order of the signature.

        Raises `CallError` if an argument is missing, repeated or unknown, or if there are too many arguments. Raises `ParameterError` for
        an invalid value.
        """
        if len(args) > self.positional:
            raise self._error(
                f"`{self.owner}` expects {self.positional} positional argument{'' if self.positional == 1 else 's'}, found {len(args)}",
                self.names[0] if self.parameters else "",
            )
        given = dict(zip(self.names, args))
        for name, value in kwargs.items():
            if name not in self.names:
                raise self._error(f"`{self.owner}` has no parameter `{name}`{suggestion(name, self.names)}", name)
            if name in given:
                raise self._error(f"`{name}` of `{self.owner}` is given twice", name)
            given[name] = value
        values: dict[str, Value] = {}
        for parameter in self.parameters:
            if parameter.name in given:
                values[parameter.name] = parameter.canonical(given[parameter.name], self.owner)
            elif parameter.default is None:
                raise self._error(f"`{self.owner}` needs `{parameter.name}`, {parameter.noun}", parameter.name)
            else:
                values[parameter.name] = parameter.default
        return values

    def _error(self, message: str, name: str) -> CallError:
        return CallError(message, owner=self.owner, parameter=name)


_on_read: Callable[[Callable[..., Any]], None] | None = None


def install(look: Callable[[Callable[..., Any]], None]) -> None:
    """Make `signature_of` call `look` with every function whose parameters it reads.

    The geometry worker calls `install` before it loads part modules.
    """
    global _on_read
    _on_read = look


def signature_of(function: Callable[..., Any], owner: str, *, method: bool, strict: bool, docs: Sequence[str | None] = ()) -> Signature:
    """Read the parameters of a function from its signature. If the function is a method, its first argument is skipped.

    If `strict` is True (for a Thing), every argument must be a parameter, or `SignatureError` is raised. If `strict` is False (for a
    build123d class or a plain function), the result omits `*args`, `**kwargs`, and arguments with a default that cannot be parameters.
    `docs` contains docstrings that may describe the arguments. If several docstrings describe the same argument, the last docstring takes
    precedence.
    """
    if _on_read is not None:
        _on_read(function)
    described: dict[str, str] = {}
    for docstring in docs:
        described |= argument_docs(docstring)
    arguments = list(inspect.signature(function).parameters.values())[1 if method else 0:]
    parameters: list[Parameter] = []
    positional = 0
    for argument in arguments:
        try:
            parameters.append(_parameter(function, argument, owner, described.get(argument.name, "")))
        except SignatureError:
            starred = argument.kind in (argument.VAR_POSITIONAL, argument.VAR_KEYWORD)
            if strict or (argument.default is argument.empty and not starred):
                raise
            continue
        positional += argument.kind is argument.POSITIONAL_OR_KEYWORD and positional == len(parameters) - 1
    return Signature(owner=owner, parameters=tuple(parameters), positional=positional)


def _parameter(function: Callable[..., Any], argument: inspect.Parameter, owner: str, doc: str) -> Parameter:
    """Convert an argument of a function to a parameter, and check its default.

    Raises `SignatureError` if the argument cannot be a parameter.
    """
    where = f"`{argument.name}` of `{owner}`"
    if argument.kind in (argument.VAR_POSITIONAL, argument.VAR_KEYWORD, argument.POSITIONAL_ONLY):
        stars = "*" * (argument.kind is argument.VAR_POSITIONAL) or "**" * (argument.kind is argument.VAR_KEYWORD)
        reason = "write each parameter separately" if stars else "remove the `/`"
        raise SignatureError(f"`{stars}{argument.name}` of `{owner}` cannot be a parameter: {reason}")
    required = argument.default is argument.empty
    if argument.annotation is argument.empty:
        kind = _kind_of_default(argument.default, where)
        minimum = maximum = None
        choices: tuple[Value, ...] = ()
    else:
        try:
            annotation = annotation_of(function, argument.annotation)
        except SignatureError as error:
            raise SignatureError(f"{where} cannot be a parameter: {error}") from None
        shown = argument.annotation if isinstance(argument.annotation, str) else inspect.formatannotation(annotation)
        kind, minimum, maximum, choices = _kind_of_annotation(annotation, where, shown)
    parameter = Parameter(
        name=argument.name, kind=kind, required=required, default=None,
        minimum=minimum, maximum=maximum, choices=choices, doc=doc,
    )
    if required:
        return parameter
    try:
        default = parameter.canonical(argument.default, owner)
    except ParameterError as error:
        raise SignatureError(f"the default of {error}") from None
    return replace(parameter, default=default)


def _kind_of_default(default: object, where: str) -> str:
    """Return the kind of a parameter that has no annotation.

    The default value determines the kind: number, text or flag. An argument without annotation and without default is a number.
    """
    if isinstance(default, bool):
        return "flag"
    if default is inspect.Parameter.empty or isinstance(default, (int, float)):
        return "number"
    if isinstance(default, str):
        return "text"
    raise SignatureError(f"the default of {where} must be a number, a string or a boolean, found {default!r}")


def annotation_of(function: Callable[..., Any], annotation: object) -> Any:
    """Return the annotation of an argument as an object.

    If the annotation is a string (`from __future__ import annotations`), it is evaluated in the module of the function. The annotation can
    use `Length`, `Angle` and similar names even if the module imports them only for type checkers. Raises `SignatureError` if the string is
    not a valid expression.
    """
    if not isinstance(annotation, str):
        return annotation
    inner = inspect.unwrap(function)
    scope = _KNOWN | getattr(inner, "__globals__", {})
    cells = getattr(inner, "__closure__", None) or ()
    for name, cell in zip(inner.__code__.co_freevars if cells else (), cells):
        try:
            scope[name] = cell.cell_contents
        except ValueError:  # a variable of the enclosing function that has no value yet
            continue
    while isinstance(annotation, str):
        try:
            annotation = eval(annotation, scope)  # the author's own annotation, in the author's own module
        except Exception as error:
            raise SignatureError(f"invalid annotation `{annotation}`: {error}") from None
    return annotation


def _kind_of_annotation(annotation: Any, where: str, text: str) -> tuple[str, float | None, float | None, tuple[Value, ...]]:
    """Read the kind, the minimum, the maximum and the choices of a parameter from its annotation.

    The bounds of nested `Annotated` types are combined.
    """
    annotation = getattr(annotation, "__value__", annotation)
    markers: tuple[object, ...] = ()
    while typing.get_origin(annotation) is Annotated:
        markers = (*annotation.__metadata__, *markers)
        annotation = annotation.__origin__
    origin = typing.get_origin(annotation)
    choices: tuple[Value, ...] = ()
    if origin is Literal:
        kind = "choice"
        choices = typing.get_args(annotation)
        if not all(isinstance(choice, (str, int)) for choice in choices):
            raise SignatureError(f"the choices of {where} must be strings, integers or booleans")
    elif origin in (Union, types.UnionType) and set(typing.get_args(annotation)) == {int, float}:
        kind = "number"
    elif isinstance(annotation, type) and annotation in _PLAIN:
        kind = _PLAIN[annotation]
    else:
        kinds = "Length, Angle, Mass, Count, Ratio, float, int, bool, str or Literal[...]"
        raise SignatureError(f"the annotation of {where} must be {kinds}, found `{text}`")
    for mark in markers:
        if isinstance(mark, Kind):
            kind = mark.kind
    ranges = [mark for mark in markers if isinstance(mark, Range)]
    if ranges and kind not in vocabulary.NUMERIC:
        raise SignatureError(f"the Range of {where} requires a number, found {vocabulary.NOUNS.get(kind, 'a choice')}")
    minimum = max((mark.minimum for mark in ranges if mark.minimum is not None), default=None)
    maximum = min((mark.maximum for mark in ranges if mark.maximum is not None), default=None)
    return kind, minimum, maximum, choices
