"""Convert the joints and equality constraints of a MuJoCo model to joints, mimic joints and closed loops."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from msgspec.structs import replace

from thingc.base.numeric import sum_of
from thingc.base.pose import NO_POSE, Pose, make_translation
from thingc.tools.importing.mjcf.adding import Added
from thingc.tools.importing.mjcf.compiled_source import SITE, SOLIMP, SOLREF, CompiledSource, differing, floats, numbers, pose_of
from thingc.tools.importing.mjcf.drives import Actuators
from thingc.tools.importing.source_model import FAR, Kind, Raw, SourceJoint, SourceLimits, SourceLoop, SourceMimic

FREE, BALL, SLIDE, HINGE = 0, 1, 2, 3
CONNECT, WELD, JOINT = 0, 1, 2
SOFTNESS = {"solref": "eq_solref", "solimp": "eq_solimp"}
"""Maps the attributes of equality constraints that documents cannot express to arrays of MuJoCo models."""
STIFF = {"solref": SOLREF, "solimp": "0.9999 0.9999 0.001 0.5 2"}
"""Attributes of the equality constraint that thingc writes for a mimic. `STIFF` in `targets/mjcf` contains the same values."""


class Equalities:
    """Converts the equality constraints of a MuJoCo model to mimics and closed loops.

    `follows` maps the index of a joint to its mimic, which couples the joint to another joint. `loops` are the closed loops, and the
    joints of the bodies `looping` are part of loops. Other equalities are `added` to the MuJoCo model unchanged, or recorded as losses.
    `on` maps each imported body to a link and the pose of the body in this link.
    """

    def __init__(self, original: CompiledSource, drives: Actuators, on: Mapping[int, tuple[int, Pose]], added: Added) -> None:
        self.original, self.model, self.drives, self.on = original, original.model, drives, on
        self.follows: dict[int, SourceMimic] = {}
        self.loops: list[SourceLoop] = []
        self.looping: set[int] = set()
        for number in range(self.model.neq):
            kind = int(self.model.eq_type[number])
            why = ""
            if not self.model.eq_active0[number]:
                why = "documents do not support inactive equalities"
            elif kind == JOINT:
                why = self._follow(number)
            elif kind in (CONNECT, WELD):
                why = self._loop(number)
            elif not added.equality(number):
                why = "documents only support equalities that couple joints or close loops"
            if why:
                original.lose("equality", number, f"equality `{original.equalities[number]}`", why)

    def _raw(self, number: int, otherwise: dict[str, str]) -> Raw:
        return differing(self.original.texts(number, SOFTNESS), otherwise)

    def _follow(self, number: int) -> str:
        """Convert an equality constraint between joints to a mimic, and add the mimic to `follows`.

        Return the reason why a document cannot express the equality, or an empty string if the mimic was added.
        """
        model, original = self.model, self.original
        one, other = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        a, b, *higher = floats(model.eq_data[number][:5])
        if other < 0 or not b and not any(higher):
            return "documents do not support equalities with a constant"
        if one in self.drives.of_joint and other not in self.drives.of_joint and abs(b) == 1.0 and not any(higher):
            one, other, a = other, one, -a * b  # invert the linear relation between the two joints
        if one in self.drives.of_joint:
            return f"a joint with `mimic` cannot have a drive (`{original.joints[one]}`)"
        if one in self.follows or other in self.follows:
            return "one of the joints already mimics another joint"
        if any(int(model.jnt_bodyid[joint]) not in self.on for joint in (one, other)):
            return "the joints of the equality are not imported"
        first, second = (float(model.qpos0[model.jnt_qposadr[joint]]) for joint in (one, other))
        constant, *rest = _shift((a, b, *higher), second)
        self.follows[one] = SourceMimic(
            joint=original.joints[other], coefficients=(first + constant, *rest), where=original.where("equality", number),
            raw=self._raw(number, STIFF), name=original.written["equality"][number].name,
        )
        return ""

    def _loop(self, number: int) -> str:
        """Convert an equality constraint between two bodies to a closed loop, and add the loop to `loops`.

        Return the reason why a document cannot express the equality, or an empty string if the loop was added.
        """
        model, original, ends = self.model, self.original, [*self._ends(number)]
        tops = {int(model.body_rootid[body]) for body, _ in ends}
        if len(ends) < 2:
            return "the equality does not connect two links"
        if len({int(model.body_weldid[body]) for body, _ in ends}) < 2:
            return "the bodies are fixed to each other"
        if len(tops) > 1 and any(model.jnt_type[joint] == FREE for top in tops for joint in original.joints_of[top]):
            return "documents do not support loops that contain a free joint"
        self.looping |= self._path_to_world(ends[0][0]) ^ self._path_to_world(ends[1][0])
        (one, place), (other, other_place) = ((self.on[body], pose) for body, pose in ends)
        self.loops.append(SourceLoop(
            name=original.equalities[number].removesuffix(":loop"),  # thingc appends this suffix
            kind="ball" if int(model.eq_type[number]) == CONNECT else "fixed",
            ends=((original.bodies[one[0]], one[1] @ place), (original.bodies[other[0]], other[1] @ other_place)),
            where=original.where("equality", number), raw=self._raw(number, {}), equality=original.written["equality"][number].name,
        ))
        return ""

    def _path_to_world(self, body: int) -> set[int]:
        return {body} | (self._path_to_world(int(self.model.body_parentid[body])) if body else set())

    def _ends(self, number: int) -> Iterator[tuple[int, Pose]]:
        """Yield the imported bodies that an equality constraint connects, and the pose of the connection in the frame of each body."""
        model, data = self.model, floats(self.model.eq_data[number])
        for index, thing in enumerate((int(model.eq_obj1id[number]), int(model.eq_obj2id[number]))):
            if int(model.eq_objtype[number]) == SITE:
                body, pose = int(model.site_bodyid[thing]), pose_of(model.site_pos[thing], model.site_quat[thing])
            elif int(model.eq_type[number]) == CONNECT:
                body, pose = thing, make_translation(*data[3 * index : 3 * index + 3])
            else:
                body, pose = thing, NO_POSE if index else pose_of(data[3:6], data[6:10])
            if body in self.on:
                yield body, pose


def _shift(coefficients: Sequence[float], by: float) -> list[float]:
    """Convert the coefficients of a polynomial in q - `by` to the coefficients of the equal polynomial in q."""
    return [
        sum_of(one * math.comb(power, k) * (-by) ** (power - k) for power, one in enumerate(coefficients) if power >= k)
        for k in range(len(coefficients))
    ]


def joint_of(original: CompiledSource, joint: int, drives: Actuators, couplings: Equalities) -> SourceJoint:
    """Convert a joint of the MuJoCo model to a joint of the source model."""
    model, name, where = original.model, original.joints[joint], original.where("joint", joint)
    kind_of, dof = int(model.jnt_type[joint]), int(model.jnt_dofadr[joint])
    if kind_of == FREE:
        return SourceJoint(name=name, kind="free", axis=(0.0, 0.0, 1.0), where=where, raw=free_joint(original, joint))
    lower, upper = original.bounds("jnt_", joint) or (None, None)
    follows, drive = couplings.follows.get(joint), drives.of_joint.get(joint)
    start = 0.0 if kind_of == BALL else float(model.qpos0[model.jnt_qposadr[joint]])
    kind: Kind
    match kind_of:
        case 1:
            kind, ends = "ball", SourceLimits(upper=upper)
        case 2:
            kind, ends = "prismatic", SourceLimits(lower=lower, upper=upper)
            if lower is None:
                ends = SourceLimits(lower=start - FAR, upper=start + FAR, made_up=True)
                original.losses.note(f"unlimited slide `{name}`", f"the document specifies limits of +-{FAR:g} m", where)
        case _:
            kind, ends = "continuous" if lower is None else "revolute", SourceLimits(lower=lower, upper=upper)
    if kind != "ball":
        ends = replace(ends, velocity=original.custom.get(name, {}).get("velocity", (None,))[0])
    weakest, strongest = floats(model.jnt_actfrcrange[joint])
    if drive is None and kind != "ball" and model.jnt_actfrclimited[joint] and weakest == -strongest:
        ends = replace(ends, effort=strongest)
    stiffness = float(model.jnt_stiffness[joint])
    rest = float(model.qpos_spring[model.jnt_qposadr[joint]]) if kind != "ball" else 0.0
    begin = None if kind == "ball" else ends.nearest(start)
    if start:
        why = "documents specify the softness at q = 0"
        original.losses.note(f"the softness of constraints at the reference of joint `{name}`, {start:g}", why, where)
    original.lose_nonlinear("joint", joint, {"jnt_stiffnesspoly": joint, "dof_dampingpoly": dof})
    (x, y, z), (u, v, w) = floats(model.jnt_pos[joint]), floats(model.jnt_axis[joint])
    return SourceJoint(
        name=name, kind=kind, axis=(u, v, w), anchor=(x, y, z), where=where, ends=ends, start=start, begin=begin, stiffness=stiffness,
        rest=rest if stiffness else 0.0,
        damping=float(model.dof_damping[dof]), friction=float(model.dof_frictionloss[dof]), armature=float(model.dof_armature[dof]),
        follows=follows, drive=drive, raw=_raw(original, joint, dof, ends.effort),
    )


def free_joint(original: CompiledSource, joint: int) -> Raw:
    """Return the attributes of a free joint that a document cannot express, such as stiffness and damping."""
    dof = int(original.model.jnt_dofadr[joint])
    attributes = original.texts(joint, {"stiffness": "jnt_stiffness"})
    attributes += original.texts(dof, {name: f"dof_{name}" for name in ("damping", "frictionloss", "armature")})
    return *differing(attributes, {name: "0" for name, _ in attributes}), *_raw(original, joint, dof, None)


def _raw(original: CompiledSource, joint: int, dof: int, effort: float | None) -> Raw:
    """Return the attributes of a joint that a document cannot express. `effort` is the effort limit in the document [N m or N]."""
    model = original.model
    attributes = [
        *original.texts(joint, {"solreflimit": "jnt_solref", "solimplimit": "jnt_solimp"}),
        *original.texts(dof, {"solreffriction": "dof_solref", "solimpfriction": "dof_solimp"}),
        *original.texts(joint, {"margin": "jnt_margin"}), ("actuatorgravcomp", "true" if model.jnt_actgravcomp[joint] else "false"),
    ]
    if model.jnt_actfrclimited[joint]:
        attributes += original.texts(joint, {"actuatorfrcrange": "jnt_actfrcrange"})
    return differing(attributes, {
        "solreflimit": SOLREF, "solimplimit": SOLIMP, "solreffriction": SOLREF, "solimpfriction": SOLIMP, "margin": "0",
        "actuatorgravcomp": "false", **({} if effort is None else {"actuatorfrcrange": numbers([-effort, effort])}),
    })
