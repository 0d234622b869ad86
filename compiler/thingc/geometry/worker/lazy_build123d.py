"""Make `import build123d` fast: packages that parts seldom need are imported when they are first used.

`import build123d` imports scikit-learn, scipy, ezdxf, lib3mf, svgpathtools and other packages, which are needed for functions that few
parts call. These imports take more than half of the time of `import build123d`, and 150 MB of memory. During `import build123d`, the names
of these packages are bound to placeholders. The first use of a placeholder imports the real package and replaces all its placeholders in
build123d by the real objects. Other code does not get placeholders. For example, `import scipy` in a part file imports the real package.
"""

from __future__ import annotations

import functools
import importlib
import importlib.abc
import importlib.machinery
import sys
import types
from collections.abc import Callable, Sequence
from typing import Any

from thingc.geometry.key.modules import SELDOM_USED


class _Session:
    """The state of an import in which some packages are deferred. The object contains the names of the deferred packages, and the places
    where their placeholders are stored.
    """

    def __init__(self, packages: frozenset[str]) -> None:
        self.packages = packages
        self.open = True
        self.settled: set[str] = set()
        self.sites: dict[str, list[Callable[[], None]]] = {}

    def settle(self, package: str) -> None:
        """Import `package`, and replace its placeholders at all recorded places."""
        if package in self.settled:
            return
        self.settled.add(package)
        importlib.import_module(package)
        for replace in self.sites.pop(package, []):
            replace()


class LazyObject:
    """A placeholder for an object of a package that is not imported yet.

    The placeholder passes calls, attributes, subclassing and `isinstance` to the real object.
    """

    __slots__ = ("_module", "_names", "_session")

    def __init__(self, session: _Session, module: str, names: tuple[str, ...]) -> None:
        object.__setattr__(self, "_session", session)
        object.__setattr__(self, "_module", module)
        object.__setattr__(self, "_names", names)

    def __getattr__(self, name: str) -> Any:
        if self._session.open:
            if name.startswith("__"):
                raise AttributeError(name)
            return LazyObject(self._session, self._module, (*self._names, name))
        return getattr(real(self), name)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Import the real object, and call it."""
        return real(self)(*args, **kwargs)

    def __mro_entries__(self, bases: tuple[Any, ...]) -> tuple[Any, ...]:
        return (real(self),)

    def __instancecheck__(self, instance: Any) -> bool:
        return isinstance(instance, real(self))

    def __subclasscheck__(self, subclass: Any) -> bool:
        return issubclass(subclass, real(self))

    def __getitem__(self, key: Any) -> Any:
        return self if self._session.open else real(self)[key]

    def __or__(self, other: Any) -> Any:
        return self if self._session.open else real(self) | other

    def __ror__(self, other: Any) -> Any:
        return self if self._session.open else other | real(self)

    def __repr__(self) -> str:
        return f"<{'.'.join((self._module, *self._names))}, not imported yet>"


class _LazyModule(types.ModuleType):
    """A module placeholder for a package that has not been imported."""

    _session: _Session

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") and self._session.open:
            raise AttributeError(name)
        lazy_object = LazyObject(self._session, self.__name__, (name,))
        return lazy_object if self._session.open else real(lazy_object)


def real(value: Any) -> Any:
    """If the value is a placeholder, import and return the real object. Return any other value unchanged."""
    if isinstance(value, _LazyModule):
        value._session.settle(value.__name__.partition(".")[0])
        return importlib.import_module(value.__name__)
    if type(value) is not LazyObject:
        return value
    value._session.settle(value._module.partition(".")[0])
    imported: Any = importlib.import_module(value._module)
    path = value._module
    for name in value._names:
        path = f"{path}.{name}"
        try:
            imported = getattr(imported, name)
        except AttributeError:
            imported = importlib.import_module(path)  # `from ezdxf import zoom`: a submodule
    return imported


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def __init__(self, session: _Session) -> None:
        self.session = session
        self.made: list[str] = []

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        """Return the spec of a placeholder for a deferred package, or None for other packages."""
        if fullname.partition(".")[0] not in self.session.packages:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, is_package=True)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> types.ModuleType:
        module = _LazyModule(spec.name)
        module._session = self.session
        self.made.append(spec.name)
        return module

    def exec_module(self, module: types.ModuleType) -> None:
        """Do nothing, because a placeholder module has no code."""


def import_cheaply(name: str, packages: frozenset[str] = SELDOM_USED) -> types.ModuleType:
    """Import module `name`, deferring `packages` until they are used.

    Packages that are already imported are unchanged. If the import fails, the function removes all modules of the failed import and imports
    `name` normally, which may raise the same exception.
    """
    absent = frozenset(package for package in packages if package not in sys.modules)
    session = _Session(absent)
    finder = _Finder(session)
    before = set(sys.modules)
    sys.meta_path.insert(0, finder)
    try:
        module = importlib.import_module(name)
        lazy_modules = {imported: sys.modules.pop(imported) for imported in finder.made if imported in sys.modules}
        _find_sites(session, [sys.modules[new] for new in sys.modules.keys() - before])
        del lazy_modules
        session.open = False
        return module
    except Exception:
        for new in sys.modules.keys() - before:
            if new in finder.made or not new.startswith("OCP"):  # an extension module cannot be loaded twice
                del sys.modules[new]
    finally:
        sys.meta_path.remove(finder)
    return importlib.import_module(name)


def _package(value: Any) -> str | None:
    if type(value) is LazyObject:
        return str(value._module.partition(".")[0])
    if type(value) is _LazyModule:
        return value.__name__.partition(".")[0]
    return None


def _find_sites(session: _Session, modules: Sequence[types.ModuleType]) -> None:
    """Record all places of placeholders in the given modules: module and class attributes, dicts, and default arguments."""
    for module in modules:
        names = vars(module)
        if not any(_package(value) for value in names.values()):
            continue
        for name, value in list(names.items()):
            _note(session, module, name, value, module.__name__)


def _note(session: _Session, owner: Any, name: str, value: Any, module: str) -> None:
    package = _package(value)
    if package is not None:
        session.sites.setdefault(package, []).append(lambda: setattr(owner, name, real(value)))
    elif isinstance(value, dict):
        for package_name in {_package(item) for pair in value.items() for item in pair} - {None}:
            session.sites.setdefault(str(package_name), []).append(lambda: _refill(value))
    elif isinstance(value, (list, tuple)):
        for package_name in {_package(item) for item in value} - {None}:
            session.sites.setdefault(str(package_name), []).append(lambda: setattr(owner, name, type(value)(real(item) for item in value)))
    elif isinstance(value, types.FunctionType):
        defaults = (*(value.__defaults__ or ()), *(value.__kwdefaults__ or {}).values())
        held_by_defaults = sorted({package for item in defaults if (package := _package(item))})
        if held_by_defaults and value.__module__ == module:
            setattr(owner, name, _settled_first(session, value, held_by_defaults))
    elif isinstance(value, type) and value.__module__ == module:
        for attribute, held_value in list(vars(value).items()):
            if not isinstance(held_value, type):
                _note(session, value, attribute, held_value, module)


def _refill(table: dict[Any, Any]) -> None:
    """Replace the placeholders among the keys and values of a dict in place. The order of the keys does not change."""
    entries = [(real(key), real(value)) for key, value in table.items()]
    table.clear()
    table.update(entries)


def _settled_first(session: _Session, function: types.FunctionType, packages: Sequence[str]) -> Callable[..., Any]:
    """Wrap `function` so that the placeholders among its default arguments are replaced before the call."""

    @functools.wraps(function)
    def settled(*args: Any, **kwargs: Any) -> Any:
        for package in packages:
            session.settle(package)
        if function.__defaults__:
            function.__defaults__ = tuple(real(value) for value in function.__defaults__)
        if function.__kwdefaults__:
            function.__kwdefaults__ = {name: real(value) for name, value in function.__kwdefaults__.items()}
        return function(*args, **kwargs)

    return settled
