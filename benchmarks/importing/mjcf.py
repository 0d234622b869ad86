"""Import existing robots in MJCF, compare them with the originals, and print a table:
`python benchmarks/importing/mjcf.py NAME=FILE_OR_FOLDER...`.

Use the unpacked wheels of robosuite 1.5 and dm_control 1.0.50 as folders. MuJoCo reads each original file. The robot is also imported, with
five random links as additional roots. In random states, the study compares poses, mass matrices, bias forces, forces and contacts. The
study also compares shapes, limits, gains, keyframes, the order of actuators and sensors, and 200 steps with random controls. For each
additional root, it compares the poses relative to this root, and the mass matrix when this root is held.

An export loss must explain each difference. MuJoCo finds contacts of meshes and of some other pairs iteratively, and chooses the axes of
meshes itself. Therefore these contacts only agree to 1e-4 m. If both models are equal without contacts, these contacts explain a different
trajectory or adhesion.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
import time
import warnings
from pathlib import Path

import mujoco

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
from tally import Tally, collections

import thingc
from importing.as_original import Pair, in_files
from thingc.base.diagnostics import Report, Severity
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.mjcf.compiled_source import CompiledSource
from thingc.tools.importing.mjcf.flattened_source import FlattenedSource
from thingc.tools.importing.xml_source import read_xml

EXACT = 1e-9
TOLERANCES = {"contacts": 1e-6, "contacts by iteration": 1e-4, "shapes": 1e-6}
TOUCHING = ("contacts of", "a contact pair", "the excluded contact of", "mesh `")
ROOTS = 5
MOVES = ("contacts of", "a contact pair", "the softness of", "actuator", "tendon", "equality", "the excluded contact of", "drag of")
EXPLAINS = {
    "contacts": TOUCHING, "contacts by iteration": TOUCHING, "shapes": ("mesh `",), "limits": ("unlimited slide",),
    "actuators": ("actuator", "tendon"), "passive": ("tendon", "nonlinear damping or stiffness", "drag of"), "gains": ("the gain of",),
    "trajectory": MOVES,
}


def main() -> int:
    """Import all robots and compare them. Return 1 if a difference has no explanation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="+", metavar="NAME=PATH")
    parser.add_argument("--states", type=int, default=50)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    tally = Tally(f"MuJoCo {mujoco.__version__}")
    print("| robot | bodies | joints | roots | s | |\n|---|---|---|---|---|---|")
    for name, file in collections(arguments.paths, ".xml"):
        try:
            spec = mujoco.MjSpec.from_file(str(file))
            theirs = spec.compile()
        except (ValueError, RuntimeError):
            continue  # not a complete model
        if theirs.njnt == 0:
            continue
        row, fine = one(file, spec, theirs, arguments.states)
        tally.add(name, row[-1], fine)
        print(f"| {file.parent.name}/{file.stem} | {theirs.nbody - 1} | {theirs.njnt} | {' | '.join(row)} |", flush=True)
    print(f"\n{tally}")
    return int(tally.failed > 0)


def one(file: Path, spec: mujoco.MjSpec, theirs: mujoco.MjModel, states: int) -> tuple[list[str], bool]:
    """Compare one robot. Return its row in the table, and whether every difference has an explanation."""
    report, begun = Report(), time.perf_counter()
    imported = import_robot(str(file), report)
    took = f"{time.perf_counter() - begun:.2f}"
    if imported is None:
        said = report.sorted_diagnostics()[0]
        return ["", took, f"refused: {said.code.code} {said.message}"], True
    original = read(file, spec, theirs)
    known = {*json.loads(imported.files["import.json"])["names"]["links"]} & {*original.bodies.values()}
    links = [link.name for link in imported.robot.links if link.name in known]
    roots = random.Random(file.stem).sample(links, min(ROOTS, len(links)))
    with_roots = rooted(file, roots)
    with tempfile.TemporaryDirectory() as folder:
        for name, content in with_roots.files.items():
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            (Path(folder) / name).write_bytes(content)
        try:
            ours, *others = (mode.model() for mode in thingc.compile(Path(folder) / with_roots.document).modes.values())
        except thingc.CompileError as fault:
            first = next(one.message for one in fault.diagnostics if one.severity is Severity.ERROR)
            return [str(len(roots)), took, f"COMES IN, and is refused: {first}"], False
    named = {"body": original.bodies, "joint": original.joints, "site": original.sites, "tendon": original.tendons,
             "actuator": original.actuators, "sensor": original.sensors}
    pair = Pair(theirs, ours, named, in_files(imported))
    weights = {one.link.name: one.new for one in with_roots.repaired}
    for root, model in zip(roots, others, strict=True):
        pair.compare_rooted(model, root, weights)
    worst = pair.compare(states=states) | {"order": float(reordered(pair))}
    differ = {kind for kind, far in worst.items() if not far <= TOLERANCES.get(kind, EXACT)}
    lost = [loss.what for loss in imported.losses]
    why = {kind: sorted({what.split("`")[0].strip() for what in lost if what.startswith(EXPLAINS.get(kind, ()))}) for kind in differ}
    roughly = {"trajectory"} & differ if pair.iterated else set()
    roughly |= {"actuators"} & differ if "contacts by iteration" in worst and imported.robot.adhesions else set()
    if roughly:
        alone = pair.without_contacts().compare(states=states)
        for kind in (kind for kind in roughly if alone[kind] <= EXACT):
            why[kind].append("contacts by iteration")
    words = [f"{kind}: {', '.join(why[kind]) or f'DIFFERS by {worst[kind]:.1g}'}" for kind in sorted(differ)]
    return [str(len(roots)), took, "; ".join(words) or "as it was"], all(why.values())


def reordered(pair: Pair) -> bool:
    """Return whether the two models have actuators or sensors in a different order. New sensors before existing sensors also count as a
    different order.
    """
    sensors = pair.words.get("sensors", {})
    named = {number: sensors[name] for number, name in pair.named["sensor"].items() if name in sensors}
    places = [pair.ours.sensor(name).id for _, name in sorted(named.items())]
    drives = [pair.ours.actuator(name).id for _, name in sorted(pair.drives.items())]
    return drives != [*range(len(drives))] or places != [*range(len(places))]


def rooted(file: Path, roots: list[str]) -> Imported:
    """Import the robot with a mode for each of the links `roots`.

    If joints are attached to the world and the world can move in a mode, the world gets a mass of 1 mg.
    """
    requests = (ImportRequest(roots=roots, repair=repair) for repair in (None, "nearest"))
    found = next((one for request in requests if (one := import_robot(str(file), Report(), request)) is not None), None)
    assert found is not None
    return found


def read(file: Path, spec: mujoco.MjSpec, theirs: mujoco.MjModel) -> CompiledSource:
    """Read a file with MuJoCo. Elements without a name get the name that the import gives them."""
    root = read_xml(str(file), file.read_bytes(), Report())
    assert root is not None
    return CompiledSource(FlattenedSource(root=root, text="", lines=(), files={}, meshes={}, included=(), losses=()), spec, theirs)


if __name__ == "__main__":
    sys.exit(main())
