"""How many variants a second stay in memory: `python benchmarks/variants/memory.py [--count N] [--scale N]`.

The arm of `throughput.py`, one mode, models without what is only drawn; per second of processor time. Four numbers differ in each variant
(a mass, a damping, a limit, a pose):

- `lent`: `thingc.family(DOC).models(many, share=True)`;
- `own`: the same without `share`, a model each;
- `results`: `evaluate(many)`, no model;
- `fields`: `batched(many)`, the arrays in which they differ;
- `a mesh`: another pen in each variant, of a few whose records are in the store and whose models are not kept;
- `a part`: another reach in each variant, never the same twice, so that one part is modelled for each (by another process, whose processor
  time counts);
- `seen`: the model of a variant that was compiled before, as an environment asks for it when it is reset;

and by hand, a mass in each, which stays where it is:

- `template`: a text with another mass in it, which MuJoCo compiles with its meshes handed over once;
- `edited`: an `MjSpec` whose body has another mass, compiled anew;
- `patched`: `body_mass` of one model, and `mj_setConst`; nothing else is what a compilation would give;
- `copied`: a copy of one model;
- `kernel`: the part of `a part` made by its class, measured and meshed, in another process that does nothing else (`kernel.py`): what
  modelling it takes, whoever asks.

They take turns, in rounds; the median is given, and the worst and the best. `--scale N` lends models of numbers to 1000, 10 000, ... N
variants, one after the other from one family, and says how processor time per variant and memory grow.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import itertools
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mujoco
from throughput import FRESH, processor, resident, workspace

import thingc
from thingc.emit import model_sources
from thingc.families.models import ModelsOfMode
from thingc.pipeline import request_of
from thingc.resolve import Settings

MODE = "bench"


def numbers(index: int) -> dict[str, float]:
    """Settings that model no part, never the same twice."""
    part = (index * 0.6180339887498949) % 1.0
    return {"board_mass": 0.010 + 0.010 * part, "damping": 0.01 + 0.02 * part, "bend": 2.2 + 0.25 * part, "lift": 0.17 * part}


def pen(index: int) -> dict[str, float]:
    """One of sixteen pens."""
    return {"pen_diameter": 0.010 + 0.0005 * (index % 16)}


def reach(index: int) -> dict[str, float]:
    """A reach that was never modelled before, on any machine."""
    return {"reach": 0.070 + 0.045 * ((index + FRESH) * 0.6180339887498949 % 1.0)}


def spent(family: thingc.RobotFamily, models: ModelsOfMode, indices: Iterator[int]) -> dict[str, Callable[[int], None]]:
    """What each lane does for so many variants."""
    session = family._session
    texts, assets = model_sources(request_of(session.environment, session.compile(Settings(), (MODE,)), verify=False))
    files = mujoco.MjVfs()
    held = {file: session.environment.store.read(stored.sha256) for file, stored in assets.items()}
    for file, data in held.items():
        files[file] = data
    text = texts[MODE].replace("<compiler ", '<compiler discardvisual="true" ', 1)
    mass = re.compile(r' mass="[^"]*" fullinertia')
    spec = mujoco.MjSpec.from_string(text, assets=held)
    model = mujoco.MjModel.from_xml_string(text, vfs=files)
    data = mujoco.MjData(model)
    body = spec.body("bracket")
    number = model.body("bracket").id

    def each(one: Callable[[int], Any]) -> Callable[[int], None]:
        def make(count: int) -> None:
            for index in itertools.islice(indices, count):
                one(index)

        return make

    def template(index: int) -> None:
        mujoco.MjModel.from_xml_string(mass.sub(f' mass="{0.05 + 1e-6 * index}" fullinertia', text, count=1), vfs=files)

    def edit(index: int) -> None:
        body.mass = 0.05 + 1e-6 * index
        spec.compile()

    def patch(index: int) -> None:
        model.body_mass[number] = 0.05 + 1e-6 * index
        mujoco.mj_setConst(model, data)

    def lent(count: int) -> None:
        for found in family.models(map(numbers, itertools.islice(indices, count)), mode=MODE, share=True):
            assert found

    def own(count: int) -> None:
        for found in family.models(map(numbers, itertools.islice(indices, count)), mode=MODE):
            assert found

    def exchanged(count: int) -> None:
        for index in range(count):
            models._kept.clear()
            assert next(family.models([pen(index)], mode=MODE, share=True))

    def parts(count: int) -> None:
        for index in itertools.islice(indices, count):
            assert next(family.models([reach(index)], mode=MODE, share=True))

    def seen(count: int) -> None:
        settings = [pen(index) for index in range(16)]
        for index in range(count):
            assert next(family.models([settings[index % 16]], mode=MODE, share=True))

    return {
        "lent": lent, "own": own, "results": lambda count: check(family.evaluate([numbers(k) for k in itertools.islice(indices, count)])),
        "fields": lambda count: (family.batched([numbers(k) for k in itertools.islice(indices, count)], mode=MODE), None)[1],
        "a mesh": exchanged, "a part": parts, "seen": seen,
        "template": each(template),
        "edited": each(edit), "patched": each(patch), "copied": each(lambda k: copy.copy(model)),
    }


@contextlib.contextmanager
def kernel(parts: Path) -> Iterator[Callable[[int], None]]:
    """The lane of `kernel.py`."""
    command = [sys.executable, str(Path(__file__).with_name("kernel.py")), str(parts)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        asked, answers = process.stdin, process.stdout

        def make(count: int) -> None:
            print(count, file=asked, flush=True)
            if not answers.readline():
                raise SystemExit("kernel.py has ended")

        yield make
        asked.close()


def check(found: list[Any]) -> None:
    """All are sound."""
    assert all(one.sound for one in found)


SLOW = {"a mesh": 0.05, "a part": 0.001, "kernel": 0.001, "template": 0.05, "edited": 0.1, "own": 0.3, "copied": 0.3}
"""Of how many of the variants the slower lanes are."""
ELSEWHERE = ("a part", "kernel")
"""Lanes whose work is done by another process."""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4000, help="variants of the quickest lanes, in each round (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=5, help="how often each lane is measured, after a first time that does not count")
    parser.add_argument("--scale", type=int, default=0, help="largest number of variants for growth (default: not measured)")
    parser.add_argument("--store", help="where modelled parts are kept")
    parser.add_argument("--verify", type=int, help="of so many models one is compared with a compilation (default: every 2^n-th)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="thingc-memory-") as name:
        document = workspace(Path(name))
        with thingc.family(document, store=arguments.store, mode=MODE, verify=arguments.verify) as family, \
                kernel(Path(name) / "parts") as alone:
            lanes = {**spent(family, family._of(MODE, False), itertools.count()), "kernel": alone}
            rates: dict[str, list[float]] = {label: [] for label in lanes}
            for turn in range(-1, arguments.rounds):
                for label, make in lanes.items():
                    count = max(int(arguments.count * SLOW.get(label, 1.0)), 1 if label in ELSEWHERE else min(16, arguments.count))
                    clock = processor if label in ELSEWHERE else time.process_time
                    begun = clock()
                    make(count)
                    if turn >= 0:
                        rates[label].append(count / max(clock() - begun, 1e-9))
            for label, found in rates.items():
                digits = 0 if min(found) > 20 else 1
                median, *ends = (f"{rate:.{digits}f}" for rate in (statistics.median(found), min(found), max(found)))
                print(f"{label:9}{median:>10}/s of processor time ({' to '.join(ends)})", flush=True)
            grown(family, arguments.scale)


def grown(family: thingc.RobotFamily, largest: int) -> None:
    """Lend models to 1000, 10 000, ... `largest` variants; print what each takes of processor time, and by how much memory has grown."""
    count = 1000
    while count <= largest:
        before, begun = resident(), time.process_time()
        for model in family.models(map(numbers, range(count)), mode=MODE, share=True):
            assert model
        took = time.process_time() - begun
        print(f"{count:8} variants: {1e6 * took / count:.1f} us of processor time for each, {resident() - before:+.1f} MB")
        count *= 10


if __name__ == "__main__":
    main()
