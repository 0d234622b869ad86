"""`modes.json` to modes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from thingc.modes.faults import ModesError
from thingc.modes.frames import inverse
from thingc.modes.tree import Cut, Hold, Joint, Link, Mimic, Mode

FILE = "modes.json"
KINDS = frozenset({"hinge", "slide"})


def read(path: str | os.PathLike[str]) -> dict[str, Mode]:
    """The modes in a build folder, or in a `modes.json`. Raises `FileNotFoundError`, and `ModesError` for anything else in it."""
    place = os.fspath(path)
    if os.path.isdir(place):
        place = os.path.join(place, FILE)
    if not os.path.isfile(place):
        raise FileNotFoundError(f"there is no `{place}`: `thingc build` writes it")
    with open(place, "rb") as stream:
        return parse(stream.read(), place)


def parse(text: str | bytes, name: str = FILE) -> dict[str, Mode]:
    """The modes that a `modes.json` describes; `name` is how errors call it. Raises `ModesError`."""
    try:
        found: Mapping[str, Any] = json.loads(text)
        return {mode: _mode(mode, described) for mode, described in found.items()}
    except (ValueError, AttributeError, TypeError, IndexError) as fault:
        if isinstance(fault, ModesError):
            raise
        raise ModesError(f"`{name}` is no {FILE} of thingc: {fault}") from fault
    except KeyError as fault:
        raise ModesError(f"`{name}` has no {fault} where this version of thingc has one: build the robot again") from fault


def _mode(name: str, described: Mapping[str, Any]) -> Mode:
    links = tuple(
        Link(
            name=str(link["name"]), X_root_link=_array(link["X_root_link"], 4, 4), mass=float(link["mass"]),
            centre=_array(link["centre"], 3), inertia=_array(link["inertia"], 3, 3),
        )
        for link in described["links"]
    )
    index = {link.name: number for number, link in enumerate(links)}
    return Mode(
        name=name,
        root=str(described["root"]),
        base=str(described["base"]),
        gravity=_array(described["gravity"], 3),
        X_world_root=_array(described["X_world_root"], 4, 4),
        links=links,
        joints=tuple(_joint(joint, links, index) for joint in described["joints"]),
        named=MappingProxyType({pose: MappingProxyType(dict(q)) for pose, q in described["poses"].items()}),
        holds=tuple(
            Hold(
                path=path, link=index[hold["link"]], X_LM=_array(hold["X_LM"], 4, 4), X_WM=_array(hold["X_WM"], 4, 4),
                turns=hold["carries"] == "force",
            )
            for path, hold in described["holds"].items()
        ),
        cuts=tuple(
            Cut(
                name=str(cut["name"]), kind=str(cut["kind"]), parent=index[cut["parent"]], child=index[cut["child"]],
                X_PA=_array(cut["X_PA"], 4, 4), X_CB=_array(cut["X_CB"], 4, 4),
            )
            for cut in described.get("cuts", ())
        ),
        bases=MappingProxyType({pose: _array(rows, 4, 4) for pose, rows in described.get("bases", {}).items()}),
        standing_on=tuple(str(path) for path in described.get("standing_on", ())),
    )


def _joint(described: Mapping[str, Any], links: tuple[Link, ...], index: Mapping[str, int]) -> Joint:
    name, kind = str(described["name"]), str(described["kind"])
    if kind not in KINDS:
        raise ModesError(f"joint `{name}` is a `{kind}`, which this version of thingc does not know")
    parent, child = index[described["parent"]], index[described["child"]]
    X_PJ = _array(described["X_PJ"], 4, 4)
    mimic = described["mimic"]
    return Joint(
        name=name,
        kind=kind,
        parent=parent,
        child=child,
        X_PJ=X_PJ,
        axis=_array(described["axis"], 3),
        X_JL=_kept(inverse(X_PJ) @ inverse(links[parent].X_root_link) @ links[child].X_root_link),
        offset=float(described["offset"]),
        reversed=bool(described["reversed"]),
        armature=float(described["armature"]),
        mimic=None if mimic is None else Mimic(
            joint=str(mimic["joint"]), multiplier=float(mimic["multiplier"]), offset=float(mimic["offset"]),
        ),
        qpos=int(described["qpos"]),
        dof=int(described["dof"]),
    )


def _array(values: object, *shape: int) -> Any:
    return _kept(np.array(values, dtype=float).reshape(shape))


def _kept(array: Any) -> Any:
    array.setflags(write=False)
    return array
