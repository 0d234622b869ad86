"""Write the sections `poses`, `modes`, `simulation`, `sensors` and `tendons` of the document of an imported robot, and the keys of drives.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from thingc.base.joints.twist import SLIDE, TURN
from thingc.base.pose import MATE, NO_POSE, Pose
from thingc.base.sensor_kinds import SENSORS
from thingc.base.units import ANGLE, LENGTH, Dimension
from thingc.tools.importing.document_names import DocumentNaming, distinct
from thingc.tools.importing.quantities import TURNS, angle, flow, length, pose_words, quantity, quaternion_words, shape_words, si_unit, was
from thingc.tools.importing.source_model import SOURCE_MODE, SourceDrive, SourceMotion, SourcePose, SourceSensor, SourceStep, SourceTendon


def _start(words: DocumentNaming) -> tuple[dict[str, str], str | None]:
    """Return the start values of the joints that do not start at q = 0.

    Also return the first pose of the source that can replace these start values, or None. Such a pose satisfies the limits of each joint
    whose start value in the source violates the limits.
    """
    moving = [joint for joint in words.moving if joint.follows is None]
    outside = {
        joint: (joint.ends.lower, joint.ends.upper) for joint in moving
        if joint.ends.lower is not None and joint.ends.upper is not None and not joint.ends.lower <= joint.start <= joint.ends.upper
    }

    def fits(state: SourcePose) -> bool:
        values = ((state.q.get(joint.name, 0.0), *ends) for joint, ends in outside.items())
        return all(isinstance(value, float) and lower <= value <= upper for value, lower, upper in values)

    begins = {joint: joint.start for joint in moving if joint.start}
    begins |= {joint: round((lower + upper) / 2.0, 6) if joint.begin is None else joint.begin for joint, (lower, upper) in outside.items()}
    stated = (words.poses[state.name] for state in words.robot.poses if begins and fits(state))
    return {words.joints[one.name]: (angle if one.kind in TURNS else length)(value) for one, value in begins.items()}, next(stated, None)


def mode_sections(words: DocumentNaming, roots: Sequence[str]) -> dict[str, Iterable[str]]:
    """Return the lines of the sections `poses` and `modes`. The modes are `source` and one mode for each link in `roots`.

    The section `simulation` follows the modes.
    """
    start, stated = _start(words)
    word = stated or distinct(["start"], "pose", taken=words.poses.values())["start"]
    poses = [f"  {words.poses[one.name]}: {flow(_state(words, one))}{was(words.poses[one.name], one.name)}" for one in words.robot.poses]
    words.places |= {("poses", words.poses[one.name]): one.where for one in words.robot.poses}
    if start and stated is None:
        poses.append(f"  {word}: {flow(start)}  # from the source")
    return {"poses": poses, "modes": _modes(words, roots, f", pose: {word}" if start else "")}


def _modes(words: DocumentNaming, roots: Sequence[str], begin: str) -> Iterator[str]:
    """Yield the lines of the modes. `begin` contains the key of the pose in which they begin, if any."""
    at, shared = pose_words(words.robot.pose), _common_values(words)
    place, more = (f", at: {{{at}}}" if at else ""), "".join(f", {key}: {value}" for key, value in shared.items())
    moved = {words.poses[state.name]: pose_words(state.at) or "xyz: 0 0 0" for state in words.robot.poses if state.at is not None}
    place += f", at_in: {{{', '.join(f'{name}: {{{said}}}' for name, said in moved.items())}}}" if moved else ""
    yield f"  {SOURCE_MODE}: {{root: {words.links[words.robot.root]}, base: {words.robot.base}{place}{begin}{more}}}"
    # in a new mode, another link is the root, so the robot could be below the floor; `on: floor` computes the height from collision shapes
    floor = any(shape.use == "collision" for link in words.robot.links for shape in link.shapes)
    taken = [SOURCE_MODE]
    for name in roots:
        mode = distinct([name], "link", taken)[name]
        taken.append(mode)
        # a component is placed by its frame, but a mount is mated with the world, so its z axis is opposite
        stands = NO_POSE if name in words.links else MATE
        turned = pose_words(stands)
        if shared:  # override the pose of the extended mode
            if "quat:" in at:
                turned = f"quat: {quaternion_words(stands)}"
            elif "rpy:" in at and not turned:
                turned = "rpy: 0 0 0"
            turned = ", ".join([*(["xyz: 0 0 0"] if "xyz:" in at else []), *([turned] if turned else [])])
        elif floor:
            turned = f"on: floor, {turned}" if turned else "on: floor"
        where = f", at: {{{turned}}}" if turned else ""
        extends = f"extends: source, {'at_in: {}, ' if moved else ''}" if shared else ""
        yield f"  {mode}: {{{extends}root: {(words.links | words.frames)[name]}, base: held{where}{'' if shared else begin}}}"
    if words.robot.simulation:
        yield ""
        said = {key: quantity(value, "s" if key == "timestep" else "") if isinstance(value, float) else value
                for key, value in words.robot.simulation}
        yield f"simulation: {flow(said)}"


def _state(words: DocumentNaming, state: SourcePose) -> dict[str, str]:
    """Format the joint coordinates of a pose.

    If the robot has no closed loops, zeros are omitted. In a closed loop, the value of an unspecified joint is computed and can differ from
    0.
    """
    said: dict[str, str] = {}
    for name, value in state.q.items():
        if isinstance(value, Pose):
            if moved := pose_words(value):
                said[words.joints[name]] = f"{{{moved}}}"
        elif isinstance(value, tuple):
            if words.loops or value != (1.0, 0.0, 0.0, 0.0):
                said[words.joints[name]] = f"{{quat: [{', '.join(quantity(one, '') for one in value)}]}}"
        elif value or words.loops:
            said[words.joints[name]] = (angle if name in words.turning else length)(value)
    return said


def _common_values(words: DocumentNaming) -> dict[str, str]:
    """Return the keys and values that all modes have in common. Default values are omitted."""
    robot, contacts = words.robot, []
    if robot.excluded:
        pairs = ", ".join(f"[{words.links[one]}, {words.links[other]}]" for one, other in robot.excluded)
        contacts.append(f"exclude: [{pairs}]")
    if robot.adhesions:
        pulls = (f"{words.links[one.link]}.{words.magnets[one.name]}: {quantity(one.force, 'N')}" for one in robot.adhesions)
        contacts.append(f"adhesion: {{{', '.join(pulls)}}}")
    said = {} if robot.gravity is None else {"gravity": f"[{', '.join(quantity(one, 'm/s^2') for one in robot.gravity)}]"}
    said |= {"cut": f"[{', '.join(words.loops.values())}]"} if words.loops else {}
    return said | ({"contacts": f"{{{', '.join(contacts)}}}"} if contacts else {})


def sensor_lines(words: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `sensors`."""
    winding = {tendon.name for tendon in words.robot.tendons if tendon.turns}
    for one, word in zip(words.robot.sensors, words.sensors, strict=True):
        said: dict[str, str] = {"type": one.kind}
        if one.joint is not None and (one.kind != "joint" or words.joints[one.joint] != word):
            said["joint"] = words.joints[one.joint]
        if one.tendon is not None:
            said["tendon"] = words.tendons[one.tendon]
        if one.kind == "camera":
            said |= {"at": f"{words.links[one.link or '']}.{words.cameras[one.name]}", "fovy": angle(one.fovy)}
        frames = words.frames | words.sites
        said |= {key: frames[site] for key, site in (("at", one.site), ("in", one.seen_from)) if site is not None}
        if one.volume is not None:
            said["volume"] = f"{{{shape_words(*one.volume)}}}"
        turns = one.joint in words.turning or one.tendon in winding
        if one.kind == "rangefinder" and one.cutoff:
            said["range"] = length(one.cutoff["distance"])
        said |= {
            key: _readings(one, numbers, turns) for key, numbers in (("noise", one.noise), ("cutoff", one.cutoff))
            if numbers and "range" not in said
        }
        words.places["sensors", word] = one.where
        yield f"  {word}: {flow(said)}"


def _readings(one: SourceSensor, numbers: Mapping[str, float], turns: bool) -> str:
    """Format the noise levels or cutoffs of a sensor.

    The text is one value, or a mapping from readings to values for a sensor with several readings.
    """
    units: dict[str, Dimension | str] = {reading.name: reading.unit for reading in SENSORS[one.kind].readings if reading.unit is not None}
    said = {}
    for name, value in numbers.items():
        unit = units[name]
        if isinstance(unit, str):
            unit = (TURN if turns else SLIDE)[unit]
        said[name] = length(value) if unit == LENGTH else angle(value) if unit == ANGLE else quantity(value, si_unit(unit))
    return next(iter(said.values())) if len(units) == 1 else flow(said)


def dynamics_words(of: SourceMotion, turns: bool) -> dict[str, str]:
    """Return the keys and values of the mapping `dynamics` of a joint or tendon. Values that are zero are omitted.

    `turns` specifies whether the joint coordinate, or the length of the tendon, is an angle. For a tendon that has stiffness and runs along
    a path, the result always contains `rest`.
    """
    units, keys = TURN if turns else SLIDE, ("damping", "friction", "armature", "stiffness")
    said = {key: quantity(value, si_unit(units[key])) for key in keys if (value := getattr(of, key))}
    rests = of.rest or isinstance(of, SourceTendon) and of.steps and of.stiffness
    return said | ({"rest": (angle if turns else length)(of.rest)} if rests else {})


def drive_words(drive: SourceDrive, turns: bool) -> dict[str, str]:
    """Return the keys and values of the mapping `drive` of a joint or tendon: kind, gains and limits."""
    units = dict(TURN if turns else SLIDE)
    command = units[{"position": "lower", "velocity": "velocity", "motor": "effort"}[drive.kind]]
    units |= {"deadband": command, "noise": command}
    keys = ("kp", "kv", "effort", "velocity", "stall", "delay", "deadband", "noise")
    said = {key: quantity(value, si_unit(units[key])) for key in keys if (value := getattr(drive, key)) is not None}
    return {"kind": drive.kind, **said}


def tendon_lines(words: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `tendons`."""
    for one in words.robot.tendons:
        yield words.entry("tendons", words.tendons[one.name], one)
        if one.moves:
            factors = {words.joints[name]: _factor(one, name in words.turning, value) for name, value in one.moves}
            yield f"    joints: {flow(factors)}"
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
            words.places["tendons", words.tendons[one.name], "drive"] = one.drive.where
        for key in ("limit", "dynamics", "drive"):
            if values.get(key):
                yield f"    {key}: {flow(values[key])}"


def transmission_lines(words: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `transmissions`. The limits of the joints specify the efforts at the joints."""
    for one in words.robot.transmissions:
        word, joints = words.transmissions[one.name], [words.joints[name] for name in one.joints]
        rows = [f"[{', '.join(quantity(value, '') for value in row)}]" for row in one.matrix]
        yield words.entry("transmissions", word, one)
        if len(rows) == 1:
            yield from ("    actuator: {kind: motor}", f"    joint: {joints[0]}", f"    ratio: {rows[0][1:-1]}")
            continue
        yield "    differential:"
        yield f"      actuators: [{', '.join('{kind: motor}' for _ in rows)}]"
        yield from (f"      joints: [{', '.join(joints)}]", f"      matrix: [{', '.join(rows)}]")


def _factor(tendon: SourceTendon, turns: bool, value: float) -> str:
    """Format the factor by which a tendon multiplies a joint coordinate, with the unit.

    The text contains a unit of length, divided by the unit of the joint coordinate.
    """
    unit = "" if tendon.turns or not turns else "m/rad"
    return f"{quantity(value, '')} {unit}".rstrip()


def _step(words: DocumentNaming, step: SourceStep) -> str:
    if step.around is not None:
        side = "" if step.around.side is None else f", side: {words.sites[step.around.side]}"
        centre = f"{words.links[step.around.link]}.{words.centres[step.around.name]}"
        return f"{{around: {centre}, {step.around.kind}: {length(step.around.radius)}{side}}}"
    return f"{{pulley: {quantity(step.divisor, '')}}}" if step.divisor is not None else words.sites[step.site or ""]
