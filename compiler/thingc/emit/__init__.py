"""The targets: one module each, imported when its target is asked for.

A package of somebody else adds one through the entry-point group `thingc.emitters`, with the same kind of function.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from thingc.shown import shortened
from thingc.typos import did_you_mean

if TYPE_CHECKING:
    from thingc.emit.artifact import Artifacts
    from thingc.emit.manifest import versions
    from thingc.emit.request import EmitRequest

    Emitter = Callable[[EmitRequest], Artifacts]

__all__ = [
    "EMITTERS", "WRITES", "chosen", "emitter", "module_of", "modules_of", "targets", "unknown", "unstated", "versions", "written",
]

GROUP = "thingc.emitters"

EMITTERS: dict[str, tuple[str, ...]] = {
    "mjcf": ("thingc.emit.mjcf.target:emit", "thingc.emit.modes:emit"),
    "mjz": ("thingc.emit.mjcf.archive:emit",),
    "stl": ("thingc.emit.stl:emit",),
    "step": ("thingc.emit.step:emit",),
    "glb": ("thingc.emit.glb:emit",),
    "urdf": ("thingc.emit.urdf.target:emit",),
    "bom": ("thingc.emit.bom:emit",),
    "hag": ("thingc.emit.hag.target:emit",),
}
"""Our own targets, in the order in which a build writes them, each with what writes it, `module:function`: `modes.json` states addresses
in the MJCF models, so the two go together."""

ON_REQUEST = frozenset({"glb", "urdf"})
"""Those of our own that a build writes only where they are named: not everybody wants them, and they cost time."""

ALL = "all"
"""The word for every target."""

WRITES = (
    "mjcf/*.xml", "mjcf/*.mjz", "mjcf/assets/*.obj", "stl/*.stl", "step/*.step", "glb/*.glb", "urdf/*.urdf",
    "urdf/meshes/*.obj", "bom.csv", "bom.json", "hag.dot", "hag.mmd", "hag.svg", "modes.json",
)
"""What our own targets call their files. A package that adds a target says the same of its own in `WRITES` of the module."""


def __getattr__(name: str) -> Any:
    """What those ask for who write no target."""
    if name == "versions":
        from thingc.emit.manifest import versions

        return versions
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def written() -> re.Pattern[str]:
    """Fits every path in a build folder that a target, ours or an installed one's, may write."""
    patterns = [*WRITES]
    for name in targets():
        if name not in EMITTERS:
            with contextlib.suppress(ImportError):
                patterns += _stated(name)
    return _fitting(patterns)


def unstated(target: str, paths: Iterable[str]) -> list[str]:
    """Those of the paths that a target of an installed package does not state, so that the next build would take them for a stranger's."""
    if target in EMITTERS:
        return []
    own = _fitting(_stated(target))
    return sorted(path for path in paths if own.fullmatch(path) is None)


def module_of(target: str) -> str:
    """The module of a target of an installed package."""
    return _installed()[target].partition(":")[0]


def _stated(target: str) -> tuple[str, ...]:
    """What the module of an installed target says that its files are called. Raises `ImportError`."""
    from importlib import import_module

    stated = getattr(import_module(module_of(target)), "WRITES", ())
    return (stated,) if isinstance(stated, str) else tuple(stated)


def _fitting(patterns: Iterable[str]) -> re.Pattern[str]:
    return re.compile("|".join(re.escape(pattern).replace(r"\*", "[^/]+") for pattern in patterns))


def targets() -> tuple[str, ...]:
    """Every target there is: ours first, then those of installed packages by name."""
    return (*EMITTERS, *sorted(name for name in _installed() if name not in EMITTERS))


def unknown(words: Sequence[str]) -> tuple[tuple[int, str, str], ...]:
    """What names no target, in a message and a hint, with the index of the word that does."""
    known = [*targets(), ALL]
    wrong = [(index, word) for index, text in enumerate(words) for word in text.split(",") if word not in ("", *known)]
    return tuple((index, f"there is no target `{shortened(word)}`", did_you_mean(word, known, what="targets")) for index, word in wrong)


def chosen(words: Sequence[str]) -> tuple[str, ...]:
    """The targets that words name (`mjcf`, `mjcf,urdf`, `all`), in the order in which a build writes them; of no words those that are
    written unasked."""
    wanted = {word for text in words for word in text.split(",")}
    return tuple(target for target in targets() if (wanted & {target, ALL} if words else target not in ON_REQUEST))


def modules_of(wanted: Collection[str]) -> tuple[str, ...]:
    """The modules of those of our own targets, and MuJoCo where it is asked: what takes long to import."""
    ours = {function.partition(":")[0]: None for target in wanted for function in EMITTERS.get(target, ())}
    return (*ours, *(["mujoco"] if "mjcf" in wanted else []))


def emitter(target: str) -> Emitter:
    """The function that writes a target. Raises `KeyError` for an unknown one, `ImportError` where its package is broken."""
    functions = [_function(name) for name in EMITTERS.get(target) or (_installed()[target],)]
    return functions[0] if len(functions) == 1 else partial(_emitted, functions)


def _emitted(emitters: list[Emitter], request: EmitRequest) -> Artifacts:
    """What all of them give."""
    from thingc.emit.artifact import Artifacts

    artifacts = [emit(request) for emit in emitters]
    files = {path: content for one in artifacts for path, content in one.files.items()}
    return Artifacts(files=files, losses=tuple(loss for one in artifacts for loss in one.losses))


def _function(name: str) -> Emitter:
    from importlib import import_module

    module, _, function = name.partition(":")
    emit: Emitter = getattr(import_module(module), function)
    return emit


def _installed() -> dict[str, str]:
    """The entry points of our group, read from the packages' own metadata files.

    `importlib.metadata` finds the same and costs 40 ms, a third of a build in which nothing has changed. Of two packages
    with one name the first on the path wins, as there.
    """
    entry_points: dict[str, str] = {}
    for folder in sys.path:
        try:
            names = sorted(os.listdir(folder or "."))
        except OSError:
            continue
        for name in names:
            if name.endswith((".dist-info", ".egg-info")):
                for target, value in _entries(os.path.join(folder, name, "entry_points.txt")):
                    entry_points.setdefault(target, value)
    return entry_points


def _entries(path: str) -> list[tuple[str, str]]:
    """`name = module:function` lines of our section of an `entry_points.txt` (entry points specification)."""
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
