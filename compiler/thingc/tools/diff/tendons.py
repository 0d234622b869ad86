"""What documents state of their tendons."""

from __future__ import annotations

from thingc.model.assembly.types import Assembly, TendonStep
from thingc.tools.diff.snapshot import Fact, Value


def tendon_facts(assembly: Assembly) -> dict[str, Fact]:
    """By key (`tendons.grip.dynamics.stiffness`): the factors of its joints, its limits, dynamics and drive, as far as they are stated."""
    facts: dict[str, Fact] = {}
    for one in assembly.tendons:
        values: dict[str, Value] = {f"joints.{path}": factor for path, factor in one.moves.items()}
        values |= {f"path.{place}": _words(step) for place, step in enumerate(one.steps)} | {"width": one.width}
        values |= {f"limit.{key}": getattr(one.limit, key) for key in ("lower", "upper")}
        values |= {f"dynamics.{key}": getattr(one.dynamics, key) for key in ("damping", "friction", "armature", "stiffness", "rest")}
        values |= {f"drive.{key}": getattr(one.actuator, key, None) for key in ("kind", "kp", "kv", "effort", "velocity")}
        facts |= {f"tendons.{one.path}.{key}": Fact(value=value, span=one.origin[0]) for key, value in values.items() if value is not None}
    return facts


def _words(step: TendonStep) -> Value:
    """What a step of a path is, in a few words and numbers."""
    if step.divisor is not None:
        return step.divisor
    mounts = tuple(mount.path.replace("/", ".") for mount in (step.mount, step.side) if mount is not None)
    return mounts[0] if step.radius is None else (step.shape or "", step.radius, *mounts)
