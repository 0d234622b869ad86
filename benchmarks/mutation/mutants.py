"""Create mutants of Python source code, each with one changed expression."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass

ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
COMPARISONS = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Is: ast.IsNot,
    ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}
CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}
MESSAGES = {"message", "help", "notes", "what", "says"}
"""Names of keyword arguments that are messages for people."""
TEXTS = {"fault", "note", "Note"}
"""Names of functions whose arguments are messages for people. Calls whose first argument is a `Code` also contain messages."""


@dataclass(frozen=True)
class Mutant:
    """A mutant: a change of one expression in `file` (relative to the package). The mutant contains the new text of the file, and the old
    and the new expression.
    """

    file: str
    line: int
    statement: int
    old: str
    new: str
    text: str


def mutants(file: str, source: str) -> Iterator[Mutant]:
    """Yield all mutants of a module, from its path and its source text."""
    lines = source.encode().splitlines(keepends=True)
    for node, statement in _expressions(ast.parse(source)):
        if node.lineno != node.end_lineno:
            continue
        line = lines[node.lineno - 1]
        old = line[node.col_offset : node.end_col_offset]
        for changed in _changes(node):
            new = ast.unparse(changed).encode()
            new = new if isinstance(changed, (ast.Constant, ast.Call, ast.Name, ast.Tuple)) else b"(" + new + b")"
            text = [*lines[: node.lineno - 1], line[: node.col_offset] + new + line[node.end_col_offset :], *lines[node.lineno :]]
            yield Mutant(file, node.lineno, statement, old.decode(), new.decode(), b"".join(text).decode())


def _expressions(tree: ast.AST, statement: int = 0) -> Iterator[tuple[ast.expr, int]]:
    """Yield expressions that affect results, each with the first line of its statement. Annotations, types, decorators and messages are
    skipped.
    """
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list", "bases", "type_params", "op", "ops"):
            continue
        for node in value if isinstance(value, list) else [value]:
            if not isinstance(node, ast.AST) or _skipped(tree, node):
                continue
            line = node.lineno if isinstance(node, ast.stmt) else statement
            unordered = isinstance(node, ast.Tuple) and (isinstance(tree, ast.Compare) or ast.unparse(tree).startswith("isinstance("))
            if isinstance(node, ast.expr) and not unordered:
                yield node, line
            yield from _expressions(node, line)


def _skipped(parent: ast.AST, node: ast.AST) -> bool:
    match node:
        case ast.JoinedStr() | ast.Raise() | ast.Assert():
            return True
        case ast.If(test=ast.Name(id="TYPE_CHECKING")) | ast.Assign(targets=[ast.Name(id="__all__" | "__slots__")]):
            return True
        case ast.keyword(arg=name):
            return name in MESSAGES or name == "strict"
        case ast.Call(args=[ast.Attribute(value=ast.Name(id="Code")), *_]):
            return True
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return name in TEXTS
        case ast.Tuple():
            return isinstance(parent, ast.Subscript)
    return False


def _changes(node: ast.expr) -> Iterator[ast.expr]:
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            if any(isinstance(one, ast.JoinedStr) or isinstance(one, ast.Constant) and isinstance(one.value, str) for one in (left, right)):
                return
            if type(op) in ARITHMETIC:
                yield ast.BinOp(left, ARITHMETIC[type(op)](), right)
            if isinstance(op, (ast.Add, ast.Sub)):
                yield left
            if isinstance(op, (ast.Mult, ast.Div)):
                yield ast.UnaryOp(ast.USub(), node)
            if isinstance(op, ast.MatMult):
                yield ast.BinOp(right, op, left)
                yield left
        case ast.Compare(left=left, ops=[op], comparators=right):
            yield ast.Compare(left, [COMPARISONS[type(op)]()], right)
        case ast.Compare(left=left, ops=[first, *rest], comparators=right):
            yield ast.Compare(left, [COMPARISONS[type(first)](), *rest], right)
        case ast.BoolOp(op=op, values=values):
            yield ast.BoolOp(ast.Or() if isinstance(op, ast.And) else ast.And(), values)
            yield from (ast.BoolOp(op, [*values[:k], *values[k + 1 :]]) if len(values) > 2 else values[1 - k] for k in range(len(values)))
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.Call(func=ast.Name(id=name)) if name in CALLS:
            yield ast.Call(ast.Name(CALLS[name]), node.args, node.keywords)
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(2.0 * value if value else 1.0)
        case ast.Tuple(elts=[first, second, *_], ctx=ast.Load()) if ast.dump(first) != ast.dump(second):
            swapped = deepcopy(node)
            swapped.elts[:2] = [second, first]
            yield swapped
        case ast.IfExp(test=test, body=body, orelse=other):
            yield ast.IfExp(test, other, body)
