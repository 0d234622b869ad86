"""What the answers for parts depend on, as far as that is known before a part is made: read, and nothing of it run."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TYPE_CHECKING

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.part_code import PartCode
from thingc.geometry.lock.lock import LOCK_FILE

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace
    from thingc.geometry.store.local import Store


class PartInputs(FrozenStruct):
    """`files` are absolute paths, there or not: of the code of parts and of what it imports in the workspace, of where a module of it
    would be found if it were there, and of the lock. `folders`: a part may read any file in them while it is made."""

    files: frozenset[str]
    folders: tuple[str, ...]


def part_inputs(references: Iterable[str], workspace: Workspace, store: Store | None) -> PartInputs:
    """Of the parts `module:Class` of a workspace. Without a store nobody trusts the workspace: what lies outside of it is not read."""
    code = PartCode(workspace, store)
    files = {os.path.join(workspace.root, LOCK_FILE)}
    own = False
    for reference in references:
        ingredients = code.code(reference)
        if isinstance(ingredients, CodeIngredients):
            files.update(ingredients.files)
        own = own or code.sources.finder.find(reference.partition(":")[0]).workspace
    return PartInputs(files=frozenset(files | code.probed), folders=tuple(workspace.parts) if own else ())
