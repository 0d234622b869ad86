"""Plan footholds and motions of MInchW over several surfaces: sample transitions between its modes, and search among them.

A state is a pose on both feet. The foot that moved last holds next. From a state, the planner samples footholds of the other foot and
pitches of the body. It keeps poses that both feet can hold alone. A best-first search visits states by the number of steps and the distance
that remains. When it visits a state, it plans the motion that leads there, with RRT-Connect.
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
"""Number of sampled poses of the leg that holds for each state, and largest number of visited states."""

RIM = POLE + 0.005
"""Smallest distance of the centre of a sole from the edges of a surface [m]."""

PRESSED = 15.0
"""Largest pull [N] of the magnet that holds by the press of a landing sole. It is large if legs are stretched across to another surface."""

SPREAD = 0.24
"""Smallest sine of the angle between the thighs in a landing."""

GAIN = 0.06
"""Distance [m] by which a step moves the middle between the feet, in the estimate of the steps that remain."""

CELL, ANGLE = 0.02, np.radians(10.0)
"""States whose footholds [m] and pitch [rad] are in the same cell count as equal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """A steel surface of a length [m], and the distance [m] from the start of the whole way to its start."""

    face: Face
    begin: float
    end: float
    start: float


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A pose on both feet, the foot that holds next, the state before it, and the swing that leads from there to here."""

    q: Array
    feet: Mapping[str, Foothold]
    holds: str
    before: State | None = None
    swing: Swing | None = None
    steps: int = 0

    def trail(self) -> list[State]:
        """Return the states from the first to this one."""
        return [*(self.before.trail() if self.before else []), self]


class NoPlan(Exception):
    """No plan was found. The text reports how far the search came, and why it went no further."""


@dataclass(slots=True, kw_only=True)
class Planner:
    """Plans a way over `surfaces` with the modes by the foot that holds."""

    modes: Mapping[str, Mode]
    surfaces: Sequence[Surface]
    rng: np.random.Generator
    refused: Counter[str] = field(default_factory=Counter)
    visited: int = 0

    def plan(self, start: State, goal: float) -> list[State]:
        """Return the states to one whose feet are both on the last surface, with their middle at least `goal` [m] along the way.

        Raises `NoPlan`.
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
        """Return sampled states in which the foot that does not hold has another foothold, and both feet could hold alone."""
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
        """Return the distance [m] of the middle between the feet along the way."""
        starts = {surface.face: surface.start for surface in self.surfaces}
        return float(np.mean([starts[foot.face] + foot.distance for foot in state.feet.values()]))

    def _refused(self, state: State) -> bool:
        """Return whether one of the feet could not hold a state alone, and count why."""
        for holds, seat in state.feet.items():
            mode = self.modes[holds]
            mode.hold(seat)
            if why := mode.refusal(state.q, [state.feet[other(holds)]]):
                self.refused[why] += 1
                return True
        return False

    def _lands(self, mode: Mode, state: State) -> bool:
        """Return whether the other foot can be pressed on without tearing off the foot that holds, and count why not."""
        if mode.spread(state.q) < SPREAD:
            self.refused["stretched legs"] += 1
            return False
        if mode.press(state.q, state.feet[mode.moves]) > PRESSED:
            self.refused["pull of the landing"] += 1
            return False
        return True

    def _with_motion(self, state: State) -> State | None:
        """Return the state with the swing that leads to it, or None if no motion was found."""
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
        """Return the cell of a state. Equal states have the same cell."""
        feet = [(state.feet[foot].face.name, round(state.feet[foot].distance / CELL)) for foot in sorted(state.feet)]
        mode = self.modes[state.holds]
        mode.hold(state.feet[state.holds])
        return (state.holds, *feet, round(mode.pitch(state.q) / ANGLE))

    def _report(self, furthest: State, goal: float) -> str:
        feet = ", ".join(f"{foot} foot on the {seat.face.name} at {1e3 * seat.distance:.0f} mm" for foot, seat in furthest.feet.items())
        why = ", ".join(f"{count} x {name}" for name, count in self.refused.most_common())
        short = 1e3 * (goal - self.progress(furthest))
        return f"no plan after {self.visited} states: the furthest is {short:.0f} mm short ({feet}). Refused: {why}"
