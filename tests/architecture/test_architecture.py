"""Architecture rules: imports point in one direction, and only the worker uses the CAD kernel."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import get_args

import networkx
import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "compiler" / "thingc"

ORDER = (
    "base", "modes", "documents", "geometry", "model/resolve", "model/assembly", "model/robot", "model", "targets", "driver", "batch",
    "tools", "__init__", "__main__",
)
"""Layers of the package and folders in them: a module may import from its own layer and from earlier ones."""
ENTRIES = {"__init__.py", "__main__.py", "py.typed", *(room for room in ORDER if room.isidentifier() and not room.startswith("__"))}
TYPES_ONLY = {("documents/checks", "thingc.model.resolve"), ("documents/checks", "thingc.model.assembly")}
ALONE = {"geometry/things": ("thingc.base.bom_values", "thingc.base.interfaces"), "tools/templates": ()}
"""Folders that import nothing else of thingc, except these modules: the first is the API for part authors, the second contains the files
of new workspaces."""
OF_EXTRAS = {
    "batch.gym.family_env", "batch.cluster.dask_plugin", "batch.families.jax_function", "batch.families.mjx_constants",
    "batch.families.mjx_family", "batch.gym.mjx_env", "batch.gym.variants_env", "modes.jax",
    "tools.mcp.server",
}
KERNEL = {"build123d", "OCP", "bd_warehouse", "lib3mf"}
KERNEL_MODULES = (
    "geometry/things/", "geometry/worker/server.py", "geometry/worker/file_reads.py", "geometry/worker/kernel/", "tools/kernel/",
)
# What each folder of `geometry`, and each module of plain data there, may import of it. The rest is the service: it sees them all.
GEOMETRY: dict[str, set[str]] = {
    "print_slices": set(), "features": set(), "declared_interfaces": {"features"}, "record": {"print_slices"},
    "print_support": {"print_slices", "store"},
    "record_json": {"record", "print_slices"}, "store": {"record", "print_slices"},
    "key": {"record", "record_json", "store"},
    "worker": {
        "things", "mesh_bounds", "features", "declared_interfaces", "record", "record_json", "print_slices", "print_support", "store",
        "key",
    },
    "lock": {"record", "record_json", "print_slices", "store", "key", "build_reasons", "slice_cache"},
}
HEAVY = {"numpy", "networkx", "trimesh", "mujoco", "scipy", "rich", "typer", "manifold3d", "coacd", "ruamel", "tomlkit"}
LIGHT = (
    "base/", "documents/load/", "documents/spec/", "documents/checks/", "documents/expressions/", "documents/workspace.py",
    "model/resolve/", "model/assembly/", "model/robot/", "driver/environment.py", "driver/pipeline.py", "driver/up_to_date.py",
)
"""The modules that `check` runs."""


def modules() -> list[Path]:
    """Return the modules of the compiler; the folders in `templates/` contain files of new workspaces."""
    begun = PACKAGE / "tools/templates"
    return sorted(path for path in PACKAGE.rglob("*.py") if path.parent == begun or begun not in path.parents)


@cache
def tree(path: Path) -> ast.Module:
    """Return the syntax tree of a module."""
    return ast.parse(path.read_text())


@pytest.fixture(scope="module", autouse=True)
def read_once() -> Iterator[None]:
    """Clear the cached syntax trees after these tests, because they use much memory."""
    yield
    for cached in (tree, nodes_of, statements):
        cached.cache_clear()


def place_of(path: Path) -> str:
    """Return the path of a module in the package, such as `model/robot/tree.py`."""
    return path.relative_to(PACKAGE).as_posix()


def module_name(path: Path) -> str:
    """Return the dotted name of a module, such as `thingc.model.robot.tree`; for a package the name of the package."""
    return ".".join(("thingc", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")


def layer(name: str) -> int:
    """Return the index in `ORDER` of a module, or of a name in it: that of the longest matching entry."""
    words = name.split(".")[1:] or ["__init__"]
    found = [room for room in ORDER if words[: room.count("/") + 1] == room.split("/")]
    assert found, f"{name} is in no room of ORDER"
    return ORDER.index(max(found, key=len))


BODIES = ("body", "handlers", "orelse", "finalbody", "cases")
"""The fields of a module or a statement that contain statements, or parts of a statement that contain some."""


def at_run_time(node: ast.AST, *, called: bool = True) -> Iterator[ast.AST]:
    """Yield the statements below a node, except those under TYPE_CHECKING; bodies of functions only if `called`."""
    waiting = [node]
    while waiting:
        node = waiting.pop()
        if called or not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node
            types = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
            waiting += node.orelse if types else [inner for name in BODIES for inner in getattr(node, name, ())]


def named_by(nodes: Iterable[ast.AST]) -> set[str]:
    """Return the modules, and names in them, in the import statements among `nodes`: `thingc.base.units.LENGTH`."""
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module is not None, "relative imports hide the direction"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@cache
def nodes_of(path: Path) -> list[ast.AST]:
    """Return all nodes of the syntax tree of a module, as `ast.walk` does, in less time."""
    nodes: list[ast.AST] = [tree(path)]
    for node in nodes:
        for value in vars(node).values():
            if isinstance(value, ast.AST):
                nodes.append(value)
            elif isinstance(value, list):
                nodes += [inner for inner in value if isinstance(inner, ast.AST)]
    return nodes


@cache
def statements(path: Path) -> list[ast.AST]:
    """Return a module and its statements. Expressions are omitted, because they make up most of a syntax tree."""
    nodes: list[ast.AST] = [tree(path)]
    for node in nodes:
        nodes += [inner for name in BODIES for inner in getattr(node, name, ())]
    return nodes


@cache
def imported(path: Path) -> frozenset[str]:
    """Return every module, and every name in it, that a file imports anywhere."""
    return frozenset(named_by(statements(path)))


def test_package_has_the_expected_entries() -> None:
    assert {path.name for path in PACKAGE.iterdir()} - {"__pycache__"} == ENTRIES


def test_imports_point_in_one_direction() -> None:
    wrong = {}
    for path in modules():
        place, own = place_of(path), layer(module_name(path))
        ours = {name for name in imported(path) if name.startswith("thingc.") and name != "thingc.__version__"}
        if later := {name for name in ours if layer(name) > own}:
            only_types = {
                name for name in later - named_by(at_run_time(tree(path)))
                if any(place.startswith(f"{folder}/") and name.startswith(room) for folder, room in TYPES_ONLY)
            }
            wrong[place] = sorted(later - only_types)
    assert wrong and {place: names for place, names in wrong.items() if names} == {}, "these modules must not import that"


def test_isolated_folders_do_not_import_others() -> None:
    """Targets do not import the document modules; some folders import nothing else of thingc."""
    for path in modules():
        place, ours = place_of(path), {name for name in imported(path) if name.startswith("thingc.")}
        if place.startswith("targets/"):
            ours = {name for name in ours if re.match(r"thingc\.documents\.(load|spec|format)\b", name)}
            assert not ours, f"{place} must not import {sorted(ours)}"
        for folder, others in ALONE.items():
            if place.startswith(f"{folder}/"):
                outside = {name for name in ours if not name.startswith((f"thingc.{folder.replace('/', '.')}.", *others))}
                assert not outside, f"{place} must not import {sorted(outside)}"


def test_scripts_import_names_that_exist() -> None:
    """mypy does not check the scripts of benchmarks, documentation and packaging."""
    scripts = [path for name in ("benchmarks", "docs", "examples", "packaging") for path in (ROOT / name).rglob("*.py")]
    wrong = []
    for script in scripts:
        for node in ast.walk(ast.parse(script.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "thingc":
                names = [name.name for name in node.names if not is_defined(node, name.name)]
                wrong += [f"{script.relative_to(ROOT)}: {node.module}.{name}" for name in names]
    assert len(scripts) > 50 and wrong == []


def is_defined(node: ast.ImportFrom, name: str) -> bool:
    """Return whether a module of thingc defines or imports a name, or is a package with a module of this name."""
    folder = PACKAGE.joinpath(*str(node.module).split(".")[1:])
    module = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    return (folder / f"{name}.py").exists() or (folder / name).is_dir() or (module.exists() and name in defined_names(module))


@cache
def defined_names(module: Path) -> frozenset[str]:
    """Return the names of all definitions, assignments and imports of a module, and of what is inside its definitions."""
    nodes = nodes_of(module)
    return frozenset(str(getattr(node, key)) for node in nodes for key in ("name", "id", "asname") if hasattr(node, key))


def test_optional_dependencies_are_imported_lazily() -> None:
    """Packages of extras are imported inside functions. Modules that require an extra are imported lazily as well."""
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


@pytest.mark.parametrize("folder", GEOMETRY)
def test_geometry_folders_import_in_one_direction(folder: str) -> None:
    seen = {
        (path.relative_to(PACKAGE).as_posix(), name) for path in modules()
        if path.relative_to(PACKAGE).parts[:2] in {("geometry", folder), ("geometry", f"{folder}.py")}
        for name in imported(path) if name.startswith("thingc.geometry.")
    }
    assert seen or not GEOMETRY[folder]
    assert {(path, name) for path, name in seen if name.split(".")[2] not in GEOMETRY[folder] | {folder}} == set()


# Tables that some members of a closed set have no place in: what they have none for is looked up with `get`, and means nothing there.
IN_PART = {"base.sensor_kinds._MOVED", "documents.spec.sensors._EXAMPLES", "tools.diff.text_report._ALONE"}


def test_tables_over_closed_sets_are_complete() -> None:
    """A module-level dictionary annotated with a `Literal` or an enum of ours as key must have every member; mypy does not check this."""
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


def test_there_are_no_import_cycles() -> None:
    """Imports inside functions count: they only postpone a cycle."""
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


def importing(packages: set[str]) -> set[str]:
    """Return the modules that import one of these packages anywhere."""
    return {place_of(path) for path in modules() if any(name.split(".")[0] in packages for name in imported(path))}


def test_only_the_worker_imports_the_kernel() -> None:
    seen = importing(KERNEL)
    assert seen and {place for place in seen if not place.startswith(KERNEL_MODULES)} == set(), "these import the CAD kernel"


def test_modules_used_by_check_are_light() -> None:
    heavy = importing(HEAVY)
    assert heavy and {place for place in heavy if place.startswith(LIGHT)} == set()


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


NO_NOUNS = {
    "about", "after", "along", "among", "around", "asked", "before", "beside", "between", "beyond", "called", "checked", "confined",
    "drawn", "first", "found", "given", "held", "holding", "joined", "kept", "known", "linked", "listed", "made", "meant", "named",
    "near", "nested", "packaged", "packed", "past", "printed", "ran", "said", "shared", "shown", "stated", "told", "twice", "upon",
    "wanted", "within", "worded", "written",
}
"""Participles, prepositions and adverbs: alone they do not describe the subject of a module."""
MANY = 12
PROTOCOLS = {"run", "configure", "emit", "measure"}
"""Functions with the same name in all modules of a kind: commands, targets and document tests."""


def test_module_names_are_nouns() -> None:
    names = {path.stem: place_of(path) for path in modules()}
    assert {place for name, place in names.items() if name.strip("_") in NO_NOUNS} == set()


VERBS = {"embed", "feed", "flatten", "len", "need", "seed", "speed", "listen", "open", "shorten", "children"}
"""Names that are not participles."""
IRREGULAR = {
    "apart", "begun", "beside", "bound", "built", "done", "drawn", "elsewhere", "found", "given", "held", "kept", "known", "made", "meant",
    "said", "seen", "sent", "shown", "swept", "told", "written",
}
FIXED_NAMES = {"batched", "namespaced", "wrapped", "settled"}
"""Names of the public Python API, of interfaces of other packages, and of functions that decorators return."""


def test_function_names_are_not_bare_participles() -> None:
    """A participle alone, such as `placed` or `told`, does not describe what a function does or returns."""
    names = {
        f"{place_of(path)}:{node.name}" for path in modules() for node in statements(path)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name not in FIXED_NAMES
        and not any("property" in ast.unparse(decorator) or "setter" in ast.unparse(decorator) for decorator in node.decorator_list)
        and (name := node.name.strip("_")) not in VERBS and (name in IRREGULAR or re.fullmatch("[a-z]+(ed|en)", name))
    }
    assert names == set()


def test_function_names_are_distinctive() -> None:
    """At most twelve modules may have a function of the same name, so that a search for it is useful."""
    counts = Counter(
        node.name for path in modules() for node in tree(path).body if isinstance(node, ast.FunctionDef) and node.name not in PROTOCOLS
    )
    assert {name: count for name, count in counts.items() if count > MANY} == {}


def test_class_names_are_unique() -> None:
    """`modes` is used next to a simulation, without the compiler: it has its own joints, links and modes."""
    places: dict[str, set[str]] = {}
    for path in modules():
        for node in statements(path):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_") and not place_of(path).startswith("modes/"):
                places.setdefault(node.name, set()).add(path.relative_to(PACKAGE).as_posix())
    assert places and {name: sorted(files) for name, files in places.items() if len(files) > 1} == {}


NUMBERS = (
    "base/pose.py", "base/inertia.py", "base/primitives.py", "base/joints/", "model/", "modes/",
    "documents/checks/", "driver/testing/kinds/",
)
"""The modules that do numeric computations."""


def test_float_sums_do_not_depend_on_the_python_version() -> None:
    """The built-in `sum` of floats changed in Python 3.12. In numeric modules it may only count, or add to a start value."""
    others = []
    for path in (one for one in modules() if place_of(one).startswith(NUMBERS)):
        for node in nodes_of(path):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "sum" and len(node.args) == 1:
                of = node.args[0].elt if isinstance(node.args[0], ast.GeneratorExp) else node.args[0]
                if not (isinstance(of, ast.Constant) and type(of.value) is int):
                    others.append(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    assert not others, "thingc.base.numeric.sum_of"


def test_lengths_do_not_depend_on_the_python_version() -> None:
    """The last digits of `math.hypot` and `math.dist` changed in Python 3.12. `things` imports nothing of ours; `principal_axes`
    explains why it may use them."""
    theirs = re.compile(r"\bmath\.(hypot|dist)\b|from math import .*\b(hypot|dist)\b")
    others = [str(path.relative_to(PACKAGE)) for path in modules() if theirs.search(path.read_text())]
    assert set(others) == {"base/numeric.py", "base/inertia.py", "geometry/things/inspection.py"}, "thingc.base.numeric has both"


RECORDED = (
    "base/pose.py", "base/inertia.py", "base/primitives.py", "base/joints/", "documents/expressions/", "documents/checks/",
    "driver/testing/kinds/", "model/", "targets/", "batch/measurements.py",
)
"""Modules whose numbers may be recorded: operations on them go through `base/numeric.py`."""
NOT_RECORDED = (
    "targets/hag/", "targets/html/", "targets/render/", "model/solids/shapes.py", "model/solids/clearance.py",
    "model/solids/contact_cells.py", "model/solids/joint_boxes.py", "targets/mjcf/initial_state_checks.py",
)
"""Exceptions for pictures, or for the numbers of another program."""
INDICES_AND_CONSTANTS = {
    "driver/testing/kinds/no_collision.py": {"max", "min"},
    "base/inertia.py": {"math.copysign", "math.hypot"}, "base/pose.py": {"math.cos", "math.sin", "max"},  # inside of one operation
    "documents/expressions/parsing.py": {"max"}, "documents/expressions/value_text.py": {"math.ulp"},
    "model/assembly/links.py": {"max"}, "model/assembly/modes.py": {"max", "min"}, "model/resolve/scope.py": {"max"},
    "model/robot/kinematic_tree.py": {"max", "min"}, "model/robot/start_pose_checks.py": {"math.ceil"},
    "model/statics/load_sharing.py": {"max"},
    "targets/mjcf/accepted_models.py": {"max", "min"}, "targets/mjcf/body_tree.py": {"max"},
    "targets/mjcf/compat/mjx.py": {"max", "math.cos", "math.sin"}, "targets/usd/chain.py": {"max", "min"},
    "targets/usd/stage.py": {"max", "min"},
}
"""Functions that other files use for indices, constants and messages."""


def test_recordable_numbers_go_through_numeric() -> None:
    """With a recorded number, `min` fixes a branch, and a function of `math` fixes the value, so a recorded plan is valid for fewer
    settings. `min` with a `key` must choose a branch anyway."""
    found: dict[str, set[str]] = {}
    for path in (one for one in modules() if place_of(one).startswith(RECORDED) and not place_of(one).startswith(NOT_RECORDED)):
        nodes = nodes_of(path)
        keyed = {node.func for node in nodes if isinstance(node, ast.Call) and any(one.arg == "key" for one in node.keywords)}
        for node in nodes:
            if isinstance(node, ast.Name) and node.id in ("min", "max") and isinstance(node.ctx, ast.Load) and node not in keyed:
                found.setdefault(place_of(path), set()).add(node.id)
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "math":
                if node.attr not in ("pi", "tau", "inf", "nan", "prod"):
                    found.setdefault(place_of(path), set()).add(f"math.{node.attr}")
            elif isinstance(node, ast.ImportFrom) and node.module == "math":
                found.setdefault(place_of(path), set()).add("from math")
    assert found == INDICES_AND_CONSTANTS


def test_importing_thingc_and_cluster_workers_is_light() -> None:
    """A process that a cluster starts only starts runners."""
    names = "thingc, thingc.batch.cluster.dask_executor, thingc.batch.cluster.remote_workers, thingc.batch.cluster.slurm"
    program = f"import sys, json, {names}; print(json.dumps(sorted(sys.modules)))"
    loaded = json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout)
    heavy = {name.split(".")[0] for name in loaded} & (KERNEL | HEAVY | {"pydantic", "yaml"})
    assert not heavy


def test_diagnostic_codes_are_unique() -> None:
    from thingc.base.diagnostics import Code

    assert max(Counter(code.code for code in Code).values()) == max(Counter(code.name for code in Code).values()) == 1
    assert all(code.title and code.cure for code in Code)
    # Enum makes members of equal values aliases of one another: a duplicate would vanish silently.
    assert len(Code.__members__) == len(list(Code))


def test_warnings_of_documents_can_be_allowed() -> None:
    """A code that is reported as a warning must name the command that reports it; otherwise `allow: {CODE: reason}` would not be
    possible."""
    passes = ("documents/", "model/", "targets/", "driver/testing/")
    warned: dict[str, bool] = {}
    for path in modules():
        for node in nodes_of(path) if place_of(path).startswith(passes) else ():
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


def test_commands_print_through_the_console_module() -> None:
    """`console.say` and the diagnostic formats escape text of documents; a plain `print` would output escape sequences."""
    plain = [
        f"{path.name}:{node.lineno}" for path in (PACKAGE / "tools/cli").glob("*.py") if path.name != "console.py"
        for node in nodes_of(path)
        if isinstance(node, ast.Call) and (
            isinstance(node.func, ast.Name) and node.func.id == "print"
            or isinstance(node.func, ast.Attribute) and node.func.attr == "write" and "sys.std" in ast.unparse(node.func)
        )
    ]
    assert plain == []
