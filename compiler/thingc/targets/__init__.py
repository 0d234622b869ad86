"""The output formats of thingc, called targets. This package also exports the API for emitters in other packages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import getattr_of

if TYPE_CHECKING:
    from thingc.targets.artifact import Artifacts, Loss
    from thingc.targets.capabilities import Capabilities
    from thingc.targets.request import EmitRequest

__all__ = ["Artifacts", "Capabilities", "EmitRequest", "Loss"]

__getattr__ = getattr_of(__name__, {"Artifacts": "artifact", "Loss": "artifact", "Capabilities": "capabilities", "EmitRequest": "request"})
