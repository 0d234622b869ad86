"""Raw attributes that cannot be set, against MuJoCo: exactly the attributes that MuJoCo interprets as names, or that move elements, are
refused."""

from __future__ import annotations

import re

import mujoco
import pytest

from thingc.model.resolve.raw_protected import CLASSES, MOTION, PLACE, REFERRING, find_protected
from thingc.targets.mjcf.raw import NAMED

PLACES = {
    "actuator": "<actuator><{}/></actuator>", "body": "<worldbody><{}/></worldbody>", "camera": "<worldbody><body><{}/></body></worldbody>",
    "equality": "<equality><{}/></equality>", "geom": "<worldbody><body><{}/></body></worldbody>",
    "joint": "<worldbody><body><{}/></body></worldbody>", "key": "<keyframe><{}/></keyframe>", "material": "<asset><{}/></asset>",
    "mesh": "<asset><{}/></asset>", "numeric": "<custom><{}/></custom>", "sensor": "<sensor><{}/></sensor>",
    "site": "<worldbody><body><{}/></body></worldbody>", "tendon": "<tendon><{}/></tendon>",
}
"""The place of an element of each kind in a model."""


def schema() -> dict[tuple[str, str], list[str]]:
    """Return the attributes of every element by section and tag, from the schema that MuJoCo prints."""
    found: dict[tuple[str, str], list[str]] = {}
    path: list[str] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        row = re.match(r"( {0,12})(\(world\))?(\w+) \([!?*R]\)\s*(.*)", line)
        if row is not None:
            depth = len(row[1]) // 3
            path = [*path[:depth], row[3]]
            found.setdefault((path[1] if depth > 1 else "", path[-1]), []).extend(row[4].split())
        elif line.strip():
            found[(path[1] if len(path) > 2 else "", path[-1])].extend(line.split())
    return found


SCHEMA = schema()


def elements(kind: str) -> list[tuple[str, list[str]]]:
    """Return tags and attributes of the elements that a kind of raw attribute applies to."""
    section, tags = NAMED[kind]
    where = {"worldbody": ("body", ""), None: ("body", "")}.get(section, (section or "",))
    return [(tag, attributes) for (owner, tag), attributes in SCHEMA.items() if owner in where and (tags is None or tag in tags)]


def is_a_name(kind: str, tag: str, attribute: str) -> bool:
    """Return whether MuJoCo looks up another element by the value of the attribute."""
    text = PLACES[kind].format(f'{tag} {attribute}="no_such"')
    try:
        mujoco.MjModel.from_xml_string(f"<mujoco>{text}</mujoco>")
    except ValueError as fault:
        named = re.search(r"'no_such'|unknown target body|unknown default childclass", str(fault))
        return named is not None and "keyword" not in str(fault)
    return False


@pytest.mark.parametrize("kind", PLACES)
def test_attributes_that_are_names_are_refused(kind: str) -> None:
    found = {(tag, attribute) for tag, attributes in elements(kind) for attribute in attributes if is_a_name(kind, tag, attribute)}
    assert {one for one in found if find_protected((kind, "some", one[1])) is None} == set()
    assert all(find_protected((kind, "some", "name")) for _, attributes in elements(kind) if "name" in attributes)


def test_all_other_attributes_are_allowed() -> None:
    attributes = {(kind, one) for kind in PLACES for _, listed in elements(kind) for one in listed}
    assert {one for _, one in attributes} >= REFERRING | CLASSES  # every one is one of MuJoCo's
    moving = {"joint": MOTION, "body": PLACE, "site": PLACE}
    refused = {(kind, one) for kind, one in attributes if find_protected((kind, "some", one)) is not None}
    assert {one for kind, one in refused if one not in moving.get(kind, ())} <= REFERRING | CLASSES | {"name"}
    for path in (
        ("joint", "a", "damping"), ("geom", "a", "type"), ("visual", "rgba", "joint"), ("visual", "scale", "camera"), ("joint", "name"),
        ("option", "timestep"), ("compiler", "boundmass"), ("key", "home", "qpos"), ("default", "collision", "geom", "solref"), (),
    ):
        assert find_protected(path) is None, path


SOME = ("0.3 0.4 0.5", "0.1 0.2 0.3 0.4", "0 1 0 1 0 0", "0 0 0 1 1 1", "0.3", "true", "slide", "capsule", "0.1 0.1")
"""Some valid attribute values."""

MODEL = """<mujoco><worldbody><body {body}>
  <joint range="-1 1" {joint}/><geom size="0.1"/><site size="0.1" {site}/>
</body></worldbody></mujoco>"""


def frames(**more: str) -> list[list[float]] | None:
    """Return the poses of body, joint and site in a small model, and the reference of its coordinate; None if MuJoCo refuses it."""
    try:
        model = mujoco.MjModel.from_xml_string(MODEL.format(**{"body": "", "joint": "", "site": "", **more}))
    except ValueError:
        return None
    told = (model.body_pos, model.body_quat, model.body_mocapid, model.jnt_type, model.jnt_axis, model.jnt_pos, model.qpos0, model.site_pos,
            model.site_quat)
    return [list(map(float, one.ravel())) for one in told]


@pytest.mark.parametrize("kind", ["body", "joint", "site"])
def test_attributes_that_move_elements_are_refused(kind: str) -> None:
    """`modes.json` and the keyframes would otherwise describe another robot than the model."""
    listed = {one for _, attributes in elements(kind) for one in attributes if not is_a_name(kind, kind, one)}
    moved = {
        one for one in listed for value in SOME
        for with_it in ((f'{one}="{value}" type="capsule"',) if (kind, one) == ("site", "fromto") else (f'{one}="{value}"',))
        if frames(**{kind: with_it}) not in (None, frames())
    }
    assert moved and {one for one in moved if find_protected((kind, "some", one)) is None} == set()


def test_every_kind_suggests_a_document_key() -> None:
    for kind in NAMED:
        message, instead = find_protected((kind, "some", "name")) or ("", "")
        assert kind in message and "`" in instead
    assert set(NAMED) == set(PLACES)
