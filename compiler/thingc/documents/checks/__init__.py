"""The types of tests that a document can define in its section `tests:`.

Every module of this folder that contains a constant `KIND` defines a type of test. The module defines the keys of the test, their schema,
and the references to elements of the robot. The module with the same name in `driver/testing/kinds/` measures the
test.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from typing import Any

from thingc.documents.checks.kind import CheckKind


@cache
def kinds() -> dict[str, CheckKind[Any, Any]]:
    """Return all types of document tests by name, such as `mass` or `reach`, in the order of the documentation."""
    stems = (name.removesuffix(".py") for name in os.listdir(os.path.dirname(__file__)) if name.endswith(".py") and name != "__init__.py")
    modules = [import_module(f"{__name__}.{stem}") for stem in stems]
    unsorted: list[CheckKind[Any, Any]] = [module.KIND for module in modules if hasattr(module, "KIND")]
    return {kind.name: kind for kind in sorted(unsorted, key=lambda kind: (kind.position, kind.name))}
