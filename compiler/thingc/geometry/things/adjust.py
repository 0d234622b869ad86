"""Change parameters of a Thing, including parameters of a parent class that a subclass sets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from thingc.geometry.things.construction import InitCall, family_signature, make
from thingc.geometry.things.parameters import NUMERIC, CallError, Parameter, Value, suggestion
from thingc.geometry.things.signature import Signature

if TYPE_CHECKING:
    from thingc.geometry.things.thing import Thing

Change = tuple[str, object]
"""An adjustment of a parameter: the operation (`set | add | mul`) and its operand."""


def adjust_thing(thing: Thing, changes: Mapping[str, object]) -> Thing:
    """Return a Thing of the same class with changed parameters.

    The name of a parameter is first searched in the class itself, and then in its parent classes, nearest first. If the parameter belongs
    to a parent class, the parent's `__init__` gets the changed value instead of the value that the subclass passes. The changed value is
    also used in later adjustments. The operations `__add` and `__mul` start from the value that the subclass passes after its own changes.
    """
    cls, construction = type(thing), thing._construction
    signature = family_signature(cls)
    parameters: dict[str, Value] = dict(construction.parameters)
    parent_changes: list[tuple[type, Parameter, Change]] = []
    changed: set[str] = set()
    for key, value in changes.items():
        family, parameter, operation = _target(thing, signature, key)
        if parameter.name in changed:
            message = f"`{parameter.name}` of `{cls.__name__}` is changed twice"
            raise CallError(message, owner=cls.__name__, parameter=parameter.name)
        changed.add(parameter.name)
        if family is cls:
            parameters[parameter.name] = _apply_change(parameter, (operation, value), parameters[parameter.name], cls.__name__)
        else:
            parent_changes.append((family, parameter, (operation, value)))
    adjustments = {family: dict(values) for family, values in construction.adjustments.items()}
    if not parent_changes:
        return make(cls, parameters, adjustments)
    base = thing if parameters == construction.parameters else make(cls, parameters, adjustments)
    for family, parameter, change in parent_changes:
        call = next((call for call in _parents(base) if call.family is family), None)
        if call is None:
            message = f"`{cls.__name__}` does not call the `__init__` method that accepts `{parameter.name}`"
            raise CallError(message, owner=cls.__name__, parameter=parameter.name)
        value = _apply_change(parameter, change, call.values[parameter.name], cls.__name__)
        values = adjustments.setdefault(family, {})
        if value == call.given[parameter.name]:
            values.pop(parameter.name, None)
        else:
            values[parameter.name] = value
    return make(cls, parameters, {family: values for family, values in adjustments.items() if values})


def _target(thing: Thing, signature: Signature, key: str) -> tuple[type, Parameter, str]:
    """Return the class whose parameter is changed by `key` (`width`, `width__add` or `width__mul`), the parameter, and the operation."""
    cls = type(thing)
    families: list[tuple[type, Signature]] = [(cls, signature)]
    families.extend((call.family, family_signature(call.family)) for call in _parents(thing))
    names = [key]
    for operation in ("add", "mul"):
        if key.endswith(f"__{operation}"):
            names.append(key.removesuffix(f"__{operation}"))
    for name in names:
        for family, known in families:
            parameter = known.get(name)
            if parameter is not None:
                return family, parameter, "set" if name == key else key[-3:]
    every = dict.fromkeys(name for _, known in families for name in known.names)
    raise CallError(
        f"`{cls.__name__}` has no parameter `{names[-1]}`{suggestion(names[-1], every)}", owner=cls.__name__, parameter=names[-1]
    )


def _parents(thing: Thing) -> list[InitCall]:
    """Return the recorded calls of the `__init__` methods of parent classes. The call of the class's own `__init__` is omitted."""
    return thing._construction.calls[1:]


def _apply_change(parameter: Parameter, change: Change, current: Value, owner: str) -> Value:
    """Apply a change to the current value of a parameter, and return the new value in canonical form.

    Raises `ParameterError` if the parameter does not accept the value.
    """
    operation, value = change
    if operation == "set":
        return parameter.canonical(value, owner)
    amount = Parameter(name=f"{parameter.name}__{operation}", kind="number", required=True, default=None)
    if parameter.kind not in NUMERIC:
        raise amount.error(f"requires a number, but `{parameter.name}` is {parameter.noun}", owner)
    number, start = float(amount.canonical(value, owner)), float(current)
    return parameter.canonical(start + number if operation == "add" else start * number, owner)
