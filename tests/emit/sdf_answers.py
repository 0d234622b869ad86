"""Answers of `read_sdf` for the conformance benchmark: Jacobians by finite differences, and everything else derived from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from emit.read_sdf import Array, Model

STEP = 1e-4
"""Step of the central differences [rad or m]. The truncation error is about 1e-9 of the value."""


def answer(asked: dict[str, Any]) -> dict[str, Any]:
    """Answer like the readers in `benchmarks/conformance`: a floating base is at the origin."""
    model = Model(Path(asked["file"]).read_text())
    bodies = {link: model.inertia(link) for link in model.links}

    def frames(values: Array) -> dict[str, Array]:
        """Poses of links and frames at these coordinate values."""
        q: dict[str, Any] = {}
        for name, axis, value in zip(asked["joints"], asked["axes"], values, strict=True):
            q[name] = (q[name], value) if axis else value
        return model.placed(q, np.eye(4))[0]

    mimics, words = model.mimics(), ("axis", "axis2")
    follows = [mimics.get((name, words[axis])) for name, axis in zip(asked["joints"], asked["axes"], strict=True)]
    elements = [model.element(name).find(words[axis]) for name, axis in zip(asked["joints"], asked["axes"], strict=True)]
    ends = [[None if one is None else one.findtext(f"limit/{end}") for end in ("lower", "upper")] for one in elements]
    efforts = [None if one is None else one.findtext("limit/effort") for one in elements]
    return of_chains(asked, bodies, frames) | {
        "mimic": [one and (one[0], one[2], one[3]) for one in follows],
        "range": [
            None if low is None and high is None else [float(low or "-inf"), float(high or "inf")] for low, high in ends
        ],
        "effort": [float(effort or "inf") for effort in efforts],
    }


def of_chains(
    asked: dict[str, Any], bodies: Mapping[str, tuple[float, Array, Array]], frames: Callable[[Array], Mapping[str, Array]],
) -> dict[str, Any]:
    """Compute frames, masses and derived values of links with a mass, a centre and an inertia each. `frames` returns all poses at given
    coordinate values."""
    masses = np.array([mass for mass, _, _ in bodies.values()])
    total = float(masses.sum())
    found: dict[str, Any] = {"frames": [], "centre": [], "mass_matrix": [], "torque": []}

    def placed(values: Array) -> tuple[Mapping[str, Array], Array, Array]:
        """Frames, centres of mass and axes of the links."""
        poses = frames(values)
        centres = np.array([(poses[link] @ [*centre, 1.0])[:3] for link, (_, centre, _) in bodies.items()])
        return poses, centres, np.array([poses[link][:3, :3] for link in bodies])

    for values in np.array(asked["q"]):
        poses, centres, axes = placed(values)
        found["frames"].append([poses[name] for name in asked["frames"]])
        found["centre"].append(masses @ centres / total)
        moves, turns = [], []
        for step in STEP * np.eye(len(values)):
            (_, ahead, turned), (_, behind, back) = placed(values + step), placed(values - step)
            moves.append((ahead - behind) / (2.0 * STEP))
            rate = (turned - back) / (2.0 * STEP) @ axes.transpose(0, 2, 1)
            turns.append(np.stack([rate[:, 2, 1], rate[:, 0, 2], rate[:, 1, 0]], axis=1))
        v, w = np.array(moves), np.array(turns)
        inertias = np.array([turn @ inertia @ turn.T for turn, (_, _, inertia) in zip(axes, bodies.values(), strict=True)])
        found["mass_matrix"].append(np.einsum("kla,l,mla->km", v, masses, v) + np.einsum("kla,lab,mlb->km", w, inertias, w))
        found["torque"].append(-np.einsum("kla,l,a->k", v, masses, asked["gravity"]))
    return {key: np.array(values).tolist() for key, values in found.items()} | {"mass": total}
