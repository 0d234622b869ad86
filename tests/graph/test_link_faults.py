"""Errors of `link` for invalid input: exact messages and positions, and one diagnostic per fault."""

from __future__ import annotations

import numpy as np

from graph.builder import (
    CAP,
    PLATE,
    Drive,
    assembly,
    attach,
    component,
    faults,
    joint,
    laid,
    linked,
    mimic,
    mode,
    notes,
    pose,
    ref,
    said,
    where,
    whole,
)
from thingc.base.diagnostics import Code, Report
from thingc.model.assembly.linking import link
from thingc.model.resolve.types import AssemblyDefinition

# --- mounts --------------------------------------------------------------------------------------------------------


def test_misspelled_mount_is_reported_with_suggestion() -> None:
    model = assembly(
        "a", [component("plate", "p:Plate"), component("cap", "p:Cap", attach("cap.foot", "plate.servo_set", line=8))]
    )
    report = faults(model, PLATE, CAP)
    assert said(report) == [("UNKNOWN_MOUNT", "`plate` (`p:Plate`) has no mount `servo_set`", "did you mean `servo_seat`?", 8)]
    assert notes(report) == [("`p:Plate` is defined here", "/robots/parts/boxes.py", 12)]
    assert report.diagnostics[0].path == "plate/servo_set"


def test_all_placements_are_checked_in_one_run() -> None:
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("cap", "p:Cap", attach("cap.fot", "plate.servo_seet", line=8)),
            component("dot", None, laid("plate.board", np.eye(4), line=9), frame=True),
            component("arm", "p:Cap"),
        ],
        [joint("j", "plate.foott", "arm.tip", line=10)],
        mounts={"tool": "cap.tool"},
    )
    assert said(faults(model, PLATE, CAP)) == [
        ("UNKNOWN_MOUNT", "`cap` (`p:Cap`) has no mount `fot`", "did you mean `foot`?", 8),
        ("UNKNOWN_MOUNT", "`plate` (`p:Plate`) has no mount `servo_seet`", "did you mean `servo_seat`?", 8),
        ("UNKNOWN_MOUNT", "`plate` (`p:Plate`) has no mount `board`", "known mounts: `foot`, `origin`, `servo_seat`", 9),
        ("UNKNOWN_MOUNT", "`arm` (`p:Cap`) has no mount `tip`", "did you mean `top`?", 10),
        ("UNKNOWN_MOUNT", "`plate` (`p:Plate`) has no mount `foott`", "did you mean `foot`?", 10),
        ("UNKNOWN_MOUNT", "`cap` (`p:Cap`) has no mount `tool`", "known mounts: `foot`, `origin`, `top`", 120),
    ]


def hand(**exported: str) -> AssemblyDefinition:
    return assembly("hand", [component("cap", "p:Cap")], mounts=exported, line=60)


def test_unexported_mount_of_nested_assembly_is_reported() -> None:
    model = assembly(
        "a", [component("plate", "p:Plate"), component("h", hand(grip="cap.foot"), attach("h.gripp", "plate.foot", line=8))]
    )
    report = faults(model, PLATE, CAP)
    assert said(report) == [("UNKNOWN_MOUNT", "`h` (`hand`) exports no mount `gripp`", "did you mean `grip`?", 8)]
    assert notes(report) == [("`hand` exports its mounts here", "/robots/robot.yaml", 80)]


def test_invalid_exported_mount_is_reported_at_its_export() -> None:
    """The error is at the export, not at its two uses."""
    inner = hand(grip="cap.fooot")
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("one", inner, attach("one.grip", "plate.foot", line=8), line=3),
            component("two", inner, attach("two.grip", "plate.foot", line=9), line=4),
        ],
    )
    report = faults(model, PLATE, CAP)
    assert said(report) == [("UNKNOWN_MOUNT", "`cap` (`p:Cap`) has no mount `fooot`", "did you mean `foot`?", 80)]
    assert notes(report)[1] == ("included from here", "/robots/robot.yaml", 3)


def test_nested_mount_is_shown_as_written() -> None:
    model = assembly("a", [component("plate", "p:Plate"), component("h", hand(), attach("h.cap.foof", "plate.foot", line=8))])
    assert said(faults(model, PLATE, CAP)) == [
        ("UNKNOWN_MOUNT", "`h.cap` (`p:Cap`) has no mount `foof`", "did you mean `foot`?", 8)
    ]


def test_unknown_components_in_a_path_are_reported() -> None:
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("h", hand(), attach("h.cup.foot", "plate.foot", line=8)),
            component("c", "p:Cap", attach("c.foot", "plat.foot", line=9)),
            component("d", "p:Cap", attach("d.foot", "plate.x.foot", line=10)),
        ],
    )
    assert said(faults(model, PLATE, CAP)) == [
        ("UNKNOWN_COMPONENT", "`h` (`hand`) has no component `cup`", "did you mean `cap`?", 8),
        ("UNKNOWN_COMPONENT", "`a` has no component `plat`", "did you mean `plate`?", 9),
        ("UNKNOWN_COMPONENT", "`plate` (`p:Plate`) has no component `x`", "no components are available", 10),
    ]


def test_added_mount_with_an_existing_name_is_reported() -> None:
    model = assembly(
        "a",
        [
            component("plate", "p:Plate", mounts={"foot": np.eye(4)}, line=3),
            component("h", hand(grip="cap.foot"), attach("h.grip", "plate.foot"), mounts={"grip": np.eye(4)}, line=5),
            component("dot", None, laid("plate.foot", np.eye(4)), frame=True, mounts={"origin": np.eye(4)}, line=7),
        ],
    )
    report = faults(model, PLATE, CAP)
    assert said(report) == [
        ("MOUNT_CLASH", "`plate` already has a mount `foot`", "rename the new mount", 4),
        ("MOUNT_CLASH", "`dot` already has a mount `origin`", "rename the new mount", 8),
        ("MOUNT_CLASH", "`h` already has a mount `grip`", "rename the new mount", 6),
    ]


# --- placement -----------------------------------------------------------------------------------------------------


def test_placement_cycle_is_reported() -> None:
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("a", "p:Cap", attach("a.foot", "c.top", line=7)),
            component("b", "p:Cap", attach("b.foot", "a.top", line=8)),
            component("c", "p:Cap"),
            component("tail", "p:Cap", attach("tail.foot", "b.top", line=11)),
        ],
        [joint("j", "b.top", "c.foot", line=9)],
    )
    report = faults(model, PLATE, CAP)
    assert said(report) == [
        (
            "PLACEMENT_CIRCLE",
            "components are placed in a cycle: `a` on `c`, `c` on `b`, `b` on `a`",
            "place one of these components on a component outside the cycle, or add `loop: true` to a joint that closes a loop",
            7,
        )
    ]
    assert notes(report) == [("`c` is placed here", "/robots/robot.yaml", 9), ("`b` is placed here", "/robots/robot.yaml", 8)]


def test_joint_within_one_component_is_reported() -> None:
    model = assembly("a", [component("plate", "p:Plate"), component("a", "p:Cap")], [joint("j", "a.top", "a.foot", line=9)])
    assert said(faults(model, PLATE, CAP)) == [
        ("PLACED_ON_ITSELF", "joint `j` connects component `a` with itself (`a.top` and `a.foot`)",
         "use mounts of two different components", 9)
    ]


def test_unknown_mount_is_reported_before_self_connection() -> None:
    """The error is the unknown mount at its own position, not that both sides are one component."""
    model = assembly("a", [component("plate", "p:Plate"), component("a", "p:Cap")], [joint("j", "a.foott", "a.foot", line=9)])
    assert said(faults(model, PLATE, CAP)) == [("UNKNOWN_MOUNT", "`a` (`p:Cap`) has no mount `foott`", "did you mean `foot`?", 9)]


def test_component_placed_on_itself_is_reported() -> None:
    model = assembly("a", [component("plate", "p:Plate"), component("a", "p:Cap", attach("a.foot", "a.top", line=7))])
    assert said(faults(model, PLATE, CAP)) == [
        (
            "PLACEMENT_CIRCLE",
            "components are placed in a cycle: `a` on `a`",
            "place one of these components on a component outside the cycle",
            7,
        )
    ]


def test_two_unplaced_components_are_reported() -> None:
    """The resolver already reports this. `link` still gives a diagnostic instead of an exception."""
    model = assembly("a", [component("plate", "p:Plate", line=3), component("cap", "p:Cap", line=4)])
    assert said(faults(model, PLATE, CAP)) == [
        (
            "INCOMPLETE",
            "`cap` is not connected to the base of `a`",
            "place every component except the base with `attach`, `at` or a joint",
            4,
        )
    ]


def test_component_placed_twice_is_reported() -> None:
    """The resolver already reports this. `link` still gives a diagnostic instead of an exception."""
    model = assembly(
        "a",
        [component("plate", "p:Plate", line=3), component("cap", "p:Cap", attach("cap.foot", "plate.foot", line=5), line=4)],
        [joint("j", "plate.foot", "cap.top")],
    )
    assert said(faults(model, PLATE, CAP)) == [
        (
            "INCOMPLETE", "`a` is not connected to the base of `a`", "place every component except the base with `attach`, `at` or a joint",
            100,
        )
    ]


def test_earlier_errors_are_not_reported_again() -> None:
    """Components that failed in an earlier pass are omitted silently; new faults are reported."""
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("gone", None),
            component("cap", "p:Cap", attach("cap.foot", "gone.top")),
            component("dot", None, laid("cap.nothing", np.eye(4), line=9), frame=True),
        ],
        [joint("j", "gone.x", "arm.foot")],
        mounts={"tool": "gone.y"},
        links={"base_link": "gone"},
        modes=[mode("m", ref("gone.top"))],
    )
    report = Report()
    report.add(Code.PART_MISSING, "earlier", where(1))
    assert link(model, {"p:Plate": PLATE, "p:Cap": CAP}, report) is None
    assert [d.message for d in report.diagnostics[1:]] == ["`cap` (`p:Cap`) has no mount `nothing`", "`a` has no component `arm`"]


def test_incomplete_model_is_always_reported() -> None:
    model = assembly("a", [component("plate", "p:Plate"), component("gone", "p:Unknown", attach("gone.foot", "plate.foot"))])
    assert said(faults(model, PLATE)) == [
        (
            "INCOMPLETE", "`a` is not connected to the base of `a`", "place every component except the base with `attach`, `at` or a joint",
            100,
        )
    ]


# --- links ---------------------------------------------------------------------------------------------------------


def test_two_names_for_one_link_are_reported() -> None:
    model = assembly(
        "a",
        [component("plate", "p:Plate"), component("cap", "p:Cap", attach("cap.foot", "plate.foot"))],
        links={"base": "plate", "lid": "cap"},
    )
    report = faults(model, PLATE, CAP)
    assert said(report) == [
        (
            "LINK_NAMED_TWICE", "the names `lid` and `base` refer to the same link",
            "remove one of the two names", 111,
        )
    ]
    assert notes(report) == [("`base` is defined here", "/robots/robot.yaml", 110)]


def test_duplicate_link_names_are_reported() -> None:
    """A name that equals another link's name is reported. Exchanging two names is valid."""
    model = assembly(
        "a",
        [component("plate", "p:Plate", line=3), component("cap", "p:Cap", line=4)],
        [joint("j", "plate.foot", "cap.foot")],
        links={"cap": "plate"},
        modes=[mode("m", whole("plate"))],
    )
    report = faults(model, PLATE, CAP)
    assert said(report) == [
        (
            "DUPLICATE_LINK",
            "two links have the name `cap`",
            "choose another name for one of the links under `links:`",
            110,
        )
    ]
    assert notes(report) == [("`cap` is defined here", "/robots/robot.yaml", 4)]
    swapped = assembly(
        "a",
        [component("plate", "p:Plate"), component("cap", "p:Cap")],
        [joint("j", "plate.foot", "cap.foot")],
        links={"cap": "plate", "plate": "cap"},
        modes=[mode("m", whole("plate"))],
    )
    assert [link.name for link in linked(swapped, PLATE, CAP).links] == ["cap", "plate"]


# --- modes and poses -----------------------------------------------------------------------------------------------


def arm(
    poses: list[object],
    *,
    yaw: tuple[float, float] = (-1.0, 2.0),
    follows: object = None,
    used: tuple[str, ...] = (),
    **over: object,
) -> AssemblyDefinition:
    return assembly(
        "a",
        [component("plate", "p:Plate"), component("cap", "p:Cap"), component("lid", "p:Cap")],
        [
            joint("yaw", "plate.foot", "cap.foot", lower=yaw[0], upper=yaw[1], line=30),
            joint("slide", "cap.top", "lid.foot", "prismatic", lower=0.0, upper=0.02, mimic=follows, line=31),
        ],  # type: ignore[arg-type]
        poses=poses,
        modes=[mode("m", whole("plate"), poses=used)],
        **over,  # type: ignore[arg-type]
    )


def test_pose_outside_limits_is_reported() -> None:
    report = faults(arm([pose("home", yaw=np.radians(150), slide=-0.001)]), PLATE, CAP)
    assert said(report) == [
        (
            "POSE_LIMITS",
            "the value of `yaw` in pose `home` (150 deg) is outside its limits (-57.2958 deg to 114.592 deg)",
            "write a value within the limits, or widen the limits",
            301,
        ),
        (
            "POSE_LIMITS",
            "the value of `slide` in pose `home` (-1 mm) is outside its limits (0 mm to 20 mm)",
            "write a value within the limits, or widen the limits",
            302,
        ),
    ]
    assert notes(report) == [("`yaw` is defined here", "/robots/robot.yaml", 30)]


def test_pose_at_a_limit_is_valid() -> None:
    linked(arm([pose("home", yaw=2.0, slide=0.02), pose("low", yaw=-1.0, slide=0.0)], used=("home", "low")), PLATE, CAP)


def test_unset_joint_outside_limits_is_reported_if_used() -> None:
    """The default 0 of a joint is checked only for poses that a mode uses."""
    linked(arm([pose("home", slide=0.01)], yaw=(0.5, 1.0)), PLATE, CAP)
    assert said(faults(arm([pose("home", slide=0.01)], yaw=(0.5, 1.0), used=("home",)), PLATE, CAP)) == [
        (
            "POSE_LIMITS",
            "the value of `yaw` in pose `home` (0 deg) is outside its limits (28.6479 deg to 57.2958 deg)",
            "set `yaw` in the pose",
            300,
        )
    ]


def test_mimic_joint_outside_limits_is_reported() -> None:
    assert said(faults(arm([pose("home", yaw=1.0)], follows=mimic("yaw", 0.03), used=("home",)), PLATE, CAP)) == [
        (
            "POSE_LIMITS",
            "the value of `slide` in pose `home` (30 mm) is outside its limits (0 mm to 20 mm)",
            "change `yaw`, which `slide` mimics, or widen the limits",
            301,
        )
    ]


def test_unknown_poses_and_joints_are_reported() -> None:
    assert said(faults(arm([pose("home", yav=1.0)], used=("hme",)), PLATE, CAP)) == [
        ("UNKNOWN_POSE", "mode `m` uses the undefined pose `hme`", "did you mean `home`?", 200),
        ("UNKNOWN_JOINT", "pose `home` sets `yav`, which is not a moving joint", "did you mean `yaw`?", 301),
    ]


def test_wrong_references_of_a_mode_are_reported() -> None:
    model = assembly(
        "a",
        [component("plate", "p:Plate")],
        modes=[
            mode(
                "m",
                ref("plate.foof", 21),
                exclude=((whole("plate"), whole("plat", 22)),),
                adhesion=((ref("plate.fooot", 23), 3.0),),
            ),
        ],
    )
    assert said(faults(model, PLATE)) == [
        ("UNKNOWN_MOUNT", "`plate` (`p:Plate`) has no mount `foof`", "did you mean `foot`?", 21),
        ("UNKNOWN_COMPONENT", "`a` has no component `plat`", "did you mean `plate`?", 22),
        ("UNKNOWN_MOUNT", "`plate` (`p:Plate`) has no mount `fooot`", "did you mean `foot`?", 23),
    ]


def test_drive_without_actuator_part_is_reported() -> None:
    """A drive that refers to an assembly or a frame is an error."""
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("h", hand(), attach("h.cap.foot", "plate.foot")),
            component("arm", "p:Cap"),
            component("arm2", "p:Cap"),
            component("dot", None, laid("plate.foot", np.eye(4)), frame=True),
        ],
        [
            joint("j", "plate.foot", "arm.foot", drive=Drive(component=whole("h", 9))),
            joint("k", "plate.foot", "arm2.foot", drive=Drive(component=whole("dot", 10))),
        ],
        modes=[mode("m", whole("plate"))],
    )
    help = "add `actuator = Actuator(...)` to its class, or write the drive inline: `drive: {kind: position, kp: 20 N*m/rad}`"
    assert said(faults(model, PLATE, CAP)) == [
        ("NO_ACTUATOR", "`h` (`hand`) is an assembly and cannot drive joint `j`", help, 9),
        ("NO_ACTUATOR", "`dot` is a frame and cannot drive joint `k`", help, 10),
    ]
