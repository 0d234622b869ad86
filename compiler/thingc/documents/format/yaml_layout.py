"""The canonical layout of a YAML document."""

from __future__ import annotations

from thingc.documents.format.flow_style import Inline, order_of, outline
from thingc.documents.format.key_order import shape_below, shape_for
from thingc.documents.format.segments import Item, Segment, commented, shifted, tidy
from thingc.documents.format.yaml_segments import yaml_pieces
from thingc.documents.spec.annotation_types import FieldType

INDENT = 2
"""Columns of one level."""


def yaml_layout(text: str, shape: FieldType | None) -> str:
    """The text in canonical layout (lines end with a line feed, as those of `text` do). Raises Unusual."""
    root, start, head = yaml_pieces(text)
    printer = _Printer(text)
    lines: list[str] = []
    if start:
        lines.extend(line.rstrip() for line in text[:start].split("\n"))
    opening = tidy(list(head))
    while opening and opening[0] is None:
        opening.pop(0)
    lines.extend(line or "" for line in opening)
    if root.flow:
        lines.extend(printer.inline.value(root, shape, 0).split("\n"))
        lines.extend(_own_lines(root.trailing, 0))
    else:
        lines.extend(printer.mapping(root, shape, 0, top=True))
    while lines and not lines[-1]:
        lines.pop()
    return "\n".join(lines) + "\n"


class _Printer:
    """Prints blocks; every method returns lines with their indentation."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.inline = Inline(text, ": ")

    def mapping(self, piece: Segment, shape: FieldType | None, indent: int, *, top: bool = False) -> list[str]:
        # an alias may stand where a person chooses the keys, and there their order counts
        shape = None if piece.body > piece.start else shape
        shape = shape_for(shape, outline(piece))
        items = [piece.items[at] for at in order_of(piece.items, shape)]
        spaces = self.alignment(items)
        lines: list[str] = []
        for at, item in enumerate(items):
            leading = tidy(item.leading)
            before = items[at - 1] if at else None
            if before is None or (top and before.value.block):
                while leading and leading[0] is None:
                    leading.pop(0)
            if before is not None and top and before.value.block:
                leading.insert(0, None)
            lines.extend(_own_lines(leading, indent))
            lines.extend(self.entry(item, shape, indent, piece.column, spaces[at]))
        return [*lines, *_own_lines(tidy(piece.trailing), indent)]

    def alignment(self, items: list[Item]) -> list[int]:
        """The spaces behind the colon of each entry: more than one where a neighbour's value stands in the same column."""
        written: list[tuple[int, int] | None] = []
        for item in items:
            assert item.key is not None
            between = self.text[item.key[1] : item.value.start]
            plain = not item.value.block and item.value.start < item.value.end and between.startswith(":")
            if not plain or between[1:].strip(" "):
                written.append(None)
            else:
                written.append((len(between) - 1, item.value.start - item.key[0]))
        spaces: list[int] = []
        for at, own in enumerate(written):
            near = [other for other in (written[at - 1] if at else None, written[at + 1] if at + 1 < len(written) else None) if other]
            aligned = own is not None and any(other[1] == own[1] for other in near)
            spaces.append(own[0] if own is not None and aligned else 1)
        return spaces

    def entry(self, item: Item, shape: FieldType | None, indent: int, column: int, spaces: int) -> list[str]:
        assert item.key is not None
        value = item.value
        below = shape_below(shape, item.name)
        head = " " * indent + self.text[item.key[0] : item.key[1]] + ":"
        if value.block:
            return [self.head(head, item), *self.block(value, below, indent + INDENT)]
        if value.start == value.end:
            return [commented(head, item.comment)]
        if item.verbatim:
            written = shifted(self.text[item.key[0] : value.end], indent - column)
            lines = (" " * indent + written).split("\n")
        else:
            written = self.leaf(value, below, indent - column)
            lines = f"{head}{' ' * spaces}{written}".split("\n")
        lines[-1] = commented(lines[-1], item.comment)
        return lines

    def head(self, head: str, item: Item) -> str:
        """The line above a block, with its anchor and comment."""
        value = item.value
        if value.body > value.start:
            head += " " + self.text[value.start : value.body]
        return commented(head, item.key_comment)

    def leaf(self, piece: Segment, shape: FieldType | None, by: int) -> str:
        """A value that is no block; the lines of a block text that hold nothing stay empty."""
        written = self.inline.value(piece, shape, by)
        if piece.kind == "scalar" and self.text[piece.body] in "|>":
            original = self.text[piece.start : piece.end].split("\n")
            indents = [len(line) - len(line.lstrip(" ")) for line in original[1:] if line.strip(" ")]
            if "\t" in original[0]:
                original[0] = original[0].rstrip()
            least = min(indents, default=0)
            lines = written.split("\n")
            for at, line in enumerate(original):
                if at == 0:
                    lines[0] = lines[0].rstrip()
                elif not line.strip(" ") and len(line) <= least:
                    lines[at] = ""
            return "\n".join(lines)
        return written

    def block(self, piece: Segment, shape: FieldType | None, indent: int) -> list[str]:
        if piece.kind == "map":
            return self.mapping(piece, shape, indent)
        shape = shape_for(shape, outline(piece))
        lines: list[str] = []
        for at, item in enumerate(piece.items):
            leading = tidy(item.leading)
            while at == 0 and leading and leading[0] is None:
                leading.pop(0)
            lines.extend(_own_lines(leading, indent))
            lines.extend(self.list_item(item, shape_below(shape, None), indent, piece.column))
        return [*lines, *_own_lines(tidy(piece.trailing), indent)]

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
            lines = shifted(" " * indent + self.text[item.dash : value.end], by).split("\n")
        else:
            lines = f"{dash} {self.leaf(value, shape, by)}".split("\n")
        lines[-1] = commented(lines[-1], item.comment)
        return lines


def _own_lines(lines: list[str | None], indent: int) -> list[str]:
    return [" " * indent + line if line is not None else "" for line in lines]
