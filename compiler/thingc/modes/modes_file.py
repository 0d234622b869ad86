"""Parse the file `modes.json`, which a build writes for switching between modes at run time."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from thingc.modes.errors import ModesError
from thingc.modes.frames import Array, inverse
from thingc.modes.partial_bases import PartBase
from thingc.modes.tree import Ball, Cut, Hold, Joint, Link, Mimic, Mode

FILE = "modes.json"
VERSION = 2


def load_modes(path: str | os.PathLike[str]) -> dict[str, Mode]:
    """Load all modes of a robot from its build folder or from its file `modes.json`.

    Raises `FileNotFoundError` if the file does not exist, and `ModesError` if the file is invalid.
    """
    place = os.fspath(path)
    if os.path.isdir(place):
        place = os.path.join(place, FILE)
    if not os.path.isfile(place):
        raise FileNotFoundError(f"there is no `{place}`: run `thingc build` to create it")
    with open(place, "rb") as stream:
        return parse(stream.read(), place)


def parse(text: str | bytes, name: str = FILE) -> dict[str, Mode]:
    """Parse the content of a file `modes.json`, and return the modes by name.

    `name` is the name of the file in error messages. Raises `ModesError` if the content is invalid.
    """
    try:
        modes: Mapping[str, Any] = json.loads(text)
        for mode, described in modes.items():
            if described.get("version") != VERSION:
                raise ModesError(f"mode `{mode}` was written by another version of thingc: build the robot again")
        order = _coordinates(next(iter(modes.values()), {}))
        return {mode: _mode(mode, described, order) for mode, described in modes.items()}
    except (ValueError, AttributeError, TypeError, IndexError) as fault:
        if isinstance(fault, ModesError):
            raise
        raise ModesError(f"`{name}` is not a {FILE} of thingc: {fault}") from fault
    except KeyError as fault:
        raise ModesError(f"`{name}` has no {fault}, which this version of thingc requires: build the robot again") from fault


def _coordinates(described: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of all joint coordinates of a mode: first those of joints in the tree, then those of loop-closing joints."""
    joints = [*described.get("joints", ()), *described.get("cuts", ())]
    return tuple(str(coordinate["name"]) for joint in joints for coordinate in joint["coordinates"])


def _mode(name: str, described: Mapping[str, Any], order: tuple[str, ...]) -> Mode:
    index = {str(link["name"]): number for number, link in enumerate(described["links"])}
    links = tuple(
        Link(
            name=str(link["name"]), X_root_link=_array(link["X_root_link"], 4, 4), mass=float(link["mass"]),
            centre=_array(link["centre"], 3), inertia=_array(link["inertia"], 3, 3),
            fixed_to=index[link["fixed_to"]] if "fixed_to" in link else None,
        )
        for link in described["links"]
    )
    base, X_world_root = str(described["base"]), _array(described["X_world_root"], 4, 4)
    part: PartBase | None
    match base:
        case "planar" | "ball":
            part = PartBase(kind=base, X_WA=_array(described["X_world_at"], 4, 4), X0_WR=X_world_root)
        case "fixed" | "held" | "free":
            part = None
        case _:
            raise ModesError(f"mode `{name}` has a base that this version of thingc does not support (`{base}`): build the robot again")
    return Mode(
        name=name,
        root=str(described["root"]),
        base=base,
        part=part,
        gravity=_array(described["gravity"], 3),
        X_world_root=X_world_root,
        links=links,
        coordinates=order,
        joints=tuple(coordinate for joint in described["joints"] for coordinate in _joints(joint, index)),
        named=MappingProxyType({pose: MappingProxyType(dict(q)) for pose, q in described["poses"].items()}),
        holds=tuple(
            Hold(
                path=path, link=index[hold["link"]], anchor=str(hold["anchor"]), X_LM=_array(hold["X_LM"], 4, 4),
                X_WM=_array(hold["X_WM"], 4, 4), turns=hold["carries"] == "force",
            )
            for path, hold in described["holds"].items()
        ),
        cuts=tuple(
            Cut(
                name=str(cut["name"]), kind=str(cut["kind"]), parent=index[cut["parent"]], child=index[cut["child"]],
                X_PA=_array(cut["X_PA"], 4, 4), X_CB=_array(cut["X_CB"], 4, 4),
                coordinates=tuple(str(coordinate["name"]) for coordinate in cut["coordinates"]),
                twists=_array([[*twist["angular"], *twist["linear"]] for twist in cut["coordinates"]], len(cut["coordinates"]), 6),
            )
            for cut in described.get("cuts", ())
        ),
        bases=MappingProxyType({pose: _array(rows, 4, 4) for pose, rows in described.get("bases", {}).items()}),
        standing_on=tuple(str(path) for path in described.get("standing_on", ())),
        tendons=tuple((float(inertia), described["tendons"][path]) for path, inertia in described.get("tendon_armature", {}).items()),
    )


def _joints(described: Mapping[str, Any], index: Mapping[str, int]) -> Iterator[Joint]:
    """Yield the coordinates of a joint in the order in which the tree of the mode traverses them.

    If the tree traverses the joint from child to parent, the order of the coordinates is reversed and their motions are inverted.
    """
    is_reversed = bool(described["reversed"])
    to_parent, to_child = _array(described["X_PJ"], 4, 4), inverse(_array(described["X_CJ"], 4, 4))
    if is_reversed:
        to_parent, to_child = inverse(to_child), inverse(to_parent)
    coordinates = described["coordinates"][::-1] if is_reversed else described["coordinates"]
    last_number = len(coordinates) - 1
    ball = None
    if described["kind"] in ("ball", "free"):
        ball = Ball(
            name=str(described["name"]), coordinates=tuple(str(coordinate["name"]) for coordinate in described["coordinates"][-3:]),
            reversed=is_reversed, R=_freeze(-to_child[:3, :3].T if is_reversed else to_child[:3, :3].T),
        )
    for number, coordinate in enumerate(coordinates):
        mimic, twist = coordinate["mimic"], _array([*coordinate["angular"], *coordinate["linear"]], 6)
        yield Joint(
            name=str(coordinate["name"]),
            kind=str(described["kind"]),
            parent=index[described["parent"]],
            child=index[described["child"]],
            first=number == 0,
            X_PJ=_freeze(to_parent) if number == 0 else NOWHERE,
            twist=_freeze(-twist) if is_reversed else twist, X_JL=_freeze(to_child) if number == last_number else NOWHERE,
            offset=float(coordinate["offset"]),
            reversed=is_reversed,
            armature=float(coordinate["armature"]),
            mimic=None if mimic is None else Mimic(
                joint=str(mimic["joint"]), multiplier=float(mimic["multiplier"]), offset=float(mimic["offset"]),
                higher=tuple(float(factor) for factor in mimic.get("higher", ())),
            ),
            in_model=MappingProxyType({str(name): float(ratio) for name, ratio in coordinate["in_model"].items()}),
            qpos=tuple(int(address) for address in coordinate["qpos"]),
            dof=tuple(int(address) for address in coordinate["dof"]),
            ball=ball if any(coordinate["angular"]) else None,
        )


def _array(values: object, *shape: int) -> Any:
    return _freeze(np.array(values, dtype=float).reshape(shape))


def _freeze(array: Any) -> Any:
    array.setflags(write=False)
    return array


NOWHERE: Array = _freeze(np.eye(4))
"""The identity pose (4, 4)."""
