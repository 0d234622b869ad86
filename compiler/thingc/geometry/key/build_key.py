"""Compute build keys: the digest of all labelled inputs on which a cached result depends.

The ingredients of two keys can be compared to find the reason for a rebuild.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import some
from thingc.documents.workspace import Workspace
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.record import PartDefinition


class BuildKey(FrozenStruct):
    """The inputs on which a result depends, by label (`module arm`, `parameter length`, `version build123d`), and their digest."""

    ingredients: dict[str, str]

    @property
    def key(self) -> str:
        """Return the SHA-256 of all inputs in hexadecimal."""
        text = json.dumps(self.ingredients, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


def schema_key(reference: str, code: CodeIngredients | None, versions: Mapping[str, str]) -> BuildKey:
    """Compute the key of a part schema from its code with docstrings and from versions. `code` is None for installed packages."""
    return BuildKey(ingredients={"part": reference, **versions, **(code.documented if code is not None else {})})


def record_key(definition: PartDefinition, code: CodeIngredients | None, versions: Mapping[str, str], workspace: Workspace) -> BuildKey:
    """Return the key of a part record. The key contains the tessellation settings of the workspace, but no other settings."""
    mesh, simulation = workspace.mesh, workspace.simulation
    parameters = {f"parameter {name}": f"{type(value).__name__} {value!r}" for name, value in definition.parameters}
    return BuildKey(
        ingredients={
            "part": definition.reference, "definition": definition.text, **versions,
            **(code.ingredients if code is not None else {}), **parameters,
            "mirror": repr(definition.mirror), "mesh linear": repr(mesh.linear), "mesh angular": repr(mesh.angular),
            "mesh simulation linear": repr(simulation.linear), "mesh simulation angular": repr(simulation.angular),
        }
    )


def difference(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """Describe at most three differences between the old and the new inputs of a part. Changed modules are listed first."""
    changed = [label for label in {**old, **new} if old.get(label) != new.get(label)]
    if any(label.startswith("module ") and label in old and label in new for label in changed):
        # the edit of a module is the reason; the edit also explains added and removed imports of other modules
        changed = [label for label in changed if label in old and label in new]
    changed.sort(key=lambda label: (not label.startswith("module "), label))
    phrases = list(dict.fromkeys(_phrase(label, old, new) for label in changed))
    if not phrases:
        return "no dependency changed"
    return some(phrases, 3, separator="; ")


def _phrase(label: str, old: Mapping[str, str], new: Mapping[str, str]) -> str:
    kind, _, name = label.partition(" ")
    verb = "is new" if label not in old else "is gone" if label not in new else "changed"
    if kind == "module":
        return f"module `{name}` {verb}"
    if kind == "version" and name == "thingc":
        return "thingc changed"
    if kind == "version":
        return f"{name} changed from {old.get(label, 'nothing')} to {new.get(label, 'nothing')}"
    if kind == "parameter":
        return f"parameter `{name}` {verb}"
    if kind == "mesh":
        purpose, _, which = name.rpartition(" ")
        return f"the {which} tolerance of {purpose + ' ' if purpose else ''}meshes changed"
    if label == "file":
        return f"file {new.get('part', old.get('part'))} changed"
    return f"{label} {verb}"
