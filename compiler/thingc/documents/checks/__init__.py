"""The types of tests that a document can define in its section `tests:`.

Every module of this folder that contains a constant `KIND` defines a type of test. The module defines the keys of the test, their schema,
the diagnostic codes, and the references to elements of the robot. The module with the same name in `driver/testing/kinds/` measures the
test.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from typing import Any

from thingc.base.diagnostics import Code, DiagnosticCode
from thingc.documents.checks.kind import CheckKind


@cache
def kinds() -> dict[str, CheckKind[Any, Any]]:
    """Return all types of document tests by name, such as `mass` or `reach`, in the order of the documentation."""
    stems = (name.removesuffix(".py") for name in os.listdir(os.path.dirname(__file__)) if name.endswith(".py") and name != "__init__.py")
    modules = [import_module(f"{__name__}.{stem}") for stem in stems]
    unsorted: list[CheckKind[Any, Any]] = [module.KIND for module in modules if hasattr(module, "KIND")]
    return {kind.name: kind for kind in sorted(unsorted, key=lambda kind: (kind.position, kind.name))}


@cache
def all_codes() -> tuple[DiagnosticCode, ...]:
    """Return all diagnostic codes of thingc: first the members of `Code`, then the codes that the types of document tests define."""
    return (*Code, *(code for kind in kinds().values() for code in kind.codes))
