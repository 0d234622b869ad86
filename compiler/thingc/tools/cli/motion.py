"""Implementation of `thingc motion`, which replays a motion of a document in MuJoCo.

Without --csv, the motion is played in the viewer of MuJoCo.

  thingc motion assemblies/arm.yaml wave
  thingc motion assemblies/arm.yaml wave --mode bench --csv tracked.csv     without a window: tracked positions and errors
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Code
from thingc.base.suggestions import did_you_mean
from thingc.driver import pipeline
from thingc.driver.environment import Environment
from thingc.driver.pipeline import Compilation, UnknownChoice
from thingc.tools.cli import console

if TYPE_CHECKING:
    from thingc.model.assembly.types import Assembly, JointEdge


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc motion` to the parser."""
    console.add_document(parser)
    parser.add_argument("motion", metavar="MOTION", nargs="?", help="a motion of the document (default: the first motion)")
    parser.add_argument("--mode", metavar="M", help="mode of the robot (default: the first mode)")
    parser.add_argument("--csv", metavar="FILE", help="write the simulated joint positions to a CSV file")
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc motion`, and return the exit code, which is 0 if the motion could be simulated."""
    diagnostics, errors = console.compile_document(arguments, partial(_replay, arguments), arguments.mode)
    found = [{"joint": joint.name, "error": error, "time": round(time, 9)} for joint, error, time in errors or ()]
    rows = [(joint.name, joint.twist.format(error), f"{time:.3f} s") for joint, error, time in errors or ()]
    lines = console.table([("joint", "largest error", "at"), *rows]) if rows else ()
    return console.print_result(arguments, diagnostics, lines, joints=found)


def _replay(
    arguments: argparse.Namespace, environment: Environment, compilation: Compilation, assembly: Assembly,
) -> Sequence[tuple[JointEdge, float, float]]:
    """Simulate a motion. With `--csv`, return the joints, each with its largest error and the time of the error. Raises `UnknownChoice`."""
    motions = {motion.name: motion for motion in assembly.definition.motions}
    name = arguments.motion if arguments.motion is not None else next(iter(motions), None)
    if name not in motions:
        hint = did_you_mean(name, list(motions), what="motions") if name and motions else "add `motions:` to the document"
        raise UnknownChoice("the document has no motions" if name is None else f"there is no motion `{name}`", hint)
    import numpy as np

    from thingc.tools.motions.replay import Diverged, Replay

    replay = Replay(pipeline.request_of(environment, compilation), compilation.robots[0], motions[name])
    if words := "; ".join(f"`{key}` of {', '.join(f'`{path}`' for path in paths)}" for key, paths in replay.ignored.items() if paths):
        console.say(f"note: MuJoCo does not simulate some properties of drives ({words})", stream=sys.stderr)
    try:
        if arguments.csv is None:
            replay.show()
            return ()
        times, tracked, commanded = replay.track()
    except Diverged as fault:
        joint = fault.joint
        where = motions[name].origin if joint is None else (joint.actuator or joint).origin
        message = f"the simulation of motion `{name}` diverges at {fault.time:.6g} s" + (f" at joint `{joint.name}`" if joint else "")
        help = "lower `kp` or `kv` of the drives, set `armature`, or use a smaller `timestep`"
        compilation.report.add(Code.CHATTER, message, where, help=help)
        return ()
    free = [number for number, joint in enumerate(replay.joints) if joint.mimic is None]  # the other joints follow them
    units = [(math.degrees(1.0), "deg") if replay.joints[number].twist.turns else (1e3, "mm") for number in free]
    header = ",".join(["time [s]", *(f"{replay.joints[number].name} [{unit}]" for number, (_, unit) in zip(free, units, strict=True))])
    table = np.column_stack([times, tracked[:, free] * [scale for scale, _ in units]])
    try:
        np.savetxt(arguments.csv, table, fmt="%.9g", delimiter=",", header=header, comments="")
    except OSError as fault:
        raise console.WrongCommandLine(f"cannot write `{arguments.csv}`: {fault.strerror}", "choose another file with --csv") from fault
    off = abs(tracked - commanded)
    return [*zip(replay.joints, off.max(axis=0).tolist(), times[off.argmax(axis=0)].tolist(), strict=True)]
