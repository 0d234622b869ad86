"""Find the names of Things in the Python modules of a workspace: names of classes, of mounts (which are attributes), and of parameters.

The modules are parsed and never run.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.python_source import parse_python
from thingc.base.source import Span

Role = Literal["declared", "used", "fits"]
"""Roles of a name at a location. The role `fits` means that a pattern matches the name, or that the name is written with escapes."""


class Name(FrozenStruct, kw_only=False):
    """A name that a document or a part module declares.

    `kind` is the type of the named element: a type from `name_types.py`, or `document`, `part`, `part mount` or `part parameter`. `file` is
    the absolute path of the document or module that declares the name, or an empty string if unknown. `owner` is the component or class in
    this file to which the name belongs (`components.leg`), or the reference `module:Class` if the file is unknown.
    """

    kind: str
    file: str
    text: str
    owner: str = ""


class NamePlace(FrozenStruct, kw_only=False):
    """A location at which a name is declared or used, in a document or in a part module.

    The span covers only the characters of the name. For the role `fits`, the span contains the whole pattern.
    """

    name: Name
    span: Span
    role: Role


class _Module:
    """A parsed Python module: its syntax tree, classes, imported names, and text."""

    def __init__(self, file: str, dotted: str, text: str) -> None:
        self.file, self.dotted = file, dotted
        self.lines = re.split(r"\r\n|\r|\n", text)
        self.tree = parse_python(text)
        self.classes = {one.name: one for one in self.tree.body if isinstance(one, ast.ClassDef)}
        self.imports: dict[str, str] = {}
        self._self_attributes: dict[str, _SelfAttributes] = {}
        for statement in self.tree.body:
            if isinstance(statement, ast.ImportFrom):
                dotted_module = f"{self.dotted}.__init__" if self.file.endswith("__init__.py") else self.dotted
                package = dotted_module.split(".")[: -statement.level] if statement.level else []
                source = ".".join([*package, *([statement.module] if statement.module else [])])
                self.imports.update({one.asname or one.name: f"{source}:{one.name}" for one in statement.names})

    def self_attributes(self, node: ast.ClassDef) -> _SelfAttributes:
        """Return the attributes of `self` that a class of the module assigns or uses."""
        if node.name not in self._self_attributes:
            self._self_attributes[node.name] = _SelfAttributes(node)
        return self._self_attributes[node.name]

    def span(self, line: int, end: int, text: str) -> Span | None:
        """Return the span of the word `text`, which ends at the byte offset `end` of a line.

        Return None if the line contains another text at this position.
        """
        column = len(self.lines[line - 1].encode()[:end].decode(errors="replace")) - len(text) + 1
        if self.lines[line - 1][column - 1 : column - 1 + len(text)] != text:
            return None
        return Span(file=self.file, line=line, column=column, end_line=line, end_column=column + len(text))

    def span_of(self, node: ast.expr, text: str) -> Span | None:
        """Return the span of a word at the end of a syntax node, such as `tip` in `self.tip`."""
        return self.span(node.end_lineno or 0, node.end_col_offset or 0, text)


class _SelfAttributes:
    """The attributes of `self` that the methods of a Python class assign or use.

    `assigned` maps the name of each assigned attribute to whether the assigned value creates mounts. `by_name` maps the name of each
    attribute to its syntax nodes, with assignments first. `nodes` contains all syntax nodes of the class.
    """

    def __init__(self, node: ast.ClassDef) -> None:
        self.nodes = list(ast.walk(node))
        self.assigned: dict[str, bool] = {}
        self.by_name: dict[str, list[ast.Attribute]] = {}
        for statement in self.nodes:
            if isinstance(statement, (ast.Assign, ast.AnnAssign)) and statement.value is not None:
                mounts = any(isinstance(inner, ast.Name) and inner.id == "MountPoint" for inner in ast.walk(statement.value))
                for target in statement.targets if isinstance(statement, ast.Assign) else [statement.target]:
                    for inner in ast.walk(target):
                        if isinstance(inner, ast.Attribute) and isinstance(inner.ctx, ast.Store) and _of_self(inner):
                            self.assigned[inner.attr] = mounts or self.assigned.get(inner.attr, False)
            elif isinstance(statement, ast.Attribute) and _of_self(statement):
                self.by_name.setdefault(statement.attr, []).append(statement)
        for places in self.by_name.values():
            places.sort(key=lambda statement: (not isinstance(statement.ctx, ast.Store), statement.lineno, statement.col_offset))


@dataclass(slots=True)
class PartClass:
    """A class that documents use as a part.

    `lineage` contains the class and its base classes in the workspace. `requested` collects the names that the methods return.
    """

    reference: str
    lineage: list[tuple[_Module, ast.ClassDef]]
    requested: dict[Name, None]

    @property
    def file(self) -> str:
        """The absolute path of the module of the class."""
        return self.lineage[0][0].file

    @property
    def span(self) -> Span | None:
        """The span of the class name in the `class` statement."""
        module, node = self.lineage[0]
        header = re.search(rf"class\s+{node.name}\b", module.lines[node.lineno - 1])
        return None if header is None else module.span(node.lineno, len(module.lines[node.lineno - 1][: header.end()].encode()), node.name)

    def mounts(self, text: str, pattern: re.Pattern[str] | None) -> list[Name]:
        """Return the attribute that can contain the mount `text`: an attribute with this name, or a list of mounts (`screw` for `screw_0`).

        With a `pattern`, return all attributes that match the pattern. `text` is then the part of the pattern before its first special
        character.
        """
        owners: dict[str, tuple[_Module, ast.ClassDef]] = {}
        several: set[str] = set()
        for module, node in self.lineage:
            for attribute, mounts in module.self_attributes(node).assigned.items():
                owners.setdefault(attribute, (module, node))
                if mounts:  # the content of other attributes is unknown
                    several.add(attribute)
        matching = [name for name in owners if pattern is not None and pattern.match(name)]
        exact = [name for name in owners if (name == text and pattern is None) or (name in several and text.startswith(f"{name}_"))]
        chosen = matching or ([max(exact, key=len)] if exact else [])
        if not chosen and pattern is None:
            return [self._missing_name("part mount", text)]
        return [self._record(Name("part mount", owners[name][0].file, name, owners[name][1].name)) for name in chosen]

    def parameter(self, text: str) -> Name:
        """Return the parameter `text` with the class that declares the parameter.

        If no class in the workspace declares the parameter, the file of the result is empty.
        """
        for module, node in self.lineage:
            method = _init_of(node)
            if method is not None:
                if any(argument.arg == text for argument in _arguments(method)):
                    return self._record(Name("part parameter", module.file, text, node.name))
                break
        return self._missing_name("part parameter", text)

    def _missing_name(self, kind: str, text: str) -> Name:
        return Name(kind, "", text, self.reference)

    def _record(self, name: Name) -> Name:
        self.requested[name] = None
        return name


class PartNames:
    """The Python modules in the part folders `folders`, which are absolute paths.

    `read` is a function that returns the text of a file, or None if the file cannot be read. Parsed modules are cached.
    """

    def __init__(self, folders: Sequence[str], read: Callable[[str], str | None]) -> None:
        self.folders = tuple(folders)
        self._read = read
        self._modules: dict[str, _Module | None] = {}
        self._things: dict[str, PartClass | None] = {}
        self._requested: dict[Name, None] = {}

    def thing(self, reference: str) -> PartClass | None:
        """Return the class with the reference `module:Class`, or None if its module is not in a part folder."""
        if reference not in self._things:
            lineage = self._lineage(reference, [])
            self._things[reference] = PartClass(reference, lineage, self._requested) if lineage else None
        return self._things[reference]

    def places(self) -> Iterator[NamePlace]:
        """Yield the locations of the mounts and parameters that `PartClass.mounts` and `PartClass.parameter` have returned.

        For a mount, locations in derived classes are included.
        """
        for name in self._requested:
            declared = False
            for module, node in self._family(name):
                for span in _name_spans(module, node, name):
                    yield NamePlace(name, span, "used" if declared else "declared")
                    declared = True

    def classes(self) -> Iterator[tuple[str, PartClass]]:
        """Yield the existing part classes that callers have requested with `thing`, each with its reference `module:Class`."""
        yield from ((reference, thing) for reference, thing in self._things.items() if thing is not None)

    def find_in_code(self, name: Name) -> tuple[str, int] | None:
        """Return the file and line of code that may use a mount or parameter, and that renaming does not edit. Return None if none exists.

        Whether the code uses the mount or parameter, or only the same name, is not known without running the code.
        """
        members = self._family(name)
        family = {(module.file, node.name) for module, node in members}
        known = {(span.file, span.line, span.column) for module, node in members for span in _name_spans(module, node, name)}
        for module in self._all_modules():
            for node in ast.walk(module.tree):
                if _may_refer_to(node, name, {family_class for _, family_class in family}):
                    span = module.span_of(node, name.text) if isinstance(node, ast.Attribute) else None
                    if span is None or (span.file, span.line, span.column) not in known:
                        class_name = _enclosing_class(module, node)
                        of_self = isinstance(node, ast.Attribute) and (_of_self(node) or _parameter_of_self(node))
                        if not of_self or class_name is None or (module.file, class_name) in family:
                            return module.file, getattr(node, "lineno", 1)
        return None

    def attributes(self, name: Name) -> frozenset[str]:
        """Return the names to which a mount or parameter cannot be renamed, because its class already uses them."""
        unavailable: set[str] = set()
        for module, node in self._family(name):
            if name.kind == "part mount":
                unavailable |= {*module.self_attributes(node).by_name, *(one.name for one in node.body if isinstance(one, ast.FunctionDef))}
            elif (method := _init_of(node)) is not None:
                unavailable |= {one.id for one in ast.walk(method) if isinstance(one, ast.Name)} | {one.arg for one in _arguments(method)}
        return frozenset(unavailable)

    def files(self) -> list[str]:
        """Return the absolute paths of all Python modules in the part folders."""
        return [module.file for module in self._all_modules()]

    def _family(self, name: Name) -> list[tuple[_Module, ast.ClassDef]]:
        """Return the class that declares the mount or parameter `name`.

        For a mount, also return all derived classes in the part folders.
        """
        family: dict[tuple[str, str], tuple[_Module, ast.ClassDef]] = {}
        for module in self._all_modules() if name.kind == "part mount" else ():
            for node in module.classes.values():
                lineage = self._lineage(f"{module.dotted}:{node.name}", [])
                if any((base_module.file, inner.name) == (name.file, name.owner) for base_module, inner in lineage):
                    family[module.file, node.name] = module, node
        for candidate in self._modules.values():
            if candidate is not None and candidate.file == name.file and name.owner in candidate.classes:
                family = {(candidate.file, name.owner): (candidate, candidate.classes[name.owner]), **family}
        return list(family.values())

    def _all_modules(self) -> Iterator[_Module]:
        """Yield all modules in the part folders."""
        for folder in self.folders:
            for path, folders, files in os.walk(folder):
                folders[:] = sorted(name for name in folders if name.isidentifier())
                inner = os.path.relpath(path, folder).replace(os.sep, ".")
                for file in sorted(files):
                    stem, suffix = os.path.splitext(file)
                    if suffix == ".py" and stem.isidentifier():
                        dotted_names = [*([] if inner == "." else [inner]), *([] if stem == "__init__" else [stem])]
                        module = self._module(".".join(dotted_names))
                        if module is not None:
                            yield module

    def _lineage(self, reference: str, above: list[str]) -> list[tuple[_Module, ast.ClassDef]]:
        """Return a class, followed by its base classes in approximate method resolution order."""
        name, _, cls = reference.partition(":")
        module = self._module(name) if name and cls and reference not in above else None
        if module is None:
            return []
        node = module.classes.get(cls)
        if node is None:
            return self._lineage(module.imports[cls], [*above, reference]) if cls in module.imports else []
        lineage = [(module, node)]
        for base in node.bases:
            if isinstance(base, ast.Name):
                inner = f"{module.dotted}:{base.id}" if base.id in module.classes else module.imports.get(base.id, "")
                lineage += [base_class for base_class in self._lineage(inner, [*above, reference]) if base_class not in lineage]
        return lineage

    def _module(self, dotted: str) -> _Module | None:
        if dotted not in self._modules:
            self._modules[dotted] = self._parse_module(dotted)
        return self._modules[dotted]

    def _parse_module(self, dotted: str) -> _Module | None:
        for folder in self.folders:
            stem = os.path.join(folder, *dotted.split("."))
            for file in (f"{stem}.py", os.path.join(stem, "__init__.py")):
                text = self._read(file)
                if text is not None:
                    return _module_of(file, dotted, text)
        return None


@lru_cache(maxsize=512)
def _module_of(file: str, dotted: str, text: str) -> _Module | None:
    """Parse a Python module. Return None if the source is not valid Python."""
    try:
        return _Module(file, dotted, text)
    except (SyntaxError, ValueError, RecursionError):
        return None


def _init_of(node: ast.ClassDef) -> ast.FunctionDef | None:
    return next((statement for statement in node.body if isinstance(statement, ast.FunctionDef) and statement.name == "__init__"), None)


def _arguments(method: ast.FunctionDef) -> list[ast.arg]:
    return [*method.args.posonlyargs, *method.args.args, *method.args.kwonlyargs][1:]


def _of_self(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id == "self"


def _name_spans(module: _Module, node: ast.ClassDef, name: Name) -> Iterator[Span]:
    """Yield the locations at which a class declares or uses a mount or a parameter, with the declaration first."""
    if name.kind == "part mount":
        attributes = module.self_attributes(node).by_name.get(name.text, ())
        yield from (span for inner in attributes if (span := module.span_of(inner, name.text)) is not None)
        return
    method = _init_of(node)
    if method is None:
        return
    for argument in _arguments(method):
        if argument.arg == name.text:
            end = argument.col_offset + len(name.text.encode())
            if (span := module.span(argument.lineno, end, name.text)) is not None:
                yield span
    used: list[ast.expr] = [inner for inner in ast.walk(method) if isinstance(inner, ast.Name) and inner.id == name.text]
    inside = (inner for inner in module.self_attributes(node).nodes if isinstance(inner, ast.Attribute) and inner.attr == name.text)
    used += [inner for inner in inside if _parameter_of_self(inner)]
    yield from (span for inner in used if (span := module.span_of(inner, name.text)) is not None)
    yield from _find_in_docstring(module, node, name.text)
    yield from _find_in_docstring(module, method, name.text)


def _parameter_of_self(node: ast.Attribute) -> bool:
    """Return whether a syntax node is an expression `self.p.NAME`."""
    return isinstance(node.value, ast.Attribute) and node.value.attr == "p" and _of_self(node.value)


def _find_in_docstring(module: _Module, node: ast.ClassDef | ast.FunctionDef, text: str) -> Iterator[Span]:
    """Yield the location of a parameter's name in the docstring of its class, in a line `NAME: ...`."""
    docstring = node.body[0]
    if not (isinstance(docstring, ast.Expr) and isinstance(docstring.value, ast.Constant) and isinstance(docstring.value.value, str)):
        return
    for line in range(docstring.lineno, (docstring.end_lineno or docstring.lineno) + 1):
        if (line_of_text := re.match(rf"\s+({text})(?: \(.*\))?:", module.lines[line - 1])) is not None:
            span = module.span(line, len(module.lines[line - 1][: line_of_text.end(1)].encode()), text)
            if span is not None:
                yield span


def _may_refer_to(node: ast.AST, name: Name, family: set[str]) -> bool:
    """Return whether a syntax node contains the text of a mount or parameter at a place where it may be used.

    `family` contains the names of the classes that have the mount or parameter.
    """
    if isinstance(node, ast.Constant):
        return node.value == name.text
    if name.kind == "part mount":
        return isinstance(node, ast.Attribute) and node.attr == name.text
    if isinstance(node, ast.Attribute):
        return node.attr == name.text and isinstance(node.value, ast.Attribute) and node.value.attr == "p"
    if isinstance(node, ast.Call):
        function = node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id if isinstance(node.func, ast.Name) else ""
        keywords = {(keyword.arg or "").partition("__")[0] for keyword in node.keywords}
        return name.text in keywords and (function in family or function in ("adjust", "__init__", "partial", "replace"))
    return False


def _enclosing_class(module: _Module, node: ast.AST) -> str | None:
    """Return the name of the top-level class that contains a syntax node, or None."""
    line = getattr(node, "lineno", 0)
    return next((name for name, cls in module.classes.items() if cls.lineno <= line <= (cls.end_lineno or 0)), None)
