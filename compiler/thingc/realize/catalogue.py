"""Every Thing in reach of a workspace, found by reading code, not by importing it."""

from __future__ import annotations

from collections.abc import Sequence

from thingc.realize.codekey import Sources
from thingc.realize.modules import listed


def classes_in_reach(sources: Sources, packages: Sequence[str]) -> list[str]:
    """`module:Class` of every public class in the part folders and in the allowed packages that are tracked by content.

    Sorted. Which of them are Things only `describe` can tell. Packages that are merely installed (bd_warehouse) are not
    listed: what they offer is in their own documentation.
    """
    finder = sources.finder
    modules = set(finder.part_modules())
    for package in packages:
        found = finder.find(package)
        if found.kind == "content":
            modules.add(package)
            for folder in found.folders:
                names = [name[:-3] for name in listed(folder) if name.endswith(".py") and name != "__init__.py"]
                modules.update(f"{package}.{name}" for name in names if name.isidentifier())
    references: list[str] = []
    for module in sorted(modules):
        source = sources.source(module)
        if source is None:
            continue
        for unit in source.facts.units:
            if unit.kind == "class":
                references += [f"{module}:{name}" for name in unit.names if not name.startswith("_")]
    return sorted(set(references))
