"""What acts along a coordinate or a tendon, as values of a document; and tendons, as lines."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.tools.importing.document_names import DocumentNaming
from thingc.tools.importing.quantities import TURNS, angle, length, quantity, scaled, was
from thingc.tools.importing.source_model import SourceDrive, SourceJoint, SourceStep, SourceTendon


def dynamics_words(of: SourceJoint | SourceTendon, turns: bool) -> dict[str, str]:
    """`dynamics`: what is not 0; `turns` where q, or the length, is an angle. The spring of a path rests where that says."""
    units = ("N*m*s/rad", "N*m", "kg*m^2", "N*m/rad") if turns else ("N*s/m", "N", "kg", "N/m")
    values = {"damping": of.damping, "friction": of.friction, "armature": of.armature, "stiffness": of.stiffness}
    said = {key: quantity(value, unit) for (key, value), unit in zip(values.items(), units, strict=True) if value}
    rests = of.rest or isinstance(of, SourceTendon) and of.steps and of.stiffness
    return said | ({"rest": (angle if turns else length)(of.rest)} if rests else {})


def drive_words(drive: SourceDrive, turns: bool) -> dict[str, str]:
    """`drive`: its kind, gains and bounds."""
    values = {
        "kp": (drive.kp, "N*m/rad" if turns else "N/m"), "kv": (drive.kv, "N*m*s/rad" if turns else "N*s/m"),
        "effort": (drive.effort, "N*m" if turns else "N"), "velocity": (drive.velocity, "rad/s" if turns else "m/s"),
    }
    return {"kind": drive.kind, **{key: quantity(value, unit) for key, (value, unit) in values.items() if value is not None}}


def tendon_lines(words: DocumentNaming) -> Iterator[str]:
    """The section `tendons`, where there are any."""
    if words.robot.tendons:
        yield "tendons:"
    kinds = {joint.name: joint.kind for one in words.order for joint in one.joints}
    for one in words.robot.tendons:
        yield f"  {words.tendons[one.name]}:{was(words.tendons[one.name], one.name)}"
        if one.moves:
            factors = (f"{words.joints[name]}: {_factor(one, kinds[name] in TURNS, value)}" for name, value in one.moves)
            yield f"    joints: {{{', '.join(factors)}}}"
        else:
            yield f"    path: [{', '.join(_step(words, step) for step in one.steps)}]"
        if one.width:
            yield f"    width: {length(one.width)}"
        values = {"dynamics": dynamics_words(one, one.turns)}
        if one.ends.lower is not None and one.ends.upper is not None:
            place = angle if one.turns else length
            values["limit"] = {"lower": place(one.ends.lower), "upper": place(one.ends.upper)}
        if one.drive is not None:
            values["drive"] = drive_words(one.drive, one.turns)
        for key in ("limit", "dynamics", "drive"):
            if values.get(key):
                yield f"    {key}: {{{', '.join(f'{name}: {value}' for name, value in values[key].items())}}}"
    if words.robot.tendons:
        yield ""


def _factor(tendon: SourceTendon, turns: bool, value: float) -> str:
    """Of a joint: length per q. It says its unit also where it is 0."""
    unit = "" if tendon.turns or not turns else "m/rad"
    return f"{scaled(value, 0)} {unit}".rstrip()


def _step(words: DocumentNaming, step: SourceStep) -> str:
    if step.around is not None:
        side = "" if step.around.side is None else f", side: {words.sites[step.around.side]}"
        centre = f"{words.links[step.around.link]}.{words.centres[step.around.name]}"
        return f"{{around: {centre}, {step.around.kind}: {length(step.around.radius)}{side}}}"
    return f"{{pulley: {scaled(step.divisor, 0)}}}" if step.divisor is not None else words.sites[step.site or ""]
