"""For editors: a JSON Schema per document that knows the parts, mounts, joints and names of that document."""

from __future__ import annotations

from thingc.editor.facts import Facts, facts_of
from thingc.editor.refresh import Schemas

__all__ = ["Facts", "Schemas", "facts_of"]
