"""Search for the lengths of MInchW's legs and body together with its gait: `make codesign`, or `python examples/codesign.py`.

Optuna maximizes the distance that the robot climbs on a wall per joule of energy. `thingc.family` creates the robots, which differ in the
lengths of legs and body. `mujoco.rollout` simulates sixteen walks in parallel. Optuna stores all trials in a journal file. To continue an
interrupted search, run the same command again. The result is the same as without the interruption.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import optuna
from optuna.storages import BaseStorage, JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, Trial, TrialState

import thingc
from codesign_walk import Design, Outcome, evaluate
from walk import ROOT, write

DOCUMENT = ROOT / "assemblies" / "minchw" / "minchw.yaml"
JOURNAL = ROOT / "build" / "codesign.journal"
TOGETHER = 16
"""Number of walks that are simulated in parallel. Optuna suggests the same number of designs at a time."""
AT_RANDOM = 64
"""Number of walks with random designs before the sampler uses earlier results."""

LENGTHS = {"leg": (64, 140, 2), "body": (90, 220, 10)}
"""Minimum, maximum and step of each length [mm]. Lengths are multiples of the step, so each part is built only once per length."""
GAIT = {"stride": (0.03, 0.3), "knee": (1.0, 1.7), "pace": (0.5, 2.0)}
"""Minimum and maximum of the gait parameters. The units are the same as in `Design`."""
PUBLISHED = {"leg": 0.064, "body": 0.0947}
BY_HAND = Design(**PUBLISHED, stride=0.09, knee=1.5, pace=1.0)
"""The design that `make walk` simulates: the published robot with a gait that was planned by hand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A design and the outcome of its simulated walk."""

    design: Design
    outcome: Outcome


def search(
    robots: thingc.RobotFamily, storage: BaseStorage, name: str, count: int, seed: int, lengths: Mapping[str, float] | None, threads: int,
) -> list[Tried]:
    """Run an Optuna study until it contains `count` walks, and return the walks in the order of the trials. If `lengths` [m] is set, these
    lengths are fixed and only the gait varies.

    The sampler of each walk has its own seed. A sampler uses the results of all previous rounds. Therefore, an interrupted search continues
    with the same designs.
    """
    study = optuna.create_study(study_name=f"{name}, seed {seed}", storage=storage, direction="maximize", load_if_exists=True)
    while True:
        trials = study.get_trials(deepcopy=False)
        asked = [_trial(study, trial.number, seed, trial) for trial in trials if trial.state is TrialState.RUNNING]
        begun = len(trials) % TOGETHER or asked
        end = -(-len(trials) // TOGETHER) * TOGETHER if begun else len(trials) + TOGETHER
        designs = [_designed(trial, lengths) for trial in asked]
        for number in range(len(trials), min(end, count)):
            asked.append(_trial(study, number, seed, None))
            designs.append(_designed(asked[-1], lengths))
        if not asked:
            return [_tried(trial, lengths) for trial in trials]
        for trial, outcome in zip(asked, evaluate(robots, designs, threads), strict=True):
            trial.set_user_attr("outcome", {key: getattr(outcome, key) for key in Outcome.__slots__})
            study.tell(trial, outcome.value)
        print(f"\r{name}: {min(end, count)} of {count}", end="", file=sys.stderr, flush=True)


def _trial(study: optuna.Study, number: int, seed: int, begun: FrozenTrial | None) -> Trial:
    """Return the Optuna trial with the number `number`. Create the trial if it does not exist."""
    study.sampler = optuna.samplers.TPESampler(
        seed=seed * 1_000_003 + number, multivariate=True, n_startup_trials=AT_RANDOM,
    )
    return study.ask() if begun is None else Trial(study, begun._trial_id)


def _designed(trial: Trial, lengths: Mapping[str, float] | None) -> Design:
    """Return the design with the parameters that an Optuna trial suggests."""
    if lengths is None:
        lengths = {key: trial.suggest_int(key, low, high, step=step) / 1000 for key, (low, high, step) in LENGTHS.items()}
    return Design(**lengths, **{key: trial.suggest_float(key, low, high) for key, (low, high) in GAIT.items()})


def _tried(trial: FrozenTrial, lengths: Mapping[str, float] | None) -> Tried:
    made = lengths or {key: trial.params[key] / 1000 for key in LENGTHS}
    return Tried(design=Design(**made, **{key: trial.params[key] for key in GAIT}), outcome=Outcome(**trial.user_attrs["outcome"]))


def best_of(tried: Sequence[Tried]) -> Tried:
    """Return the design with the longest distance per joule. If several designs are equal, return the first."""
    return max(tried, key=lambda one: one.outcome.value)


def report(columns: Mapping[str, Tried]) -> str:
    """Return the results as a text table with one column per robot."""
    some = list(columns.values())
    rows = [
        ("", list(columns)),
        ("leg [mm]", [f"{1e3 * one.design.leg:.1f}" for one in some]),
        ("body [mm]", [f"{1e3 * one.design.body:.1f}" for one in some]),
        ("stride [mm]", [f"{1e3 * one.design.stride:.1f}" for one in some]),
        ("knee angle, feet together [deg]", [f"{57.29578 * one.design.knee:.1f}" for one in some]),
        ("pace", [f"{one.design.pace:.2f}" for one in some]),
        ("mass [kg]", [f"{one.outcome.mass:.3f}" for one in some]),
        ("speed [mm/s]", [f"{1e3 * one.outcome.distance / one.outcome.seconds:.1f}" for one in some]),
        ("work per metre [J]", [f"{one.outcome.work / one.outcome.distance:.1f}" for one in some]),
        ("  of this, to lift the robot [J]", [f"{9.81 * one.outcome.mass:.1f}" for one in some]),
        ("heat per metre [J]", [f"{one.outcome.heat / one.outcome.distance:.1f}" for one in some]),
        ("largest share of a torque-speed line", [f"{100 * one.outcome.largest:.0f} %" for one in some]),
        ("distance per joule [mm]", [f"{1e3 * one.outcome.value:.2f}" for one in some]),
    ]
    return "\n".join(f"{name:38}" + "".join(f"{cell:>20}" for cell in cells) for name, cells in rows)


def report_failed(tried: Sequence[Tried]) -> str:
    """Return a text that lists the number of failed walks for each reason."""
    reasons = Counter(one.outcome.failed for one in tried if one.outcome.failed)
    lines = [f"{len(tried):5} walks, {len(tried) - reasons.total()} of them completed"]
    return "\n".join([*lines, *(f"{count:5} {reason}" for reason, count in sorted(reasons.items(), key=lambda one: (-one[1], one[0])))])


def plot(together: Sequence[Tried], gait: Sequence[Tried], path: Path) -> None:
    """Plot the distance per joule of both searches against the leg length. Colours show the body length, and lines show the best result so
    far.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(10.0, 3.8), dpi=110, layout="constrained")
    walks = [one for one in together if not one.outcome.failed]
    points = axes[0].scatter(
        [1e3 * one.design.leg for one in walks], [1e3 * one.outcome.value for one in walks], s=10, cmap="viridis_r",
        c=[1e3 * one.design.body for one in walks],
    )
    figure.colorbar(points, ax=axes[0], label="body [mm]")
    best = best_of(together)
    axes[0].scatter([1e3 * best.design.leg], [1e3 * best.outcome.value], s=130, facecolors="none", edgecolors="black", label="best")
    by_hand = best_of(gait)
    axes[0].scatter([64], [1e3 * by_hand.outcome.value], s=90, marker="*", color="tab:red", label="published lengths, best gait", zorder=3)
    axes[0].set(xlabel="leg [mm]", ylabel="distance per energy [mm/J]")
    axes[0].legend(fontsize=8, loc="lower left")
    for tried, colour, label in ((together, "tab:blue", "lengths and gait"), (gait, "tab:red", "gait only, published lengths")):
        so_far, curve = 0.0, []
        for one in tried:
            so_far = max(so_far, one.outcome.value)
            curve.append(1e3 * so_far)
        axes[1].step(range(1, len(curve) + 1), curve, where="post", color=colour, label=label)
    axes[1].set(xlabel="walks simulated", ylabel="best so far [mm/J]", ylim=(0.8 * 1e3 * by_hand.outcome.value, None))
    axes[1].legend(fontsize=8, loc="lower right")
    for panel in axes:
        panel.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Software": None})
    pyplot.close(figure)


def main() -> int:
    """Start or continue the search, and print the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="number of walks in the search for lengths and gait (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="random seed (default: %(default)s)")
    parser.add_argument("--journal", type=Path, default=JOURNAL, help="file of all trials, to continue the search (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1, help="number of simulation threads (default: %(default)s)")
    parser.add_argument("--store", help="folder of cached parts (default: the user's cache)")
    parser.add_argument("--page", type=Path, help="page whose reports are replaced (docs/studies/codesign.md)")
    parser.add_argument("--plot", type=Path, help="output file for the plot (PNG)")
    parser.add_argument("--adopt", action="store_true", help="write the lengths of the best robot into its document")
    given = parser.parse_args()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    given.journal.parent.mkdir(parents=True, exist_ok=True)
    storage = JournalStorage(JournalFileBackend(str(given.journal)))
    began = time.monotonic()
    with thingc.family(DOCUMENT, store=given.store) as robots:
        together = search(robots, storage, "lengths and gait", given.count, given.seed, None, given.threads)
        gait = search(robots, storage, "gait alone", given.count // 4, given.seed, PUBLISHED, given.threads)
        by_hand = Tried(design=BY_HAND, outcome=evaluate(robots, [BY_HAND], 1)[0])
        print(f"\n{time.monotonic() - began:.0f} s, {time.process_time():.0f} s of processor time but for modelling parts", file=sys.stderr)
        best = best_of(together)
        table = report({"make walk": by_hand, "best gait": best_of(gait), "best robot and gait": best})
        failed = report_failed(together)
        print(table, failed, sep="\n\n")
        if given.page is not None:
            write(given.page, "report", table)
            write(given.page, "report of what was tried", failed)
        if given.plot is not None:
            plot(together, gait, given.plot)
        if given.adopt:
            for problem in robots.adopt(best.design.settings):
                print(problem.message, file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
