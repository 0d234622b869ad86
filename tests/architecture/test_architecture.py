"""The house as its drawing says: imports point one way, and the CAD kernel stays behind its wall."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import get_args

import networkx
import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "compiler" / "thingc"

BASE = {
    "frozen", "brief", "shown", "source", "typos", "diagnostics", "units", "expressions", "pose", "inertia", "mirror", "primitives",
    "sensing",
    "memo", "packaging", "exports", "unit_spellings", "file_names", "files", "replacement", "heading", "circles", "summing", "syntax",
    "installed", "workspace", "mesh_bounds",
}
# What each room may import of thingc, besides itself. `workspace` reads its own document with load and spec.
ROOMS: dict[str, set[str]] = {
    "frozen": set(), "shown": set(), "source": {"frozen"}, "brief": {"source"}, "typos": {"shown"},
    "diagnostics": {"brief", "shown", "source", "typos"},
    "printing": {"brief", "shown", "source", "diagnostics"}, "units": {"frozen", "diagnostics", "typos", "unit_spellings"},
    "expressions": {"frozen", "diagnostics", "typos", "units"},
    "summing": set(), "syntax": set(), "pose": {"frozen", "summing"}, "inertia": {"frozen", "brief", "pose"}, "mirror": {"pose"},
    "primitives": {"frozen", "brief", "pose", "inertia", "summing"}, "sensing": {"frozen", "brief", "source", "units", "primitives"},
    "memo": set(), "file_names": set(), "files": set(), "replacement": {"diagnostics", "files"},
    "heading": set(), "circles": set(), "unit_spellings": set(), "installed": {"files"},
    "mesh_bounds": set(), "later": set(), "exports": set(), "packaging": {"frozen"},
    "archives": {"frozen"}, "gaps": set(), "csvcell": {"shown", "gaps"}, "webpage": {"shown"}, "exchange": set(),
    "workspace": BASE | {"load", "spec"},
    "load": BASE,
    "spec": BASE | {"load", "joints", "checks"},
    # A file holds all of a kind of test: what is written, which `spec` reads, and how it is run, which knows robots.
    "checks": BASE | {"spec", "realize", "resolve", "joints", "graph", "robot", "statics", "testing", "emit"},
    "things": set(),
    "line_process": set(),
    "realize": BASE | {"things", "line_process"},
    "meshes": BASE | {"load", "realize"},
    "joints": BASE,
    "resolve": BASE | {"load", "spec", "checks", "realize", "meshes", "joints"},
    "graph": BASE | {"checks", "resolve", "realize", "meshes", "joints"},
    "robot": BASE | {"resolve", "realize", "joints", "graph"},
    "solids": BASE | {"realize", "graph"},
    "statics": BASE | {"joints", "graph", "robot"},
    "drawing": {"frozen", "summing"},
    "emit": BASE | {"later", "gaps", "archives", "csvcell", "webpage", "resolve", "realize", "joints", "graph", "robot", "statics",
        "drawing"},
    "modes": {"brief", "diagnostics", "summing", "typos"},  # read at run time, next to a simulation
    "render": {"frozen", "pose", "summing"},
    "reporting": {"frozen", "shown", "source", "diagnostics"},
    "templates": set(),
    "importing": BASE | {"load", "layout", "realize", "meshes"},
    "layout": BASE | {"load", "spec"},
    "editor": BASE | {"load", "spec", "realize", "resolve", "watching"},
    "lsp": BASE | {"environment", "pipeline", "dependencies", "stamp", "watching", "load", "spec", "layout", "realize", "resolve", "joints",
        "graph", "robot", "editor", "variants"},
    "testing": BASE | {"printing", "checks", "resolve", "realize", "joints", "graph", "robot", "statics", "solids", "emit"},
    "affected": BASE | {"load", "realize"},
    "diff": BASE | {"affected", "render", "environment", "pipeline", "stamp", "load", "resolve", "realize", "joints", "graph", "emit",
        "testing"},
    "output": BASE | {"exchange", "realize", "emit"},
    "stamp": BASE | {"realize"},
    "environment": BASE | {"realize"},
    "pipeline": BASE | {"environment", "load", "spec", "realize", "meshes", "resolve", "joints", "graph", "robot", "solids", "emit"},
    "dependencies": BASE | {"environment", "pipeline", "stamp", "resolve"},
    "session": BASE | {"environment", "pipeline", "resolve", "emit"},
    "building": BASE | {"environment", "pipeline", "output", "realize", "graph", "emit"},
    "watching": set(),
    "writing": BASE | {"environment", "pipeline", "layout", "load", "spec"},
    "live": BASE | {"watching", "environment", "pipeline", "dependencies", "building", "output", "stamp", "realize", "emit"},
    "plans": BASE | {"archives", "gaps", "csvcell", "pipeline", "session", "load", "spec", "realize", "resolve", "emit"},
    "patching": {"frozen"},
    "variants": BASE | {"printing", "archives", "csvcell", "webpage", "line_process", "environment", "pipeline", "stamp", "session",
        "plans", "load", "spec",
        "realize", "resolve", "graph", "robot", "statics", "emit", "output", "modes", "render", "patching"},
    "api": BASE | {"printing", "environment", "pipeline", "plans", "realize", "graph", "robot", "emit"},
    "families": BASE | {"api", "environment", "pipeline", "session", "output", "load", "spec", "realize", "resolve", "emit", "testing",
        "plans", "patching", "variants", "writing", "modes"},
    "cli": BASE | {"printing", "environment", "pipeline", "dependencies", "realize", "graph", "robot", "emit", "output", "stamp", "resolve",
        "render", "reporting", "layout", "editor", "lsp", "testing", "variants", "load", "spec", "joints", "checks", "affected", "building",
        "diff", "live", "templates", "writing", "importing"},
    "__init__": {"things", "api", "modes", "families"},
    "__main__": {"cli"},
}
# The door: what satellites may import, besides themselves and what stands below all rooms: the driver, what the `__init__` of a room
# exports, and modules of types that passes hand over. ARCHITECTURE.md says so too, under "The door".
DRIVER = {"environment", "pipeline", "dependencies", "session", "building", "output", "stamp"}
TYPES = {
    "spec.assembly", "spec.variants", "realize.record", "resolve.model", "resolve.link_definition", "graph.types", "robot.types",
    "emit.artifact",
}
ANY = {"*"}
SATELLITES: dict[str, dict[str, set[str]]] = {
    "render": {},
    "reporting": {},
    "editor": {
        "load": {"Documents", "documents_in", "load", "packaged_documents", "read_tree"},
        "realize.record": ANY,
        "resolve": {"Settings", "Sources", "part_definitions", "resolve"},
        "resolve.model": ANY,
        "resolve.link_definition": ANY,
        "spec": {"REFERENCE_PATTERN", "Specs", "json_schema", "part_references", "validate"},
    },
    "lsp": {
        "editor": {"Facts", "Schemas", "facts_of"},
        "environment": {"Environment", "Lend", "Options", "geometry_of"},
        "pipeline": {"*"},
        "dependencies": {"*"},
        "load": {"Documents", "documents_in", "has_header", "load", "named", "read_tree"},
        "resolve": {"RESERVED"},
        "joints": {"KINDS"},
        "spec": {"Declares", "Means", "Meant", "Mention", "mentions_of", "referred", "setting_words"},
        "layout": {"Looked", "TextEdit", "Unsettable", "format_document", "located", "sure_edits", "with_values"},
        "realize": {
            "ABSENT", "BadLock", "Decision", "EndingWorkers", "GeometryService", "Module", "NoWorkers", "PartAnswers", "Slicing", "Store",
            "StoreUnusable", "read_lock",
        },
        "stamp": {"state_of"},
        "variants": {"read_plan"},
        "realize.record": ANY,
        "resolve.model": ANY,
        "graph.types": ANY,
        "robot.types": ANY,
    },
    "live": {
        "pipeline": {"*"},
        "dependencies": {"*"},
        "building": {"*", "Built", "Wish"},
        "environment": {"Environment", "Options", "geometry_of"},
        "output": {"Waiting"},
        "realize": {"BlobMissing", "EndingWorkers", "GeometryService", "Store"},
        "emit": {"Page", "waiting"},
        "emit.artifact": ANY,
        "stamp": {"state_of"},
    },
    "diff": {
        "affected": {"NotARepository", "changed_paths", "git", "run_git", "touched"},
        "environment": {"Environment", "Options"},
        "pipeline": {"*", "Compilation"},
        "stamp": {"fingerprint", "packed", "unpacked"},
        "load": {"Documents"},
        "joints": {"KINDS"},
        "resolve": {"assemblies_of"},
        "resolve.model": ANY,
        "realize": {"BlobMissing", "Store", "StoreUnusable", "arrays", "read_lock"},
        "realize.record": ANY,
        "graph.types": ANY,
        "emit": {"with_pieces"},
        "testing": {"Selection", "run"},
        "render": {"body_poses", "extent", "small_picture"},
    },
    "affected": {"load": {"Documents", "documents_in", "load", "named"}, "realize": {"Store", "part_inputs"}},
    "variants": {
        "environment": {"Environment", "Lend", "Options", "store_of"},
        "pipeline": {"*", "Compilation"},
        "session": {"Session"},
        "plans": {"Builds", "SettingsReader"},
        "output": {"NOTHING", "Blobs", "same_file", "unexpected_files"},
        "stamp": {"state_of"},
        "load": {"Documents", "find_assembly", "load"},
        "spec": {"stated_choices", "stated_value", "validate_one", "within"},
        "spec.assembly": ANY,
        "spec.variants": ANY,
        "realize": {"BlobMissing", "Digests", "Store", "StoreUnusable"},
        "realize.record": ANY,
        "resolve": {"AssemblyParameters", "Settings", "Sources", "part_definitions"},
        "resolve.model": ANY,
        "graph": {"coordinates", "joints_of", "link"},
        "graph.types": ANY,
        "robot": {"in_link", "placed_bodies"},
        "robot.types": ANY,
        "statics": {"lifted", "stance", "static_efforts"},
        "emit": {"chosen", "unknown", "versions"},
        "emit.artifact": ANY,
        "modes": {"Modes"},
        "patching": {"ModelText", "TextModels"},
        "render": {"NoGraphics", "extent", "ready", "small_picture"},
    },
}
OF_EXTRAS = {"families.learning", "variants.dask_worker", "variants.learning"}
KERNEL = {"build123d", "OCP", "bd_warehouse", "lib3mf"}
KERNEL_ROOMS = {"things"}
KERNEL_MODULES = {"realize/worker/server.py", "realize/worker/reads.py"}
KERNEL_FOLDER = "realize/worker/kernel/"
# What each folder of `realize`, and each module of plain data there, may import of it. The rest is the service: it sees them all.
REALIZE: dict[str, set[str]] = {
    "slices": set(), "record": {"slices"}, "record_json": {"record", "slices"},
    "store": {"record", "slices"},
    "key": {"record", "record_json", "store"},
    "worker": {"record", "record_json", "slices", "store", "key"},
    "lock": {"record", "record_json", "slices", "store", "key", "answers", "decisions", "service"},
}
HEAVY = {"numpy", "networkx", "trimesh", "mujoco", "scipy", "rich", "typer", "manifold3d", "coacd", "ruamel", "tomlkit"}
CHECK_ROOMS = BASE | {"load", "spec", "checks", "resolve", "graph", "joints", "robot", "environment", "pipeline", "stamp"}


def modules() -> list[Path]:
    """Those of the compiler; in the folders of `templates/` are files of new workspaces."""
    begun = PACKAGE / "templates"
    return sorted(path for path in PACKAGE.rglob("*.py") if path.parent == begun or begun not in path.parents)


@cache
def tree(path: Path) -> ast.Module:
    """A module as Python reads it."""
    return ast.parse(path.read_text())


@pytest.fixture(scope="module", autouse=True)
def read_once() -> Iterator[None]:
    """Trees are kept for all tests here, and no longer: they take much room."""
    yield
    tree.cache_clear()


def room_of(path: Path) -> str:
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


@cache
def imported(path: Path) -> frozenset[str]:
    """Every module that a file names in an import, wherever it stands."""
    found: set[str] = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide the direction"
            assert node.module is not None
            found |= {f"{node.module}.{alias.name}" for alias in node.names} if node.module == "thingc" else {node.module}
    return frozenset(found)


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    room = room_of(path)
    assert room in ROOMS, f"{room} is a new room: say in ROOMS what it may see"
    seen = {name.split(".")[1] for name in imported(path) if name.startswith("thingc.")}
    seen -= {room, "__version__"}
    assert seen <= ROOMS[room], f"{path.relative_to(PACKAGE)} must not import {sorted(seen - ROOMS[room])}"


@pytest.mark.parametrize("satellite", SATELLITES)
def test_satellites_use_the_door(satellite: str) -> None:
    below = BASE | {"printing", "archives", "csvcell", "webpage", "watching", "line_process", satellite}
    seen: dict[str, set[str]] = {}
    for path in (PACKAGE / satellite).rglob("*.py"):
        for node in ast.walk(tree(path)):
            for module, name in named_in(node):
                if module.split(".")[0] not in below:
                    seen.setdefault(module, set()).add("*" if module in TYPES else name)
    assert seen == SATELLITES[satellite], "say in SATELLITES what it may import, or take out there what it does not"


def named_in(node: ast.AST) -> Iterator[tuple[str, str]]:
    """Modules of thingc (`load.paths`; empty for thingc itself) with the names that an import takes from each; of whole modules, `*`."""
    if isinstance(node, ast.Import):
        yield from ((alias.name.removeprefix("thingc."), "*") for alias in node.names if alias.name.startswith("thingc."))
    elif isinstance(node, ast.ImportFrom) and node.module == "thingc":
        whole = {room_of(path) for path in modules()}
        yield from ((alias.name, "*") if alias.name in whole else ("", alias.name) for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("thingc."):
        assert node.module is not None
        yield from ((node.module.removeprefix("thingc."), alias.name) for alias in node.names)


def test_the_door_is_narrow() -> None:
    """A satellite may import a module only where that is the driver's, a room's own `__init__` (or thingc's), or one of types."""
    for satellite, wanted in SATELLITES.items():
        for module, names in wanted.items():
            if module in DRIVER | TYPES:
                continue
            door = PACKAGE / module / "__init__.py"
            assert door.is_file(), f"{satellite} reaches into a room: {module}"
            exported = set(import_module(f"thingc.{module}".rstrip(".")).__all__)
            assert names <= exported, f"thingc.{module} does not export {sorted(names - exported)}, which {satellite} wants"


def test_the_door_is_in_the_drawing() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text().partition("## The door")[2].partition("\n## ")[0]
    told = {word.removesuffix(".py").replace("/", ".") for word in re.findall(r"`([\w/]+\.py)`", text)} - {"__init__"}
    assert told == TYPES | DRIVER
    assert {word for word in SATELLITES if f"`{word}/`" in text} == set(SATELLITES)


def test_optional_dependencies_stay_optional() -> None:
    """What extras bring is imported where it is used, inside functions; modules that are nothing without it are imported so as well."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    optional = {re.split(r"[<>=!~]", line)[0] for name, lines in extras.items() if name != "dev" for line in lines}
    wanted = optional | {f"thingc.{name}" for name in OF_EXTRAS}
    at_once = {
        path.relative_to(PACKAGE).with_suffix("").as_posix().replace("/", ".") for path in modules()
        for node in at_run_time(tree(path), called=False)
        for name in ([alias.name for alias in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", None) or ""])
        if name in wanted or name.split(".")[0] in wanted
    }
    assert optional >= {"distributed", "gymnasium", "optuna"} and at_once == OF_EXTRAS


@pytest.mark.parametrize("folder", REALIZE)
def test_folders_of_realize_point_one_way(folder: str) -> None:
    seen = {
        (path.relative_to(PACKAGE).as_posix(), name) for path in modules()
        if path.relative_to(PACKAGE).parts[:2] in {("realize", folder), ("realize", f"{folder}.py")}
        for name in imported(path) if name.startswith("thingc.geometry.")
    }
    assert seen or not REALIZE[folder]
    assert {(path, name) for path, name in seen if name.split(".")[2] not in REALIZE[folder] | {folder}} == set()


def at_run_time(node: ast.AST, *, called: bool = True) -> Iterator[ast.AST]:
    """What is below a node, but for what stands there for type checkers alone; of functions only where they are `called`."""
    if not called and isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
        return
    yield node
    for inner in node.orelse if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test) else ast.iter_child_nodes(node):
        yield from at_run_time(inner, called=called)


# Tables that some members of a closed set have no place in: what they have none for is looked up with `get`, and means nothing there.
IN_PART = {"diff.change._BACKWARD", "sensing._MOVED", "spec.sensors._EXAMPLES"}


def test_tables_by_closed_sets_are_whole() -> None:
    """A dictionary of a module that is annotated as one by a `Literal` or an enum of ours has every member, which mypy does not ask for."""
    asked, missing = set(), {}
    for path in modules():
        name = ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")
        for node in tree(path).body:
            table = re.match(r"(\w+): (?:dict|Mapping)\[([A-Z]\w+), ", ast.unparse(node)) if isinstance(node, ast.AnnAssign) else None
            if table is None or table[2] in ("Any", "Code", "Path"):
                continue
            module = import_module(f"thingc.{name}")
            keys = getattr(module, table[2], None)
            members = set(keys) if isinstance(keys, type) and issubclass(keys, Enum) else set(get_args(keys))
            if members:
                asked.add(f"{name}.{table[1]}")
                missing[f"{name}.{table[1]}"] = members - getattr(module, table[1]).keys()
    assert len(asked) > 12 and {table for table, members in missing.items() if members} == IN_PART, missing


def test_no_module_needs_itself() -> None:
    """Imports inside functions count: they put a circle off, and do not open it."""
    names = {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path for path in modules()}
    graph = networkx.DiGraph()
    for name, path in names.items():
        for node in at_run_time(tree(path)):
            if isinstance(node, ast.ImportFrom):
                wanted = {f"{node.module}.{alias.name}" for alias in node.names}
                graph.add_edges_from((name, one if one in names else node.module) for one in wanted)
            elif isinstance(node, ast.Import):
                graph.add_edges_from((name, alias.name) for alias in node.names)
    circles = [sorted(circle) for circle in networkx.strongly_connected_components(graph) if len(circle) > 1]
    assert len(graph) > len(names) and circles == []


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_only_the_worker_sees_the_kernel(path: Path) -> None:
    relative = path.relative_to(PACKAGE).as_posix()
    if room_of(path) in KERNEL_ROOMS or relative in KERNEL_MODULES or relative.startswith(KERNEL_FOLDER):
        return
    kernel = {name for name in imported(path) if name.split(".")[0] in KERNEL}
    assert not kernel, f"{relative} imports the CAD kernel: {sorted(kernel)}"


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_the_path_of_check_is_light(path: Path) -> None:
    if room_of(path) not in CHECK_ROOMS:
        return
    heavy = {name for name in imported(path) if name.split(".")[0] in HEAVY}
    assert not heavy, f"{path.relative_to(PACKAGE)} imports {sorted(heavy)}"


def test_every_public_name_has_a_docstring() -> None:
    missing = []
    for path in modules():
        for node in tree(path).body:
            if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_"):
                continue
            if ast.get_docstring(node) is None:
                missing.append(f"{path.relative_to(PACKAGE)}: {node.name}")
            if isinstance(node, ast.ClassDef):
                missing += [
                    f"{path.relative_to(PACKAGE)}: {node.name}.{method.name}"
                    for method in node.body
                    if isinstance(method, ast.FunctionDef) and not method.name.startswith("_") and ast.get_docstring(method) is None
                    and not any(isinstance(d, ast.Attribute) and d.attr == "setter" for d in method.decorator_list)
                    and not any(isinstance(d, ast.Name) and d.id == "overload" for d in method.decorator_list)
                ]
    assert not missing, missing


def test_a_class_name_means_one_class() -> None:
    """`modes` is read beside a simulation, without the compiler: it has joints, links and modes of its own."""
    places: dict[str, set[str]] = {}
    for path in modules():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_") and room_of(path) != "modes":
                places.setdefault(node.name, set()).add(path.relative_to(PACKAGE).as_posix())
    assert places and {name: sorted(files) for name, files in places.items() if len(files) > 1} == {}


NUMBERS = {
    "pose", "inertia", "mirror", "primitives", "joints", "resolve", "checks", "graph", "robot", "statics", "solids", "modes", "drawing",
}
"""Rooms that reckon with floats."""


def test_sums_of_floats_are_the_same_in_every_python() -> None:
    """`sum` is, of floats, another function from Python 3.12 on: where numbers are reckoned with it counts, or adds to a start."""
    others = []
    for path in (one for one in modules() if room_of(one) in NUMBERS):
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "sum" and len(node.args) == 1:
                of = node.args[0].elt if isinstance(node.args[0], ast.GeneratorExp) else node.args[0]
                if not (isinstance(of, ast.Constant) and type(of.value) is int):
                    others.append(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    assert not others, "thingc.base.summing.plain_sum"


def test_lengths_are_the_same_in_every_python() -> None:
    """`math.hypot` and `math.dist` have other last digits from Python 3.12 on. `things` imports nothing of ours; `principal_axes` says why
    it does without."""
    theirs = re.compile(r"\bmath\.(hypot|dist)\b|from math import .*\b(hypot|dist)\b")
    others = [str(path.relative_to(PACKAGE)) for path in modules() if theirs.search(path.read_text())]
    assert set(others) == {"summing.py", "inertia.py", "things/inspection.py"}, "thingc.base.summing.hypot, thingc.base.summing.dist"


def test_modules_stay_readable() -> None:
    long = {str(p.relative_to(PACKAGE)): n for p in modules() if (n := len(p.read_text().splitlines())) > 500}
    assert not long, long


def test_importing_thingc_is_light() -> None:
    program = "import sys, json, thingc; print(json.dumps(sorted(sys.modules)))"
    loaded = json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout)
    heavy = {name.split(".")[0] for name in loaded} & (KERNEL | HEAVY | {"pydantic", "yaml"})
    assert not heavy


def test_diagnostic_codes_are_a_closed_set() -> None:
    from thingc.base.diagnostics import Code

    codes = [code.code for code in Code]
    assert len(set(codes)) == len(codes)
    assert all(code.title and code.cure for code in Code)
    # Enum makes members of equal values aliases of one another: a duplicate would vanish silently.
    assert len(Code.__members__) == len(list(Code))


def test_warnings_of_documents_can_be_allowed() -> None:
    """A code that a pass warns of has the command that says it: without, nobody could write `allow: {CODE: reason}`."""
    passes = {"load", "spec", "checks", "resolve", "graph", "robot", "emit", "testing"}
    warned: dict[str, bool] = {}
    for path in modules():
        for node in ast.walk(tree(path)) if room_of(path) in passes else ():
            if not isinstance(node, ast.Call) or not node.args:
                continue
            code = node.args[0]
            if not (isinstance(code, ast.Attribute) and isinstance(code.value, ast.Name) and code.value.id == "Code"):
                continue
            severities = [ast.unparse(keyword.value) for keyword in node.keywords if keyword.arg == "severity"]
            if ast.unparse(node.func).endswith(".warn") or severities == ["Severity.WARNING"]:
                from thingc.base.diagnostics import Code

                warned[code.attr] = Code[code.attr].warned_by is not None
    allowances = {"UNNEEDED"}  # said by the report itself
    assert len(warned) >= 5 and not [name for name, known in warned.items() if not known] and not allowances & set(warned)


def test_what_commands_print_goes_through_one_place() -> None:
    """`common.say` and the forms of diagnostics show what documents hold as text; a plain `print` would hand on escape sequences."""
    plain = [
        f"{path.name}:{node.lineno}" for path in (PACKAGE / "cli").glob("*.py") if path.name != "common.py"
        for node in ast.walk(tree(path))
        if isinstance(node, ast.Call) and (
            isinstance(node.func, ast.Name) and node.func.id == "print"
            or isinstance(node.func, ast.Attribute) and node.func.attr == "write" and "sys.std" in ast.unparse(node.func)
        )
    ]
    assert plain == []
