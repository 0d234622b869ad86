"""Models of the interface of a mount in a document. Field docstrings are the hover text of an editor."""

import re
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from thingc.base.interfaces import THREAD
from thingc.documents.spec.base import Model, optional, require_with, rule
from thingc.documents.spec.fields import AngleField, CountField, LengthField, text_field

ThreadField = Annotated[str, text_field(re.compile(THREAD).fullmatch, "the name of a thread", "M3", {"pattern": THREAD})]
PairField = Annotated[list[LengthField], Field(min_length=2, max_length=2)]


class BoltsSpec(Model):
    """Holes for screws, parallel to the z axis of the mount: one at its origin, several on a circle, or at any positions."""

    thread: ThreadField = Field(examples=["M3"])
    """Thread of the screws: `M3`."""
    count: CountField | None = optional(4)
    """Number of holes on the circle; default: 1."""
    circle: LengthField | None = None
    """Diameter of the circle through the centres of the holes."""
    start: AngleField | None = None
    """Angle of the first hole on the circle, from x towards y; default: 0."""
    at: Annotated[list[PairField], Field(min_length=1)] | None = optional([["8 mm", "6 mm"], ["-8 mm", "6 mm"]])
    """Positions of the holes along x and y, in place of `count` and `circle`."""
    depth: LengthField | None = None
    """Depth of a threaded hole; default: a clearance hole."""
    hole: LengthField | None = None
    """Diameter of the holes; default: any diameter that suits the thread."""


class BoreSpec(Model):
    """A round hole along the z axis of the mount."""

    diameter: LengthField
    """Diameter of the hole."""
    depth: LengthField | None = None
    """Depth of the hole; default: a through hole."""
    clearance: PairField | None = optional(["0.05 mm", "0.2 mm"])
    """Smallest and largest difference between the diameters of bore and boss; default: at least 0."""


class BossSpec(Model):
    """A cylinder along the z axis of the mount, such as a shaft."""

    diameter: LengthField
    """Diameter of the cylinder."""
    length: LengthField | None = None
    """Length above the mount; default: unknown."""
    clearance: PairField | None = optional(["0.05 mm", "0.2 mm"])
    """Smallest and largest difference between the diameters of bore and boss; default: at least 0."""


class ShankSpec(Model):
    """The shank of a screw along the z axis of the mount."""

    thread: ThreadField = Field(examples=["M3"])
    """Thread of the screw: `M3`."""
    length: LengthField
    """Length of the screw below its head."""


class InterfaceSpec(Model):
    """The mating features of a mount. Two mounts that meet must fit together."""

    model_config = ConfigDict(json_schema_extra={
        "minProperties": 1, "dependentRequired": {"side": ["connector"], "counterpart": ["connector"]},
    })

    name: str | None = optional("x430-horn")
    """Name of the interface, which is not checked."""
    bolts: BoltsSpec | None = optional({"thread": "M3", "count": 4, "circle": "20 mm", "start": "45 deg"})
    """Holes for screws."""
    bore: BoreSpec | None = optional({"diameter": "6.1 mm", "clearance": ["0.05 mm", "0.2 mm"]})
    """A round hole."""
    boss: BossSpec | None = optional({"diameter": "6 mm", "length": "8 mm"})
    """A cylinder, such as a shaft."""
    shank: ShankSpec | None = optional({"thread": "M3", "length": "12 mm"})
    """The shank of a screw."""
    connector: str | None = Field(default=None, min_length=1, examples=["JST-PH-2"])
    """Name of a connector."""
    side: Literal["plug", "socket"] | None = None
    """Side of the connector; default: a connector without sides."""
    counterpart: str | None = Field(default=None, min_length=1, examples=["B2B-PH-K"])
    """Name of the mating connector; default: the same name."""

    def _check_rules(self) -> None:
        if not self.model_fields_set:
            raise rule("an interface must have at least one feature", "write, for example, `bolts: {thread: M3, count: 4, circle: 20 mm}`")
        for key in ("side", "counterpart"):
            require_with(self, key, "connector", "add `connector` with the name of the connector")
