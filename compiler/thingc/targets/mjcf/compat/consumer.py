"""Describe the programs besides MuJoCo that read MJCF, and the options of MuJoCo that they do not support."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.xml_writer import Element


class Refusal(FrozenStruct):
    """The reason why a consumer rejects a model, if the model cannot be adapted without affecting other readers.

    `what` is the reason, as a text that follows a colon. `origin` and `path` are the location of the cause, and `hint` is the help text.
    """

    what: str
    origin: Origin
    path: str
    hint: str


class Consumer(FrozenStruct):
    """A program that reads MJCF. `name` is its name in `compat`, `label` is its display name, and `version` is the version that was
    examined.

    The function `suit` adapts the tree of a model, and yields the differences from the document as losses. No other consumer uses this
    tree. The function `refuses` yields every feature that the consumer still does not support. By default, both yield nothing.
    """

    name: str
    label: str
    version: str
    suit: Callable[[Robot, Element], Iterable[Loss]] = lambda robot, root: ()
    refuses: Callable[[Robot, Element], Iterable[Refusal]] = lambda robot, root: ()


class UnsupportedOptions(FrozenStruct):
    """Options that a consumer does not support. Such options are solvers, and flags that must not be enabled or disabled, by their names in
    MJCF.

    These options are only in a model if raw attributes set them.
    """

    solvers: Collection[str] = ()
    enabled: Collection[str] = ()
    disabled: Collection[str] = ()

    def refusals(self, root: Element) -> Iterator[Refusal]:
        """Yield a refusal for each option of a model that the consumer does not support."""
        option = root.find_or_empty("option")
        yield from _refusals(option, {"solver": dict.fromkeys(self.solvers, "")})
        on = {name: {"enable": "enabled"} for name in self.enabled}
        yield from _refusals(option.find_or_empty("flag"), {**on, **{name: {"disable": "disabled"} for name in self.disabled}})


def _refusals(element: Element, lacking: Mapping[str, Mapping[str, str]]) -> Iterator[Refusal]:
    for name, values in lacking.items():
        value = element.get(name, "")
        if value in values:
            raw = element.raw.get(name)
            option = f"`{name}` `{value}`" if element.tag == "option" else f"the {values[value]} flag `{name}`"
            yield Refusal(
                what=f"it does not support {option}", origin=raw.attribute.origin if raw else element.origin, path=name,
                hint=f"remove `{name}`",
            )
