"""Measure `thingc import` and `thingc joints` on STEP assemblies of robots whose joints are known, and print a table.

    python benchmarks/step/study.py [--count 40] [--seed 0] [--freecad COMMAND] [DOC ...]

The random robots (`robots.py`) are exported by build123d, and every fourth robot also by FreeCAD if it is installed. The documents are
exported by thingc itself. A joint counts as proposed if a proposal of the same kind has the same axis.
"""

from __future__ import annotations

import argparse
import math
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from build123d import export_step
from freecad_export import export_with_freecad
from robots import Joint, generate

import thingc
from thingc.base.diagnostics import Report
from thingc.base.pose import NO_POSE, Pose, rotate
from thingc.documents.load.documents import read_tree
from thingc.driver.environment import Options, store_of
from thingc.geometry.features import CentreLine
from thingc.tools.cli.main import main as command
from thingc.tools.importing.step import ImportedAssembly, import_step
from thingc.tools.joints.contacts import parallel
from thingc.tools.joints.joints import propose_joints
from thingc.tools.joints.proposals import JointProposal

NEAR = 1e-5
"""Largest distance [m] between the axes of a joint and of its proposal."""


def imported_into(path: Path, folder: Path, options: Options) -> ImportedAssembly:
    """Import a STEP file, and write its documents to a folder."""
    report = Report()
    imported = import_step(str(path), store_of(options), report)
    assert imported is not None, [one.message for one in report.diagnostics]
    for name, content in imported.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return imported


def all_proposals(document: Path, options: Options, pose: Pose = NO_POSE) -> Iterator[tuple[JointProposal, CentreLine]]:
    """Yield the proposals for a document and its nested documents, with their axes in the frame of the outermost document."""
    proposed = propose_joints(str(document), options)
    assert proposed.document is not None, [one.message for one in proposed.found]
    for one in proposed.proposals:
        yield one, CentreLine.through(pose.apply(one.line.point), rotate(pose.rotation, one.line.axis))
    tree = read_tree(str(document), document.read_bytes(), Report())
    assert tree is not None
    for name, component in tree.plain()["components"].items():  # type: ignore[union-attr]
        if "assembly" in component:
            yield from all_proposals(document.parent / component["assembly"], options, pose @ proposed.frames[name])


def root_frame(imported: ImportedAssembly) -> Pose:
    """Return the pose of the frame of the outermost document in the STEP file."""
    pose, number = NO_POSE, imported.assembly.root
    while True:
        child = imported.assembly.assemblies[number].children[0]
        pose = pose @ child.pose
        if child.assembly is None:
            return pose
        number = child.assembly


def _same(joint: Joint, one: JointProposal, line: CentreLine, root: Pose) -> bool:
    x, y, z = (value / 1000.0 for value in joint.point)
    point, axis = root.inverse().apply((x, y, z)), rotate(root.inverse().rotation, joint.axis)
    known = CentreLine.through(point, axis)
    # any point on the axis of a slide is correct
    near = one.kind == "prismatic" or math.dist(known.point, line.point) < NEAR
    return joint.kind == one.kind and parallel(known, line.axis) and near


def joints_of(document: Path, options: Options) -> list[Joint]:
    """Return the joints of a document with one coordinate, in the frame of the document."""
    assembly, joints = thingc.compile(str(document), store=options.store).assembly, []
    for mate in assembly.mates:
        if len(mate.joints) == 1:
            twist, pose = mate.joints[0].twist, assembly.rest[mate.parent] @ mate.X_PJ
            kind, axis = ("revolute", twist.angular) if any(twist.angular) else ("prismatic", twist.linear)
            point = tuple(1000.0 * value for value in pose.translation)
            joints.append(Joint(kind, f"{document.stem} {kind}", point, rotate(pose.rotation, axis)))  # type: ignore[arg-type]
    return joints


class Results:
    """Counts the joints that are known, proposed and accepted by default, by kind of connection, and the proposals that are not joints."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.options = folder, Options(store=str(folder / "store"))
        self.known: Counter[str] = Counter()
        self.proposed: Counter[str] = Counter()
        self.accepted: Counter[str] = Counter()
        self.wrong: Counter[bool] = Counter()

    def add(self, path: Path, joints: list[Joint]) -> None:
        """Import a STEP file, and compare the proposals with its joints."""
        out = self.folder / path.stem
        imported = imported_into(path, out, self.options)
        root, found = root_frame(imported), [*all_proposals(out / f"{imported.name}.yaml", self.options)]
        for joint in joints:
            matches = [one for one, line in found if _same(joint, one, line, root)]
            self.known[joint.connection] += 1
            self.proposed[joint.connection] += bool(matches)
            self.accepted[joint.connection] += any(one.doubt is None for one in matches)
            if not matches:
                print(f"{path.stem}: not proposed: {joint}")
        for one, line in found:
            if not any(_same(joint, one, line, root) for joint in joints):
                self.wrong[one.doubt is None] += 1
                print(f"{path.stem}: {'WRONG' if one.doubt is None else 'only suggested'}: {one.kind} {one.name} ({one.doubt})")

    def table(self) -> int:
        """Print the table, and return 1 if a wrong joint was accepted or less than 90 % of the revolute joints were proposed."""
        print("connection             joints  proposed  accepted by default")
        for name, count in self.known.items():
            print(f"{name:22} {count:6} {self.proposed[name]:9} {self.accepted[name]:9}")
        turning = [name for name in self.known if not name.startswith("slide") and "prismatic" not in name]
        share = sum(self.proposed[name] for name in turning) / max(1, sum(self.known[name] for name in turning))
        print(f"revolute joints proposed: {100 * share:.1f} %; not joints: {self.wrong[True]} accepted, {self.wrong[False]} only suggested")
        return int(share < 0.9 or self.wrong[True] > 0)


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40, help="number of random robots")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first robot")
    parser.add_argument("--freecad", metavar="COMMAND", default="freecadcmd", help="FreeCAD without a window (default: %(default)s)")
    parser.add_argument("documents", nargs="*", type=Path, metavar="DOC", help="documents of robots, in addition to the random robots")
    arguments = parser.parse_args()
    freecad = shutil.which(arguments.freecad)
    if not freecad:
        print(f"no `{arguments.freecad}`: nothing is exported by FreeCAD; to install it on Debian: apt-get install freecad-python3")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        results = Results(folder)
        for document in arguments.documents:
            store = ["--store", results.options.store or ""]
            assert command(["build", str(document), "--emit", "step", "-o", str(folder / "build"), *store]) == 0
            results.add(next((folder / "build").rglob(f"{document.stem}.step")), joints_of(document, results.options))
        for seed in range(arguments.seed, arguments.seed + arguments.count):
            robot, joints = generate(seed)
            path = folder / f"robot{seed}.step"
            export_step(robot, path)
            results.add(path, joints)
            if freecad and seed % 4 == 0:
                path = folder / f"freecad{seed}" / f"freecad{seed}.step"
                path.parent.mkdir()
                export_with_freecad(robot, path, freecad)
                results.add(path, [replace(joint, connection=f"{joint.connection}, FreeCAD") for joint in joints])
        return results.table()


if __name__ == "__main__":
    sys.exit(main())
