"""`dataclass` as the standard library has it, for frozen data with slots, in a third of the time.

A check makes a hundred and fifty such classes. The standard library compiles six functions for each, which altogether takes longer than
the passes that hand this data on. Here one is compiled, `__init__`; the others are the same functions for every class.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(*, frozen: bool, slots: bool, kw_only: bool = False, eq: bool = True) -> Callable[[type], type]:
        """`dataclasses.dataclass(frozen=True, slots=True, ...)`; without `InitVar`, and a field is compared and hashed, or neither."""
        assert frozen and slots, "the standard library has the others"

        def made(cls: type) -> type:
            cls = dataclasses.dataclass(init=False, repr=False, eq=False, slots=True, kw_only=kw_only)(cls)
            fields = dataclasses.fields(cls)
            methods = {**_SHARED, "__init__": _init(cls, fields, kw_only)}
            if cls.__repr__ is object.__repr__:
                methods["__repr__"] = _repr
            if eq:
                methods |= _comparing([one.name for one in fields if one.compare])
            for name, method in methods.items():
                if cls.__dict__.get(name) is None:
                    setattr(cls, name, method)
            return cls

        return made


def _init(cls: type, fields: Sequence[dataclasses.Field[Any]], kw_only: bool) -> Any:
    """The constructor, compiled from its text."""
    known: dict[str, Any] = {"_set": object.__setattr__, "_absent": dataclasses.MISSING}
    parameters, lines = (["self", "*"] if kw_only and any(one.init for one in fields) else ["self"]), []
    for one in fields:
        default, value = f"_of_{one.name}", one.name
        if one.default is not dataclasses.MISSING:
            known[default] = one.default
            parameter, otherwise = f"{value}={default}", default
        elif one.default_factory is not dataclasses.MISSING:
            known[default] = one.default_factory
            parameter, otherwise = f"{value}=_absent", f"{default}()"
            value = f"{otherwise} if {value} is _absent else {value}"
        else:
            parameter, otherwise = value, ""
        if one.init:
            parameters.append(parameter)
        if one.init or otherwise:
            lines.append(f"_set(self, {one.name!r}, {value if one.init else otherwise})")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    exec(f"def __init__({', '.join(parameters)}):\n " + "\n ".join(lines or ["pass"]), known)
    constructor = known["__init__"]
    constructor.__qualname__ = f"{cls.__qualname__}.__init__"
    return constructor


def _comparing(names: Sequence[str]) -> Mapping[str, Callable[..., Any]]:
    """Equality and hash of the values of these fields."""
    together: Callable[[Any], Any] = attrgetter(*names) if names else lambda _: ()

    def equal(self: object, other: object) -> bool:
        return together(self) == together(other) if other.__class__ is self.__class__ else NotImplemented

    def hashed(self: object) -> int:
        return hash(together(self) if len(names) != 1 else (together(self),))

    return {"__eq__": equal, "__hash__": hashed}


def _fixed(self: object, name: str, *value: object) -> NoReturn:
    raise dataclasses.FrozenInstanceError(f"cannot {'assign to' if value else 'delete'} field {name!r}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, one.name) for one in dataclasses.fields(self)]


def _restore(self: Any, state: Sequence[Any]) -> None:
    for one, value in zip(dataclasses.fields(self), state):
        object.__setattr__(self, one.name, value)


def _repr(self: Any) -> str:
    shown = (f"{one.name}={getattr(self, one.name)!r}" for one in dataclasses.fields(self) if one.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


_SHARED: Mapping[str, Callable[..., Any]] = {
    "__setattr__": _fixed, "__delattr__": _fixed, "__getstate__": _state, "__setstate__": _restore,
}
