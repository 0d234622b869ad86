"""Measure how many variants per second are created in memory: `python benchmarks/variants/memory.py [--count N] [--scale N]`.

The robot is the arm of `throughput.py` in one mode, and models have no visual geometry. Rates are per second of CPU time. In most lanes,
four numbers differ in each variant: a mass, a damping, a limit and a pose. The lane `lent` uses
`thingc.family(DOC).models(many, share=True)`. The lane `own` creates a new model for each variant (without `share`). The lane `results`
uses `evaluate(many)` without models, and the lane `fields` uses `batched(many)`, which returns only the arrays that differ. In the lane
`a mesh`, each variant has another pen. The records of the pens are in the store, but their models are not cached. In the lane `a part`,
each variant has a reach that was not used before, so another process models one part per variant. The CPU time of this process counts. The
lane `seen` creates the model of a variant that was compiled before, as an environment does at a reset.

The other lanes are programs without thingc, for comparison. In the lane `template`, MuJoCo compiles a text with another mass and with
meshes that were loaded once. The lane `edited` changes the mass of a body in an `MjSpec` and compiles it again. The lane `exchanged`
replaces the meshes of a pen in an `MjSpec`. The lane `patched` writes the four numbers of `lent` into the fields of one model and calls
`mj_setConst`. Other values that depend on the mass are not changed. The lane `copied` copies a model. In the lane `kernel`, another process
(`kernel.py`) creates, measures and meshes the part of `a part`, and writes its meshes, which is the minimum cost of modelling.

Machines differ by more than the effects that are measured. Therefore, each rate is also given relative to the program that does most of the
same work, measured in the same round. The columns `must` and `aim` contain the required ratio and the target ratio, computed from rates on
a reference machine (`MUSTS`, `BY_HAND`). The lanes run in turn, for several rounds, and the table contains the median, the smallest and the
largest rate. `--scale N` creates 1000, 10 000, ... N variants of one family, and prints the growth of the CPU time per variant and of the
memory.
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
from thingc.batch.families.models import ModelsOfMode
from thingc.driver.pipeline import request_of
from thingc.driver.session import Session
from thingc.model.resolve.resolver import Settings
from thingc.targets.mjcf.emit import sources as model_sources

MODE = "bench"


def numbers(index: int) -> dict[str, float]:
    """Return settings on which parts do not depend. The settings differ for each index."""
    part = (index * 0.6180339887498949) % 1.0
    return {"board_mass": 0.010 + 0.010 * part, "damping": 0.01 + 0.02 * part, "bend": 2.2 + 0.25 * part, "lift": 0.17 * part}


def pen(index: int) -> dict[str, float]:
    """Return the settings that select one of a few pens."""
    return {"pen_diameter": 0.010 + 0.0005 * index}


def reach(index: int) -> dict[str, float]:
    """Return the settings for a reach that has not been modelled before, on any machine."""
    return {"reach": 0.070 + 0.045 * ((index + FRESH) * 0.6180339887498949 % 1.0)}


def source(session: Session, settings: Settings) -> tuple[str, dict[str, bytes]]:
    """Return the MJCF text of a model without visual geometry, and its mesh files by name."""
    compilation = session.compile(settings, (MODE,))
    texts, assets = model_sources(request_of(session.environment, compilation, verify=False))
    files = {file: session.environment.store.read(stored.sha256) for file, stored in assets.items()}
    return texts[MODE].replace("<compiler ", '<compiler discardvisual="true" ', 1), files


def spent(family: thingc.RobotFamily, models: ModelsOfMode, indices: Iterator[int], many: int) -> dict[str, Callable[[int], None]]:
    """Return a function for each lane. The function creates a given number of variants, which use `many` different pens."""
    session = family._session
    text, held = source(session, Settings())
    pens = [source(session, Settings(parameters={name: f"{value} m" for name, value in pen(index).items()})) for index in range(many)]
    files = mujoco.MjVfs()
    for file, content in {file: content for _, some in ((text, held), *pens) for file, content in some.items()}.items():
        files[file] = content
    mass = re.compile(r' mass="[^"]*" fullinertia')
    spec = mujoco.MjSpec.from_string(text, vfs=files)
    names, *others = ([mesh.file for mesh in mujoco.MjSpec.from_string(one, vfs=files).meshes] for one in (text, *(one for one, _ in pens)))
    meshes = [dict(zip(names, other, strict=True)) for other in others]
    exchanging = mujoco.MjSpec.from_string(text, vfs=files)
    exchanging.compile(files)  # compiling removes the visual meshes
    exchanged = [(mesh, [other[mesh.file] for other in meshes]) for mesh in exchanging.meshes]
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
        spec.compile(files)

    def exchange(index: int) -> None:
        for mesh, own in exchanged:
            if mesh.file != own[index % many]:
                mesh.file = own[index % many]
        exchanging.compile(files)

    def patch(index: int) -> None:
        share = 1e-6 * index
        model.body_mass[number] = 0.05 + share
        model.dof_damping[:] = 0.01 + share
        model.jnt_range[2, 1] = model.actuator_ctrlrange[2, 1] = 2.2 + share
        model.key_qpos[0, 3] = model.key_ctrl[0, 3] = share
        mujoco.mj_setConst(model, data)

    def lent(count: int) -> None:
        for found in family.models(map(numbers, itertools.islice(indices, count)), mode=MODE, share=True):
            assert found

    def own(count: int) -> None:
        for found in family.models(map(numbers, itertools.islice(indices, count)), mode=MODE):
            assert found

    def other_pens(count: int) -> None:
        for index in range(count):
            models._cached.clear()
            assert next(family.models([pen(index % many)], mode=MODE, share=True))

    def parts(count: int) -> None:
        for index in itertools.islice(indices, count):
            assert next(family.models([reach(index)], mode=MODE, share=True))

    def seen(count: int) -> None:
        settings = [pen(index) for index in range(many)]
        for index in range(count):
            assert next(family.models([settings[index % many]], mode=MODE, share=True))

    return {
        "lent": lent, "own": own, "results": lambda count: check(family.evaluate([numbers(k) for k in itertools.islice(indices, count)])),
        "fields": lambda count: (family.batched([numbers(k) for k in itertools.islice(indices, count)], mode=MODE), None)[1],
        "a mesh": other_pens, "a part": parts, "seen": seen,
        "template": each(template),
        "edited": each(edit), "exchanged": each(exchange), "patched": each(patch), "copied": each(lambda k: copy.copy(model)),
    }


@contextlib.contextmanager
def kernel(parts: Path) -> Iterator[Callable[[int], None]]:
    """Return a context manager for the lane that uses the process `kernel.py`."""
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
    """Raise `SystemExit` if a result is not valid."""
    assert all(one.sound for one in found)


SLOW = {
    "a mesh": 0.05, "a part": 0.004, "kernel": 0.004, "template": 0.05, "edited": 0.1, "exchanged": 0.05, "own": 0.3, "copied": 0.3,
}
"""Fraction of the variants that each slow lane creates."""
ELSEWHERE = ("a part", "kernel")
"""Lanes in which another process does the work."""

BY_HAND = {"exchanged": 639.0, "patched": 46_000.0, "copied": 3_990.0, "kernel": 8.0}
"""Rates of the programs without thingc [1/s] on the reference machine."""
MUSTS = {
    "lent": ("patched", 10_000.0, 20_000.0), "own": ("copied", 2_000.0, 3_000.0), "results": ("patched", 2_000.0, 10_000.0),
    "fields": ("patched", 1_000.0, 1_000.0), "a mesh": ("exchanged", 300.0, 600.0), "a part": ("kernel", 7.0, 8.0),
    "seen": ("patched", 20_000.0, 20_000.0),
}
"""For each lane of thingc: the comparable program, and the required and the target rate [1/s] on the reference machine. If several programs
are comparable, the fastest one counts.
"""


def main() -> None:
    """Measure all lanes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4000, help="number of variants per round for the fastest lanes (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=5, help="measurements per lane, after one warm-up")
    parser.add_argument("--pens", type=int, default=16, help="number of meshes for the lane `a mesh` (default: %(default)s)")
    parser.add_argument("--scale", type=int, default=0, help="largest number of variants for growth (default: not measured)")
    parser.add_argument("--store", help="cache of built parts")
    parser.add_argument("--verify", type=int, help="compare every N-th model with a compilation (default: every 2^n-th)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="thingc-memory-") as name:
        document = workspace(Path(name))
        with thingc.family(document, store=arguments.store, mode=MODE, verify=arguments.verify) as family, \
                kernel(Path(name) / "parts") as alone:
            lanes = {**spent(family, family._models_of(MODE, False), itertools.count(), arguments.pens), "kernel": alone}
            rates: dict[str, list[float]] = {label: [] for label in lanes}
            for turn in range(-1, arguments.rounds):
                for label, make in lanes.items():
                    least = 1 if label in ELSEWHERE else min(arguments.pens, arguments.count)
                    count = max(int(arguments.count * SLOW.get(label, 1.0)), least)
                    clock = processor if label in ELSEWHERE else time.process_time
                    if label == "seen":
                        make(arguments.pens)  # the lane `a mesh` discards these models
                    begun = clock()
                    make(count)
                    if turn >= 0:
                        rates[label].append(count / max(clock() - begun, 1e-9))
            for label, found in rates.items():
                print(f"{label:9}{row(found)}/s of processor time{judged(label, rates)}", flush=True)
            grown(family, arguments.scale)


def row(found: list[float]) -> str:
    """Format the median, the smallest and the largest of several rates."""
    digits = 0 if min(found) > 20 else 1
    median, *ends = (f"{rate:.{digits}f}" for rate in (statistics.median(found), min(found), max(found)))
    return f"{median:>10} ({' to '.join(ends)})"


def judged(label: str, rates: dict[str, list[float]]) -> str:
    """Format the ratio of a lane to the comparable program, with the required and the target ratio. Return an empty string for the programs
    themselves.
    """
    if label not in MUSTS:
        return ""
    beside, must, aim = MUSTS[label]
    ratio = statistics.median(own / other for own, other in zip(rates[label], rates[beside], strict=True))
    return f"  {ratio:.3f} of {beside} (must {must / BY_HAND[beside]:.3f}, aim {aim / BY_HAND[beside]:.3f})"


def grown(family: thingc.RobotFamily, largest: int) -> None:
    """Create 1000, 10 000, ... `largest` variants of one family. Print the CPU time per variant, and the growth of memory."""
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
