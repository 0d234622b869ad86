"""Compare models that thingc computes without a compilation with models that are compiled:
`python benchmarks/variants/patched.py [--count N] [DOCUMENT ...]`.

The settings change every number of a document on which parts do not depend, a few numbers at a time. A number gets N random values that
differ by at most 5 % from its value in the document. In 10 % of all cases, it gets its own value, 0, or a bound of the document instead,
because the compiler may take a different branch there. For valid settings, the model of `thingc.family(DOCUMENT).models` must equal the
model that MuJoCo compiles. The comparison covers every array and every number of `opt`, `stat` and `vis`, in all modes. With `--parts`, the
settings also change a number on which parts depend, to one of three values.

The default documents are those of the arm and of MInchW, and two documents of `tests/families` that use features which the robots do not
use.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco

import thingc
from thingc.base.source import MappingNode, Node, ScalarNode
from thingc.base.units import Quantity
from thingc.batch.families import NoModel
from thingc.batch.mujoco_arrays.equality import different_fields

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from families.documents import WORKSPACE  # noqa: E402

SECTIONS = ("parameters", "components", "joints", "tendons", "poses", "modes", "simulation", "defaults")
AT_ONCE = 4
SHARES = (0.97, 1.0, 1.04)
"""Factors by which a number on which parts depend is multiplied."""
MEETING = 0.1
"""Probability that a number gets its own value, 0, or a bound."""
NESTED = {
    f"components.{leg}.joints.{joint}.{path}": value
    for leg in ("front", "rear") for joint in ("yaw", "knee", "ankle")
    for path, value in (
        ("dynamics.damping", "0.02 N*m*s/rad"), ("dynamics.armature", "0.01 kg*m^2"), ("dynamics.friction", "0.03 N*m"),
        ("limit.lower", "-1.57 rad"), ("limit.upper", "1.57 rad"), ("limit.effort", "4 N*m"),
    )
}
"""Numbers in the legs of MInchW, which are defined in the document of the leg."""


def numbers(family: thingc.RobotFamily) -> dict[str, float]:
    """Return the value of every number in the document in SI units. The keys are names of parameters or paths."""
    tree = family._root.tree
    found: dict[str, float] = {}
    for section in SECTIONS:
        for path, _ in scalars(tree.entries.get(section), (section,)):
            name = path[1] if section == "parameters" else ".".join(path)
            if section == "parameters" and len(path) > 2 and path[2] != "value":
                continue
            kind = family._reader.kind(name)
            if isinstance(kind, Quantity):
                found[name] = kind.value
    return found


def where_branches_meet(family: thingc.RobotFamily, known: dict[str, float]) -> dict[str, list[float]]:
    """Return special values for each number, in SI units: its own value, 0, and the bounds of a parameter."""
    bounds = {name: [family._reader.kind(f"parameters.{name}.{key}") for key in ("min", "max")] for name in known if "." not in name}
    return {
        name: [value, 0.0, *(bound.value for bound in bounds.get(name, ()) if isinstance(bound, Quantity))] for name, value in known.items()
    }


def scalars(node: Node | None, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], ScalarNode]]:
    """Yield every scalar node below a node, with its path."""
    if isinstance(node, ScalarNode):
        yield path, node
    elif isinstance(node, MappingNode):
        for key, inner in node.entries.items():
            yield from scalars(inner, (*path, key))


def drawn(
    known: dict[str, float], meeting: dict[str, list[float]], geometry: set[str], modelling: list[str], count: int, source: random.Random,
) -> Iterator[list[dict[str, Any]]]:
    """Yield lists of settings. All settings of a list have the same keys: random numbers except those in `geometry`, and one number of
    `modelling`, if any.
    """
    def value(name: str) -> float:
        if source.random() < MEETING:
            return source.choice(meeting[name])
        return known[name] * source.uniform(0.95, 1.05) or source.uniform(-0.01, 0.01)

    names = [name for name in known if name not in geometry]
    while count > 0:
        chosen = source.sample(names, min(AT_ONCE, len(names)))
        more = source.sample(modelling, min(1, len(modelling)))
        many = min(count, 50)
        yield [
            {name: value(name) for name in chosen}
            | {name: known[name] * source.choice(SHARES) for name in more} for _ in range(many)
        ]
        count -= many


def compared(document: str, count: int, store: str | None, visual: bool, parts: bool) -> Counter[str]:
    """Return the number of equal models by the way in which thingc computed them, and the number of different models."""
    tally: Counter[str] = Counter()
    source = random.Random(1)
    with thingc.family(document, store=store, verify=0) as family:
        known = numbers(family)
        for name, text in NESTED.items() if family.name == "minchw" else ():
            known[name] = family._reader.read({name: text}).values[0]
        meeting = where_branches_meet(family, known)
        ways = {name: family.explain(name) for name in known}
        tally.update(f"{getattr(way, 'way', 'refused')}: numbers" for way in ways.values())
        geometry = {name for name, way in ways.items() if getattr(way, "way", "passes") in ("passes", "parts")}
        modelling = [name for name, way in ways.items() if parts and getattr(way, "way", "") == "parts"]
        for mode in family.modes:
            models = family._models_of(mode, visual)
            for many in drawn(known, meeting, geometry, modelling, count // len(family.modes), source):
                read = [family._read(one) for one in many]
                whole = [models._compile(one) for _, one in read]
                for settings, one, model, other in zip(many, read, models.each(read, share=True), whole, strict=True):
                    cache = models.caches.get((one[1].names, one[1].texts))
                    plan = cache.find(one[1]) if cache is not None else None
                    way = "passes" if plan is None else "other parts" if plan[0].exchange is not None else type(plan[0].template).__name__
                    if isinstance(model, NoModel) or isinstance(other, tuple):
                        tally["refused alike" if isinstance(model, NoModel) and isinstance(other, tuple) else "REFUSED OTHERWISE"] += 1
                        continue
                    wrong = different_fields(model, other)
                    tally[f"equal by {way}" if not wrong else "DIFFERENT"] += 1
                    if wrong:
                        print(document, mode, settings, wrong)
    return tally


def main() -> int:
    """Compare the models of all documents. Return 1 if a model differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("documents", nargs="*", metavar="DOCUMENT")
    parser.add_argument("--count", type=int, default=2000, help="number of settings per document (default: %(default)s)")
    parser.add_argument("--store", help="cache of built parts")
    parser.add_argument("--visual", action="store_true", help="include visual geometry")
    parser.add_argument("--parts", action="store_true", help="vary numbers that change the geometry of parts")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        wrong = sum(printed(document, arguments) for document in arguments.documents or usual(Path(folder)))
    print(f"MuJoCo {mujoco.__version__}")
    return 1 if wrong else 0


def usual(folder: Path) -> list[str]:
    """Return the paths of the default documents. The documents of tests are written to `folder`."""
    for name, text in WORKSPACE.items():
        (folder / name).write_text(text)
    own = [str(folder / name) for name in ("everything.yaml", "strung.yaml")]
    return [f"{ROOT}/assemblies/arm.yaml", f"{ROOT}/assemblies/minchw/minchw.yaml", *own]


def printed(document: str, arguments: argparse.Namespace) -> int:
    """Compare the models of one document, and print the result. Return the number of wrong models."""
    begun = time.monotonic()
    tally = compared(document, arguments.count, arguments.store, arguments.visual, arguments.parts)
    words = ", ".join(f"{number} {what}" for what, number in sorted(tally.items()))
    print(f"{document}: {words} ({time.monotonic() - begun:.0f} s)", flush=True)
    return sum(number for what, number in tally.items() if what.isupper() or what.split()[0].isupper())


if __name__ == "__main__":
    sys.exit(main())
