"""Warn of suspicious settings in the modes of a document."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from thingc.base.diagnostics import Code, make_notes
from thingc.base.units import FORCE, Quantity
from thingc.model.assembly.instance_tree import Tree
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Adhesion, LinkedMode
from thingc.model.resolve.plausibility import times_words
from thingc.model.resolve.types import AssemblyDefinition, Mode

WEAK, STRONG = 0.1, 1000.0
"""Plausible range for the force of a magnet, relative to the weight of the robot."""
LONG_STEP = 10e-3
"""Largest plausible time step [s]. Contacts in MuJoCo need time steps of about a fifth of this value."""
GRAVITY = 9.81
"""Gravity [m/s^2] from which weights are computed, independent of the gravity of a mode."""


def check_nested_simulation(tree: Tree) -> None:
    """Warn of simulation settings of nested documents that neither the top document nor its modes specify."""
    top = tree.model
    stated = {*top.simulation, *(key for mode in top.modes for key in mode.simulation)}
    nested = {definition.document: (definition, instance) for instance, definition in tree.assemblies if instance is not tree.top}
    for definition, instance in nested.values():
        unused = {key: f"{value} s" if key == "timestep" else value for key, value in definition.simulation.items() if key not in stated}
        if unused:
            settings = ", ".join(f"{key}: {value}" for key, value in unused.items())
            tree.findings.warn(
                Code.NESTED_SIMULATION,
                f"`simulation: {{{settings}}}` of the nested document `{definition.name}` has no effect",
                (definition.step_origin or definition.origin) + instance.origin, path=instance.path,
                help=f"add `simulation: {{{settings}}}` to the document of `{top.name}`",
            )


def check_modes(
    top: AssemblyDefinition, modes: Sequence[LinkedMode], magnets: Collection[Adhesion], mass: float, findings: LinkReport,
) -> None:
    """Warn of implausible settings in the modes of the `top` document.

    `mass` is the mass [kg] of the robot, and `magnets` contains the magnets of all modes.
    """
    _check_steps(top, findings)
    _check_gravity(top.modes, findings)
    _check_magnets(top, modes, mass, findings)
    _check_held(top, modes, magnets, findings)
    unlike = {mode.name for mode in top.modes if mode.has_expressions}
    unlike.update(path[-1] for component in top.components for path in component.overrides.variants if path[:1] == ("modes",))
    _check_alike([mode for mode in modes if mode.name not in unlike], findings)


def _check_steps(top: AssemblyDefinition, findings: LinkReport) -> None:
    """Warn of time steps that are too long for contacts, at their location in the document."""
    owners: list[tuple[AssemblyDefinition | Mode, str]] = [(top, "simulation"), *((mode, mode.name) for mode in top.modes)]
    for owner, path in owners:
        step = owner.simulation.get("timestep")
        if isinstance(step, float) and step >= LONG_STEP:
            findings.warn(
                Code.LONG_STEP, f"a time step of {1e3 * step:g} ms is too long for contacts",
                owner.step_origin, path=path, help="use a time step of 1 to 5 ms",
            )


def _check_gravity(modes: Sequence[Mode], findings: LinkReport) -> None:
    """Warn of a numeric gravity vector that points straight up.

    The sign is probably wrong, because a robot on a ceiling would use the keyword `ceiling`.
    """
    for mode in modes:
        x, y, z = mode.gravity
        if mode.gravity_origin and x == y == 0.0 < z:
            findings.warn(
                Code.GRAVITY_UP, f"gravity points up ({z:.6g} m/s^2)", mode.gravity_origin,
                path=mode.name, help="write `gravity: floor`, or `gravity: ceiling` for a robot that hangs from a ceiling",
            )


def _check_magnets(top: AssemblyDefinition, modes: Sequence[LinkedMode], mass: float, findings: LinkReport) -> None:
    """Warn of forces of magnets that are implausible in comparison with the weight of the robot."""
    weight = mass * GRAVITY
    places = {mode.name: mode for mode in top.modes}
    reported: set[tuple[str, float]] = set()
    for mode in modes:
        for reference, force in places[mode.name].adhesion if mode.name in places else ():
            if WEAK * weight <= force <= STRONG * weight or weight <= 0.0 or (reference.text, force) in reported:
                continue
            ratio = force / weight
            times = f"{times_words(ratio)} times" if ratio > 1.0 else f"{ratio:.2g} times"
            reported.add((reference.text, force))
            findings.warn(
                Code.MAGNET, f"the adhesion of `{reference.text}` ({Quantity(force, FORCE)}) is {times} the weight of the robot",
                reference.origin, path=mode.name,
                notes=make_notes(f"mode `{mode.name}` is defined here", mode.origin),
                help="check the unit (`mN`, `N`, `kN`)",
            )


def _check_held(top: AssemblyDefinition, modes: Sequence[LinkedMode], magnets: Collection[Adhesion], findings: LinkReport) -> None:
    """Warn of a mode that holds the robot at an inactive magnet although another magnet is active and not held."""
    places = {magnet.path: (magnet.occurrence, magnet.mount) for magnet in magnets}
    written = {mode.name: {reference.text: reference.origin for reference, _ in mode.adhesion} for mode in top.modes}
    for mode in modes:
        holding = {(at.occurrence, at.mount) for at in (mode.root, *(hold.mount for hold in mode.holds))}
        on = [path for path in mode.adhesion if path in places]
        off = next((path for path, place in places.items() if place == (mode.root.occurrence, mode.root.mount)), None)
        if mode.base != "held" or off is None or not on or any(places[path] in holding for path in on):
            continue
        shown, other = (path.replace("/", ".") for path in (off, on[0]))
        findings.warn(
            Code.HELD_OFF, f"the magnet at the root of mode `{mode.name}` (`{shown}`) is off",
            mode.origin, path=mode.name, notes=make_notes(
                f"the magnet of `{other}` is switched on here", written[mode.name].get(other, ()),
            ),
            help=f"write `root: {other}`, or switch on the magnet at `{shown}`",
        )


def _check_alike(modes: Sequence[LinkedMode], findings: LinkReport) -> None:
    """Warn of several modes that would produce the same simulation model."""
    met: dict[object, LinkedMode] = {}
    for mode in modes:
        first = met.setdefault(_content(mode), mode)
        if first is not mode:
            findings.warn(
                Code.ALIKE, f"mode `{mode.name}` is identical to mode `{first.name}`", mode.origin, path=mode.name,
                notes=make_notes(f"mode `{first.name}` is defined here", first.origin),
                help="change or remove one of the two modes",
            )


def _content(mode: LinkedMode) -> object:
    """Return all settings of a mode that determine its simulation model, which are all settings except the name and the location."""
    return (
        (mode.root.occurrence, mode.root.mount, mode.root.of_component), mode.base, mode.at, mode.on_floor, mode.gravity, mode.pose,
        mode.poses, mode.actuators,
        frozenset((pair.one, pair.other, pair.friction, pair.margin, pair.gap) for pair in mode.pairs), mode.groups,
        frozenset(mode.exclude), frozenset(mode.adhesion.items()), frozenset(mode.simulation.items()),
        frozenset((hold.mount.occurrence, hold.mount.mount, hold.mount.of_component, hold.pose, hold.turns) for hold in mode.holds),
        frozenset((foot.mount.occurrence, foot.mount.mount, foot.friction) for foot in mode.feet),
        frozenset(cut.joint for cut in mode.cut),
    )
