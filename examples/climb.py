"""MInchW climbs through a steel tunnel with a floor, a wall and a ceiling: `make climb`, or `python examples/climb.py BUILD`.

The film shows one simulation from the floor to the ceiling. The root of the model is the foot that holds the robot. The plot shows the pull
margin of many walks on each surface, at different speeds. The printed values are measured in the simulations.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # before mujoco is imported, which chooses its renderer then

import mujoco
import numpy as np

from inchworm_film import FollowingFilm
from inchworm_gait import PULL, Swing, swings
from inchworm_physics import STAND, Climb, Seen
from inchworm_tunnel import CORNER, Tunnel
from walk import LIFT, PLACES, SHORT, SINK, STRIDE, built, write

STAGES = ("floor", "floor to wall", "wall", "wall to ceiling", "ceiling")
PACES = (0.5, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0)
"""Speeds of the walk relative to the gait in `walk.py`."""

FALLEN = 0.1
"""Slip [m] of a foot above which the robot counts as fallen."""

FRAME, SHOWN = 0.3, 0.1
"""Simulated time [s] between two frames of the film, and the time [s] for which each frame is shown."""


@dataclass(slots=True, kw_only=True)
class Stages:
    """Records the smallest pull margin [N] in each stage of the climb. An instance is a callback that runs after every simulation step."""

    until: tuple[float, ...]
    film: FollowingFilm | None = None
    least: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, np.inf))

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData, margin: float) -> None:
        """Update the smallest margin of the current stage, and call the film's callback."""
        stage = STAGES[min(int(np.searchsorted(self.until, data.time - 1e-9)), len(STAGES) - 1)]
        self.least[stage] = min(self.least[stage], margin)
        if self.film is not None:
            self.film(model, data, margin)


def stages(tunnel: Tunnel, plan: Sequence[Swing]) -> tuple[float, ...]:
    """Return the simulated time [s] at the end of each stage."""
    ends = np.cumsum([2 * tunnel.floor, len(CORNER), 2 * tunnel.wall, len(CORNER), 2 * tunnel.ceiling])
    return tuple(STAND + sum(swing.duration for swing in plan[:end]) for end in ends)


def climb(folder: Path, tunnel: Tunnel, film: FollowingFilm | None = None) -> dict[str, tuple[Seen, Stages]]:
    """Simulate the climb through a tunnel twice: rooted at the holding foot, and with a free base. The film records only the rooted
    simulation.
    """
    robot = Climb(folder, "", tunnel.faces)
    plan, footholds = tunnel.plan(robot.models), tunnel.footholds()
    found = {}
    for way, walk, shown in (("rooted", robot.rooted, film), ("free", robot.adhering, None)):
        watch = Stages(until=stages(tunnel, plan), film=shown)
        found[way] = walk(plan, watch, footholds), watch
    return found


def report(found: Mapping[str, tuple[Seen, Stages]]) -> str:
    """Return the results of the climb as a text table with one column per simulation."""
    seen = [each for each, _ in found.values()]
    rows = [
        ("", list(found)),
        ("steps of a foot", [f"{2 * one.steps}" for one in seen]),
        *((f"smallest pull margin, {stage} [N]", [newtons(watch.least[stage]) for _, watch in found.values()]) for stage in STAGES),
        *outcomes(seen),
    ]
    return "\n".join(f"{name:42}" + "".join(f"{cell:>12}" for cell in cells) for name, cells in rows)


def outcomes(seen: Sequence[Seen]) -> list[tuple[str, list[str]]]:
    """Return the rows of a table that compares simulations, with one column per simulation: smallest margins, slip and contacts."""
    return [
        ("smallest shear margin", [f"{100 * (1 - one.shear):.1f} %" for one in seen]),
        ("smallest torque margin", [f"{100 * (1 - max(one.torque.values())):.1f} %" for one in seen]),
        ("smallest torque-speed margin", [f"{100 * (1 - one.speed):.1f} %" for one in seen]),
        ("slip of the supporting foot [mm]", [f"{1e3 * one.slips['standing']:.3f}" for one in seen]),
        ("contacts besides soles", [", ".join(sorted(one.touches)) or "nothing" for one in seen]),
    ]


def newtons(margin: float) -> str:
    """Format a pull margin [N], or report that the foot detached from the steel."""
    return f"{round(margin, 1) + 0.0:.1f}" if np.isfinite(margin) else "off"


def fallen(seen: Seen) -> bool:
    """Return whether a foot has slipped by more than `FALLEN`."""
    return max(seen.slips.values()) > FALLEN


def paced(folder: Path, place: str, pace: float, steps: int = 2) -> tuple[float, dict[str, Seen]]:
    """Simulate the gait of `walk.py` on a surface, with its speed multiplied by `pace`. Return the walking speed [m/s] and the results of
    the rooted and the free simulation.
    """
    robot = Climb(folder, PLACES[place])
    plan = [replace(swing, pace=pace) for swing in swings(robot.models, steps, SHORT, STRIDE, LIFT, SINK)]
    return steps * STRIDE / sum(swing.duration for swing in plan), {"rooted": robot.rooted(plan), "free": robot.adhering(plan)}


def report_speeds(found: Mapping[str, Sequence[tuple[float, dict[str, Seen]]]]) -> str:
    """Return the results at each speed as a text table with one column per speed."""
    rows = [("speed [mm/s]", [f"{1e3 * speed:.1f}" for speed, _ in next(iter(found.values()))])]
    for place, walks in found.items():
        for way in ("rooted", "free"):
            margins = ["falls" if fallen(seen[way]) else newtons(PULL - seen[way].pull) for _, seen in walks]
            rows.append((f"pull margin, {place}, {way} [N]", margins))
        rows.append((f"torque-speed margin, {place}", [f"{100 * (1 - seen['rooted'].speed):.0f} %" for _, seen in walks]))
    return "\n".join(f"{name:34}" + "".join(f"{cell:>8}" for cell in cells) for name, cells in rows)


def plot(found: Mapping[str, Sequence[tuple[float, dict[str, Seen]]]], path: Path) -> None:
    """Plot the smallest pull margin against the speed. Lines are rooted simulations, rings are free simulations, and crosses are walks in
    which a foot detached.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8.0, 4.2), dpi=120)
    limits = [np.interp(1.0, [seen["rooted"].speed for _, seen in walks], [1e3 * speed for speed, _ in walks]) for walks in found.values()]
    axes.axvspan(min(limits), 200.0, color="0.93", lw=0)
    axes.annotate("faster than the servos'\ntorque-speed line allows", (1.04 * min(limits), 222), color="0.4", va="top", fontsize=9)
    axes.axhline(0.0, color="0.3", lw=1)
    for shift, (place, walks), colour in zip((0.96, 1.0, 1.04), found.items(), ("tab:blue", "tab:green", "tab:orange"), strict=True):
        kept = [(1e3 * speed, PULL - seen["rooted"].pull) for speed, seen in walks if np.isfinite(seen["rooted"].pull)]
        axes.plot(*zip(*kept, strict=True), color=colour, marker=".", label=f"{place}, rooted")
        held = [(1e3 * speed, PULL - seen["free"].pull) for speed, seen in walks if np.isfinite(seen["free"].pull)]
        axes.plot(*zip(*held, strict=True), color=colour, ls="", marker="o", mfc="none", label=f"{place}, free")
        off = [shift * 1e3 * speed for speed, seen in walks if not np.isfinite(seen["free"].pull)]
        axes.plot(off, [0.0] * len(off), color=colour, ls="", marker="x", ms=9, mew=2.5, clip_on=False)
        for speed, seen in walks:
            if fallen(seen["free"]):
                axes.annotate("falls", (shift * 1e3 * speed, -14.0), color=colour, ha="center", va="top", fontsize=9)
    axes.plot([], [], color="0.3", ls="", marker="x", ms=9, mew=2.5, label="foot comes off")
    axes.set_xscale("log")
    ticks = [10, 20, 30, 40, 60, 80, 120]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.set(xlim=(8.5, 135.0), ylim=(-60.0, 230.0), xlabel="gait speed [mm/s]", ylabel="smallest pull margin [N] of 300 N")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, ncols=1, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Software": None})


def main() -> int:
    """Build the robot unless a build folder is specified, simulate the climb, and print the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", nargs="?", type=Path, help="build folder of MInchW (default: build it)")
    parser.add_argument("--film", type=Path, help="output file for the film of the climb (WebP)")
    parser.add_argument("--plot", type=Path, help="output file for the plot of the pull margin; without it, only the climb is simulated")
    parser.add_argument("--page", type=Path, help="page whose reports are replaced (docs/studies/walking.md)")
    given = parser.parse_args()
    with built(given.build) as folder:
        film = FollowingFilm(FRAME) if given.film is not None else None
        climbed = report(climb(folder, Tunnel(), film))
        print(climbed)
        if film is not None:
            film.close()
            film.save(given.film, round(1e3 * SHOWN))
        if given.page is not None:
            write(given.page, "report of the climb", climbed)
        if given.plot is not None:
            found = {place: [paced(folder, place, pace) for pace in PACES] for place in PLACES}
            plot(found, given.plot)
            print(report_speeds(found))
            if given.page is not None:
                write(given.page, "report of speeds", report_speeds(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
