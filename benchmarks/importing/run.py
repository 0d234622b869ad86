"""Import existing robots in URDF and SDF, compare them with the originals, and print a table:
`python benchmarks/importing/run.py NAME=FILE_OR_FOLDER...`.

The options `--pinocchio` and `--drake` are paths of Python interpreters with these packages (`pip install pin`, `pip install drake`).
Original URDF files are read with pinocchio, and original SDF files with Drake, without joints that close loops. The package
`example-robot-data` contains URDF and SDF files. In random states, the study compares the poses of all links, mass matrices, bias forces,
gravity forces and limits. The study also compares five links as roots: the poses relative to the root, and the mass matrix when the root is
held. The mass matrix is not compared if Drake fixes the robot to the world. A loss or a repair must explain each difference.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy
from tally import Tally, collections

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
import thingc
from importing.as_original import in_files
from thingc.base.diagnostics import Report, Severity
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.sdf import ENDLESS

ROOTS = 5
POSE, RELATIVE = 1e-9, 1e-9
ORIGINAL = {".urdf": "ask_original.py", ".sdf": "ask_drake.py"}
"""The program that reads the original files, by suffix."""
KINDS = ("poses", "mass matrix", "bias", "gravity", "limits", "rooted poses", "rooted mass matrix")


def main() -> int:
    """Import all robots and compare them. Return 1 if a difference has no explanation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pinocchio")
    parser.add_argument("--drake")
    parser.add_argument("paths", nargs="+", metavar="NAME=PATH")
    parser.add_argument("--states", type=int, default=50)
    arguments = parser.parse_args()
    pythons = {suffix: python for suffix, python in ((".urdf", arguments.pinocchio), (".sdf", arguments.drake)) if python is not None}
    tally = Tally(" and ".join(name for name in ("pinocchio", "drake") if getattr(arguments, name) is not None))
    print(f"| robot | links | joints | s | {' | '.join(KINDS)} | |")
    print("|---" * (len(KINDS) + 5) + "|")
    for name, file in collections(arguments.paths, *pythons):
        row, fine = one(file, pythons[file.suffix], arguments.states)
        tally.add(name, row[-1], fine)
        print(f"| {file.stem} | {' | '.join(row)} |", flush=True)
    print(f"\n{tally}")
    return int(tally.failed > 0)


def one(file: Path, python: str, count: int) -> tuple[list[str], bool]:
    """Compare one robot. Return its row in the table, and whether every difference has an explanation."""
    chance, report, begun = random.Random(file.stem), Report(), time.perf_counter()
    first = import_robot(str(file), report, ImportRequest(repair="nearest"))
    empty = [""] * (len(KINDS) + 2)
    if first is None:
        said = report.sorted_diagnostics()[0]
        return ["", *empty, f"refused: {said.code.code} {said.message}"], True
    links = [link.name for link in first.robot.links]
    roots = chance.sample(links, min(ROOTS, len(links)))
    imported = import_robot(str(file), Report(), ImportRequest(roots=roots, repair="nearest"))
    assert imported is not None
    took = time.perf_counter() - begun
    names = in_files(imported)
    balls = {joint.name for one in imported.robot.attachments for joint in one.joints if joint.kind == "ball"}
    known, joints = names["links"] | names["frames"], {name: word for name, word in names["joints"].items() if name not in balls}
    row = [str(len(links)), str(len(joints)), f"{took:.2f}"]
    with tempfile.TemporaryDirectory() as folder:
        for name, content in imported.files.items():
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            (Path(folder) / name).write_bytes(content)
        try:
            compiled = thingc.compile(Path(folder) / imported.document)
        except thingc.CompileError as fault:
            said = next(one for one in fault.diagnostics if one.severity is Severity.ERROR)
            return [*row, *empty[2:], f"COMES IN, and is refused: {said.message}"], False
        models = {name: mode.model() for name, mode in compiled.modes.items()}
        known = {name: word for name, word in known.items() if all(there(model, word) for model in models.values())}
        states = [[[chance.uniform(-1.0, 1.0) for _ in joints] for _ in range(2)] for _ in range(count)]
        original = opened(file, {loop.name for loop in imported.robot.loops}, Path(folder))
        request = {"file": str(original), "joints": list(joints), "links": list(known), "roots": [name for name in roots if name in known],
                   "states": states}
        script = Path(__file__).parent / ORIGINAL[file.suffix]
        asked = subprocess.run([python, script], input=json.dumps(request), text=True, capture_output=True)
    if asked.returncode:
        return [*row, *empty[2:], asked.stderr.splitlines()[-1]], False
    worst = compared(imported, models, json.loads(asked.stdout), states, known, joints, roots)
    fine = all(value <= (POSE if "poses" in key else RELATIVE) for key, value in worst.items())
    lost = [loss for loss in imported.losses if "inertia" in loss.what]
    limits = ("unlimited slide", "`lower` and `upper`")
    ends = [loss for loss in imported.losses if worst["limits"] > RELATIVE and loss.what.startswith(limits)]
    said = [f"{len(imported.repaired)} repaired"] * bool(imported.repaired) + [f"{len(lost)} inertias without a mass lost"] * bool(lost)
    said += [f"{len(ends)} joints said to have other ends"] * bool(ends)
    why = "as it was" if fine else ", ".join(said) or "DIFFERS"
    fine = fine or bool(said) and max(worst["poses"], worst["rooted poses"]) <= POSE
    return [*row, *(f"{value:.0e}" for value in worst.values()), why], fine


def opened(file: Path, loops: set[str], folder: Path) -> Path:
    """Return the path of the file, or of a copy in `folder` without the joints `loops`, which close kinematic loops."""
    if not loops:
        return file
    tree = ET.parse(file)
    for around in [*tree.iter("model")]:
        for joint in around.findall("joint"):
            if joint.get("name") in loops:
                around.remove(joint)
    tree.write(folder / file.name)
    return folder / file.name


def compared(
    imported: Imported, models: dict[str, mujoco.MjModel], theirs: dict[str, list[dict[str, object]]], states: list[list[list[float]]],
    known: dict[str, str], joints: dict[str, str], roots: list[str],
) -> dict[str, float]:
    """Return the largest difference of each quantity. Differences of poses are in m, or in entries of the rotation matrix. Other
    differences are relative to the largest value. The difference is NaN if a value is missing.
    """
    worst = dict.fromkeys(KINDS, 0.0)

    def told(kind: str, ours: numpy.ndarray, other: object, scale: float | None = None) -> None:
        other = numpy.array(other)
        size = 1.0 if scale is not None else float(numpy.abs(other).max(initial=0.0)) or 1.0
        worst[kind] = max(worst[kind], float(numpy.abs(ours - other).max(initial=0.0)) / size)

    for name, ends in theirs["ends"].items():
        ours = models["source"].joint(joints[name])
        for here, there in zip(ours.range if ours.limited[0] else (-math.inf, math.inf), ends, strict=True):
            worst["limits"] = max(worst["limits"], 0.0 if here == there or abs(there) >= ENDLESS <= abs(here) else abs(here - there))
    modes = dict(zip(("source", *dict.fromkeys(roots)), models.values(), strict=True))
    for mode, model in ((mode, model) for mode, model in modes.items() if mode == "source" or mode in known):
        data = mujoco.MjData(model)
        dofs = [int(model.joint(word).dofadr[0]) for word in joints.values()]
        for (q, v), other in zip(states, theirs["states"], strict=True):
            for word, here, speed in zip(joints.values(), q, v, strict=True):
                data.joint(word).qpos[0], data.joint(word).qvel[0] = here, speed
            mujoco.mj_forward(model, data)
            full = numpy.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, full)
            poses = {name: pose(data, word) for name, word in known.items()}
            frames = {name: numpy.array(other["frames"][name]) for name in known}
            if mode == "source":
                shift = poses[imported.robot.root] @ numpy.linalg.inv(frames[imported.robot.root])
                for name in known:
                    told("poses", poses[name], shift @ frames[name], 1.0)
                told("mass matrix", full[numpy.ix_(dofs, dofs)], other["mass_matrix"])
                told("bias", data.qfrc_bias[dofs], other["bias"])
                data.qvel[:] = 0.0
                mujoco.mj_forward(model, data)
                told("gravity", data.qfrc_bias[dofs], other["gravity"])
            else:
                at, there = numpy.linalg.inv(poses[mode]), numpy.linalg.inv(frames[mode])
                for name in known:
                    told("rooted poses", at @ poses[name], there @ frames[name], 1.0)
                if mode in other["held"]:
                    told("rooted mass matrix", full[numpy.ix_(dofs, dofs)], other["held"][mode])
    return worst


def there(model: mujoco.MjModel, word: str) -> bool:
    """Return whether the MuJoCo model contains a link. A massless link between two joints is not a body."""
    return any(mujoco.mj_name2id(model, kind, word) >= 0 for kind in (mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_BODY))


def pose(data: mujoco.MjData, word: str) -> numpy.ndarray:
    """Return the pose of a site or body in the world as a 4 x 4 matrix."""
    is_site = mujoco.mj_name2id(data.model, mujoco.mjtObj.mjOBJ_SITE, word) >= 0
    found, one = numpy.eye(4), data.site(word) if is_site else data.body(word)
    found[:3, :3], found[:3, 3] = one.xmat.reshape(3, 3), one.xpos
    return found


if __name__ == "__main__":
    sys.exit(main())
