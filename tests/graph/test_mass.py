"""Mass, centre and inertia of occurrences and links, compared with textbook formulas in numpy."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from graph.builder import (
    PETG,
    ActuatorRecord,
    DeclaredValue,
    Drive,
    Process,
    assembly,
    attach,
    bare,
    box,
    box_inertia,
    component,
    faults,
    joint,
    laid,
    linked,
    mated,
    material,
    mode,
    rx,
    ry,
    rz,
    said,
    stated,
    t,
    warnings,
    whole,
)
from thingc.base.diagnostics import Report
from thingc.model.assembly.linking import link
from thingc.model.assembly.types import Assembly, Occurrence

SIZE = (0.1, 0.06, 0.04)
VOLUME = 0.1 * 0.06 * 0.04
AREA = 2 * (0.1 * 0.06 + 0.06 * 0.04 + 0.1 * 0.04)
MASS = 1000.0 * VOLUME
PRINTED = Process(kind="fdm", walls=3, line_width=0.0004, infill=0.15, estimate="skin")


def only(record: object, **over: object) -> Occurrence:
    materials = over.pop("materials", (PETG, material("steel", 7850.0)))
    model = assembly("a", [component("part", "p:Box", **over)], materials=materials)  # type: ignore[arg-type]
    return linked(model, record).occurrences[0]  # type: ignore[arg-type]


def test_mass_is_density_times_volume() -> None:
    """A box has the inertia of a box up to rounding. Placeholder inertias were a defect of the prototype."""
    found = only(box("p:Box", SIZE, centre=(0.01, 0.02, 0.03)))
    assert found.properties.mass == pytest.approx(0.24, rel=1e-15)
    assert found.properties.centre == (0.01, 0.02, 0.03)
    a, b, c = SIZE
    expected = 0.24 / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    assert np.array(found.properties.inertia) == pytest.approx(expected, rel=1e-15)
    assert found.mass_source == "derived"


def test_document_material_overrides_the_thing() -> None:
    steel = material("steel", 7850.0, color="#888888")
    found = only(box("p:Box", SIZE), material=steel)
    assert found.properties.mass == pytest.approx(7850 * VOLUME)
    assert (found.material, found.color) == (steel, "#888888")
    assert only(box("p:Box", SIZE, color="#ff0000"), material=steel).color == "#ff0000"


def test_skin_estimate_of_infill() -> None:
    """The skin is area * walls * line width; the rest is filled by the infill fraction."""
    found = only(box("p:Box", SIZE), materials=(material("petg", 1270.0, process=PRINTED),))
    skin = AREA * 3 * 0.0004
    mass = 1270 * (skin + 0.15 * (VOLUME - skin))
    assert skin < VOLUME
    assert found.properties.mass == pytest.approx(mass, rel=1e-14)
    assert np.array(found.properties.inertia) == pytest.approx(box_inertia(SIZE) * mass / VOLUME)
    assert found.mass_source == "estimated"


def test_infill_of_a_thin_part_is_solid() -> None:
    thin = Process(kind="fdm", walls=100, line_width=0.01, infill=0.15, estimate="skin")
    assert only(box("p:Box", SIZE), materials=(material("petg", process=thin),)).properties.mass == pytest.approx(MASS)


def test_component_process_overrides_the_material() -> None:
    found = only(box("p:Box", SIZE), materials=(material("petg", process=PRINTED),), process=Process(infill=0.5))
    skin = AREA * 3 * 0.0004
    assert found.properties.mass == pytest.approx(1000 * (skin + 0.5 * (VOLUME - skin)))
    full = only(box("p:Box", SIZE), materials=(material("petg", process=PRINTED),), process=Process(infill=1.0))
    assert (full.properties.mass, full.mass_source) == (pytest.approx(MASS), "derived")


def test_thing_density_overrides_the_material() -> None:
    found = only(box("p:Box", SIZE, density=DeclaredValue(value=2000.0)))
    assert (found.properties.mass, found.mass_source) == (pytest.approx(2000 * VOLUME), "derived")
    guess = only(box("p:Box", SIZE, material=None, density=DeclaredValue(value=2000.0, source="estimated")))
    assert guess.mass_source == "estimated"


def test_thing_mass_scales_inertia_and_keeps_centre() -> None:
    found = only(box("p:Box", SIZE, centre=(0.01, 0.0, 0.0), mass=DeclaredValue(value=0.082, source="vendor")))
    assert (found.properties.mass, found.mass_source) == (0.082, "vendor")
    assert found.properties.centre == (0.01, 0.0, 0.0)
    assert np.array(found.properties.inertia) == pytest.approx(box_inertia(SIZE) * 0.082 / VOLUME)


def test_vendor_mass_needs_no_material() -> None:
    found = only(box("p:Box", SIZE, material=None, mass=DeclaredValue(value=0.082, source="vendor")), materials=())
    assert found.properties.mass == 0.082


def test_thing_centre_and_inertia_are_used() -> None:
    matrix = ((2e-5, 1e-6, 0.0), (1e-6, 3e-5, 0.0), (0.0, 0.0, 4e-5))
    found = only(box("p:Box", SIZE, com=DeclaredValue(value=(0.001, 0.002, 0.003)), matrix=DeclaredValue(value=matrix)))
    assert found.properties.centre == (0.001, 0.002, 0.003)
    assert found.properties.inertia == matrix
    assert (found.properties.mass, found.mass_source) == (pytest.approx(MASS), "derived")


def test_document_mass_scales_the_inertia() -> None:
    matrix = ((2e-5, 1e-6, 0.0), (1e-6, 3e-5, 0.0), (0.0, 0.0, 4e-5))
    derived = only(box("p:Box", SIZE), mass=stated(0.5, source="measured"))
    assert np.array(derived.properties.inertia) == pytest.approx(box_inertia(SIZE) * 0.5 / VOLUME)
    assert derived.mass_source == "measured"
    unknown = only(box("p:Box", SIZE, material=None), mass=stated(0.5))
    assert np.array(unknown.properties.inertia) == pytest.approx(box_inertia(SIZE) * 0.5 / VOLUME)
    assert unknown.mass_source == "stated"
    own = only(box("p:Box", SIZE, mass=DeclaredValue(value=0.25), matrix=DeclaredValue(value=matrix)), mass=stated(0.5))
    assert np.array(own.properties.inertia) == pytest.approx(np.array(matrix) * 2)
    no_mass_to_scale_by = only(box("p:Box", SIZE, material=None, matrix=DeclaredValue(value=matrix)), mass=stated(0.5))
    assert no_mass_to_scale_by.properties.inertia == matrix


def test_document_centre_keeps_the_inertia() -> None:
    """The prototype converted the centre of mass from millimetres to metres twice."""
    record = box("p:Box", SIZE, com=DeclaredValue(value=(0.004, 0.0, 0.0)))
    assert only(record).properties.centre == (0.004, 0.0, 0.0)
    found = only(record, com=stated(0.01, -0.02, 0.03))
    assert found.properties.centre == (0.01, -0.02, 0.03)
    assert np.array(found.properties.inertia) == pytest.approx(box_inertia(SIZE) * 1000)
    assert found.properties.mass == pytest.approx(MASS)


def test_document_inertia_is_used_unchanged() -> None:
    six = (2e-4, 3e-4, 4e-4, 1e-6, 2e-6, 3e-6)
    found = only(box("p:Box", SIZE, mass=DeclaredValue(value=0.25)), mass=stated(0.5), inertia=stated(*six))
    assert found.properties.inertia == ((2e-4, 1e-6, 2e-6), (1e-6, 3e-4, 3e-6), (2e-6, 3e-6, 4e-4))


def test_masses_of_frames_and_empty_things() -> None:
    model = assembly(
        "a",
        [
            component("part", "p:Box"),
            component("dot", None, laid("part.origin", np.eye(4)), frame=True),
            component(
                "board",
                None,
                laid("part.origin", t(0, 0, 0.1)),
                frame=True,
                mass=stated(0.012, source="measured"),
                com=stated(0.0, 0.0, 0.01),
            ),
            component("mark", "p:Mark", attach("mark.origin", "part.origin")),
        ],
    )
    found = linked(model, box("p:Box", SIZE), bare("p:Mark"))
    assert [(o.properties.mass, o.mass_source) for o in found.occurrences] == [
        (pytest.approx(MASS), "derived"),
        (0.0, "derived"),
        (0.012, "measured"),
        (0.0, "derived"),
    ]
    link = found.links[0].properties
    assert link.mass == pytest.approx(MASS + 0.012)
    assert link.centre == pytest.approx((0, 0, 0.012 * 0.11 / (MASS + 0.012)))


def parallel_axis(assembly: Assembly, frames: dict[int, np.ndarray]) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and inertia about it, summed over point masses: eight points at the corners of each box's equimomental box, which is
    the box scaled by 1/sqrt(3)."""
    points, weights = [], []
    for index, frame in frames.items():
        own = assembly.occurrences[index].properties
        assert own.mass > 0
        size = np.array(SIZE)
        for signs in itertools.product((-1, 1), repeat=3):
            corner = np.array(own.centre) + np.array(signs) * size / 2 / np.sqrt(3)
            points.append((frame @ [*corner, 1.0])[:3])
            weights.append(own.mass / 8)
    weight, place = np.array(weights), np.array(points)
    centre = weight @ place / weight.sum()
    d = place - centre
    inertia = sum(w * (x @ x * np.eye(3) - np.outer(x, x)) for w, x in zip(weight, d))
    return weight.sum(), centre, inertia


def test_link_inertia_is_in_its_named_frame() -> None:
    """The oracle is `parallel_axis`. The link's frame is that of the component it is named after."""
    seat, back, cap = t(0.05, 0.01, 0.02) @ ry(0.7), t(-0.03, 0.02, -0.02) @ rx(2.0), t(0.1, 0, 0) @ rz(0.3)
    record = box("p:Box", SIZE, centre=(0.01, 0.02, -0.01), mounts={"seat": seat, "back": back, "cap": cap})
    model = assembly(
        "a",
        [
            component("one", "p:Box"),
            component("two", "p:Box", attach("two.back", "one.seat"), mass=stated(0.7)),
            component("three", "p:Box", attach("three.back", "two.cap")),
        ],
        links={"body": "two"},
    )
    found = linked(model, record)
    two, three = mated(seat, back), mated(cap, back)
    frames = {0: np.linalg.inv(two), 1: np.eye(4), 2: three}
    mass, centre, inertia = parallel_axis(found, frames)
    link = found.links[0]
    assert (link.name, link.frame, link.members) == ("body", 1, (0, 1, 2))
    assert link.properties.mass == pytest.approx(mass, rel=1e-14)
    assert np.array(link.properties.centre) == pytest.approx(centre, abs=1e-14)
    assert np.array(link.properties.inertia) == pytest.approx(inertia, rel=1e-12, abs=1e-16)
    whole_robot = found.properties
    assert whole_robot.mass == pytest.approx(mass)
    assert np.array(whole_robot.centre) == pytest.approx((two @ [*centre, 1])[:3])
    assert np.array(whole_robot.inertia) == pytest.approx(two[:3, :3] @ inertia @ two[:3, :3].T)


# --- what can be wrong ---------------------------------------------------------------------------------------------


def test_missing_material_and_mass_is_reported() -> None:
    model = assembly("a", [component("humerus", "p:Box", line=7)])
    assert said(faults(model, box("p:Box", material=None))) == [
        (
            "NO_MATERIAL",
            "`humerus` (`p:Box`) has neither a material nor a mass",
            "add `material:` (known materials: `petg`) or `mass:`",
            7,
        )
    ]


def test_unknown_default_material_is_reported() -> None:
    model = assembly("a", [component("humerus", "p:Box", line=7)])
    report = faults(model, box("p:Box", material="pteg"))
    assert said(report) == [
        (
            "UNKNOWN_MATERIAL",
            "unknown default material `pteg` of `humerus` (`p:Box`)",
            "did you mean `petg`?",
            7,
        )
    ]
    near, note = report.diagnostics[0].notes
    assert near.message == "`petg` is defined here"
    assert note.message == "`p:Box` is defined here"
    assert note.span is not None
    assert (note.span.file, note.span.line) == ("/robots/parts/boxes.py", 12)


def test_unneeded_unknown_material_is_a_warning() -> None:
    model = assembly("a", [component("humerus", "p:Box", mass=stated(0.1), line=7)])
    assert said(warnings(model, box("p:Box", material="abs"))) == [
        (
            "UNKNOWN_MATERIAL",
            "unknown default material `abs` of `humerus` (`p:Box`)",
            "known materials: `petg`; set `material:`, or list a document that defines `abs` under `materials:`",
            7,
        )
    ]


def test_material_without_density_is_reported() -> None:
    model = assembly("a", [component("humerus", "p:Box", line=7)], materials=[material("petg", None)])
    assert said(faults(model, box("p:Box"))) == [
        (
            "NO_MATERIAL",
            "the material `petg` of `humerus` has no density",
            "add `density:` to `petg`, or `mass:` to `humerus`",
            7,
        )
    ]


@pytest.mark.parametrize(("process", "missing"), [
    (Process(infill=0.2), "`walls` and `line_width`"), (Process(infill=0.2, walls=2), "`line_width`"),
])
def test_infill_without_process_values_is_reported(process: Process, missing: str) -> None:
    model = assembly("a", [component("humerus", "p:Box", process=process, line=7)])
    assert said(faults(model, box("p:Box"))) == [
        (
            "INFILL",
            f"the print process of `humerus` lacks {missing}",
            f"add {missing} to the `process` of the material or of the component, or write `infill: 100 %`",
            7,
        )
    ]


def test_unphysical_inertia_is_reported() -> None:
    model = assembly("a", [component("humerus", "p:Box", line=7, inertia=stated(1e-4, 1e-4, 3e-4, 0, 0, 0, line=9))])
    assert said(faults(model, box("p:Box"))) == [
        (
            "NOT_PHYSICAL",
            "the inertia of `humerus` is not physical: the largest principal moment (0.0003 kg m^2) exceeds the sum "
            "of the other two (0.0001 + 0.0001)",
            "specify `inertia` relative to the centre of mass, in the axes of the component",
            9,
        )
    ]


def test_inertia_is_checked_for_the_whole_link() -> None:
    """An unphysical inertia is accepted if the inertia of its link is physical. An explicit inertia of 0 is always an error."""
    at = laid("humerus.origin", np.eye(4))
    flat = component("label", None, at, frame=True, mass=stated(0.001), inertia=stated(1e-9, 1e-9, 3e-9, 0, 0, 0))
    whole_link = component("humerus", "p:Box", inertia=stated(1e-4, 1e-4, 1e-4, 0, 0, 0))
    report = Report()
    linked = link(assembly("a", [whole_link, flat]), {"p:Box": box("p:Box")}, report)
    assert linked is not None and not report.failed
    none = component("label", None, at, frame=True, mass=stated(0.001), inertia=stated(0, 0, 0, 0, 0, 0))
    found = said(faults(assembly("a", [whole_link, none]), box("p:Box")))
    assert [(one[0], one[2]) for one in found] == [
        ("NOT_PHYSICAL", "remove `inertia` to use the computed inertia"),
    ]


def test_unphysical_inertia_of_a_thing_is_reported() -> None:
    matrix = ((1e-4, 0.0, 0.0), (0.0, -1e-4, 0.0), (0.0, 0.0, 1e-4))
    assert said(faults(assembly("a", [component("humerus", "p:Box", line=7)]), box("p:Box", matrix=DeclaredValue(value=matrix)))) == [
        (
            "NOT_PHYSICAL",
            "the inertia of `p:Box` is not physical: the principal moments (-0.0001, 0.0001, 0.0001 kg m^2) are not all positive",
            "return the inertia relative to the centre of mass in kg m^2 from `matrix_of_inertia()`",
            7,
        )
    ]


SWING = box("p:Box", SIZE, mounts={"top": t(0, 0, 0.02), "low": rx(np.pi) @ t(0, 0, 0.02)})


def test_moving_link_without_mass_is_reported() -> None:
    model = assembly(
        "a",
        [
            component("plate", "p:Box"),
            component("dot", None, frame=True, line=9),
            component("dash", None, laid("dot.origin", np.eye(4)), frame=True),
        ],
        [joint("j", "plate.top", "dot.origin")],
        modes=[mode("bench", whole("plate"))],
    )
    assert said(faults(model, SWING)) == [
        (
            "MASSLESS",
            "the moving link `dot` has no mass",
            "add `mass:` to a component of the link, or use `attach` instead of a joint",
            9,
        )
    ]


def test_moving_link_without_inertia_is_reported() -> None:
    model = assembly(
        "a",
        [component("plate", "p:Box"), component("dot", None, frame=True, line=9, mass=stated(0.1))],
        [joint("j", "plate.top", "dot.origin")],
        modes=[mode("bench", whole("plate"))],
    )
    assert said(faults(model, SWING)) == [
        (
            "NOT_PHYSICAL",
            "the inertia of the moving link `dot` is not physical: the principal moments (0, 0, 0 kg m^2) are not all positive",
            "add a mass to a component with geometry, or add `inertia:` to a component of the link",
            9,
        )
    ]


def test_static_massless_link_is_valid() -> None:
    """A massless link is valid if it does not move in any mode."""
    def model(base: str) -> object:
        return assembly(
            "a",
            [component("dot", None, frame=True, line=9), component("arm", "p:Box")],
            [joint("j", "dot.origin", "arm.top")],
            modes=[mode("bench", whole("dot")), mode("held", whole("dot"), base)],
        )

    linked(model("held"), SWING)  # type: ignore[arg-type]
    report = faults(model("free"), SWING)  # type: ignore[arg-type]
    assert said(report)[0][:2] == ("MASSLESS", "the moving link `dot` has no mass")
    assert report.diagnostics[0].notes[0].message == "the link contains component `dot` and moves in mode `held`"


def test_massless_definition_is_reported_once() -> None:
    leg = assembly(
        "leg", [component("hip", "p:Box"), component("toe", None, frame=True, line=9)], [joint("j", "hip.top", "toe.origin")]
    )
    model = assembly(
        "a", [component("body", "p:Box")] + [component(f"leg_{k}", leg, attach(f"leg_{k}.hip.low", "body.top")) for k in range(6)]
    )
    report = faults(model, SWING)
    assert [d.message for d in report.diagnostics] == ["the moving link `leg_0/toe` has no mass"]
    contents = "the link contains component `leg_0/toe` and moves in mode `default`"
    rule = "a massless link must be between two joints, and must not be the root of the mode"
    assert [n.message for n in report.diagnostics[0].notes] == [contents, rule, "included from here"]


# --- drives --------------------------------------------------------------------------------------------------------

SERVO = ActuatorRecord(kind="position", stall_torque=4.1, no_load_speed=4.8, gear_ratio=353.5, rotor_inertia=1e-7, kp=20.0, kv=1.0)


def driven(drive: Drive, servo: ActuatorRecord | None = SERVO, **over: object) -> tuple[object, ...]:
    model = assembly(
        "a",
        [component("servo", "p:Servo"), component("arm", "p:Box")],
        [joint("yaw", "servo.top", "arm.top", drive=drive, line=20, **over)],  # type: ignore[arg-type]
    )
    return model, box("p:Servo", mounts={"top": t(0, 0, 0.02)}, actuator=servo), SWING


def test_drive_fills_missing_joint_values() -> None:
    """Effort, velocity and armature come from the actuator unless the joint has its own."""
    edge = linked(*driven(Drive(component=whole("servo", 21)))).mates[0].joints[0]  # type: ignore[arg-type]
    assert edge is not None
    assert edge.actuator is not None
    assert (edge.limit.effort, edge.limit.velocity) == (4.1, 4.8)
    assert edge.dynamics.armature == pytest.approx(1e-7 * 353.5**2)
    assert (edge.actuator.kind, edge.actuator.kp, edge.actuator.kv, edge.actuator.effort) == ("position", 20.0, 1.0, 4.1)
    written = linked(*driven(Drive(component=whole("servo")), effort=3.0, velocity=2.0, armature=0.5)).mates[0].joints[0]  # type: ignore[arg-type]
    assert written is not None
    assert written.actuator is not None
    assert (written.limit.effort, written.limit.velocity, written.dynamics.armature, written.actuator.effort) == (
        3.0,
        2.0,
        0.5,
        3.0,
    )


def test_inline_drive_sets_joint_values() -> None:
    edge = linked(*driven(Drive(component=None, kind="motor", effort=2.0, armature=0.01))).mates[0].joints[0]  # type: ignore[arg-type]
    assert edge is not None
    assert edge.actuator is not None
    assert (edge.actuator.kind, edge.limit.effort, edge.dynamics.armature, edge.actuator.kp) == ("motor", 2.0, 0.01, None)


def test_effort_above_the_actuator_is_a_warning() -> None:
    assert said(warnings(*driven(Drive(component=whole("servo")), effort=5.0))) == [  # type: ignore[arg-type]
        (
            "EFFORT",
            "the effort limit of joint `yaw` (5 N*m) exceeds the effort of its actuator (4.1 N*m)",
            "lower `limit.effort`, or use a stronger actuator",
            21,
        )
    ]


def test_drive_component_without_actuator_is_reported() -> None:
    model, _, swing = driven(Drive(component=whole("arm", 33)))
    report = faults(model, box("p:Servo", mounts={"top": t(0, 0, 0.02)}, actuator=SERVO), swing)  # type: ignore[arg-type]
    assert said(report) == [
        (
            "NO_ACTUATOR",
            "`arm` (`p:Box`) has no actuator and cannot drive joint `yaw`",
            "known components with an actuator: `servo`",
            33,
        )
    ]
    assert report.diagnostics[0].notes[0].message == "`p:Box` is defined here"


def test_position_drive_without_gain_is_reported() -> None:
    weak = ActuatorRecord(kind="position", stall_torque=4.1)
    assert said(faults(*driven(Drive(component=whole("servo"), origin=()), weak))) == [  # type: ignore[arg-type]
        (
            "NO_GAIN",
            "the position drive of joint `yaw` has no gain `kp`",
            "set `kp` in the part's `Actuator`, or write the drive inline: `drive: {kind: position, kp: 20 N*m/rad}`",
            20,
        )
    ]
