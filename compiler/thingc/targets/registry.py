"""The table of all targets. Each target is declared in its own package. The emitter of a target is imported when it is first needed.

A folder beside this module is a target if the `__init__.py` of the folder defines `TARGET`. Other packages can add targets through the
entry-point group `thingc.emitters`. The emitters of such packages have the same function signature.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.diagnostics import Code
from thingc.base.filesystem import listing
from thingc.base.safe_text import abbreviate
from thingc.base.suggestions import Hint, did_you_mean
from thingc.targets.target import Target

if TYPE_CHECKING:
    from thingc.targets.artifact import Artifacts, Loss
    from thingc.targets.request import EmitRequest

    Emitter = Callable[[EmitRequest], Artifacts]


GROUP = "thingc.emitters"


def _own_targets() -> dict[str, Target]:
    """Return the targets of thingc. The targets are declared by the packages beside this module that define `TARGET`. The emitters are not
    imported.
    """
    folders = (entry for entry in os.scandir(os.path.dirname(__file__)) if os.path.isfile(os.path.join(entry.path, "__init__.py")))
    packages = {entry.name: import_module(f"{__package__}.{entry.name}") for entry in folders}
    declared: dict[str, Target] = {name: package.TARGET for name, package in packages.items() if hasattr(package, "TARGET")}
    return dict(sorted(declared.items(), key=lambda item: (item[1].position, item[0])))


TARGETS = _own_targets()
"""The targets of thingc, in the order in which a build writes them. Targets of other packages list their files in `WRITES`."""

MODELS = frozenset({"mjcf", "mjz", "urdf", "ros", "sdf", "usd"})
"""The targets that write models of the robot. A build with any of these targets also writes `JOINT_ORDER`."""

JOINT_ORDER = "joint_order.json"
"""The path of the file with the order of joints in each format (see `targets/joint_order.py`)."""

ALL = "all"
"""The argument of `--emit` that selects all targets."""


def written_pattern() -> re.Pattern[str]:
    """Return a regular expression that matches the path of every file in a build folder that a target may write.

    The expression includes the targets of installed packages.
    """
    patterns = [JOINT_ORDER, *(pattern for target in TARGETS.values() for pattern in target.writes)]
    for name in targets():
        if name not in TARGETS:
            with contextlib.suppress(ImportError):
                patterns += _declared_patterns(name)
    return _compile_patterns(patterns)


def module_of(target: str) -> str:
    """Return the name of the Python module that defines a target of an installed package."""
    return _find_installed()[target].partition(":")[0]


def _declared_patterns(target: str) -> tuple[str, ...]:
    """Return the file patterns in `WRITES` of a target from an installed package.

    Raises `ImportError` if the package cannot be imported.
    """
    patterns = getattr(import_module(module_of(target)), "WRITES", ())
    return (patterns,) if isinstance(patterns, str) else tuple(patterns)


def _compile_patterns(patterns: Iterable[str]) -> re.Pattern[str]:
    return re.compile("|".join(re.escape(pattern).replace(r"\*", "[^/]+") for pattern in patterns))


def targets() -> tuple[str, ...]:
    """Return the names of all targets. thingc's own targets come first, followed by the targets of installed packages sorted by name."""
    return (*TARGETS, *sorted(name for name in _find_installed() if name not in TARGETS))


def unknown(arguments: Sequence[str]) -> tuple[tuple[int, str, Hint], ...]:
    """Return an error for each unknown target in the arguments: the index of the argument, the message, and a hint."""
    names = [*targets(), ALL]
    wrong = [(index, name) for index, text in enumerate(arguments) for name in text.split(",") if name not in ("", *names)]
    return tuple((index, f"there is no target `{abbreviate(name)}`", did_you_mean(name, names, what="targets")) for index, name in wrong)


def parse_targets(arguments: Sequence[str]) -> tuple[str, ...]:
    """Parse the target names in arguments such as `mjcf`, `mjcf,urdf` and `all`.

    Return the targets in the order in which a build writes them. If there are no arguments, return the default targets. A target of an
    installed package can require other targets, to whose files it refers, with `REQUIRES = {"NAME": ("usd",)}` in its module.
    """
    requested = {word for text in arguments for word in text.split(",")}
    for name in requested & {*_find_installed()} - {*TARGETS}:
        with contextlib.suppress(ImportError):
            requested.update(getattr(import_module(module_of(name)), "REQUIRES", {}).get(name, ()))
    return tuple(target for target in targets() if (requested & {target, ALL} if arguments else _is_default(target)))


def _is_default(target: str) -> bool:
    """Return whether builds without `--emit` write a target. A target of an installed package can set `UNASKED` to False in its module."""
    if target in TARGETS:
        return TARGETS[target].unasked
    try:
        return bool(getattr(import_module(module_of(target)), "UNASKED", True))
    except ImportError:  # is reported when the target is written
        return True


def modules_of(requested: Collection[str]) -> tuple[str, ...]:
    """Return the names of the modules that thingc's own targets need, including libraries, so that these modules can be imported early."""
    emitters = [TARGETS[target].emitter.partition(":")[0] for target in requested if target in TARGETS]
    return (*emitters, *dict.fromkeys(library for target in requested if target in TARGETS for library in TARGETS[target].libraries))


def run_emitters(request: EmitRequest, targets: Sequence[str]) -> dict[str, Artifacts]:
    """Call the emitters of the given targets, and return the files and export losses of each target in the given order.

    If several targets report the same export loss, it is only included with the first target.
    """
    from thingc.targets.custom_names import apply_custom_names

    artifacts: dict[str, Artifacts] = {}
    reported: dict[Loss, None] = {}
    for target in targets:
        target_request = request.in_target(target)
        result = emitter(target)(apply_custom_names(target_request) if target not in TARGETS or TARGETS[target].by_name else target_request)
        declared = None if target in TARGETS else _compile_patterns(_declared_patterns(target))
        # the next build would not recognise files with undeclared paths
        if declared is not None and (undeclared := sorted(path for path in result.files if declared.fullmatch(path) is None)):
            request.report.add(
                Code.UNSTATED, f"the target `{target}` writes the unlisted file `{undeclared[0]}`", None,
                path=target,
                help=f'ask the author of the package to write `WRITES = ("{undeclared[0]}",)` in `{module_of(target)}`',
            )
        artifacts[target] = replace(result, losses=tuple(loss for loss in result.losses if loss not in reported))
        reported |= dict.fromkeys(result.losses)
    first = next((target for target in targets if target in MODELS), None)
    if first is not None:
        from thingc.targets import joint_order

        result = artifacts[first]
        artifacts[first] = replace(result, files={**result.files, JOINT_ORDER: joint_order.emit(request)})
    return artifacts


def emitter(target: str) -> Emitter:
    """Return the function that writes the files of a target.

    Raises `KeyError` for an unknown target, and `ImportError` if its package cannot be imported.
    """
    module, _, function = (TARGETS[target].emitter if target in TARGETS else _find_installed()[target]).partition(":")
    emit: Emitter = getattr(import_module(module), function)
    return emit


def _find_installed() -> Mapping[str, str]:
    """Return the entry points of installed packages that declare targets, read from the metadata files of the packages.

    `importlib.metadata` returns the same result, but takes 40 ms. These 40 ms are a third of the time of a build without changes. If two
    packages declare the same name, the first package on the path takes precedence, as in `importlib.metadata`. The cached result is valid
    until a folder on the import path changes.
    """
    return _entry_points(tuple((folder, _folder_time(folder)) for folder in sys.path))


def _folder_time(folder: str) -> int:
    """Return the modification time [ns] of a folder on the import path, or 0 if the folder does not exist."""
    try:
        return os.stat(folder or ".").st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=1)
def _entry_points(path: tuple[tuple[str, int], ...]) -> Mapping[str, str]:
    """Return the entry points that declare targets, for the packages in the folders of an import path."""
    entry_points: dict[str, str] = {}
    for folder, _ in path:
        for name in listing(folder or "."):
            if name.endswith((".dist-info", ".egg-info")):
                for target, value in _entries(os.path.join(folder, name, "entry_points.txt")):
                    entry_points.setdefault(target, value)
    return entry_points


def _entries(path: str) -> list[tuple[str, str]]:
    """Parse an `entry_points.txt` file, whose format is defined in the entry points specification. Return the names and the object
    references in the group `thingc.emitters`.
    """
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
