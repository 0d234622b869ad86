"""Check and measure functions of robot families, and their derivatives: `make gradients`.

The first table has a row for each robot, with parameters of its document and results that depend on these parameters. The column `bits`
contains the number of settings for which the vectorized function returns exactly the same bits as `evaluate`. The column `value` is the
speed of `function.value` for all settings at once, relative to calls of `evaluate` one after the other. The column `jacobian` is the time
of a Jacobian, relative to the time of an evaluation. The column `error` is the largest difference between a derivative and a difference
quotient with 60 digits, relative to the largest derivative with respect to the same parameter. For these quotients, mpmath evaluates the
program of the function again, so the rules for derivatives are not used.

The next rows contain derivatives with respect to parameters on which modelled parts depend. Such derivatives are compared with finite
differences of other step sizes. The rows show the largest relative difference, and the number of settings for which all differences are
within the stated errors.

The third table compares models of MJX with models that MuJoCo compiles, for 50 settings (4096 for the rates). The columns `f64` and `f32`
are the largest difference of a field, relative to the largest entry of the field. The column `models` is the speed of creating all models
in one call, relative to `models(share=False)`. The column `XML` is this speed relative to MuJoCo's compilation of the XML.

The last row differentiates a height after 200 simulation steps in MJX, and compares the derivatives with finite differences in MuJoCo. The
program exits with 1 if a result exceeds its bound.

`--import FILE` imports a robot from an MJCF file into a temporary workspace, and prints the rows of this robot, and the rows of
`switches.py` for switches between the root of the file and the last link. The parameters are masses of three links, an offset of a link,
and gains and damping of three joints.
"""

from __future__ import annotations

import argparse
import itertools
import re
import statistics
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import mpmath
import mujoco
import numpy as np
from mjx_fields import leaves, one_of
from mujoco import mjx
from ruamel.yaml import YAML
from switches import report_switches

import thingc
from thingc.base.diagnostics import Report
from thingc.batch.families import FamilyFunction
from thingc.batch.plans.program import Operation, Program, expression, operand
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from families.documents import WORKSPACE  # noqa: E402

ALL = ("mass", "centre", "inertia")
ROBOTS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "boom": ("boom.yaml", ("length", "load"), (*ALL, "site:hook", "torque_margin")),
    "tendons": ("strung.yaml", ("thickness", "axle", "reach", "components.foot.mass"), (*ALL, "box", "site:thigh.drum")),
    "loops": ("everything.yaml", ("load", "length"), (*ALL, "length")),
    "arm": (str(ROOT / "assemblies/arm.yaml"), ("components.bus_board.mass", "components.bus_board.at.xyz.2"), (*ALL, "box")),
    "MInchW": (
        str(ROOT / "assemblies/minchw/minchw.yaml"),
        ("components.harness.mass", "components.harness.at.xyz.0", "components.magnet_driver.mass"), (*ALL, "box"),
    ),
}
"""For each robot: its document, the names of parameters, and the names of results. Plans do not support torque margins of robots with
tendons, or boxes around parts of robots with boards.
"""
MODELLED = {
    "assemblies/minchw/minchw.yaml": {"leg_length": (0.0653, 0.071, 0.0777)},
    "assemblies/arm.yaml": {
        "reach": (0.0912345, 0.104, 0.1234567, 0.1712), "pen_diameter": (0.0103217, 0.015, 0.0171234, 0.0215),
        "components.humerus.params.length": (0.0931, 0.1007, 0.1123), "components.humerus.params.thickness": (0.00313, 0.0037),
    },
}
"""For each document: parameters on which modelled parts depend, and the values at which derivatives are computed. The finite differences
use small steps, because results change discontinuously where the number of printed layers changes.
"""
ERROR, COST, RATIO, ESTIMATED = 1e-13, 3.0, 20.0, 1e-4
IN_MJX: dict[str, tuple[str, tuple[str, ...], str]] = {
    "boom": ("boom.yaml", ("length", "load", "joints.lift.drive.kp"), "standing"),
    "tendons": ("strung.yaml", ("thickness", "reach", "components.foot.mass"), "standing"),
    "loops": ("everything.yaml", ("load", "length", "stiff"), "loose"),
    "arm": (str(ROOT / "assemblies/arm.yaml"), ("components.bus_board.mass", "components.bus_board.at.xyz.2"), "bench"),
}
"""For each robot: its document, the names of parameters, and a mode."""
EULER = {"simulation.integrator": "euler"}
"""Settings that select the Euler integrator, because MJX integrates damped drives differently from MuJoCo with `implicitfast`."""
SINGLE, MODELS, XML, SLOPE = 1e-6, 10.0, 30.0, 1e-6
HEAD = f"{'':9} {'lines':>6} {'bits':>11} {'value':>8} {'jacobian':>9} {'error':>8}"
HEAD_OF_MJX = f"{'MJX':9} {'f64':>8} {'f32':>8} {'models':>8} {'XML':>8}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4096, help="number of settings per robot (default: %(default)s)")
    parser.add_argument("--no-parts", action="store_true", help="skip measurements that build parts")
    parser.add_argument("--no-mjx", action="store_true", help="without MJX")
    parser.add_argument("--only-mjx", action="store_true", help="only MJX")
    parser.add_argument("--import", dest="source", metavar="FILE", help="only the robot in an MJCF file")
    options = parser.parse_args()
    if options.source is not None:
        return bool(report_imported(options.source, options.count))
    if options.only_mjx:
        return bool(report_mjx(options.count))
    missed = []
    print(HEAD)
    with tempfile.TemporaryDirectory() as folder:
        write_documents(Path(folder))
        for name, (document, names, outputs) in ROBOTS.items():
            with thingc.family(Path(folder) / document, verify=0) as family:
                missed += report(name, family, family.function(names, outputs), options.count)
    for document, numbers in {} if options.no_parts else MODELLED.items():
        with thingc.family(ROOT / document, verify=0) as family:
            for name, values in numbers.items():
                missed += estimated(family.function([name], ALL), values)
    if not options.no_mjx:
        missed += report_mjx(options.count)
    print(f"must      {'':6} {'all':>11} {RATIO:8.0f} {COST:9.1f} {ERROR:8.0e}; estimated {ESTIMATED:.0e}")
    for one in missed:
        print(f"MISSED {one}")
    return bool(missed)


def write_documents(folder: Path) -> None:
    """Write the documents of the robots that have no file in the repository."""
    boom = re.search(r"```yaml\n(# boom\.yaml.*?)```", (ROOT / "docs/learning.md").read_text(), re.DOTALL)
    assert boom is not None
    for name, text in {**WORKSPACE, "boom.yaml": boom[1]}.items():
        (folder / name).write_text(textwrap.dedent(text))


def report_imported(source: str, count: int) -> list[str]:
    """Print the rows of a robot that is imported from a file. Return a description of each result that exceeds its bound."""
    first = imported_from(source)
    last = first.robot.links[-1].name
    imported = imported_from(source, ImportRequest(roots=[last]))
    words = YAML(typ="safe").load(imported.files[imported.document])
    links, drives = numbers_of(words)
    modes = list(words["modes"])
    with tempfile.TemporaryDirectory() as folder:
        for name, content in imported.files.items():
            path = Path(folder) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        document = Path(folder) / imported.document
        print(f"{imported.name}: {', '.join((*links, *drives))}", HEAD, sep="\n")
        with thingc.family(document, verify=0) as family:
            missed = report(imported.name, family, family.function(links, (*ALL, "box")), count)
        print(HEAD_OF_MJX)
        with thingc.family(document, verify=0, compat="mjx", mode=modes[0]) as family:
            missed += report_models(imported.name, family, (*links, *drives), count, {**EULER, "simulation.cone": "pyramidal"})
        jax.config.update("jax_enable_x64", True)
        missed += report_switches({str(document): list(itertools.permutations(modes))}, count)
    for one in missed:
        print(f"MISSED {one}")
    return missed


def imported_from(source: str, request: ImportRequest | None = None) -> Imported:
    """Import a robot from a file."""
    problems = Report()
    imported = import_robot(source, problems, request or ImportRequest())
    assert imported is not None, [one.message for one in problems.diagnostics]
    return imported


def numbers_of(words: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Return the paths of some numbers in the document of an imported robot: of links, and of the drives and the damping of joints.

    The numbers are the masses of the first, the middle and the last link, the greatest coordinate of the first mount, and the gains and
    damping of the first, the middle and the last joint.
    """
    components, joints = words["components"], words["joints"]
    links = [f"components.{name}.mass" for name in ends([name for name, of in components.items() if "mass" in of])]
    name, mount, place = next(
        (name, mount, re.findall(r"[-+\d.e]+(?= |$)", place["xyz"]))
        for name, of in components.items() for mount, place in of.get("mounts", {}).items() if "xyz" in place
    )
    greatest = max(range(3), key=lambda axis: abs(float(place[axis])))
    drives = [
        f"joints.{name}.{section}.{key}" for name in ends(list(joints))
        for section, key in (("drive", "kp"), ("drive", "kv"), ("dynamics", "damping")) if key in joints[name].get(section, {})
    ]
    return [*links, f"components.{name}.mounts.{mount}.xyz.{greatest}"], drives


def ends(names: Sequence[str]) -> list[str]:
    """Return the first, the middle and the last name."""
    return list(dict.fromkeys((names[0], names[len(names) // 2], names[-1])))


def report(name: str, family: thingc.RobotFamily, function: FamilyFunction, count: int) -> list[str]:
    """Print the row of a robot. Return a description of each result that exceeds its bound."""
    rows = function.start * np.random.default_rng(1).uniform(0.98, 1.02, (count, len(function.names)))
    settings = [dict(zip(function.names, row, strict=True)) for row in rows.tolist()]
    function.value(rows[:64])
    family.evaluate(settings[:64])
    values, alone = function.value(rows), [family.evaluate(one) for one in settings]
    expected = np.array([[one.results.get(output, np.nan) for output in function.outputs] for one in alone], dtype=np.float64)
    if any(output.startswith("site:") for output in function.outputs):  # `evaluate` does not return sites
        for row, own in zip(expected, map(function.value, rows), strict=True):
            row[np.isnan(row)] = np.asarray(own)[np.isnan(row)]
    same = int((values.view(np.ndarray).view(np.uint64) == expected.view(np.uint64)).all(axis=1).sum())
    evaluations = seconds_of(lambda: [family.evaluate(one) for one in settings[:512]]) / 512
    together = seconds_of(lambda: function.value(rows)) / count
    jacobian = seconds_of(lambda: [function.jacobian(row) for row in rows[:128]]) / 128
    error = max(error_of(function, row) for row in rows[:3])
    plan, why = function._evaluation.plan_at(function._item(rows[0])[1])
    assert plan is not None, why
    ratio, cost = evaluations / together, jacobian / evaluations
    print(f"{name:9} {len(plan.program.statements):6} {same:5} /{count:5} {ratio:7.1f}x {cost:9.2f} {error:8.1e}", flush=True)
    bounds = {"bits": same == count, "value": ratio >= RATIO, "jacobian": cost <= COST, "error": error <= ERROR}
    return [f"{figure} of {name}" for figure, holds in bounds.items() if not holds]


def report_mjx(count: int) -> list[str]:
    """Print the rows of MJX. Return a description of each result that exceeds its bound."""
    missed = []
    print(HEAD_OF_MJX)
    with tempfile.TemporaryDirectory() as folder:
        write_documents(Path(folder))
        for name, (document, names, mode) in IN_MJX.items():
            with thingc.family(Path(folder) / document, verify=0, compat="mjx", mode=mode) as family:
                missed += report_models(name, family, names, count, EULER if name == "arm" else {})
        with thingc.family(Path(folder) / "boom.yaml", verify=0) as family:
            missed += report_simulation(family)
    print(f"must      {ERROR:8.0e} {SINGLE:8.0e} {MODELS:7.0f}x {XML:7.0f}x; derivatives {SLOPE:.0e}")
    return missed


def report_models(name: str, family: thingc.RobotFamily, names: Sequence[str], count: int, at: dict[str, str]) -> list[str]:
    """Print the row of a robot. Return a description of each result that exceeds its bound."""
    errors = {}
    for dtype in ("float32", "float64"):
        jax.config.update("jax_enable_x64", dtype == "float64")
        robots = family.mjx(names, dtype=dtype, at=at)
        rows = robots.start * np.random.default_rng(1).uniform(0.98, 1.02, (count, len(names)))
        model, _, ok = robots.batch(rows)
        settings = [{**at, **dict(zip(names, row, strict=True))} for row in rows[:512].tolist()]
        errors[dtype] = 0.0
        for place, expected in enumerate(family.models(settings[:50])):
            if ok[place]:
                found = leaves(one_of(model, robots.varied, place))
                wanted = leaves(mjx.put_model(expected))
                errors[dtype] = max(errors[dtype], *(difference(found[one], value) for one, value in wanted.items()))
    valid = int(ok[:50].sum())
    together = seconds_of(lambda: jax.block_until_ready(robots.batch(rows)[0])) / count
    alone = seconds_of(lambda: list(family.models(settings, share=False))) / len(settings)
    models, function = family._models_of(None, False), family.function(names, (), at=at)
    plan, why = models.template_at(function._item(rows[0])[1])
    assert plan is not None, why
    texts = [plan.template.text(plan.outputs(function._item(row)[1].values) or ()) for row in rows[:50][np.asarray(ok[:50])]]
    parsed = seconds_of(lambda: [models._load(text) for text in texts]) / len(texts)
    rates = f"{alone / together:7.1f}x {parsed / together:7.1f}x, {valid} of 50 valid"
    print(f"{name:9} {errors['float64']:8.1e} {errors['float32']:8.1e} {rates}", flush=True)
    bounds = {
        "f64": errors["float64"] <= ERROR, "f32": errors["float32"] <= SINGLE, "models": alone / together >= MODELS,
        "XML": parsed / together >= XML, "valid": valid > 25,
    }
    return [f"MJX {figure} of {name}" for figure, holds in bounds.items() if not holds]


def difference(found: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest difference between two arrays, relative to the largest entry. If all expected entries are 0 except for rounding
    errors, the difference is absolute.
    """
    scale = np.abs(expected).max(initial=0.0)
    return float(np.abs(found.astype(float) - expected).max(initial=0.0) / (scale if scale > 1e-12 else 1.0))


def report_simulation(family: thingc.RobotFamily) -> list[str]:
    """Print the error of the derivatives of a simulation. Return a description of the error if it exceeds its bound."""
    names = ["length", "load", "joints.lift.drive.kp", "joints.lift.dynamics.damping"]
    robots = family.mjx(names)
    state = mujoco.MjData(family.model({}, visual=False))
    state.ctrl[:] = 0.3

    def height(p: Any) -> Any:
        model, data = robots.put(robots.model(p)[0], state)
        last = jax.lax.scan(lambda data, _: (mjx.step(model, data), None), data, length=200)[0]
        return p[0] * jax.numpy.sin(last.qpos[0])

    def in_mujoco(p: np.ndarray) -> float:
        model = family.model(dict(zip(names, p.tolist(), strict=True)), visual=False)
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.3
        mujoco.mj_step(model, data, 200)
        return float(p[0] * np.sin(data.qpos[0]))

    greatest = 0.0
    slopes = jax.jit(jax.jacfwd(height))
    for row in robots.start * np.random.default_rng(2).uniform(0.9, 1.1, (3, len(names))):
        expected = np.array([(in_mujoco(row + step) - in_mujoco(row - step)) / (2.0 * step.sum()) for step in np.diag(1e-5 * row)])
        greatest = max(greatest, float(np.max(np.abs(slopes(row) - expected) / np.abs(expected))))
    print(f"boom: derivatives of 200 steps by {', '.join(names)}: error {greatest:.1e}", flush=True)
    return [] if greatest <= SLOPE else ["derivatives of a simulation"]


def seconds_of(job: Callable[[], Any]) -> float:
    """Return the median wall time [s] of five calls of a function."""
    times = []
    for _ in range(5):
        before = time.perf_counter()
        job()
        times.append(time.perf_counter() - before)
    return statistics.median(times)


def error_of(function: FamilyFunction, x: np.ndarray) -> float:
    """Return the largest relative error of the derivatives at `x`."""
    found = function.jacobian(x)
    assert found.error is not None and not found.error.any(), function._evaluation.plan_at(function._item(x)[1])[1]
    read = function._item(x)[1]
    plan, _ = function._evaluation.plan_at(read)
    assert plan is not None
    program = function._restrict(plan).program
    run = in_many_digits(program)
    greatest = 0.0
    with mpmath.workdps(60):
        given = [mpmath.mpf(read.values[place]) for place in plan.free]
        for column, name in enumerate(function.names):
            place, step = plan.free.index(read.names.index(name)), mpmath.mpf(10) ** -20
            ends = [run(*(value + side * step * (at == place) for at, value in enumerate(given))) for side in (1, -1)]
            exact = [(one - other) / (2 * step) for one, other in zip(*ends, strict=True)]
            scale = max(map(abs, exact)) or mpmath.mpf(1)
            derivatives = found[:, column].tolist()
            greatest = max(greatest, *(float(abs(one - other) / scale) for one, other in zip(exact, derivatives, strict=True)))
    return greatest


def in_many_digits(program: Program) -> Callable[..., Sequence[Any]]:
    """Convert a program to a function that computes with numbers of mpmath."""
    lines = [one for one in program.statements if isinstance(one, Operation) and one.target in program.needed]
    text = [f"def run({', '.join(f'v{index}' for index in program.variables)}):"]
    text += [f" v{one.target} = {expression(one.operation, one.arguments)}" for one in lines]
    text.append(f" return [{', '.join(f'mpf({operand(one)})' for one in program.outputs)}]")
    same = ("mpf", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "radians", "degrees")
    names = {
        **{name: getattr(mpmath, name) for name in same},
        "hypot": lambda *given: mpmath.sqrt(sum(one * one for one in given)), "_fsum": lambda *given: mpmath.fsum(given),
        "quarter_exact": lambda angle: (mpmath.cos(angle), mpmath.sin(angle)), "copysign": lambda a, b: abs(a) * mpmath.sign(b),
        "inf": mpmath.inf, "nan": mpmath.nan,
    }
    exec("\n".join(text), names)
    run: Callable[..., Sequence[Any]] = names["run"]
    return run


def estimated(function: FamilyFunction, values: Sequence[float]) -> list[str]:
    """Print the row of derivatives with respect to a parameter on which modelled parts depend. Return a description of each result that
    exceeds its bound.
    """
    greatest, within = 0.0, 0
    for value in values:
        found = function.jacobian([value])
        assert found.error is not None
        expected, uncertain = min((richardson(function, value, step * value) for step in (1e-3, 1e-4, 1e-5)), key=lambda one: one[1].max())
        difference = np.abs(found[:, 0] - expected)
        greatest = max(greatest, float((difference / np.abs(expected)).max()))
        within += bool((difference <= found.error[:, 0] + uncertain * np.abs(expected)).all())
    name = function.names[0]
    print(f"modelled: {name}: error {greatest:.1e}, {within} of {len(values)} within the stated errors", flush=True)
    missed = [] if greatest <= ESTIMATED else [f"estimate of {name}"]
    return missed if within == len(values) else [*missed, f"stated errors of {name}"]


def richardson(function: FamilyFunction, value: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute derivatives at a value by fourth-order finite differences. Return the derivatives, and their relative errors estimated from
    another step size.
    """
    slopes = []
    for size in (0.6 * step, step):
        f = np.asarray(function.value([[value + k * size] for k in (-2.0, -1.0, 1.0, 2.0)]))
        slopes.append((f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * size))
    return slopes[0], 2.0 * np.abs(slopes[1] - slopes[0]) / np.abs(slopes[0])


if __name__ == "__main__":
    sys.exit(main())
