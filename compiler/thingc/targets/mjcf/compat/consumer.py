"""Describe the programs besides MuJoCo that read MJCF, and the options of MuJoCo that they do not support."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.xml_writer import Element


class Refusal(FrozenStruct):
    """The reason why a program cannot read a model. No change of the model would help without an effect on other programs.

    `what` is the reason, as a text that follows a colon. `origin` and `path` are the location of the cause, and `hint` is the help text.
    """

    what: str
    origin: Origin
    path: str
    hint: str


class Consumer(FrozenStruct):
    """A program that reads MJCF. `name` is its name in `compat`, `label` is its display name, and `version` is the version that was
    examined.

    `adapt(robot, root)` changes the MJCF tree `root` of a mode, and yields the differences from the document as export losses. Then
    `find_refusals(robot, root)` yields the features that the consumer still does not support. By default, both yield nothing.
    """

    name: str
    label: str
    version: str
    adapt: Callable[[Robot, Element], Iterable[Loss]] = lambda robot, root: ()
    find_refusals: Callable[[Robot, Element], Iterable[Refusal]] = lambda robot, root: ()


class UnsupportedOptions(FrozenStruct):
    """Options that a consumer does not support: solvers, and flags that must not be enabled or disabled, by their names in MJCF.

    A model contains these options only if raw attributes set them.
    """

    solvers: Collection[str] = ()
    enabled: Collection[str] = ()
    disabled: Collection[str] = ()

    def refusals(self, root: Element) -> Iterator[Refusal]:
        """Yield a refusal for each option of a model that the consumer does not support."""
        option = root.find_or_empty("option")
        flag = option.find_or_empty("flag")
        for element, name, value, words in (
            *((option, "solver", solver, f"`solver: {solver}`") for solver in self.solvers),
            *((flag, name, "enable", f"the enabled flag `{name}`") for name in self.enabled),
            *((flag, name, "disable", f"the disabled flag `{name}`") for name in self.disabled),
        ):
            if element.get(name) == value:
                raw = element.raw.get(name)
                origin = raw.attribute.origin if raw else element.origin
                yield Refusal(what=f"{words} is not supported", origin=origin, path=name, hint=f"remove `{name}`")
