"""Adapt MJCF models to the additional programs that the option `compat` lists.

A model is only adapted to a program if the change does not affect other readers. If the program still does not support a feature, a warning
is reported.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from thingc.base.diagnostics import Code, Report
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.mjcf.compat.consumer import Consumer, Refusal
from thingc.targets.mjcf.compat.drake import DRAKE
from thingc.targets.mjcf.compat.mjx import MJX
from thingc.targets.mjcf.compat.pymjcf import PYMJCF, SEPARATOR
from thingc.targets.mjcf.compat.warp import WARP
from thingc.targets.xml_writer import Element

CONSUMERS: tuple[Consumer, ...] = (MJX, WARP, DRAKE, PYMJCF)
"""The consumers, in the order in which models are adapted to them. Names are changed last, by the last consumer."""


def separator(names: Collection[str]) -> str:
    """Return the path separator that the given consumers require in the names of a model."""
    return SEPARATOR if PYMJCF.name in names else "/"


def adapt_models(
    names: Collection[str], robots: Sequence[Robot], roots: Sequence[Element], report: Report,
) -> tuple[list[Element], dict[Loss, None]]:
    """Adapt the MJCF models of all modes to the named consumers. Return the adapted models and the resulting export losses.

    Report a warning for each feature that one of the consumers still rejects.
    """
    losses: dict[Loss, None] = {}
    refused: dict[tuple[str, Refusal], list[str]] = {}
    adapted = [root.copy() for root in roots] if names else list(roots)
    for consumer in CONSUMERS:
        for robot, root in zip(robots, adapted, strict=True) if consumer.name in names else ():
            losses |= dict.fromkeys(consumer.adapt(robot, root))
            for refusal in dict.fromkeys(consumer.find_refusals(robot, root)):
                refused.setdefault((consumer.label, refusal), []).append(robot.mode.name)
    for (label, refusal), modes in refused.items():
        which = f"mode{'' if len(modes) == 1 else 's'} {', '.join(f'`{mode}`' for mode in modes)}"
        message = f"{label} cannot load {which}: {refusal.what}"
        report.warn(Code.COMPAT, message, refusal.origin, path=refusal.path, help=refusal.hint, allow=True)
    return adapted, losses
