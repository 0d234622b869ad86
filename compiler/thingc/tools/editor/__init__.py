"""For editors: a JSON Schema per document that knows the parts, mounts, joints and names of that document."""

from __future__ import annotations

from thingc.tools.editor.facts import Facts, facts_of
from thingc.tools.editor.refresh import Schemas

__all__ = ["Facts", "Schemas", "facts_of"]
