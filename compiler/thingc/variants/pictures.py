"""The pictures of a batch, `pictures/ID.png`: of some of its variants, by one camera, so that sizes compare."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

from thingc.diagnostics import Code, Diagnostic, Severity
from thingc.variants import places
from thingc.variants.journal import in_order

MOST = 48
"""Pictures of a batch, unless the caller says otherwise: one takes some tenths of a second without a graphics card."""

OnPicture = Callable[[int, int], None]
"""`on_picture(done, count)`."""


def chosen(folder: str, mode: str, most: int | None) -> list[tuple[str, str]]:
    """`(id, path of the model)` of at most so many built variants (None: of all), evenly spread over the batch, in plan order."""
    found: list[tuple[str, str]] = []
    for line in in_order(os.path.join(folder, places.JOURNAL)):
        if line["status"] == "built" and (path := _model(folder, line["id"], mode)) is not None:
            found.append((line["id"], path))
    if most is None or len(found) <= most:
        return found
    return [found[k * len(found) // most] for k in range(most)]


def _model(folder: str, id: str, mode: str) -> str | None:
    """The path of a variant's model in a mode, `mjcf/ROBOT_MODE.xml`; None where MJCF was not written."""
    place = os.path.join(places.variant_folder(folder, id), "mjcf")
    names = os.listdir(place) if os.path.isdir(place) else []
    # of the modes `foot` and `front_foot` the ends are alike: then the shorter name is the one of `foot`
    found = sorted((name for name in names if name.endswith(f"_{mode}.xml") and name != f"scene_{mode}.xml"), key=len)
    return os.path.join(place, found[0]) if found else None


def draw(
    folder: str, mode: str, pose: str | None, *, most: int | None = MOST, jobs: int = 1, on_picture: OnPicture | None = None,
) -> Diagnostic | None:
    """Draw the pictures anew, in up to `jobs` processes; a warning where this machine cannot draw.

    What was drawn before and is not chosen now is deleted. Interrupted, it leaves the pictures that are there. Raises `OSError`
    when the system refuses.
    """
    place = os.path.join(folder, places.PICTURES)
    shots = chosen(folder, mode, most) if most != 0 else []
    keep = {f"{id}.png" for id, _ in shots}
    for name in os.listdir(place) if os.path.isdir(place) else ():
        if name not in keep:
            os.unlink(os.path.join(place, name))
    if not shots:
        with contextlib.suppress(OSError):
            os.rmdir(place)
        return None
    os.makedirs(place, exist_ok=True)
    count = max(1, min(jobs, len(shots) // 4))
    parts = [shots[k::count] for k in range(count)]
    processes = [_Photographer() for _ in parts]
    try:
        fault = _drawn(place, pose, parts, processes, len(shots), on_picture)
    finally:
        for process in processes:
            process.close()
        with contextlib.suppress(OSError):  # nothing could be drawn
            os.rmdir(place)
    return fault


def _drawn(
    place: str, pose: str | None, parts: Sequence[Sequence[tuple[str, str]]], processes: Sequence[_Photographer], count: int,
    on_picture: OnPicture | None,
) -> Diagnostic | None:
    for part, process in zip(parts, processes, strict=True):
        process.ask({"measure": [path for _, path in part], "pose": pose})
    points: list[Any] = []
    gravity = [0.0, 0.0, 0.0]
    visible: list[list[tuple[str, str]]] = []
    for part, process in zip(parts, processes, strict=True):
        found = process.answer()
        if found is None:
            return _refused("the process that draws ended", process.errors())
        for own, down in found:
            points += own
            gravity = down if own else gravity
        visible.append([shot for shot, (own, _) in zip(part, found, strict=True) if own])
    if not points:
        return None  # robots of bare frames: there is nothing to see
    for part, process in zip(visible, processes, strict=True):
        process.ask({
            "draw": [[path, os.path.join(place, f"{id}.png")] for id, path in part], "points": points, "gravity": gravity, "pose": pose,
        })
    done = count - sum(map(len, visible))
    for part, process in zip(visible, processes, strict=True):
        for _ in part:
            found = process.answer()
            if found is None or "fault" in found:
                return _refused(*(("the process that draws ended", process.errors()) if found is None else (found["fault"], found["hint"])))
            done += 1
            if on_picture is not None:
                on_picture(done, count)
    return None


def _refused(words: str, hint: str) -> Diagnostic:
    return Diagnostic(
        code=Code.NO_GRAPHICS, severity=Severity.WARNING, message=f"the batch's page has no pictures, or not all: {words}",
        help=" ".join(hint.split()) or None,
    )


class _Photographer:
    """A process that draws, and the pipes to it."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "thingc.variants.photographer"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def ask(self, asked: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # the answer that does not come will tell
            self._process.stdin.write(json.dumps(asked).encode() + b"\n")
            self._process.stdin.flush()

    def answer(self) -> Any:
        """The next answer; None where none will come."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        return json.loads(line) if line.endswith(b"\n") else None

    def errors(self) -> str:
        """The last line of what it wrote to standard error, once it has ended."""
        assert self._process.stderr is not None
        self._process.kill()
        said = self._process.stderr.read().decode(errors="replace").strip().splitlines()
        return said[-1] if said else ""

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
