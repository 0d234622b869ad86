"""Targets: one module or folder for each format that a build writes. What emitters of other packages need is exported here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import exported

if TYPE_CHECKING:
    from thingc.targets.artifact import Artifacts as Artifacts
    from thingc.targets.artifact import Loss as Loss
    from thingc.targets.capabilities import Capabilities as Capabilities
    from thingc.targets.request import EmitRequest as EmitRequest

__getattr__ = exported(
    __name__, {"Artifacts": "artifact", "Loss": "artifact", "Capabilities": "capabilities", "EmitRequest": "request"},
)
