"""Kinds of tests that a document can define under `tests:`.

Every module of `driver/testing/kinds/` with a `KIND` defines a kind. The module determines the keys of the test, its schema, its page in
the documentation, its references, and how the test is linked and measured.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from typing import Any

from thingc.base.diagnostics import Code, DiagnosticCode
from thingc.documents.checks.kind import CheckKind

KINDS = "thingc.driver.testing.kinds"
"""The package that contains the kinds.

Kinds measure robots, so the package belongs to a later room and is imported only when it is needed.
"""


@cache
def kinds() -> dict[str, CheckKind[Any, Any]]:
    """Return all kinds of tests by name, in the order of the documentation."""
    (folder,) = import_module(KINDS).__path__
    stems = (name.removesuffix(".py") for name in os.listdir(folder) if name.endswith(".py") and name != "__init__.py")
    modules = [import_module(f"{KINDS}.{stem}") for stem in stems]
    unsorted: list[CheckKind[Any, Any]] = [module.KIND for module in modules if hasattr(module, "KIND")]
    return {kind.name: kind for kind in sorted(unsorted, key=lambda kind: (kind.position, kind.name))}


@cache
def all_codes() -> tuple[DiagnosticCode, ...]:
    """Return all diagnostic codes: first the members of `Code`, then the codes that the kinds of tests define."""
    return (*Code, *(code for kind in kinds().values() for code in kind.codes))
