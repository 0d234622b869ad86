"""Assembly graphs written out for tests: an arm of 12 definitions, a walker of 32, and a graph with characters that need escaping."""

from __future__ import annotations

from collections.abc import Iterable

from thingc.model.assembly.hag import Definition, DefinitionEdge, Hag

XM430 = "thingc_stock.dynamixel:XM430"
SCREW = "thingc_stock.fasteners:Screw(length=0.008, size='M2.5-0.45')"
EFFECTOR = "end_effector(pen_diameter=0.02)"
CAP = "arm:OmegaCap(diameter=0.02, length=0.03)"
LABELS = {
    SCREW: "thingc_stock.fasteners:Screw(length=8 mm, size='M2.5-0.45')",
    EFFECTOR: "end_effector(pen_diameter=20 mm)",
    CAP: "arm:OmegaCap(diameter=20 mm, length=30 mm)",
    "arm:Brace(length=0.12)": "arm:Brace(length=120 mm)",
}
"""Labels of definitions, where they differ from their texts."""


def graph(
    root: str, definitions: Iterable[tuple[str, str, str]], edges: Iterable[tuple[str, str, str, str, str | None]],
) -> Hag:
    """Build a graph. `definitions` are (text, reference, kind), `edges` are (parent, child, component, mounts, joint)."""
    return Hag(
        root=root,
        definitions=tuple(
            Definition(text=text, label=LABELS.get(text, text), reference=reference, kind=kind) for text, reference, kind in definitions
        ),
        edges=tuple(
            DefinitionEdge(parent=parent, child=child, component=component, mounts=mounts, joint=joint)
            for parent, child, component, mounts, joint in edges
        ),
    )


def arm() -> Hag:
    """An arm with 11 components and 8 screws; the hand has 5 components."""
    part_texts = (
        "arm:BasePlate", XM430, "arm:Bracket", "arm:Brace(length=0.12)", "arm:Brace", "arm:LHand", CAP, "arm:Pen", SCREW,
    )
    return graph("arm", [
        ("arm", "arm.yaml", "assembly"), (EFFECTOR, "end_effector.yaml", "assembly"), ("frame", "frame", "frame"),
        *((text, text.partition("(")[0], "part") for text in part_texts),
    ], [
        ("arm", "arm:BasePlate", "plate", "", None),
        ("arm", XM430, "yaw_servo", "back -> plate.servo_seat", None),
        ("arm", "arm:Bracket", "bracket", "yaw_seat -> yaw_servo.rotor", "yaw"),
        ("arm", XM430, "shoulder_servo", "front -> bracket.seat", None),
        ("arm", "arm:Brace(length=0.12)", "humerus", "lower -> shoulder_servo.rotor", "shoulder"),
        ("arm", XM430, "elbow_servo", "back -> humerus.upper", None),
        ("arm", "arm:Brace", "forearm", "lower -> elbow_servo.rotor", "elbow"),
        ("arm", XM430, "wrist_servo", "back -> forearm.upper", None),
        ("arm", EFFECTOR, "hand", "base -> wrist_servo.rotor", "wrist"),
        ("arm", "frame", "board", "in bracket.board", None),
        *(("arm", SCREW, f"screw_{k}", f"head -> plate.hole_{k}", None) for k in range(8)),
        (EFFECTOR, "arm:LHand", "l", "", None),
        (EFFECTOR, CAP, "cap", "seat -> l.cap_seat", None),
        (EFFECTOR, "arm:Pen", "pen", "grip -> cap.pen", None),
        (EFFECTOR, SCREW, "left", "head -> cap.left", None),
        (EFFECTOR, SCREW, "right", "head -> cap.right", None),
    ])


def walker() -> Hag:
    """Two sizes of legs that share most of their parts, and feet that share the screws."""
    parts = ["Coxa", "Femur", "Tibia", "Sole", "Toe", "Top", "Bottom", "Spine", "Neck", "Skull", "Jaw", "Lens", "Guide", "Board",
             "Ring", "Cell", "Insert", "Screw", "Bolt", "Small", "Large", "Tibia(length=0.12, thickness=0.004, width=0.02)"]
    legs = ("leg", "leg(length=0.12)")
    edges: list[tuple[str, str, str, str, str | None]] = [("walker", "body", "body", "", None)]
    edges += [("walker", "leg", f"leg_{k}", f"hip -> body.hip_{k}", f"hip_{k}") for k in range(4)]
    edges += [("walker", legs[1], f"rear_{side}", f"hip -> body.{side}", f"hip_{side}") for side in ("left", "right")]
    edges += [("walker", "head", "head", "neck -> body.front", None)]
    edges += [("walker", "cad/battery.step", "battery", "b -> body.tray", None)]
    for leg, tibia in zip(legs, ("w:Tibia", "w:Tibia(length=0.12, thickness=0.004, width=0.02)")):
        inside = [("w:Coxa", "coxa"), ("w:Small", "hip_servo"), ("w:Femur", "femur"), ("w:Large", "knee_servo"), (tibia, "tibia"),
                  ("foot", "foot"), ("w:Screw", "screw_0"), ("w:Screw", "screw_1"), ("w:Guide", "guide")]
        edges += [(leg, child, name, f"a -> {name}.b", None) for child, name in inside]
    edges += [("foot", f"w:{name}", name.lower(), "a -> b.c", None) for name in ("Sole", "Toe", "Ring", "Screw")]
    edges += [("body", f"w:{name}", name.lower(), "a -> b.c", None) for name in ("Top", "Bottom", "Spine", "Board")]
    edges += [("body", "w:Bolt", f"bolt_{k}", f"a -> b.c_{k}", None) for k in range(6)]
    edges += [("body", "w:Insert", f"insert_{k}", f"a -> b.c_{k}", None) for k in range(6)]
    edges += [("body", "w:Cell", f"cell_{k}", f"a -> b.c_{k}", None) for k in range(2)]
    edges += [("head", f"w:{name}", name.lower(), "a -> b.c", None) for name in ("Neck", "Skull", "Jaw", "Lens", "Screw")]
    edges += [("head", "cad/motor.step", "motor", "a -> b.c", None), ("head", "frame", "imu", "in skull.top", None)]
    return graph("walker", [
        ("walker", "walker.yaml", "assembly"), ("body", "body.yaml", "assembly"), ("leg", "leg.yaml", "assembly"),
        (legs[1], "leg.yaml", "assembly"), ("foot", "foot.yaml", "assembly"), ("head", "head.yaml", "assembly"),
        *((f"w:{name}", f"w:{name.partition('(')[0]}", "part") for name in parts),
        ("cad/battery.step", "cad/battery.step", "file"), ("cad/motor.step", "cad/motor.step", "file"),
        ("frame", "frame", "frame"),
    ], edges)


NASTY = 'w:Label(text=\'<b>&amp; "x" \\n `y` #35; ]]> | ; \x07 \ud800 漢字 -->\')'


def awkward() -> Hag:
    """A text parameter that contains the end of every kind of quotation, and a file with a quotation mark in its name."""
    return graph("top", [
        ("top", "top.yaml", "assembly"), (NASTY, "w:Label", "part"), ('cad/a "b" <c>\\.step', 'cad/a "b" <c>\\.step', "file"),
    ], [("top", NASTY, "label", "", None), ("top", 'cad/a "b" <c>\\.step', "thing", "a -> label.b", "turn")])
