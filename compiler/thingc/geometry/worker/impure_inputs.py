"""Record the impure inputs of a part: the environment, the clock, random numbers, other processes and the network.

A part is built once and cached. Therefore, the record always contains the value that an impure input had in the first build. Processes and
network connections are detected by audit events. For other inputs, Python functions are wrapped once per worker, before part code is
loaded. An input is reported at the line of the author's code that causes it. The nearest stack frame outside of installed packages must be
in the author's code. Inputs that Python itself needs are not recorded, for example for an import, a log record or the name of a temporary
file.
"""

from __future__ import annotations

import builtins
import contextlib
import datetime
import functools
import importlib.abc
import importlib.machinery
import math
import os
import random
import sys
import time
import types
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import FrameType
from typing import Any

from thingc.geometry.key.modules import OWN_FOLDER, installed_roots
from thingc.geometry.record import ImpureInputs, PartWarning
from thingc.geometry.worker import audit

MACHINERY = frozenset({"importlib", "logging", "tempfile", "threading", "warnings"})
"""Modules of Python whose impure inputs do not affect a part."""


class ImpureInputRecorder:
    """Records the impure inputs of one part, from `start` to `stop`.

    The function `is_own` returns whether a file contains code of the part's authors.
    """

    def __init__(self, is_own: Callable[[str], bool]) -> None:
        self._is_own = is_own
        self._skipped = (*installed_roots(), os.path.join(OWN_FOLDER, ""), "<")
        self._found: dict[PartWarning, None] = {}
        self.seeded: set[str] = set()

    @property
    def found(self) -> tuple[PartWarning, ...]:
        """Return the recorded impure inputs in the order of their use. An input that is used several times on the same line occurs once."""
        return tuple(self._found)

    def start(self) -> None:
        """Begin to record the impure inputs."""
        global _current
        _current = self

    def stop(self) -> None:
        """Stop all recording."""
        global _current
        _current = None

    @contextlib.contextmanager
    def pause(self) -> Iterator[None]:
        """Return a context manager that stops the recording of impure inputs while it is active."""
        self.stop()
        try:
            yield
        finally:
            self.start()

    def note(self, what: ImpureInputs, message: str, frame: FrameType | None) -> bool:
        """Record the use of an impure input in the stack frame `frame`. Return False if the use is not caused by part code."""
        while frame is not None:
            file = frame.f_code.co_filename
            if self._is_own(file):
                self._found[PartWarning(message=message, file=file, line=frame.f_lineno, asked=what)] = None
                return True
            if str(frame.f_globals.get("__name__")).partition(".")[0] in MACHINERY or not file.startswith(self._skipped):
                return False
            frame = frame.f_back
        return False


_current: ImpureInputRecorder | None = None


def _note_use(what: ImpureInputs, message: str) -> bool:
    return _current is not None and _current.note(what, message, sys._getframe(2))


def install() -> None:
    """Wrap the functions of Python through which a part can use impure inputs.

    Call this function once per process, before part modules are loaded, because these modules may contain `from time import time`.
    Child processes inherit the wrapped functions.
    """
    _wrap_environment()
    _wrap_clock()
    _wrap_chance()
    sys.meta_path.insert(0, _NumpysRandom())
    audit.listen((*_PROCESSES, *_CONNECTIONS), _handle_event)


# --- processes and connections ----------------------------------------------------------------------------------------

_PROCESSES: dict[str, Callable[..., Any]] = {
    "os.exec": lambda path, *_: path,
    "os.fork": lambda *_: None,
    "os.forkpty": lambda *_: None,
    "os.posix_spawn": lambda path, *_: path,
    "os.spawn": lambda mode, path, *_: path,
    "os.system": lambda command: command,
    "pty.spawn": lambda words: words[0],
    "subprocess.Popen": lambda program, words, *_: program or (words if isinstance(words, (str, bytes)) else words[0]),
}
"""Functions that return the started program from the arguments of an audit event. The functions return None if the part started a copy of
its own process.
"""

_CONNECTIONS: dict[str, Callable[..., Any]] = {
    "socket.connect": lambda socket, address: address[0] if isinstance(address, tuple) else address,
    "socket.getaddrinfo": lambda host, *_: host,
    "socket.gethostbyname": lambda host: host,
}
"""Functions that return the network host from the arguments of an audit event."""


def _handle_event(event: str, arguments: tuple[Any, ...]) -> None:
    if _current is None:
        return
    if event in _PROCESSES:
        program = _PROCESSES[event](*arguments)
        named = "another program" if program is None else f"the program `{_name_text(program)}`"
        _note_use(ImpureInputs.PROCESS, f"starts {named}")
    else:
        host = _name_text(_CONNECTIONS[event](*arguments))
        _note_use(ImpureInputs.NETWORK, f"accesses the network host `{host}`")


def _name_text(name: Any) -> str:
    text = name if isinstance(name, str) else os.fsdecode(name) if isinstance(name, (bytes, os.PathLike)) else repr(name)
    return text if len(text) <= 60 else text[:57] + "..."


# --- the environment --------------------------------------------------------------------------------------------------


def _wrap_environment() -> None:
    family: Any = type(os.environ)
    original = family.__getitem__

    @functools.wraps(original)
    def getitem(self: Any, key: Any) -> Any:
        try:
            return original(self, key)
        except KeyError as fault:  # existing variables have fixed values, or the part itself set them
            name = _name_text(key)
            if _note_use(ImpureInputs.ENVIRONMENT, f"reads the environment variable `{name}`, which parts cannot use"):
                fault.add_note(f"the environment of parts does not contain `{name}`")
            raise

    family.__getitem__ = getitem


# --- the clock --------------------------------------------------------------------------------------------------------

_CLOCK = "reads the clock"
_DATE_METHODS = frozenset({"now", "today", "utcnow"})
_CLOCKS = {
    "time": 0, "time_ns": 0, "monotonic": 0, "monotonic_ns": 0, "perf_counter": 0, "perf_counter_ns": 0, "process_time": 0,
    "process_time_ns": 0, "thread_time": 0, "thread_time_ns": 0, "localtime": 0, "gmtime": 0, "ctime": 0, "asctime": 0, "strftime": 1,
    "clock_gettime": 1, "clock_gettime_ns": 1,
}
"""Functions of the module `time`, each with a maximum number of arguments. A call with at most this number of arguments reads the clock.
A call with more arguments converts a given time.
"""


def _wrap_clock() -> None:
    for name, count in _CLOCKS.items():
        if hasattr(time, name):
            setattr(time, name, _noting_use(getattr(time, name), ImpureInputs.CLOCK, _CLOCK, count))


def _noting_use(function: Callable[..., Any], what: ImpureInputs, message: str, most: float = math.inf) -> Callable[..., Any]:
    """Wrap a function so that calls with at most `most` positional arguments are recorded as the use of an impure input."""
    @functools.wraps(function)
    def noting(*arguments: Any, **options: Any) -> Any:
        if len(arguments) <= most:
            _note_use(what, message)
        return function(*arguments, **options)

    return noting


def builtins_for(code: types.CodeType) -> Mapping[str, Any] | None:
    """Return the builtins for a module that may read the clock through `datetime`. Return None if the module can use the normal builtins.

    The classes of `datetime` cannot be wrapped globally, because compiled packages refer to them directly. Instead, the `import` of such a
    module returns a module that replaces `datetime`.
    """
    return _builtins() if _names(code) else None


@functools.cache
def _names(code: types.CodeType) -> bool:
    return not _DATE_METHODS.isdisjoint(code.co_names) or any(_names(one) for one in code.co_consts if isinstance(one, types.CodeType))


@functools.cache
def _builtins() -> Mapping[str, Any]:
    wrapped_datetime = types.ModuleType("datetime", datetime.__doc__)
    wrapped_datetime.__dict__.update(vars(datetime))
    wrapped_datetime.date = _noting_clock(datetime.date, ("today",))  # type: ignore[attr-defined]
    wrapped_datetime.datetime = _noting_clock(datetime.datetime, ("now", "utcnow", "today"))  # type: ignore[attr-defined]

    def import_(*arguments: Any, **options: Any) -> Any:
        module = builtins.__import__(*arguments, **options)
        return wrapped_datetime if module is datetime else module

    return {**vars(builtins), "__import__": import_}


def _noting_clock(real: Any, names: Sequence[str]) -> type:
    """Return a class to replace `datetime.date` or `datetime.datetime`. `names` contains the methods that read the clock."""

    def new(cls: Any, *arguments: Any, **options: Any) -> Any:
        return real.__new__(real if cls is stand_in else cls, *arguments, **options)

    def noting(name: str) -> Any:
        def method(cls: Any, *arguments: Any, **options: Any) -> Any:
            _note_use(ImpureInputs.CLOCK, _CLOCK)
            return getattr(real if cls is stand_in else super(stand_in, cls), name)(*arguments, **options)

        return classmethod(functools.wraps(getattr(real, name))(method))

    stand_in = _stand_in(real, new, {name: noting(name) for name in names})
    return stand_in


def _stand_in(real: Any, new: Callable[..., Any], body: Mapping[str, Any]) -> type:
    """Create a class that replaces the class `real`.

    The function `new` creates the instances. Instances of `real` also count as instances of the new class.
    """

    class _ClockClass(type):
        def __instancecheck__(cls, value: Any) -> bool:
            return isinstance(value, real) if cls is stand_in else type.__instancecheck__(cls, value)

        def __subclasscheck__(cls, other: type) -> bool:
            return issubclass(other, real) if cls is stand_in else type.__subclasscheck__(cls, other)

    namespace = {"__new__": new, "__doc__": real.__doc__, "__module__": real.__module__, **body}
    stand_in: type = _ClockClass(real.__name__, (real,), namespace)
    return stand_in


# --- random numbers ---------------------------------------------------------------------------------------------------

_CHANCE = "uses random numbers without a seed"
_SEEDING = frozenset({"seed", "setstate", "set_state", "set_bit_generator"})
_STATE_READERS = frozenset({"getstate", "get_state", "get_bit_generator"})


def _wrap_chance() -> None:
    family: Any = random.Random
    original = family.seed

    def seed(self: random.Random, a: Any = None, version: int = 2) -> None:
        if a is None:
            _note_use(ImpureInputs.CHANCE, _CHANCE)
        original(self, a, version)

    family.seed = functools.wraps(original)(seed)
    generator = random._inst
    _wrap_global(random, lambda function: getattr(function, "__self__", None) is generator)
    # SystemRandom, `secrets` and numpy's generators without a seed call this function
    urandom = _noting_use(os.urandom, ImpureInputs.CHANCE, _CHANCE)
    for owner, name in ((os, "urandom"), (random, "_urandom")):
        setattr(owner, name, urandom)
    for owner, name in ((os, "getrandom"), (uuid, "uuid1"), (uuid, "getnode")):
        if hasattr(owner, name):
            setattr(owner, name, _noting_use(getattr(owner, name), ImpureInputs.CHANCE, _CHANCE))


def _wrap_global(module: types.ModuleType, of_global: Callable[[Any], bool]) -> None:
    """Wrap the functions of a module that use the module's global random number generator.

    Calls of these functions are recorded, unless the part has seeded the generator.
    """
    for name, function in list(vars(module).items()):
        if name not in _STATE_READERS and callable(function) and not isinstance(function, type) and of_global(function):
            setattr(module, name, _noting_unless_seeded(module.__name__, name, function))


def _noting_unless_seeded(module: str, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def global_(*arguments: Any, **options: Any) -> Any:
        if _current is not None:
            if name in _SEEDING and next(iter((*arguments, *options.values())), None) is not None:
                _current.seeded.add(module)
            elif module not in _current.seeded:
                _note_use(ImpureInputs.CHANCE, _CHANCE)
        return function(*arguments, **options)

    return global_


def _wrap_numpy(module: types.ModuleType) -> None:
    """Wrap the legacy random number generator of `numpy.random`.

    The function wraps three kinds of objects. The first kind are functions that draw numbers from the global generator. The second object
    is the global generator itself, which libraries use by default. The third object is the class of this generator, which draws a random
    seed even if the caller passes a seed.
    """
    mtrand = module.mtrand
    real = mtrand.RandomState
    functions = {id(value) for value in vars(mtrand).values()}
    _wrap_global(module, lambda function: id(function) in functions)

    def new(cls: Any, seed: Any = None) -> Any:
        if cls is not stand_in:
            return real.__new__(cls)
        with contextlib.nullcontext() if _current is None or seed is None else _current.pause():
            return real(seed)

    def look_up(self: Any, name: str) -> Any:
        attribute = real.__getattribute__(self, name)
        plain = name.startswith("_") or name in _STATE_READERS or not callable(attribute)
        return attribute if plain else _noting_unless_seeded(module.__name__, name, attribute)

    stand_in = _stand_in(real, new, {})
    watched = type(real.__name__, (real,), {"__getattribute__": look_up})
    module.RandomState = mtrand.RandomState = stand_in  # type: ignore[attr-defined]
    mtrand._rand = watched(mtrand._rand._bit_generator)


class _NumpysRandom(importlib.abc.MetaPathFinder):
    """An import hook that wraps the functions of `numpy.random` when a part first imports this module. The hook is used because most parts
    do not use `numpy.random`.
    """

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        """Return Python's own spec for `numpy.random`, with a loader that wraps the module. Return None for any other module."""
        if fullname != "numpy.random":
            return None
        sys.meta_path.remove(self)
        spec = importlib.machinery.PathFinder.find_spec(fullname, path)
        if spec is not None and spec.loader is not None:
            run = spec.loader.exec_module

            def exec_module(module: types.ModuleType) -> None:
                run(module)
                _wrap_numpy(module)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec
