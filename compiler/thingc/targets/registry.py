"""The table of targets. Their modules are imported on demand.

Other packages can add targets through the entry-point group `thingc.emitters`, with the same function signature.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import lru_cache, partial
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.diagnostics import Code
from thingc.base.filesystem import listing
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import shortened
from thingc.base.suggestions import did_you_mean

if TYPE_CHECKING:
    from thingc.targets.artifact import Artifacts, Loss
    from thingc.targets.request import EmitRequest

    Emitter = Callable[[EmitRequest], Artifacts]


GROUP = "thingc.emitters"


class Target(FrozenStruct):
    """A target of thingc.

    `says` is a short description, `emitters` are references of the form `module:function`, and `writes` are patterns for its files. With
    `unasked`, the target is written by builds without `--emit`. `capabilities` is the module with the `CAPABILITIES` of a format for whole
    robots. With `by_name`, custom names are applied, because readers of the files use names.
    """

    says: str
    emitters: tuple[str, ...]
    writes: tuple[str, ...]
    unasked: bool = True
    capabilities: str | None = None
    by_name: bool = False


TARGETS: dict[str, Target] = {
    "mjcf": Target(  # `modes.json` contains addresses in the models, so the two are written together
        says="MuJoCo models and scenes, one per mode", emitters=("thingc.targets.mjcf.emit:emit", "thingc.targets.modes_json:emit"),
        writes=("mjcf/*.xml", "mjcf/assets/*.obj", "modes.json"), capabilities="thingc.targets.mjcf.capabilities", by_name=True,
    ),
    "mjz": Target(
        says="each model in one file with its meshes", emitters=("thingc.targets.mjcf.emit:emit_archives",), writes=("mjcf/*.mjz",),
        by_name=True,
    ),
    "stl": Target(says="print files", emitters=("thingc.targets.stl:emit",), writes=("stl/*.stl",)),
    "step": Target(says="the whole robot", emitters=("thingc.targets.step:emit",), writes=("step/*.step",)),
    "glb": Target(
        says="each mode for viewers of glTF", emitters=("thingc.targets.gltf:emit",), writes=("glb/*.glb",), unasked=False,
        capabilities="thingc.targets.gltf", by_name=True,
    ),
    "urdf": Target(
        says="each mode for ROS", emitters=("thingc.targets.urdf.emit:emit",), writes=("urdf/*.urdf", "urdf/meshes/*.obj"), unasked=False,
        capabilities="thingc.targets.urdf.capabilities", by_name=True,
    ),
    "ros": Target(
        says="a ROS 2 package with all modes", emitters=("thingc.targets.ros.emit:emit",), unasked=False,
        writes=(
            "ros/*/package.xml", "ros/*/CMakeLists.txt", "ros/*/urdf/*.urdf", "ros/*/meshes/*.obj", "ros/*/launch/*.launch.py",
            "ros/*/config/*.srdf", "ros/*/config/*.yaml", "ros/*/config/*.rviz",
        ),
        capabilities="thingc.targets.ros.capabilities", by_name=True,
    ),
    "sdf": Target(
        says="each mode for Gazebo", emitters=("thingc.targets.sdf.emit:emit",),
        writes=("sdf/*.sdf", "sdf/*/model.sdf", "sdf/*/model.config", "sdf/*/meshes/*.obj"), unasked=False,
        capabilities="thingc.targets.sdf.capabilities", by_name=True,
    ),
    "usd": Target(
        says="each mode for Isaac Sim and Newton", emitters=("thingc.targets.usd.emit:emit",), writes=("usd/*.usda",), unasked=False,
        capabilities="thingc.targets.usd.capabilities",
    ),
    "html": Target(
        says="the robot in a browser", emitters=("thingc.targets.html.emit:emit",), writes=("html/*.html",), unasked=False,
    ),
    "bom": Target(says="bill of materials", emitters=("thingc.targets.bom:emit",), writes=("bom.csv", "bom.json")),
    "hag": Target(says="assembly graph", emitters=("thingc.targets.hag.emit:emit",), writes=("hag.dot", "hag.mmd", "hag.svg")),
}
"""The targets of thingc, in the order in which a build writes them. Other packages list their files in `WRITES` of the module."""

ALL = "all"
"""Selects every target."""


def written() -> re.Pattern[str]:
    """Return a pattern for all paths in a build folder that targets, including those of installed packages, may write."""
    patterns = [pattern for target in TARGETS.values() for pattern in target.writes]
    for name in targets():
        if name not in TARGETS:
            with contextlib.suppress(ImportError):
                patterns += _stated(name)
    return _fitting(patterns)


def _unstated(target: str, paths: Iterable[str]) -> list[str]:
    """Return the paths not matched by the `WRITES` of an installed target, which the next build would not recognise."""
    if target in TARGETS:
        return []
    own = _fitting(_stated(target))
    return sorted(path for path in paths if own.fullmatch(path) is None)


def module_of(target: str) -> str:
    """Return the module of a target from an installed package."""
    return _installed()[target].partition(":")[0]


def _stated(target: str) -> tuple[str, ...]:
    """Return the `WRITES` of an installed target. Raises `ImportError`."""
    from importlib import import_module

    stated = getattr(import_module(module_of(target)), "WRITES", ())
    return (stated,) if isinstance(stated, str) else tuple(stated)


def _fitting(patterns: Iterable[str]) -> re.Pattern[str]:
    return re.compile("|".join(re.escape(pattern).replace(r"\*", "[^/]+") for pattern in patterns))


def targets() -> tuple[str, ...]:
    """Return all targets: thingc's own, then those of installed packages sorted by name."""
    return (*TARGETS, *sorted(name for name in _installed() if name not in TARGETS))


def unknown(words: Sequence[str]) -> tuple[tuple[int, str, str], ...]:
    """Return a message and a hint for each unknown target, with the index of its argument."""
    known = [*targets(), ALL]
    wrong = [(index, word) for index, text in enumerate(words) for word in text.split(",") if word not in ("", *known)]
    return tuple((index, f"there is no target `{shortened(word)}`", did_you_mean(word, known, what="targets")) for index, word in wrong)


def chosen(words: Sequence[str]) -> tuple[str, ...]:
    """Return the targets named by arguments (`mjcf`, `mjcf,urdf`, `all`), in the order in which a build writes them.

    Without arguments these are the default targets.
    """
    wanted = {word for text in words for word in text.split(",")}
    return tuple(target for target in targets() if (wanted & {target, ALL} if words else target not in TARGETS or TARGETS[target].unasked))


def modules_of(wanted: Collection[str]) -> tuple[str, ...]:
    """Return the modules of thingc's own targets, and MuJoCo if needed, so that they can be imported early."""
    ours = {function.partition(":")[0]: None for target in wanted if target in TARGETS for function in TARGETS[target].emitters}
    return (*ours, *(["mujoco"] if {"mjcf", "ros"} & {*wanted} else []))


def emitted(request: EmitRequest, targets: Sequence[str]) -> dict[str, Artifacts]:
    """Return the artifacts of each target in the given order. A loss is only included with the first target that has it."""
    from thingc.targets.custom_names import called

    artifacts: dict[str, Artifacts] = {}
    told: dict[Loss, None] = {}
    for target in targets:
        made = emitter(target)(called(request) if target not in TARGETS or TARGETS[target].by_name else request)
        if astray := _unstated(target, made.files):
            request.report.add(
                Code.UNSTATED, f"the target `{target}` writes `{astray[0]}`, which is missing in `{module_of(target)}.WRITES`", None,
                path=target,
                help=f'report this to its author: `WRITES = ("{astray[0]}",)` in that module must list all files of the target',
            )
        artifacts[target] = replace(made, losses=tuple(loss for loss in made.losses if loss not in told))
        told |= dict.fromkeys(made.losses)
    return artifacts


def emitter(target: str) -> Emitter:
    """Return the function that writes a target. Raises `KeyError` for an unknown one, `ImportError` if its package is broken."""
    functions = [_function(name) for name in (TARGETS[target].emitters if target in TARGETS else (_installed()[target],))]
    return functions[0] if len(functions) == 1 else partial(_joined, functions)


def _joined(emitters: list[Emitter], request: EmitRequest) -> Artifacts:
    """Return the combined artifacts of all emitters."""
    from thingc.targets.artifact import Artifacts

    artifacts = [emit(request) for emit in emitters]
    files = {path: content for one in artifacts for path, content in one.files.items()}
    return Artifacts(files=files, losses=tuple(loss for one in artifacts for loss in one.losses))


def _function(name: str) -> Emitter:
    from importlib import import_module

    module, _, function = name.partition(":")
    emit: Emitter = getattr(import_module(module), function)
    return emit


def _installed() -> Mapping[str, str]:
    """Return the entry points of the group, read from the packages' metadata files.

    `importlib.metadata` gives the same result but takes 40 ms, a third of a build without changes. As there, the first package on the path
    has precedence if two packages use the same name. The cache is valid until a folder on the path changes.
    """
    return _entry_points(tuple((folder, _changed(folder)) for folder in sys.path))


def _changed(folder: str) -> int:
    """Return the modification time of a folder on the path [ns], or 0 if it does not exist."""
    try:
        return os.stat(folder or ".").st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=1)
def _entry_points(path: tuple[tuple[str, int], ...]) -> Mapping[str, str]:
    """Return the entry points of the packages in the folders of an import path."""
    entry_points: dict[str, str] = {}
    for folder, _ in path:
        for name in listing(folder or "."):
            if name.endswith((".dist-info", ".egg-info")):
                for target, value in _entries(os.path.join(folder, name, "entry_points.txt")):
                    entry_points.setdefault(target, value)
    return entry_points


def _entries(path: str) -> list[tuple[str, str]]:
    """Return the `name = module:function` lines of the group in an `entry_points.txt` (entry points specification)."""
    try:
        with open(path, encoding="utf-8", errors="replace") as stream:
            text = stream.read()
    except OSError:
        return []
    if f"[{GROUP}]" not in text:
        return []
    section = text.partition(f"[{GROUP}]")[2].partition("\n[")[0]
    lines = (line.partition("=") for line in section.splitlines() if not line.lstrip().startswith(("#", ";")))
    return [(name.strip(), value.partition("[")[0].strip()) for name, equals, value in lines if equals]
