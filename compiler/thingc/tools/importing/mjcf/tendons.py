"""Convert the tendons of a MuJoCo model, which either couple joints or run along a path of sites and shapes."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from thingc.base.numeric import hypot
from thingc.base.pose import Pose
from thingc.tools.importing.mjcf.compiled_source import SOLIMP, SOLREF, CompiledSource, differing, floats, numbers, pose_of
from thingc.tools.importing.mjcf.shapes import GREY
from thingc.tools.importing.source_model import Raw, SourceAround, SourceDrive, SourceLimits, SourceStep, SourceTendon

JOINT, PULLEY, SITE, SPHERE, CYLINDER = 1, 2, 3, 4, 5
HINGE = 3
WIDTH = 0.003
USUAL = {
    "stiffness": "0", "damping": "0", "frictionloss": "0", "armature": "0", "margin": "0", "group": "0", "width": numbers(WIDTH),
    "rgba": "0.5 0.5 0.5 1", "solreflimit": SOLREF, "solimplimit": SOLIMP, "solreffriction": SOLREF, "solimpfriction": SOLIMP,
}
"""MuJoCo's default values of tendon attributes."""


SOFTNESS = {
    "solreflimit": "tendon_solref_lim", "solimplimit": "tendon_solimp_lim", "solreffriction": "tendon_solref_fri",
    "solimpfriction": "tendon_solimp_fri",
}
"""Maps the attributes of tendons that specify the softness of constraints to arrays of MuJoCo models."""


class Tendons:
    """Converts the tendons of a MuJoCo model.

    `of` maps the indices of supported tendons to the converted tendons. Other tendons are recorded as losses. `joints` and `sites` contain
    the indices of imported elements. `on` maps each imported body to a link and the pose of the body in this link. `heads` maps each body
    to the first body of its link.
    """

    def __init__(
        self, original: CompiledSource, joints: set[int], sites: set[int], on: Mapping[int, tuple[int, Pose]], heads: Mapping[int, int],
    ) -> None:
        self.original, self.model, self.joints, self.sites, self.on, self.heads = original, original.model, joints, sites, on, heads
        self.of: dict[int, SourceTendon] = {}
        for number in range(self.model.ntendon):
            first, count = int(self.model.tendon_adr[number]), int(self.model.tendon_num[number])
            wraps = range(first, first + count)
            why = next(filter(None, map(self._unsaid, wraps)), "")
            if why:
                original.lose("tendon", number, f"tendon `{original.tendons[number]}`", why)
            else:
                self.of[number] = self._tendon(number, wraps)

    def with_drives(self, drives: Mapping[int, SourceDrive]) -> tuple[SourceTendon, ...]:
        """Return all imported tendons, including their drives. `drives` maps the index of a tendon to its drive."""
        return tuple(replace(one, drive=drives.get(number)) for number, one in self.of.items())

    def _unsaid(self, wrap: int) -> str:
        """Return the reason why a document cannot express one step of a tendon's path, or an empty string if the step is supported."""
        model = self.model
        kind, thing, side = (int(one[wrap]) for one in (model.wrap_type, model.wrap_objid, model.wrap_prm))
        reason = "the tendon uses elements that are not imported"
        if kind == JOINT:
            return "" if thing in self.joints else reason
        if kind == SITE:
            return "" if thing in self.sites else reason
        if kind == PULLEY:
            begins = any(wrap == int(first) for first in model.tendon_adr)
            return "the tendon starts with a pulley" if begins else "" if model.wrap_prm[wrap] > 0.0 else "a pulley has the divisor 0"
        body = int(model.geom_bodyid[thing])
        if body not in self.on or side >= 0 and side not in self.sites:
            return reason
        if side < 0:
            return ""
        on, place = int(model.site_bodyid[side]), pose_of(model.site_pos[side], model.site_quat[side])
        if self.heads[on] != self.heads[body]:
            return "the side site and the wrapping geom are on different links"
        shape = self._pose_in_link(body) @ pose_of(model.geom_pos[thing], model.geom_quat[thing])
        x, y, z = (shape.inverse() @ self._pose_in_link(on) @ place).translation
        inside = hypot(x, y, z if kind == SPHERE else 0.0) <= float(model.geom_size[thing][0])
        return "documents do not support tendons that wrap inside a shape" if inside else ""

    def _pose_in_link(self, body: int) -> Pose:
        """Return the pose of a body in the frame of the first body of its link."""
        pose = pose_of(self.model.body_pos[body], self.model.body_quat[body])
        return pose if self.heads[body] == body else self._pose_in_link(int(self.model.body_parentid[body])) @ pose

    def _tendon(self, number: int, wraps: range) -> SourceTendon:
        model, original = self.model, self.original
        moves: dict[str, float] = {}
        joints = [(wrap, int(model.wrap_objid[wrap])) for wrap in wraps if int(model.wrap_type[wrap]) == JOINT]
        for wrap, joint in joints:
            moves[original.joints[joint]] = moves.get(original.joints[joint], 0.0) + float(model.wrap_prm[wrap])
        turns = all(int(model.jnt_type[joint]) == HINGE for _, joint in joints)
        lower, upper = original.bounds("tendon_", number) or (0.0, 0.0)
        if not moves:
            lower = max(lower, 0.0)  # the length of a path cannot be negative
        ends = SourceLimits(lower=lower, upper=upper) if lower < upper else SourceLimits()
        damping, friction, armature, stiffness = (
            max(float(getattr(model, f"tendon_{word}")[number]), 0.0) for word in ("damping", "frictionloss", "armature", "stiffness")
        )
        rest = float(model.tendon_lengthspring[number][0]) if stiffness else 0.0
        original.lose_nonlinear("tendon", number, {"tendon_stiffnesspoly": number, "tendon_dampingpoly": number})
        made = SourceTendon(
            name=original.tendons[number], where=original.where("tendon", number), moves=tuple(moves.items()), turns=bool(moves) and turns,
            steps=() if moves else tuple(map(self._step, wraps)), ends=ends, damping=damping, friction=friction, armature=armature,
            stiffness=stiffness, rest=rest if moves else max(rest, 0.0),
            width=2.0 * float(model.tendon_width[number]) if not moves and model.tendon_width[number] != WIDTH else None,
        )
        return replace(made, raw=self._raw(number, made))

    def _step(self, wrap: int) -> SourceStep:
        model = self.model
        kind, thing = int(model.wrap_type[wrap]), int(model.wrap_objid[wrap])
        if kind == PULLEY:
            return SourceStep(divisor=float(model.wrap_prm[wrap]))
        if kind == SITE:
            return SourceStep(site=self.original.sites[thing])
        link, pose = self.on[int(model.geom_bodyid[thing])]
        side = int(model.wrap_prm[wrap])
        return SourceStep(around=SourceAround(
            name=self.original.geoms[thing], link=self.original.bodies[link], kind="sphere" if kind == SPHERE else "cylinder",
            pose=pose @ pose_of(model.geom_pos[thing], model.geom_quat[thing]), radius=float(model.geom_size[thing][0]),
            side=self.original.sites[side] if side >= 0 else None,
        ))

    def _raw(self, number: int, tendon: SourceTendon) -> Raw:
        """Return the attributes of a tendon that a document cannot express, or whose default value in documents differs from MuJoCo's."""
        model = self.model
        plain = ("stiffness", "damping", "frictionloss", "armature", "margin", "group", *(() if tendon.moves else ("width",)))
        attributes = self.original.texts(number, {word: f"tendon_{word}" for word in plain})
        otherwise = USUAL | {
            "stiffness": numbers(tendon.stiffness), "damping": numbers(tendon.damping), "frictionloss": numbers(tendon.friction),
            "armature": numbers(tendon.armature),
        }
        if tendon.width:
            otherwise["width"] = numbers(tendon.width / 2.0)
        if model.tendon_stiffness[number]:
            spring = floats(model.tendon_lengthspring[number])
            attributes.append(("springlength", numbers(spring if spring[0] != spring[1] else spring[:1])))
            otherwise |= {"springlength": numbers(tendon.rest)} if tendon.stiffness else {}
        if model.tendon_limited[number]:
            attributes += self.original.texts(number, {"range": "tendon_range"})
            if tendon.ends.lower is not None and tendon.ends.upper is not None:
                otherwise["range"] = numbers([tendon.ends.lower, tendon.ends.upper])
        if model.tendon_actfrclimited[number]:
            attributes += self.original.texts(number, {"actuatorfrcrange": "tendon_actfrcrange"})
        if not tendon.moves:
            material = int(model.tendon_matid[number])
            color = floats(model.tendon_rgba[number])
            if color == GREY and material >= 0:
                color = floats(model.mat_rgba[material])
            attributes.append(("rgba", numbers([round(one, 6) for one in color])))
        attributes += self.original.texts(number, SOFTNESS)
        return differing(attributes, otherwise)
