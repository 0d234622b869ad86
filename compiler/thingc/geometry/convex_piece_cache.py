"""Convex pieces of parts, kept by the mesh that they are made of: to ask for them models nothing anew."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

from thingc.geometry.record import PartFailure, PartRecord
from thingc.geometry.record_json import mesh_from_json
from thingc.geometry.store.local import Store
from thingc.geometry.store.slice_cache import Records, Run


class ConvexAnswers:
    """Pieces by mesh, kept in a store. `versions` are those of everything that makes them."""

    def __init__(self, store: Store, versions: Callable[[], Mapping[str, str]]) -> None:
        self._store = store
        self._versions = versions

    def add(
        self, records: Records, convex: Collection[str], run: Run, timeout: float, broken: Callable[[str, dict[str, Any]], PartFailure],
    ) -> None:
        """Give their pieces to `records` for the texts in `convex`. `run` asks the workers, `broken` puts an answer that failed
        into words."""
        wanted: dict[str, list[str]] = {}
        for text in sorted(convex):
            record = records.get(text)
            if isinstance(record, PartRecord) and record.simulated is not None:
                wanted.setdefault(record.simulated.sha256, []).append(text)
        version = "".join(self._versions().values()) if wanted else ""
        pieces: dict[str, Any] = {}
        requests = []
        for mesh in wanted:
            kept = self._store.get_json("convex", f"{version} {mesh}")
            if kept is not None and all(self._store.has(piece[0], piece[1]) for piece in kept):
                pieces[mesh] = kept
            else:
                requests.append({"op": "decompose", "mesh": mesh, "store": self._store.root, "timeout": timeout})
        for request, answer in run(requests, "decomposing"):
            if "failed" in answer:
                for text in wanted[request["mesh"]]:
                    records[text] = broken(text, answer)
                continue
            pieces[request["mesh"]] = answer["answer"]["pieces"]
            self._store.put_json("convex", f"{version} {request['mesh']}", pieces[request["mesh"]])
        for mesh, made in pieces.items():
            for text in wanted[mesh]:
                record = records[text]
                if isinstance(record, PartRecord):
                    records[text] = replace(record, convex=tuple(mesh_from_json(piece) for piece in made))
