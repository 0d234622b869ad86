"""Files that the results for parts depend on, as far as they are known before a part is built.

This module reads code without running it.
"""

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
    """Files and folders that parts depend on.

    `files` contains absolute paths, including paths that do not exist: the code of parts with the modules of the workspace that it imports,
    the places where Python would search for these modules first, and the lock. `folders` contains the folders whose files a part may read
    when it is built.
    """

    files: frozenset[str]
    folders: tuple[str, ...]


def part_inputs(references: Iterable[str], workspace: Workspace, store: Store | None) -> PartInputs:
    """Return the inputs of the parts `module:Class` of a workspace.

    Without a store, the workspace is untrusted: files outside of the workspace are not read.
    """
    code = PartCode(workspace, store)
    files = {os.path.join(workspace.root, LOCK_FILE)}
    own = False
    for reference in references:
        ingredients = code.code(reference)
        if isinstance(ingredients, CodeIngredients):
            files.update(ingredients.files)
        own = own or code.sources.finder.find(reference.partition(":")[0]).workspace
    return PartInputs(files=frozenset(files | code.probed), folders=tuple(workspace.parts) if own else ())
