"""Convert the actuators of a MuJoCo model to drives of joints, drives of tendons, and adhesions of bodies."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from thingc.base.pose import Pose
from thingc.targets.mjcf.drives import delay_steps
from thingc.tools.importing.mjcf.adding import Added
from thingc.tools.importing.mjcf.compiled_source import CompiledSource, differing, floats, numbers
from thingc.tools.importing.mjcf.tendons import Tendons
from thingc.tools.importing.source_model import SourceAdhesion, SourceDrive, SourceTarget

AT_JOINT, AT_PARENT, AT_TENDON, AT_BODY = 0, 1, 3, 5
FIXED_GAIN, NO_BIAS, AFFINE = 0, 0, 1
NOT_DYNAMIC, EXACT = 0, 3
HINGE, SLIDE = 3, 2
UNSAID = ("actlimited", "actearly", "armature")
"""Attributes of actuators that documents cannot express. The default value of these attributes is 0."""


Bounds = tuple[float, float] | None
"""The lower and the upper bound of a value. None means unlimited."""


class Actuators:
    """Converts the actuators of a MuJoCo model to drives and adhesions.

    `of_joint` and `of_tendon` map the index of a joint or tendon to its drive. `driven` maps the index of an actuator to the target of its
    drive. Other actuators become `adhesions`, are `added` to the MuJoCo model unchanged, or are recorded as losses. `kept` contains the
    indices of all other actuators. `joints` and `tendons` are the imported joints and tendons. `on` maps each imported body to a link and
    the pose of the body in this link.
    """

    def __init__(
        self, original: CompiledSource, joints: set[int], tendons: Tendons, on: Mapping[int, tuple[int, Pose]], added: Added,
    ) -> None:
        self.original, self.model = original, original.model
        self.of_joint: dict[int, SourceDrive] = {}
        self.of_tendon: dict[int, SourceDrive] = {}
        self.driven: dict[int, SourceTarget] = {}
        self.kept: set[int] = set()
        added.kept["actuator"] = self.kept
        adhesions = []
        for number in range(self.model.nu):
            transmission, target = int(self.model.actuator_trntype[number]), int(self.model.actuator_trnid[number][0])
            what, why = f"actuator `{original.actuators[number]}`", ""
            if transmission == AT_BODY and target in on:
                adhesions.append(self._adhesion(number, original.bodies[on[target][0]]))
            elif transmission == AT_TENDON:
                one = tendons.of.get(target)
                if one is None:
                    why = "the tendon of the actuator is not imported"
                else:
                    lower, upper = one.ends.lower, one.ends.upper
                    ends = None if lower is None or upper is None else (lower, upper)
                    most = original.bounds("tendon_actfrc", target)
                    why = self._driving(number, SourceTarget(kind="tendon", name=one.name), target, self.of_tendon, ends, most)
            elif transmission not in (AT_JOINT, AT_PARENT) or int(self.model.jnt_type[target]) not in (HINGE, SLIDE):
                why = "documents only support drives of tendons, hinges and slides"
            elif target not in joints:
                why = "the joint of the actuator is not imported"
            else:
                ends, most = original.bounds("jnt_", target), original.bounds("jnt_actfrc", target)
                why = self._driving(number, SourceTarget(kind="joint", name=original.joints[target]), target, self.of_joint, ends, most)
            if why and not added.actuator(number):
                original.lose("actuator", number, what, why)
            else:
                self.kept.add(number)
                self._unsaid(number, what)
        self.adhesions = tuple(adhesions)

    def _driving(self, number: int, what: SourceTarget, target: int, drives: dict[int, SourceDrive], ends: Bounds, most: Bounds) -> str:
        """Convert an actuator to a drive, and add the drive to `drives` under the index of the driven joint or tendon.

        `ends` limits the coordinate or length [rad or m], and `most` the total actuator force [N m or N].
        Return the reason why a document cannot express the actuator, or an empty string if the drive was added.
        """
        if target in drives:
            return f"`{what.name}` already has the drive `{drives[target].name}`"
        drive = self._drive(number, ends, most)
        if drive is None:
            return "documents only support motors, position drives and velocity drives"
        drives[target] = self._with_effects(number, drive)
        self.driven[number] = what
        return ""

    def _with_effects(self, number: int, drive: SourceDrive) -> SourceDrive:
        """Add the delay of an actuator to its drive, and the values that thingc writes as custom data."""
        (count, interpolation), delay = self.model.actuator_history[number], float(self.model.actuator_delay[number])
        steps = delay_steps(delay, float(self.model.opt.timestep)) if delay else 0
        raw = differing([("nsample", str(count)), ("interp", str(interpolation))], {"nsample": str(steps), "interp": "0"})
        own = self.original.custom.get(drive.name, {})
        stall, speed = own.get("stall", (None, drive.velocity))
        return replace(
            drive, delay=delay or None, stall=stall, velocity=speed, deadband=own.get("deadband", (None,))[0],
            noise=own.get("noise", (None,))[0], raw=(*drive.raw, *raw),
        )

    def _unsaid(self, number: int, what: str) -> None:
        for name in UNSAID:
            values = getattr(self.model, f"actuator_{name}", None)
            if values is not None and float(values[number]):
                self.original.lose("actuator", number, f"`{name}` of {what}", "documents do not support the property")

    def _drive(self, number: int, ends: Bounds, most: Bounds) -> SourceDrive | None:
        """Convert an actuator to a drive. Return None for a kind of actuator that documents do not support."""
        model = self.model
        gain, *gains = floats(model.actuator_gainprm[number])
        constant, position, velocity, *others = floats(model.actuator_biasprm[number])
        affine, dynamic = int(model.actuator_biastype[number]) == AFFINE, int(model.actuator_dyntype[number])
        if int(model.actuator_gaintype[number]) != FIXED_GAIN or any(gains) or gain == 0.0 or model.actuator_plugin[number] >= 0:
            return None
        gear = floats(model.actuator_gear[number])[0]
        if gear == 0.0:
            return None
        control, force = self.original.bounds("actuator_ctrl", number), self.original.bounds("actuator_force", number)
        if not affine and int(model.actuator_biastype[number]) == NO_BIAS and dynamic == NOT_DYNAMIC:
            return self._motor(number, gain, gear, control, force, most)
        kv = -velocity
        if not affine or constant or any(others) or kv < 0.0 or gain < 0.0:
            return None
        effort = _largest(most if force is None else (force[0] * abs(gear), force[1] * abs(gear)))
        values = [("gear", numbers(gear)), ("kv", numbers(kv)), *_range_keys("ctrl", control).items(), *_range_keys("force", force).items()]
        otherwise = {"gear": "1", "kv": numbers(kv * gear * gear), **_range_keys("force", None if effort is None else (-effort, effort))}
        name, where = self.original.actuators[number], self.original.where("actuator", number)
        drive = SourceDrive(name=name, kind="position", where=where, kv=kv * gear * gear, effort=effort)
        if position == -gain and dynamic in (NOT_DYNAMIC, EXACT):
            values.append(("kp", numbers(gain)))
            if dynamic == EXACT:
                values.append(("timeconst", numbers(model.actuator_dynprm[number][0])))
            otherwise |= {"kp": numbers(gain * gear * gear), **_range_keys("ctrl", ends)}
            return replace(drive, kp=gain * gear * gear, kv=drive.kv or None, raw=differing(values, otherwise))
        if position == 0.0 and kv == gain and dynamic == NOT_DYNAMIC:
            fastest = None if control is None else max(map(abs, control)) / abs(gear)
            otherwise |= _range_keys("ctrl", None if fastest is None else (-fastest, fastest))
            return replace(drive, kind="velocity", velocity=fastest, raw=differing(values, otherwise))
        return None

    def _motor(self, number: int, gain: float, gear: float, control: Bounds, force: Bounds, most: Bounds) -> SourceDrive:
        """Convert an actuator to a motor. The gear ratio is multiplied by the gain, because motors in a document do not have a gain.

        The control range does not change.
        """
        original, ends = self.original, force
        if gain != 1.0:
            ends = None if force is None else (force[0] / gain, force[1] / gain)
            what = f"the gain of motor `{original.actuators[number]}`, {gain:g}"
            why = "the gear ratio is multiplied by the gain"
            original.lose("actuator", number, what, why)
        bounds = [max(map(abs, one)) for one in (control, ends) if one is not None]
        effort = None if not bounds else min(bounds) * abs(gear * gain)
        effort = _largest(most) if effort is None else effort
        attributes = [("gear", numbers(gear * gain)), *_range_keys("ctrl", control).items(), *_range_keys("force", ends).items()]
        otherwise = {"gear": "1", "forcelimited": "false", **_range_keys("ctrl", None if effort is None else (-effort, effort))}
        return SourceDrive(
            name=original.actuators[number], kind="motor", where=original.where("actuator", number), effort=effort,
            raw=differing(attributes, otherwise),
        )

    def _adhesion(self, number: int, link: str) -> SourceAdhesion:
        gain, control = floats(self.model.actuator_gainprm[number])[0], self.original.bounds("actuator_ctrl", number) or (0.0, 1.0)
        force = gain * control[1]
        why = "thingc writes stiffer contacts for adhesion"
        self.original.lose("actuator", number, f"the softness of contacts of `{link}`", why)
        attributes = [("gain", numbers(gain)), ("ctrlrange", numbers(control))]
        return SourceAdhesion(
            name=self.original.actuators[number], link=link, force=force, where=self.original.where("actuator", number),
            raw=differing(attributes, {"gain": "1", "ctrlrange": numbers([0.0, force])}),
        )


def _largest(bounds: Bounds) -> float | None:
    return None if bounds is None else max(map(abs, bounds))


def _range_keys(kind: str, bounds: Bounds) -> dict[str, str]:
    """Return the XML attributes that specify the control range (`ctrl`) or the force range (`force`) of an actuator."""
    return {f"{kind}limited": "false"} if bounds is None else {f"{kind}range": numbers(bounds)}
