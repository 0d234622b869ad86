"""What a kind of document test is: the contract between one file per kind and the passes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import ConfigDict

from thingc.base.brief import Brief
from thingc.base.frozen import dataclass
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import fault

if TYPE_CHECKING:
    from thingc.documents.checks.outcome import Outcome

BOUNDED = ConfigDict(json_schema_extra={"anyOf": [{"required": ["min"]}, {"required": ["max"]}]})
"""Of a model that takes `min`, `max` or both, as its schema says it."""


def require_bounds(low: object, high: object, kind: str, example: str) -> None:
    """Raises the fault of a mapping that has neither `min` nor `max`."""
    if low is None and high is None:
        raise fault("rule", f"a `{kind}` test needs `min`, `max` or both; none is here", help=f"write for example `{example}`")


Written = TypeVar("Written", bound=Model)
Stated = TypeVar("Stated", bound=Brief)


def _one_pose(check: Any, pose: Any) -> Sequence[Any]:
    return [pose]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckKind(Generic[Written, Stated]):
    """One kind of test.

    `model` is what is written under the key `name`. With a field `mode` the test is run in modes, with a field `pose` in poses of these,
    else once. `read(written, reader)` gives what is stated, in SI and with names worked out (None, where something of it was wrong: the
    reader has reported it); `reader` is a `resolve.tests.Reader`. References are found in what is stated by their type, and linked.

    `run(case, stated)` measures one case, a `testing.results.Case`. `poses(stated, pose)` are the poses that a case looks at, of
    the one that it is named after. `finish(linked, outcomes, report)` hears of all outcomes, if the test was run in all of its modes.
    `link(test, stated, joints by path, findings)` says what is only known of the linked assembly. (Naming these types here would make
    the passes that read the language import those that come after them: every kind's functions name them.)

    `position` is the place among the kinds in the documentation; `summary` one sentence for a schema and a table; `examples` values
    of the key; `stub` what a new test of this kind says, which is right in any robot, `$mount` and `$base` standing for mounts of it;
    `page` what the documentation says, with a table of keys for each model of the file. `of_limits`: what is read depends
    on the limits of joints.
    """

    name: str
    position: int
    summary: str
    examples: Sequence[Mapping[str, Any]]
    stub: Mapping[str, Any]
    page: str
    model: type[Written]
    read: Callable[[Written, Any], Stated | None]
    run: Callable[[Any, Stated], Outcome]
    poses: Callable[[Stated, Any], Sequence[Any]] = _one_pose
    finish: Callable[[Any, Sequence[Outcome], Any], None] | None = None
    link: Callable[[Any, Stated, Mapping[str, Any], Any], None] | None = None
    of_limits: bool = False

    def takes(self, key: str) -> bool:
        """Whether a test of this kind may say `mode`, or `pose`."""
        return key in self.model.model_fields
