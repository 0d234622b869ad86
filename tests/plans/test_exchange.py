"""Part records on a tape: the values that a plan replaces, and the records to which a plan does not apply."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pytest
from msgspec.structs import replace

from graph.builder import record
from thingc.base.pose import Pose
from thingc.base.primitives import Primitive
from thingc.batch.plans.numeric_plan import PAYS, NumericPlan, PlanCache
from thingc.batch.plans.part_exchange import Exchange, Exchanged, PartDependsOnNumber, TracedParts
from thingc.batch.plans.program import program_of
from thingc.batch.plans.tape import Tape
from thingc.driver.settings import ParsedSettings
from thingc.geometry.record import (
    Mesh,
    MountExpectation,
    MountRecord,
    ParameterSchema,
    PartDefinition,
    PartFailure,
    PartRecord,
    PartSchema,
)
from thingc.targets.artifact import StoredArtifact

BAR = PartSchema(
    reference="m:Bar", kind="thing", doc="", material=None, actuator=False, file="", line=0,
    parameters=(ParameterSchema(name="length", kind="length", required=False, default=0.1),),
)


def bar(length: float, text: str) -> PartRecord:
    """Return the record of a bar: its numbers, a mesh, and a mount whose position is not a number of a known kind."""
    mesh = Mesh(sha256=f"{length!r}".ljust(64, "0"), size=100, vertices=8, faces=12, closed=True, flat=False)
    return record(
        text, volume=length * 1e-4, box=((0.0, -0.005, -0.005), (length, 0.005, 0.005)), meshes={"visual": mesh},
        mounts={"end": MountRecord(pose=Pose(translation=(length, 0.0, 0.0)), interface=f"bar-{length}")},
    )


class Parts:
    """A geometry service without a CAD kernel. `made` changes the record of a bar."""

    def __init__(self, made: Callable[[PartRecord], Any] = lambda one: one) -> None:
        self.made = made
        self.asked: list[str] = []

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema]:
        return dict.fromkeys(references, BAR)

    def realize(self, definitions: Sequence[PartDefinition], convex: object = None) -> dict[str, Any]:
        self.asked += [one.text for one in definitions]
        return {one.text: self._record(one) for one in definitions}

    def _record(self, one: PartDefinition) -> Any:
        if one.reference == "m:Plate":
            cut = MountExpectation(mount="seat", text="m:Bar(length=0.2)", label="", child_mount="end")
            return record(one.text, expectations=(cut,))
        length = dict(one.parameters)["length"]
        assert type(length) is float
        return self.made(bar(length, one.text))

    def slice(self, definitions: Sequence[PartDefinition], records: Mapping[str, Any], slicings: Mapping[str, Any]) -> Mapping[str, Any]:
        return records


def exchange(parts: Parts, *others: PartDefinition) -> Exchange:
    """Return the exchange for a bar whose length is a variable, and for another one that is 1 cm longer."""
    tape = Tape()
    length = tape.variable(0.14)
    traced = TracedParts(parts, lambda number: True)  # type: ignore[arg-type]
    definition = BAR.definition({"length": length + 0.01})  # type: ignore[dict-item]
    records = traced.realize([definition, *others])
    records = traced.slice([definition, *others], records, {})
    mesh = records[definition.text].meshes["visual"]
    assert records[definition.text].box[1][0].value == 0.14 + 0.01
    assets = {
        f"{definition.stem}_hull.obj": StoredArtifact(sha256=mesh.sha256, size=mesh.size),
        "m.Other.obj": StoredArtifact(sha256="5", size=5),
    }
    made = Exchange(traced, parts, assets)  # type: ignore[arg-type]
    assert made.names == [f"{definition.stem}_hull"] and definition.text == f"m:Bar(length={0.14 + 0.01!r})"
    return made


def test_numbers_and_meshes_come_from_the_other_record() -> None:
    parts = Parts()
    found = exchange(parts).of([0.25])
    assert isinstance(found, Exchanged) and parts.asked == [f"m:Bar(length={0.14 + 0.01!r})", "m:Bar(length=0.26)"]
    assert [one for one in found.numbers if one] == [0.26 * 1e-4, -0.005, -0.005, 0.26, 0.005, 0.005, 0.26]
    (name,) = found.names
    assert name == BAR.definition({"length": 0.26}).stem + "_hull"
    assert found.assets == {
        f"{name}.obj": StoredArtifact(sha256="0.26".ljust(64, "0"), size=100), "m.Other.obj": StoredArtifact(sha256="5", size=5),
    }


def test_repeated_requests_are_cached() -> None:
    parts = Parts()
    made = exchange(parts)
    assert made.of([0.25]) is made.of([0.25]) and parts.asked.count("m:Bar(length=0.26)") == 1


@pytest.mark.parametrize("made", [
    lambda one: PartFailure(subject=one.text, kind="raised", message="") if one.volume > 2e-5 else one,
    lambda one: replace(one, exact=one.volume < 2e-5),
    lambda one: replace(one, material="petg" if one.volume > 2e-5 else None),
    lambda one: replace(one, up=(0.0, 0.0, 1.0) if one.volume > 2e-5 else (0.0, 0.6, 0.8)),
    lambda one: replace(one, mounts={**one.mounts, **({"more": one.mounts["end"]} if one.volume > 2e-5 else {})}),
    lambda one: replace(one, meshes={name: replace(mesh, closed=one.volume < 2e-5) for name, mesh in one.meshes.items()}),
    lambda one: replace(one, pieces=(Primitive(shape="sphere", size=(1.5,), pose=Pose()),) * (2 if one.volume > 2e-5 else 1)),
], ids=["failed", "not exact", "material", "turned", "mounts", "closed", "pieces"])
def test_plan_does_not_apply_to_other_differences(made: Callable[[PartRecord], Any]) -> None:
    found = exchange(Parts(made))
    assert found.of([0.15]) is not None and found.of([0.25]) is None


def test_zero_centres_may_change_but_mounts_may_not() -> None:
    centre = Parts(lambda one: replace(one, centre=(0.1, 0.0 if one.volume > 2e-5 else 1e-3, 0.0)))
    assert exchange(centre).of([0.25]) is not None
    mount = MountRecord(pose=Pose(translation=(0.1, 1e-3, 0.0)), interface=None)
    mounts = Parts(lambda one: one if one.volume > 2e-5 else replace(one, mounts={"end": mount}))
    assert exchange(mounts).of([0.25]) is None


def test_plan_does_not_apply_if_parts_become_equal() -> None:
    """The plate is cut for a bar of 200 mm, and another bar is 300 mm long. If the traced bar is 300 mm long too, there are fewer parts."""
    plate = PartDefinition(reference="m:Plate", kind="code", parameters=(), text="m:Plate", label="m:Plate")
    found = exchange(Parts(), plate, BAR.definition({"length": 0.3}))
    assert found.of([0.15]) is not None and found.of([0.2 - 0.01]) is None and found.of([0.3 - 0.01]) is None


def test_reason_is_given_if_a_number_cannot_change_a_part() -> None:
    traced = TracedParts(Parts(), lambda number: False)  # type: ignore[arg-type]
    with pytest.raises(PartDependsOnNumber, match=r"m:Bar\(length=150 mm\)"):
        traced.realize([BAR.definition({"length": Tape().variable(0.15)})])  # type: ignore[dict-item]


def test_next_plan_is_immediate_if_plans_save_time() -> None:
    cache: PlanCache[None] = PlanCache()
    read = ParsedSettings(names=("length",), values=(0.1,), texts=())
    assert [cache.should_create_plan(read) for _ in range(8)] == [False, True, False, True, False, False, False, True]
    cache.hits = PAYS
    assert [cache.should_create_plan(read) for _ in range(3)] == [True, False, True] and cache.hits == 0


def test_settings_come_before_numbers_of_records() -> None:
    class Records:
        def of(self, values: Sequence[float]) -> Exchanged:
            assert list(values) == [1.0, 2.0]
            return Exchanged(numbers=(7.0, 8.0), names=(), assets={})

    tape = Tape()
    program = program_of(tape, [tape.variable(value) for value in (0.1, 0.2, 0.3, 0.4)])
    plan = NumericPlan(free=(0, 2), fixed=((1, 5.0),), program=program, template=None, exchange=Records())  # type: ignore[arg-type]
    assert plan.outputs((1.0, 5.0, 2.0)) == (1.0, 2.0, 7.0, 8.0)
    assert plan.outputs((1.0, 4.0, 2.0)) is None
