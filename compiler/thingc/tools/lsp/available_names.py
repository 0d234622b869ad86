"""What a document of a workspace can name besides what it holds: parts in reach, other documents; and its schema, which says that."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from thingc.base.source import Path
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.tools.lsp.cached_parts import WAITED_FOR, CachedParts
from thingc.tools.schemas.refresh_schemas import Schemas

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace
    from thingc.tools.lsp.analysis import Analysis


class AvailableNames:
    """The surroundings of the documents of one workspace. `at_hand` answers for parts; None where nothing of the workspace may run: then
    none are known but those that a document names. `wake` is called where workers are to be asked for more."""

    def __init__(self, workspace: Workspace, at_hand: CachedParts | None, wake: Callable[[], None]) -> None:
        self.workspace = workspace
        self.at_hand = at_hand
        self._schemas = Schemas(workspace, _Parts(at_hand, wake))

    def schema_of(self, analysis: Analysis, scalars: Mapping[Path, str]) -> dict[str, Any] | None:
        """The schema of a document as it is being written; of one that was never well-formed what every document of its kind may say, by
        its `scalars`. None for what is no document."""
        tree = analysis.tree
        if tree is None:
            return self._schemas.general(scalars.get(("thingc",), "").partition("/")[0] or "assembly")
        made: dict[str, Any] | None = analysis.once(
            "schema", lambda: self._schemas.schema_of(analysis.path, tree, analysis.model, analysis.records, analysis.schemas),
        )
        return made


class _Parts:
    """Parts in reach, as far as they are known at once. What their classes take is asked of workers, too; nothing is modelled for it."""

    def __init__(self, at_hand: CachedParts | None, wake: Callable[[], None]) -> None:
        self._at_hand = at_hand
        self._wake = wake

    def catalogue(self) -> list[str]:
        """See `PartsInReach`."""
        return [] if self._at_hand is None else self._at_hand.service.catalogue()

    def not_python(self) -> list[PartFailure]:
        """See `PartsInReach`."""
        return [] if self._at_hand is None else self._at_hand.service.not_python()

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """See `PartsInReach`. Those that are waited for are left out."""
        answers = {} if self._at_hand is None else self._at_hand.describe(references)
        known = {name: one for name, one in answers.items() if not isinstance(one, PartFailure) or one.kind != WAITED_FOR}
        if len(known) < len(answers):
            self._wake()
        return known

    def realize(self, definitions: Sequence[PartDefinition]) -> Mapping[str, PartRecord | PartFailure]:
        """See `PartsInReach`."""
        return {} if self._at_hand is None else self._at_hand.service.realize(definitions)
