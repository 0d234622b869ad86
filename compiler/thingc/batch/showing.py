"""What a batch shows of itself when it is over, or is asked again: pictures of variants, and the page."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from thingc.base.diagnostics import Diagnostic
from thingc.base.units import Quantity
from thingc.batch import folder_layout, variants_document
from thingc.batch.build_records import lengths_in
from thingc.batch.folder import begun, forget, in_words, locked, remember, whole
from thingc.batch.page import write_page
from thingc.batch.pictures import OnPicture, draw, usual
from thingc.batch.planning import Plan
from thingc.batch.tables import Column, columns
from thingc.driver.environment import Options


def parameter_columns(plan: Plan) -> list[Column]:
    """The columns of the assembly's parameters by their own names, and of what is set by path."""
    return [
        Column(name=name, kind="number", unit=plan.units[name], written=plan.written_in.get(name, "")) if isinstance(own, Quantity)
        else Column(name=name, kind="flag" if isinstance(own, bool) else "text")
        for name, own in plan.kinds.items()
    ]


def show(
    folder: str, described: Mapping[str, Any], wanted: Sequence[Column], *, most: int, jobs: int,
    on_picture: OnPicture | None = None,
) -> Diagnostic | None:
    """Draw pictures of at most so many variants and write the page. A warning where nothing can be drawn here.

    Ctrl-C ends the drawing alone: the page shows what was drawn until then. Raises `OSError` when the system refuses.
    """
    warning = None
    forget(folder, folder_layout.PAGE)
    try:
        warning = draw(folder, described["modes"][0], described["pose"], most=most, jobs=jobs, on_picture=on_picture)
    except KeyboardInterrupt:
        pass
    write_page(folder, described, wanted)
    remember(folder, folder_layout.PAGE)
    return warning


def show_again(
    document: str, *, output: str | None = None, pictures: int | None = None, jobs: int = 0, options: Options | None = None,
    on_picture: OnPicture | None = None,
) -> tuple[str, Diagnostic | None]:
    """The page of a batch that is there, written anew; nothing is built. The page's path, and a warning where nothing can be drawn.
    `pictures` as of `run`.

    Raises `PlanError` for a document with errors, and `BatchFault` where there is no batch of it, or another one is under way.
    """
    plan = variants_document.plan(document, options=options)
    folder = plan.folder_in(output)
    described = begun(plan.relative, folder, "build it first, without --page-only")
    try:
        with locked(folder):
            whole(folder, described)
            wanted = columns(parameter_columns(plan), plan.choice_paths, lengths_in(folder))
            most = usual(described["count"]) if pictures is None else pictures
            warning = show(folder, described, wanted, most=most, jobs=jobs or os.cpu_count() or 1, on_picture=on_picture)
    except OSError as fault:
        raise in_words(folder, fault) from fault
    return os.path.join(folder, folder_layout.PAGE), warning
