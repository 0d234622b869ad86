"""Warn of suspicious values in manufacturing processes, such as values with wrong units or digits."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from thingc.base.diagnostics import Code, Note, make_notes
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Span
from thingc.model.assembly.instance_tree import Tree
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Occurrence
from thingc.model.resolve.plausibility import length_words
from thingc.model.resolve.types import Process

WIDTHS, HEIGHTS = (0.05e-3, 3e-3), (0.01e-3, 1.5e-3)
"""Possible ranges of line widths and layer heights [m] of printers."""
USUAL_WIDTHS, USUAL_HEIGHTS = (0.2e-3, 1.2e-3), (0.05e-3, 0.6e-3)
"""Usual ranges of line widths and layer heights [m], from which the fix for a wrong unit is chosen."""
SKINS, USUAL_SKINS = (0.05e-3, 30e-3), (1e-3, 10e-3)
"""Possible range and usual range of the wall thickness [m]. For processes without printed lines, `line_width` is the wall thickness."""
WALLS, LIDS = 50, 100
"""Largest plausible number of walls, and of layers at the top or bottom. With more walls or layers, a part would be solid."""
LEAST_SHARE = 0.01
"""Smallest plausible infill or overlap. A smaller value probably has a wrong unit (`0.15 %`)."""

_SLIPS = (1e-1, 1e-2, 1e-3, 1e1, 1e2, 1e3)
"""Factors by which values with common unit errors must be multiplied. Small errors come first."""


class _Doubt(FrozenStruct):
    """A suspicious value of a print setting: the key of the setting, and the message and the help text of the warning."""

    key: str
    words: str
    help: str


def check_processes(tree: Tree, occurrences: Sequence[Occurrence]) -> None:
    """Warn of suspicious values in processes of components, of their materials, and of materials that no component uses."""
    used = set()
    for one in occurrences:
        material, own = one.material, one.overrides.process
        base = material.process if material is not None else None
        if base is not None and material is not None:
            used.add(material.process_origin)
            for doubt in _doubts(base, base.origins):
                _warn(doubt, base, (), one.path, make_notes(f"`{one.component.name}` is made of this material", one.origin), tree.findings)
        if own is not None:
            for doubt in _doubts(own.merge_over(base or Process()), own.origins):
                notes = make_notes(f"`{one.component.name}` is printed with this process", one.component.origin)
                same_line = own.origins[doubt.key][0].line == one.component.origin[0].line
                _warn(doubt, own, one.component.full_origin((), one.origin), one.path, () if same_line else notes, tree.findings)
    for instance, definition in tree.assemblies:
        for material in definition.materials.values():
            if material.process is not None and material.process_origin not in used:
                notes = make_notes(f"no part of `{definition.name}` is made of this material", definition.origin)
                for doubt in _doubts(material.process, material.process.origins):
                    _warn(doubt, material.process, instance.origin, instance.within(material.name), notes, tree.findings)


def _warn(doubt: _Doubt, process: Process, outer: Sequence[Span], path: str, notes: Sequence[Note], findings: LinkReport) -> None:
    findings.warn(Code.PROCESS, doubt.words, (*process.origins[doubt.key], *outer), path=path, help=doubt.help, notes=notes)


def _doubts(process: Process, keys: Collection[str]) -> Iterator[_Doubt]:
    """Yield the implausible values of a manufacturing process. Only the settings in `keys` are checked."""
    lines = process.technique == "fdm"
    for key, value, (least, most), usual in (
        ("line_width", process.line_width, *((WIDTHS, USUAL_WIDTHS) if lines else (SKINS, USUAL_SKINS))),
        ("layer", process.layer, HEIGHTS, USUAL_HEIGHTS),
    ):
        if key in keys and value is not None and not least <= value <= most:
            intended = next((value * slip for slip in _SLIPS if usual[0] <= value * slip <= usual[1]), None)
            yield _Doubt(
                key=key, words=f"`{key}` ({length_words(value)}) is not in the usual range ({length_words(least)} to {length_words(most)})",
                help="check the unit (`mm`, `um`)" if intended is None else f"try `{length_words(intended)}`",
            )
    for key, count, most, some in (
        ("walls", process.walls, WALLS, "2 to 6 lines"), ("top", process.top, LIDS, "3 to 8 layers"),
        ("bottom", process.bottom, LIDS, "3 to 8 layers"),
    ):
        if key in keys and count is not None and count > most:
            help = f"use {some}, or `infill: 100 %` for a solid part"
            yield _Doubt(key=key, words=f"`{key}` ({count}) exceeds the plausible maximum ({most})", help=help)
    for key, share in (("infill", process.infill), ("overlap", process.overlap)):
        if key in keys and share is not None and 0.0 < share < LEAST_SHARE:
            yield _Doubt(
                key=key, words=f"`{key}` ({100.0 * share:.6g} %) is below 1 %",
                help=f"try `{key}: {10_000.0 * share:.6g} %`",
            )
