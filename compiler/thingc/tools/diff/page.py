"""One page of what changed: a slider between before and after, and the changes below."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator
from html import escape

from thingc.base.safe_text import escape_control
from thingc.tools.diff.results import DiffResult
from thingc.tools.diff.text_report import NOTHING, TITLES, ReportLine, made, outcomes_and_more

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1d1d22; background: #fff }
code { background: #f1f1f4; padding: 0 .25em; border-radius: .25em } li { margin: .2em 0 } .because { color: #66666e }
.slider { position: relative; aspect-ratio: 4 / 3; overflow: hidden; border-radius: .5rem; --at: 50% }
.slider img { position: absolute; inset: 0; width: 100%; height: 100% }
.slider .after { clip-path: inset(0 0 0 var(--at)) }
.slider input { position: absolute; inset: auto 0 .5rem 0; width: 100%; margin: 0 }
.overlay { width: 100%; border-radius: .5rem }
@media (prefers-color-scheme: dark) {
  body { color: #e8e8ec; background: #17171a } code { background: #2a2a30 } .because { color: #a0a0aa }
}
"""


def as_html(differences: DiffResult) -> str:
    """A page that stands alone: it asks nothing of a network."""
    title = f"{_escape_text(differences.old)} → {_escape_text(differences.new)}"
    return "\n".join([
        "<!doctype html>", f'<html lang="en"><head><meta charset="utf-8"><title>{title}</title>',
        f"<style>{STYLE}</style></head><body>", f"<h1>{title}</h1>", *_body(differences),
        "</body></html>", "",
    ])


def _body(differences: DiffResult) -> Iterator[str]:
    for words, names in (("new", differences.come), ("gone", differences.gone)):
        yield from (f"<p><code>{_escape_text(name)}</code> is {words}</p>" for name in names)
    for name, comparison in differences.documents:
        yield f"<h2><code>{_escape_text(name)}</code></h2>"
        if not comparison.changes:
            yield f"<p>{NOTHING.capitalize()}.</p>"
            continue
        if comparison.pictures:
            before, after, overlay = (_source(comparison.pictures[key]) for key in ("before", "after", "overlay"))
            yield '<div class="slider">'
            yield f'<img src="{before}" alt="before"><img class="after" src="{after}" alt="after">'
            yield (
                '<input type="range" min="0" max="100" value="50" aria-label="from before to after" '
                "oninput=\"this.parentNode.style.setProperty('--at', this.value + '%')\"></div>"
            )
        yield from _list(made(comparison))
        outcomes, kinds = outcomes_and_more(comparison)
        if outcomes:
            yield from _list(outcomes)
        if comparison.pictures:
            yield "<details open><summary>what is new (green), other now (orange), elsewhere (blue)</summary>"
            yield f'<img class="overlay" src="{overlay}" alt="what changed, in colours"></details>'
        for what, sentences in kinds.items():
            yield f"<details><summary>{TITLES[what]} ({sum(len(one.paths) for one in sentences)})</summary>"
            yield from _list(sentences)
            yield "</details>"
        yield from (f"<p>Not compared: {_escape_text(unknown)}.</p>" for unknown in comparison.unknown)


def _list(sentences: Iterable[ReportLine]) -> Iterator[str]:
    yield "<ul>"
    for one in sentences:
        causes = ", ".join(path or "robot" for path in one.because)
        because = f' <span class="because">because of {_escape_text(causes)}</span>' if causes else ""
        sign = {"+": "new ", "-": "gone "}.get(one.sign, "")
        yield f"<li>{sign}{one.what} <code>{_escape_text(one.named)}</code>{_escape_text(one.words)}{because}</li>"
    yield "</ul>"


def _escape_text(text: str) -> str:
    return escape(escape_control(text))


def _source(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode()
