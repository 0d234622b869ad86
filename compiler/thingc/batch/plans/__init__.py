"""Plans: what compilations make of settings, worked out again for other numbers without a compilation. `Builds` gives whole builds so."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import exported

if TYPE_CHECKING:
    from thingc.batch.plans.builds import Build, Builds

__all__ = ["Build", "Builds"]

__getattr__ = exported(__name__, {"Build": "builds", "Builds": "builds"})
