"""Find every Thing that a workspace can use, by reading code without importing it."""

from __future__ import annotations

import ast
import os
from collections.abc import Sequence

from thingc.base.python_source import parse_python
from thingc.geometry.key.module_key import ModuleSource, ModuleSources
from thingc.geometry.key.modules import modules_in
from thingc.geometry.record import PartFailure


def classes_in_reach(sources: ModuleSources, packages: Sequence[str]) -> list[str]:
    """Return the sorted references `module:Class` of all public classes in the part folders, and in the allowed packages that are tracked
    by content.

    Only the method `describe` of the geometry service can decide which of these classes are Things. Packages that are only installed, such
    as bd_warehouse, are not listed, because they have hundreds of classes (see `installed_modules`).
    """
    return sorted(
        f"{source.module.name}:{name}" for source in _sources(sources, packages) for name, (kind, _, _) in source.facts.names.items()
        if kind == "class" and name[0] != "_"
    )


def installed_modules(sources: ModuleSources, packages: Sequence[str]) -> dict[str, str]:
    """Return the files of the public modules at the top level of the allowed installed packages, by module.

    An example of such a module is `bd_warehouse.fastener`.
    """
    files: dict[str, str] = {}
    for package in packages:
        module = sources.finder.find(package)
        if module.kind == "installed" and module.file is not None and os.path.basename(module.file) == "__init__.py":
            folder = os.path.dirname(module.file)
            files.update((f"{package}.{name}", os.path.join(folder, f"{name}.py")) for name in modules_in(folder) if name[0] != "_")
        elif module.kind == "installed" and module.file is not None:
            files[package] = module.file
    return files


def classes_installed(module: str, file: str) -> list[str]:
    """Return the references `module:Class` of all public classes in the file of an installed module, in the order of the file. The result
    is empty for invalid Python.
    """
    try:
        with open(file, "rb") as stream:
            body = parse_python(stream.read()).body
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    return [f"{module}:{node.name}" for node in body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")]


def not_python(sources: ModuleSources, packages: Sequence[str]) -> list[PartFailure]:
    """Return a failure for each module of `classes_in_reach` that is not valid Python, because its classes cannot be found."""
    failures: list[PartFailure] = []
    for source in _sources(sources, packages):
        if source.module.file is None or not source.facts.broken:
            continue
        try:
            with open(source.module.file, "rb") as stream:
                parse_python(stream.read())
        except (SyntaxError, ValueError, RecursionError, MemoryError) as fault:
            text, line = (fault.msg, fault.lineno) if isinstance(fault, SyntaxError) else (str(fault) or "too deeply nested", None)
            failures.append(PartFailure(
                subject=source.module.name, kind="raised", message=f"{type(fault).__name__}: {text}", file=source.module.file, line=line,
                column=getattr(fault, "offset", None) or 1,
            ))
    return failures


def _sources(sources: ModuleSources, packages: Sequence[str]) -> list[ModuleSource]:
    """Return the sources of the modules in part folders and in packages that are tracked by content, sorted by name."""
    modules = set(sources.finder.part_modules)
    for package in packages:
        module = sources.finder.find(package)
        if module.kind == "content":
            modules.add(package)
            for folder in module.folders:
                modules.update(f"{package}.{name}" for name in modules_in(folder))
    return [source for name in sorted(modules) if (source := sources.source(name)) is not None]
