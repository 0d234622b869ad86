"""Decide whether a part may be loaded, and find its code and the dependencies of this code, without importing the code."""

from __future__ import annotations

import os
from typing import Any

from msgspec.structs import replace

from thingc.base.filesystem import listing
from thingc.documents.workspace import Workspace
from thingc.geometry.key.module_key import CodeIngredients, ModuleSources, code_of, defined_in, may_have
from thingc.geometry.key.modules import OWN, Finder, Module, modules_in
from thingc.geometry.key.result_cache import Results
from thingc.geometry.key.versions import KERNEL, compiler_version, platform_versions, versions_of
from thingc.geometry.record import PartDefinition, PartFailure
from thingc.geometry.record_json import relative_path
from thingc.geometry.store.local import Store

FILES = (".step", ".stp", ".brep", ".brp", ".stl", ".3mf", ".obj")
"""Suffixes of files that can be parts."""


class PartCode:
    """The code of the parts of one workspace. The code of each part is read only once.

    The object `sources` reads the source files. If there is no store, the workspace is untrusted, and part folders outside of the workspace
    are not read.
    """

    def __init__(self, workspace: Workspace, store: Store | None) -> None:
        self.workspace = workspace
        self.store = store
        within = None if store is not None else workspace.contains
        self.sources = ModuleSources(Finder(workspace.parts, workspace.packages), workspace.root, store, within)
        self._codes: dict[str, CodeIngredients | None | PartFailure] = {}
        self._known_versions: dict[tuple[str, ...], dict[str, str]] = {}

    @property
    def probed(self) -> set[str]:
        """The absolute paths that were searched for module files, including paths that do not exist."""
        return self.sources.finder.probed

    def code(self, reference: str) -> CodeIngredients | None | PartFailure:
        """Return the source code that the part `module:Class` depends on, or None for a part of an installed package.

        If the class of the part must not or cannot be loaded, return a failure.
        """
        if reference not in self._codes:
            code = self._read_code(reference)
            self._codes[reference] = self.with_namesakes(code) if isinstance(code, PartFailure) else code
        return self._codes[reference]

    def with_namesakes(self, failure: PartFailure) -> PartFailure:
        """Add suggestions to the failure of a part that was not found: classes of the same name in other modules.

        Return a copy of the failure with these suggestions.
        """
        from thingc.geometry.key.catalogue import classes_in_reach

        name = failure.subject.rpartition(":")[2]
        if failure.kind != "missing" and name != failure.subject:
            return failure
        namesakes = [one for one in classes_in_reach(self.sources, self.workspace.packages) if one.partition(":")[2] == name]
        return replace(failure, candidates=(*failure.candidates, *namesakes))

    def hiding(self, reference: str) -> tuple[Module, ...]:
        """Return the modules that hide other modules of the same name, among the modules on which `module:Class` depends.

        If the class does not exist, check only its module.
        """
        code = self.code(reference)
        if isinstance(code, PartFailure) and code.file is not None:
            return tuple(one for one in (self.sources.finder.find(reference.partition(":")[0]),) if one.hides)
        return code.hiding if isinstance(code, CodeIngredients) else ()

    def _read_code(self, reference: str) -> CodeIngredients | None | PartFailure:
        module_name, colon, name = reference.partition(":")
        if not colon or not all(part.isidentifier() for part in (*module_name.split("."), *name.split("."))):
            message = f"`{reference}` is not a part reference: expected `module:Class`"
            return PartFailure(subject=reference, kind="invalid", message=message)
        finder = self.sources.finder
        module = finder.find(module_name)
        top = module_name.partition(".")[0]
        allowed = module.workspace or top in self.workspace.packages
        if not allowed and (module.kind != "absent" or finder.find(top).kind == "installed"):
            message = f"the module `{module_name}` is not in a part folder or in an allowed package"
            if hidden := finder.find_hidden(top):
                path = os.path.relpath(hidden, self.workspace.root)
                message = f"the installed module `{top}` hides `{path}`"
            return PartFailure(subject=reference, kind="refused", message=message, candidates=tuple(self.workspace.packages))
        if module.kind == "installed":
            return None
        if module.kind == "absent" or module.file is None:
            inside = finder.find(top).folders if top in self.workspace.packages else ()
            known = (
                *finder.part_modules, *self.workspace.packages,
                *(f"{top}.{name}" for folder in inside for name in modules_in(folder) if name[0] != "_"),
            )
            return PartFailure(subject=reference, kind="missing", message=f"there is no module `{module_name}`", candidates=known)
        first = name.partition(".")[0]
        if not may_have(module_name, first, self.sources):
            return PartFailure(
                subject=reference, kind="missing", message=f"the module `{module_name}` has no `{first}`", file=module.file,
                candidates=tuple(f"{module_name}:{one}" for one in defined_in(module_name, self.sources)),
            )
        return code_of(reference, self.sources)

    def versions(self, code: CodeIngredients | None, reference: str = "") -> dict[str, str]:
        """Return the versions of the kernel, of thingc, and of all installed packages that the code uses.

        If `code` is None, the versions include the package of `reference`.
        """
        package = reference.partition(":")[0].partition(".")[0]
        packages = {name.partition(".")[0] for name in code.installed} if code is not None else {package} - {""}
        used = (*KERNEL, *packages)
        key = tuple(sorted(set(used) - OWN))
        if key not in self._known_versions:
            self._known_versions[key] = {**platform_versions(), **compiler_version(), **versions_of(key, self.file_of, self.store)}
        return self._known_versions[key]

    def file_of(self, package: str) -> str | None:
        """Return the path of a top-level module of the Python environment, and add the path to `probed`."""
        file = self.sources.finder.find(package).file
        if file is not None:
            self.probed.add(file)
        return file

    def code_fields(self, code: CodeIngredients | None) -> dict[str, Any]:
        """Return the fields of a worker request that describe the code.

        The fields contain the folders and packages of the workspace, and the SHA-256 of the files in the key. The fields also contain
        part packages without `__init__.py`, and the installed packages to load before the fork.
        """
        code = code or CodeIngredients()
        return {
            "root": self.workspace.root, "parts": list(self.workspace.parts), "packages": list(self.workspace.packages),
            "hashes": code.files, "plain": sorted(code.plain),
            "preload": sorted(name for name in code.installed if name.partition(".")[0] in self.workspace.packages),
        }

    def files(self) -> dict[str, str]:
        """Return the states of all code files that have been read so far, by path. Paths inside the workspace are relative."""
        code = [code for code in self._codes.values() if isinstance(code, CodeIngredients)]
        return {relative_path(file, self.workspace.root): f"file:{sha256}" for one in code for file, sha256 in one.files.items()}


def file_state(definition: PartDefinition, workspace: Workspace, results: Results) -> str | PartFailure:
    """Return the state of a part file, such as a STEP file, in the form of the module `file_states`.

    Return a failure if the part file does not exist.
    """
    path = os.path.join(workspace.root, definition.reference)
    if os.path.isabs(definition.reference) or not workspace.contains(path):
        return PartFailure(subject=definition.text, kind="refused", message=f"`{definition.reference}` is outside the workspace")
    state = results.state(definition.reference, "file:")
    if not state.startswith("file:"):
        folder = os.path.dirname(definition.reference)
        files = [os.path.join(folder, name).replace(os.sep, "/") for name in listing(os.path.dirname(path))]
        return PartFailure(
            subject=definition.text, kind="missing", message=f"there is no file `{definition.reference}`",
            candidates=tuple(name for name in files if name.lower().endswith(FILES)),
        )
    return state
