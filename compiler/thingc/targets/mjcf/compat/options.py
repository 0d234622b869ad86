"""What a consumer cannot of MuJoCo's `<option>`. Solvers and flags come from raw attributes alone."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.targets.mjcf.compat.consumer import Refusal
from thingc.targets.xml_writer import Element


class UnsupportedOptions(FrozenStruct):
    """Solvers that a consumer lacks, and flags that it refuses to have enabled, or disabled, all as MJCF calls them."""

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
