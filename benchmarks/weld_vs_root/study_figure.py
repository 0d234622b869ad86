"""Draw the figure of the study. The plots show a posture that should be at rest, the motion of the foot, and the error of a swing."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from formulations import FORMULATIONS, ROOTED, SOFT, STIFF
from measured import DRIVES, FREE, SWUNG, USUAL, Measured, worst_swing

matplotlib.use("Agg")
from matplotlib import pyplot  # after the backend is set, which does not need a display

COLOURS = {SOFT: "#c44e52", STIFF: "#dd8452", ROOTED: "#1f77b4"}
NOTHING = 1e-17
"""Position at which the logarithmic axis shows the value 0."""


def draw(found: Measured, file: Path) -> None:
    """Write the figure as a PNG file."""
    timestep, integrator = USUAL
    figure, grid = pyplot.subplots(2, 2, figsize=(10.5, 8.0), layout="constrained")
    axes = grid.ravel()
    for axis, condition, title in (
        (axes[0], DRIVES, "Standing, the drives hold"), (axes[1], FREE, "Standing, torques alone"),
    ):
        for name in FORMULATIONS:
            speeds = found.stands[condition, "floor", "arched", integrator, timestep, name].speeds
            axis.semilogy(np.arange(1, len(speeds) + 1), np.maximum(speeds, NOTHING), color=COLOURS[name], label=name)
        axis.set(title=title, xlabel=f"step of {timestep * 1e3:g} ms", ylabel="max |qvel|  [rad/s, m/s]", ylim=(2e-18, 20.0))
        axis.axhline(NOTHING, color="0.85", zorder=0)
        axis.text(0.98, 0.065, "exactly 0", transform=axis.transAxes, ha="right", color=COLOURS[ROOTED])
    for axis, scheme in ((axes[2], integrator), (axes[3], "RK4")):
        for feedback, style, marker in ((False, "--", "o"), (True, "-", "s")):
            for name in FORMULATIONS:
                errors = [worst_swing(found, feedback, scheme, step, name).tip for step in SWUNG]
                label = f"{name}, {'light' if feedback else 'no'} feedback"
                axis.loglog([1e3 * step for step in SWUNG], errors, style, marker=marker, ms=4, color=COLOURS[name], label=label)
        axis.set(title=f"Swinging, {scheme}", xlabel="timestep [ms]", ylabel="error of the free sole [mm]", ylim=(2e-6, 200.0))
    axes[1].legend(loc="center right", fontsize=9)
    axes[2].legend(loc="lower right", fontsize=9)
    for axis in axes:
        axis.grid(alpha=0.25)
    figure.savefig(file, dpi=110, metadata={"Software": None})
    pyplot.close(figure)
