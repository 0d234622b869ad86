"""Reads the facts of a source file off its syntax tree. Never imports or runs anything."""

from __future__ import annotations

import ast
import hashlib
import os
from typing import Any

from thingc.realize.code_facts import FileFacts, Import, Unit

MUTATORS = frozenset({
    "add", "append", "appendleft", "clear", "discard", "extend", "extendleft", "insert", "move_to_end", "pop", "popitem",
    "remove", "reverse", "setdefault", "sort", "update", "__setitem__", "__setattr__", "__delitem__",
})
"""Methods of Python's own containers that change them: a call on a module-level name is a change of it."""

UNSURE = frozenset({"exec", "eval", "globals", "locals", "compile", "__import__", "__builtins__"})
"""Names whose use makes static reading a guess."""

TELLING = frozenset({
    "__doc__", "f_lineno", "tb_lineno", "co_firstlineno", "co_lines", "co_positions", "co_linetable", "co_lnotab", "co_consts",
})
"""Attributes by which code looks at docstrings or lines."""

UNSURE_CHAINS = ("sys.modules", "sys._getframe", "inspect.currentframe", "inspect.stack", "builtins")
NOWHERE = os.devnull
"""The file that Python is told: it looks for the faulty line in it, and by default that is a file `<unknown>` of the working folder."""
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_SKIPPED_FIELDS = frozenset({"ctx", "type_comment", "kind", "type_ignores"})


def read_facts(source: bytes) -> FileFacts:
    """The facts of a source file."""
    try:
        tree = ast.parse(source, NOWHERE)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return FileFacts(units=(), digest=hashlib.sha256(source).hexdigest(), exported=None, broken=True)
    try:
        return _facts(tree)
    except RecursionError:
        return FileFacts(units=(), digest=hashlib.sha256(source).hexdigest(), exported=None, broken=True)


def _facts(tree: ast.Module) -> FileFacts:
    future: list[str] = []
    units: list[Unit] = []
    imported: set[str] = set()
    exported: tuple[str, ...] | None = None
    body = tree.body[1:] if _is_docstring(tree.body[:1]) else tree.body
    for statement in body:
        if isinstance(statement, ast.ImportFrom) and statement.module == "__future__":
            future.extend(alias.name for alias in statement.names)
    for statement in body:
        if _is_main_guard(statement):
            continue
        if isinstance(statement, (ast.Import, ast.ImportFrom)):
            for found in _imports(statement):
                imported.add(found.alias)
                units.append(_import_unit(found, statement.lineno))
            continue
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            continue
        exported = _exported(statement) or exported
        units.append(_Reader(future).unit(statement, imported))
    whole = hashlib.sha256("\n".join(unit.digest for unit in units).encode()).hexdigest()
    return FileFacts(units=tuple(units), digest=whole, exported=exported, broken=False)


def _import_unit(found: Import, line: int) -> Unit:
    text = f"{found.alias}|{found.level}|{found.module}|{found.name}|{found.whole_path}"
    digest = hashlib.sha256(text.encode()).hexdigest()
    return Unit(
        kind="import", names=() if found.name == "*" else (found.alias,), line=line, uses=(), imports=(found,), changes=(),
        late=False, effect=False, unsure=False, telling=False, digest=digest, documented=digest,
    )


def _imports(statement: ast.Import | ast.ImportFrom) -> list[Import]:
    if isinstance(statement, ast.Import):
        return [
            Import(alias=alias.asname, module=alias.name, level=0, name=None)
            if alias.asname is not None
            else Import(
                alias=alias.name.partition(".")[0], module=alias.name, level=0, name=None, whole_path="." not in alias.name
            )
            for alias in statement.names
        ]
    return [
        Import(alias=alias.asname or alias.name, module=statement.module or "", level=statement.level, name=alias.name)
        for alias in statement.names
    ]


def _exported(statement: ast.stmt) -> tuple[str, ...] | None:
    target = statement.targets[0] if isinstance(statement, ast.Assign) else None
    if isinstance(statement, ast.AnnAssign):
        target = statement.target
    if not (isinstance(target, ast.Name) and target.id == "__all__"):
        return None
    value = statement.value  # type: ignore[attr-defined]
    if isinstance(value, (ast.List, ast.Tuple)) and all(
        isinstance(item, ast.Constant) and isinstance(item.value, str) for item in value.elts
    ):
        return tuple(str(item.value) for item in value.elts if isinstance(item, ast.Constant))
    return None


def _is_docstring(body: list[ast.stmt]) -> bool:
    first = body[0] if body else None
    return isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)


def _is_main_guard(statement: ast.stmt) -> bool:
    """`if __name__ == "__main__":` without `else`: never runs in a module that is imported."""
    if not (isinstance(statement, ast.If) and not statement.orelse and isinstance(statement.test, ast.Compare)):
        return False
    sides = [statement.test.left, *statement.test.comparators]
    return (
        len(sides) == 2
        and isinstance(statement.test.ops[0], ast.Eq)
        and any(isinstance(side, ast.Name) and side.id == "__name__" for side in sides)
        and any(isinstance(side, ast.Constant) and side.value == "__main__" for side in sides)
    )


class _Scope:
    __slots__ = ("kind", "loads", "stores", "changes", "outer")

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.loads: set[str] = set()
        self.stores: set[str] = set()
        self.changes: set[str] = set()
        self.outer: set[str] = set()


class _Reader:
    """Reads one top-level statement: its digest, and its names with Python's scoping (locals are not uses)."""

    def __init__(self, future: list[str]) -> None:
        self.out: list[str] = sorted(future)
        self.documents: list[str] = []
        self.scopes: list[_Scope] = [_Scope("module")]
        self.imports: list[Import] = []
        self.effect = False
        self.unsure = False
        self.telling = False
        self.late_changes: set[str] = set()
        self.annotation = 0

    def unit(self, statement: ast.stmt, imported: set[str]) -> Unit:
        """The unit of `statement`; `imported` are the names that the file imported before it."""
        self.visit(statement)
        scope = self.scopes[0]
        kind = (
            "class" if isinstance(statement, ast.ClassDef)
            else "function" if isinstance(statement, _FUNCTIONS)
            else "value" if scope.stores
            else "statement"
        )
        changes = scope.changes | self.late_changes
        own = {found.alias for found in self.imports}
        if any(name in imported or name in own for name in changes - scope.stores):
            # changes an object of another module: nobody can say what else that reaches
            self.unsure = True
            self.effect = self.effect or bool((scope.changes & (imported | own)) - scope.stores)
        if kind == "statement" and not scope.changes and not self.late_changes:
            self.effect = True
        for chain in scope.loads:
            root = chain.partition(".")[0]
            if root in UNSURE and root not in scope.stores or any(
                chain == unsure or chain.startswith(unsure + ".") for unsure in UNSURE_CHAINS
            ):
                self.unsure = True
        digest = hashlib.sha256("\x1f".join(self.out).encode("utf-8", "surrogatepass")).hexdigest()
        documented = hashlib.sha256("\x1f".join((digest, *self.documents)).encode("utf-8", "surrogatepass")).hexdigest()
        return Unit(
            kind=kind,
            names=tuple(sorted(scope.stores)),
            line=statement.lineno,
            uses=tuple(sorted(scope.loads)),
            imports=tuple(self.imports),
            changes=tuple(sorted(changes - {name for name in scope.stores if kind in ("class", "function")} | (
                self.late_changes & scope.stores
            ))),
            late=bool(self.late_changes),
            effect=self.effect,
            unsure=self.unsure,
            telling=self.telling,
            digest=digest,
            documented=documented,
        )

    # --- the walk ------------------------------------------------------------------------------------------------

    def visit(self, node: ast.AST) -> None:
        special = _SPECIAL.get(type(node))
        if special is not None:
            special(self, node)
        else:
            self.generic(node)

    def generic(self, node: ast.AST) -> None:
        out = self.out
        out.append(type(node).__name__ + "(")
        for field in node._fields:
            if field not in _SKIPPED_FIELDS:
                self.value(getattr(node, field, None))
        out.append(")")

    def value(self, value: Any) -> None:
        if isinstance(value, ast.AST):
            self.visit(value)
        elif isinstance(value, list):
            self.out.append("[")
            for item in value:
                self.value(item)
            self.out.append("]")
        else:
            self.out.append(repr(value))

    def body(self, statements: list[ast.stmt]) -> None:
        """Statements of a class or a function; a docstring is kept apart."""
        if _is_docstring(statements):
            self.documents.append(statements[0].value.value)  # type: ignore[attr-defined]
            statements = statements[1:]
        self.value(statements)

    def function(self, node: Any) -> None:
        if isinstance(node, ast.Lambda):
            self.out.append("Lambda(")
        else:
            self.bind(node.name)
            self.out.append(f"{type(node).__name__} {node.name}(")
            self.value(node.decorator_list)
            self.value(getattr(node, "type_params", None))
            self.annotated(node.returns)
        arguments = node.args
        every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
        for special in (arguments.vararg, arguments.kwarg):
            if special is not None:
                every.append(special)
        for argument in every:
            self.out.append("arg " + argument.arg)
            self.annotated(argument.annotation)
        shape = tuple(map(len, (arguments.posonlyargs, arguments.args, arguments.kwonlyargs)))
        self.out.append(f"{shape}{arguments.vararg is not None}{arguments.kwarg is not None}")
        self.value(arguments.defaults)
        self.value(arguments.kw_defaults)
        scope = self.enter("function")
        scope.stores.update(argument.arg for argument in every)
        if isinstance(node, ast.Lambda):
            self.visit(node.body)
        else:
            self.body(node.body)
        self.leave()
        self.out.append(")")

    def class_(self, node: ast.ClassDef) -> None:
        self.bind(node.name)
        self.out.append(f"ClassDef {node.name}(")
        for group in (node.decorator_list, getattr(node, "type_params", None), node.bases, node.keywords):
            self.value(group)
        self.enter("class")
        self.body(node.body)
        self.leave()
        self.out.append(")")

    def comprehension(self, node: Any) -> None:
        self.out.append(type(node).__name__ + "(")
        self.visit(node.generators[0].iter)  # evaluated outside: `[x for x in x]` uses a global x
        self.enter("comprehension")
        for field in ("key", "elt", "value"):
            if hasattr(node, field):
                self.visit(getattr(node, field))
        for index, generator in enumerate(node.generators):
            self.out.append(f"for {generator.is_async}")
            self.visit(generator.target)
            if index:
                self.visit(generator.iter)
            self.value(generator.ifs)
        self.leave()
        self.out.append(")")

    def enter(self, kind: str) -> _Scope:
        scope = _Scope(kind)
        self.scopes.append(scope)
        return scope

    def leave(self) -> None:
        scope = self.scopes.pop()
        hidden = set() if scope.kind == "class" else scope.stores - scope.outer
        # the free names of a function do not see the class around it
        outer = self.scopes[-1]
        for chain in scope.loads:
            if chain.partition(".")[0] not in hidden:
                outer.loads.add(chain)
        changed = {name for name in scope.changes if name not in hidden} | (scope.stores & scope.outer)
        if scope.kind == "function":
            inside = {name for level in self.scopes[1:] if level.kind != "class" for name in level.stores - level.outer}
            self.late_changes |= changed - inside
        else:
            outer.changes |= changed if scope.kind == "comprehension" else changed - scope.stores

    def bind(self, name: str) -> None:
        self.scopes[-1].stores.add(name)

    def name(self, node: ast.Name) -> None:
        self.out.append("N" + node.id)
        scope = self.scopes[-1]
        if isinstance(node.ctx, ast.Load):
            scope.loads.add(node.id)
            self.telling = self.telling or node.id in TELLING
        else:
            scope.stores.add(node.id)
            if isinstance(node.ctx, ast.Del):
                scope.changes.add(node.id)

    def attribute(self, node: ast.Attribute) -> None:
        chain = [node.attr]
        inner: ast.AST = node.value
        while isinstance(inner, ast.Attribute):
            chain.append(inner.attr)
            inner = inner.value
        self.telling = self.telling or not TELLING.isdisjoint(chain)
        if isinstance(inner, ast.Name):
            chain.append(inner.id)
            text = ".".join(reversed(chain))
            self.out.append("A" + text)
            self.scopes[-1].loads.add(text)
            if not isinstance(node.ctx, ast.Load):
                self.scopes[-1].changes.add(inner.id)
        else:
            self.out.append(f"Attribute {node.attr}(")
            self.visit(node.value)
            self.out.append(")")
            if not isinstance(node.ctx, ast.Load):
                self.change(inner)

    def subscript(self, node: ast.Subscript) -> None:
        self.generic(node)
        if not isinstance(node.ctx, ast.Load):
            self.change(node.value)

    def change(self, node: ast.AST) -> None:
        """Note that the object `node` leads to is changed: the name at its root."""
        while isinstance(node, (ast.Attribute, ast.Subscript, ast.Call)):
            node = node.func if isinstance(node, ast.Call) else node.value
        if isinstance(node, ast.Name):
            self.scopes[-1].changes.add(node.id)

    def call(self, node: ast.Call) -> None:
        function = node.func
        if isinstance(function, ast.Attribute) and function.attr in MUTATORS:
            self.change(function.value)
        elif isinstance(function, ast.Name) and function.id in ("setattr", "delattr") and node.args:
            self.change(node.args[0])
        elif isinstance(function, ast.Name) and function.id == "vars" and not node.args:
            self.unsure = True
        self.generic(node)

    def augmented(self, node: ast.AugAssign) -> None:
        if isinstance(node.target, ast.Name):
            self.scopes[-1].loads.add(node.target.id)
            self.scopes[-1].changes.add(node.target.id)
        self.generic(node)

    def expression(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return
        if len(self.scopes) == 1:
            self.effect = True
        self.generic(node)

    def abrupt(self, node: ast.stmt) -> None:
        """`assert`, `raise`, `del` at the top level: whether the module can be loaded at all."""
        if len(self.scopes) == 1:
            self.effect = True
        self.generic(node)

    def annotated(self, annotation: ast.expr | None) -> None:
        if annotation is None:
            self.out.append("None")
            return
        self.annotation += 1
        self.visit(annotation)
        self.annotation -= 1

    def annotated_assignment(self, node: ast.AnnAssign) -> None:
        self.out.append("AnnAssign(")
        self.visit(node.target)
        self.annotated(node.annotation)
        self.value(node.value)
        self.out.append(")")

    def constant(self, node: ast.Constant) -> None:
        self.out.append(repr(node.value))
        self.telling = self.telling or isinstance(node.value, str) and node.value in TELLING
        if self.annotation and isinstance(node.value, str) and len(node.value) < 200:
            try:
                written = ast.parse(node.value, NOWHERE, "eval")
            except (SyntaxError, ValueError, RecursionError, MemoryError):
                return
            for part in ast.walk(written):
                if isinstance(part, ast.Name):
                    self.scopes[-1].loads.add(part.id)

    def imported(self, node: ast.Import | ast.ImportFrom) -> None:
        self.out.append(ast.dump(node))
        for found in _imports(node):
            self.imports.append(found)
            if found.name != "*" and len(self.scopes) == 1:
                self.bind(found.alias)

    def global_(self, node: ast.Global) -> None:
        self.out.append(f"Global {node.names}")
        self.scopes[-1].outer.update(node.names)

    def nonlocal_(self, node: ast.Nonlocal) -> None:
        self.out.append(f"Nonlocal {node.names}")
        self.scopes[-1].outer.update(node.names)

    def handler(self, node: ast.ExceptHandler) -> None:
        if node.name:
            self.bind(node.name)
        self.generic(node)

    def captured(self, node: Any) -> None:
        for field in ("name", "rest"):
            name = getattr(node, field, None)
            if isinstance(name, str):
                self.bind(name)
        self.generic(node)

    def walrus(self, node: ast.NamedExpr) -> None:
        target = next(scope for scope in reversed(self.scopes) if scope.kind != "comprehension")
        target.stores.add(node.target.id)
        self.out.append(f"NamedExpr {node.target.id}(")
        self.visit(node.value)
        self.out.append(")")

    def interpolated(self, node: ast.JoinedStr) -> None:
        held, self.annotation = self.annotation, 0
        self.generic(node)
        self.annotation = held


_SPECIAL: dict[type[ast.AST], Any] = {
    ast.FunctionDef: _Reader.function,
    ast.AsyncFunctionDef: _Reader.function,
    ast.Lambda: _Reader.function,
    ast.ClassDef: _Reader.class_,
    ast.ListComp: _Reader.comprehension,
    ast.SetComp: _Reader.comprehension,
    ast.DictComp: _Reader.comprehension,
    ast.GeneratorExp: _Reader.comprehension,
    ast.Name: _Reader.name,
    ast.Attribute: _Reader.attribute,
    ast.Subscript: _Reader.subscript,
    ast.Call: _Reader.call,
    ast.AugAssign: _Reader.augmented,
    ast.Expr: _Reader.expression,
    ast.Assert: _Reader.abrupt,
    ast.Raise: _Reader.abrupt,
    ast.Delete: _Reader.abrupt,
    ast.AnnAssign: _Reader.annotated_assignment,
    ast.Constant: _Reader.constant,
    ast.Import: _Reader.imported,
    ast.ImportFrom: _Reader.imported,
    ast.Global: _Reader.global_,
    ast.Nonlocal: _Reader.nonlocal_,
    ast.ExceptHandler: _Reader.handler,
    ast.MatchAs: _Reader.captured,
    ast.MatchStar: _Reader.captured,
    ast.MatchMapping: _Reader.captured,
    ast.NamedExpr: _Reader.walrus,
    ast.JoinedStr: _Reader.interpolated,
}
