"""`make conformance`: check that independent readers find the same robot in every file.

The study builds both robots and random robots in all modes. Each reader runs in its own environment and process, and loads every file. The
answers of the readers at 50 random configurations are compared with the results of MuJoCo for the MJCF of the same mode. The study writes
`docs/studies/conformance_table.md`, and exits with 1 if an answer differs. The environments are cached in `build/conformance/`.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import packages
from environments import environment
from reference import Question, question, stepped
from robots import document

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGE = ROOT / "docs" / "studies" / "conformance_table.md"
RANDOM = 20
ROBOTS = ("assemblies/arm.yaml", "assemblies/minchw/minchw.yaml")
BOUNDS = {
    "frames": 1e-9, "mass": 1e-6, "centre": 1e-6, "mass_matrix": 1e-6, "torque": 1e-6, "range": 1e-9, "effort": 1e-9, "mimic": 1e-6,
    "meshes": 1e-6, "steps": 1e-6,
}
"""Tolerances of the compared quantities.

The tolerances of frames [m and 1], ranges [rad, m], efforts [N m, N], mimics, boxes around meshes [m] and joint positions after steps [rad,
m] are absolute. Other tolerances are relative to the largest value of the quantity. MuJoCo stores meshes in single precision.
"""
FLOAT, FLOATS_STEPPED = 1e-5, 1e-4
"""Minimum tolerances if the reader or the file uses single precision. The second tolerance applies to simulation steps."""
WORDS = {
    "frames": "frames", "mass": "total mass", "centre": "centre of mass", "mass_matrix": "mass matrix", "torque": "gravity torque",
    "range": "limits", "effort": "efforts", "mimic": "mimics", "meshes": "meshes", "steps": "steps",
}

FOR_DRAKE = "MJCF, `--compat drake`"
"""Name of the MJCF models that are adapted to Drake."""

COMPAT = "MJCF, `--compat mjx,pymjcf`"
"""Name of the MJCF models that are adapted to MJX and PyMJCF."""


@dataclass(frozen=True)
class Reader:
    """A reader of robot files. `name` determines its program `ask_NAME.py`, and `packages` lists the packages of its Python environment. If
    `packages` is empty, the current environment is used. The commands in `needs` must succeed.

    If `alone` is True, only `packages` are installed, without their dependencies. An error that contains the text `refuses` is a known
    limitation of the reader and not a failure. If `floats` is True, the reader uses single precision, and the tolerances are larger.
    """

    name: str
    formats: tuple[str, ...]
    packages: tuple[str, ...] = ()
    note: str = ""
    needs: tuple[str, ...] = ()
    alone: bool = False
    refuses: str = ""
    floats: bool = False

    def environment(self, folder: Path) -> Path | None:
        """Return the Python interpreter of the environment of the reader in a folder, or None if the reader is not available."""
        place = folder / f"env-{'-'.join(self.packages).replace('==', '-')}"
        return environment(place, self.packages, self.needs, alone=self.alone)


READERS = (
    Reader(
        "mujoco", ("URDF",),
        note="MuJoCo ignores mimics in URDF. A floating base is fixed to the world.",
    ),
    Reader(
        "pinocchio", ("URDF",), ("pin==4.1.0",),
        "The study loads URDF without mimics, and adds up the masses of all links, because the total mass in pinocchio excludes links "
        "that are fixed to the world.",
    ),
    Reader(
        "yourdfpy", ("URDF",), ("yourdfpy==0.0.60", "trimesh==5.2.0", "lxml==6.1.3", "six==1.17.0", "numpy==2.4.6"),
        "yourdfpy computes only kinematics. The study sets the independent joints, and yourdfpy computes the mimic joints.", alone=True,
    ),
    Reader(
        "pybullet", ("URDF",), ("pybullet==3.2.7", "numpy==2.4.6"),
        "PyBullet fixes the base to the world, and returns link poses in single precision.", floats=True,
    ),
    Reader(
        "urdf_parser_py", ("URDF", "ROS"), ("urdf-parser-py==0.0.4", "lxml==6.1.3", "PyYAML==6.0.4"),
        "urdf_parser_py only parses files. Every message counts as an error, except messages that the tags `<mujoco>` (in URDF) and "
        "`<ros2_control>` (in packages) are unknown.",
    ),
    Reader(
        "ikpy", ("URDF",), ("ikpy==4.2.1",),
        "ikpy computes only the kinematics of each chain from the root to a leaf. The chain that ikpy selects by default must"
        " contain a moving joint.",
    ),
    Reader(
        "drake", ("MJCF", FOR_DRAKE, "URDF", "SDF"), ("drake==1.51.1",),
        "Drake does not support loops, so the study removes joints that close loops or hold mounts. Drake does not report mimics, "
        "so the study moves the independent joints with a force and observes the mimic joints for 0.4 s. Drake reports effort "
        "limits only for joints with one axis. Except in SDF files, such a joint has a drive with the name of the "
        "joint. The study places a floating base at the origin. In MJCF, Drake ignores sites and mimics. Without "
        "`--compat drake`, Drake reads command ranges as efforts, so the study does not compare these efforts. Without this option, "
        "Drake also uses the axes of the parent for a body with several joints, which changes the robot if the body is rotated.",
        refuses="several joints of one body",
    ),
    Reader(
        "libsdformat", ("SDF",), note=(
            "libsdformat reads and checks models and worlds for Gazebo; warnings count as errors. libsdformat does not compute kinematics."
        ),
        needs=("g++ --version", "pkg-config --exists sdformat12"), refuses="is newer than",
    ),
    Reader(
        "check_urdf", ("URDF",), note="check_urdf is the URDF parser of ROS. check_urdf must accept the file and find every link.",
        needs=("sh -c 'command -v check_urdf'",),
    ),
    Reader("catkin_pkg", ("ROS",), ("catkin_pkg==1.1.1",), "colcon reads manifests with catkin_pkg, which must not report warnings."),
    Reader(
        "pinocchio_srdf", ("ROS",), ("pin==4.1.0",),
        "The study loads URDF and SRDF with pinocchio, sets the positions of mimic joints and continuous joints, and "
        "compares frames in every pose. At 200 configurations, the study also checks whether links with "
        "disabled collisions collide.",
    ),
    Reader(
        "pymjcf", (COMPAT,), ("dm_control==1.0.50", "mujoco==3.17.0"),
        "PyMJCF loads models and scenes that are written with `--compat pymjcf`, and MuJoCo compiles the output of PyMJCF.",
    ),
    Reader(
        "mjx", (COMPAT,), ("mujoco-mjx==3.17.0", "mujoco==3.17.0"),
        "MJX loads models and scenes that are written with `--compat mjx`, and computes in double precision. The study compares "
        "simulation steps without contacts, because MJX compiles a function for every pair of meshes. The models use pyramidal "
        "friction cones, because MJX supports elliptic cones only with contacts.",
        refuses="mjTRN_BODY",
    ),
    Reader(
        "warp", ("MJCF",), ("mujoco-warp==3.17.0", "mujoco==3.17.0"),
        "MuJoCo Warp loads the default models, and computes in single precision on a CPU. The study compares steps without contacts.",
        floats=True,
    ),
    Reader(
        "newton", ("URDF", "USD"), (
            "newton==1.8.0", "warp-lang==1.19.0", "usd-core==26.11", "newton-usd-schemas==0.6.0", "scipy==1.17.1", "trimesh==5.2.0",
        ),
        "Newton computes in single precision on a CPU. The study places a floating base at the origin. "
        "The tree in Newton does not contain holds or joints that close loops. The study "
        "reads frames of USD from the file, relative to the links in Newton. The study compares efforts and meshes only for USD.",
        floats=True,
    ),
    Reader(
        "mujoco-usd", ("USD",), ("mujoco-usd==4.0.0", "mujoco==4.0.0"),
        "mujoco-usd is the USD reader of MuJoCo; USD stores values in single precision. The reader supports revolute and prismatic "
        "joints, replaces all other joints by welds, and drops drives and mimics. The study reads frames from the file, "
        "relative to the links in the reader.",
        refuses="are read as welds", floats=True,
    ),
    Reader(
        "usdchecker", ("USD",), ("usd-core==26.11", "numpy==2.4.6"),
        "usdchecker runs all validators of usd-core, including UsdPhysics, and no validator may report an error or a warning."
        " In addition, each file must contain "
        "one articulation and every link, frame and joint.",
        floats=True,
    ),
)
NOT_RUN = "ROS itself (`colcon build`, `ros2 launch`, the controllers on their mock hardware, RViz and MoveIt)"
"""Programs that the study does not run."""


@dataclass
class Judged:
    """The results of a reader for some files. The object contains the largest difference of each quantity, the failures of each file, the
    number of known limitations, and the message of the first limitation.
    """

    refuses: str = ""
    floats: bool = False
    files: int = 0
    refused: int = 0
    refusal: str = ""
    worst: dict[str, float] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def add(self, name: str, answer: Mapping[str, Any], expected: Mapping[str, Any], joints: Sequence[str]) -> None:
        """Compare the answer of the reader for one file with the expected answer."""
        self.files += 1
        if "cannot" in answer and self.refuses and self.refuses in answer["cannot"]:
            self.refused += 1
            self.refusal = self.refusal or answer["cannot"].partition(": ")[2]
            return
        if "cannot" in answer:
            self.faults.append(f"{name}: reader cannot: {answer['cannot']}")
            return
        for key in [key for key in BOUNDS if key in answer]:
            apart = difference(key, answer[key], expected[key], joints)
            self.worst[key] = max(self.worst.get(key, 0.0), apart)
            floats = FLOATS_STEPPED if key == "steps" else FLOAT
            if not apart <= max(BOUNDS[key], floats if self.floats else 0.0):
                self.faults.append(f"{name}: {WORDS[key]} are {apart:.3g} apart")


UNBOUNDED = 1e9
"""Efforts of at least this value [N m or N] count as unlimited."""


def difference(key: str, answer: Any, expected: Any, joints: Sequence[str]) -> float:
    """Return the difference between two answers. The difference is absolute for frames and ranges. For all other quantities, the difference
    is relative to the largest expected value.
    """
    if key == "range":
        both = [(_ends(a), _ends(b)) for name, a, b in zip(joints, answer, expected, strict=True) if not name.endswith("_slide")]
        return max((abs(x - y) for a, b in both for x, y in zip(a, b, strict=True) if x != y), default=0.0)
    if key == "effort":
        known = [(min(a, UNBOUNDED), min(b, UNBOUNDED)) for a, b in zip(answer, expected, strict=True) if a is not None]
        return max((abs(a - b) for a, b in known), default=0.0)
    if key == "mimic":
        if [one and one[0] for one in answer] != [one and one[0] for one in expected]:
            return math.inf
        answer, expected = ([one[1:] for one in side if one] for side in (answer, expected))
    a, b = np.array(answer), np.array(expected)
    if a.shape != b.shape:
        return math.inf
    apart = float(np.abs(a - b).max(initial=0.0))
    return apart if key in ("frames", "mimic", "meshes", "steps") else apart / max(float(np.abs(b).max(initial=0.0)), 1e-6)


def _ends(ends: Sequence[float] | None) -> tuple[float, float]:
    """Return both ends of a range. An end is infinite if the range is unlimited there."""
    low, high = (-math.inf, math.inf) if ends is None else ends
    return (-math.inf if low <= -1e6 else low, math.inf if high >= 1e6 else high)


def main() -> int:
    """Build the robots, run all readers and write the page. Return 1 if an answer differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--random", type=int, default=RANDOM, help="number of random robots")
    parser.add_argument("--reader", action="append", default=[], choices=[one.name for one in READERS], help="measure only this one")
    parser.add_argument("--print", action="store_true", help="print the results without updating the page")
    arguments = parser.parse_args()
    folder = ROOT / "build" / "conformance"
    asked = list(questions(folder, arguments.random))
    rows: dict[tuple[str, str], tuple[str, dict[str, Judged]]] = {}
    faults: list[str] = []
    head, _, rest = PAGE.read_text(encoding="utf-8").partition("<!-- conformance -->\n")
    before, end, foot = rest.partition("<!-- end of conformance -->")
    for reader in READERS:
        for format in reader.formats if not arguments.reader or reader.name in arguments.reader else ():
            rows[reader.name, format] = judged(reader, folder, [(group, one) for group, one in asked if one.format == format])
            version, groups = rows[reader.name, format]
            new = [f"{reader.name}: {format}: {fault}" for one in groups.values() for fault in one.faults]
            print(*rows_of(reader.name, format, version, groups), *new, sep="\n", flush=True)
            faults += new
            if not arguments.print:  # after each reader, because the study takes long
                page = "\n".join(table(rows, before))
                PAGE.write_text(f"{head}<!-- conformance -->\n{page}\n{end}{foot}", encoding="utf-8")
    return 1 if faults else 0


def questions(folder: Path, count: int) -> Iterator[tuple[str, Question]]:
    """Yield questions about every mode of both robots and of the random robots, each with the name of its group."""
    documents = folder / "documents"
    documents.mkdir(parents=True, exist_ok=True)
    robots = [(Path(path).stem, ROOT / path) for path in ROBOTS]
    for seed in range(count):
        for group in ("random", "balls"):
            robots.append((group, documents / f"{group}_{seed}.yaml"))
            robots[-1][1].write_text(document(seed, balls=group == "balls"), encoding="utf-8")
    for group, path in robots:
        built(path, folder / "robots", "--emit", "mjcf,urdf,ros,sdf,usd")
        out = folder / "robots" / path.stem
        for mjcf in sorted((out / "mjcf").glob(f"{path.stem}_*.xml")):
            one = question(mjcf, mjcf)
            yield group, stepped(replace(one, request={**one.request, "efforts": False}))
        built(path, folder / "drake", "--emit", "mjcf", "--compat", "drake")
        for mjcf in sorted((folder / "drake" / path.stem / "mjcf").glob(f"{path.stem}_*.xml")):
            yield group, replace(question(mjcf, out / "mjcf" / mjcf.name), format=FOR_DRAKE)
        for urdf in sorted((out / "urdf").glob("*.urdf")) if group != "balls" else ():
            yield group, question(urdf, out / "mjcf" / f"{urdf.stem}.xml")
        for sdf in sorted((out / "sdf").glob("*/model.sdf")):
            yield group, question(sdf, out / "mjcf" / f"{sdf.parent.name}.xml")
        for usd in sorted((out / "usd").glob("*.usda")):
            yield group, question(usd, out / "mjcf" / f"{usd.stem}.xml")
        yield from ((group, one) for one in packages.questions(out))
    for group, path in robots[: len(ROBOTS)]:
        built(path, folder / "compat", "--emit", "mjcf", "--compat", "mjx,pymjcf")
        for mjcf in sorted((folder / "compat" / path.stem / "mjcf").glob(f"{path.stem}_*.xml")):
            yield group, replace(stepped(question(mjcf, mjcf)), format=COMPAT)


def built(path: Path, folder: Path, *options: str) -> None:
    """Build a document into a folder."""
    words = [sys.executable, "-m", "thingc", "build", str(path), *options, "-o", str(folder)]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def judged(reader: Reader, folder: Path, asked: Sequence[tuple[str, Question]]) -> tuple[str, dict[str, Judged]]:
    """Run a reader. Return its version, and its results by group. If the reader is not available, return the reason and no results."""
    python = reader.environment(folder)
    if python is None:
        return f"not available ({' '.join(reader.packages or reader.needs)})", {}
    requests, answers = folder / f"{reader.name}_asked.json", folder / f"{reader.name}.json"
    requests.write_text(json.dumps([one.request for _, one in asked]))
    subprocess.run([str(python), str(HERE / f"ask_{reader.name.replace('-', '_')}.py"), str(requests), str(answers)], check=True, cwd=HERE)
    read = json.loads(answers.read_text())
    groups: dict[str, Judged] = {}
    for (group, one), answer in zip(asked, read["answers"], strict=True):
        groups.setdefault(group, Judged(reader.refuses, reader.floats)).add(one.name, answer, one.answer, one.request["joints"])
    return read["version"], groups


def table(rows: Mapping[tuple[str, str], tuple[str, dict[str, Judged]]], before: str) -> Iterator[str]:
    """Yield the lines of the table, and the notes. Rows of other readers are copied from the table `before`."""
    known: dict[tuple[str, str], list[str]] = {}
    for line in before.splitlines():
        if line.startswith("| "):
            name, format = line[2:].split(" | ")[:2]
            known.setdefault((name.partition(" ")[0], format), []).append(line)
    yield "| reader | reads | robots | files | " + " | ".join(WORDS.values()) + " | |"
    yield "|---" * (len(WORDS) + 5) + "|"
    for key in ((reader.name, format) for reader in READERS for format in reader.formats):
        yield from rows_of(*key, *rows[key]) if key in rows else known.get(key, ())
    yield ""
    yield from (f"- {reader.name}: {reader.note}" for reader in READERS)
    yield f"- The package was not tested with {NOT_RUN}."


def rows_of(name: str, format: str, version: str, groups: Mapping[str, Judged]) -> Iterator[str]:
    """Yield a row for each group of robots, with the largest differences."""
    if not groups:
        yield f"| {name} | {format} | {version} |" + " |" * (len(WORDS) + 2)
    for group, one in groups.items():
        cells = [f"{one.worst[key]:.0e}" if key in one.worst else "-" for key in WORDS]
        state = [f"{len(one.faults)} differ" if one.faults else "no differences" if one.refused < one.files else ""]
        state += [f"not supported: {one.refused} ({one.refusal})"] if one.refused else []
        yield f"| {name} {version} | {format} | {group} | {one.files} | " + " | ".join(cells) + f" | {', '.join(filter(None, state))} |"


if __name__ == "__main__":
    sys.exit(main())
