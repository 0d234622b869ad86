"""Kinds of document tests (`tests:` of a document).

Every module of `driver/testing/kinds/` with a `KIND` defines a kind. Its declarations determine the language, the schema, the page in the
documentation, references, linking and measurements.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from typing import Any

from thingc.base.diagnostics import Code, DiagnosticCode
from thingc.documents.checks.kind import CheckKind

KINDS = "thingc.driver.testing.kinds"
"""The package of the kinds. It belongs to a later room, because kinds measure robots, and is therefore imported only when it is needed."""


@cache
def kinds() -> dict[str, CheckKind[Any, Any]]:
    """Return every kind by its name, in the order of the documentation."""
    (folder,) = import_module(KINDS).__path__
    stems = (name.removesuffix(".py") for name in os.listdir(folder) if name.endswith(".py") and name != "__init__.py")
    modules = [import_module(f"{KINDS}.{stem}") for stem in stems]
    unsorted: list[CheckKind[Any, Any]] = [module.KIND for module in modules if hasattr(module, "KIND")]
    return {kind.name: kind for kind in sorted(unsorted, key=lambda kind: (kind.position, kind.name))}


@cache
def all_codes() -> tuple[DiagnosticCode, ...]:
    """Return every diagnostic code: the members of `Code`, then the codes of kinds of tests."""
    return (*Code, *(code for kind in kinds().values() for code in kind.codes))
