"""Create the parts, assemblies, modes, joints and tests that `thingc add` adds to a document."""

from __future__ import annotations

import argparse
import ast
import importlib.util
import keyword
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import get_args

from thingc.base.diagnostics import Report, shown_path
from thingc.base.filesystem import without_suffix
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.kinds import KINDS, BaseType, stays
from thingc.base.python_source import parse_python
from thingc.base.replacement import Change
from thingc.base.source import Document, MappingNode, SequenceNode, node_at
from thingc.base.suggestions import closest_name, did_you_mean
from thingc.base.units import shorten
from thingc.documents.checks import kinds
from thingc.documents.format.value_edits import Keys, Written
from thingc.documents.load.documents import Documents, read_tree
from thingc.documents.load.paths import DOCUMENT_SUFFIXES
from thingc.documents.load.yaml_scalars import core_value
from thingc.documents.workspace import Workspace
from thingc.driver.environment import geometry_of
from thingc.geometry.record import PartRecord, PartSchema
from thingc.geometry.service import GeometryService
from thingc.tools.cli import console
from thingc.tools.cli.set import settings
from thingc.tools.templates import new_assembly, new_part

BASES: tuple[BaseType, ...] = get_args(BaseType)
"""All types that the base of a mode can have."""
NAME = r"[A-Za-z][A-Za-z0-9_]*"
"""Regular expression of valid names of elements."""


class DocumentEdit(FrozenStruct, dict=True):
    """The changes with which `thingc add` adds an element to a document. `values` maps paths of keys to new values.

    `placed` lists the keys to remove before the values are set. `files` are new files to write.
    """

    values: Mapping[Keys, Written]
    placed: tuple[Keys, ...] = ()
    files: Mapping[str, Change] = {}


def _part(arguments: argparse.Namespace, documents: Documents | None) -> DocumentEdit:
    """Create a component with a part. The class of the part already exists, or this function creates the class."""
    report = Report()
    workspace = Workspace.find(os.path.abspath("document") if documents is None else documents.root.path, report)
    if workspace is None:
        raise console.WrongCommandLine(report.diagnostics[0].message, "fix the workspace first")
    has_reference = ":" in arguments.name
    reference = arguments.name if has_reference else _reference(arguments.name)
    module, _, name = reference.partition(":")
    with geometry_of(workspace, console.options_of(arguments)) as geometry:
        place = geometry.part_code.sources.finder.find(module)
        if not arguments.new:
            elsewhere = has_reference and (re.fullmatch(NAME, module) is None or not (place.workspace or place.kind == "absent"))
            source = geometry.part_code.sources.source(module)
            if elsewhere or place.workspace and source is not None and name in source.facts.names:
                return _placed_part(arguments, documents, geometry, reference)
            near = closest_name(reference, geometry.catalogue()) if has_reference else None
            if near is not None:
                help = f"did you mean `{near}`? Add --new to create a class"
                raise console.WrongCommandLine(f"there is no part `{reference}`", help)
    folder = next(iter(workspace.parts), os.path.join(workspace.root, "parts"))
    path = (place.file if place.workspace else None) or os.path.join(folder, f"{module}.py")
    if not workspace.contains(path):
        message = f"the symbolic link `{shown_path(path)}` leads out of the workspace"
        raise console.WrongCommandLine(message, "use another module: `thingc add part MODULE:CLASS`")
    return _new_part(arguments, documents, reference, path)


def _placed_part(arguments: argparse.Namespace, documents: Documents | None, geometry: GeometryService, reference: str) -> DocumentEdit:
    """Create a component with an existing part class.

    This function ignores errors in the code of the part, because `thingc check` reports them.
    """
    if documents is None:
        raise console.WrongCommandLine(f"the part `{shorten(reference)}` already exists", "use --to to add the part to a document")
    name = reference.rpartition(":")[2]
    component = arguments.component or (_snake(name) if re.fullmatch(NAME, name) else "part")
    answer = geometry.describe([reference])[reference]
    definition = answer.default if isinstance(answer, PartSchema) else None
    record = geometry.realize([definition]).get(definition.text) if definition is not None else None
    value: dict[str, Written] = {"part": reference, **_params(arguments)}
    mount = "origin"
    if isinstance(record, PartRecord):
        if record.box is not None and (record.material, record.mass, record.density) == (None, None, None):
            value |= _weight(documents)
        if arguments.on is not None and arguments.by is None:
            mount = _sole_mount(reference, list(record.mounts) or ["origin"], "bottom")
    elif isinstance(answer, PartSchema) and definition is None and arguments.on is not None and arguments.by is None:
        raise console.WrongCommandLine(f"the mounts of `{reference}` depend on its parameters", "specify a mount with --by")
    return DocumentEdit(values={("components", component): {**value, **_placement_keys(arguments, documents.root, component, mount)}})


def _sole_mount(whose: str, mounts: Sequence[str], usual: str) -> str:
    """Return the mount by which a component is attached by default: the mount `usual` if it exists, or else the only mount.

    Raises `WrongCommandLine` if the component has several mounts, but no mount `usual`.
    """
    if usual in mounts or not mounts:
        return usual
    if len(mounts) > 1:
        help = f"specify one of the mounts with --by ({did_you_mean('', mounts, what='mounts')})"
        raise console.WrongCommandLine(f"`{whose}` has several mounts", help)
    return mounts[0]


def _new_part(arguments: argparse.Namespace, documents: Documents | None, reference: str, path: str) -> DocumentEdit:
    """Add a new part class to the Python module at `path`, and create a component with this class.

    If the module does not exist, create it.
    """
    module_name, _, class_name = reference.partition(":")
    module, name = _identifier(module_name), _class_name(class_name)
    if keyword.iskeyword(name) or name in _bound_names(parse_python(new_part("_", None))):
        raise console.WrongCommandLine(f"`{name}` cannot be used as a class name", "choose another name")
    component = arguments.component or _snake(name)
    placed = None if documents is None else _placement_keys(arguments, documents.root, component, "bottom")
    weight = {"material": "pla"} if documents is None else _weight(documents)
    material = weight.pop("material", None)
    text = new_part(name, None if material is None else str(material))
    change: Change = None, text.encode()
    if os.path.exists(path):
        change = _append_class(path, name, text)
    elif keyword.iskeyword(module) or _is_installed(module):
        kind = "a keyword of Python" if keyword.iskeyword(module) else "an installed Python module"
        raise console.WrongCommandLine(f"`{module}` is {kind}", f"specify a module: `thingc add part {module}_parts:{name}`")
    if documents is None or placed is None:
        return DocumentEdit(values={}, files={path: change})
    value = {"part": f"{module}:{name}", **_params(arguments), **weight, **placed}
    return DocumentEdit(values={("components", component): value}, files={path: change})


def _reference(word: str) -> str:
    """Return the reference `module:Class` of a new part class, for example `front_bracket:FrontBracket` for the class `FrontBracket`."""
    name = _class_name(word)
    return f"{_snake(name)}:{name}"


def _class_name(word: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in _identifier(word).split("_"))


def _snake(name: str) -> str:
    """Convert a class name to snake case: `FrontBracket` becomes `front_bracket`, and `MG90S` becomes `mg90s`."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[0-9])(?=[A-Z][a-z])", "_", name).lower()


def _assembly(arguments: argparse.Namespace, documents: Documents | None) -> DocumentEdit:
    """Create a component that nests another document. If that document does not exist, create it."""
    path = _nested_path(arguments.name, None if documents is None else documents.root.path)
    exists = os.path.lexists(path)
    if documents is None and exists:
        hint = "choose another name, or add the existing assembly to a document: --to robot.yaml"
        raise console.WrongCommandLine(f"`{shown_path(path)}` exists already", hint)
    name = _identifier(without_suffix(os.path.basename(path)))
    text = new_assembly(name, ".toml" if path.lower().endswith(".toml") else ".yaml")
    files: dict[str, Change] = {} if exists else {path: (None, text.encode())}
    if documents is None:
        return DocumentEdit(values={}, files=files)
    root, component = documents.root, arguments.component or name
    mount = _own_mount(path) if exists and arguments.on is not None and arguments.by is None else "base"
    nested = os.path.relpath(path, os.path.dirname(root.path)).replace(os.sep, "/")
    value = {"assembly": nested, **_params(arguments, "parameters"), **_placement_keys(arguments, root, component, mount)}
    return DocumentEdit(values={("components", component): value}, files=files)


def _nested_path(name: str, outer_path: str | None) -> str:
    """Return the path of a nested document with the given name, which is in the same folder as the document `outer_path`.

    A name with the suffix of a document is a path. Otherwise, the function appends the suffix of an existing document, or else the suffix
    of `outer_path`.
    """
    if name.lower().endswith(DOCUMENT_SUFFIXES):
        return os.path.abspath(name)
    folder, suffix = ("", ".yaml") if outer_path is None else (os.path.dirname(outer_path), os.path.splitext(outer_path)[1])
    usual, *others = (os.path.abspath(os.path.join(folder, _identifier(name) + one)) for one in (suffix, *DOCUMENT_SUFFIXES))
    return next((path for path in (usual, *others) if os.path.lexists(path)), usual)


def _own_mount(path: str) -> str:
    """Return the name of the mount by which a nested document is attached by default.

    This function does not report errors in the document, because `thingc check` reports them.
    """
    try:
        with open(path, "rb") as stream:
            tree = read_tree(path, stream.read(), Report())
    except OSError:
        tree = None
    return _sole_mount(shown_path(path), list(_section(tree, "mounts")), "base")


def _mode(arguments: argparse.Namespace, documents: Documents | None) -> DocumentEdit:
    assert documents is not None
    root = documents.root
    name = _new(root, "modes", arguments.name)
    modes = _section(root.tree, "modes")
    first = {"root": _base(root), **(_extend_mode(modes, next(iter(modes))) if modes else {})}
    soles: list[str] = arguments.standing_on or []
    by_sole = len(soles) == 1 and (arguments.base is None or stays(arguments.base))
    if by_sole and arguments.root is not None:
        message = f"--root cannot be combined with a single mount in --standing-on (`{soles[0]}`)"
        raise console.WrongCommandLine(message, "omit --root, or write `--base free`")
    root_name = soles[0] if by_sole else arguments.root or str(first["root"])
    usual: tuple[BaseType, ...] = ("held", "fixed") if by_sole else ("free",) if soles else ("fixed", "held", "free")
    bases = {str(mode.get("base", "fixed")) for mode in (_extend_mode(modes, one) for one in modes) if mode.get("root") == root_name}
    base: BaseType = arguments.base or next((one for one in usual if one not in bases), usual[0])
    value: dict[str, Written] = {"root": root_name, "base": base}
    if not by_sole:  # otherwise, the mount is at the origin of the world
        if root_name == first["root"] and stays(base):
            value |= {"at": _format_plain(first["at"])} if "at" in first else {}
        elif _has_shapes(root):
            value["at"] = {"on": "floor"}
        value |= {"standing_on": list(soles)} if soles else {}
    if arguments.gravity is not None:
        value["gravity"] = arguments.gravity
    pose = arguments.pose or first.get("pose")
    return DocumentEdit(values={("modes", name): {**value, **({"pose": str(pose)} if pose else {})}})


def _format_plain(plain: object) -> Written:
    """Convert the values of a new element to strings, as they are written in documents."""
    if isinstance(plain, dict):
        return {key: _format_plain(one) for key, one in plain.items()}
    return [_format_plain(one) for one in plain] if isinstance(plain, list) else str(plain)


def _joint_edit(arguments: argparse.Namespace, documents: Documents | None) -> DocumentEdit:
    assert documents is not None
    root = documents.root
    name = _new(root, "joints", arguments.name)
    if arguments.parent is None or arguments.child is None:
        help = "write, for example, `--parent base.top --child bracket.bottom`"
        raise console.WrongCommandLine("a joint requires --parent and --child", help)
    kind = KINDS[arguments.type or "revolute"]
    value: dict[str, Written] = {"type": kind.name, "parent": arguments.parent, "child": arguments.child}
    if arguments.loop:
        value["loop"] = "true"
    if kind.leads:
        value["lead"] = "2 mm"
    if kind.limits == "required":
        bounds: list[Written] = [
            {"lower": "-90 deg", "upper": "90 deg"} if one.turns else {"lower": "0", "upper": "50 mm"} for one in kind.twists
        ]
        value["limit"] = bounds if len(bounds) > 1 else bounds[0]
    component = arguments.child.partition(".")[0]
    ways = () if arguments.loop else ("attach", "at")
    placed = tuple(("components", component, way) for way in ways if node_at(root.tree, ("components", component, way)) is not None)
    return DocumentEdit(values={("joints", name): value}, placed=placed)


def _test(arguments: argparse.Namespace, documents: Documents | None) -> DocumentEdit:
    assert documents is not None
    root = documents.root
    name = _new(root, "tests", arguments.name)
    if arguments.kind not in kinds():
        wrong = "a test requires --kind" if arguments.kind is None else f"there is no test kind `{arguments.kind}`"
        raise console.WrongCommandLine(wrong, did_you_mean(arguments.kind or "", kinds(), what="kinds"))
    motions, mounts = _section(root.tree, "motions"), _section(root.tree, "mounts")
    if "$motion" in kinds()[arguments.kind].stub.values() and not motions:
        raise console.WrongCommandLine(f"a `{arguments.kind}` test requires a motion of the document", "add `motions` to the document")
    last = list(_section(root.tree, "components"))[-1]
    words = {"$base": f"{_base(root)}.origin", "$mount": next(iter(mounts), f"{last}.origin"), "$motion": next(iter(motions), "")}
    stub = {key: words.get(value, value) if isinstance(value, str) else value for key, value in kinds()[arguments.kind].stub.items()}
    return DocumentEdit(values={("tests", name): {arguments.kind: stub}})


STUBS: dict[str, Callable[[argparse.Namespace, Documents | None], DocumentEdit]] = {
    "part": _part, "assembly": _assembly, "mode": _mode, "joint": _joint_edit, "test": _test,
}


# --- content of the document ------------------------------------------------------------------------------------------


def _section(tree: MappingNode | None, section: str) -> dict[str, object]:
    """Return a section of a document, such as `joints`, or an empty mapping if the document does not contain the section."""
    node = None if tree is None else node_at(tree, (section,))
    return {key: one.plain() for key, one in node.entries.items()} if isinstance(node, MappingNode) else {}


def _extend_mode(modes: Mapping[str, object], name: str, above: tuple[str, ...] = ()) -> dict[str, object]:
    """Return the keys of a mode, merged with the keys of the modes that it extends.

    This function does not report missing modes and cycles.
    """
    mode = modes.get(name)
    if not isinstance(mode, dict) or name in above:
        return {}
    return {**_extend_mode(modes, str(mode.get("extends")), (*above, name)), **mode}


def _base(root: Document) -> str:
    """Return the name of the base component, which is the only component that is not placed."""
    joints = [joint for joint in _section(root.tree, "joints").values() if isinstance(joint, dict) and not joint.get("loop")]
    children = {str(joint.get("child", "")).partition(".")[0] for joint in joints}
    components = _section(root.tree, "components")
    free = (name for name, one in components.items() if isinstance(one, dict) and not {"attach", "at"} & set(one) and name not in children)
    return next(free, next(iter(components)))


def _placement_keys(arguments: argparse.Namespace, root: Document, name: str, mount: str) -> dict[str, Written]:
    """Return the keys that place a new component in a document, according to the options `--by`, `--on` and `--at`.

    The mount `--by` of the component (default: `mount`) is attached to the mount `--on` or to the frame `--at`. By default, the component
    is placed above the base.
    """
    _new(root, "components", name, hint="choose another name with --name")
    if arguments.on is not None:
        return {"attach": {arguments.by or mount: arguments.on}}
    if arguments.at is not None:
        return {"at": {"in": arguments.at}}
    return {"at": {"in": f"{_base(root)}.origin", "xyz": "0 0 100 mm" if _has_shapes(root) else "0 0 30 mm"}}


def _has_shapes(root: Document) -> bool:
    """Return whether the document contains a component other than a frame."""
    return any(isinstance(one, dict) and "frame" not in one for one in _section(root.tree, "components").values())


def _weight(documents: Documents) -> dict[str, Written]:
    """Return the keys that a component needs if its part has neither a material nor a mass.

    The result contains a material of the document, preferably a material for printing, or else a mass. The result is empty if the section
    `defaults` specifies a material.
    """
    root = documents.root
    if node_at(root.tree, ("defaults", "component", "material")) is not None:
        return {}
    node = node_at(root.tree, ("materials",))
    names: list[str] = list(node.entries) if isinstance(node, MappingNode) else []
    for one in node.items if isinstance(node, SequenceNode) else ():
        document = documents.find_referenced(root, str(one.plain()))
        names += [] if document is None else _section(document.tree, "materials")
    usual = next((name for name in ("pla", "petg") if name in names), next(iter(names), None))
    return {"mass": {"value": "20 g", "source": "estimated"}} if usual is None else {"material": usual}


def _params(arguments: argparse.Namespace, key: str = "params") -> dict[str, Written]:
    """Return the arguments of a part (under the key `params`) or of a nested assembly (under the key `parameters`)."""
    return {key: settings(arguments.param)} if arguments.param else {}


def _new(root: Document, section: str, name: str, hint: str = "choose another name") -> str:
    """Check and return the name of a new element of a document section.

    Raises `WrongCommandLine` if the section already contains the name.
    """
    _identifier(name)
    existing = {known.lower(): known for known in _section(root.tree, section)}
    if name.lower() in existing:
        document, kind = shown_path(root.path), section.removesuffix("s")
        raise console.WrongCommandLine(f"`{document}` already has a {kind} `{existing[name.lower()]}`", hint)
    return name


def _identifier(name: str) -> str:
    if not isinstance(core_value(name), str):
        raise console.WrongCommandLine(f"`{name}` is not a valid name (YAML reads another value)", "choose another name")
    if not re.fullmatch(NAME, name):
        near = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
        hint = f"write, for example, `{near}`" if re.fullmatch(r"[A-Za-z]\w*", near, re.ASCII) else "choose another name"
        raise console.WrongCommandLine(f"`{name}` is not a valid name (expected a letter, then letters, digits and `_`)", hint)
    return name


def _is_installed(module: str) -> bool:
    """Return whether Python can already import a module with this name. A new module with the same name would shadow it."""
    return module in sys.stdlib_module_names or getattr(importlib.util.find_spec(module), "origin", None) is not None


# --- appending a class to a module --------------------------------------------------------------------------------------


def _bound_names(module: ast.Module) -> set[str]:
    """Return the names that the imports, classes and functions of a module define. For a star import, the result contains `module.*`."""
    names: set[str] = set()
    for node in module.body:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {alias.asname or alias.name for alias in node.names if alias.name != "*"}
            names |= {f"{getattr(node, 'module', '')}.*" for alias in node.names if alias.name == "*"}
        elif isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            names.add(node.name)
    return names


def _append_class(path: str, name: str, text: str) -> Change:
    """Return the edit that appends a class with the source code `text` to a Python module, and adds the missing imports."""
    with open(path, "rb") as stream:
        data = stream.read()
    source = data.decode()
    try:
        module = parse_python(source)
    except SyntaxError as fault:
        message = f"`{shown_path(path)}` cannot be read as Python: {fault.msg}"
        raise console.WrongCommandLine(message, f"correct line {fault.lineno}") from fault
    bound = _bound_names(module)
    if name in bound:
        raise console.WrongCommandLine(f"`{shown_path(path)}` already has a `{name}`", "choose another name")
    missing = []
    for node in parse_python(text).body:
        if isinstance(node, ast.ImportFrom) and f"{node.module}.*" not in bound:
            names = [alias.name for alias in node.names if alias.name not in bound]
            missing += [f"from {node.module} import {', '.join(names)}\n"] if names else []
    lines = source.splitlines(keepends=True)
    if lines and not lines[-1].endswith("\n"):
        lines[-1] += "\n"
    imports = [node for node in module.body if isinstance(node, (ast.Import, ast.ImportFrom))]
    doc = ast.get_docstring(module) is not None
    at = (imports[-1].end_lineno if imports else module.body[0].end_lineno if doc else 0) or 0
    return data, "".join([*lines[:at], *missing, *lines[at:], "\n\n", text[text.index("class ") :]]).encode()


