"""Find the versions of all software outside the workspace that affects a part: Python, packages, and thingc itself."""

from __future__ import annotations

import hashlib
import os
import platform
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from thingc.base.installed_packages import distribution_versions, import_path
from thingc.geometry.key.environment_variables import passed_variables
from thingc.geometry.key.file_states import state_of
from thingc.geometry.key.modules import OWN_FOLDER, is_installed
from thingc.geometry.store.local import Store

KERNEL = ("build123d", "OCP", "numpy", "manifold3d")
"""Top-level packages whose versions are part of the key of every part record."""

OF_FILES = ("fast_simplification", "trimesh")
"""Packages that read and simplify meshes."""

_DISTRIBUTIONS = {"OCP": ("cadquery_ocp", "cadquery_ocp_novtk"), "sklearn": ("scikit_learn",), "yaml": ("pyyaml",), "PIL": ("pillow",)}


def versions_of(names: Iterable[str], file_of: Callable[[str], str | None], store: Store | None = None) -> dict[str, str]:
    """Return the versions of top-level packages in the Python environment, such as `{"version build123d": "0.13.0"}`.

    The value is the version of the distribution. If there is no distribution, it is a hash of the file `file_of(name)`. Modules of the
    standard library are omitted, because the version of Python covers them.
    """
    ingredients: dict[str, str] = {}
    installed = _installed_versions()
    unknown: list[str] = []
    for name in sorted(set(names) - sys.stdlib_module_names):
        candidates = _DISTRIBUTIONS.get(name, (name.lower().replace("-", "_").replace(".", "_"),))
        versions = [f"{one} {installed[one]}" if len(candidates) > 1 else installed[one] for one in candidates if one in installed]
        if versions:
            ingredients[f"version {name}"] = ", ".join(versions)
        else:
            unknown.append(name)
    if unknown:
        table = _by_import_name(store)
        for name in unknown:
            file = None if name in table else file_of(name)
            ingredients[f"version {name}"] = table.get(name) or ("unknown" if file is None else state_of(file))
    return ingredients


def platform_versions() -> dict[str, str]:
    """Return the versions of Python and of the machine, and the variables that workers get from the environment."""
    return {
        **{f"variable {name}": value for name, value in passed_variables().items()},
        "version Python": f"{platform.python_implementation()} {'.'.join(map(str, sys.version_info[:3]))}",
        "machine": f"{sys.platform} {platform.machine()}",
    }


@cache
def compiler_version() -> dict[str, str]:
    """Return the version of the code in thingc that creates part records, and a digest of its source files.

    The digest also covers the package `base`, because its structs define the format of records.
    """
    import thingc

    digest = hashlib.sha256()
    for room in ("base", "geometry"):
        for file in sorted(Path(OWN_FOLDER, room).rglob("*.py")):
            digest.update(str(file.relative_to(OWN_FOLDER)).encode() + hashlib.sha256(file.read_bytes()).digest())
    return {"version thingc": f"{getattr(thingc, '__version__', '0')} {digest.hexdigest()[:16]}"}


@cache
def _installed_versions() -> dict[str, str]:
    """Return the versions of all installed distributions by normalised name."""
    return distribution_versions(folder for folder in import_path() if is_installed(os.path.join(folder, "")))


def _by_import_name(store: Store | None) -> dict[str, str]:
    """Return the versions of packages by import name, for packages whose distribution has another name.

    The store caches the result, because the search is slow.
    """
    key = hashlib.sha256(repr(sorted(_installed_versions().items())).encode()).hexdigest()
    cached = store.get_json("packages", key) if store is not None else None
    if isinstance(cached, dict):
        return cached
    from importlib import metadata

    table = {
        name: ", ".join(f"{one} {metadata.version(one)}" for one in sorted(set(distributions)))
        for name, distributions in metadata.packages_distributions().items()
    }
    if store is not None:
        store.note_json("packages", key, table)
    return table
