"""Further results of `link`: the HAG, links, exported mounts, modes, raw attributes and bills of materials."""

from __future__ import annotations

import numpy as np
import pytest

from graph.builder import (
    as_matrix,
    assembly,
    attach,
    box,
    component,
    inv,
    joint,
    laid,
    linked,
    mated,
    mode,
    part,
    ref,
    rx,
    t,
    where,
    whole,
)
from thingc.model.assembly.hag import Definition, DefinitionEdge
from thingc.model.resolve.types import BomEntry

PLATE = box("p:Plate", mounts={"top": t(0, 0, 0.02), "foot": rx(np.pi) @ t(0, 0, 0.02)})
LEG = assembly(
    "leg",
    [component("hip", "p:Plate"), component("shin", "p:Plate"), component("toe", "p:Plate", attach("toe.foot", "shin.top"))],
    [joint("knee", "hip.top", "shin.foot")],
    mounts={"sole": "toe.top"},
    links={"shank": "toe"},
    raw=[(("joint", "knee", "margin"), "0.1"), (("option", "cone"), "elliptic")],
)


def test_hag_has_a_node_per_definition_and_labelled_edges() -> None:
    found = linked(
        assembly(
            "body",
            [
                component("torso", "p:Plate"),
                component("front", LEG, attach("front.hip.foot", "torso.top")),
                component("rear", LEG),
                component("imu", None, laid("torso.top", np.eye(4)), frame=True),
            ],
            [joint("swing", "torso.foot", "rear.sole")],
        ),
        PLATE,
    ).hag
    assert found.root == "body"
    assert found.definitions == (
        Definition(text="body", label="body", reference="body.yaml", kind="assembly"),
        Definition(text="p:Plate", label="p:Plate", reference="p:Plate", kind="part"),
        Definition(text="leg", label="leg", reference="leg.yaml", kind="assembly"),
        Definition(text="frame", label="frame", reference="frame", kind="frame"),
    )

    def edge(parent: str, child: str, name: str, mounts: str = "", joint: str | None = None) -> DefinitionEdge:
        return DefinitionEdge(parent=parent, child=child, component=name, mounts=mounts, joint=joint)

    assert found.edges == (
        edge("body", "p:Plate", "torso"),
        edge("body", "leg", "front", "hip.foot -> torso.top"),
        edge("body", "leg", "rear", "sole -> torso.foot", "swing"),
        edge("body", "frame", "imu", "in torso.top"),
        edge("leg", "p:Plate", "hip"),
        edge("leg", "p:Plate", "shin", "foot -> hip.top", "knee"),
        edge("leg", "p:Plate", "toe", "foot -> shin.top"),
    )


def test_equal_definition_objects_share_a_node() -> None:
    """Equal definitions share a node even if they are two objects. Other parameters or another document make another node."""
    twin = assembly("leg", [component("hip", part("p:Plate"))])
    other = assembly("leg", [component("hip", part("p:Plate"))])
    longer = assembly("leg", [component("hip", part("p:Plate"))], text="leg(length=0.2)")
    alike = assembly("leg", [component("hip", part("p:Plate"))], document="other/leg.yaml")
    found = linked(
        assembly(
            "body",
            [
                component("a", twin),
                component("b", other, attach("b.hip.foot", "a.hip.top")),
                component("c", longer, attach("c.hip.foot", "a.hip.top")),
                component("d", alike, attach("d.hip.foot", "a.hip.top")),
            ],
        ),
        PLATE,
    ).hag
    assert [d.text for d in found.definitions] == ["body", "leg", "p:Plate", "leg(length=0.2)", "leg [other/leg.yaml]"]
    assert [e.child for e in found.edges if e.parent == "body"] == ["leg", "leg", "leg(length=0.2)", "leg [other/leg.yaml]"]


BODY = assembly(
    "body",
    [
        component("torso", "p:Plate"),
        component("front", LEG, attach("front.hip.foot", "torso.top")),
        component("rear", LEG, attach("rear.sole", "torso.foot")),
    ],
    links={"chassis": "front"},
    mounts={"lens": "torso.top"},
    raw=[(("joint", "front.knee", "range"), "0 1")],
    modes=[
        mode(
            "walk",
            whole("torso"),
            "free",
            exclude=((whole("torso"), whole("rear")), (whole("front.shin"), whole("front.toe"))),
            adhesion=((ref("front.sole"), 100.0), (ref("rear.toe.top"), 50.0)),
        ),
        mode("stand", ref("front.sole"), "held", adhesion=((ref("front.sole"), 300.0),), actuators=("front/knee",)),
        mode("hang", whole("rear")),
        mode("hang2", ref("rear.origin"), "held"),
    ],
)


def test_links_have_index_name_and_frame() -> None:
    """torso + front/hip + rear/toe + rear/shin are one link. The outermost name is used, and nested names are prefixed with their path."""
    found = linked(BODY, PLATE)
    assert [o.path for o in found.occurrences] == [
        "torso",
        "front/hip",
        "front/shin",
        "front/toe",
        "rear/hip",
        "rear/shin",
        "rear/toe",
    ]
    assert found.link_of == (0, 0, 1, 1, 2, 0, 0)
    assert [(link.name, link.frame, link.members) for link in found.links] == [
        ("chassis", 1, (0, 1, 5, 6)),
        ("front/shank", 3, (2, 3)),
        ("rear/hip", 4, (4,)),
    ]
    up = mated(t(0, 0, 0.02), rx(np.pi) @ t(0, 0, 0.02))
    assert as_matrix(found.links[0].poses[0]) == pytest.approx(inv(up), abs=1e-15)
    assert as_matrix(found.links[0].poses[1]) == pytest.approx(np.eye(4))
    assert [s.line for s in found.links[1].origin] == [110, 1]


def test_modes_are_resolved() -> None:
    """Roots, excluded pairs, adhesions and actuators of modes refer to occurrences of the linked robot."""
    found = linked(BODY, PLATE)
    walk, stand, hang, hang2 = found.modes
    assert (walk.root.occurrence, walk.root.mount, walk.root.path) == (0, "origin", "torso/origin")
    assert (stand.root.occurrence, stand.root.mount, stand.root.path) == (3, "top", "front/sole")
    assert (hang.root.occurrence, hang.root.mount, hang.root.path) == (4, "origin", "rear/origin")
    assert hang2.root == hang.root
    assert walk.exclude == ((0, 2),)
    assert (walk.adhesion, stand.adhesion) == ({"front/sole": 100.0, "rear/toe/top": 50.0}, {"front/sole": 300.0})
    assert [(a.path, a.occurrence, a.mount, a.force) for a in found.adhesions] == [
        ("front/sole", 3, "top", 300.0),
        ("rear/toe/top", 6, "top", 50.0),
    ]
    assert (stand.base, stand.actuators, walk.actuators) == ("held", ("front/knee",), None)


def test_exported_mounts_of_all_levels_are_listed() -> None:
    found = linked(BODY, PLATE)
    assert [(m.path, m.occurrence, m.mount) for m in found.exported] == [
        ("lens", 0, "top"),
        ("front/sole", 3, "top"),
        ("rear/sole", 6, "top"),
    ]


def test_nested_raw_attributes_get_robot_paths() -> None:
    found = linked(BODY, PLATE)
    assert [(raw.path, raw.value) for raw in found.raw] == [
        (("joint", "front/knee", "range"), "0 1"),
        (("joint", "front/knee", "margin"), "0.1"),
        (("option", "cone"), "elliptic"),
        (("joint", "rear/knee", "margin"), "0.1"),
        (("option", "cone"), "elliptic"),
    ]
    assert found.raw[1].origin == where(130) + where(1)


def test_bom_entries_are_merged() -> None:
    """Values of the document override those of the Thing; other values are kept."""
    servo = box("p:Servo", bom={"make": "buy", "supplier": "Robotis", "number": "902-0135-000"})
    model = assembly("a", [component("servo", "p:Servo", bom=BomEntry(supplier="elsewhere", cost="12.50 EUR"))])
    assert linked(model, servo).occurrences[0].bom == BomEntry(
        number="902-0135-000", supplier="elsewhere", cost="12.50 EUR", make="buy"
    )


def test_linking_is_deterministic() -> None:
    assert linked(BODY, PLATE) == linked(BODY, PLATE)
