"""Parse YAML to a tree with source positions, using the parser events of libyaml.

The parser also checks rules of documents, such as unique keys.

PyYAML interprets values as YAML 1.1 (`on` is true, `1e-3` is a string). This module therefore uses only the parser events of PyYAML, and
interprets scalars by the rules of YAML 1.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NoReturn

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Note, Report
from thingc.base.source import MappingNode, Node, Scalar, ScalarNode, SequenceNode, Span
from thingc.base.suggestions import Hint, Suggestion, did_you_mean
from thingc.base.units import scan_number, shorten
from thingc.documents.load.text import MAX_ALIAS_NODES, MAX_FAULTS, MAX_LEVELS, MAX_NODES, Source
from thingc.documents.load.yaml_scalars import core_value
from thingc.documents.load.yaml_syntax import explain


def read_yaml(source: Source, report: Report) -> Node | None:
    """Parse a YAML 1.2 document to a tree. If the document is invalid, report the errors and return None.

    Some errors are reported and corrected, so that later passes can check the rest of the document. For example, the first of several
    duplicate keys is used.
    """
    import yaml

    loader = getattr(yaml, "CLoader", yaml.Loader)
    try:
        return _Builder(source, report, yaml.parse(source.text, Loader=loader)).document()
    except _Stop:
        return None
    except yaml.YAMLError as error:
        report_syntax(error, source, report)
        return None


def report_syntax(error: Any, source: Source, report: Report) -> None:
    """Report a YAML syntax error, with its position and a hint about the probable intention."""
    problem, context = getattr(error, "problem_mark", None), getattr(error, "context_mark", None)
    position = min(problem.index if problem is not None else 0, len(source.text))
    # libyaml has a limit of 1 000 levels, which is larger than MAX_LEVELS. But libyaml reads ahead, so it may raise its own error first.
    if "nesting depth" in str(getattr(error, "problem", "")):
        report.add(Code.TOO_LARGE, f"the document has more than {MAX_LEVELS} levels of nesting", source.span(position, position + 1))
        return
    fault = explain(
        source, problem=str(getattr(error, "problem", None) or error), at=position, context=str(getattr(error, "context", None) or ""),
        began=min(context.index, len(source.text)) if context is not None else position,
    )
    notes = () if fault.note is None else (Note(message=fault.note[0], span=source.span(fault.note[1], fault.note[1] + 1)),)
    report.add(Code.SYNTAX, fault.message, source.span(fault.start, fault.end), help=fault.help, notes=notes)


class _Stop(Exception):
    """Raised to stop parsing a YAML document. The reason is reported before the exception is raised."""


@dataclass(slots=True)
class _Anchored:
    """A YAML anchor: its node (once complete), the number of nodes in it with all aliases expanded, and its depth."""

    node: Node | None = None
    nodes: int = 1
    height: int = 0


class _Builder:
    """Builds the tree of a YAML document from parser events, in one pass.

    `nodes` is the number of nodes read so far, with all aliases expanded, and `from_aliases` the number of these from aliases. `deepest` is
    the largest depth of the value that is being read.
    """

    def __init__(self, source: Source, report: Report, events: Any) -> None:
        self.source = source
        self.report = report
        self.events = events
        self.anchors: dict[str, _Anchored] = {}
        self.faults_before = len(report.diagnostics)
        self.nodes = 0
        self.from_aliases = 0
        self.deepest = 0

    def document(self) -> Node | None:
        root: Node | None = None
        for event in self.events:
            kind = type(event).__name__
            if kind == "DocumentStartEvent":
                if root is not None:
                    message = "expected one document per file, found a second document"
                    self.stop(Code.SEVERAL_DOCUMENTS, message, self.span(event), "move the second document to a separate file")
                if event.version is not None and tuple(event.version) != (1, 2):
                    found = ".".join(map(str, event.version))
                    message = f"expected YAML 1.2, found `%YAML {found}`"
                    self.report.add(Code.SYNTAX, message, self.source.span(0, 5), help="remove the `%YAML` line")
                root = self.node(next(self.events), 1)
        return root

    def span(self, event: Any) -> Span:
        return self.source.span(event.start_mark.index, event.end_mark.index)

    def stop(self, code: Code, message: str, span: Span, help: Hint | None = None) -> NoReturn:
        """Report an error after which the rest of the document is not read."""
        self.report.add(code, message, span, help=help)
        raise _Stop

    def node(self, event: Any, level: int) -> Node:
        kind = type(event).__name__
        if kind == "AliasEvent":
            return self.alias(event, level)
        self.nodes += 1
        self.deepest = max(self.deepest, level)
        self.check_limits(event, level)
        if event.tag is not None:
            start = event.start_mark.index
            tag = self.source.text[start : event.end_mark.index].split(None, 1)[0] if kind == "ScalarEvent" else event.tag
            self.report.add(
                Code.TAG, f"tags such as `{shorten(tag)}` are not supported", self.source.span(start, start + max(1, len(tag))),
                help="remove the tag",
            )
        anchored = _Anchored() if event.anchor is not None else None
        if anchored is not None:
            self.anchors[event.anchor] = anchored
        before, deepest = self.nodes, self.deepest
        self.deepest = level
        node: Node
        if kind == "ScalarEvent":
            node = self.scalar(event)
        else:
            node = self.sequence(event, level) if kind == "SequenceStartEvent" else self.mapping(event, level)
        if anchored is not None:
            anchored.node = node
            anchored.nodes = self.nodes - before + 1
            anchored.height = self.deepest - level
        self.deepest = max(self.deepest, deepest)
        return node

    def check_limits(self, event: Any, level: int) -> None:
        """Raise `_Stop` if the document is nested too deeply, is too large, or has too many errors."""
        if level > MAX_LEVELS:
            message = f"the document has more than {MAX_LEVELS} levels of nesting"
        elif self.nodes > MAX_NODES:
            message = f"the document has more than {MAX_NODES} values"
        elif len(self.report.diagnostics) - self.faults_before > MAX_FAULTS:
            message = f"the document has more than {MAX_FAULTS} errors (the rest was not read)"
        else:
            return
        start = event.start_mark.index
        self.stop(Code.TOO_LARGE, message, self.source.span(start, start + 1))

    def alias(self, event: Any, level: int) -> Node:
        anchored = self.anchors.get(event.anchor)
        if anchored is None:
            help: Hint = f'put a value that starts with `*` in quotes: `"*{event.anchor}..."`'
            if self.anchors:
                help = did_you_mean(event.anchor, self.anchors, what="anchors")
            self.stop(Code.ALIAS, f"the alias `*{event.anchor}` has no anchor", self.span(event), help)
        if anchored.node is None:
            self.stop(Code.ALIAS, f"the alias `*{event.anchor}` is inside its own anchor", self.span(event))
        self.from_aliases += anchored.nodes
        self.nodes += anchored.nodes
        self.deepest = max(self.deepest, level + anchored.height)
        if self.from_aliases > MAX_ALIAS_NODES:
            self.stop(Code.TOO_LARGE, f"aliases expand to more than {MAX_ALIAS_NODES} values", self.span(event))
        if level + anchored.height > MAX_LEVELS:
            self.stop(Code.TOO_LARGE, f"the document has more than {MAX_LEVELS} levels of nesting", self.span(event))
        return anchored.node

    def scalar(self, event: Any) -> ScalarNode:
        text: str = event.value
        plain = not event.style
        start, end = event.start_mark.index, event.end_mark.index
        if event.anchor is not None or event.tag is not None:
            start = self.skip_properties(start, end)
        if not plain and event.style in "|>":
            end = start + len(self.source.text[start:end].rstrip())
        span = self.source.span(start, end)
        value: Scalar = text
        damaged = False
        if plain:
            try:
                value = core_value(text)
            except OverflowError:
                self.report.add(Code.NOT_FINITE, f"expected a finite number, found `{shorten(text)}`", span)
                value, damaged = 0, True
        return ScalarNode(value=value, text=text, span=span, damaged=damaged)

    def skip_properties(self, start: int, end: int) -> int:
        """Return the index of the first character of a scalar after its `&anchor` and `!tag`."""
        text = self.source.text
        while start < end and text[start] in "&!":
            while start < end and not text[start].isspace():
                start += 1
            while start < end and text[start].isspace():
                start += 1
        return start

    def sequence(self, event: Any, level: int) -> SequenceNode:
        items: list[Node] = []
        next_event = next(self.events)
        while type(next_event).__name__ != "SequenceEndEvent":
            if event.flow_style and _is_cut_expression(next_event):
                pieces = [next_event]
                while _has_open_parenthesis(pieces) and type(next_event := next(self.events)).__name__ == "ScalarEvent":
                    pieces.append(next_event)
                items.append(self.rejoin(pieces))
                if next_event not in pieces:
                    continue
            else:
                items.append(self.node(next_event, level + 1))
            next_event = next(self.events)
        return SequenceNode(items=tuple(items), span=self.collection_span(event, next_event))

    def mapping(self, event: Any, level: int) -> MappingNode:
        entries: dict[str, Node] = {}
        keys: dict[str, Span] = {}
        damaged = False
        next_event = next(self.events)
        bare_keys: list[tuple[Any, Any]] = []
        while bare_keys or type(next_event).__name__ != "MappingEndEvent":
            if bare_keys:
                key_event, value = bare_keys.pop(0)
                key = self.key(key_event, level)
            else:
                key = self.key(next_event, level)
                value, next_event = next(self.events), None
            node: Node
            if event.flow_style and _is_cut_expression(value):
                node, next_event = self.rejoined_entries(value)
            else:
                node = self.node(value, level + 1)
            damaged = damaged or key is None
            if not bare_keys and next_event is None:
                next_event = next(self.events)
                if event.flow_style and _is_value(value) and _is_value(next_event):
                    bare_keys, next_event = self.bare_keys(next_event)
                    if len(bare_keys) == 2 and next_event is not None:
                        node, bare_keys = self.vector(value, [piece for piece, _ in bare_keys]), []
            if key is not None:
                name, key_span = key
                if name in entries:
                    self.report.add(
                        Code.DUPLICATE_KEY, f"duplicate key `{shorten(name)}`", key_span,
                        notes=[Note(message="first defined here", span=keys[name])], help="remove or rename one of the two keys",
                    )
                else:
                    entries[name], keys[name] = node, key_span
        return MappingNode(entries=entries, keys=keys, span=self.collection_span(event, next_event), damaged=damaged)

    def collection_span(self, first: Any, last: Any) -> Span:
        """Return the span of a mapping or list without trailing spaces and comments. `first` and `last` are its first and last event."""
        start, text = first.start_mark.index, self.source.text
        if first.flow_style:
            return self.source.span(start, max(first.end_mark.index, last.end_mark.index))
        end = min(last.start_mark.index, len(text))
        # libyaml ends a block collection at the start of the next token: exclude comments and blank lines before that token
        while end > start:
            line = self.source.line_at(end - 1)
            line_start = max(self.source.starts[line], start)
            line_text = text[line_start:end].strip()
            if line_text and not (line_text.startswith("#") and line_start != start):
                end = line_start + len(text[line_start:end].rstrip())
                break
            end = line_start
            if line_start == start:
                break
        return self.source.span(start, max(start, end))

    def key(self, event: Any, level: int) -> tuple[str, Span] | None:
        """Return the text and the span of a mapping key. If the key is invalid, report the error and return None."""
        kind = type(event).__name__
        if kind == "AliasEvent":
            if event.anchor not in self.anchors:
                key_text = self.source.text[event.start_mark.index :].partition(":")[0].strip()
                self.report.add(
                    Code.ALIAS, f"the alias `*{event.anchor}` has no anchor", self.span(event),
                    help=f'put a key that starts with `*` in quotes: `"{shorten(key_text)}"`',
                )
            else:
                self.report.add(Code.KEY_NOT_TEXT, f"a key must not be an alias, found `*{event.anchor}`", self.span(event))
            return None
        start = event.start_mark.index
        if self.source.text[max(0, start - 1) : start] == "?" and not self.source.text[start : start + 1].isspace():
            # libyaml reads the `?` of `{?_knee: 1}` as an explicit key, although no space follows
            self.stop(Code.SYNTAX, "a name cannot start with `?`", self.source.span(start - 1, start), "put the name in quotes")
        node = self.node(event, level + 1)
        if not isinstance(node, ScalarNode):
            found = "a list" if isinstance(node, SequenceNode) else "a mapping"
            self.report.add(
                Code.KEY_NOT_TEXT, f"a key must be a string, found {found}", node.span,
                help="put a string that starts with `{` or `[` in quotes",
            )
            return None
        if isinstance(node.value, str):
            if node.value == "<<" and not event.style:
                self.report.add(
                    Code.ALIAS, "the merge key `<<` is not supported", node.span,
                    help="copy the keys into this mapping, or use `defaults:`",
                )
                return None
            return node.value, node.span
        if node.text.isdecimal() and node.text.isascii() and not event.style:
            return node.text, node.span  # an index, as in `limit: {0: ..., 1: ...}`
        if node.text == "":
            self.report.add(Code.KEY_NOT_TEXT, "a key is missing before the `:`", self.source.span(start, start))
            return None
        value_kind = "the number" if not isinstance(node.value, (bool, type(None))) else "the word"
        self.report.add(
            Code.KEY_NOT_TEXT, f"a key must be a string, found {value_kind} `{shorten(node.text)}`", node.span,
            help=f'write `"{shorten(node.text)}"`',
        )
        return None

    # An unquoted comma inside `{length: =min(a, 80 mm)}` ends the value: the rest becomes keys without values, or further items of a list.
    # Report one error, and join the pieces to the intended value.

    def bare_keys(self, event: Any) -> tuple[list[tuple[Any, Any]], Any]:
        """Read up to two keys without values, which are the other elements of a vector without brackets.

        `event` is the first parser event to examine. Return pairs (key event, value event) and the next event. If the last key has a value,
        the returned event is None.
        """
        pairs: list[tuple[Any, Any]] = []
        while len(pairs) < 2 and _is_value(event):
            value = next(self.events)
            pairs.append((event, value))
            if type(value).__name__ != "ScalarEvent" or value.value or value.style:
                return pairs, None
            event = next(self.events)
        return pairs, event

    def vector(self, first: Any, others: list[Any]) -> ScalarNode:
        """Return the vector that a user probably meant by three values without brackets, as in `{xyz: 0, 0, 4 mm}`."""
        start, end = first.start_mark.index, others[-1].end_mark.index
        span, text = self.source.span(start, end), " ".join(piece.value for piece in (first, *others))
        original = self.source.text[start:end]
        unit_at_end = all(scan_number(piece.value) == (piece.value, len(piece.value)) for piece in (first, others[0]))
        corrected = text if unit_at_end else f"[{original}]"  # a unit at the end applies to all three values
        self.report.add(
            Code.EXPRESSION_COMMA, "unexpected comma in a vector without brackets", span,
            help=Suggestion(f"write `{shorten(corrected)}`", (original, corrected) if "\n" not in original else None),
        )
        return ScalarNode(value=text, text=text, span=span, damaged=True)

    def rejoined_entries(self, first: Any) -> tuple[ScalarNode, Any]:
        """Join the pieces of an expression that begins with the event `first` and that an unquoted comma split.

        Return the expression and the next event.
        """
        pieces = [first]
        next_event = next(self.events)
        while _has_open_parenthesis(pieces) and type(next_event).__name__ == "ScalarEvent":
            value = next(self.events)
            pieces.append(next_event)
            if type(value).__name__ != "ScalarEvent" or value.value or value.style:
                self.rejoin(pieces)
                raise _Stop
            next_event = next(self.events)
        return self.rejoin(pieces), next_event

    def rejoin(self, pieces: list[Any]) -> ScalarNode:
        """Join the pieces of an expression. If there are several pieces, report the comma that split the expression."""
        start, end = pieces[0].start_mark.index, pieces[-1].end_mark.index
        text, span = " ".join(self.source.text[start:end].split()), self.source.span(start, end)
        if len(pieces) > 1:
            quoted = f"'{text}'" if '"' in text else f'"{text}"'
            self.report.add(
                Code.EXPRESSION_COMMA, "unexpected comma in an expression without quotes", span,
                help=Suggestion(f"write `{shorten(quoted)}`", (text, quoted) if text == self.source.text[start:end] else None),
            )
        self.nodes += 1
        return ScalarNode(value=text, text=text, span=span)


def _is_cut_expression(event: Any) -> bool:
    """Return whether a parser event is an unquoted scalar that contains an expression with unclosed parentheses."""
    return type(event).__name__ == "ScalarEvent" and not event.style and event.value.startswith("=") and _has_open_parenthesis([event])


def _is_value(event: Any) -> bool:
    """Return whether a parser event is an unquoted scalar that begins with a number or an expression."""
    if type(event).__name__ != "ScalarEvent" or event.style:
        return False
    return event.value.startswith("=") or scan_number(event.value) is not None


def _has_open_parenthesis(pieces: list[Any]) -> bool:
    return bool(sum(piece.value.count("(") - piece.value.count(")") for piece in pieces) > 0)


def is_flow(text: str) -> bool:
    """Return whether a string looks like a mapping or a list in YAML's flow style. The string need not be well-formed."""
    return text.startswith("{") or text.startswith("[") and text.endswith("]")


def read_flow(text: str, place: Span) -> Node | Diagnostic:
    """Parse a one-line mapping or list in flow style, such as `{on: floor}`, to a tree. All nodes of the tree have the span `place`.

    If the text is invalid, return a diagnostic instead.
    """
    report = Report()
    tree = read_yaml(Source("", text), report)
    return report.diagnostics[0] if tree is None or report.failed else _with_span(tree, place)


def _with_span(node: Node, place: Span) -> Node:
    if isinstance(node, MappingNode):
        entries = {key: _with_span(child, place) for key, child in node.entries.items()}
        return replace(node, entries=entries, keys=dict.fromkeys(entries, place), span=place)
    if isinstance(node, SequenceNode):
        return replace(node, items=tuple(_with_span(child, place) for child in node.items), span=place)
    return replace(node, span=place)
