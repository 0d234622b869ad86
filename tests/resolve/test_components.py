"""Components: part parameters, materials, overrides and placements, and which parts of invalid components are omitted from the model."""

from __future__ import annotations

import builtins
import math
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from resolve.resolving import run
from thingc.base.diagnostics import Code
from thingc.geometry.record import PartDefinition
from thingc.model.resolve.types import At, Attach, BomEntry, Overrides, Process

ARM = """
thingc: assembly/1
name: arm
parameters: {reach: 100 mm, fill: 15 %}
materials: [materials.yaml]
defaults:
  component: {material: petg, collision: box, process: {walls: 4, infill: =fill}, bom: {supplier: us, make: print}}
components:
  plate: {part: "arm:Plate"}
  brace:
    part: arm:Brace
    params:
      {length: =reach / 4, tilt: 90 deg, holes: =2 * 3, fill: 50 %, weight: 5 g, scale: 3, open: true, label: 12 mm, size: M2,
       teeth: 16}
    attach: {mount: back, to: plate.seat, turn: 90 deg, gap: =reach / 100}
    material: steel
    mass: 12 g
    com: [1 mm, 0, =reach]
    inertia: {value: {ixx: 1 kg*m^2, iyy: 2 kg*m^2, izz: 2.5 kg*m^2, ixz: -0.1 kg*m^2}, source: vendor}
    collision: none
    visual: false
    process: {walls: 2}
    bom: {number: X1, cost: 12.50 EUR, make: buy}
    mounts: {shaft: {xyz: 0 0 4 mm, rpy: 0 0 90 deg, interface: horn}}
  board:
    frame: true
    mass: {value: 12 g, source: measured}
    at: {in: brace.shaft, xyz: 1 2 3 mm, rpy: 0 90 0 deg}
"""
MATERIALS = """
thingc: materials/1
materials:
  petg:
    density: 1270 kg/m^3
    color: lavender
    friction: {slide: 0.4, torsion: 5 mm}
    process: {kind: fdm, walls: 3, line_width: 0.45 mm, layer: 0.2 mm, top: 4, bottom: 5, infill: 15 %}
  steel: {base: "bd_materials:stainless", color: "#888"}
  light: {base: "bd_materials:pla", density: 500 kg/m^3}
"""


def unplaced(process: Process | None) -> Process | None:
    """Return a process without its source locations."""
    return None if process is None else replace(process, origins={})


def lines(process: Process) -> dict[str, int]:
    """Return the source line of each key of a process."""
    return {key: origin[0].line for key, origin in process.origins.items()}


def test_all_keys_of_a_component(tmp_path: Path) -> None:
    outcome = run(tmp_path, {"arm.yaml": ARM, "materials.yaml": MATERIALS})
    assert outcome.said == []
    plate, brace, board = (outcome.component(name) for name in ("plate", "brace", "board"))

    assert isinstance(plate.definition, PartDefinition) and plate.definition.parameters == ()
    assert plate.placement is None
    assert plate.material is not None and plate.material.name == "petg"
    made = plate.overrides.process
    assert replace(plate.overrides, process=unplaced(made)) == Overrides(collision="box", process=Process(walls=4, infill=0.15))
    assert made is not None and lines(made) == {"walls": 6, "infill": 6}
    assert plate.bom == BomEntry(supplier="us", make="print")

    assert isinstance(brace.definition, PartDefinition)
    assert brace.definition.parameters == (
        ("fill", 0.5), ("holes", 6), ("label", "12 mm"), ("length", 0.025), ("open", True), ("scale", 3.0), ("size", "M2"),
        ("teeth", 16), ("tilt", math.pi / 2), ("weight", 0.005),
    )
    assert type(dict(brace.definition.parameters)["holes"]) is int
    assert type(dict(brace.definition.parameters)["scale"]) is float
    assert brace.definition.text == (
        "arm:Brace(fill=0.5, holes=6, label='12 mm', length=0.025, open=True, scale=3.0, size='M2', teeth=16, "
        "tilt=1.5707963267948966, weight=0.005)"
    )
    assert brace.definition.label == (
        "arm:Brace(fill=50 %, holes=6, label='12 mm', length=25 mm, open=true, scale=3, size='M2', teeth=16, tilt=90 deg, weight=5 g)"
    )
    assert brace.definition.words == ("50 %", "6", "12 mm", "25 mm", "true", "3", "M2", "16", "90 deg", "5 g")
    placement = brace.placement
    assert isinstance(placement, Attach)
    assert (placement.mount.text, placement.to.text) == ("brace.back", "plate.seat")
    assert placement.turn == math.pi / 2 and placement.gap == 0.001
    assert brace.material is not None and brace.material.name == "steel"
    over = brace.overrides
    assert over.mass is not None and over.mass.value == (0.012,) and over.mass.source == "stated"
    assert over.com is not None and over.com.value == (0.001, 0.0, 0.1) and over.com.source == "stated"
    assert over.inertia is not None and over.inertia.value == (1.0, 2.0, 2.5, 0.0, -0.1, 0.0) and over.inertia.source == "vendor"
    assert (over.collision, over.visual) == ("none", False)
    assert unplaced(over.process) == Process(walls=2, infill=0.15)
    assert over.process is not None and lines(over.process) == {"walls": 21, "infill": 6}
    assert brace.bom == BomEntry(number="X1", supplier="us", cost="12.50 EUR", make="buy")
    shaft = brace.mounts["shaft"]
    assert shaft.interface == "horn" and shaft.pose.translation == (0.0, 0.0, 0.004)
    assert shaft.pose.rotation == ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))

    assert board.frame and board.definition is None and board.material is None
    assert board.overrides.mass is not None and board.overrides.mass.source == "measured"
    assert board.overrides.collision == "hull"  # the defaults are for parts
    assert isinstance(board.placement, At) and board.placement.to.text == "brace.shaft"
    assert board.placement.pose.translation == (0.001, 0.002, 0.003)
    assert board.placement.pose.rotation == ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))  # +90 deg about y


def test_labels_are_rounded(tmp_path: Path) -> None:
    document = """
        thingc: assembly/1
        name: arm
        components:
          brace: {part: arm:Brace, params: {length: =0.1 m + 0.2 m, tilt: =1 deg / 3, weight: 1.5 kg}}
    """
    brace = run(tmp_path, {"arm.yaml": document}).component("brace").definition
    assert isinstance(brace, PartDefinition)
    assert "length=0.30000000000000004, " in brace.text
    assert brace.label == "arm:Brace(length=300 mm, tilt=0.333333 deg, weight=1.5 kg)"


def test_materials_are_resolved(tmp_path: Path) -> None:
    scope = run(tmp_path, {"arm.yaml": ARM, "materials.yaml": MATERIALS}).good.materials
    petg, steel, light = scope["petg"], scope["steel"], scope["light"]
    assert (petg.density, petg.color, petg.slide, petg.torsion, petg.roll) == (1270.0, "#e6e6fa", 0.4, 0.005, None)
    assert unplaced(petg.process) == Process(kind="fdm", walls=3, line_width=0.00045, layer=0.0002, top=4, bottom=5, infill=0.15)
    import bd_materials

    assert steel.density == bd_materials.resolve("stainless").material.density and steel.color == "#888888"
    assert light.density == 500.0


def test_missing_material_library_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name == "bd_materials":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    outcome = run(tmp_path, """
        thingc: assembly/1
        name: arm
        materials: {s: {base: "bd_materials:pla"}}
        components: {a: {part: "arm:Plate"}}
        """)
    assert outcome.said == [
        "TC339 arm.yaml:3:23 `bd_materials:pla` requires the package `bd_materials`, which is not installed"
        " | install the package, or use `density` and `color` instead of `base`",
    ]


def test_default_values_keep_their_source_location(tmp_path: Path) -> None:
    outcome = run(tmp_path, """
        thingc: assembly/1
        name: arm
        defaults: {component: {mass: 5 g}}
        components:
          plate: {part: "arm:Plate"}
        """)
    mass = outcome.component("plate").overrides.mass
    assert mass is not None and (mass.origin[0].line, mass.origin[0].column) == (3, 30)
    assert (outcome.component("plate").origin[0].line, outcome.component("plate").origin[0].column) == (5, 3)


def test_valid_components_are_resolved_despite_errors(tmp_path: Path) -> None:
    """Invalid components have no definition, and components with an invalid placement have no placement."""
    outcome = run(tmp_path, """
        thingc: assembly/1
        name: arm
        components:
          plate: {part: "arm:Plate"}
          bad: {part: "arm:Brace", params: {length: 3 deg}, attach: {a: plate.b}}
          on_bad: {part: "arm:Plate", attach: {a: bad.b}}
          eye: {frame: true, at: {in: plat.top}}
          lost: {part: "arm:Plate", attach: {a: plat.b}}
        """)
    assert len(outcome.said) == 3
    by_name = {name: outcome.component(name) for name in ("plate", "bad", "on_bad", "eye", "lost")}
    assert [name for name, c in by_name.items() if c.definition is not None] == ["plate", "on_bad", "lost"]
    assert by_name["eye"].frame
    assert [name for name, c in by_name.items() if c.placement is not None] == ["on_bad"]


def test_file_parts_are_resolved(tmp_path: Path) -> None:
    (tmp_path / "cad").mkdir()
    (tmp_path / "cad" / "motor.STEP").write_text("")
    outcome = run(tmp_path, {"robots/arm.yaml": """
        thingc: assembly/1
        name: arm
        components:
          a: {file: ../cad/motor.STEP, mounts: {shaft: {}}}
          b: {file: ../robots/../cad/motor.STEP, attach: {shaft: a.shaft}, mounts: {shaft: {}}}
        """})
    definitions = outcome.good.part_definitions()
    assert definitions == (
        PartDefinition(reference="cad/motor.STEP", kind="file", parameters=(), text="cad/motor.STEP", label="cad/motor.STEP"),
    )


def test_refused_file_part_causes_no_further_errors(tmp_path: Path) -> None:
    (tmp_path / "w").mkdir()
    outcome = run(tmp_path / "w", """
        thingc: assembly/1
        name: arm
        components:
          a: {part: "arm:Plate"}
          b: {file: ../motor.step, attach: {origin: a.x}}
          c: {file: /etc/motor.step, attach: {origin: b.x}}
          d: {file: motor.txt, attach: {origin: b.x}}
        """)
    assert [line.split()[0] for line in outcome.said] == ["TC114", "TC114", "TC115"]


def test_part_definitions_are_unique_and_in_document_order(tmp_path: Path) -> None:
    outcome = run(tmp_path, {
        "arm.yaml": """
            thingc: assembly/1
            name: arm
            components:
              first: {part: "arm:Brace"}
              hand: {assembly: hand.yaml, attach: {origin: first.x}}
              hand2: {assembly: hand.yaml, attach: {origin: first.x}}
              same: {part: "arm:Brace", params: {length: 80 mm}, attach: {a: first.x}}
              last: {part: "arm:Servo", attach: {a: first.x}}
            """,
        "hand.yaml": """
            thingc: assembly/1
            name: hand
            components:
              cap: {part: "arm:Plate"}
              pen: {part: "arm:Brace", params: {length: 20 mm}, attach: {a: cap.x}}
            """,
    })
    assert [d.text for d in outcome.good.part_definitions()] == ["arm:Brace", "arm:Plate", "arm:Brace(length=0.02)", "arm:Servo"]
    assert outcome.component("first").definition is outcome.component("same").definition


def test_links_with_equal_shapes_have_equal_definitions(tmp_path: Path) -> None:
    """The position in the documents does not matter."""
    outcome = run(tmp_path, """
        thingc: assembly/1
        name: arm
        components:
          first: {link: true, mass: 1 kg, shapes: [{box: 100 50 20 mm}, {sphere: {radius: 30 mm}}]}
          same: {link: true, mass: 2 kg, shapes: [{box: 10 5 2 cm}, {sphere: {radius: 3 cm}}], at: {in: first.origin}}
          other: {link: true, mass: 1 kg, shapes: [{box: 100 50 20 mm}, {sphere: {radius: 31 mm}}], at: {in: first.origin}}
        """)
    first, same, other = (outcome.component(name).definition for name in ("first", "same", "other"))
    assert first == same and first is not None and first.text == same.text and first != other and first.text != other.text


@pytest.mark.parametrize("limit", [3, 2])
def test_number_of_reported_part_failures_is_limited(limit: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thingc.model.resolve.parts.MAX_FAULTS", limit)
    components = "".join(
        f"  c{number}: {{part: '{part}'{', attach: {x: c0.y}' if number else ''}}}\n"
        for number, part in enumerate(("arm:Gone", "amr:Plate", "os:system"))
    )
    codes = [one.code for one in run(tmp_path, f"thingc: assembly/1\nname: arm\ncomponents:\n{components}").report.diagnostics]
    assert (Code.TOO_LARGE in codes) == (limit < 3) and len([code for code in codes if code is not Code.TOO_LARGE]) == limit
