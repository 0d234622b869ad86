"""Create documents of random robots. Each robot is a tree of joints, with all joint types that every format supports. It has masses, mimic
joints, a pose, and a mode for each kind of base.
"""

from __future__ import annotations

import numpy as np

KINDS = ("revolute", "continuous", "prismatic", "cylindrical", "universal", "planar", "screw", "fixed")
COUNTS = {"cylindrical": ("rad", "m"), "universal": ("rad", "rad"), "planar": ("m", "m", "rad"), "fixed": ()}


def document(seed: int, *, balls: bool = False) -> str:
    """Return the document of a random robot whose name contains the seed. If `balls` is True, the robot also has ball joints, which URDF
    does not support.
    """
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 8))
    lines = ["thingc: assembly/1", f"name: {'balls' if balls else 'random'}_{seed}", "components:"]
    for k in range(count):
        lines.append(f"  c{k}: {{frame: true, {_mass(rng)}, mounts: {{a: {_frame(rng)}, b: {_frame(rng)}}}}}")
    lines.append("joints:")
    leaders: dict[str, str] = {}
    kinds: dict[str, str] = {}
    for k in range(1, count):
        kind = str(rng.choice(("ball", "ball", *KINDS) if balls else KINDS))
        said = [f"type: {kind}", f"parent: c{int(rng.integers(0, k))}.a", f"child: c{k}.b"]
        if kind == "revolute":
            ends = f"lower: {rng.uniform(-3, -1):.3f} rad, upper: {rng.uniform(1, 3):.3f} rad"
            said.append(f"limit: {{{ends}, effort: 5 N*m, velocity: 2 rad/s}}")
        if kind == "prismatic":
            said.append(f"limit: {{lower: {rng.uniform(-200, -50):.1f} mm, upper: {rng.uniform(50, 200):.1f} mm}}")
        if kind == "screw":
            said.append(f"lead: {rng.choice([-1, 1]) * rng.uniform(2, 20):.2f} mm")
        unit = {"revolute": "rad", "continuous": "rad", "prismatic": "m"}.get(kind)
        same = [name for name, of in leaders.items() if of == unit]
        if unit is not None and same and rng.random() < 0.4:
            multiplier, offset = rng.uniform(-2, 2), rng.uniform(-0.2, 0.2)
            offset *= 0.05 if unit == "m" else 1.0
            said.append(f"mimic: {{joint: {rng.choice(same)}, multiplier: {multiplier:.3f}, offset: {offset:.4f} {unit}}}")
            kind = "mimic"
        elif unit is not None:
            leaders[f"j{k}"] = unit
            if rng.random() < 0.4:
                said.append("drive: {kind: motor, effort: " + ("7 N*m}" if unit == "rad" else "8 N}"))
        lines.append(f"  j{k}: {{{', '.join(said)}}}")
        kinds[f"j{k}"] = kind
    root = int(rng.integers(0, count))
    lines += [
        "modes:", f"  fixed: {{root: c{root}.a, base: fixed, at: {_frame(rng)}}}",
        f"  free: {{root: c{int(rng.integers(0, count))}, base: free}}",
        f"  held: {{root: c{int(rng.integers(0, count))}.b, base: held, at: {_frame(rng)}}}",
    ]
    if balls:
        lines += [
            f"  planar: {{root: c{int(rng.integers(0, count))}, base: planar, at: {_frame(rng)}}}",
            f"  ball: {{root: c{int(rng.integers(0, count))}.a, base: ball, at: {_frame(rng)}}}",
        ]
    values = {name: _value(kind, rng) for name, kind in kinds.items()}
    lines += ["poses:", f"  p: {{{', '.join(f'{name}: {value}' for name, value in values.items() if value)}}}"]
    return "\n".join(lines) + "\n"


def _value(kind: str, rng: np.random.Generator) -> str:
    """Return a random joint value for a pose. The string is empty if the pose omits the joint."""
    if kind == "ball":
        return f"{{rpy: [{', '.join(f'{angle:.3f} rad' for angle in rng.uniform(-1.5, 1.5, 3))}]}}"
    units = {**COUNTS, "mimic": (), **dict.fromkeys(("revolute", "continuous", "screw"), ("rad",)), "prismatic": ("m",)}[kind]
    said = [f"{rng.uniform(-0.02, 0.02) if unit == 'm' else rng.uniform(-0.4, 0.4):.4f} {unit}" for unit in units]
    return said[0] if len(said) == 1 else f"[{', '.join(said)}]" if said else ""


def _frame(rng: np.random.Generator) -> str:
    xyz, rpy = rng.uniform(-100, 100, 3), rng.uniform(-180, 180, 3)
    place, turn = ", ".join(f"{x:.2f} mm" for x in xyz), ", ".join(f"{x:.2f} deg" for x in rpy)
    return f"{{xyz: [{place}], rpy: [{turn}]}}"


def _mass(rng: np.random.Generator) -> str:
    """Return the mass, the centre of mass and the inertia of a random box, as keys of a document."""
    mass, (a, b, c) = rng.uniform(0.1, 1.0), rng.uniform(0.02, 0.2, 3)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    i = turn @ np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) @ turn.T * mass / 12.0 * 1e6
    moments = ", ".join(f"{name}: {value:.6f} kg*mm^2" for name, value in (
        ("ixx", i[0, 0]), ("iyy", i[1, 1]), ("izz", i[2, 2]), ("ixy", i[0, 1]), ("ixz", i[0, 2]), ("iyz", i[1, 2]),
    ))
    centre = ", ".join(f"{x:.2f} mm" for x in rng.uniform(-50, 50, 3))
    return f"mass: {mass:.4f} kg, com: [{centre}], inertia: {{{moments}}}"
