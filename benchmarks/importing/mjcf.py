"""Real robots of MJCF, imported: `python benchmarks/importing/mjcf.py FILE_OR_FOLDER...`, a table of what came back.

Material: the wheels of robosuite 1.5 and dm_control 1.0.50, unpacked. A file is read by MuJoCo as it is, and imported; compared are, in
random states, poses, mass matrix, bias, forces and contacts, then limits, gains and keyframes, and 200 steps with random controls. What
differs has to be explained by a loss; a trajectory also by meshes that touch (MuJoCo finds another depth of a mesh whose axes it has laid
otherwise), if it is the same without contacts.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import warnings
from pathlib import Path

import mujoco
import numpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
import thingc
from importing.as_original import Pair
from thingc.diagnostics import Report, Severity
from thingc.importing import Imported, import_robot
from thingc.importing.mjcf.flat import Flat
from thingc.importing.mjcf.original import Original
from thingc.importing.xml_source import read_xml

EXACT, TOUCHING = 1e-9, 1e-6
MESH = 7
MOVES = ("contacts of", "a contact pair", "how soft", "actuator", "tendon", "equality", "that `", "drag of")
EXPLAINS = {
    "contacts": ("contacts of", "a contact pair", "that `", "mesh `"), "limits": ("slide",), "actuators": ("actuator", "tendon"),
    "passive": ("tendon", "what of joint", "drag of"), "gains": ("the gain of",), "keyframes": ("of keyframe",), "trajectory": MOVES,
}


def main() -> int:
    """Exit code 1 where something differs that nothing explains."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--states", type=int, default=50)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    files = [file for path in arguments.paths for file in (sorted(path.rglob("*.xml")) if path.is_dir() else [path])]
    count = failed = 0
    print("| robot | bodies | joints | s | |\n|---|---|---|---|---|")
    for file in files:
        try:
            spec = mujoco.MjSpec.from_file(str(file))
            theirs = spec.compile()
        except (ValueError, RuntimeError):
            continue  # no model by itself
        if theirs.njnt == 0:
            continue
        said, fine = one(file, spec, theirs, arguments.states)
        count, failed = count + 1, failed + (not fine)
        print(f"| {file.parent.name}/{file.stem} | {theirs.nbody - 1} | {theirs.njnt} | {said} |", flush=True)
    print(f"\n{count - failed} of {count} are as they were, or said why not", file=sys.stderr)
    return int(failed > 0)


def one(file: Path, spec: mujoco.MjSpec, theirs: mujoco.MjModel, states: int) -> tuple[str, bool]:
    """What became of a robot, and whether all of it is as it was, or explained."""
    report, begun = Report(), time.perf_counter()
    imported = import_robot(str(file), report)
    took = f"{time.perf_counter() - begun:.2f}"
    if imported is None:
        said = report.ordered()[0]
        return f"{took} | refused: {said.code.code} {said.message}", True
    with tempfile.TemporaryDirectory() as folder:
        for name, content in imported.files.items():
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            (Path(folder) / name).write_bytes(content)
        try:
            ours = thingc.compile(Path(folder) / imported.document).modes["source"].model()
        except thingc.CompileError as fault:
            first = next(one.message for one in fault.diagnostics if one.severity is Severity.ERROR)
            return f"{took} | COMES IN, and is refused: {first}", False
    pair = paired(file, imported, spec, theirs, ours)
    worst = pair.compare(states=states)
    differ = {kind for kind, far in worst.items() if not far <= (TOUCHING if kind == "contacts" else EXACT)}
    if not differ:
        return f"{took} | as it was", True
    lost = [loss.what for loss in imported.losses]
    why = {kind: sorted({what.split("`")[0].strip() for what in lost if what.startswith(EXPLAINS.get(kind, ()))}) for kind in differ}
    touching = [k for k in range(theirs.ngeom) if theirs.geom_type[k] == MESH and (theirs.geom_contype[k] or theirs.geom_conaffinity[k])]
    if "trajectory" in differ and touching and _free_of_contacts(pair) <= EXACT:
        why["trajectory"].append("meshes touch")
    words = [f"{kind}: {', '.join(why[kind]) or f'DIFFERS by {worst[kind]:.1g}'}" for kind in sorted(differ)]
    return f"{took} | {'; '.join(words)}", all(why.values())


def paired(file: Path, imported: Imported, spec: mujoco.MjSpec, theirs: mujoco.MjModel, ours: mujoco.MjModel) -> Pair:
    """The two models; what the source gives no name has the one that the import has made up."""
    root = read_xml(str(file), file.read_bytes(), Report())
    assert root is not None
    original = Original(Flat(root=root, text="", lines=(), files={}, meshes={}, losses=()), spec, theirs)
    named = {"body": original.bodies, "joint": original.joints, "site": original.sites, "actuator": original.actuators}
    return Pair(theirs, ours, named, json.loads(imported.files["import.json"])["names"])


def _free_of_contacts(pair: Pair) -> float:
    """How far the trajectories are apart where nothing touches."""
    for model in (pair.theirs, pair.ours):
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    pair.worst.pop("trajectory")
    pair.trajectory(numpy.random.default_rng(1), 200)
    return pair.worst["trajectory"]


if __name__ == "__main__":
    sys.exit(main())
