"""YAML text to pieces, from libyaml's events."""

from __future__ import annotations

import re
from typing import Any

from thingc.documents.format.segments import Item, Segment, Trivia, UnsupportedStyle, body_of, gap

_COLON = re.compile(r"[ \t]*:(?=\s|$)")
_FLOW_COLON = re.compile(r"[ \t]*:[ \t]*")
_BLOCK_ANCHOR = re.compile(r"&\S+")


def yaml_pieces(text: str) -> tuple[Segment, int, list[str | None]]:
    """The root of a well-formed YAML text, where the document begins (behind `---`), and the comments above its first key.

    Raises Unusual for texts with explicit keys (`?`), texts that keep their last line breaks (`|+`), an end mark (`...`), or
    lists with empty items: rare forms, which are left alone.
    """
    import yaml

    events: Any = iter(yaml.parse(text, Loader=getattr(yaml, "CLoader", yaml.Loader)))
    start = 0
    root: Segment | None = None
    for event in events:
        if type(event).__name__ == "DocumentStartEvent":
            if event.version is not None or event.tags:
                raise UnsupportedStyle
            if event.explicit:
                start = event.end_mark.index
            root = _Cutter(text, events).piece(next(events))
        elif type(event).__name__ == "DocumentEndEvent" and event.explicit:
            raise UnsupportedStyle
    if root is None or root.kind != "map":
        raise UnsupportedStyle
    return root, start, _Commenter(text).run(root, start)


class _Cutter:
    """Events to pieces; columns are those of the text."""

    def __init__(self, text: str, events: Any) -> None:
        self.text = text
        self.events = events

    def piece(self, event: Any) -> Segment:
        kind = type(event).__name__
        start, end = event.start_mark.index, event.end_mark.index
        if kind == "AliasEvent":
            return Segment(kind="scalar", start=start, end=end, body=start, aliases=frozenset((event.anchor,)))
        anchors = frozenset((event.anchor,)) if event.anchor is not None else frozenset()
        if kind == "ScalarEvent":
            if event.style in ("|", ">"):
                end = self.block_end(start, end)
            return Segment(kind="scalar", start=start, end=end, body=self.body(start, anchors), anchors=anchors)
        if kind == "MappingStartEvent":
            return self.mapping(event, anchors)
        return self.sequence(event, anchors)

    def body(self, start: int, anchors: frozenset[str]) -> int:
        return body_of(self.text, start) if anchors else start

    def block_end(self, start: int, end: int) -> int:
        """The end of a block text: of its last line that is no mere empty line."""
        written = self.text[start:end]
        header, _, rest = written.partition("\n")
        header = header.partition("#")[0]
        if "+" in header or (end == len(self.text) and not written.endswith("\n") and "-" not in header):
            raise UnsupportedStyle  # line breaks at its end count, even the last of the file
        lines = rest.split("\n")
        indents = [len(line) - len(line.lstrip(" ")) for line in lines if line.strip(" ")]
        while lines and not lines[-1].strip(" ") and len(lines[-1]) <= min(indents, default=len(lines[-1])):
            lines.pop()
        return start + len("\n".join([written.partition("\n")[0], *lines]))

    def mapping(self, event: Any, anchors: frozenset[str]) -> Segment:
        items: list[Item] = []
        flow = bool(event.flow_style)
        start = event.start_mark.index
        odd = False
        following = next(self.events)
        while type(following).__name__ != "MappingEndEvent":
            key = (following.start_mark.index, following.end_mark.index)
            if type(following).__name__ != "ScalarEvent" or "\n" in self.text[key[0] : key[1]]:
                raise UnsupportedStyle
            value = self.piece(next(self.events))
            if following.anchor is not None:
                value.anchors |= {following.anchor}
            if flow:
                colon = _FLOW_COLON.match(self.text, key[1])
                odd = odd or colon is None or colon.end() != value.start or value.start == value.end
            items.append(Item(key=key, name=following.value, value=value))
            following = next(self.events)
        piece = self.collection("map", start, following, items, anchors, flow)
        piece.odd = flow and (odd or self.text[piece.body : piece.body + 1] != "{")
        return piece

    def sequence(self, event: Any, anchors: frozenset[str]) -> Segment:
        items: list[Item] = []
        flow = bool(event.flow_style)
        following = next(self.events)
        while type(following).__name__ != "SequenceEndEvent":
            value = self.piece(following)
            if value.start == value.end and value.kind == "scalar" and not flow:
                raise UnsupportedStyle
            items.append(Item(value=value))
            following = next(self.events)
        piece = self.collection("list", event.start_mark.index, following, items, anchors, flow)
        piece.odd = flow and any(item.value.start == item.value.end for item in items)
        return piece

    def collection(
        self, kind: str, start: int, last: Any, items: list[Item], anchors: frozenset[str], flow: bool,
    ) -> Segment:
        body = self.body(start, anchors)
        own = anchors
        for item in items:
            anchors |= item.value.anchors
        aliases = frozenset(name for item in items for name in item.value.aliases)
        if flow:
            if "\n" in self.text[start:body]:
                raise UnsupportedStyle
            return Segment(
                kind=kind, start=start, end=last.end_mark.index, body=body, flow=True, items=items, anchors=anchors, aliases=aliases,
            )
        if not items:
            raise UnsupportedStyle
        body = start
        if own:
            match = _BLOCK_ANCHOR.match(self.text, start)
            if match is None:
                raise UnsupportedStyle
            body = match.end()
        at = items[0].start if kind == "map" else start
        if kind == "list" and own:
            raise UnsupportedStyle
        return Segment(
            kind=kind, start=start, end=max(items[-1].value.end, items[-1].start), body=body, items=items,
            column=at - (self.text.rfind("\n", 0, at) + 1), anchors=anchors, aliases=aliases,
        )


class _Commenter:
    """Gives every comment to the entry by which it stands."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.last: Item | None = None
        self.inside = False
        self.ended: list[Segment] = []

    def run(self, root: Segment, start: int) -> list[str | None]:
        """Returns the comments above the first entry that belong to the document."""
        self.at = start
        if root.flow:
            head = gap(self.text, start, root.start)
            self.at = root.end
            foot = gap(self.text, root.end, len(self.text))
            if head.comment is not None or foot.comment is not None:
                raise UnsupportedStyle
            root.trailing = [line and line[1] for line in foot.lines]
            return [line and line[1] for line in head.lines]
        if start and self.text[start : start + 1] not in ("\n", ""):
            raise UnsupportedStyle
        self.at = min(start + 1, len(self.text)) if start else 0
        self.block(root)
        self.ended = [root, *self.ended]
        rest = self.take(gap(self.text, self.at, len(self.text)), -1)
        root.trailing.extend(rest)
        return self.head(root.items[0])

    def head(self, first: Item) -> list[str | None]:
        """Comments with an empty line below them, and those for editors, belong to the document, not to its first key."""
        lines = first.leading
        cut = max((at for at, line in enumerate(lines) if line is None or is_modeline(line)), default=-1) + 1
        first.leading = lines[cut:]
        return lines[:cut]

    def block(self, piece: Segment) -> None:
        before: Item | None = None
        for item in piece.items:
            self.ended = _chain(before.value) if before is not None else []
            if item.key is not None:
                item.leading = self.take(gap(self.text, self.at, item.start, compact=self.inside), piece.column)
                self.mapping_item(item)
            else:
                self.list_item(item, piece)
            before = item
        self.ended = _chain(before.value) if before is not None else []

    def mapping_item(self, item: Item) -> None:
        assert item.key is not None
        colon = _COLON.match(self.text, item.key[1])
        if colon is None:
            raise UnsupportedStyle
        self.value(item, colon.end())

    def list_item(self, item: Item, piece: Segment) -> None:
        dash = self.at
        while dash < item.value.start:
            # a comment above may hold dashes, too: that of the list stands in its column
            if self.text[dash] == "-" and dash - (self.text.rfind("\n", 0, dash) + 1) == piece.column:
                break
            dash += 1
        else:
            raise UnsupportedStyle
        item.dash = dash
        item.leading = self.take(gap(self.text, self.at, dash, compact=self.inside), piece.column)
        self.value(item, dash + 1)

    def value(self, item: Item, at: int) -> None:
        value = item.value
        if value.block:
            if self.text[at : value.start].strip() and value.body != value.start:
                raise UnsupportedStyle
            self.at = value.body if value.body != value.start else at
            self.last, self.inside = item, True
            self.block(value)
            return
        item.verbatim = "#" in self.text[at : value.start]
        if value.start < value.end:
            self.at = value.end
        else:
            self.at = at
            value.start = value.end = value.body = at
        self.last, self.inside = item, False

    def take(self, gap: Trivia, column: int) -> list[str | None]:
        """Give away what stands in a gap; returns the lines that lead the entry in `column`, which follows it."""
        if gap.comment is not None:
            if self.last is None:
                raise UnsupportedStyle
            if self.inside:
                self.last.key_comment = gap.comment
            else:
                self.last.comment = gap.comment
        chain = list(self.ended)
        leading: list[str | None] = []
        blanks = 0
        trailing = True
        for line in gap.lines:
            if line is None:
                blanks += 1
                continue
            place, words = line
            chain = [piece for piece in chain if piece.column <= place] if trailing else []
            trailing = trailing and place > column and bool(chain)
            target = chain[-1].trailing if trailing else leading
            target.extend([None] * blanks)
            target.append(words)
            blanks = 0
        leading.extend([None] * blanks)
        return leading


def is_modeline(line: str) -> bool:
    """Whether a comment is for an editor or a language server, which look for it at the top of the file."""
    return bool(re.match(r"#\s*(yaml-language-server:|-\*-|vim?:|:schema\b)", line))


def _chain(piece: Segment) -> list[Segment]:
    """The blocks that end where this value ends, outermost first."""
    blocks: list[Segment] = []
    while piece.block:
        blocks.append(piece)
        piece = piece.items[-1].value
    return blocks
