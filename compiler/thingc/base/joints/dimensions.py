"""The dimensions of what is written of a coordinate: of one that turns, and of one that slides."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.units import (
    ANGLE,
    ANGULAR_DAMPING,
    ANGULAR_STIFFNESS,
    ANGULAR_VELOCITY,
    FORCE,
    INERTIA,
    LENGTH,
    LINEAR_DAMPING,
    LINEAR_STIFFNESS,
    MASS,
    TORQUE,
    VELOCITY,
    Dimension,
)

TURN: Mapping[str, Dimension] = {
    "lower": ANGLE, "upper": ANGLE, "offset": ANGLE, "kp": ANGULAR_STIFFNESS, "kv": ANGULAR_DAMPING, "effort": TORQUE,
    "velocity": ANGULAR_VELOCITY, "damping": ANGULAR_DAMPING, "friction": TORQUE, "armature": INERTIA, "stiffness": ANGULAR_STIFFNESS,
    "rest": ANGLE,
}
"""The dimension of every value of a coordinate that turns, by its key."""
SLIDE: Mapping[str, Dimension] = {
    "lower": LENGTH, "upper": LENGTH, "offset": LENGTH, "kp": LINEAR_STIFFNESS, "kv": LINEAR_DAMPING, "effort": FORCE,
    "velocity": VELOCITY, "damping": LINEAR_DAMPING, "friction": FORCE, "armature": MASS, "stiffness": LINEAR_STIFFNESS,
    "rest": LENGTH,
}
"""The same of one that slides."""


def dimensions_of(coordinate: Dimension) -> Mapping[str, Dimension]:
    """The dimension of every value of a coordinate with this dimension, by key."""
    return TURN if coordinate == ANGLE else SLIDE
