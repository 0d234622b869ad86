"""What readers meet that a document does not say: noted where it is met, and told in the order of the source."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from thingc.base.source import Span
from thingc.tools.importing.source_model import SourceLoss
from thingc.tools.importing.xml_source import SourceElement


class Losses:
    """Those of one source, begun with what was noted `before`."""

    def __init__(self, before: Iterable[SourceLoss] = ()) -> None:
        self._noted = list(before)

    def note(self, what: str, why: str, where: Span) -> None:
        """One more: `what` it is, and `why` it is not in the document."""
        self._noted.append(SourceLoss(what=what, why=why, where=where))

    def all(self) -> tuple[SourceLoss, ...]:
        """Those that were noted, from the first line of the source to the last."""
        return tuple(sorted(self._noted, key=lambda one: (one.where.file, one.where.line, one.where.column)))

    def unread(
        self, element: SourceElement, attributes: Mapping[str, Collection[str]], inside: Mapping[str, Collection[str]],
        idle: Mapping[str, Collection[str]], read: Collection[Span] = (),
    ) -> None:
        """Note each element in another, and each attribute, that is not read, the whole of it: `attributes` and `inside` are those that
        are, by tag, `idle` by tag the texts with which one that is not says nothing; and what stands at the places `read` is."""
        for attribute in element.attributes:
            if attribute not in attributes.get(element.tag, ()) and not attribute.startswith("xmlns"):
                self.note(f"`{attribute}` of `<{element.tag}>`", "it is not read", element.where)
        for child in element.children:
            if child.tag in inside.get(element.tag, ()):
                self.unread(child, attributes, inside, idle, read)
            elif child.where not in read and child.text.lower() not in idle.get(child.tag, ()):
                self.note(f"`<{child.tag}>` of `<{element.tag}>`", "it is not read", child.where)
