"""Report the results of a bridge search as a section of a page and as a plot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

MARGIN = 1.3
"""Smallest allowed torque margin, the same as in the section `keep` of the variants document."""
PULL, RADIUS = 300.0, 0.025
"""Adhesion force [N] of a magnet, and the radius [m] of its face."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A bridge that was tried: its lengths [m], smallest torque margin and mass [kg]. A feasible bridge also has a build folder."""

    name: str
    leg: float
    body: float
    bridge: float
    margin: float
    mass: float
    feasible: bool
    command: str
    folder: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Rebuilt:
    """Values of a bridge computed by MuJoCo: distance between the soles [m], torque margin by joint, and pull [N] at the rim of the holding
    magnet.
    """

    bridge: float
    margins: dict[str, float]
    pull: float


def rebuilt(one: Tried) -> Rebuilt:
    """Compute the distance, the torque margins and the pull of a built bridge with MuJoCo's inverse dynamics."""
    assert one.folder is not None
    model = mujoco.MjModel.from_xml_path(str(Path(one.folder, "mjcf", "minchw_probe_reaching.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stretched").id)
    mujoco.mj_forward(model, data)
    torques = np.array(data.qfrc_bias)  # at rest: the required joint torques
    margins = {}
    for k in range(model.njnt):
        joint = model.joint(k)
        torque = float(abs(torques[joint.dofadr[0]]))
        margins[joint.name] = float(model.actuator(joint.name).forcerange[1]) / torque if torque else math.inf
    front, rear = data.site("front_sole").xpos, data.site("rear_sole").xpos
    weight = model.body_subtreemass[0] * float(np.linalg.norm(model.opt.gravity))
    lever = float(np.linalg.norm((data.subtree_com[0] - front)[:2]))
    return Rebuilt(bridge=float(np.linalg.norm(front - rear)), margins=margins, pull=weight * lever / RADIUS - weight)


def page(found: Sequence[Tried], best: Tried | None, seen: Rebuilt | None, driver: str) -> str:
    """Return the generated section of the page `docs/variants_search.md` as Markdown."""
    feasible = [one for one in found if one.feasible]
    document = Path(__file__).resolve().parents[1] / "assemblies" / "minchw" / "bridge_search.yaml"
    chosen = "sampled from the ranges in the document" if driver == "random" else "chosen by Optuna"
    lines = [
        "## The longest bridge", "",
        "This search finds the largest distance between the soles of MInchW, by varying the lengths of the legs and the body. The magnet",
        "of the front foot holds the robot, which stretches horizontally over a gap. The sole of the rear foot carries a probe of 400 g.",
        "The *bridge* is the distance between the two soles. The *torque margin* is the maximum torque of a drive divided by the required",
        f"torque, and must be at least {MARGIN} for every drive.",
        "`make bridge-search` runs the search in a few minutes and writes this section.", "",
        "![The bridges of all robots, and the longest bridge so far](pictures/bridge_search.png)", "",
        "The document of variants is `assemblies/minchw/bridge_search.yaml`, for the assembly `probe.yaml` in the same folder:", "",
        "```text", *document.read_text().strip().split("\n"), "```", "",
        f"The search evaluated {len(found)} robots, {chosen}. {len(feasible)} robots satisfy the rule. The five longest bridges are:", "",
        "| | leg | body | bridge | torque margin | mass |", "|---|---|---|---|---|---|",
    ]
    for one in sorted(feasible, key=lambda one: -one.bridge)[:5]:
        lines.append(
            f"| `{one.name}` | {1e3 * one.leg:.1f} mm | {1e3 * one.body:.1f} mm | {1e3 * one.bridge:.1f} mm | {one.margin:.3f} "
            f"| {one.mass:.3f} kg |"
        )
    lines.append("")
    if best is None or seen is None:
        lines += ["No robot satisfies the rule.", ""]
        return "\n".join(lines)
    weakest = min(seen.margins, key=seen.margins.__getitem__)
    so_far = best_so_far(found)
    first = next(k for k, value in enumerate(so_far) if value == best.bridge) + 1
    verdict = "\n  A bridge of this length therefore requires a wider magnet." if seen.pull > PULL else ""
    lines += [
        f"- Robot {first} of {len(found)} has the longest bridge. In its MuJoCo model, the bridge is {1e3 * seen.bridge:.1f} mm long.",
        f"  Inverse dynamics gives the smallest torque margin, {seen.margins[weakest]:.3f}, at the drive of `{weakest}`.",
        "- The torque margin does not include the magnet. The robot can tip about the rim of the magnet, which has a radius of",
        f"  {1e3 * RADIUS:.0f} mm. To prevent tipping, the magnet must pull with {seen.pull:.1f} N, "
        f"{'but' if seen.pull > PULL else 'and'} it pulls with at most {PULL:.0f} N.{verdict}", "",
        "To build the longest bridge, run:", "", "```text", best.command, "```", "",
        "With `python examples/longest_bridge.py --driver optuna`, [Optuna](https://optuna.org) chooses eight robots per round",
        "(`pip install 'thingc[search]'`), and thingc builds each round as a batch. `--count N` stops after N robots.",
        "Both search methods use fixed seeds, so the same command finds the same robot.", "",
    ]
    return "\n".join(lines)


def best_so_far(found: Sequence[Tried]) -> list[float]:
    """Return the length [m] of the longest feasible bridge so far, for each robot. The value is NaN before the first feasible robot."""
    best, curve = math.nan, []
    for one in found:
        if one.feasible and not one.bridge <= best:
            best = one.bridge
        curve.append(best)
    return curve


def draw(found: Sequence[Tried], best: Tried | None, path: Path) -> None:
    """Plot the bridge length against the leg length and the body length, and the length of the best bridge so far."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(12.0, 3.6), dpi=100, layout="constrained")
    kinds = ((True, "o", "tab:blue", f"torque margin at least {MARGIN}"), (False, "x", "tab:red", "less"))
    for panel, key, label in ((axes[0], "leg", "leg"), (axes[1], "body", "body")):
        for feasible, marker, colour, words in kinds:
            kind = [one for one in found if one.feasible is feasible]
            x, y = [1e3 * getattr(one, key) for one in kind], [1e3 * one.bridge for one in kind]
            panel.scatter(x, y, s=22, marker=marker, color=colour, label=words)
        if best is not None:
            x, y = [1e3 * getattr(best, key)], [1e3 * best.bridge]
            panel.scatter(x, y, s=140, facecolors="none", edgecolors="black", label="the longest")
        panel.set(xlabel=f"{label} [mm]", ylabel="bridge [mm]")
    axes[0].legend(fontsize=8)
    axes[2].step(range(1, len(found) + 1), [1e3 * value for value in best_so_far(found)], where="post", color="tab:blue")
    axes[2].set(xlabel="robots built", ylabel="longest bridge so far [mm]")
    for panel in axes:
        panel.grid(alpha=0.3)
    figure.savefig(path, metadata={"Software": None})
    pyplot.close(figure)
