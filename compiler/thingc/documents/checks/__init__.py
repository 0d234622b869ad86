"""Kinds of document tests (`tests:` of a document), one module each: its model, how it is read, and its documentation.

Every module of this folder with a `KIND` defines a kind. Its declarations determine the language, the schema, the page in the
documentation, references and linking. The measurements are in `driver/testing/kinds/`.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from typing import Any

from thingc.documents.checks.kind import CheckKind


@cache
def kinds() -> dict[str, CheckKind[Any, Any]]:
    """Return every kind by its name, in the order of the documentation."""
    files = (name.removesuffix(".py") for name in os.listdir(os.path.dirname(__file__)) if name.endswith(".py"))
    modules = [import_module(f"{__name__}.{stem}") for stem in files if stem != "__init__"]
    unsorted: list[CheckKind[Any, Any]] = [module.KIND for module in modules if hasattr(module, "KIND")]
    return {kind.name: kind for kind in sorted(unsorted, key=lambda kind: (kind.position, kind.name))}
