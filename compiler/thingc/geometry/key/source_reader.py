"""Extract the relevant facts from the syntax tree of a source file, without importing or running it."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Sequence
from typing import Any

from thingc.base.python_source import parse_python
from thingc.geometry.key.modules import MAX_NAME

TEXT_READERS = frozenset({
    "__doc__", "f_lineno", "tb_lineno", "co_firstlineno", "co_lines", "co_positions", "co_linetable", "co_lnotab", "co_consts",
    "inspect", "linecache", "pydoc", "traceback",
})
"""Names that code uses to read docstrings, line numbers or source texts, which are otherwise not part of a key."""

NAME_DEFINERS = frozenset({
    "exec", "eval", "globals", "locals", "vars", "setattr", "modules", "f_globals", "__dict__", "__getattr__", "__builtins__",
})
"""Names with which a module can define other names without a binding statement. A `global` statement in a function has the same effect."""

LOOKING = re.compile(
    rb"\b(?:__code__|__defaults__|__kwdefaults__|__globals__|co_code|settrace|setprofile|gc|dis|marshal|dill|cloudpickle"
    rb"|n?jit|numba|cython|FunctionType|LambdaType|CodeType)\b"
)
"""Names that code uses to inspect functions without calling them, or to run functions in another way."""

_IMPLIED = ("ctx", "kind")
"""Fields of syntax nodes that are ignored, because they do not contain additional information."""
_END, _END_OF_PART = object(), object()

PLAIN = frozenset({"classmethod", "property", "staticmethod"})
"""Decorators that do not run the decorated function. A function with such a decorator only runs when it is called."""


def read_source(source: bytes) -> dict[str, Any]:
    """Parse a Python source file, and return its facts as a JSON value (see `module_key.ModuleFacts`)."""
    try:
        tree = parse_python(source)
        tree.body = [statement for statement in tree.body if not _is_main_guard(statement)]
        return _facts(tree, source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        digest = hashlib.sha256(source).hexdigest()
        return {
            "syntax": digest, "documented": digest, "outline": digest, "bodies": [], "imports": [], "names": {}, "telling": True,
            "looking": True, "more": True, "broken": True,
        }


def functions(tree: ast.Module, source: bytes) -> list[ast.FunctionDef]:
    """Return the functions and methods of a module that run only when they are called, in source order.

    A function with a decorator that is not in `PLAIN` is excluded, because the decorator may inspect the function. Generators and
    coroutines are excluded, because calling them does not run their body.
    """
    definitions: list[ast.FunctionDef] = []
    yields = b"yield" in source
    to_visit: list[ast.AST] = [statement for statement in tree.body if not _is_main_guard(statement)]
    while to_visit:
        node = to_visit.pop(0)
        if isinstance(node, ast.FunctionDef):
            plain = all(isinstance(one, ast.Name) and one.id in PLAIN for one in node.decorator_list)
            if plain and not (yields and any(isinstance(one, (ast.Yield, ast.YieldFrom)) for one in ast.walk(node))):
                definitions.append(node)
        elif not isinstance(node, (ast.AsyncFunctionDef, ast.expr)):
            to_visit[:0] = ast.iter_child_nodes(node)
    return definitions


def _inert_parts(function: ast.FunctionDef) -> list[Any]:
    """Return the parts of a function that have no effect until the function is called. Such parts are the body of the function, and default
    arguments that are plain values.
    """
    defaults = [*function.args.defaults, *function.args.kw_defaults]
    return [function.body, *(one for one in defaults if one is not None and _is_value(one))]


def _is_value(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) or isinstance(node, ast.UnaryOp) and isinstance(node.operand, ast.Constant)


def _facts(tree: ast.Module, source: bytes) -> dict[str, Any]:
    """Compute the facts of a Python module from its syntax tree.

    The traversal does not use recursion, because long sums are nested more deeply than Python's stack allows.
    """
    syntax: list[str] = []
    outline: list[str] = []
    called = functions(tree, source)
    bodies: list[list[str]] = [[] for _ in called]
    owners = {id(owned): body for function, body in zip(called, bodies, strict=True) for owned in _inert_parts(function)}
    part = outline
    docstrings: list[str] = []
    names: set[str] = set()
    imports: set[str] = set()
    to_visit: list[Any] = [tree]
    while to_visit:
        node = to_visit.pop()
        if part is outline and (body := owners.get(id(node))) is not None:
            outline.append("a part of a function")
            part = body
            to_visit.append(_END_OF_PART)
        elif node is _END_OF_PART:
            part = outline
            continue
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):  # a constant as a statement: a docstring
            docstrings.append(f"{len(syntax)} {node.value.value!r}")
            continue
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            imports.update(origin for _, origin in _imported_names(node) if len(origin) <= MAX_NAME)
        elif isinstance(node, (ast.Global, str)):
            names.add(node if isinstance(node, str) else "globals")
        line, inner = _node_line(node)
        to_visit += reversed(inner)
        syntax.append(line)
        part.append(line)
    return {
        "syntax": _digest(syntax), "documented": _digest([*syntax, *docstrings]), "outline": _digest(outline),
        "bodies": [_digest(body)[:32] for body in bodies], "imports": sorted(imports), "names": _names(tree),
        "telling": not names.isdisjoint(TEXT_READERS), "looking": LOOKING.search(source) is not None,
        "more": not names.isdisjoint(NAME_DEFINERS), "broken": False,
    }


def _digest(lines: list[str]) -> str:
    return hashlib.sha256("".join(f"{line}\n" for line in lines).encode()).hexdigest()


def _node_line(node: Any) -> tuple[str, Sequence[Any]]:
    """Return a line of text that identifies an item of a syntax tree, and the children of the item in order.

    An item is a node, a list of nodes, or a plain value.
    """
    if isinstance(node, ast.AST):
        # fields without a value are omitted, because other versions of Python have more fields
        fields = {
            name: value for name in node._fields
            if name not in _IMPLIED and (value := getattr(node, name, None)) is not None and value != []
        }
        return f"{type(node).__name__} {' '.join(fields)}", tuple(fields.values())
    if isinstance(node, list):
        return "[", (*node, _END)
    return "]" if node is _END else repr(node), ()


def _is_main_guard(statement: ast.stmt) -> bool:
    """Return whether a statement is `if __name__ == "__main__":` without `else`, which never runs in an imported module."""
    return (
        isinstance(statement, ast.If) and not statement.orelse
        and ast.unparse(statement.test) in ("__name__ == '__main__'", "'__main__' == __name__")
    )


def _imported_names(statement: ast.Import | ast.ImportFrom) -> list[tuple[str, str]]:
    """Return the names that an import binds, each with its origin: `module` or `module:name`, with the dots of a relative import."""
    if isinstance(statement, ast.Import):
        return [(alias.asname or alias.name.partition(".")[0], alias.name) for alias in statement.names]
    module = "." * statement.level + (statement.module or "")
    return [(alias.asname or alias.name, f"{module}:{alias.name}") for alias in statement.names]


def _names(tree: ast.Module) -> dict[str, tuple[str, int, str]]:
    """Return the names that a module's top-level statements may bind.

    The values are tuples of the kind, the line, and the origin of an imported name.
    """
    names: dict[str, tuple[str, int, str]] = {}
    nodes: list[ast.AST] = list(tree.body)
    for node in nodes:
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.ClassDef):
            names[node.name] = ("class", line, "")
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            names[node.name] = ("function", line, "")
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names.update({name: ("import", line, origin) for name, origin in _imported_names(node)})
        else:
            bound = node.id if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else None
            for name in (bound, getattr(node, "name", None), getattr(node, "rest", None)):  # including names that `except` and `match` bind
                if isinstance(name, str):
                    names[name] = ("value", line, "")
            nodes += ast.iter_child_nodes(node)
    return names
