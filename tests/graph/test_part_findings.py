"""Diagnostics of `link` about parts: failed parts, warnings of parts, and parts where another one is expected."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from graph.builder import (
    CAP,
    PLATE,
    MountExpectation,
    PartFailure,
    PartWarning,
    assembly,
    attach,
    box,
    component,
    faults,
    joint,
    laid,
    linked,
    notes,
    part,
    rx,
    said,
    t,
    warnings,
    where,
)
from thingc.base.diagnostics import Code, Report
from thingc.geometry.record import Mesh, PartRecord
from thingc.model.assembly.report import LinkReport
from thingc.model.resolve.types import AssemblyDefinition, BomEntry, Component, Process


def hand(**exported: str) -> AssemblyDefinition:
    return assembly("hand", [component("cap", "p:Cap")], mounts=exported, line=60)


# --- parts ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "code", "words", "help"),
    [
        (
            "raised",
            "PART_RAISED",
            "`pen` (`p:Pen(length=-100 mm)`) raised an exception: length must be above 0",
            "change the `params` of the component, or fix the part file",
        ),
        (
            "hung",
            "PART_HUNG",
            "`pen` (`p:Pen(length=-100 mm)`) took too long: length must be above 0",
            "fix the part, or allow more time with `--part-timeout`",
        ),
        (
            "crashed",
            "PART_CRASHED",
            "`pen` (`p:Pen(length=-100 mm)`) crashed the interpreter: length must be above 0",
            "change the `params` of the component, or the CAD calls in the part file",
        ),
        (
            "empty",
            "PART_EMPTY",
            "`pen` (`p:Pen(length=-100 mm)`) has no volume: length must be above 0",
            "return a solid from `result()`, or None for a part without geometry",
        ),
        (
            "refused",
            "PART_REFUSED",
            "`pen` (`p:Pen(length=-100 mm)`) is not allowed: length must be above 0",
            "use a part from the `parts` folders or the `packages` of the workspace",
        ),
        (
            "missing",
            "PART_MISSING",
            "`pen` (`p:Pen(length=-100 mm)`) does not exist: length must be above 0",
            "write `module:Class`, with a module in a part folder and a class in that module",
        ),
        ("invalid", "PART_INVALID", "`pen` (`p:Pen(length=-100 mm)`) is not valid: length must be above 0", "fix the part file"),
    ],
)
def test_failed_part_is_reported_once(kind: str, code: str, words: str, help: str) -> None:
    """One error at the first use, with notes for other uses, the parameters and the line in the part file."""
    pen = replace(
        part("p:Pen(length=-0.1)", length=-0.1, diameter=0.015), label="p:Pen(length=-100 mm)", words=("15 mm", "-100 mm")
    )
    inner = assembly("hand", [component("pen", pen, line=41)])
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("pen", pen, attach("pen.foot", "plate.foot"), line=5),
            component("spare", pen, attach("spare.foot", "plate.nowhere_near", line=7), line=6),
            component("h", inner, attach("h.pen.foot", "plate.foot"), line=8),
            component("h2", inner, attach("h2.pen.foot", "plate.foot"), line=9),
        ],
    )
    failure = PartFailure(
        subject="p:Pen(length=-0.1)",
        kind=kind,
        message="length must be above 0",
        file="/robots/parts/p.py",
        line=31,
        detail="Traceback ...",
    )
    report = faults(model, PLATE, failure)
    assert said(report)[0] == (code, words, help, 5)
    assert notes(report) == [
        ("`spare` also uses this part", "/robots/robot.yaml", 6),
        ("`pen` also uses this part", "/robots/robot.yaml", 41),
        ("parameters of the part: diameter=15 mm, length=-100 mm", None, None),
        ("location in the part file", "/robots/parts/p.py", 31),
    ]
    assert report.diagnostics[0].detail == "Traceback ..."
    assert report.diagnostics[0].path == "pen"
    assert [d.message for d in report.diagnostics[1:]] == ["`plate` (`p:Plate`) has no mount `nowhere_near`"]


def test_part_warnings_are_reported_once() -> None:
    odd = box(
        "p:Plate",
        mounts={"foot": t(0, 0, 0.02)},
        warnings=(PartWarning(message="a fillet failed", file="/robots/parts/p.py", line=9),),
    )
    model = assembly("a", [component("one", "p:Plate", line=3), component("two", "p:Plate", attach("two.foot", "one.foot"))])
    report = warnings(model, odd)
    assert said(report) == [("PART_WARNING", "`p:Plate`: a fillet failed", None, 3)]
    assert notes(report) == [("location in the part file", "/robots/parts/p.py", 9)]


def test_duplicate_warning_counts_as_reported() -> None:
    """The second warning is a duplicate of the first, but `warn` still returns True."""
    report = Report()
    findings = LinkReport(report)
    assert [findings.warn(Code.APART, "two solids", where(3)) for _ in range(2)] == [True, True]
    assert [one.message for one in report.diagnostics] == ["two solids"]


@pytest.mark.parametrize(("choice", "why"), [
    ("part", "method `collision()`"), ("decompose", "convex decomposition"),
    ("capsule", "enclosing capsule"),
])
def test_missing_collision_shapes_are_reported(choice: str, why: str) -> None:
    """Reported only for parts whose meshes are known."""
    mesh = Mesh(sha256="0" * 64, size=1, vertices=8, faces=12, closed=True, flat=False)
    model = assembly("a", [component("one", "p:Plate", line=3, collision=choice)])
    message = f"`one` (`p:Plate`) has no {why} for `collision: {choice}`"
    report = faults(model, box("p:Plate", meshes=dict.fromkeys(("visual", "mesh", "hull"), mesh)))
    assert said(report) == [("COLLISION_MISSING", message, "write `collision: hull`, or `collision: none` to disable contacts", 3)]
    linked(model, box("p:Plate"))


# --- expectations --------------------------------------------------------------------------------------------------

BOARD = box(
    "p:Board",
    mounts={"cap_seat": t(0, 0, 0.02), "foot": rx(np.pi)},
    expectations=(MountExpectation(mount="cap_seat", text="p:Cap", label="p:Cap", child_mount="foot"),),
)


def board(*others: Component, **over: object) -> tuple[AssemblyDefinition, PartRecord, PartRecord, PartRecord]:
    return assembly("a", [component("board", "p:Board", line=3, **over), *others]), BOARD, CAP, PLATE  # type: ignore[arg-type]


def test_met_expectations_are_silent() -> None:
    linked(*board(component("cap", "p:Cap", attach("cap.foot", "board.cap_seat"))))
    linked(
        assembly("a", [component("cap", "p:Cap"), component("board", "p:Board", attach("board.cap_seat", "cap.foot"))]),
        BOARD,
        CAP,
    )
    linked(
        assembly("a", [component("board", "p:Board"), component("cap", "p:Cap")], [joint("j", "board.cap_seat", "cap.foot")]),
        BOARD,
        CAP,
    )
    linked(
        assembly("a", [component("board", "p:Board"), component("h", hand(), attach("h.cap.foot", "board.cap_seat"))]), BOARD, CAP
    )


def test_unmet_expectations_are_warnings() -> None:
    help = "attach the mount `foot` of `p:Cap` to `board.cap_seat`"
    assert said(warnings(*board())) == [("EXPECTATION", "expected `p:Cap` on mount `board.cap_seat`, found nothing", help, 3)]
    plain = component("cap", "p:Cap", laid("board.cap_seat", np.eye(4)), line=5)
    assert said(warnings(*board(plain)))[0][1] == "expected `p:Cap` on mount `board.cap_seat`, found nothing"
    other = warnings(*board(component("lid", "p:Plate", attach("lid.foot", "board.cap_seat"), line=5)))
    assert said(other) == [("EXPECTATION", "expected `p:Cap` on mount `board.cap_seat`, found `lid` (`p:Plate`)", help, 5)]
    assert notes(other) == [("`board` is defined here", "/robots/robot.yaml", 3)]
    turned = warnings(*board(component("cap", "p:Cap", attach("cap.top", "board.cap_seat"), line=5)))
    assert said(turned) == [
        ("EXPECTATION", "expected mount `foot` of `cap` on `board.cap_seat`, found `top`", help, 5)
    ]


def test_expectation_compares_parameters() -> None:
    wide = box("p:Cap(width=0.2)", mounts={"foot": rx(np.pi)})
    model = assembly(
        "a", [component("board", "p:Board"), component("cap", "p:Cap(width=0.2)", attach("cap.foot", "board.cap_seat"), line=5)]
    )
    assert (
        said(warnings(model, BOARD, wide))[0][1]
        == "expected `p:Cap` on mount `board.cap_seat`, found `cap` (`p:Cap(width=0.2)`)"
    )


def test_mirrored_part_accepts_original_or_mirrored_child() -> None:
    """A mirrored part that expects `p:Cap` accepts the part or its mirror image; an unmirrored one does not accept the mirror image."""
    image = replace(BOARD, text="p:Board(mirror=y)")
    wide = box("p:Cap(width=0.2)", mounts={"foot": rx(np.pi)})
    for cap, fits in ((part("p:Cap"), True), (part("p:Cap").mirror_image("x"), True), (part(wide.text), False)):
        placed = component("cap", cap, attach("cap.foot", "board.cap_seat"))
        model = assembly("a", [component("board", part("p:Board").mirror_image("y")), placed])
        records = (image, CAP, wide, replace(CAP, text="p:Cap(mirror=x)"))
        if fits:
            linked(model, *records)
        else:
            assert [code for code, *_ in said(warnings(model, *records))] == ["EXPECTATION"]
    cap_x = component("cap", part("p:Cap").mirror_image("x"), attach("cap.foot", "board.cap_seat"))
    model = assembly("a", [component("board", "p:Board"), cap_x])
    assert said(warnings(model, BOARD, replace(CAP, text="p:Cap(mirror=x)")))[0][1] == (
        "expected `p:Cap` on mount `board.cap_seat`, found `cap` (`p:Cap(mirror=x)`)"
    )


def test_mirrored_bought_or_symmetric_parts_are_warnings() -> None:
    """A mirrored purchased part, or a mirrored part that equals its mirror image, is a warning. A BOM entry of the component suppresses
    the first."""
    left = part("p:Plate").mirror_image("y")
    bought, own = box(left.text, bom={"make": "buy"}), box(left.text, bom={"make": "buy"}, own_image=True)
    twice = [component("one", left, line=3), component("two", left, laid("one.origin", np.eye(4)))]

    def words(*components: Component, record: PartRecord = bought) -> list[tuple[str, str]]:
        found = said(warnings(assembly("a", list(components)), record))
        return [(code, message) for code, message, *_ in found]

    assert words(*twice) == [
        ("MIRRORED_BOUGHT", "`one` is the mirror image of the purchased part `p:Plate`"),
    ]
    assert words(twice[0], record=own) == [
        ("OWN_IMAGE", "`mirror` has no effect on the symmetric part `one` (`p:Plate`)")
    ]
    by_process = component("one", left, process=Process(kind="bought"))
    assert [code for code, _ in words(by_process, record=box(left.text))] == ["MIRRORED_BOUGHT"]
    for sold in (component("one", left, bom=BomEntry(number="P-2")), component("one", left, bom=BomEntry(make="print"))):
        linked(assembly("a", [sold]), bought)


def test_rounded_lengths_are_equal() -> None:
    """Parts use millimetres with 15 digits, so the last digits of a length in metres are not preserved."""
    board = box("p:Board", mounts={"seat": t(0, 0, 0.02)}, expectations=(
        MountExpectation(mount="seat", text="p:Cap(width=0.187672239581141)", label="p:Cap(width=187.672 mm)", child_mount="foot"),
    ))
    for width, same in (("0.18767223958114063", True), ("0.1876722395", False)):
        cap = box(f"p:Cap(width={width})", mounts={"foot": rx(np.pi)})
        made = replace(part(cap.text), label="p:Cap(width=187.672 mm)")
        model = assembly("a", [component("board", "p:Board"), component("cap", made, attach("cap.foot", "board.seat"))])
        if same:
            linked(model, board, cap)
        else:
            assert said(warnings(model, board, cap))[0][1] == (
                "expected `p:Cap(width=0.187672239581141)` on mount `board.seat`, found `cap` (`p:Cap(width=0.1876722395)`)"
            ), "where labels are the same, the texts tell them apart"


def test_exported_expectations_are_not_checked() -> None:
    """The mount is exported, so the enclosing assembly is responsible for it."""
    shown = assembly("a", [component("board", "p:Board")], mounts={"seat": "board.cap_seat"})
    linked(shown, BOARD)  # whoever nests this assembly puts the cap there
    nested = assembly("b", [component("plate", "p:Plate"), component("h", shown, attach("h.board.foot", "plate.foot"))])
    assert [d.message for d in warnings(nested, BOARD, PLATE).diagnostics] == [
        "expected `p:Cap` on mount `board.cap_seat`, found nothing"
    ]
