"""Find modules by name in the part folders of the workspace, in packages tracked by content, and in the rest of the environment.

The client reads part files without importing them, whereas the worker imports part files. Both processes use this module, so that a name
refers to the same file in both processes.
"""

from __future__ import annotations

import os
import site
import sys
import sysconfig
from collections.abc import Collection, Iterable, Sequence
from functools import cache, cached_property

import thingc
from thingc.base.filesystem import listing
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.installed_packages import import_path, specification_of

OWN_FOLDER = os.path.dirname(os.path.abspath(thingc.__file__))
"""The folder of the package `thingc`."""

CONTENT_TRACKED = frozenset({"thingc_stock"})
"""Packages that are always tracked by content, even if they are installed."""

OWN = frozenset({"thingc"})
"""Packages whose files count as code of the compiler. The state of the compiler is part of every cache key."""

SELDOM_USED = frozenset({
    "IPython", "ezdxf", "fontTools", "lib3mf", "ocp_gordon", "ocpsvg", "requests", "scipy", "sklearn", "svgpathtools",
    "sympy", "threejs_materials", "trianglesolver",
})
"""Top-level packages that build123d imports for only a few of its functions."""

PROTECTED = frozenset(sys.stdlib_module_names) | SELDOM_USED | {
    "OCP", "anytree", "bd_materials", "bd_warehouse", "build123d", "coacd", "manifold3d", "numpy", "thingc", "typing_extensions",
    "webcolors",
}
"""Forbidden names of modules in part folders: names of the standard library and of packages that the geometry worker uses."""


MAX_NAME = 500
"""Maximum length of a dotted name [characters]."""


class Module(FrozenStruct):
    """A module found by name, without importing it.

    `kind` is `content`, `installed` or `absent`. If `kind` is `content`, the code of the module and the modules that it imports are part of
    the key. If `kind` is `installed`, Python finds the module when it is imported, and the key contains its version or the files that were
    loaded. `file` is the source file, or the binary file of an extension module. `file` is None for a folder without `__init__.py` and for
    a built-in module. `folders` contains the folders of submodules, and is empty for a plain module. `hides` contains other files in the
    part folders that have the same module name but lower precedence.
    """

    name: str
    kind: str
    file: str | None = None
    folders: tuple[str, ...] = ()
    workspace: bool = False
    hides: tuple[str, ...] = ()


@cache
def own_roots() -> tuple[str, ...]:
    """Return the interpreter's own folders, the standard library and site-packages, as configured and with links resolved."""
    named = sysconfig.get_paths()
    roots = {named[key] for key in ("stdlib", "platstdlib", "purelib", "platlib")}
    roots.update(site.getsitepackages() if hasattr(site, "getsitepackages") else ())
    if site.ENABLE_USER_SITE:
        roots.add(site.getusersitepackages())
    return _in_both_forms(roots)


@cache
def installed_roots() -> tuple[str, ...]:
    """Return the folders of installed packages. Cache keys contain the versions of these packages, but no hashes of their files.

    The folders include the interpreter's own folders, and other folders of the import path with installed packages (for example by a `.pth`
    file).
    """
    others = [folder for folder in import_path() if any(name.endswith(".dist-info") for name in listing(folder))]
    return tuple(dict.fromkeys((*own_roots(), *_in_both_forms(others))))


def _in_both_forms(folders: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted({os.path.join(form, "") for folder in folders for form in (folder, os.path.realpath(folder))}))


def is_installed(file: str) -> bool:
    """Return whether a file is in one of the folders that `installed_roots` returns."""
    return (os.path.realpath(file) + os.sep).startswith(installed_roots())


class Finder:
    """Finds modules by name for one workspace.

    `parts` contains the absolute part folders of the workspace in order of precedence, `packages` the packages that the workspace allows.
    The code of an allowed package is tracked by content, unless the package is installed. `probed` collects the absolute paths that were
    tested in folders tracked by content, including paths that do not exist.
    """

    def __init__(self, parts: Sequence[str], packages: Iterable[str] = ()) -> None:
        self.parts = tuple(parts)
        self.followed = CONTENT_TRACKED.union(packages)
        self.probed: set[str] = set()
        self._found: dict[str, Module] = {}

    def find(self, name: str) -> Module:
        """Find the module with the absolute, dotted name `name`.

        If the module does not exist, the returned `Module` has the kind `absent`.
        """
        if name not in self._found:
            self._found[name] = self._find(name)
        return self._found[name]

    def _find(self, name: str) -> Module:
        if len(name) > MAX_NAME:
            return Module(name=name, kind="absent")
        parent, _, last = name.rpartition(".")
        if parent:
            package = self.find(parent)
            if package.kind != "content":
                return Module(name=name, kind=package.kind)
            return self._in_folders(name, last, package.folders, package.workspace) or Module(name=name, kind="absent")
        if name in sys.builtin_module_names or name in OWN:
            return Module(name=name, kind="installed")
        if name not in PROTECTED:
            module = self._in_folders(name, name, self.parts, True, plain_folders=False)
            if module is not None:
                return module
        module = _on_path(name, self.followed)
        if module is not None and module.kind == "content" and module.file is not None:
            self.probed.add(module.file)
        if module is None and name not in PROTECTED:
            module = self._in_folders(name, name, self.parts, True)
        return module or Module(name=name, kind="absent")

    def find_hidden(self, name: str) -> str | None:
        """Return the file in a part folder that would be the top-level module `name` if `PROTECTED` did not contain this name, or None."""
        module = self._in_folders(name, name, self.parts, True, plain_folders=False) if name in PROTECTED else None
        return module.file if module is not None else None

    def _in_folders(self, name: str, last: str, folders: Iterable[str], workspace: bool, *, plain_folders: bool = True) -> Module | None:
        """Find a module in folders as Python's path finder does: a package, a module, or (if allowed) a folder without `__init__.py`."""
        candidates: list[tuple[str, tuple[str, ...]]] = []
        plain: list[str] = []
        for folder in folders:
            path = os.path.join(folder, last)
            initial = os.path.join(path, "__init__.py")
            self.probed.update((initial, path + ".py"))
            candidates += [one for one in ((initial, (path,)), (path + ".py", ())) if os.path.isfile(one[0])]
            if os.path.isdir(path):
                plain.append(path)
        if candidates:
            file, inside = candidates[0]
            others = (one for one, _ in candidates[1:] if workspace and not os.path.samefile(one, file))
            return Module(name=name, kind="content", file=file, folders=inside, workspace=workspace, hides=tuple(others))
        if plain and plain_folders:
            return Module(name=name, kind="content", folders=tuple(plain), workspace=workspace)
        return None

    @cached_property
    def part_modules(self) -> list[str]:
        """The names of all modules in the part folders, up to two levels deep. Error messages use these names as suggestions."""
        modules: set[str] = set()
        for folder in self.parts:
            names = listing(folder)
            modules.update(name[:-3] for name in names if name.endswith(".py") and name[:-3].isidentifier())
            for name in filter(str.isidentifier, names):
                path = os.path.join(folder, name)
                if os.path.lexists(os.path.join(path, "__init__.py")):
                    modules.add(name)
                modules.update(f"{name}.{inner}" for inner in modules_in(path))
        return sorted(name for name in modules if name.partition(".")[0] not in PROTECTED)


def modules_in(folder: str) -> list[str]:
    """Return the sorted names of the modules in a folder, without `__init__`. Return an empty list if the folder cannot be read."""
    return [name[:-3] for name in listing(folder) if name.endswith(".py") and name[:-3].isidentifier() and name != "__init__.py"]


def _on_path(name: str, followed: Collection[str]) -> Module | None:
    """Find a top-level module on the import path of the Python environment, or return None.

    The search also uses the finders of editable packages.
    """
    specification = specification_of(name)
    if specification is None:
        return None
    origin = specification.origin
    folders = tuple(specification.submodule_search_locations or ())
    if origin is None and folders and all(is_installed(os.path.join(folder, "")) for folder in folders):
        return Module(name=name, kind="installed")
    if origin is None:  # a folder without __init__.py, such as the project's own build/ or docs/, is ignored
        return None
    if origin.endswith(".py") and name in followed and (name in CONTENT_TRACKED or not is_installed(origin)):
        return Module(name=name, kind="content", file=origin, folders=folders)
    return Module(name=name, kind="installed", file=origin if specification.has_location else None)
