"""Tables for people, and how frames are written in them."""

from __future__ import annotations

from collections.abc import Sequence

from thingc.base.pose import Matrix, Vector
from thingc.base.safe_text import escape_control


def table(rows: Sequence[tuple[str, ...]], right: tuple[int, ...] = ()) -> list[str]:
    """The lines of rows of as many cells each; columns `right` are set to the right."""
    rows = [tuple(map(escape_control, row)) for row in rows]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(cell.rjust(w) if k in right else cell.ljust(w) for k, (cell, w) in enumerate(zip(row, widths))).rstrip()
        for row in rows
    ]


def millimetres(place: Vector) -> str:
    """A place [m] in mm, to a tenth of a micrometre: `0 120 30.5`."""
    return " ".join(f"{round(1000.0 * x, 4) + 0.0:g}" for x in place)


def axes(rotation: Matrix) -> str:
    """The axes x, y, z of a frame, each as the axis of its parent that it lies along, or as a direction in it: `+x, -y, -z`."""
    return ", ".join(_axis((rotation[0][k], rotation[1][k], rotation[2][k])) for k in range(3))


def _axis(v: Vector) -> str:
    for k, name in enumerate("xyz"):
        if abs(abs(v[k]) - 1.0) < 1e-9:
            return f"{'+' if v[k] > 0 else '-'}{name}"
    return "(" + " ".join(f"{x:z.3f}" for x in v) + ")"
