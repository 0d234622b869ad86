"""Print numbers that describe the structure of the compiler: `make structure`, or `make structure SINCE=REVISION`.

    python benchmarks/structure/figures.py [REVISION ...]    # a column for each revision, and a column for the working tree

Only lines of code are counted, without comments, docstrings and empty lines. An import cycle is a set of modules that all need each other
at run time. Imports inside functions count, but imports for type checkers do not count. The numbers of parameters do not include `self` and
`cls`. Template files (`templates/*/`) are not counted. Long functions, and names that many functions have, are listed below the table.
"""

from __future__ import annotations

import ast
import io
import subprocess
import sys
import tokenize
from collections import Counter, defaultdict, deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import networkx

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "compiler/thingc/"
PARAMETERS, LINES, USES = 8, 50, 12
BLOCKS = ("body", "handlers", "orelse", "finalbody", "cases")
"""The fields of a module or a statement that contain statements, or parts of a statement that contain some."""
Trees = dict[str, tuple[str, ast.Module]]
"""The source text and the syntax tree of every module, by path in the package."""


@dataclass(frozen=True)
class Function:
    """A function, with its number of lines (without the docstring) and its number of parameters."""

    where: str
    lines: int
    parameters: int


@dataclass(frozen=True)
class Structure:
    """Numbers that describe the structure of one revision of the compiler."""

    rooms: Counter[str]
    largest: tuple[int, str]
    circles: list[list[str]]
    functions: list[Function]
    twice: list[str]
    names: Counter[str]
    """Number of functions and methods for each name. The `run` functions of commands are not counted."""

    def rows(self) -> list[tuple[str, int]]:
        """Return the rows of the table that follow the rows of the rooms."""
        return [
            ("code lines in all", self.rooms.total()),
            ("top-level entries", len(self.rooms)),
            (f"functions of more than {LINES} lines", sum(one.lines > LINES for one in self.functions)),
            (f"functions with {PARAMETERS} or more parameters", sum(one.parameters >= PARAMETERS for one in self.functions)),
            ("functions", len(self.functions)),
            (f"function names used more than {USES} times", sum(count > USES for count in self.names.values())),
            ("import cycles", len(self.circles)),
            ("class names of several classes", len(self.twice)),
            ("code lines of the largest file", self.largest[0]),
        ]


def main(revisions: list[str]) -> int:
    """Print the table, followed by long functions, frequent function names, import cycles and duplicate class names."""
    states = [structure(committed(revision)) for revision in revisions] + [structure(lying_here())]
    now = states[-1]
    print("| | " + " | ".join([*revisions, "here"]) + " |\n|---|" + "--:|" * len(states))
    for room in sorted({room for state in states for room in state.rooms}, key=lambda room: (-now.rooms[room], room)):
        print(f"| `{room}` | " + " | ".join(f"{state.rooms[room]:,}" if state.rooms[room] else "" for state in states) + " |")
    for row in zip(*(state.rows() for state in states), strict=True):
        print(f"| {row[0][0]} | " + " | ".join(f"{count:,}" for _, count in row) + " |")
    print(f"\nlargest file: {now.largest[1]}")
    for one in sorted(now.functions, key=lambda one: (-one.lines, -one.parameters)):
        if one.lines > LINES or one.parameters >= PARAMETERS:
            print(f"{one.lines:4} lines, {one.parameters:2} parameters  {one.where}")
    print("\n" + "\n".join(f"{count:4} functions  {name}" for name, count in now.names.most_common() if count > USES))
    print("\n".join(["", *(" ".join(circle) for circle in now.circles), *now.twice]).rstrip())
    return 0


def lying_here() -> dict[str, str]:
    """Return the source text of every module in the working tree, by path in the package."""
    folder = ROOT / PACKAGE
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*.py")}


def committed(revision: str) -> dict[str, str]:
    """Return the source text of every module in a git revision, by path in the package."""
    names = git("ls-tree", "-r", "--name-only", revision, PACKAGE).split()
    return {name.removeprefix(PACKAGE): git("show", f"{revision}:{name}") for name in names if name.endswith(".py")}


def git(*words: str) -> str:
    """Run git, and return its standard output."""
    return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True).stdout


def is_template(path: str) -> bool:
    """Return whether a module belongs to a template of a workspace."""
    return path.rpartition("templates/")[2].count("/") > 0 and "templates/" in path


def code_lines(text: str, tree: ast.Module) -> int:
    """Return the number of lines of a module without comments, docstrings and empty lines."""
    lines = text.splitlines()
    docstrings = {
        line for node in statements(tree) if isinstance(body := getattr(node, "body", None), list)
        for one in body if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) and isinstance(one.value.value, str)
        for line in range(one.lineno, one.end_lineno + 1)
    }
    others = [line.strip() for number, line in enumerate(lines, 1) if number not in docstrings]
    if not any('"""' in line or "'''" in line for line in others):  # no multi-line strings, so the file need not be tokenized
        return sum(bool(line) and not line.startswith("#") for line in others)
    layout = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
    code = {
        line for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type not in layout
        for line in range(token.start[0], token.end[0] + 1)
    }
    return len(code - docstrings)


def structure(texts: dict[str, str]) -> Structure:
    """Compute the numbers for a revision, from the source texts of its modules."""
    trees: Trees = {path: (text, ast.parse(text)) for path, text in texts.items() if not is_template(path)}
    sizes = {path: code_lines(text, tree) for path, (text, tree) in trees.items()}
    names: Counter[str] = Counter()
    rooms: Counter[str] = Counter()
    classes: defaultdict[str, set[str]] = defaultdict(set)
    for path, (_, tree) in trees.items():
        rooms[path.partition("/")[0]] += sizes[path]
        for node in statements(tree):
            if isinstance(node, ast.FunctionDef) and not (node.name == "run" and "cli/" in path) and not node.name.startswith("__"):
                names[node.name] += 1
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].add(path)
    return Structure(
        rooms=rooms,
        largest=max((size, path) for path, size in sizes.items()),
        circles=circles(trees),
        functions=[one for path, (_, tree) in sorted(trees.items()) for one in functions(path, tree)],
        twice=[f"{name}: {', '.join(sorted(paths))}" for name, paths in sorted(classes.items()) if len(paths) > 1],
        names=names,
    )


def statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield a module and its statements, outer statements first. Expressions are skipped, because they make up most of a syntax tree."""
    waiting: deque[ast.AST] = deque([tree])
    while waiting:
        node = waiting.popleft()
        yield node
        waiting.extend(blocks(node))


def blocks(node: ast.AST) -> list[ast.AST]:
    """Return the statements in a module or a statement, and the handlers and cases that contain further statements."""
    return [inner for name in BLOCKS for inner in getattr(node, name, ())]


def functions(path: str, tree: ast.Module) -> Iterator[Function]:
    """Yield the functions of a module, including methods and nested functions."""
    for node in statements(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            names = [argument.arg for argument in ast.walk(node.args) if isinstance(argument, ast.arg)]
            bound = names[:1] in (["self"], ["cls"])
            first = node.body[0]
            docstring = 0 if ast.get_docstring(node) is None else first.end_lineno - first.lineno + 1
            yield Function(f"{path}:{node.lineno} {node.name}", node.end_lineno - node.lineno + 1 - docstring, len(names) - bound)


def circles(trees: Trees) -> list[list[str]]:
    """Return all import cycles, each as a sorted list of modules."""
    names = {module(path): path for path in trees}
    graph = networkx.DiGraph()
    for name, path in names.items():
        for node in at_run_time(trees[path][1]):
            if isinstance(node, ast.ImportFrom):
                wanted = {f"{node.module}.{alias.name}" for alias in node.names}
                graph.add_edges_from((name, one if one in names else node.module) for one in wanted)
            elif isinstance(node, ast.Import):
                graph.add_edges_from((name, alias.name) for alias in node.names)
    return sorted(sorted(circle) for circle in networkx.strongly_connected_components(graph) if len(circle) > 1)


def module(path: str) -> str:
    """Return the import name of the module at a path."""
    return f"thingc.{path.removesuffix('.py').replace('/', '.')}".removesuffix(".__init__")


def at_run_time(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and the statements below it, except code that only type checkers read."""
    yield node
    for inner in node.orelse if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test) else blocks(node):
        yield from at_run_time(inner)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
