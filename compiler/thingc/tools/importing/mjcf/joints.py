"""What moves a body, as MuJoCo has it."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from thingc.tools.importing.mjcf.compiled_source import SOLIMP, SOLREF, CompiledSource, differing, floats, numbers
from thingc.tools.importing.mjcf.drives import Actuators
from thingc.tools.importing.mjcf.equalities import Equalities
from thingc.tools.importing.source_model import FAR, Kind, Raw, SourceJoint, SourceLimits

BALL, SLIDE, HINGE = 1, 2, 3


def joint_of(original: CompiledSource, joint: int, drives: Actuators, couplings: Equalities) -> SourceJoint:
    """A hinge, slide or ball of the model."""
    model, name, where = original.model, original.joints[joint], original.where("joint", joint)
    kind_of, dof = int(model.jnt_type[joint]), int(model.jnt_dofadr[joint])
    limited, (lower, upper) = bool(model.jnt_limited[joint]), floats(model.jnt_range[joint])
    follows, drive = couplings.follows.get(joint), drives.of_joint.get(joint)
    start = 0.0 if kind_of == BALL else float(model.qpos0[model.jnt_qposadr[joint]])
    kind: Kind
    match kind_of:
        case 1:
            kind, ends = "ball", SourceLimits(upper=upper if limited else None)
        case 2:
            kind, ends = "prismatic", SourceLimits(lower=lower, upper=upper)
            if not limited:
                ends = SourceLimits(lower=start - FAR, upper=start + FAR, made_up=True)
                original.losses.note(f"slide `{name}` without ends", f"a document has them, at {FAR:g} m", where)
        case _:
            kind, ends = ("revolute", SourceLimits(lower=lower, upper=upper)) if limited else ("continuous", SourceLimits())
    if name in original.speeds and kind != "ball":
        ends = replace(ends, velocity=original.speeds[name])
    weakest, strongest = floats(model.jnt_actfrcrange[joint])
    if drive is None and kind != "ball" and model.jnt_actfrclimited[joint] and weakest == -strongest:
        ends = replace(ends, effort=strongest)
    stiffness = float(model.jnt_stiffness[joint])
    rest = float(model.qpos_spring[model.jnt_qposadr[joint]]) if kind != "ball" else 0.0
    begin = None if kind == "ball" else ends.nearest(start)
    if start:
        why = "MuJoCo takes it from where its reference is, which is q = 0 in a document"
        original.losses.note(f"how soft constraints are at the reference of joint `{name}`, {start:g}", why, where)
    for what in ("jnt_stiffnesspoly", "dof_dampingpoly"):
        polynomial = getattr(model, what, None)
        if polynomial is not None and any(floats(polynomial[joint if what.startswith("jnt") else dof])):
            original.losses.note(f"what of joint `{name}` is not linear", "damping and stiffness of a document are numbers", where)
    (x, y, z), (u, v, w) = floats(model.jnt_pos[joint]), floats(model.jnt_axis[joint])
    return SourceJoint(
        name=name, kind=kind, axis=(u, v, w), anchor=(x, y, z), where=where, ends=ends, start=start, begin=begin, stiffness=stiffness,
        rest=rest if stiffness else 0.0,
        damping=float(model.dof_damping[dof]), friction=float(model.dof_frictionloss[dof]), armature=float(model.dof_armature[dof]),
        follows=follows, drive=drive, raw=_raw(model, joint, dof, ends.effort),
    )


def free_joint(original: CompiledSource, joint: int) -> Raw:
    """What a free joint does by itself, in MuJoCo's words: the language has none."""
    model, dof = original.model, int(original.model.jnt_dofadr[joint])
    wanted = [("stiffness", numbers([model.jnt_stiffness[joint]]))]
    wanted += [(name, numbers([getattr(model, f"dof_{name}")[dof]])) for name in ("damping", "frictionloss", "armature")]
    return *differing(wanted, {name: "0" for name, _ in wanted}), *_raw(model, joint, dof, None)


def _raw(model: Any, joint: int, dof: int, effort: float | None) -> Raw:
    """What the language has no words for, beside an `effort` limit [N m or N]."""
    wanted = [
        ("solreflimit", numbers(model.jnt_solref[joint])), ("solimplimit", numbers(model.jnt_solimp[joint])),
        ("solreffriction", numbers(model.dof_solref[dof])), ("solimpfriction", numbers(model.dof_solimp[dof])),
        ("margin", numbers([model.jnt_margin[joint]])),
        ("actuatorgravcomp", "true" if model.jnt_actgravcomp[joint] else "false"),
    ]
    if model.jnt_actfrclimited[joint]:
        wanted.append(("actuatorfrcrange", numbers(model.jnt_actfrcrange[joint])))
    return differing(wanted, {
        "solreflimit": SOLREF, "solimplimit": SOLIMP, "solreffriction": SOLREF, "solimpfriction": SOLIMP, "margin": "0",
        "actuatorgravcomp": "false", **({} if effort is None else {"actuatorfrcrange": numbers([-effort, effort])}),
    })
