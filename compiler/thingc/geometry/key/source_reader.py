"""Reads off the syntax tree of a source file what counts of it. Never imports or runs anything."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Sequence
from typing import Any

from thingc.base.python_source import parse_python
from thingc.geometry.key.modules import MAX_NAME

TELLING = frozenset({
    "__doc__", "f_lineno", "tb_lineno", "co_firstlineno", "co_lines", "co_positions", "co_linetable", "co_lnotab", "co_consts",
    "inspect", "linecache", "pydoc", "traceback",
})
"""Words by which code looks at docstrings, lines or source texts, which are otherwise no part of a key."""

BINDING = frozenset({
    "exec", "eval", "globals", "locals", "vars", "setattr", "modules", "f_globals", "__dict__", "__getattr__", "__builtins__",
})
"""Words by which a module can have names that no statement of it binds; so can a function that says `global`."""

LOOKING = re.compile(
    rb"\b(?:__code__|__defaults__|__kwdefaults__|__globals__|co_code|settrace|setprofile|gc|dis|marshal|dill|cloudpickle"
    rb"|n?jit|numba|cython|FunctionType|LambdaType|CodeType)\b"
)
"""Words by which code looks at functions that it does not call, or has others run them in another way."""

_IMPLIED = ("ctx", "kind")
"""Fields of nodes that tell nothing: what a name is used for shows where it stands, and `u"x"` is `"x"`."""
_END, _LEFT = object(), object()

PLAIN = frozenset({"classmethod", "property", "staticmethod"})
"""Decorators that do nothing with a function but call it."""


def read_source(source: bytes) -> dict[str, Any]:
    """The facts of a source file, as JSON (see `module_key.Facts`)."""
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
    """The functions and methods of a module that run when they are called and not before, in the order of the text. Left out are those
    that others may have looked at by then (decorated ones, but for what Python itself has), and those whose call runs nothing yet."""
    definitions: list[ast.FunctionDef] = []
    yields = b"yield" in source
    waiting: list[ast.AST] = [statement for statement in tree.body if not _is_main_guard(statement)]
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, ast.FunctionDef):
            plain = all(isinstance(one, ast.Name) and one.id in PLAIN for one in node.decorator_list)
            if plain and not (yields and any(isinstance(one, (ast.Yield, ast.YieldFrom)) for one in ast.walk(node))):
                definitions.append(node)
        elif not isinstance(node, (ast.AsyncFunctionDef, ast.expr)):
            waiting[:0] = ast.iter_child_nodes(node)
    return definitions


def _own(function: ast.FunctionDef) -> list[Any]:
    """What of a function counts where it is called: its body, and defaults that are plain values."""
    defaults = [*function.args.defaults, *function.args.kw_defaults]
    return [function.body, *(one for one in defaults if one is not None and _is_value(one))]


def _is_value(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) or isinstance(node, ast.UnaryOp) and isinstance(node.operand, ast.Constant)


def _facts(tree: ast.Module, source: bytes) -> dict[str, Any]:
    """One walk in the order of the text, without recursion: sums grow deeper than Python's stack."""
    syntax: list[str] = []
    outline: list[str] = []
    called = functions(tree, source)
    bodies: list[list[str]] = [[] for _ in called]
    owners = {id(own): body for function, body in zip(called, bodies, strict=True) for own in _own(function)}
    part = outline
    docstrings: list[str] = []
    words: set[str] = set()
    imports: set[str] = set()
    waiting: list[Any] = [tree]
    while waiting:
        node = waiting.pop()
        if part is outline and (body := owners.get(id(node))) is not None:
            outline.append("a part of a function")
            part = body
            waiting.append(_LEFT)
        elif node is _LEFT:
            part = outline
            continue
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):  # it does nothing: a docstring
            docstrings.append(f"{len(syntax)} {node.value.value!r}")
            continue
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            imports.update(origin for _, origin in _imported(node) if len(origin) <= MAX_NAME)
        elif isinstance(node, (ast.Global, str)):
            words.add(node if isinstance(node, str) else "globals")
        word, inner = _word(node)
        waiting += reversed(inner)
        syntax.append(word)
        part.append(word)
    return {
        "syntax": _digest(syntax), "documented": _digest([*syntax, *docstrings]), "outline": _digest(outline),
        "bodies": [_digest(body)[:32] for body in bodies], "imports": sorted(imports), "names": _names(tree),
        "telling": not words.isdisjoint(TELLING), "looking": LOOKING.search(source) is not None, "more": not words.isdisjoint(BINDING),
        "broken": False,
    }


def _digest(lines: list[str]) -> str:
    return hashlib.sha256("".join(f"{line}\n" for line in lines).encode()).hexdigest()


def _word(node: Any) -> tuple[str, Sequence[Any]]:
    """What a node, a list of some, or a value of one is in the line of its own, and what is in it, in order."""
    if isinstance(node, ast.AST):
        # what is not there is left out: other versions of Python have more fields
        fields = {
            name: value for name in node._fields
            if name not in _IMPLIED and (value := getattr(node, name, None)) is not None and value != []
        }
        return f"{type(node).__name__} {' '.join(fields)}", tuple(fields.values())
    if isinstance(node, list):
        return "[", (*node, _END)
    return "]" if node is _END else repr(node), ()


def _is_main_guard(statement: ast.stmt) -> bool:
    """`if __name__ == "__main__":` without `else` never runs in a module that is imported."""
    return (
        isinstance(statement, ast.If) and not statement.orelse
        and ast.unparse(statement.test) in ("__name__ == '__main__'", "'__main__' == __name__")
    )


def _imported(statement: ast.Import | ast.ImportFrom) -> list[tuple[str, str]]:
    """What an import binds, with where that comes from: `module`, or `module:name` with the dots of a relative import before it."""
    if isinstance(statement, ast.Import):
        return [(alias.asname or alias.name.partition(".")[0], alias.name) for alias in statement.names]
    module = "." * statement.level + (statement.module or "")
    return [(alias.asname or alias.name, f"{module}:{alias.name}") for alias in statement.names]


def _names(tree: ast.Module) -> dict[str, tuple[str, int, str]]:
    """What the module's own statements bind, conditional ones among them: kind, line, and where an imported name comes from."""
    names: dict[str, tuple[str, int, str]] = {}
    waiting: list[ast.AST] = list(tree.body)
    for node in waiting:
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.ClassDef):
            names[node.name] = ("class", line, "")
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            names[node.name] = ("function", line, "")
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names.update({name: ("import", line, origin) for name, origin in _imported(node)})
        else:
            bound = node.id if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else None
            for name in (bound, getattr(node, "name", None), getattr(node, "rest", None)):  # also of `except` and `match`
                if isinstance(name, str):
                    names[name] = ("value", line, "")
            waiting += ast.iter_child_nodes(node)
    return names
