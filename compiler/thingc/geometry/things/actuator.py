"""The limits and gains of a motor, from its data sheet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, TypeAlias

Stated: TypeAlias = "float | tuple[float, str] | None"
SOURCES = ("measured", "vendor", "estimated", "stated")
"""The valid sources of a number, such as `measured` or `vendor`. A number without a source has the source `stated`."""


@dataclass(frozen=True, slots=True, kw_only=True, init=False)
class Actuator:
    """An actuator at its output shaft, in SI units.

    `kind` is `position`, `velocity` or `motor`. The units are [N m] for `stall_torque` (linear: [N]) and [rad/s] for `no_load_speed`
    (linear: [m/s]). `gear_ratio` is in motor turns per output turn. `rotor_inertia` [kg m^2] is the inertia of the rotor before the gear.
    The gains are `kp` [N m/rad] and `kv` [N m s/rad].

    Each number may be a pair `(value, source)` with the source `measured`, `vendor` or `estimated`. The attribute `sources` contains the
    sources by name. Raises `ValueError` for an unknown kind or source, and for a number that is not finite or not positive. Only
    `rotor_inertia`, `kp` and `kv` may be 0.
    """

    kind: Literal["position", "velocity", "motor"]
    stall_torque: float | None
    no_load_speed: float | None
    gear_ratio: float
    rotor_inertia: float | None
    kp: float | None
    kv: float | None
    sources: Mapping[str, str] = field(compare=True, hash=False)

    def __init__(
        self, *, kind: Literal["position", "velocity", "motor"], stall_torque: Stated = None, no_load_speed: Stated = None,
        gear_ratio: float | tuple[float, str] = 1.0, rotor_inertia: Stated = None, kp: Stated = None, kv: Stated = None,
    ) -> None:
        if kind not in ("position", "velocity", "motor"):
            raise ValueError(f"the kind of an Actuator must be 'position', 'velocity' or 'motor', found {kind!r}")
        object.__setattr__(self, "kind", kind)
        sources: dict[str, str] = {}
        numbers = {
            "stall_torque": stall_torque, "no_load_speed": no_load_speed, "gear_ratio": gear_ratio,
            "rotor_inertia": rotor_inertia, "kp": kp, "kv": kv,
        }
        for name, stated in numbers.items():
            if isinstance(stated, tuple):
                stated, sources[name] = check_sourced(f"`{name}` of an Actuator", stated)
            object.__setattr__(self, name, _check_number(name, stated))
        object.__setattr__(self, "sources", MappingProxyType(sources))

    @property
    def armature(self) -> float | None:
        """Rotor inertia at the output [kg m^2]: rotor inertia times the square of the gear ratio. The value is None if the inertia or the
        gear ratio is unknown.
        """
        return None if self.rotor_inertia is None else self.rotor_inertia * self.gear_ratio * self.gear_ratio


def check_sourced(what: str, pair: tuple[object, ...]) -> tuple[float, str]:
    """Check that a tuple is a pair of a number and its source, and return the pair. Raises `ValueError` for any other tuple."""
    if len(pair) != 2 or not isinstance(pair[1], str):
        raise ValueError(f"{what} must be a number or (number, source), found {pair!r}")
    value, source = pair
    if source not in SOURCES:
        raise ValueError(f"the source of {what} must be one of {', '.join(map(repr, SOURCES))}, found {source!r}")
    return value, source  # type: ignore[return-value]


def _check_number(name: str, value: object) -> float | None:
    if value is None and name != "gear_ratio":
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"`{name}` of an Actuator must be a finite number, found {value!r}")
    if value < 0 or (value == 0 and name in ("stall_torque", "no_load_speed", "gear_ratio")):
        bound = "positive" if name in ("stall_torque", "no_load_speed", "gear_ratio") else "at least 0"
        raise ValueError(f"`{name}` of an Actuator must be {bound}, found {value!r}")
    return float(value)
