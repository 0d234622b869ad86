"""`make conformance`: run checkers from other projects on the build outputs, and count their findings.

The study builds both robots, the gallery and imported robots in all modes. Each checker runs in its own environment and process, and checks
every file of its format. The study updates the rows of the table in `docs/studies/checkers.md`, and exits with 1 if a checker reports an
error or a warning without an explanation. The environments are cached in `build/checkers/`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # which MuJoCo reads when it is imported
sys.path.insert(0, str(Path(__file__).resolve().parent))

from environments import environment
from study import HERE, ROBOTS, ROOT, built

from thingc.targets.render.picture import extent, small_picture

PAGE = ROOT / "docs" / "studies" / "checkers.md"
BEGIN, END = "<!-- checkers -->\n", "<!-- end of checkers -->"
FOLDER = ROOT / "build" / "checkers"
FILES = {"MJCF": "mjcf/*.xml", "URDF": "urdf/*.urdf", "SDF": "sdf/*/model.sdf", "USD": "usd/*.usda"}
"""Patterns of the checked files in a build folder, by format."""
PYBULLET = ("pybullet==3.2.7", "numpy==2.4.6")
IMPORTED = (
    "a1/a1.urdf", "franka_panda/panda.urdf", "kuka_iiwa/model.urdf", "laikago/laikago.urdf", "mini_cheetah/mini_cheetah.urdf",
    "quadruped/minitaur.urdf", "r2d2.urdf", "racecar/racecar.urdf", "mjcf/ant.xml", "mjcf/humanoid.xml",
)
"""Robot files in the package pybullet that are imported."""
OVERLAPPING = "(a1_description|mini_cheetah|panda|plane)"
"""Imported robots whose collision shapes overlap. `plane` is the robot in `laikago.urdf`."""
FLOATING = {
    r"(?is)(floating|free joint|joint unsupported).*\[dropper/urdf": (
        "The ball of `dropper` has a `floating` joint, which the reader does not support."
    ),
}
MUJOCO = {
    **FLOATING,
    r"^WARNING: Geom with duplicate name.*\[(ant|humanoid)/": (
        "An imported geom that is both visual and collision geometry becomes two geoms with the same name."
    ),
}
DIFFERENTIAL = r'^Unknown tag "(role|mechanicalReduction)" in .*/transmission'
GALLERY = sorted(path for path in ROOT.glob("gallery/*/*.yaml") if path.stem == path.parent.name)


@dataclass(frozen=True)
class Checker:
    """A program that checks robot files of some formats. `function` in `findings.py` runs it; by default, it is `name` as an identifier.

    `packages` lists the pinned packages of its environment, and `version` is the version of Python that it requires. If `packages` is
    empty, the commands in `needs` must succeed, and `install` is the command that installs the program. `explained` contains patterns
    of findings, followed by the file in brackets, that are not a mistake in the files, with the reasons.
    """

    name: str
    formats: tuple[str, ...]
    packages: tuple[str, ...] = ()
    note: str = ""
    version: str = ""
    needs: tuple[str, ...] = ()
    install: str = ""
    alone: bool = False
    function: str = ""
    explained: Mapping[str, str] = field(default_factory=dict)

    @property
    def installation(self) -> str:
        """Return the command that installs the checker."""
        return self.install or f"python{self.version} -m pip install {' '.join(self.packages)}"


CHECKERS: tuple[Checker, ...] = (
    Checker(
        "simready-validate", ("USD",), ("simready-validate==2026.8.0", "simready-foundation-tier-core==2026.8.0"),
        "The checker tests the required features of the profile Robot-Body 3.0.0 of NVIDIA SimReady.", version="3.12", explained={
            "^VG.008": "The checker reports collision meshes that equal visual meshes, which is intended: they have the purpose `guide`.",
            "site-packages/simready/": "Some warnings come from the Python code of the checker, not from the files.",
            "^VG.MESH.001": "The checker expects a mesh, but robots with only boxes, spheres and cylinders have none.",
        },
    ),
    Checker(
        "ros-openusd-compliance-checker", ("USD",), ("ros-openusd-compliance-checker==0.1.2",),
        "The checker tests all rules of the draft of REP 158.", version="3.12", explained={
            r"^1\.2\.13": "thingc stores meshes as text, so that one file contains the whole robot.",
            r"^1\.3\.4.*approximation": (
                "For a moving mesh, simulators use the convex hull. Primitive shapes do not need a collision approximation."
            ),
            r"^3\.1\.1.*_friction'": "A physics material is not drawn, so it does not need a shader.",
            r"^3\.4\.3": "Open surfaces of imported robots are drawn from both sides.",
        },
    ),
    Checker(
        "usdchecker", ("USD",), ("usd-core==26.11", "numpy==2.4.6"), "The checker runs all validators of usd-core, including UsdPhysics.",
    ),
    Checker(
        "isaaclab-robot-doctor", ("URDF", "USD"), ("isaaclab-robot-doctor[usd]==0.1.0",), explained={
            "^mass.tiny": "The checker warns about links with a very small mass, such as those between the axes of a joint.",
            "^joint.effort_missing|^joint.velocity_missing": "In some robots, joints do not have a drive or a limit.",
            "^joint.mimic": "The checker warns about mimic joints, which are intended.",
            "^tree.kinematic_loop|^tree.no_root": "The USD articulation does not contain holds and joints that close loops.",
            r"^names.invalid_prim_name.*\[humanoid/": "URDF files of imported robots contain the original names.",
            r"^inertia.not_positive_definite.*'chassis'.*\[plane/": "In the source file of `plane`, an inertia is 0.",
            r"^tree.multiple_roots.*\[dropper/": "In USD files, the ball of `dropper`, which is free, does not have a joint.",
            **FLOATING,
        },
    ),
    Checker("urdf-validator", ("URDF",), ("urdf-validator==1.6.0",), explained={
        '^Unknown tag "mujoco"': "The checker does not know the tag `<mujoco>`, which MuJoCo reads.",
        DIFFERENTIAL: "The checker does not know tags of differential transmissions, which ros_control reads.",
        "stability margin is negative|^--deep skipped": "The balancing robot is unstable without a controller.",
        r"^\[INERTIA\].*diverges": (
            "The checker expects the inertia of a solid box or cylinder around the visual shapes of a link."
        ),
    }),
    Checker("check_urdf", ("URDF",), needs=("sh -c 'command -v check_urdf'",), install="apt install liburdfdom-tools"),
    Checker(
        "urdf_parser_py", ("URDF",), ("urdf-parser-py==0.0.4", "lxml==6.1.3", "PyYAML==6.0.4"),
        explained={
            '^Unknown tag "mujoco"': "The parser does not know the tag `<mujoco>`, which MuJoCo reads.",
            DIFFERENTIAL: "The parser does not know tags of differential transmissions, which ros_control reads.",
        },
    ),
    Checker(
        "yourdfpy", ("URDF",), ("yourdfpy==0.0.60", "trimesh==5.2.0", "lxml==6.1.3", "six==1.17.0", "numpy==2.4.6"), alone=True,
    ),
    Checker("pinocchio", ("URDF",), ("pin==4.1.0",)),
    Checker("pybullet", ("URDF",), PYBULLET, explained={
        "^pybullet build time": "PyBullet prints the time at which PyBullet was built.",
        **FLOATING,
    }),
    Checker("ikpy", ("URDF",), ("ikpy==4.2.1",), explained={
        "is of type 'fixed' but set as active": "ikpy reports a warning for every fixed joint.",
        **FLOATING,
    }),
    Checker("placo", ("URDF",), ("placo==0.10.2",), explained={
        "self collisions|collides with": (
            "At q = 0, the shapes of neighbouring links overlap. In some imported robots, the shapes of other links also "
            "overlap."
        ),
    }),
    Checker("scikit-robot", ("URDF",), ("scikit-robot==0.4.7",), explained=FLOATING),
    Checker("roboticstoolbox", ("URDF",), ("roboticstoolbox-python==1.5.0",)),
    Checker("urchin", ("URDF",), ("urchin==0.0.30",)),
    Checker("idyntree", ("URDF",), ("idyntree==15.1.0",), explained={
        r"\[dropper/": "iDynTree does not read the files of `dropper`, because it does not support the `floating` joint of the ball.",
    }),
    Checker("dartpy", ("URDF",), ("dartpy==6.20.0",), "DART is the default physics engine of Gazebo.", explained={
        "A negative or zero mass": "DART warns about links without a mass, which represent frames.",
        r"^links missing \['world'\], added \[\]": "DART does not create a body for a root link with the name `world`.",
    }),
    Checker("mjcf-doctor", ("MJCF",), ("mjcf-doctor==0.2.1",), explained={
        rf"_penetration.*\[{OVERLAPPING}/": "In some imported robots, collision shapes overlap, as in the source files.",
        r"^timestep_large.*\[ant/": "The large time step of the imported robot `ant` comes from the source file of this robot.",
    }),
    *(Checker(name, ("MJCF", "URDF"), (f"mujoco=={version}",), function="mujoco", explained=MUJOCO) for name, version in (
        ("mujoco", "4.0.0"), ("mujoco-3.17", "3.17.0"), ("mujoco-3.11", "3.11.0"),
    )),
    Checker(
        "libsdformat", ("SDF",), needs=("g++ --version", "pkg-config --exists sdformat12"), install="apt install libsdformat-dev",
        explained={"is newer than the supported version": "libsdformat 12 supports SDFormat 1.9, but some files require 1.11."},
    ),
    Checker(
        "gz sdf", ("SDF",), needs=("gz sdf --version",), install="apt install gz-tools2",
        note=(
            "Debian does not contain gz-tools2, and the Python package sdformat14-py-bindings does not contain libsdformat. Drake, which "
            "also contains libsdformat, reads all SDF files in the conformance study."
        ),
    ),
    Checker("newton", ("URDF", "USD"), (
        "newton==1.8.0", "warp-lang==1.19.0", "usd-core==26.11", "newton-usd-schemas==0.6.0", "scipy==1.17.1", "trimesh==5.2.0",
    ), explained={
        "^Inertia validation corrected": "Newton enlarges the inertia of links of 1e-9 kg between the axes of a joint.",
        "physics:filteredPairs was not imported": "Newton does not import filters of links that do not have collision shapes.",
        "^Warp CUDA warning": "Newton warns that CUDA is missing, because the study runs on a CPU.",
    }),
    Checker("genesis", ("URDF", "MJCF"), ("genesis-world==1.4.5", "torch==2.13.0"), "The study only loads the files.", explained={
        r"has dubious .*_source\.": "Dubious masses and inertias come from the source files of imported robots.",
        r"Mesh is not watertight.*_source\.": "Meshes with holes come from the source files of imported robots.",
        r"Failed to parse actuator .*\[wrist/": "Genesis does not support the differential of `wrist`.",
        "Joint limit ignored for ball joints": "Genesis does not support limits of ball joints.",
        "The model declares (torsional|rolling) friction": "By default, Genesis simulates only sliding friction.",
        "The model declares the elliptic friction cone": "By default, Genesis uses a pyramidal friction cone.",
    }),
)


@dataclass
class Verdict:
    """The findings of a checker for the files of a format: the number of errors, of warnings and of explained findings, and examples."""

    version: str
    files: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    explained: int = 0
    examples: dict[str, str] = field(default_factory=dict)

    def add(self, checker: Checker, file: str, findings: Sequence[tuple[str, str]]) -> None:
        """Count the findings for a file. Each finding consists of its level, `error` or `warning`, and its message."""
        self.files += 1
        for level, message in findings:
            if level == "info":
                continue
            if any(re.search(pattern, f"{message} [{file}]") for pattern in checker.explained):
                self.explained += 1
                continue
            self.counts[level] += 1
            self.examples.setdefault(re.sub(r"['\"<`].*?['\">`]|[\d.e-]+", "*", message), f"{file}: {level}: {message}")


def main() -> int:
    """Build the robots, run the checkers and write the page. Return 1 if a checker reports something."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkers", nargs="*", metavar="CHECKER", help=f"run only these: {', '.join(one.name for one in CHECKERS)}")
    parser.add_argument("--no-build", action="store_true", help="check the files of the last run")
    parser.add_argument("--print", action="store_true", help="print the results without updating the page")
    arguments = parser.parse_args()
    chosen = [one for one in CHECKERS if not arguments.checkers or one.name in arguments.checkers]
    if unknown := set(arguments.checkers) - {one.name for one in CHECKERS}:
        parser.error(f"unknown checker {sorted(unknown)[0]}")
    builds = sorted((FOLDER / "robots").iterdir()) if arguments.no_build else list(robots())
    reported = False
    rows: list[str] = []
    for checker in chosen:
        for format in checker.formats:
            verdict = checked(checker, [file for one in builds for file in sorted(one.glob(FILES[format]))])
            rows.append(row(checker, format, verdict))
            print(rows[-1], *(verdict.examples.values() if verdict is not None else ()), sep="\n", flush=True)
            reported |= verdict is not None and bool(verdict.counts)
    if not arguments.print:
        head, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        body, _, foot = rest.partition(END)
        PAGE.write_text(f"{head}{BEGIN}{page(rows, body)}{END}{foot}", encoding="utf-8")
    return int(reported)


def row(checker: Checker, format: str, verdict: Verdict | None) -> str:
    """Return the row of the table for a checker and a format."""
    if verdict is None:
        return f"| {checker.name} | {format} | not installed: `{checker.installation}` | | | | |"
    counts = f"{verdict.counts['error']} | {verdict.counts['warning']} | {verdict.explained}"
    return f"| {checker.name} | {format} | {verdict.version} | {verdict.files} | {counts} |"


def page(rows: Sequence[str], before: str) -> str:
    """Return the table with new rows and the explanations. Rows of other checkers are copied from the table `before`."""
    known = {tuple(line.split(" | ")[:2]): line for line in (*before.splitlines(), *rows) if line.startswith("| ")}
    order = [known.get((f"| {checker.name}", format)) for checker in CHECKERS for format in checker.formats]
    table = ["| checker | format | version | files | errors | warnings | explained |", "|---" * 7 + "|", *filter(None, order)]
    notes = [f"- {one.name}: {' '.join(filter(None, (one.note, *dict.fromkeys(one.explained.values()))))}" for one in CHECKERS]
    return "\n".join((*table, "", *(note for note in notes if not note.endswith(": ")), ""))


def robots() -> Iterator[Path]:
    """Build all robots, and yield their build folders."""
    for path in (*ROBOTS, *GALLERY):
        yield from compiled(ROOT / path)
    python = environment(FOLDER / "pybullet", PYBULLET)
    originals = [] if python is None else [*(python.parents[1] / "lib").glob("python*/site-packages/pybullet_data")]
    for name in IMPORTED if originals else ():
        folder = FOLDER / "imported" / name.replace("/", "_")
        words = [sys.executable, "-m", "thingc", "import", str(originals[0] / name), "-o", str(folder), "--repair", "inertia=nearest"]
        if not folder.exists():
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        yield from compiled(next(folder.glob("*.yaml")))


def compiled(document: Path) -> Iterator[Path]:
    """Build a document in all formats, with a picture beside each USD file, which SimReady requires. Yield the build folder."""
    built(document, FOLDER / "robots", "--emit", "mjcf,urdf,sdf,usd", "--force")
    folder = FOLDER / "robots" / document.stem
    thumbs = folder / "usd" / ".thumbs" / "256x256"
    thumbs.mkdir(parents=True, exist_ok=True)
    assets = {file.name: file.read_bytes() for file in (folder / "mjcf" / "assets").glob("*")}
    for usd in (folder / "usd").glob("*.usda"):
        xml = (folder / "mjcf" / f"{usd.stem}.xml").read_text()
        points, gravity = extent(xml, assets, None)
        (thumbs / f"{usd.name}.png").write_bytes(small_picture(xml, assets, None, points, gravity, (256, 256)))
    yield folder


def checked(checker: Checker, files: Sequence[Path]) -> Verdict | None:
    """Run a checker on files. Return None if the checker cannot be installed."""
    python = environment(FOLDER / checker.name, checker.packages, checker.needs, alone=checker.alone, version=checker.version)
    if python is None:
        return None
    requests, answers = FOLDER / f"{checker.name}_files.json", FOLDER / f"{checker.name}_findings.json"
    requests.write_text(json.dumps([{"file": str(file)} for file in files]))
    function = checker.function or re.sub(r"\W", "_", checker.name)
    package = re.split(r"==|\[", checker.packages[0])[0] if checker.packages else checker.name
    subprocess.run([str(python), str(HERE / "findings.py"), str(requests), str(answers), function, package], check=True, cwd=HERE)
    read = json.loads(answers.read_text())
    verdict = Verdict(read["version"])
    for file, answer in zip(files, read["answers"], strict=True):
        findings = [("error", answer["cannot"])] if "cannot" in answer else answer["findings"]
        verdict.add(checker, str(file.relative_to(FOLDER / "robots")), findings)
    return verdict


if __name__ == "__main__":
    sys.exit(main())
