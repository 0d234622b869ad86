"""Actuators of the source: drives of joints, and adhesions of bodies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thingc.importing.mjcf.adding import Added
from thingc.importing.mjcf.original import Original, differing, floats, numbers
from thingc.importing.model import Raw, SourceAdhesion, SourceDrive
from thingc.pose import Pose

AT_JOINT, AT_PARENT, AT_BODY = 0, 1, 5
FIXED_GAIN, NO_BIAS, AFFINE = 0, 0, 1
NOT_DYNAMIC, EXACT = 0, 3
HINGE, SLIDE = 3, 2
UNSAID = ("actlimited", "actearly", "armature", "delay")
"""What of actuators a document does not say, and is 0 of most."""


class Actuators:
    """`of_joint` by the number of the joint, `driven` the names of these joints by that of the actuator; `adhesions`; others are `added`,
    or losses. `joints` are those that are kept, `on` is the link of each body that is kept, with the body's pose in it."""

    def __init__(self, original: Original, joints: set[int], on: Mapping[int, tuple[int, Pose]], added: Added) -> None:
        self.original, self.model = original, original.model
        self.of_joint: dict[int, SourceDrive] = {}
        self.driven: dict[int, str] = {}
        adhesions = []
        for number in range(self.model.nu):
            transmission, target = int(self.model.actuator_trntype[number]), int(self.model.actuator_trnid[number][0])
            what, where = f"actuator `{original.actuators[number]}`", original.where("actuator", number)
            why = ""
            if transmission == AT_BODY and target in on:
                adhesions.append(self._adhesion(number, original.bodies[on[target][0]]))
            elif transmission not in (AT_JOINT, AT_PARENT) or int(self.model.jnt_type[target]) not in (HINGE, SLIDE):
                why = "a document drives joints that turn about, or slide along, an axis"
            elif target not in joints:
                why = "its joint is left out"
            elif target in self.of_joint:
                why = f"`{original.joints[target]}` is driven by `{self.of_joint[target].name}`, and a joint of a document has one drive"
            else:
                drive = self._drive(number, target)
                why = "" if drive is not None else "a drive of a document is a motor, or of position or velocity with a gain"
                if drive is not None:
                    self.of_joint[target] = drive
                    self.driven[number] = original.joints[target]
            if why and added.actuator(number):
                self._unsaid(number, what)
            elif why:
                original.lose(what, why, where)
            else:
                self._unsaid(number, what)
        self.adhesions = tuple(adhesions)

    def _unsaid(self, number: int, what: str) -> None:
        for name in UNSAID:
            values = getattr(self.model, f"actuator_{name}", None)
            if values is not None and float(values[number]):
                self.original.lose(f"`{name}` of {what}", "a document does not say it", self.original.where("actuator", number))

    def _range(self, kind: str, number: int) -> tuple[float, float] | None:
        """`ctrl` or `force`; None where there is none."""
        if not getattr(self.model, f"actuator_{kind}limited")[number]:
            return None
        low, high = floats(getattr(self.model, f"actuator_{kind}range")[number])
        return low, high

    def _drive(self, number: int, joint: int) -> SourceDrive | None:
        """A drive as it is at the joint; None of a kind that the language has not."""
        model = self.model
        gain, *gains = floats(model.actuator_gainprm[number])
        constant, position, velocity, *others = floats(model.actuator_biasprm[number])
        affine, dynamic = int(model.actuator_biastype[number]) == AFFINE, int(model.actuator_dyntype[number])
        if int(model.actuator_gaintype[number]) != FIXED_GAIN or any(gains) or gain == 0.0:
            return None
        gear = floats(model.actuator_gear[number])[0]
        if gear == 0.0:
            return None
        control, force = self._range("ctrl", number), self._range("force", number)
        if not affine and int(model.actuator_biastype[number]) == NO_BIAS and dynamic == NOT_DYNAMIC:
            return self._motor(number, gain, gear, control, force)
        kv = -velocity
        if not affine or constant or any(others) or kv < 0.0 or gain < 0.0:
            return None
        effort = _bound(self.model, joint, None if force is None else (force[0] * abs(gear), force[1] * abs(gear)))
        wanted = [("gear", numbers([gear])), ("kv", numbers([kv])), *_said("ctrl", control), *_said("force", force)]
        otherwise = {"gear": "1", "kv": numbers([kv * gear * gear]), **_written("force", None if effort is None else (-effort, effort))}
        where, name = self.original.where("actuator", number), self.original.actuators[number]
        if position == -gain and dynamic in (NOT_DYNAMIC, EXACT):
            wanted.append(("kp", numbers([gain])))
            if dynamic == EXACT:
                wanted.append(("timeconst", numbers([model.actuator_dynprm[number][0]])))
            ends = floats(model.jnt_range[joint]) if model.jnt_limited[joint] else None
            otherwise |= {"kp": numbers([gain * gear * gear]), **_written("ctrl", None if ends is None else (ends[0], ends[1]))}
            return SourceDrive(
                name=name, kind="position", where=where, kp=gain * gear * gear, kv=kv * gear * gear or None, effort=effort,
                raw=differing(wanted, otherwise),
            )
        if position == 0.0 and kv == gain and dynamic == NOT_DYNAMIC:
            fastest = None if control is None else max(map(abs, control)) / abs(gear)
            otherwise |= _written("ctrl", None if fastest is None else (-fastest, fastest))
            return SourceDrive(
                name=name, kind="velocity", where=where, kv=kv * gear * gear, effort=effort, velocity=fastest,
                raw=differing(wanted, otherwise),
            )
        return None

    def _motor(
        self, number: int, gain: float, gear: float, control: tuple[float, float] | None, force: tuple[float, float] | None,
    ) -> SourceDrive:
        """One whose gain, which a motor has not, is in its gear; what it is controlled by stays as it is."""
        original, ends = self.original, force
        if gain != 1.0:
            ends = None if force is None else (force[0] / gain, force[1] / gain)
            original.lose(
                f"the gain of motor `{original.actuators[number]}`, {gain:g}", "it is in its gear: the same torque for the same control",
                original.where("actuator", number),
            )
        bounds = [max(map(abs, one)) for one in (control, ends) if one is not None]
        effort = None if not bounds else min(bounds) * abs(gear * gain)
        joint = int(self.model.actuator_trnid[number][0])
        effort = _bound(self.model, joint, None if effort is None else (-effort, effort))
        wanted = [("gear", numbers([gear * gain])), *_said("ctrl", control), *_said("force", ends)]
        otherwise = {"gear": "1", "forcelimited": "false", **_written("ctrl", None if effort is None else (-effort, effort))}
        return SourceDrive(
            name=original.actuators[number], kind="motor", where=original.where("actuator", number), effort=effort,
            raw=differing(wanted, otherwise),
        )

    def _adhesion(self, number: int, link: str) -> SourceAdhesion:
        gain, control = floats(self.model.actuator_gainprm[number])[0], self._range("ctrl", number) or (0.0, 1.0)
        force = gain * control[1]
        why = "contacts of what adheres are harder in a document, so that they hold"
        self.original.lose(f"how soft contacts of `{link}` are", why, self.original.where("actuator", number))
        wanted = [("gain", numbers([gain])), ("ctrlrange", numbers(control))]
        return SourceAdhesion(
            name=self.original.actuators[number], link=link, force=force, where=self.original.where("actuator", number),
            raw=differing(wanted, {"gain": "1", "ctrlrange": numbers([0.0, force])}),
        )


def _bound(model: Any, joint: int, force: tuple[float, float] | None) -> float | None:
    """The largest effort [N m or N] of a drive at its joint, from its own range, else from that of all that acts on the joint."""
    if force is None and model.jnt_actfrclimited[joint]:
        return max(map(abs, floats(model.jnt_actfrcrange[joint])))
    return None if force is None else max(map(abs, force))


def _said(kind: str, bounds: tuple[float, float] | None) -> Raw:
    """Of `ctrl` or `force`, the attributes that say its range, or that it has none."""
    return ((f"{kind}limited", "false"),) if bounds is None else ((f"{kind}range", numbers(bounds)),)


def _written(kind: str, bounds: tuple[float, float] | None) -> dict[str, str]:
    return {f"{kind}limited": "false"} if bounds is None else {f"{kind}range": numbers(bounds)}
