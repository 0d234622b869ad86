"""Find the pairs of geoms that may collide. The pairs are selected from the tree of a model, by the rules of MuJoCo.

The rules are described in the documentation of MuJoCo, in the section "Selection" of the chapter Computation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations, product

from thingc.base.frozen_struct import FrozenStruct
from thingc.targets.xml_writer import Element

Values = Mapping[str, str]

PLANE = "plane"
WORLD = -1


class ContactGeom(FrozenStruct):
    """A geom that can collide with other geoms.

    The object contains the element of the geom (None for the floor of the scene), and its attributes. The attributes include those of the
    element's default class.
    """

    element: Element | None
    values: Values

    @property
    def type(self) -> str:
        """Return the type of the geom in MJCF."""
        return self.values.get("type", "sphere")

    def meets(self, other: ContactGeom) -> bool:
        """Return whether the masks of two geoms allow contacts."""
        (type_1, affinity_1), (type_2, affinity_2) = (
            (int(geom.values.get("contype", "1")), int(geom.values.get("conaffinity", "1"))) for geom in (self, other)
        )
        return bool(type_1 & affinity_2 or type_2 & affinity_1)

    @property
    def margin(self) -> float:
        """Return the contact margin [m] of the geom."""
        return float(self.values.get("margin", "0"))


FLOOR = ContactGeom(element=None, values={"type": PLANE})


def pairs(root: Element) -> Iterator[tuple[ContactGeom, ContactGeom]]:
    """Yield every pair of geoms that MuJoCo tests for contacts, including pairs with the floor.

    A pair is omitted if its bodies are rigidly connected, if they are parent and child, if `exclude` lists the pair, or if the masks of the
    geoms do not match. The pairs in `pair` elements are always included. At run time, MuJoCo also skips pairs of a held root and the floor,
    because neither moves.
    """
    classes = defaults(root, "geom")
    bodies = list(_bodies(root))
    index = {body.get("name"): number for number, (body, _) in enumerate(bodies)}
    contact = root.find_or_empty("contact").children
    excluded = {frozenset(index.get(item.get(body)) for body in ("body1", "body2")) for item in contact if item.tag == "exclude"}
    rigid: list[int] = []  # for every body, the body to which it is rigidly connected: itself or the world
    for number, (body, parent) in enumerate(bodies):
        moves = body.get("mocap") == "true" or any(child.tag in ("joint", "freejoint") for child in body.children)
        rigid.append(number if moves else WORLD if parent is None else rigid[parent])
    geoms = [list(_geoms(body, classes)) for body, _ in bodies]
    carrier = [WORLD if parent is None else rigid[parent] for _, parent in bodies]
    for number, own in enumerate(geoms):
        if rigid[number] != WORLD:
            yield from ((FLOOR, geom) for geom in own if FLOOR.meets(geom))
    for first, second in combinations(range(len(bodies)), 2):
        a, b = rigid[first], rigid[second]
        if a == b or frozenset((first, second)) in excluded:
            continue
        if WORLD not in (a, b) and (carrier[a] == b or carrier[b] == a):
            continue
        yield from (pair for pair in product(geoms[first], geoms[second]) if pair[0].meets(pair[1]))
    named = {geom.values.get("name"): geom for own in geoms for geom in own}
    for item in contact:
        first_name, second_name = item.get("geom1"), item.get("geom2")
        if item.tag == "pair" and first_name in named and second_name in named:
            yield named[first_name], named[second_name]


def defaults(root: Element, tag: str) -> dict[str, dict[str, str]]:
    """Return the default attributes of elements with a tag, by the name of the default class. The attributes of outer classes are
    included.
    """
    by_class: dict[str, dict[str, str]] = {}
    waiting = [(child, dict[str, str]()) for child in root.children if child.tag == "default"]
    while waiting:
        element, above = waiting.pop()
        values = {**above, **element.find_or_empty(tag).texts}
        by_class[element.get("class", "main")] = values
        waiting += [(child, values) for child in element.children if child.tag == "default"]
    return by_class


def _bodies(root: Element) -> Iterator[tuple[Element, int | None]]:
    """Yield every body of a model with the index of its parent body. Each body comes after its parent."""
    waiting: list[tuple[Element, int | None]] = [(child, None) for child in root.find_or_empty("worldbody").children]
    number = 0
    while waiting:
        element, parent = waiting.pop(0)
        if element.tag == "body":
            yield element, parent
            waiting += [(child, number) for child in element.children]
            number += 1


def _geoms(body: Element, classes: Mapping[str, Values]) -> Iterator[ContactGeom]:
    """Yield the geoms of a body that can collide with other geoms."""
    for element in body.children:
        if element.tag == "geom":
            values = {**classes.get(element.get("class", "main"), {}), **element.texts}
            if values.get("contype", "1") != "0" or values.get("conaffinity", "1") != "0":
                yield ContactGeom(element=element, values=values)
