"""What `resolve` is asked with: what was read, and what one compilation sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.store.file_digests import digest_of

if TYPE_CHECKING:
    from thingc.base.units import Quantity
    from thingc.documents.load.documents import Documents
    from thingc.documents.spec.invalid_entries import Specs
    from thingc.documents.workspace import Workspace
    from thingc.geometry.record import PartFailure, PartSchema


class Settings(FrozenStruct):
    """What one compilation has of its own. `parameters` are texts as `-p` takes them (`{"reach": "120 mm"}`), `choices` texts by
    dotted path in the root document (`{"components.foot.part": "feet:Wide"}`). `quantities` are values for some of these paths: each is
    set in place of its text."""

    parameters: Mapping[str, str] = {}
    choices: Mapping[str, str] = {}
    quantities: Mapping[str, Quantity] = {}


class Sources(FrozenStruct):
    """Documents, their models (or the sound rest of these) by path in the workspace, what the parts that they name take, and who
    tells the SHA-256 of a file."""

    workspace: Workspace
    documents: Documents
    specs: Specs
    schemas: Mapping[str, PartSchema | PartFailure]
    digest: Callable[[str], str] = digest_of
