"""Create the requests to workers that build parts, and the keys of their results."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from msgspec.structs import asdict, replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.documents.workspace import Workspace
from thingc.geometry.build_reasons import why
from thingc.geometry.key.build_key import BuildKey, record_key
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.part_code import PartCode, file_state
from thingc.geometry.key.result_cache import Results
from thingc.geometry.key.versions import OF_FILES, versions_of
from thingc.geometry.print_slices import LikelySlicing
from thingc.geometry.record import PartDefinition, PartFailure, PartSchema, Value
from thingc.geometry.store.local import Store

Likely = Callable[[], Mapping[str, Collection[LikelySlicing]]] | None
"""A function that returns the likely slicings of parts, by the text of their definitions. The function is only called when a part must be
built.
"""


class PartRequest(FrozenStruct):
    """A request to describe or build a part.

    `subject` is the reference or the definition text of the part, and `build_key` is the cache key of the result. `code` is None for a file
    or an installed package.
    """

    subject: str
    build_key: BuildKey
    code: CodeIngredients | None
    request: dict[str, Any]


class RecordRequest(PartRequest):
    """A request to build the part `definition`. `reason` is the reason for building the part."""

    definition: PartDefinition
    reason: str = ""


class PartRequests:
    """Requests for the parts of one workspace, each with a time limit of `timeout` [s].

    `schemas` contains the schemas of classes that have been described, by reference. `slicings` contains the expected slicings of the
    parts of each class, by reference. A worker slices a part right after building it.
    """

    def __init__(self, workspace: Workspace, store: Store, timeout: float, parts: PartCode, results: Results) -> None:
        self._workspace, self._store, self._timeout, self._parts, self._results = workspace, store, timeout, parts, results
        self.schemas: dict[str, PartSchema] = {}
        self.slicings: dict[str, set[LikelySlicing]] = {}

    def common_fields(self, code: CodeIngredients | None) -> dict[str, Any]:
        """Return the fields that every request to a worker contains: the code, the store, and the limits of time and memory."""
        return {**self._parts.code_fields(code), "store": self._store.root, "timeout": self._timeout, "memory": self._workspace.part_memory}

    def given_parameters(self, definition: PartDefinition) -> dict[str, Value]:
        """Return the parameters of a definition that differ from their defaults.

        If the class has not been described, return all parameters.
        """
        schema = self.schemas.get(definition.reference)
        defaults = {parameter.name: parameter.default for parameter in schema.parameters} if schema is not None else {}
        return {name: value for name, value in definition.parameters if repr(value) != repr(defaults.get(name))}

    def expect_slicings(self, definitions: Sequence[PartDefinition], requested: Mapping[str, Collection[LikelySlicing]]) -> None:
        """Set the slicings that parts will need. `requested` maps the text of a definition to its slicings."""
        self.slicings.update((definition.reference, set()) for definition in definitions)
        for definition in definitions:
            self.slicings[definition.reference].update(requested.get(definition.text, ()))

    def complete(self, requests: Sequence[RecordRequest], likely: Likely) -> list[RecordRequest]:
        """Add the slicings and the reasons to requests, and return the requests in the order in which workers process them.

        Parts that will be sliced come first, because they take longest. `likely` returns the likely slicings of parts whose class does not
        have expected slicings yet.
        """
        new = [request.definition for request in requests if request.definition.reference not in self.slicings]
        if likely is not None and new:
            self.expect_slicings(new, likely())
        completed = [
            replace(one, request=self.with_slicings(one), reason=why(one.definition, one.build_key, self._results)) for one in requests
        ]
        return sorted(completed, key=lambda one: not one.request["slicings"])

    def with_slicings(self, request: RecordRequest) -> dict[str, Any]:
        """Return the complete worker request, with the slicings that are expected for the part's class."""
        slicings = sorted(self.slicings.get(request.definition.reference, ()), key=repr)
        return {**request.request, "slicings": [[asdict(one), own_up] for one, own_up in slicings]}

    def prepare(self, definition: PartDefinition, given: Mapping[str, Value] | None = None) -> RecordRequest | PartFailure:
        """Prepare the request to build a part definition, or return a failure.

        `given` contains the parameters that the request sets. If `given` is None, the result of the method `given_parameters` is used.
        """
        workspace = self._workspace
        code: CodeIngredients | None = None
        if definition.kind == "file":
            state = file_state(definition, workspace, self._results)
            if isinstance(state, PartFailure):
                return state
            versions = {**self._parts.versions(None), "file": state, **versions_of(OF_FILES, self._parts.file_of, self._store)}
        else:
            checked = self._parts.code(definition.reference)
            if isinstance(checked, PartFailure):
                return replace(checked, subject=definition.text)
            code = checked
            versions = self._parts.versions(code, definition.reference)
        build_key = record_key(definition, code, versions, workspace)
        request = {
            "op": "model",
            "definition": {
                "kind": definition.kind, "reference": definition.reference, "text": definition.text, "mirror": definition.mirror,
                "parameters": self.given_parameters(definition) if given is None else dict(given),
                "placed": code is not None and code.place is not None,
            },
            "tessellations": {"fine": asdict(workspace.mesh), "simulation": asdict(workspace.simulation)},
            **self.common_fields(code),
        }
        return RecordRequest(subject=definition.text, build_key=build_key, code=code, request=request, definition=definition)
