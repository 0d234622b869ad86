"""One change of a robot: what it is of, how it changed, and which changes caused it."""

from __future__ import annotations

from typing import Literal, Union, get_args

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.source import Span

What = Literal[
    "component", "joint", "mate", "parameter", "mode", "pose", "material", "sensor", "test", "mass", "geometry", "mount", "bom", "file",
]
WHATS: tuple[What, ...] = get_args(What)
"""What a change may be of, the most important first where they are told."""

How = Literal["added", "removed", "renamed", "moved", "changed"]
_BACKWARD: dict[How, How] = {"added": "removed", "removed": "added"}

DisplayValue = Union[None, bool, int, float, str, tuple["DisplayValue", ...]]
"""A value as an answer tells it: SI, names as documents write them."""

PERHAPS = "perhaps"
"""What `because` has of a match that is doubtful."""


class Change(OneLineRepr, FrozenStruct):
    """`path` is the occurrence, joint, mode, ... in the old robot (of what is added in the new one), `new_path` in the new one where it is
    called otherwise there. `field` is the key whose value was `old` and is `new` (SI; `words` both for people, where their dimension is
    known). `because` are paths of the changes that caused it: empty for what somebody changed himself. `reason` says by what
    something renamed was known, and a match that is doubtful has `perhaps` among its causes. `span` is where the new robot says it, of
    what is removed the old one."""

    what: What
    change: How
    path: str
    new_path: str | None = None
    field: str | None = None
    old: DisplayValue = None
    new: DisplayValue = None
    because: tuple[str, ...] = ()
    reason: str = ""
    words: tuple[str, str] | None = None
    span: Span | None = None

    @property
    def caused(self) -> bool:
        """Whether it is the consequence of other changes."""
        return any(word != PERHAPS for word in self.because)

    @property
    def backward(self) -> Change:
        """The same change from the new robot to the old one; what caused it, and its place, are not known of it."""
        there, back = (self.path, None) if self.new_path is None else (self.new_path, self.path)
        return replace(
            self, change=_BACKWARD.get(self.change, self.change), path=there, new_path=back, old=self.new, new=self.old, because=(),
            reason="", words=None if self.words is None else (self.words[1], self.words[0]), span=None,
        )
