"""Construct Things. This module checks the arguments, returns the same object for equal parameters, and makes each object immutable after
`__init__`.

`__init__` runs only once for each set of parameters. The metaclass intercepts the call of a Thing class before an object is created.
Therefore, it can return an existing object with equal parameters, and it can check arguments before geometry is created. The metaclass also
wraps the `__init__` of each class, so that the parameters of parent classes are recorded.
"""

from __future__ import annotations

import contextvars
import functools
import inspect
from abc import ABCMeta
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

from thingc.geometry.things.mounts import MountPoint, settle
from thingc.geometry.things.parameters import Value, suggestion
from thingc.geometry.things.signature import Signature, signature_of

if TYPE_CHECKING:
    from thingc.geometry.things.thing import Thing

Adjustments: TypeAlias = "Mapping[type[Any], Mapping[str, Value]]"
"""For each ancestor class, the parameters that `adjust` changed although a subclass sets them."""

_things: dict[tuple[object, ...], Thing] = {}
_under_construction: set[tuple[object, ...]] = set()
_files: list[str] = []
"""The source files of the `__init__` methods that are running, the innermost last."""


@dataclass(slots=True, kw_only=True)
class InitCall:
    """A recorded call of `__init__` during the construction of a Thing.

    The object contains the arguments of the call, and the adjusted `values` that `__init__` received.
    """

    family: type[Any]
    given: dict[str, Value]
    values: dict[str, Value]


@dataclass(slots=True, kw_only=True)
class Construction:
    """The state of a Thing's construction.

    `calls` contains the calls of `__init__`, beginning with the class's own `__init__`. `running` contains the calls that have not returned
    yet. The innermost call is the last item. `finished` is set when the Thing becomes immutable. `mounts` contains the mounts by exported
    name, and is filled at the end.
    """

    parameters: dict[str, Value]
    adjustments: Adjustments
    calls: list[InitCall] = field(default_factory=list)
    running: list[InitCall] = field(default_factory=list)
    finished: bool = False
    material: str | None = None
    color: str | None = None
    mounts: dict[str, MountPoint] = field(default_factory=dict)

    def scopes(self) -> Iterator[Mapping[str, Value]]:
        """Yield the sets of parameters in which `self.p` looks up a name.

        If an `__init__` is running, its parameters come first. The parameters of the class itself come next, and then the parameters of its
        parent classes.
        """
        if self.running:
            yield self.running[-1].values
        yield self.parameters
        for call in self.calls:
            yield call.values


class Parameters:
    """The parameters of a Thing as attributes, such as `self.p.length`, in the units of part code.

    The parameters include parameters of a parent class that a subclass sets. While an `__init__` runs, its own arguments take precedence
    over other parameters of the same name. Afterwards, the class's own parameters take precedence. Raises `AttributeError` if no parameter
    has this name.
    """

    __slots__ = ("_construction", "_owner")

    def __init__(self, owner: str, construction: Construction) -> None:
        self._owner = owner
        self._construction = construction

    def __getattr__(self, name: str) -> Any:
        """Return the value of the parameter `name`."""
        for scope in self._construction.scopes():
            if name in scope:
                return scope[name]
        raise AttributeError(f"`{self._owner}` has no parameter `{name}`{suggestion(name, self.__dir__())}")

    def __dir__(self) -> list[str]:
        """Return the names of the parameters, beginning with the parameters of the class itself."""
        return list(dict.fromkeys(name for scope in self._construction.scopes() for name in scope))

    def __repr__(self) -> str:
        return f"Parameters({', '.join(f'{name}={getattr(self, name)!r}' for name in self.__dir__())})"


class ThingType(ABCMeta):
    """The metaclass of all Thing classes."""

    def __init__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **kwargs: Any) -> None:
        super().__init__(name, bases, namespace, **kwargs)
        init = namespace.get("__init__")
        if any(isinstance(base, ThingType) for base in bases) and inspect.isfunction(init):
            cls.__init__ = _record_calls(cls, init)  # type: ignore[misc]

    if not TYPE_CHECKING:  # type checkers take the signature from `__init__`

        def __call__(cls, *args: object, **kwargs: object) -> Thing:
            """Return the Thing of this class with the given parameters. The first call creates the Thing, and later calls return the same
            object.
            """
            return make(cls, family_signature(cls).bind(args, kwargs), {})


def make(cls: type[Any], parameters: dict[str, Value], adjustments: Adjustments) -> Thing:
    """Return the Thing of class `cls` with the given parameters and adjustments. If the Thing does not exist yet, it is created.

    If `__init__` raises an exception, the function raises the same exception and does not cache a Thing. A Thing depends only on its
    parameters. Therefore, geometry that `__init__` creates is not added to a build123d builder that is active during the call.
    """
    adjusted = tuple((family, name, value) for family in cls.__mro__ for name, value in sorted(adjustments.get(family, {}).items()))
    key = (cls, tuple((name, type(value), value) for name, value in parameters.items()), adjusted)
    if key in _things:
        return _things[key]
    if key in _under_construction:
        raise RecursionError(f"`{format_thing(cls, parameters)}` depends on itself")
    _under_construction.add(key)
    try:
        thing = _construct(cls, parameters, adjustments)
    finally:
        _under_construction.discard(key)
    _things[key] = thing
    return thing


def _construct(cls: type[Any], parameters: dict[str, Value], adjustments: Adjustments) -> Thing:
    thing: Thing = cls.__new__(cls)  # type: ignore[call-overload]
    construction = Construction(parameters=parameters, adjustments=adjustments)
    object.__setattr__(thing, "_construction", construction)
    init: Callable[..., None] = cls.__init__
    contextvars.Context().run(functools.partial(init, thing, **parameters))
    for name, value in list(vars(thing).items()):
        if not name.startswith("_"):
            settled = settle(thing, name, value, construction.mounts)
            if settled is not value:
                object.__setattr__(thing, name, settled)
    construction.finished = True
    return thing


def create_thing(cls: type[Any], parameters: dict[str, Value], **attributes: object) -> Thing:
    """Create a finished Thing of class `cls` with the given parameters and attributes. The Thing is not cached, and `__init__` does not
    run.
    """
    thing: Thing = cls.__new__(cls)  # type: ignore[call-overload]
    object.__setattr__(thing, "_construction", Construction(parameters=parameters, adjustments={}, finished=True))
    for name, value in attributes.items():
        object.__setattr__(thing, name, value)
    return thing


def family_signature(cls: type[Any]) -> Signature:
    """Return the parameters of a Thing class. Raises `SignatureError` if an argument of `__init__` cannot be a parameter."""
    signature = cls.__dict__.get("_signature")
    if isinstance(signature, Signature):
        return signature
    init: Callable[..., Any] = cls.__init__
    if getattr(init, "_base_of_all_things", False):
        signature = Signature(owner=cls.__name__, parameters=(), positional=0)
    else:
        docs = (*(base.__doc__ for base in reversed(cls.__mro__)), init.__doc__)
        signature = signature_of(init, cls.__name__, method=True, strict=True, docs=docs)
    cls._signature = signature
    return signature


def _record_calls(cls: type[Any], init: Callable[..., None]) -> Callable[..., None]:
    """Wrap `init` of the class `cls`. The wrapper checks and records the arguments, and calls `init` with the adjusted values."""

    @functools.wraps(init)
    def construct(self: Thing, *args: object, **kwargs: object) -> None:
        construction = self._construction
        if construction.finished:
            raise AttributeError(f"`{cls.__name__}` is immutable: `__init__` cannot be called again")
        arguments = family_signature(cls).bind(args, kwargs)
        call = InitCall(family=cls, given=arguments, values={**arguments, **construction.adjustments.get(cls, {})})
        construction.calls.append(call)
        construction.running.append(call)
        _files.append(getattr(getattr(inspect.unwrap(init), "__code__", None), "co_filename", ""))
        try:
            init(self, **call.values)
        finally:
            _files.pop()
            construction.running.pop()

    return construct


def running_file() -> str | None:
    """Return the source file of the innermost `__init__` of a Thing that is currently running, or None."""
    return _files[-1] if _files else None


def format_thing(cls: type, parameters: Mapping[str, Value]) -> str:
    """Format a Thing as a call of its class, for example as `PenDummy(length=100.0, diameter=15.0)`."""
    return f"{cls.__name__}({', '.join(f'{name}={value!r}' for name, value in parameters.items())})"
