"""What a program that reads MJCF besides MuJoCo is to us, and which of MuJoCo's options it lacks."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.xml_writer import Element


class Refusal(FrozenStruct):
    """What a consumer refuses a model for, and nothing harmless can be done about: `what` it is, in words that follow a colon; the
    `origin` of what is to blame, its `path` there, and a hint."""

    what: str
    origin: Origin
    path: str
    hint: str


class Consumer(FrozenStruct):
    """A program that reads MJCF: its `name` in `compat`, what people call it, and the version of which this was found out.

    `suit` changes the tree of a mode's model, which is this consumer's alone, where that does no harm, so that it is read: what
    then is not as the document has it is a loss. `refuses` is what it will refuse of the tree all the same.
    """

    name: str
    label: str
    version: str
    suit: Callable[[Robot, Element], Iterator[Loss]]
    refuses: Callable[[Robot, Element], Iterator[Refusal]]


def nothing_lost(robot: Robot, root: Element) -> Iterator[Loss]:
    """Of a consumer for which nothing has to be changed."""
    yield from ()


def nothing_refused(robot: Robot, root: Element) -> Iterator[Refusal]:
    """Of a consumer that refuses nothing which we write."""
    yield from ()


class UnsupportedOptions(FrozenStruct):
    """Solvers that a consumer lacks, and flags that it refuses to have enabled, or disabled, all as MJCF calls them. They come from raw
    attributes alone."""

    solvers: Collection[str] = ()
    enabled: Collection[str] = ()
    disabled: Collection[str] = ()

    def refusals(self, root: Element) -> Iterator[Refusal]:
        """What of the options is refused."""
        option = root.find("option")
        if option is None:
            return
        yield from _refusals(option, {"solver": dict.fromkeys(self.solvers, "")})
        flag = option.find("flag")
        if flag is not None:
            on = {name: {"enable": "enabled"} for name in self.enabled}
            yield from _refusals(flag, {**on, **{name: {"disable": "disabled"} for name in self.disabled}})


def _refusals(element: Element, lacking: Mapping[str, Mapping[str, str]]) -> Iterator[Refusal]:
    for name, values in lacking.items():
        value = element.get(name, "")
        if value in values:
            raw = element.raw.get(name)
            what = f"it has no `{name}` `{value}`" if element.tag == "option" else f"it has no `{name}` that is {values[value]}"
            yield Refusal(what=what, origin=raw.attribute.origin if raw else element.origin, path=name, hint=f"leave `{name}` out")
