"""Format a YAML document in the canonical layout. The parser is libyaml, whose parser events contain the positions of all values."""

from __future__ import annotations

import re
from typing import Any

from thingc.documents.format.flow_style import Inline, order_of, outline, shape_below, shape_for
from thingc.documents.format.segments import Item, Segment, Trivia, UnsupportedStyle, alignments, append_comment, gap, indent_rest, tidy
from thingc.documents.spec.annotation_types import FieldType

_COLON = re.compile(r"[ \t]*:(?=\s|$)")
_FLOW_COLON = re.compile(r"[ \t]*:[ \t]*")
_BLOCK_ANCHOR = re.compile(r"&\S+")
_ANCHOR = re.compile(r"&[^\s\[\]{},]+\s+")


def cut_yaml(text: str) -> tuple[Segment, int, list[str | None]]:
    """Split a well-formed YAML document into segments. Return its root value, its start index (after `---`), and the comments at its top.

    Raises `UnsupportedStyle` for explicit keys (`?`), block scalars that keep trailing line breaks (`|+`), an end mark (`...`), or
    lists with empty items.
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
    """Converts the parser events of libyaml to segments, which contain the source position of every key and value."""

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
            return Segment(kind="scalar", start=start, end=end, body=self.body_of(start), anchors=anchors)
        if kind == "MappingStartEvent":
            return self.mapping(event, anchors)
        return self.sequence(event, anchors)

    def body_of(self, start: int) -> int:
        """Skip the anchor (`&name`) at the index `start`, if any, and return the index of the first character of the value."""
        match = _ANCHOR.match(self.text, start)
        return match.end() if match is not None else start

    def block_end(self, start: int, end: int) -> int:
        """Return the end of the last non-empty line of a block scalar."""
        block_text = self.text[start:end]
        header, _, rest = block_text.partition("\n")
        marks = header.partition("#")[0]
        if "+" in marks or (end == len(self.text) and not block_text.endswith("\n") and "-" not in marks):
            raise UnsupportedStyle  # trailing line breaks are part of the value
        lines = rest.split("\n")
        indents = [len(line) - len(line.lstrip(" ")) for line in lines if line.strip(" ")]
        while lines and not lines[-1].strip(" ") and len(lines[-1]) <= min(indents, default=len(lines[-1])):
            lines.pop()
        return start + len("\n".join([header, *lines]))

    def mapping(self, event: Any, anchors: frozenset[str]) -> Segment:
        items: list[Item] = []
        flow = bool(event.flow_style)
        start = event.start_mark.index
        verbatim = False
        next_event = next(self.events)
        while type(next_event).__name__ != "MappingEndEvent":
            key = (next_event.start_mark.index, next_event.end_mark.index)
            if type(next_event).__name__ != "ScalarEvent" or "\n" in self.text[key[0] : key[1]]:
                raise UnsupportedStyle
            value = self.piece(next(self.events))
            if next_event.anchor is not None:
                value.anchors |= {next_event.anchor}
            if flow:
                colon = _FLOW_COLON.match(self.text, key[1])
                verbatim = verbatim or colon is None or colon.end() != value.start or value.start == value.end
            items.append(Item(key=key, name=next_event.value, value=value))
            next_event = next(self.events)
        piece = self.collection("map", start, next_event, items, anchors, flow)
        piece.verbatim = flow and (verbatim or self.text[piece.body : piece.body + 1] != "{")
        return piece

    def sequence(self, event: Any, anchors: frozenset[str]) -> Segment:
        items: list[Item] = []
        flow = bool(event.flow_style)
        next_event = next(self.events)
        while type(next_event).__name__ != "SequenceEndEvent":
            value = self.piece(next_event)
            if value.start == value.end and value.kind == "scalar" and not flow:
                raise UnsupportedStyle
            items.append(Item(value=value))
            next_event = next(self.events)
        piece = self.collection("list", event.start_mark.index, next_event, items, anchors, flow)
        piece.verbatim = flow and any(item.value.start == item.value.end for item in items)
        return piece

    def collection(self, kind: str, start: int, last: Any, items: list[Item], anchors: frozenset[str], flow: bool) -> Segment:
        body = self.body_of(start)
        all_anchors = anchors.union(*(item.value.anchors for item in items))
        aliases = frozenset(name for item in items for name in item.value.aliases)
        if flow:
            if "\n" in self.text[start:body]:
                raise UnsupportedStyle
            return Segment(
                kind=kind, start=start, end=last.end_mark.index, body=body, flow=True, items=items, anchors=all_anchors, aliases=aliases,
            )
        if not items or (kind == "list" and anchors):
            raise UnsupportedStyle
        body = start
        if anchors:
            match = _BLOCK_ANCHOR.match(self.text, start)
            if match is None:
                raise UnsupportedStyle
            body = match.end()
        first_start = items[0].start if kind == "map" else start
        return Segment(
            kind=kind, start=start, end=max(items[-1].value.end, items[-1].start), body=body, items=items,
            column=first_start - (self.text.rfind("\n", 0, first_start) + 1), anchors=all_anchors, aliases=aliases,
        )


class _Commenter:
    """Assigns every comment of a document to an entry, or to the block that ends above the comment.

    `position` is the index up to which comments are assigned. `last` is the previous entry, `inside` is True between the key of this entry
    and its block value, and `ended_blocks` contains the blocks that end at the position.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.position = 0
        self.last: Item | None = None
        self.inside = False
        self.ended_blocks: list[Segment] = []

    def run(self, root: Segment, start: int) -> list[str | None]:
        """Assign every comment to an entry, and return the comments at the top that describe the whole document."""
        if root.flow:
            head = gap(self.text, start, root.start)
            foot = gap(self.text, root.end, len(self.text))
            if head.comment is not None or foot.comment is not None:
                raise UnsupportedStyle
            root.trailing = [line and line[1] for line in foot.lines]
            return [line and line[1] for line in head.lines]
        if start and self.text[start : start + 1] not in ("\n", ""):
            raise UnsupportedStyle
        self.position = min(start + 1, len(self.text)) if start else 0
        self.block(root)
        self.ended_blocks = [root, *self.ended_blocks]
        root.trailing.extend(self.assign_comments(gap(self.text, self.position, len(self.text)), -1))
        # Comments before an empty line, and comments for an editor, belong to the document. The others remain with the first key.
        lines = root.items[0].leading
        cut = max((index for index, line in enumerate(lines) if line is None or is_modeline(line)), default=-1) + 1
        root.items[0].leading = lines[cut:]
        return lines[:cut]

    def block(self, piece: Segment) -> None:
        previous: Item | None = None
        for item in piece.items:
            self.ended_blocks = _ending_blocks(previous.value) if previous is not None else []
            if item.key is None:
                item.dash = self.find_dash(item, piece)
                start, end = item.dash, item.dash + 1
            elif (colon := _COLON.match(self.text, item.key[1])) is not None:
                start, end = item.start, colon.end()
            else:
                raise UnsupportedStyle
            item.leading = self.assign_comments(gap(self.text, self.position, start, compact=self.inside), piece.column)
            self.value(item, end)
            previous = item
        self.ended_blocks = _ending_blocks(previous.value) if previous is not None else []

    def find_dash(self, item: Item, piece: Segment) -> int:
        """Return the index of the dash before an item of the list `piece`."""
        for dash in range(self.position, item.value.start):
            # a comment above the list may also contain dashes: only the dash in the column of the list marks an item
            if self.text[dash] == "-" and dash - (self.text.rfind("\n", 0, dash) + 1) == piece.column:
                return dash
        raise UnsupportedStyle

    def value(self, item: Item, after_key: int) -> None:
        value = item.value
        if value.block:
            if self.text[after_key : value.start].strip() and value.body != value.start:
                raise UnsupportedStyle
            self.position = value.body if value.body != value.start else after_key
            self.last, self.inside = item, True
            self.block(value)
            return
        item.verbatim = "#" in self.text[after_key : value.start]
        if value.start < value.end:
            self.position = value.end
        else:
            self.position = after_key
            value.start = value.end = value.body = after_key
        self.last, self.inside = item, False

    def assign_comments(self, gap: Trivia, column: int) -> list[str | None]:
        """Assign the comments in `gap`, between two entries, to the previous entry or to the blocks that end there.

        Return the remaining comment lines, which belong to the next entry. This entry begins in the column `column`.
        """
        if gap.comment is not None:
            if self.last is None:
                raise UnsupportedStyle
            if self.inside:
                self.last.key_comment = gap.comment
            else:
                self.last.comment = gap.comment
        open_blocks = list(self.ended_blocks)
        leading: list[str | None] = []
        blank_count = 0
        trailing = True
        for line in gap.lines:
            if line is None:
                blank_count += 1
                continue
            comment_column, comment = line
            open_blocks = [piece for piece in open_blocks if piece.column <= comment_column] if trailing else []
            trailing = trailing and comment_column > column and bool(open_blocks)
            receiver = open_blocks[-1].trailing if trailing else leading
            receiver.extend([None] * blank_count)
            receiver.append(comment)
            blank_count = 0
        leading.extend([None] * blank_count)
        return leading


def is_modeline(line: str) -> bool:
    """Return whether a comment configures an editor or a language server. Such comments must be at the top of the file."""
    return bool(re.match(r"#\s*(yaml-language-server:|-\*-|vim?:|:schema\b)", line))


def _ending_blocks(piece: Segment) -> list[Segment]:
    """Return the block `piece`, its last value if this is also a block, and so on. These blocks all end at the same position."""
    blocks: list[Segment] = []
    while piece.block:
        blocks.append(piece)
        piece = piece.items[-1].value
    return blocks


INDENT = 2
"""Indentation per level, in columns."""


def yaml_layout(text: str, shape: FieldType | None) -> str:
    """Return the text of a YAML document in the canonical layout, with line feeds as line ends.

    Raises `UnsupportedStyle` for unsupported syntax.
    """
    root, start, head = cut_yaml(text)
    printer = _Printer(text)
    lines: list[str] = []
    if start:
        lines.extend(line.rstrip() for line in text[:start].split("\n"))
    lines.extend(line or "" for line in tidy(head, first=True))
    if root.flow:
        lines.extend(printer.inline.value(root, shape, 0).split("\n"))
        lines.extend(_indent_comments(root.trailing, 0))
    else:
        lines.extend(printer.mapping(root, shape, 0, top=True))
    return "\n".join(lines).rstrip("\n") + "\n"


class _Printer:
    """Formats the block mappings and lists of a YAML document. Each method returns the lines of a value with their indentation."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.inline = Inline(text, ": ")

    def mapping(self, piece: Segment, shape: FieldType | None, indent: int, *, top: bool = False) -> list[str]:
        # an alias may be among user-defined keys, which keep their order
        shape = None if piece.body > piece.start else shape
        shape = shape_for(shape, outline(piece))
        items = [piece.items[index] for index in order_of(piece.items, shape)]
        spaces = self.alignment(items)
        lines: list[str] = []
        for index, item in enumerate(items):
            after_block = top and index > 0 and items[index - 1].value.block
            leading = tidy(item.leading, first=index == 0 or after_block)
            lines.extend(_indent_comments([None, *leading] if after_block else leading, indent))
            lines.extend(self.entry(item, shape, indent, piece.column, spaces[index]))
        return [*lines, *_indent_comments(tidy(piece.trailing), indent)]

    def alignment(self, items: list[Item]) -> list[int]:
        """Return the number of spaces after the colon of each entry."""
        columns: list[tuple[int, int] | None] = []
        for item in items:
            assert item.key is not None
            gap_text = self.text[item.key[1] : item.value.start]
            plain = not item.value.block and item.value.start < item.value.end and gap_text.startswith(":") and not gap_text[1:].strip(" ")
            columns.append((len(gap_text) - 1, item.value.start - item.key[0]) if plain else None)
        return alignments(columns)

    def entry(self, item: Item, shape: FieldType | None, indent: int, column: int, spaces: int) -> list[str]:
        assert item.key is not None
        value = item.value
        below = shape_below(shape, item.name)
        head = " " * indent + self.text[item.key[0] : item.key[1]] + ":"
        if value.block:
            return [self.head(head, item), *self.block(value, below, indent + INDENT)]
        if value.start == value.end:
            return [append_comment(head, item.comment)]
        if item.verbatim:
            value_text = indent_rest(self.text[item.key[0] : value.end], indent - column)
            lines = (" " * indent + value_text).split("\n")
        else:
            value_text = self.leaf(value, below, indent - column)
            lines = f"{head}{' ' * spaces}{value_text}".split("\n")
        lines[-1] = append_comment(lines[-1], item.comment)
        return lines

    def head(self, head: str, item: Item) -> str:
        """Return the first line of an entry whose value is a block, with its anchor and comment."""
        value = item.value
        if value.body > value.start:
            head += " " + self.text[value.start : value.body]
        return append_comment(head, item.key_comment)

    def leaf(self, piece: Segment, shape: FieldType | None, by: int) -> str:
        """Format a scalar, an alias, or a value in braces or brackets. Trailing spaces are removed from empty lines of block scalars."""
        formatted = self.inline.value(piece, shape, by)
        if piece.kind == "scalar" and self.text[piece.body] in "|>":
            original = self.text[piece.start : piece.end].split("\n")
            least = min((len(line) - len(line.lstrip(" ")) for line in original[1:] if line.strip(" ")), default=0)
            first, *rest = formatted.split("\n")
            empty = [not line.strip(" ") and len(line) <= least for line in original[1:]]
            return "\n".join([first.rstrip(), *("" if is_empty else line for line, is_empty in zip(rest, empty, strict=True))])
        return formatted

    def block(self, piece: Segment, shape: FieldType | None, indent: int) -> list[str]:
        if piece.kind == "map":
            return self.mapping(piece, shape, indent)
        shape = shape_for(shape, outline(piece))
        lines: list[str] = []
        for index, item in enumerate(piece.items):
            lines.extend(_indent_comments(tidy(item.leading, first=index == 0), indent))
            lines.extend(self.list_item(item, shape_below(shape, None), indent, piece.column))
        return [*lines, *_indent_comments(tidy(piece.trailing), indent)]

    def list_item(self, item: Item, shape: FieldType | None, indent: int, column: int) -> list[str]:
        dash = " " * indent + "-"
        value = item.value
        if value.block:
            lines = self.block(value, shape, indent + INDENT)
            bare = item.key_comment is None and value.body == value.start
            if bare and not lines[0].lstrip().startswith("#"):
                return [f"{dash} {lines[0].lstrip(' ')}", *lines[1:]]
            return [self.head(dash, item), *lines]
        by = indent - column
        if item.verbatim:
            lines = indent_rest(" " * indent + self.text[item.dash : value.end], by).split("\n")
        else:
            lines = f"{dash} {self.leaf(value, shape, by)}".split("\n")
        lines[-1] = append_comment(lines[-1], item.comment)
        return lines


def _indent_comments(lines: list[str | None], indent: int) -> list[str]:
    return [" " * indent + line if line is not None else "" for line in lines]
