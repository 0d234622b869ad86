"""Vary one parameter of a part at a time over its range, and check named mounts and plain selectors against the intended geometry."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import intents_arm
import intents_minchw
import intents_stock
from build123d import Location, Solid
from features import TOLERANCE, Feature, Vector, distance, is_feature, is_rim
from intents import Intent
from picks import EDGES, FACES, Lists, Pick, chosen

import arm
import minchw.body
import minchw.leg
from thingc.geometry.things.inspection import build, mounts_of, parameters_of
from thingc.geometry.things.parameters import Parameter, Value
from thingc_stock import cells, dynamixel, fasteners, magnets

PARTS: dict[str, list[tuple[Any, Callable[..., list[Intent]]]]] = {
    "arm": [
        (arm.BasePlate, intents_arm.base_plate), (arm.YawPitchBracket, intents_arm.yaw_pitch_bracket),
        (arm.RotorBrace, intents_arm.rotor_brace), (arm.OmegaCap, intents_arm.omega_cap),
        (arm.Hand, intents_arm.hand), (arm.PenDummy, intents_arm.pen_dummy),
    ],
    "MInchW": [
        (minchw.body.Chassis, intents_minchw.chassis), (minchw.body.Cover, intents_minchw.cover),
        (minchw.leg.HipBracket, intents_minchw.hip_bracket), (minchw.leg.ThighBrace, intents_minchw.thigh_brace),
        (minchw.leg.Foot, intents_minchw.foot),
    ],
    "bought": [
        (dynamixel.XM430, intents_stock.xm430), (dynamixel.XM540, intents_stock.xm540),
        (cells.Cell18650, intents_stock.cell), (cells.CellTray, intents_stock.cell_tray),
        (magnets.HoldingMagnet, intents_stock.magnet), (fasteners.Screw, intents_stock.cap_screw),
    ],
}
"""Every part of both robots, and a function that returns the intended geometry of its names."""


@dataclass(slots=True, kw_only=True)
class Result:
    """The result of the study for one part.

    `picks` contains counts by selector, class of feature and outcome. The outcomes are `same`, `another` and `fails`. `gone` contains
    counts for features that do not exist for some parameters. For these features, `fails` is the right outcome.
    """

    part: str
    members: int = 0
    refused: list[str] = field(default_factory=list)
    names: int = 0
    checks: int = 0
    wrong: list[str] = field(default_factory=list)
    picks: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    gone: Counter[tuple[str, str]] = field(default_factory=Counter)
    lasting: Counter[str] = field(default_factory=Counter)
    chosen: Counter[str] = field(default_factory=Counter)


def fault(frame: Location, intent: Intent, solid: Solid) -> str | None:
    """Return a description of the error of a name, or None if the name is right. The frame of the name must be at the intended position,
    and the solid must have the features there.

    """
    origin, z = _frame(frame)
    if distance(origin, intent.at) > TOLERANCE:
        return f"stands in {origin}, meant in {intent.at}"
    if distance(z, intent.z) > TOLERANCE:
        return f"looks along {z}, meant along {intent.z}"
    for feature in intent.features:
        if not any(is_feature(face, feature) for face in solid.faces()):
            return f"the solid has no {feature.kind} on {feature.on} along {feature.axis}"
    return None


def members(part: Any, steps: int) -> Iterator[dict[str, Value]]:
    """Yield the default parameters of a part, and then sets of parameters in which one parameter differs. A parameter takes `steps` values
    over its range.
    """
    parameters = parameters_of(part)
    default = {parameter.name: parameter.default for parameter in parameters}
    yield default
    for parameter in parameters:
        for value in _values(parameter, steps):
            if value != parameter.default:
                yield {**default, parameter.name: value}


def sweep(part: Any, table: Callable[..., list[Intent]], steps: int) -> Result:
    """Build a part with all sets of parameters, and check its names and plain selectors.

    Raises `ValueError` if the table of intended geometry is wrong. Each mount must have a row, and a hole with a `rim` must open in a
    circle at the default parameters.
    """
    result = Result(part=part.__name__)
    names: dict[str, Intent] = {}
    picks: list[tuple[str, Pick, str, bool]] = []
    failed: set[int] = set()
    for parameters in members(part, steps):
        shown = ", ".join(f"{name}={value}" for name, value in parameters.items())
        try:
            thing = build(part, parameters)
        except (AssertionError, ValueError) as error:
            result.refused.append(f"{part.__name__}({shown}): {error}")
            continue
        rows = {intent.name: intent for intent in table(**parameters)}
        unknown = mounts_of(thing).keys() - rows.keys() - {"origin"}
        if unknown:
            raise ValueError(f"no intent is written for {sorted(unknown)} of {part.__name__}")
        solid = thing.result()
        result.members += 1
        for intent in rows.values():
            result.checks += 1
            problem = fault(intent.frame(thing), intent, solid)
            if problem:
                result.wrong.append(f"{part.__name__}({shown}).{intent.name}: {problem}")
        lists = Lists(solid)
        if not names:
            names = rows
            result.names = len(rows)
            picks = list(_picks(part.__name__, rows, lists))
            result.chosen.update(pick.selector for _, pick, _, _ in picks)
            continue
        for name in names.keys() - rows.keys():
            result.gone["name", _reads(names[name], thing)] += 1
        for number, (name, pick, group, edge) in enumerate(picks):
            try:
                item = pick.of(lists)
            except IndexError:
                outcome = "fails"
            else:
                feature = rows[name].features[0] if name in rows else None
                outcome = "same" if feature and (is_rim if edge else is_feature)(item, feature) else "another"
            if name not in rows:
                result.gone[pick.selector, outcome] += 1
                continue
            result.picks[pick.selector, group, outcome] += 1
            if outcome != "same":
                failed.add(number)
    result.lasting.update(pick.selector for number, (_, pick, _, _) in enumerate(picks) if number not in failed)
    return result


def _picks(part: str, rows: dict[str, Intent], lists: Lists) -> Iterator[tuple[str, Pick, str, bool]]:
    """Yield one item for each name and selector: the name, the selector with its arguments, the class of the feature, and whether the
    selector finds edges.
    """
    for intent in rows.values():
        feature = intent.features[0]
        group = _class(feature, lists)
        for selector in FACES:
            pick = chosen(selector, lists, feature, lambda face, f=feature: is_feature(face, f))
            if pick:
                yield intent.name, pick, group, False
        if feature.rim is None:
            continue
        for selector in EDGES:
            pick = chosen(selector, lists, feature, lambda edge, f=feature: is_rim(edge, f))
            if pick is None:
                raise ValueError(f"the hole of `{intent.name}` of {part} opens in no circle at {feature.rim}")
            yield intent.name, pick, group, True


def _class(feature: Feature, lists: Lists) -> str:
    """Return the class of a feature: `outermost plane`, `inner plane`, `hole` or `other surface`. A plane is outermost if no point of the
    solid is farther out.
    """
    if feature.kind != "plane":
        return "hole" if feature.kind == "hole" else "other surface"
    box = lists.solid.bounding_box()
    corner = [(box.max if axis > 0.5 else box.min) for axis in feature.axis]
    reach = sum(component * value for component, value in zip(feature.axis, (corner[0].X, corner[1].Y, corner[2].Z)))
    level = sum(component * value for component, value in zip(feature.axis, feature.on))
    return "outermost plane" if abs(reach - level) < 1e-4 else "inner plane"


def _reads(intent: Intent, thing: Any) -> str:
    """Return the outcome of reading a name whose feature does not exist for these parameters: `fails` or `another`."""
    try:
        intent.frame(thing)
    except (AttributeError, IndexError):
        return "fails"
    return "another"


def _values(parameter: Parameter, steps: int) -> Iterator[Value]:
    if parameter.kind == "flag":
        yield from (False, True)
    elif parameter.kind == "choice":
        yield from parameter.choices
    elif parameter.minimum is None or parameter.maximum is None:
        raise ValueError(f"`{parameter.name}` has no range to sweep")
    elif parameter.kind == "count":
        yield from range(int(parameter.minimum), int(parameter.maximum) + 1)
    else:
        low, high = parameter.minimum, parameter.maximum
        yield from (low + (high - low) * step / (steps - 1) for step in range(steps))


def _frame(location: Location) -> tuple[Vector, Vector]:
    position = location.position
    z = location.z_axis.direction
    return (position.X, position.Y, position.Z), (z.X, z.Y, z.Z)
