"""`repeat`: names, the index in expressions and references, and the limits."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from resolve.resolving import run
from thingc.base.diagnostics import Report
from thingc.base.source import Document, MappingNode, Span
from thingc.geometry.record import PartDefinition
from thingc.model.resolve import repeats
from thingc.model.resolve.references import replace_index
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import AssemblyDefinition, Attach

HEXAPOD = {
    "hexapod.yaml": """
        thingc: assembly/1
        name: hexapod
        parameters: {legs: 6}
        components:
          body: {part: "arm:Plate"}
          leg:
            assembly: leg.yaml
            repeat: {count: =legs}
            parameters: {angle: =i * 360 deg / legs}
            attach: {mount: seat, to: body.hip_$i, turn: =(i - 1) * 10 deg}
          foot:
            part: arm:Brace
            repeat: {count: =legs / 2, as: k}
            params: {length: =20 mm + k * 5 mm}
          spare: {part: "arm:Plate"}
          knob: {part: "arm:Plate", attach: {x: leg_0.shin.top}}
        joints:
          ankle:
            type: revolute
            repeat: {count: 3}
            parent: leg_${i}.shin.tip
            child: foot_$i.top
            limit: {lower: =-10 deg * (i + 1), upper: 90 deg}
            drive: leg_$i.hip
            mimic: {joint: lead}
          lead: {type: continuous, parent: body.x, child: spare.y}
        """,
    "leg.yaml": """
        thingc: assembly/1
        name: leg
        parameters: {angle: 0 deg}
        components:
          hip: {part: "arm:Servo"}
          shin: {part: "arm:Brace", params: {tilt: =angle}}
        joints:
          knee: {type: revolute, parent: hip.rotor, child: shin.top, limit: {lower: -90 deg, upper: 0}, drive: hip}
        mounts: {seat: hip.back, tip: shin.tip}
        poses: {folded: {knee: -90 deg}, straight: {knee: 0}}
        """,
}


def test_names_expressions_and_references_of_a_repeat(tmp_path: Path) -> None:
    outcome = run(tmp_path, HEXAPOD)
    model = outcome.good
    legs, feet = [f"leg_{k}" for k in range(6)], [f"foot_{k}" for k in range(3)]
    assert [c.name for c in model.components] == ["body", *legs, *feet, "spare", "knob"]
    assert [j.name for j in model.joints] == ["ankle_0", "ankle_1", "ankle_2", "lead"]
    for k in range(6):
        leg = outcome.component(f"leg_{k}")
        assert isinstance(leg.definition, AssemblyDefinition) and isinstance(leg.placement, Attach)
        assert dict(leg.definition.parameters)["angle"] == pytest.approx(math.radians(60 * k), abs=1e-15)
        assert (leg.placement.mount.text, leg.placement.to.text) == (f"leg_{k}.seat", f"body.hip_{k}")
        assert leg.placement.turn == pytest.approx(math.radians(10 * (k - 1)), abs=1e-15)
    for k in range(3):
        foot, ankle = outcome.component(f"foot_{k}"), outcome.joint(f"ankle_{k}")
        assert isinstance(foot.definition, PartDefinition)
        assert dict(foot.definition.parameters)["length"] == pytest.approx(0.02 + 0.005 * k)
        assert (ankle.parent.text, ankle.child.text) == (f"leg_{k}.shin.tip", f"foot_{k}.top")
        assert ankle.limit.lower == pytest.approx(math.radians(-10 * (k + 1)))
        assert ankle.drive is not None and ankle.drive.component is not None and ankle.drive.component.text == f"leg_{k}.hip"
        assert ankle.mimic is not None and ankle.mimic.joint == "lead"


def test_zero_items_create_no_components(tmp_path: Path) -> None:
    outcome = run(tmp_path, """
        thingc: assembly/1
        name: arm
        parameters: {n: 0}
        components:
          body: {part: "arm:Plate"}
          leg: {part: "arm:Plate", repeat: {count: =n}, attach: {a: body.x_$i}}
        """)
    assert [c.name for c in outcome.good.components] == ["body"]


def test_poses_and_modes_match_repeated_components(tmp_path: Path) -> None:
    files = dict(HEXAPOD)
    files["hexapod.yaml"] += """
        poses:
          rest: {"leg_*": folded, leg_3: straight, "leg_[01].knee": -30 deg, leg_1.knee: -10 deg, lead: 5 deg}
        modes:
          walk: {root: body, actuators: ["leg_[0-2].knee", "ankle_2"], contacts: {exclude: [["leg_*", body], ["leg_*", "leg_*"]]}}
        """
    outcome = run(tmp_path, files)
    assert outcome.said == []
    rest, walk = outcome.pose("rest"), outcome.mode("walk")
    degrees = {joint: round(math.degrees(q), 9) for joint, q in rest.values.items()}
    assert degrees == {
        "lead": 5.0, "leg_0/knee": -30.0, "leg_1/knee": -10.0, "leg_2/knee": -90.0, "leg_3/knee": 0.0, "leg_4/knee": -90.0,
        "leg_5/knee": -90.0,
    }
    assert walk.actuators == ("ankle_2", "leg_0/knee", "leg_1/knee", "leg_2/knee")
    pairs = [(a.text, b.text) for a, b in walk.exclude]
    assert len(pairs) == 6 + 15 and ("leg_0", "body") in pairs and ("leg_4", "leg_5") in pairs
    assert all(a != b for a, b in pairs)


def test_number_of_occurrences_is_limited(tmp_path: Path) -> None:
    def files(count: int) -> dict[str, str]:
        return {
            "big.yaml": """
                thingc: assembly/1
                name: big
                components:
                  row: {assembly: row.yaml, repeat: {count: 10}, attach: {origin: base.x}}
                  base: {part: "arm:Plate"}
                """,
            "row.yaml": f"""
                thingc: assembly/1
                name: row
                components:
                  first: {{part: "arm:Plate"}}
                  cell: {{part: "arm:Plate", repeat: {{count: {count}}}, attach: {{a: first.x}}}}
                """,
        }

    good = run(tmp_path, files(9998))
    assert good.said == []
    bad = run(tmp_path, files(9999))
    assert bad.said == ["TC331 big.yaml:5:3 the assembly has 100001 components (at most 100000 are allowed)"]


def test_doubling_documents_are_counted_without_expansion(tmp_path: Path) -> None:
    files = {}
    for k in range(60):
        inner = f"assembly: d{k + 1}.yaml" if k < 59 else 'part: "arm:Plate"'
        files[f"d{k}.yaml"] = f"""
            thingc: assembly/1
            name: d{k}
            components:
              a: {{{inner}}}
              b: {{{inner}, attach: {{origin: a.origin}}}}
            """
    outcome = run(tmp_path, files)
    # 2**16 fit, so the first document in which 2**17 would stand is the 17th from the end, at its second component.
    assert outcome.said == [
        "TC331 d43.yaml:5:3 the assembly has 131072 components (at most 100000 are allowed)"
    ]


@settings(max_examples=100)
@given(
    st.from_regex(r"[a-z]{1,3}(_[a-z]{1,2})?", fullmatch=True), st.integers(0, 9999),
    st.from_regex(r"[a-z]{0,3}_?", fullmatch=True), st.sampled_from(["", "_x", ".top", "_1.y"]),
)
def test_index_is_replaced_anywhere_in_a_name(index: str, value: int, before: str, after: str) -> None:
    span = Span(file="a.yaml", line=1, column=1, end_line=1, end_column=2)
    document = Document(
        path="a.yaml", relative="a.yaml", kind="assembly", tree=MappingNode(entries={}, keys={}, span=span), sha256="", text="",
    )
    report = Report()
    scope = Scope(document=document, report=report, names={}).repeat_scope(index, value)
    for written in (f"{before}${index}{after}", f"{before}${{{index}}}{after}"):
        assert replace_index(scope, written, ()) == f"{before}{value}{after}"
    assert replace_index(scope, f"{before}$Q{after}", ()) is None and len(report.diagnostics) == 1


def test_repeated_joint_mimics_the_one_with_its_index(tmp_path: Path) -> None:
    outcome = run(tmp_path, """
        thingc: assembly/1
        name: arm
        components:
          body: {part: "arm:Plate"}
          a: {part: "arm:Plate", repeat: {count: 2}}
          b: {part: "arm:Plate", repeat: {count: 2}}
        joints:
          hip: {type: continuous, repeat: {count: 2}, parent: body.x, child: a_$i.y}
          knee: {type: continuous, repeat: {count: 2}, parent: a_$i.x, child: b_$i.y,
                 mimic: {joint: hip_$i, multiplier: =-1 - i}}
        """)
    assert outcome.said == []
    found = [outcome.joint(f"knee_{k}").mimic for k in range(2)]
    assert [(mimic.joint, mimic.multiplier) for mimic in found if mimic] == [("hip_0", -1.0), ("hip_1", -2.0)]


@pytest.mark.parametrize(("count", "said"), [
    (3, []), (4, ["TC331 arm.yaml:6:44 the document has 6 components (at most 5 are allowed)"]),
])
def test_section_limit_includes_repeats(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int, said: list[str]
) -> None:
    monkeypatch.setattr(repeats, "MAX_OCCURRENCES", 5)
    outcome = run(tmp_path, f"""
        thingc: assembly/1
        name: arm
        components:
          body: {{part: "arm:Plate"}}
          cap: {{part: "arm:Plate", attach: {{a: body.y}}}}
          leg: {{part: "arm:Plate", repeat: {{count: {count}}}, attach: {{a: body.x_$i}}}}
        """)
    assert outcome.said == said
