"""Plan footholds and motions of MInchW over several surfaces. The planner samples transitions between the modes of the robot, and searches
for a sequence of transitions.

A state of the search is a pose of the robot on both feet. The feet alternate: the foot that moved last holds in the next step. From each
state, the planner samples footholds of the moving foot and pitches of the body. The planner keeps a sampled pose only if each foot could
hold the robot alone. A best-first search orders states by the number of steps so far and the remaining distance. When the search visits a
state, it plans the motion to this state with RRT-Connect.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from inchworm_gait import Array, Swing, other
from inchworm_modes import MOVING, Foothold, Mode
from inchworm_physics import POLE, Face

SAMPLES, VISITS = 500, 400
"""Number of poses of the holding leg that are sampled in each state, and maximum number of states that are visited."""

RIM = POLE + 0.005
"""Smallest allowed distance [m] from the centre of a sole to the edges of a surface."""

PRESSED = 15.0
"""Largest allowed pull [N] on the holding magnet when the other sole lands and is pressed against the steel. This pull is large if the legs
are stretched.
"""

SPREAD = 0.24
"""Smallest allowed sine of the angle between the thighs at a landing."""

GAIN = 0.06
"""Distance [m] by which one step moves the midpoint between the feet. The search uses this value to estimate the number of remaining
steps.
"""

CELL, ANGLE = 0.02, np.radians(10.0)
"""Cell sizes for footholds [m] and for the pitch of the body [rad]. The search visits at most one state per cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """A steel surface with two edges, given as distances [m] along the surface. `start` is the distance [m] along the whole path at which
    the surface begins.
    """

    face: Face
    begin: float
    end: float
    start: float


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A pose on both feet, and the foot that holds the robot in the next step. `before` is the previous state, and `swing` is the motion
    from the previous state to this one.
    """

    q: Array
    feet: Mapping[str, Foothold]
    holds: str
    before: State | None = None
    swing: Swing | None = None
    steps: int = 0

    def trail(self) -> list[State]:
        """Return all states from the start to this state."""
        return [*(self.before.trail() if self.before else []), self]


class NoPlan(Exception):
    """Raised if the planner does not find a plan. The message contains the state nearest to the goal, and the reasons for which states were
    refused.
    """


@dataclass(slots=True, kw_only=True)
class Planner:
    """Plans a path over `surfaces`. `modes` maps each foot to the mode in which this foot holds the robot."""

    modes: Mapping[str, Mode]
    surfaces: Sequence[Surface]
    rng: np.random.Generator
    refused: Counter[str] = field(default_factory=Counter)
    visited: int = 0

    def plan(self, start: State, goal: float) -> list[State]:
        """Return the states of a plan to a state with both feet on the last surface. On the last surface, the midpoint between the feet
        must be at least `goal` [m] along the path.

        Raises `NoPlan` if the search does not find such a state.
        """
        queue, closed, furthest = [(0.0, 0, start)], {self._cell(start)}, start
        while queue and self.visited < VISITS:
            *_, state = heapq.heappop(queue)
            reached = self._with_motion(state)
            if reached is None:
                continue
            self.visited += 1
            furthest = max(furthest, reached, key=self.progress)
            if self.progress(reached) >= goal and all(foot.face == self.surfaces[-1].face for foot in reached.feet.values()):
                return reached.trail()
            for child in self.transitions(reached):
                if (cell := self._cell(child)) not in closed:
                    closed.add(cell)
                    cost = child.steps + max(goal - self.progress(child), 0.0) / GAIN
                    heapq.heappush(queue, (cost, len(closed), child))
        raise NoPlan(self._report(furthest, goal))

    def transitions(self, state: State) -> list[State]:
        """Return sampled states in which the moving foot has a new foothold and each foot could hold the robot alone."""
        mode, moves, found = self.modes[state.holds], other(state.holds), []
        held = state.feet[state.holds]
        mode.hold(held)
        for _ in range(SAMPLES):
            surface = self.surfaces[int(self.rng.integers(len(self.surfaces)))]
            for q, distance in mode.on(surface.face, self.rng.uniform(mode.lower, mode.upper) * MOVING):
                seat = Foothold(face=surface.face, distance=distance)
                feet = {state.holds: held, moves: seat}
                child = State(q=q, feet=feet, holds=moves, before=state, steps=state.steps + 1)
                if surface.begin + RIM <= distance <= surface.end - RIM and not self._refused(child) and self._lands(mode, child):
                    found.append(child)
        return found

    def progress(self, state: State) -> float:
        """Return the distance [m] of the midpoint between the feet along the path."""
        starts = {surface.face: surface.start for surface in self.surfaces}
        return float(np.mean([starts[foot.face] + foot.distance for foot in state.feet.values()]))

    def _refused(self, state: State) -> bool:
        """Return whether one of the feet could not hold the robot alone in a state. Count the reason in `refused`."""
        for holds, seat in state.feet.items():
            mode = self.modes[holds]
            mode.hold(seat)
            if why := mode.refusal(state.q, [state.feet[other(holds)]]):
                self.refused[why] += 1
                return True
        return False

    def _lands(self, mode: Mode, state: State) -> bool:
        """Return whether the moving foot can be pressed against the steel without detaching the holding foot. If the answer is False, count
        the reason in `refused`.
        """
        if mode.spread(state.q) < SPREAD:
            self.refused["stretched legs"] += 1
            return False
        if mode.press(state.q, state.feet[mode.moves]) > PRESSED:
            self.refused["pull of the landing"] += 1
            return False
        return True

    def _with_motion(self, state: State) -> State | None:
        """Return a copy of the state with the swing to this state, or None if the planner finds no motion."""
        if state.before is None:
            if self._refused(state):
                raise NoPlan(f"no plan: the start is not allowed ({next(iter(self.refused))})")
            return state
        mode, before = self.modes[state.before.holds], state.before
        mode.hold(before.feet[before.holds])
        swing = mode.motion(before.q, state.q, (before.feet[mode.moves], state.feet[mode.moves]), self.rng)
        if swing is None:
            self.refused["no motion"] += 1
            return None
        return replace(state, swing=swing)

    def _cell(self, state: State) -> tuple[object, ...]:
        """Return a key of the state for the set of visited states. States with almost equal footholds and pitch have the same key."""
        feet = [(state.feet[foot].face.name, round(state.feet[foot].distance / CELL)) for foot in sorted(state.feet)]
        mode = self.modes[state.holds]
        mode.hold(state.feet[state.holds])
        return (state.holds, *feet, round(mode.pitch(state.q) / ANGLE))

    def _report(self, furthest: State, goal: float) -> str:
        feet = ", ".join(f"{foot} foot on the {seat.face.name} at {1e3 * seat.distance:.0f} mm" for foot, seat in furthest.feet.items())
        why = ", ".join(f"{count} x {name}" for name, count in self.refused.most_common())
        short = 1e3 * (goal - self.progress(furthest))
        return f"no plan after {self.visited} states: the furthest is {short:.0f} mm short ({feet}). Refused: {why}"
