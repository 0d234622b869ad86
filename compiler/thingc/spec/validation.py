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
from thingc.slips import Hint
from thingc.source import Document, MappingNode, Path, ScalarNode, SequenceNode, Span, node_at, walk
from thingc.spec.allowances import allowances
from thingc.spec.assembly import AssemblySpec
from thingc.spec.base import Model
from thingc.spec.doubts import Doubts, Specs
from thingc.spec.fields import decimal_point
from thingc.spec.materials import MaterialsSpec
from thingc.spec.misplaced import gathered
from thingc.spec.pruning import ROUNDS, Fault, prune, take_out
from thingc.spec.saying import KINDS, MAX_FAULTS, dotted, say
from thingc.spec.shapes import Shape, branch_of, model_keys, shape_of
from thingc.spec.variants import VariantsSpec
from thingc.spec.workspace import WorkspaceSpec
from thingc.units import shortened

if TYPE_CHECKING:
    from thingc.load import Documents

MODELS: dict[str, type[Model]] = {
    "assembly": AssemblySpec, "materials": MaterialsSpec, "workspace": WorkspaceSpec, "variants": VariantsSpec,
}
"""The model of each kind of document."""


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
        faults = gathered(document, model, list(_faults(shape_of(model), plain, (), error)))
        say(document, model, faults, report, empty, damaged)
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
            comment = re.match(r":?\s+(#[0-9a-fA-F]{3,8})\b", document.line(key.end_line)[key.end_column - 1 :])
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
        if entry["type"] not in KINDS:
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
