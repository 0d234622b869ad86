"""Render a picture of each chosen variant of a batch to the file `pictures/ID.png`.

All pictures use the same camera, so that sizes can be compared.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from typing import Any

from thingc.base.diagnostics import Code, Diagnostic, Severity
from thingc.base.filesystem import listing, write_tree
from thingc.base.json_lines_process import JsonLinesProcess, ProcessLost
from thingc.base.numeric import sum_of
from thingc.batch import folder_layout
from thingc.batch.build_records import BuildRecords, VariantFiles
from thingc.batch.packed_layout import is_packed

MOST = 48
"""Default number of pictures of a batch. Without a graphics card, rendering a picture takes some tenths of a second."""
MANY = 200
"""Maximum number of variants for which pictures are rendered by default."""
ALL = sys.maxsize
"""A value of the option `pictures` that selects a picture for every variant."""

PATIENCE = 120.0
"""Time limit [s] for rendering a picture."""

OnPicture = Callable[[int, int], None]
"""A callback that reports `done` of `count` pictures as finished."""


def usual(count: int) -> int:
    """Return the default number of pictures for a batch with `count` variants."""
    return MOST if count <= MANY else 0


def along_the_axes(settings: Sequence[Sequence[Any]], max_pictures: int) -> list[int]:
    """Choose `max_pictures` variants that cover the ranges of the settings evenly, and return their indices in ascending order.

    For each setting, the choice includes the variants that are nearest to a straight line. On the line of a setting, this setting changes
    from its first to its last value, while all other settings have middle values. If these variants include all values, further variants
    are chosen at even intervals.

    The position of a value on its axis is its rank, scaled to the interval from 0 to 1. Numbers are ranked by size, and other values by
    their first occurrence. Settings with the same ranks as another setting are ignored.
    """
    ranked = [_ranks(column) for column in zip(*settings, strict=True)]
    axes = [list(ranks) for ranks in dict.fromkeys(tuple(ranks) for ranks in ranked if max(ranks) > 0.0)]
    if not axes:
        return [k * len(settings) // max_pictures for k in range(max_pictures)]
    shares = [min(max_pictures // len(axes) + (number < max_pictures % len(axes)), len(set(axis))) for number, axis in enumerate(axes)]
    remaining = dict.fromkeys(range(len(settings)))
    for axis, share in zip(axes, shares, strict=True):
        distances = [sum_of((other[k] - 0.5) ** 2 for other in axes if other is not axis) for k in range(len(settings))]
        for step in range(share):
            target = step / (share - 1) if share > 1 else 0.5
            del remaining[min(remaining, key=lambda k: (distances[k] + (axis[k] - target) ** 2, k))]
    others, missing = list(remaining), max_pictures - sum(shares)
    for k in range(missing):
        del remaining[others[k * len(others) // missing]]
    return [k for k in range(len(settings)) if k not in remaining]


def _ranks(values: Sequence[Any]) -> tuple[float, ...]:
    """Return the rank of each value among the distinct values, scaled to the interval from 0 to 1."""
    known = list(dict.fromkeys(values))
    if all(isinstance(value, (int, float)) for value in known):
        known.sort()
    place = {value: k / max(1, len(known) - 1) for k, value in enumerate(known)}
    return tuple(place[value] for value in values)


def _model(files: VariantFiles, mode: str) -> str | None:
    """Return the name `ROBOT_MODE.xml` of the model file of a variant in a mode. Return None if the variant has no such file."""
    # the file names for the modes `foot` and `front_foot` have the same end; the shorter one belongs to `foot`
    models = sorted((name for name in files.models() if name.endswith(f"_{mode}.xml") and name != f"scene_{mode}.xml"), key=len)
    return models[0] if models else None


def _choose_models(folder: str, mode: str, max_pictures: int, scratch: str) -> list[tuple[str, str]]:
    """Choose at most `max_pictures` built variants for pictures, and return the id and the path of the model of each variant.

    The function `along_the_axes` makes the choice from the settings of the variants. Variants without a model in the mode are omitted. The
    meshes of a model are in the same folder. For a packed batch, the files are written to the folder `scratch`.
    """
    records = BuildRecords(folder)
    lines = map(records.line, records.built)
    settings = [(*line["parameters"].values(), *line["choices"].values()) for line in lines]
    models: list[tuple[str, str]] = []
    for k in range(len(settings)) if len(settings) <= max_pictures else along_the_axes(settings, max_pictures):
        id, files = str(records.line(records.built[k])["id"]), records.files(records.built[k])
        name = _model(files, mode)
        if name is None:
            continue
        place = os.path.join(folder_layout.variant_folder(folder, id), "mjcf")
        if is_packed(folder):
            place = os.path.join(scratch, id)
            meshes = {f"{id}/assets/{mesh}": path for mesh, (_, path) in files.meshes().items()}
            write_tree(scratch, {f"{id}/{name}": files.read(f"mjcf/{name}")}, meshes)
        models.append((id, os.path.join(place, name)))
    return models


def draw(
    folder: str, mode: str, pose: str | None, *, max_pictures: int = MOST, jobs: int = 1, on_picture: OnPicture | None = None,
) -> Diagnostic | None:
    """Render all pictures of a batch again, in at most `jobs` processes. Return a warning if this machine cannot render pictures.

    Old pictures of variants that are not chosen are deleted. After an interruption, all finished pictures remain. Raises `OSError` if
    writing fails.
    """
    place = os.path.join(folder, folder_layout.PICTURES)
    with tempfile.TemporaryDirectory(prefix="thingc-pictures-") as scratch:
        return _draw(place, pose, _choose_models(folder, mode, max_pictures, scratch) if max_pictures != 0 else (), jobs, on_picture)


def _draw(place: str, pose: str | None, shots: Sequence[tuple[str, str]], jobs: int, on_picture: OnPicture | None) -> Diagnostic | None:
    keep = {f"{id}.png" for id, _ in shots}
    for name in listing(place):
        if name not in keep:
            os.unlink(os.path.join(place, name))
    os.makedirs(place, exist_ok=True)
    count = min(len(shots), max(1, min(jobs, len(shots) // 4)))
    parts = [shots[k::count] for k in range(count)]
    processes: list[JsonLinesProcess] = []
    try:
        for _ in parts:
            processes.append(JsonLinesProcess("thingc.batch.thumbnails"))
        return _draw_parts(place, pose, parts, processes, on_picture)
    finally:
        for process in processes:
            process.kill()
            process.close()
        with contextlib.suppress(OSError):  # this fails unless the folder is empty
            os.rmdir(place)


def _draw_parts(
    place: str, pose: str | None, parts: Sequence[Sequence[tuple[str, str]]], processes: Sequence[JsonLinesProcess],
    on_picture: OnPicture | None,
) -> Diagnostic | None:
    """Render the pictures of each part of the variants in one process. Return a warning after an error."""
    for part, process in zip(parts, processes, strict=True):
        process.ask({"measure": [path for _, path in part], "pose": pose})
    points: list[Any] = []
    gravity = [0.0, 0.0, 0.0]
    visible: list[list[tuple[str, str]]] = []
    for part, process in zip(parts, processes, strict=True):
        try:
            answer = process.answer(PATIENCE * (1 + len(part)))
        except ProcessLost as fault:
            return _lost(process, fault)
        for own, down in answer:
            points += own
            gravity = down if own else gravity
        visible.append([shot for shot, (own, _) in zip(part, answer, strict=True) if own])
    if not points:
        return None  # the robots consist only of frames, so nothing is visible
    for part, process in zip(visible, processes, strict=True):
        process.ask({
            "draw": [[path, os.path.join(place, f"{id}.png")] for id, path in part], "points": points, "gravity": gravity, "pose": pose,
        })
    count = sum(map(len, parts))
    finished = count - sum(map(len, visible))
    for part, process in zip(visible, processes, strict=True):
        for _ in part:
            try:
                answer = process.answer(PATIENCE)
            except ProcessLost as fault:
                return _lost(process, fault)
            if "fault" in answer:
                return _error(answer["fault"], answer["hint"])
            finished += 1
            if on_picture is not None:
                on_picture(finished, count)
    return None


def _lost(process: JsonLinesProcess, fault: ProcessLost) -> Diagnostic:
    """Return a warning that the rendering process has ended unexpectedly. The warning contains the last line of output of the process."""
    lines = process.errors().strip().splitlines()
    return _error(f"the rendering process failed: {fault}", lines[-1] if lines else "")


def _error(message: str, hint: str) -> Diagnostic:
    return Diagnostic(
        code=Code.NO_GRAPHICS, severity=Severity.WARNING, message=f"pictures are missing on the page of the batch: {message}",
        help=" ".join(hint.split()) or None,
    )
