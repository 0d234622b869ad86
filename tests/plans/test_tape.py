"""A recorded operation gives the same results as the operation itself for any numbers, or else its guards reject the numbers."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest

from thingc.base.inertia import MassProperties, physical_fault, principal_moments, total
from thingc.base.numeric import dist, hypot, isfinite, maximum, minimum, round_significant
from thingc.base.pose import make_pose, quarter_exact, turned_about
from thingc.base.safe_text import format_cell
from thingc.batch.plans.program import program_of
from thingc.batch.plans.tape import SLOT, Tape, variables_of
from thingc.targets import json_writer
from thingc.targets.xml_writer import Element, write


def moved(mass: Any, x: Any, angle: Any) -> tuple[Any, ...]:
    """Apply many of the operations that compiler passes use."""
    pose = make_pose((x, 0.1, 0.2), (angle, 0.3, 0.0))
    body = MassProperties(mass=mass, centre=(0.1, x, 0.0), inertia=((0.01, 0.0, 0.001), (0.0, 0.02, 0.0), (0.001, 0.0, 0.015)))
    whole = total([body.seen_from(pose), body.with_mass(mass * 2.0)])
    turn = turned_about((0.0, 0.6, 0.8), angle)
    return (
        whole.mass, *whole.centre, *(one for row in whole.inertia for one in row), *principal_moments(whole.inertia), *pose.quaternion(),
        *turn[1], dist((x, 0.0), (0.0, mass)), hypot(angle), maximum(x, 0.05), minimum([mass, x, 0.2]), x if x > 0.05 else 0.05,
        abs(-x) ** 2, x % 0.07, round_significant(mass * x, 3), round(x, 2),
    )


def test_tape_gives_the_same_bits() -> None:
    tape = Tape()
    variables = [tape.variable(value) for value in (1.2, 0.3, 0.4)]
    outputs = moved(*variables)
    run = program_of(tape, outputs).run
    source, given = random.Random(1), 0
    for _ in range(200):
        values = (source.uniform(0.1, 3.0), source.uniform(0.01, 0.5), source.uniform(-1.0, 1.0))
        found = run(*values)
        if found is not None:
            given += 1
            assert found == moved(*values)
    assert 100 < given < 200  # where x is small another branch would have been taken
    assert math.sin is not None and quarter_exact(math.pi) == (-1.0, 0.0) and physical_fault(((1, 0, 0), (0, 1, 0), (0, 0, 1))) is None


def test_reading_a_value_makes_it_constant() -> None:
    tape = Tape()
    a, b = tape.variable(2.5), tape.variable(7.0)
    assert [10.0, 20.0, 30.0][int(a)] == 30.0 and isfinite(b)
    answer = a * b + float(b - a)
    assert [variables_of(tape, one) for one in tape.pinned] == [[0], [0, 1]]
    run = program_of(tape, (answer, 1.5)).run
    assert run(2.5, 7.0) == (22.0, 1.5)
    assert run(2.6, 7.0) is None and run(2.5, 8.0) is None


def test_decisions_become_guards() -> None:
    tape = Tape()
    a = tape.variable(2.0)
    answer = a * 3.0 if a > 1.0 and a else a
    run = program_of(tape, (answer,)).run
    assert run(1.5) == (4.5,) and run(0.5) is None
    with pytest.raises(TypeError):
        range(a)  # type: ignore[call-overload]


def test_maximum_is_not_a_decision() -> None:
    tape = Tape()
    a, b = tape.variable(2.0), tape.variable(3.0)
    answers = (maximum(a, b, 1.0), minimum([a, b]), maximum((a,)), minimum(4, 5), maximum([], default=7))
    assert answers[2:] == (a, 4, 7) and tape.guards == []
    assert program_of(tape, answers).run(5.0, 4.0) == (5.0, 4.0, 5.0, 4, 7)


def test_slots_survive_every_format() -> None:
    number = Tape().variable(0.25)
    root = Element(tag="body", attributes={"pos": (number, 1.0), "mass": number})
    number.tape.writing = True
    texts = (write(root, "test").text, json_writer.encode({"mass": number, "what": f"{number:.3g} kg"}).decode(), format_cell(number))
    assert [SLOT.findall(text) for text in texts] == [["0:xml", "0:xml"], ["0:json", "0::.3g"], ["0:csv"]]
