"""Format the result of `thingc diff` as text for a terminal, as Markdown for a pull-request comment, or as an HTML page."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import resources
from typing import Any

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.numeric import dist, hypot
from thingc.base.one_line_repr import format_count
from thingc.base.pose import make_pose, turn_of
from thingc.base.safe_text import escape_control, html_text, some
from thingc.base.units import ANGLE, LENGTH, MASS, Quantity
from thingc.documents.checks import kinds
from thingc.tools.diff.comparison import Comparison
from thingc.tools.diff.results import DiffResult
from thingc.tools.diff.snapshot import PERHAPS, Change, DisplayValue, How, What

MOVED = ": moved"
NOTHING = "no changes in meaning"
SHOWN = 3
"""Maximum number of paths in a line of a report. The line also contains the number of further paths."""
FOLLOWING = 30
"""Maximum number of lines about consequences in a text report."""
LARGEST = 60_000
"""Maximum size [bytes] of a Markdown comment."""

_SIGNS: dict[How, str] = {"added": "+", "removed": "-", "renamed": "~", "moved": "~", "changed": " "}
_ALONE: dict[How, str] = {"added": "new", "removed": "gone", "changed": "changed, but not compared because of --no-code"}
TITLES: dict[What, str] = {
    "mass": "masses", "bom": "bill of materials", "file": "files to print again", "test": "tests", "joint": "joints", "mode": "modes",
    "pose": "poses", "component": "places", "geometry": "geometry", "mate": "mates", "parameter": "parameters", "mount": "mounts",
    "material": "materials", "sensor": "sensors",
}
"""Titles of consequences by kind of element, the most important kind first."""
_ORDER = tuple(TITLES)
_LENGTHS = ("xyz", "place", "centre", "box", "surface", "gap", "lead")
_ANGLES = ("rpy", "turn", "fovy", "cone")


class ReportLine(FrozenStruct):
    """A line of a report that describes equal changes of several elements.

    `paths` are the paths of the elements, and `words` describes the change. If `decides` is true, a test that failed before passes now, or
    vice versa.
    """

    what: What
    sign: str
    paths: tuple[str, ...]
    words: str
    because: tuple[str, ...]
    decides: bool = False

    @property
    def named(self) -> str:
        """The paths of the changed elements as text, abbreviated if the list is long."""
        return _join_paths(self.paths)


def as_text(answer: DiffResult) -> Iterator[str]:
    """Format the result of a comparison as lines for a terminal."""
    for one in answer.alone:
        yield f"{_SIGNS[one.change]} {one.path}{f': {_ALONE[one.change]}' if one.change == 'changed' else ''}"
    if not answer.documents and not answer.changes:
        yield f"{answer.old} -> {answer.new}: {NOTHING}"
    for name, comparison in answer.documents:
        if not comparison.changes and not comparison.mechanism:
            yield f"{name}: {NOTHING}"
            continue
        yield f"{name}: {answer.old} -> {answer.new}"
        yield from (f"  {line}" for line in _mechanism(comparison))
        yield from (f"  {line.sign} {line.what} {line.named}{line.words}" for line in user_changes(comparison))
        sentences = list(consequences_of(comparison))
        if sentences:
            yield "  effects:"
            for line in sentences[:FOLLOWING]:
                because = f" (because of {_join_paths(line.because)})" if line.because else ""
                yield f"  {line.sign} {line.what} {line.named}{line.words}{because}"
            if len(sentences) > FOLLOWING:
                yield f"    and {format_count(len(sentences) - FOLLOWING, 'line')} more, see --format json"
        yield from (f"  not compared: {unknown}" for unknown in comparison.unknown)


def _mechanism(comparison: Comparison) -> list[str]:
    return [comparison.mechanism] if comparison.mechanism else []


def as_markdown(answer: DiffResult, pictures: Callable[[str, str], str] | None = None) -> str:
    """Format the result of a comparison as Markdown of at most `LARGEST` bytes.

    The text contains the changes in documents, the changed test results, and a collapsible section for each kind of other consequences. The
    function `pictures` returns the URL of a picture, given the name of a document and `before`, `after` or `overlay`.
    """
    for limit in (10_000, 200, 50, 20, 5, 1):
        text = "\n".join(_markdown(answer, limit, pictures)) + "\n"
        if len(text.encode()) <= LARGEST:
            return text
    return text.encode()[:LARGEST].decode(errors="ignore")


def _markdown(answer: DiffResult, limit: int, pictures: Callable[[str, str], str] | None) -> Iterator[str]:
    yield f"### {_code(answer.old)} → {_code(answer.new)}"
    yield from (f"- {_code(one.path)} is {_ALONE[one.change]}" for one in answer.alone[:limit])
    if not any(comparison.changes or comparison.mechanism for _, comparison in answer.documents):
        yield "" if answer.changes else f"\n{NOTHING.capitalize()}."
    for name, comparison in answer.documents:
        if not comparison.changes and not comparison.mechanism:
            continue
        yield f"\n#### {_code(name)}\n"
        if pictures is not None and comparison.pictures:
            yield from (f"![{_plain(name)}, {key}]({pictures(name, key)})" for key in comparison.pictures)
            yield ""
        yield from (f"- {_code(line)}" for line in _mechanism(comparison))
        yield from _items(list(user_changes(comparison)), limit)
        outcomes, kinds = split_consequences(comparison)
        if outcomes:
            yield ""
            yield from _items(outcomes, limit)
        for kind, lines in kinds.items():
            yield f"\n<details><summary>{TITLES[kind]} ({sum(len(line.paths) for line in lines)})</summary>\n"
            yield from _items(lines, limit)
            yield "\n</details>"
        yield from (f"\nNot compared: {unknown}." for unknown in comparison.unknown)


def _items(lines: Sequence[ReportLine], limit: int) -> Iterator[str]:
    for line in lines[:limit]:
        because = f" — because of {_code(_join_paths(line.because))}" if line.because else ""
        sign = {"+": "**new** ", "-": "**gone** ", "~": ""}.get(line.sign, "")
        yield f"- {sign}{line.what} {_code(line.named)}{_code(line.words.strip(' :')) if line.words else ''}{because}".replace("``", "` `")
    if len(lines) > limit:
        yield f"- and {len(lines) - limit} more"


def _plain(text: str) -> str:
    """Escape the Markdown special characters in a name."""
    return "".join(letter if letter.isalnum() or letter in " ./_-" else "?" for letter in escape_control(text))


def _code(text: str) -> str:
    """Format a string as a Markdown code span, in which special characters have no effect."""
    return f"`{escape_control(text).replace('`', chr(39))}`"


def _join_paths(paths: Sequence[str]) -> str:
    return some([path or "robot" for path in paths], SHOWN)


def user_changes(comparison: Comparison) -> Iterator[ReportLine]:
    """Return the changes that the user made in documents."""
    return _lines(change for change in comparison.changes if not change.caused)


def consequences_of(comparison: Comparison) -> Iterator[ReportLine]:
    """Yield the consequences of changes in documents, the most important first.

    Changed test results come first. Other consequences are grouped by kind, and each group starts with changes of the whole robot.
    """
    consequences = [change for change in comparison.changes if change.caused and not _is_detail(change)]
    consequences.sort(key=lambda c: (-1 if _decides(c) else _ORDER.index(c.what), c.path != ""))
    return _lines(consequences)


def split_consequences(comparison: Comparison) -> tuple[list[ReportLine], dict[What, list[ReportLine]]]:
    """Return the changed test results, and all other consequences of changes in documents, grouped by kind."""
    lines = list(consequences_of(comparison))
    return [line for line in lines if line.decides], group_by((line for line in lines if not line.decides), lambda line: line.what)


def _decides(change: Change) -> bool:
    return change.what == "test" and (change.field or "").startswith("passed")


def _is_detail(change: Change) -> bool:
    """Return whether a change affects the centre of mass or the inertia of a single part or link.

    Only JSON output contains such changes.
    """
    return change.what == "mass" and change.field in ("centre", "inertia", "link.centre", "link.inertia")


def _lines(changes: Iterable[Change]) -> Iterator[ReportLine]:
    grouped: dict[tuple[What, str, str], list[Change]] = {}
    for change in changes:
        measured = change.what == "test" and (change.field or "").startswith("measured.")
        everywhere = replace(change, field=(change.field or "").partition(" [")[0]) if measured else change  # without mode and pose
        grouped.setdefault((change.what, _SIGNS[change.change], _change_text(everywhere)), []).append(change)
    for (kind, sign, text), equal_changes in grouped.items():
        if len({one.field for one in equal_changes}) == 1:
            text = _change_text(equal_changes[0])
        if text == MOVED:
            distance, angle = (max(motion) for motion in zip(*map(_motion, equal_changes), strict=True))
            text = ": " + " and ".join([
                *([f"moved by up to {Quantity(distance, LENGTH).format(3)}"] if distance or not angle else []),
                *([f"turned by up to {Quantity(angle, ANGLE).format(3)}"] if angle else []),
            ])
        paths = dict.fromkeys(one.path for one in equal_changes)
        causes = dict.fromkeys(word for one in equal_changes for word in one.because if word != PERHAPS)
        yield ReportLine(what=kind, sign=sign, paths=tuple(paths), words=text, because=tuple(causes), decides=_decides(equal_changes[0]))


def _motion(change: Change) -> tuple[float, float]:
    """Return the distance [m] and the angle [rad] by which a part or frame moved.

    A change of the field `place` contains translations, a change of `turn` contains roll, pitch and yaw, and a change of `pose` contains
    both.
    """
    values: Any = (change.old, change.new)
    pairs = {"place": [(value, (0.0,) * 3) for value in values], "turn": [((0.0,) * 3, value) for value in values]}
    old, new = (make_pose(*pair) for pair in pairs.get(change.field or "", values))
    angle = hypot(*turn_of((old.inverse() @ new).quaternion()))
    return dist(old.translation, new.translation), angle if angle > 1e-9 else 0.0


def _change_text(change: Change) -> str:
    """Describe a change as text, for example by its old and new value."""
    if change.change == "moved" and change.field in ("place", "turn", "pose"):
        return MOVED
    if change.change in ("added", "removed"):
        label = change.new if change.change == "added" else change.old
        return f" ({label})" if isinstance(label, (str, int)) and not isinstance(label, bool) else ""
    if change.change in ("renamed", "moved") and change.field is None:
        where = "renamed to" if change.change == "renamed" else "moved to"
        perhaps = f"{PERHAPS}, " if PERHAPS in change.because else ""
        reason = f" ({perhaps}{change.reason})" if change.reason else ""
        return f" {where} {change.new_path}{reason}"
    old, new = change.words or (_value(change.field or "", change.old), _value(change.field or "", change.new))
    field = change.field or ""
    if field == "surface":
        return f": surfaces up to {new} apart"
    if isinstance(change.old, bool) and field.startswith("passed"):
        return f"{field.removeprefix('passed')}: {'passes' if change.new else 'FAILS'} now"
    return f": {field} {old} -> {new}{_share(change.old, change.new)}"


def _share(old: DisplayValue, new: DisplayValue) -> str:
    """Format the relative difference between an old and a new number. Return an empty string if the relative difference is undefined."""
    if not isinstance(old, float) or not isinstance(new, float) or old == 0.0 or not math.isfinite(new / old):
        return ""
    return f" ({100.0 * (new / old - 1.0):+.3g} %)"


def _value(field: str, value: DisplayValue) -> str:
    """Format the value of a field with the unit of the field."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(_value(field, one) for one in value) + "]"
    if isinstance(value, str):
        return value
    keys = field.partition(" [")[0].split(".")
    first, last = keys[0], keys[-1]
    if last in ("min", "max") and len(keys) == 2:  # `reach.min` of a test
        last = first
    if last in ("mass", "value") and "mass" in field:
        return str(Quantity(value, MASS))
    measured = first != "params" and any(last in kind.lengths for kind in kinds().values())
    if last == "value" and "com" in field or last in _LENGTHS or measured:
        return str(Quantity(value if abs(value) >= 1e-12 else 0.0, LENGTH))
    if last in _ANGLES:
        return str(Quantity(value, ANGLE))
    if last == "rest" and first == "measured":
        return f"{value:.6g} s"
    if last == "volume":
        return f"{value * 1e6:.4g} cm^3"
    return f"{value * 1e4:.4g} cm^2" if last == "area" else f"{value:.6g}"


STYLE = "\n" + resources.files(__package__).joinpath("page.css").read_text(encoding="utf-8")


def as_html(differences: DiffResult) -> str:
    """Format the result of a comparison as a self-contained HTML page."""
    title = f"{html_text(differences.old)} → {html_text(differences.new)}"
    return "\n".join([
        "<!doctype html>", f'<html lang="en"><head><meta charset="utf-8"><title>{title}</title>',
        f"<style>{STYLE}</style></head><body>", f"<h1>{title}</h1>", *_body(differences),
        "</body></html>", "",
    ])


def _body(differences: DiffResult) -> Iterator[str]:
    yield from (f"<p><code>{html_text(one.path)}</code> is {_ALONE[one.change]}</p>" for one in differences.alone)
    for name, comparison in differences.documents:
        yield f"<h2><code>{html_text(name)}</code></h2>"
        if not comparison.changes and not comparison.mechanism:
            yield f"<p>{NOTHING.capitalize()}.</p>"
            continue
        if comparison.pictures:
            pngs = (base64.b64encode(comparison.pictures[key]).decode() for key in ("before", "after", "overlay"))
            old_url, new_url, overlay = (f"data:image/png;base64,{png}" for png in pngs)
            yield '<div class="slider">'
            yield f'<img src="{old_url}" alt="before"><img class="after" src="{new_url}" alt="after">'
            yield (
                '<input type="range" min="0" max="100" value="50" aria-label="from before to after" '
                "oninput=\"this.parentNode.style.setProperty('--at', this.value + '%')\"></div>"
            )
        yield from (f"<p>{html_text(line)}</p>" for line in _mechanism(comparison))
        yield from _list(user_changes(comparison))
        outcomes, kinds = split_consequences(comparison)
        if outcomes:
            yield from _list(outcomes)
        if comparison.pictures:
            yield "<details open><summary>added (green), changed (orange), moved (blue)</summary>"
            yield f'<img class="overlay" src="{overlay}" alt="changes in colour"></details>'
        for kind, sentences in kinds.items():
            yield f"<details><summary>{TITLES[kind]} ({sum(len(one.paths) for one in sentences)})</summary>"
            yield from _list(sentences)
            yield "</details>"
        yield from (f"<p>Not compared: {html_text(unknown)}.</p>" for unknown in comparison.unknown)


def _list(sentences: Iterable[ReportLine]) -> Iterator[str]:
    yield "<ul>"
    for one in sentences:
        causes = ", ".join(path or "robot" for path in one.because)
        because = f' <span class="because">because of {html_text(causes)}</span>' if causes else ""
        sign = {"+": "new ", "-": "gone "}.get(one.sign, "")
        yield f"<li>{sign}{one.what} <code>{html_text(one.named)}</code>{html_text(one.words)}{because}</li>"
    yield "</ul>"
