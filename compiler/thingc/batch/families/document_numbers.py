"""The numbers in the document of a family: their values for given settings, their bounds, and their places in the document."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.base.grouping import group_by
from thingc.base.source import ScalarNode
from thingc.base.units import Quantity
from thingc.batch.families.search_space import SearchSpace, of_axes, of_parameters
from thingc.batch.plans.row_paths import compute_rows
from thingc.batch.plans.tape import Number
from thingc.documents.expressions.evaluation import evaluate
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.spec.assembly import AssemblySpec, ParameterSpec
from thingc.documents.spec.settable_values import node_in_full
from thingc.driver.settings import ParsedSettings, SettingsReader

if TYPE_CHECKING:
    from thingc.batch.planning import Plan
    from thingc.model.resolve.resolver import Sources


class DocumentNumbers:
    """The numbers in the assembly document of a family. `plan` contains the variants of a variants document, if any."""

    def __init__(self, sources: Sources, reader: SettingsReader, plan: Plan | None) -> None:
        self._root = sources.documents.root
        spec = sources.specs[self._root.relative]
        assert isinstance(spec, AssemblySpec)
        self.spec: AssemblySpec = spec
        self.units: Mapping[str, str] = plan.written_in if plan is not None else {}
        self._reader = reader
        self._plan = plan

    @cached_property
    def parameters(self) -> SearchSpace:
        """The search space of the parameters of the assembly document."""
        return of_parameters(self.spec, self._reader.parameters, self._bound_of)

    @cached_property
    def space(self) -> SearchSpace:
        """The search space of the axes of the variants document, or of the parameters of the assembly document."""
        return self.parameters if self._plan is None else of_axes(self._plan.axes, self._plan.document_values)

    def values(self, items: Sequence[ParsedSettings]) -> list[dict[str, float]]:
        """Return the values [SI] of all numbers for each set of settings, keyed by name, as `RobotFamily.numbers` describes."""
        forms = group_by(range(len(items)), lambda place: (items[place].names, items[place].texts))
        numbers_by_place: dict[int, dict[str, float]] = {}
        for (names, texts), places in forms.items():
            rows = compute_rows(partial(self._row, names, texts), np.array([items[place].values for place in places]))
            for place, row in zip(places, rows, strict=True):
                numbers_by_place[place] = self._values(items[place])[0] if row is None else dict(zip(*row, strict=True))
        return [numbers_by_place[place] for place in range(len(items))]

    def _row(
        self, names: tuple[str, ...], texts: tuple[tuple[str, str], ...], numbers: Sequence[Number],
    ) -> tuple[Iterable[str], Sequence[Number]] | None:
        """Return the paths and the values of all numbers for one row, or None if the value of an expression is not known."""
        values, complete = self._values(ParsedSettings(names=names, values=tuple(numbers), texts=texts))
        return (tuple(values), tuple(values.values())) if complete else None

    def _values(self, parsed: ParsedSettings) -> tuple[dict[str, float], bool]:
        """Return the numbers of the document that settings change, and whether all values and expressions could be evaluated."""
        values, document_values = self._reader.values(parsed), self._reader.parameters
        complete = document_values.keys() <= values.keys() and not any(text.startswith("=") for _, text in parsed.texts)
        if self._plan is not None:  # this reads the values at the paths of the document
            path_values = self._plan.values(values)
            complete = complete and len(path_values) == len(self._plan.kinds)
            values.update((name, value) for name, value in path_values.items() if "." in name)
            document_values = {**document_values, **self._plan.paths.own}
        set_names = {*parsed.names, *dict(parsed.texts)}
        changed = {name: value for name, value in values.items() if name in set_names or value != document_values.get(name)}
        numbers = {name: one.value + 0.0 if isinstance(one, Quantity) else one for name, one in changed.items() if not isinstance(one, str)}
        return {name: float(one) if isinstance(one, bool) else one for name, one in numbers.items()}, complete

    def value_of(self, name: str) -> Any:
        """Return the value of a number in the document [SI], or an empty string if the document does not contain this number."""
        kind = self._reader.kind(name)
        return kind.value if isinstance(kind, Quantity) else "" if kind is None else kind

    def find_nodes(self, names: Iterable[str]) -> dict[str, ScalarNode]:
        """Return a mapping from the names of numbers to the nodes of the document that contain these numbers.

        Numbers that are missing or given by an expression are omitted.
        """
        from thingc.driver.edit_document import keys_of

        nodes = {name: node_in_full(self._root.tree, keys_of(self._root, name)) for name in names}
        return {name: node for name, node in nodes.items() if isinstance(node, ScalarNode) and not node.text.startswith("=")}

    def _bound_of(self, name: str, key: str) -> float | None:
        """Return the bound `key` of a parameter [SI], or None if the parameter does not have this bound."""
        entry = self.spec.parameters[name]
        raw: Any = getattr(entry, key) if isinstance(entry, ParameterSpec) else None
        if isinstance(raw, Expression):
            try:
                raw = evaluate(raw, self._reader.parameters)
            except ExpressionError:
                return None
        return raw.value if isinstance(raw, Quantity) else None
