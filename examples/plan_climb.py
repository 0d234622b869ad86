"""Let MInchW plan its path from the floor over a wall to the ceiling: `make plan`, or `python examples/plan_climb.py BUILD`.

The controller of `climb.py` simulates the plan. The result is compared with the climb through the same tunnel that was planned by hand. The
printed values are measured in the simulations.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # before mujoco is imported, which chooses its renderer then

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import thingc
from climb import newtons, outcomes
from inchworm_film import HEIGHT, OPEN, WIDTH, FollowingFilm
from inchworm_gait import DRAWN_UP, FEET, PULL, TRANSFER, Stance, Swing
from inchworm_modes import Foothold, Margins, Mode
from inchworm_physics import POLE, STAND, TIMESTEP, Climb, Seen
from inchworm_planner import NoPlan, Planner, State, Surface
from inchworm_tunnel import SHORT, SINK, Tunnel
from walk import PLACES, ROOT, built, write

TUNNEL = Tunnel(wall=3)
"""In this tunnel, which is lower than the tunnel of `climb.py`, the robot does not need a foothold on the wall."""

SEED = 5
LOW, NEAR = 20.0, 0.02
"""Pull margins below the first value [N] count as low. Footholds nearer than the second value [m] to an edge are reported."""

COLUMNS, TILE = 5, 0.55
"""Number of pictures in a row, and scale of each picture."""


@dataclass(slots=True, kw_only=True)
class Watch:
    """Measures how long [s] the pull margin is low. An instance is a callback that runs after every simulation step."""

    film: Strip | None = None
    low: float = 0.0

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData, margin: float) -> None:
        """Update the smallest margin of the current stage, and call the film's callback."""
        self.low += TIMESTEP * (margin < LOW)
        if self.film is not None:
            self.film(model, data, margin)


class Strip(FollowingFilm):
    """Takes pictures of the whole tunnel in the middle and at the end of each swing."""

    def __init__(self, tunnel: Tunnel, plan: Sequence[State]) -> None:
        super().__init__(0.0)
        self.tunnel = tunnel
        self.shots = list(self._shots(plan))

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData, margin: float) -> None:
        """Take a picture if the time of the next picture has been reached."""
        if len(self.frames) < len(self.shots) and data.time >= self.shots[len(self.frames)][0]:
            picture, _ = self.picture(model, data)
            ImageDraw.Draw(picture).text((12, 10), self.shots[len(self.frames)][1], fill=(40, 42, 48), font=ImageFont.load_default(24))
            self.frames.append(picture)

    def camera(self, data: mujoco.MjData) -> mujoco.MjvCamera:
        """Return a camera that sees the tunnel from its open side."""
        camera = mujoco.MjvCamera()
        camera.lookat[:] = (OPEN + self.tunnel.length) / 2, 0.0, self.tunnel.height / 2
        camera.distance, camera.azimuth, camera.elevation = 1.4, 86.0, -4.0
        return camera

    def save_grid(self, path: Path) -> None:
        """Save all pictures as one image with `COLUMNS` pictures in a row."""
        wide, high = round(TILE * WIDTH), round(TILE * HEIGHT)
        grid = Image.new("RGB", (COLUMNS * wide, -(-len(self.frames) // COLUMNS) * high), "white")
        for k, frame in enumerate(self.frames):
            grid.paste(frame.resize((wide, high), Image.Resampling.LANCZOS), (k % COLUMNS * wide, k // COLUMNS * high))
        path.parent.mkdir(parents=True, exist_ok=True)
        grid.save(path)

    def _shots(self, plan: Sequence[State]) -> Iterator[tuple[float, str]]:
        """Yield the time [s] and the label of each picture."""
        yield STAND, "start"
        time = STAND
        for state in plan[1:]:
            assert state.swing is not None
            foot = state.holds
            yield time + state.swing.seconds / 2, f"step {state.steps}"
            time += state.swing.duration
            yield time - TRANSFER, f"step {state.steps}: {foot} foot on the {state.feet[foot].face.name}"


def surfaces(tunnel: Tunnel) -> list[Surface]:
    """Return the three surfaces of a tunnel, with the positions of their edges."""
    floor, wall, ceiling = tunnel.faces
    return [
        Surface(face=floor, begin=OPEN, end=tunnel.length, start=0.0),
        Surface(face=wall, begin=0.0, end=tunnel.height, start=tunnel.length),
        Surface(face=ceiling, begin=0.0, end=tunnel.length - OPEN, start=tunnel.length + tunnel.height),
    ]


def modes(robot: Climb, store: str | None = None) -> dict[str, Mode]:
    """Return a mapping from each foot to the mode in which this foot holds the robot."""
    names = {(foot, face): f"{foot}_foot{where}" for foot in FEET for face, where in PLACES.items()}
    compiled = thingc.compile(str(ROOT / "assemblies" / "minchw" / "minchw.yaml"), modes=list(names.values()), store=store).modes
    return {foot: Mode(foot, robot.held[foot], {face: compiled[names[foot, face]].robot for face in PLACES}) for foot in FEET}


def start(robot: Climb, tunnel: Tunnel) -> State:
    """Return the state in which the climb starts: on both feet on the floor, held by the rear foot."""
    floor = tunnel.faces[0]
    q = robot.legs["rear"].solve(SHORT, 0.0, 0.0, 0.0, DRAWN_UP)
    return State(q=q, feet={"front": Foothold(face=floor, distance=SHORT), "rear": Foothold(face=floor, distance=0.0)}, holds="rear")


def goal(tunnel: Tunnel) -> float:
    """Return the distance [m] along the path at which the climb planned by hand ends, measured at the midpoint between the feet."""
    front, rear = tunnel.footholds()[-2:]
    return tunnel.length + tunnel.height + tunnel.length - (front.x + rear.x) / 2


def swings(plan: Sequence[State]) -> tuple[list[Swing], list[Stance]]:
    """Return the swings of a plan, and the position of the moving sole at the end of each swing."""
    return [one.swing for one in plan if one.swing is not None], [one.feet[one.holds].above(-SINK) for one in plan[1:]]


def least_margins(by_foot: Mapping[str, Mode], tunnel: Tunnel, plan: Sequence[Swing], footholds: Sequence[Stance]) -> Margins:
    """Return the smallest static margins of the holding foot over all swings."""
    on = dict.fromkeys(FEET, tunnel.faces[0])
    found = []
    for swing, foothold in zip(plan, footholds, strict=True):
        mode = by_foot[swing.holds]
        mode.hold(Foothold(face=on[swing.holds], distance=0.0))
        found += [mode.margins(now.q) for now in swing.instants(0.05) if now.phase == "swing"]
        on[swing.moves] = min(tunnel.faces, key=lambda face: abs(face.turn - foothold.turn))
    return Margins(torque=min(one.torque for one in found), magnet=min(one.magnet for one in found))


def report_steps(plan: Sequence[State], on: Sequence[Surface]) -> str:
    """Return a text table of the footholds, and the steps whose footholds are near an edge."""
    rows, near = [f"{'step':6}{'foot':8}{'surface':10}{'at [mm]':>8}{'edge [mm]':>11}{'swing [s]':>11}"], []
    for state in plan:
        for foot in FEET if state.swing is None else [state.holds]:
            seat = state.feet[foot]
            surface = next(each for each in on if each.face == seat.face)
            edge = min(seat.distance - surface.begin, surface.end - seat.distance) - POLE
            seconds = f"{state.swing.seconds:.1f}" if state.swing is not None else "-"
            rows.append(f"{state.steps:<6}{foot:8}{seat.face.name:10}{1e3 * seat.distance:8.0f}{1e3 * edge:11.0f}{seconds:>11}")
            near += [f"step {state.steps}"] if edge < NEAR else []
    return "\n".join([*rows, f"nearer than {1e3 * NEAR:.0f} mm to an edge: {', '.join(near) or 'no foothold'}"])


def report(ways: Mapping[str, tuple[Sequence[Swing], Margins, Seen, Watch]]) -> str:
    """Return the table that compares simulated climbs, one column per climb."""
    plans, static, seen, watches = zip(*ways.values(), strict=True)
    rows = [
        ("", list(ways)),
        ("steps of a foot", [f"{len(plan)}" for plan in plans]),
        ("duration [s]", [f"{STAND + sum(swing.duration for swing in plan):.1f}" for plan in plans]),
        ("smallest static torque margin (ratio)", [f"{one.torque:.2f}" for one in static]),
        ("smallest static pull margin [N]", [f"{one.magnet:.1f}" for one in static]),
        ("smallest pull margin [N]", [newtons(PULL - one.pull) for one in seen]),
        (f"time with less than {LOW:.0f} N [ms]", [f"{1e3 * one.low:.0f}" for one in watches]),
        *outcomes(seen),
    ]
    return "\n".join(f"{name:40}" + "".join(f"{cell:>16}" for cell in cells) for name, cells in rows)


def simulate(
    robot: Climb, by_foot: Mapping[str, Mode], tunnel: Tunnel, plan: Sequence[State], film: Strip | None,
) -> dict[str, tuple[Sequence[Swing], Margins, Seen, Watch]]:
    """Simulate the plan of the planner and the plan by hand, rooted and free. Return the results for `report` by name."""
    ways = {}
    for name, (steps, footholds) in (("planned", swings(plan)), ("by hand", (tunnel.plan(robot.models), tunnel.footholds()))):
        static = least_margins(by_foot, tunnel, steps, footholds)
        for way, walk in (("rooted", robot.rooted), ("free", robot.adhering)):
            watch = Watch(film=film if (name, way) == ("planned", "rooted") else None)
            ways[f"{name}, {way}"] = (steps, static, walk(list(steps), watch, footholds), watch)
    return ways


def failed(seen: Seen) -> str | None:
    """Return the reason why a plan fails in the simulation, or None if it succeeds."""
    if seen.touches:
        return f"the plan fails in the simulation: contacts between {', '.join(sorted(seen.touches))}"
    if seen.pull > PULL:
        return f"the plan fails in the simulation: a magnet comes off in the phase `{seen.pulled}` (pull margin {PULL - seen.pull:.1f} N)"
    return None


def main() -> int:
    """Plan the climb, simulate it, and print the results. Returns 1 if the planner finds no plan, or if the plan fails in the
    simulation.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", nargs="?", type=Path, help="build folder of MInchW (default: build it)")
    parser.add_argument("--seed", type=int, default=SEED, help=f"seed of the random samples (default: {SEED})")
    parser.add_argument("--picture", type=Path, help="output file for the picture of the plan (PNG)")
    parser.add_argument("--page", type=Path, help="page whose reports are replaced (docs/studies/planning.md)")
    given = parser.parse_args()
    with built(given.build) as folder:
        robot = Climb(folder, "", TUNNEL.faces)
        planner = Planner(modes=modes(robot), surfaces=surfaces(TUNNEL), rng=np.random.default_rng(given.seed))
        try:
            plan = planner.plan(start(robot, TUNNEL), goal(TUNNEL))
        except NoPlan as reason:
            print(reason, file=sys.stderr)
            return 1
        film = Strip(TUNNEL, plan) if given.picture is not None else None
        ways = simulate(robot, planner.modes, TUNNEL, plan, film)
    texts = {"plan": report_steps(plan, planner.surfaces), "comparison": report(ways)}
    print("\n\n".join(texts.values()))
    if (failure := failed(ways["planned, rooted"][2])) is not None:
        print(failure, file=sys.stderr)
        return 1
    if film is not None:
        film.close()
        film.save_grid(given.picture)
    if given.page is not None:
        for marker, text in texts.items():
            write(given.page, marker, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
