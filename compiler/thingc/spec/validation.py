"""Documents against their models: every error at its place, in the words of documents.

pydantic checks the plain values and says where in the model something is wrong. That location is followed through the
annotations (`shapes`): a union's tag is in pydantic's location but not in the document, so at a union the branch that
was meant is chosen by what is written there, and only its errors count.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pydantic_core import PydanticCustomError, ValidationError

from thingc.diagnostics import Code, Report
from thingc.slips import Hint, did_you_mean, near_hint, nearest
from thingc.source import Document, MappingNode, Path, ScalarNode, SequenceNode, Span, node_at, walk
from thingc.spec.allowances import allowances
from thingc.spec.assembly import AssemblySpec
from thingc.spec.base import Model
from thingc.spec.doubts import Doubts, Specs
from thingc.spec.fields import decimal_point, found, read_value
from thingc.spec.joint_values import dimension_at
from thingc.spec.materials import MaterialsSpec
from thingc.spec.pruning import ROUNDS, Fault, prune, take_out
from thingc.spec.shapes import Shape, branch_of, model_keys, one_of, shape_of, spoken
from thingc.spec.variants import VariantsSpec
from thingc.spec.workspace import WorkspaceSpec
from thingc.units import shortened

if TYPE_CHECKING:
    from thingc.load import Documents

MAX_FAULTS = 200
"""Faults said of one document."""

MODELS: dict[str, type[Model]] = {
    "assembly": AssemblySpec, "materials": MaterialsSpec, "workspace": WorkspaceSpec, "variants": VariantsSpec,
}
"""The model of each kind of document."""

_KINDS: dict[str, Code] = {
    "unit": Code.BAD_UNIT, "dimension": Code.WRONG_DIMENSION, "quantity": Code.BAD_QUANTITY, "expression": Code.BAD_EXPRESSION,
    "name": Code.BAD_NAME, "reference": Code.BAD_REFERENCE, "color": Code.BAD_COLOR, "vector": Code.WRONG_LENGTH,
    "type": Code.WRONG_TYPE, "rule": Code.BROKEN_RULE, "choice": Code.UNKNOWN_CHOICE,
}
"""The codes of errors that `spec.fields` and the models' own rules raise."""


def validate(documents: Documents, report: Report) -> Specs:
    """Check every document by itself: path in the workspace to its model.

    Of a document with faults (all reported) the model is that of its sound rest, and `doubts` says what was left out.
    Documents of which nothing useful stays are absent.
    """
    specs = Specs()
    for path, document in documents.by_path.items():
        spec, doubts = _sound(document, report)
        if isinstance(spec, (AssemblySpec, MaterialsSpec)) and path not in documents.broken:
            specs[path] = spec
            if doubts:
                specs.doubts[path] = doubts
            if isinstance(spec, AssemblySpec):
                specs.allowances.extend(allowances(spec, document))
    return specs


def validate_one(document: Document, report: Report) -> Model | None:
    """Check one document; None when it is wrong, which has been reported with every place."""
    spec, doubts = _sound(document, report)
    return None if doubts else spec


def _sound(document: Document, report: Report) -> tuple[Model | None, Doubts]:
    """The model of what is sound in a document, None where that is nothing; and what was left out (reported)."""
    model = MODELS.get(document.kind)
    if model is None:
        report.add(
            Code.WRONG_KIND, f"documents of kind `{document.kind}` cannot be used yet", document.span(("thingc",)),
        )
        return None, Doubts()
    plain = document.tree.plain()
    assert isinstance(plain, dict)
    plain.pop("$schema", None)  # for editors
    empty = _report_empty(document, report)
    damaged = frozenset(path for path, node in walk(document.tree) if not isinstance(node, SequenceNode) and node.damaged)
    _build(model)
    try:
        spec = model.model_validate(plain, strict=True)
        if not empty and not damaged:
            return spec, Doubts()
        faults: list[Fault] = []
    except ValidationError as error:
        faults = list(_faults(shape_of(model), plain, (), error))
        _Reporter(document, report, empty, damaged).say(faults)
    if model is WorkspaceSpec:
        return None, Doubts()
    return _rest(model, plain, faults, empty | damaged)


def _rest(model: type[Model], plain: dict[str, Any], faults: list[Fault], wrong: frozenset[Path]) -> tuple[Model | None, Doubts]:
    """The model of a document without its faults and without the values at the paths `wrong`, and what is in doubt then."""
    doubts: set[Path] = set()
    found = prune(plain, faults)
    for path in wrong:
        taken = take_out(plain, path)
        if found is None or taken is None:
            return None, Doubts()
        found.add(taken)
    for _ in range(ROUNDS):
        if found is None:
            break
        doubts |= found
        try:
            return model.model_validate(plain, strict=True), Doubts(paths=frozenset(doubts))
        except ValidationError as error:
            found = prune(plain, _faults(shape_of(model), plain, (), error))
    return None, Doubts()


def _build(model: type[Model]) -> None:
    """Build a model's validator at its first use, without pydantic's search for plugins in all installed packages."""
    if model.__pydantic_complete__:
        return
    switch = "PYDANTIC_DISABLE_PLUGINS"
    before = os.environ.get(switch)
    os.environ[switch] = "__all__"
    try:
        model.model_rebuild()
    finally:
        if before is None:
            del os.environ[switch]
        else:
            os.environ[switch] = before


def _report_empty(document: Document, report: Report) -> frozenset[Path]:
    """Keys without a value are errors: a null means nothing in any document. Returns their paths, and those of the values
    that a decimal comma has cut."""
    paths: set[Path] = set()
    for path, node in walk(document.tree):
        if isinstance(node, ScalarNode) and node.value is None:
            paths.add(path)
            named = next((f"`{shortened(step)}`" for step in reversed(path) if isinstance(step, str)), "the document")
            help: str = "write a value after the colon, or remove the key"
            key = document.span(path, key=True)
            comment = re.match(r":?\s+(#[0-9a-fA-F]{3,8})\b", _line(document, key.end_line)[key.end_column - 1 :])
            if comment is not None:
                help = f'a `#` begins a comment: write `"{comment.group(1)}"`'
            message = f"an item of {named} has no value" if path and isinstance(path[-1], int) else f"{named} has no value"
            where = document.span(path, key=True) if node.text == "" else node.span
            code, cut = Code.NO_VALUE, _decimal_comma(document, path)
            if cut is not None:
                paths.add(cut[0])
                code, message, where, help = Code.BAD_QUANTITY, _COMMA, cut[1], cut[2]
            if len(paths) > MAX_FAULTS:
                continue
            report.add(code, message, where, help=help, path=dotted(path))
    return frozenset(paths)


_COMMA = "a number is written with a point, not with a comma"


def _decimal_comma(document: Document, path: Path) -> tuple[Path, Span, Hint] | None:
    """Where `{gap: 1,5 mm}` was meant to be 1.5 mm and came as `gap: 1` and a key `5 mm`: the path of the value, where the
    whole stands, and a hint that says what it should be."""
    mapping = node_at(document.tree, path[:-1])
    if not isinstance(mapping, MappingNode) or not isinstance(path[-1], str) or not path[-1][:1].isdigit():
        return None
    keys = list(mapping.entries)
    before = mapping.entries[keys[max(0, keys.index(path[-1]) - 1)]]
    key = mapping.keys[path[-1]]
    if not isinstance(before, ScalarNode) or not re.fullmatch(r"[-+]?\d+", before.text):
        return None
    if (before.span.end_line, before.span.end_column + 1) != (key.line, key.column):
        return None
    where = replace(before.span, end_line=key.end_line, end_column=key.end_column)
    return (*path[:-1], keys[keys.index(path[-1]) - 1]), where, decimal_point(f"{before.text},{path[-1]}", before.text, path[-1])


def _faults(shape: Shape, value: Any, path: Path, error: ValidationError) -> Iterator[Fault]:
    """The errors of a value of this shape that stands at `path`, unions decided."""
    unions: set[Path] = set()
    for entry in error.errors(include_url=False):
        steps, there, key, union = _follow(shape, entry["loc"], entry["type"])
        if union:
            if steps not in unions:
                unions.add(steps)
                yield from _union_faults(there, _value_at(value, steps), (*path, *steps))
            continue
        context = dict(entry.get("ctx", {}))
        if entry["type"] not in _KINDS:
            context.setdefault("message", entry["msg"])
        yield Fault(path=(*path, *steps), kind=entry["type"], context=context, value=entry["input"], shape=there, key=key)


def _union_faults(shape: Shape, value: Any, path: Path) -> Iterator[Fault]:
    """The errors of a value that fits no branch of a union: those of the branch that was meant."""
    branch = branch_of(shape, value)
    if branch is None:
        yield Fault(path=path, kind="type", context={}, value=value, shape=shape)
    elif branch.kind == "field":
        assert branch.field is not None
        try:
            branch.field.validate(value)
        except PydanticCustomError as fault:
            yield Fault(path=path, kind=fault.type, context=dict(fault.context or {}), value=value, shape=branch)
    else:
        from pydantic import TypeAdapter

        try:
            TypeAdapter(branch.annotation).validate_python(value, strict=True)
        except ValidationError as error:
            yield from _faults(branch, value, path, error)


def _follow(shape: Shape, location: tuple[int | str, ...], kind: str) -> tuple[Path, Shape, bool, bool]:
    """Follow pydantic's location through the annotations.

    Returns the path in the document, the shape there, whether the key is meant, and whether a union stopped the way.
    """
    path: list[int | str] = []
    for index, step in enumerate(location):
        if shape.kind == "union":
            return tuple(path), shape, False, True
        if shape.kind == "model":
            assert shape.model is not None
            path.append(step)
            known = model_keys(shape.model).get(str(step))
            if known is None or (kind == "missing" and index == len(location) - 1):
                return tuple(path), shape, kind == "extra_forbidden", False
            shape = known[0]
        elif shape.kind in ("dict", "list"):
            if step == "[key]" and index == len(location) - 1 and path:
                return tuple(path), shape, True, False
            path.append(step)
            if location[index + 1 :] != ("[key]",):
                shape = shape_of(shape.members[0])
        else:
            break
    return tuple(path), shape, False, shape.kind == "union" and kind != "missing"


def _value_at(value: Any, path: Path) -> Any:
    for step in path:
        value = value[step]
    return value


class _Reporter:
    """Faults to diagnostics of one document; `empty` are paths that have been reported as without a value, `damaged` those
    of mappings with a key that is none (reported, too; what is missing there may be what that key was) and of values that
    stand for one that cannot be."""

    def __init__(self, document: Document, report: Report, empty: frozenset[Path], damaged: frozenset[Path]) -> None:
        self.document = document
        self.report = report
        self.empty = empty
        self.damaged = damaged

    def say(self, faults: list[Fault]) -> None:
        meant: set[Path] = set()
        for fault in faults:
            if fault.kind == "extra_forbidden":
                close = self.near_key(fault)
                if close is not None:
                    meant.add((*fault.path[:-1], close))
        parents = {path[:-1] for path in self.empty}
        before = len(self.report.diagnostics)
        for fault in faults:
            if fault.path in self.empty or self.stands_in(fault.path) or (fault.kind == "missing" and fault.path in meant):
                continue
            if fault.kind == "rule" and (fault.path in parents or fault.path in self.damaged):
                continue
            if (fault.kind == "missing" and fault.path[:-1] in self.damaged) or (
                fault.kind == "too_short" and fault.path in self.damaged
            ):
                continue
            if len(self.report.diagnostics) - before >= MAX_FAULTS:
                message = f"more than {MAX_FAULTS} faults in one document; the rest is not said"
                self.add(Code.TOO_LARGE, message, self.place(fault.path), fault.path, None)
                return
            self.one(fault)

    def stands_in(self, path: Path) -> bool:
        """Whether the value at a path (or inside it: an item of a vector) is one that load put there for what cannot be."""
        inside = (place for place in self.damaged if place[: len(path)] == path)
        return any(isinstance(node_at(self.document.tree, place), ScalarNode) for place in inside)

    def one(self, fault: Fault) -> None:
        if fault.kind == "extra_forbidden":
            self.unknown_key(fault)
        elif fault.kind == "missing":
            self.missing_key(fault)
        elif fault.kind == "literal_error":
            self.unknown_choice(fault)
        elif fault.kind in ("too_short", "too_long"):
            self.wrong_length(fault)
        elif fault.kind in _KINDS and "message" in fault.context:
            self.stated(fault)
        else:
            self.wrong_type(fault)

    def add(self, code: Code, message: str, where: Span, path: Path, help: str | None) -> None:
        self.report.add(code, message, where, help=help or None, path=dotted(path) or None)

    def place(self, path: Path, *, key: bool = False) -> Span:
        """The value at a path, or its key where the value goes over several lines (or is not there)."""
        node = node_at(self.document.tree, path)
        if node is None or not path:
            first = next(iter(self.document.tree.keys.values()), self.document.tree.span)
            return self.document.span(path, key=True) if path else first
        long = node.span.line != node.span.end_line and not isinstance(node, ScalarNode)
        return self.document.span(path, key=key or (long and isinstance(path[-1], str)))

    def near_key(self, fault: Fault) -> str | None:
        mapping = node_at(self.document.tree, fault.path[:-1])
        present = set(mapping.entries) if isinstance(mapping, MappingNode) else set()
        return nearest(str(fault.path[-1]), [key for key in _keys(fault.shape) if key not in present])

    def unknown_key(self, fault: Fault) -> None:
        key = str(fault.path[-1])
        close = self.near_key(fault)
        help: str = did_you_mean(key, _keys(fault.shape), what="keys")
        if close and help != f"did you mean `{close}`?":
            help = f"did you mean `{close}`?"
        if close is None and nearest(key, _keys(fault.shape)):
            help = f"`{nearest(key, _keys(fault.shape))}` is already here"
        message = f"unknown key `{shortened(key)}`{_inside(fault.path[:-1])}"
        self.add(Code.UNKNOWN_KEY, message, self.place(fault.path, key=True), fault.path, help)

    def missing_key(self, fault: Fault) -> None:
        key, parent = str(fault.path[-1]), fault.path[:-1]
        owner = f"`{dotted(parent)}`" if parent else "the document"
        assert fault.shape.model is not None
        shape = model_keys(fault.shape.model)[key][0]
        self.add(
            Code.MISSING_KEY, f"{owner} needs the key `{key}`", self.place(parent, key=True), parent,
            f"`{key}` takes {shape.words}",
        )

    def unknown_choice(self, fault: Fault) -> None:
        choices = [spoken(choice) for choice in fault.shape.choices]
        text = spoken(fault.value)
        self.add(
            Code.UNKNOWN_CHOICE, f"expected {one_of(choices)}, found {found(fault.value)}", self.place(fault.path), fault.path,
            near_hint(text, choices) if isinstance(fault.value, str) else None,
        )

    def wrong_length(self, fault: Fault) -> None:
        if isinstance(fault.value, dict):
            message = f"`{dotted(fault.path)}` is empty; it needs at least one entry"
        else:
            least, most = fault.context.get("min_length"), fault.context.get("max_length")
            wanted = "a list with at least one item" if least == 1 and most is None else f"a list of {most if least is None else least}"
            message = f"expected {wanted}, found {found(fault.value)}"
        self.add(Code.WRONG_LENGTH, message, self.place(fault.path), fault.path, None)

    def stated(self, fault: Fault) -> None:
        """An error in words of its own: of a field, or of a rule of a model."""
        path = (*fault.path, *fault.context.get("path", ()))
        if fault.kind == "unit":
            fault = self.of_its_joint(fault)
        where = self.place(path, key=fault.key or fault.kind == "rule")
        offset = fault.context.get("offset")
        if offset is not None and not fault.key:
            where = within(self.document, path, int(offset), int(fault.context["end"])) or where
        help = fault.context.get("help")
        if fault.kind in ("type", "quantity") and not help:
            help = _space_hint(fault.value)
        self.add(_KINDS[fault.kind], fault.context["message"], where, path, help)

    def of_its_joint(self, fault: Fault) -> Fault:
        """A unit that is missing, with the dimension that the joint's type gives the value."""
        dimension = dimension_at(self.document, fault.path)
        if dimension is not None:
            try:
                read_value(fault.value, (dimension,), dimension.words, dimension.example)
            except PydanticCustomError as narrower:
                return replace(fault, kind=narrower.type, context=dict(narrower.context or {}))
        return fault

    def wrong_type(self, fault: Fault) -> None:
        shape, value = fault.shape, fault.value
        help: str | None = _mapping_hint(fault.path, value) if shape.kind in ("model", "dict", "union") else None
        if shape.kind == "text" and isinstance(value, (int, float)):
            node = node_at(self.document.tree, fault.path)
            if isinstance(node, ScalarNode):
                quoted = f'"{node.text}"'
                help = Hint(f"write `{shortened(quoted)}`", (node.text, quoted))
        elif shape.kind == "flag" and isinstance(value, str) and value.lower() in ("yes", "no", "on", "off"):
            flag = "true" if value.lower() in ("yes", "on") else "false"
            help = Hint(f"write `{flag}`", (value, flag))
        elif help is None and isinstance(value, str) and any(member.kind == "list" for member in _alternatives(shape)):
            help = f"write `[{shortened(value)}]`"
        self.add(Code.WRONG_TYPE, f"expected {shape.words}, found {found(value)}", self.place(fault.path), fault.path, help)


def _alternatives(shape: Shape) -> list[Shape]:
    return [shape_of(member) for member in shape.members] if shape.kind == "union" else [shape]


def _keys(shape: Shape) -> list[str]:
    return list(model_keys(shape.model)) if shape.model is not None else []


def _inside(path: Path) -> str:
    return f" in `{dotted(path)}`" if path else ""


def _mapping_hint(path: Path, value: Any) -> str | None:
    """A hint where text stands for a mapping that can be told from it."""
    if isinstance(value, str) and path[-1:] == ("attach",):
        return f"write `{{my_mount: {shortened(value)}}}`"
    if isinstance(value, str) and path[:-1] == ("components",) and re.fullmatch(r"[\w.]+:[\w.]+", value):
        return f"write `{{part: {shortened(value)}}}`"
    return _space_hint(value)


def _space_hint(value: Any) -> str | None:
    """A hint where `key:value` was meant as a mapping."""
    found = re.fullmatch(r"([A-Za-z_]\w*):(\S.*)", value) if isinstance(value, str) else None
    return f"a space is missing after the `:`: `{found.group(1)}: {shortened(found.group(2))}`" if found else None


def dotted(path: Path) -> str:
    """A path as messages show it: `components.plate.at.xyz[0]`."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{shortened(step)}" if text else shortened(step)
    return text


def _line(document: Document, number: int) -> str:
    lines = re.split(r"\r\n|\r|\n", document.text)
    return lines[number - 1] if number <= len(lines) else ""


def within(document: Document, path: Path, offset: int, end: int) -> Span | None:
    """The characters `offset` to before `end` of the scalar at `path`; None where they cannot be told apart (text over
    several lines, escapes)."""
    node = node_at(document.tree, path)
    if not isinstance(node, ScalarNode) or node.span.line != node.span.end_line or node.span.file != document.path:
        return None
    written = _line(document, node.span.line)[node.span.column - 1 : node.span.end_column - 1]
    begin = written.find(node.text)
    if begin < 0 or not node.text:
        return None
    column = node.span.column + begin
    return Span(
        file=node.span.file, line=node.span.line, column=column + min(offset, len(node.text) - 1),
        end_line=node.span.line, end_column=column + max(min(end, len(node.text)), min(offset, len(node.text) - 1) + 1),
    )


def part_references(
    specs: Specs, documents: Documents,
) -> tuple[tuple[str, Span], ...]:
    """Every `part:` of every assembly, in the order written, with its place."""
    references: list[tuple[str, Span]] = []
    for path, spec in specs.items():
        if isinstance(spec, AssemblySpec):
            document = documents.by_path[path]
            references.extend(
                (component.part, document.span(("components", name, "part")))
                for name, component in spec.components.items() if component.part is not None
            )
    return tuple(references)
