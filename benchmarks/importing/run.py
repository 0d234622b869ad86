"""Real robots, imported: `python benchmarks/importing/run.py PYTHON FILE_OR_FOLDER...`, a table of what came back.

PYTHON is the interpreter of an environment with pinocchio (`pip install pin`), which reads the originals; `pip install example-robot-data`
brings 69 files. Compared, at random states: poses of all links, mass matrix, bias, gravity, limits, and for five links as roots poses
relative to it, and the mass matrix with it held. What differs has to be explained by a loss or a repair.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mujoco
import numpy

import thingc
from thingc.diagnostics import Report
from thingc.importing import Imported, import_robot

ROOTS = 5
POSE, RELATIVE = 1e-9, 1e-9


def main() -> int:
    """Exit code 1 where something differs that nothing explains."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("python")
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--states", type=int, default=50)
    arguments = parser.parse_args()
    files = [file for path in arguments.paths for file in (sorted(path.rglob("*.urdf")) if path.is_dir() else [path])]
    failed = 0
    print("| robot | links | joints | s | poses | mass matrix | bias | gravity | rooted: poses | rooted: mass matrix | |")
    print("|---" * 11 + "|")
    for file in files:
        row, fine = one(file, arguments.python, arguments.states)
        failed += not fine
        print(f"| {file.stem} | {' | '.join(row)} |", flush=True)
    print(f"\n{len(files) - failed} of {len(files)} are as they were, or said why not", file=sys.stderr)
    return int(failed > 0)


def one(file: Path, python: str, count: int) -> tuple[list[str], bool]:
    """The row of a robot, and whether all of it is as it was, or explained."""
    chance, report, begun = random.Random(file.stem), Report(), time.perf_counter()
    first = import_robot(str(file), report, repair="nearest")
    if first is None:
        said = report.ordered()[0]
        return [*["" for _ in range(9)], f"refused: {said.code.code} {said.message}"], True
    links = [link.name for link in first.robot.links]
    roots = chance.sample(links, min(ROOTS, len(links)))
    imported = import_robot(str(file), Report(), roots=roots, repair="nearest")
    assert imported is not None
    took = time.perf_counter() - begun
    with tempfile.TemporaryDirectory() as folder:
        for name, content in imported.files.items():
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            (Path(folder) / name).write_bytes(content)
        compiled = thingc.compile(Path(folder) / f"{imported.name}.yaml")
        models = {name: mode.model() for name, mode in compiled.modes.items()}
    names = json.loads(imported.files["import.json"])["names"]
    known, joints = names["links"] | names["frames"], names["joints"]
    states = [[[chance.uniform(-1.0, 1.0) for _ in joints] for _ in range(2)] for _ in range(count)]
    request = {"file": str(file), "joints": list(joints), "links": list(known), "roots": roots, "states": states}
    asked = subprocess.run([python, Path(__file__).parent / "ask_original.py"], input=json.dumps(request), text=True, capture_output=True)
    if asked.returncode:
        return [str(len(links)), str(len(joints)), f"{took:.2f}", *["" for _ in range(6)], asked.stderr.splitlines()[-1]], False
    worst = compared(imported, models, json.loads(asked.stdout), states, known, joints, roots)
    fine = all(value <= (POSE if "poses" in key else RELATIVE) for key, value in worst.items())
    lost = [loss for loss in imported.losses if "inertia" in loss.what]
    said = [f"{len(imported.repaired)} repaired"] * bool(imported.repaired) + [f"{len(lost)} inertias without a mass lost"] * bool(lost)
    why = "as it was" if fine else ", ".join(said) or "DIFFERS"
    row = [str(len(links)), str(len(joints)), f"{took:.2f}", *(f"{value:.0e}" for value in worst.values()), why]
    return row, fine or bool(said) and max(worst["poses"], worst["rooted poses"]) <= POSE


def compared(
    imported: Imported, models: dict[str, mujoco.MjModel], theirs: dict[str, list[dict[str, object]]], states: list[list[list[float]]],
    known: dict[str, str], joints: dict[str, str], roots: list[str],
) -> dict[str, float]:
    """The largest difference of each kind: poses in m (and of rotations), others relative to the largest entry; nan where something is
    missing."""
    worst = dict.fromkeys(("poses", "mass matrix", "bias", "gravity", "rooted poses", "rooted mass matrix"), 0.0)

    def told(kind: str, ours: numpy.ndarray, other: object, scale: float | None = None) -> None:
        other = numpy.array(other)
        size = 1.0 if scale is not None else float(numpy.abs(other).max(initial=0.0)) or 1.0
        worst[kind] = max(worst[kind], float(numpy.abs(ours - other).max(initial=0.0)) / size)

    modes = dict(zip(("source", *dict.fromkeys(roots)), models.values(), strict=True))
    for mode, model in modes.items():
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
                told("rooted mass matrix", full[numpy.ix_(dofs, dofs)], other["held"][mode])
    return worst


def pose(data: mujoco.MjData, word: str) -> numpy.ndarray:
    """4 x 4, of the site of that name, else the body."""
    is_site = mujoco.mj_name2id(data.model, mujoco.mjtObj.mjOBJ_SITE, word) >= 0
    found, one = numpy.eye(4), data.site(word) if is_site else data.body(word)
    found[:3, :3], found[:3, 3] = one.xmat.reshape(3, 3), one.xpos
    return found


if __name__ == "__main__":
    sys.exit(main())
