"""Write the sections `poses`, `modes`, `simulation`, `sensors` and `tendons` of the document of an imported robot, and the keys of drives.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from thingc.base.joints.twist import SLIDE, TURN
from thingc.base.pose import MATE, NO_POSE, Pose
from thingc.base.sensor_kinds import SENSORS
from thingc.base.units import ANGLE, LENGTH, Dimension
from thingc.tools.importing.document_names import DocumentNaming, UsedNames
from thingc.tools.importing.quantities import TURNS, angle, flow, length, pose_words, quantity, quaternion_words, shape_words, si_unit, was
from thingc.tools.importing.source_model import SOURCE_MODE, SourceDrive, SourceMotion, SourcePose, SourceSensor, SourceStep, SourceTendon


def _start(naming: DocumentNaming) -> tuple[dict[str, str], str | None]:
    """Return the start values of the joints that do not start at q = 0.

    Also return the first pose of the source that can replace these start values, or None. Such a pose satisfies the limits of each joint
    whose start value in the source violates the limits.
    """
    moving = [joint for joint in naming.moving if joint.follows is None]
    outside = {
        joint: (joint.ends.lower, joint.ends.upper) for joint in moving
        if joint.ends.lower is not None and joint.ends.upper is not None and not joint.ends.lower <= joint.start <= joint.ends.upper
    }

    def fits(state: SourcePose) -> bool:
        values = ((state.q.get(joint.name, 0.0), *ends) for joint, ends in outside.items())
        return all(isinstance(value, float) and lower <= value <= upper for value, lower, upper in values)

    begins = {joint: joint.start for joint in moving if joint.start}
    begins |= {joint: round((lower + upper) / 2.0, 6) if joint.begin is None else joint.begin for joint, (lower, upper) in outside.items()}
    apart = any(joint.follows.at(0.0) for joint in naming.moving if joint.follows is not None)  # these joints do not start at q = 0
    usable_poses = (naming.poses[state.name] for state in naming.robot.poses if (begins or apart) and fits(state))
    starts = {naming.joints[one.name]: (angle if one.kind in TURNS else length)(value) for one, value in begins.items()}
    return starts, next(usable_poses, None)


def mode_sections(naming: DocumentNaming, roots: Sequence[str]) -> dict[str, Iterable[str]]:
    """Return the lines of the sections `poses` and `modes`. The modes are `source` and one mode for each link in `roots`.

    The section `simulation` follows the modes.
    """
    start, pose_of_source = _start(naming)
    start_pose = pose_of_source or UsedNames(naming.poses.values()).take("start", "pose")
    names = naming.poses
    poses = [f"  {names[one.name]}: {flow(_state(naming, one))}{was(names[one.name], one.name)}" for one in naming.robot.poses]
    naming.places |= {("poses", naming.poses[one.name]): one.where for one in naming.robot.poses}
    if start and pose_of_source is None:
        poses.append(f"  {start_pose}: {flow(start)}  # from the source")
    return {"poses": poses, "modes": _modes(naming, roots, f", pose: {start_pose}" if start or pose_of_source else "")}


def _modes(naming: DocumentNaming, roots: Sequence[str], begin: str) -> Iterator[str]:
    """Yield the lines of the modes. `begin` is the text of the key `pose` that all modes have, or an empty string."""
    at, shared = pose_words(naming.robot.pose), _common_values(naming)
    place, more = (f", at: {{{at}}}" if at else ""), "".join(f", {key}: {value}" for key, value in shared.items())
    moved = {naming.poses[state.name]: pose_words(state.at) or "xyz: 0 0 0" for state in naming.robot.poses if state.at is not None}
    place += f", at_in: {{{', '.join(f'{name}: {{{pose}}}' for name, pose in moved.items())}}}" if moved else ""
    yield f"  {SOURCE_MODE}: {{root: {naming.links[naming.robot.root]}, base: {naming.robot.base}{place}{begin}{more}}}"
    # in a new mode, another link is the root, so the robot could be below the floor; `on: floor` computes the height from collision shapes
    floor = any(shape.use == "collision" for link in naming.robot.links for shape in link.shapes)
    used_names = UsedNames([SOURCE_MODE])
    for name in roots:
        mode = used_names.take(name, "link")
        # a component is placed by its frame, but a mount is mated with the world, so its z axis is opposite
        root_pose = NO_POSE if name in naming.links else MATE
        pose_text = pose_words(root_pose)
        if shared:  # override the pose of the extended mode
            if "quat:" in at:
                pose_text = f"quat: {quaternion_words(root_pose)}"
            elif "rpy:" in at and not pose_text:
                pose_text = "rpy: 0 0 0"
            pose_text = ", ".join([*(["xyz: 0 0 0"] if "xyz:" in at else []), *([pose_text] if pose_text else [])])
        elif floor:
            pose_text = f"on: floor, {pose_text}" if pose_text else "on: floor"
        where = f", at: {{{pose_text}}}" if pose_text else ""
        extends = f"extends: source, {'at_in: {}, ' if moved else ''}" if shared else ""
        yield f"  {mode}: {{{extends}root: {(naming.links | naming.frames)[name]}, base: held{where}{'' if shared else begin}}}"
    if naming.robot.simulation:
        yield ""
        entries = {key: quantity(value, "s" if key == "timestep" else "") if isinstance(value, float) else value
                for key, value in naming.robot.simulation}
        yield f"simulation: {flow(entries)}"


def _state(naming: DocumentNaming, state: SourcePose) -> dict[str, str]:
    """Format the joint coordinates of a pose.

    If the robot has no closed loops, zeros are omitted. In a closed loop, the value of an unspecified joint is computed and can differ from
    0.
    """
    entries: dict[str, str] = {}
    for name, value in state.q.items():
        if isinstance(value, Pose):
            if moved := pose_words(value):
                entries[naming.joints[name]] = f"{{{moved}}}"
        elif isinstance(value, tuple):
            if naming.loops or value != (1.0, 0.0, 0.0, 0.0):
                entries[naming.joints[name]] = f"{{quat: [{', '.join(quantity(one, '') for one in value)}]}}"
        elif value or naming.loops:
            entries[naming.joints[name]] = (angle if name in naming.turning else length)(value)
    return entries


def _common_values(naming: DocumentNaming) -> dict[str, str]:
    """Return the keys and values that all modes have in common. Default values are omitted."""
    robot, contacts = naming.robot, []
    if robot.excluded:
        pairs = ", ".join(f"[{naming.links[one]}, {naming.links[other]}]" for one, other in robot.excluded)
        contacts.append(f"exclude: [{pairs}]")
    if robot.adhesions:
        pulls = (f"{naming.links[one.link]}.{naming.magnets[one.name]}: {quantity(one.force, 'N')}" for one in robot.adhesions)
        contacts.append(f"adhesion: {{{', '.join(pulls)}}}")
    entries = {} if robot.gravity is None else {"gravity": f"[{', '.join(quantity(one, 'm/s^2') for one in robot.gravity)}]"}
    entries |= {"cut": f"[{', '.join(naming.loops.values())}]"} if naming.loops else {}
    return entries | ({"contacts": f"{{{', '.join(contacts)}}}"} if contacts else {})


def sensor_lines(naming: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `sensors`."""
    winding, frames = {tendon.name for tendon in naming.robot.tendons if tendon.turns}, naming.frames | naming.sites
    for sensor, name in zip(naming.robot.sensors, naming.sensors, strict=True):
        entries: dict[str, str] = {"type": sensor.kind}
        if sensor.joint is not None and (sensor.kind != "joint" or naming.joints[sensor.joint] != name):
            entries["joint"] = naming.joints[sensor.joint]
        if sensor.tendon is not None:
            entries["tendon"] = naming.tendons[sensor.tendon]
        if sensor.kind == "camera":
            entries |= {"at": f"{naming.links[sensor.link or '']}.{naming.cameras[sensor.name]}", "fovy": angle(sensor.fovy)}
        entries |= {key: frames[site] for key, site in (("at", sensor.site), ("in", sensor.seen_from)) if site is not None}
        if sensor.volume is not None:
            entries["volume"] = f"{{{shape_words(*sensor.volume)}}}"
        turns = sensor.joint in naming.turning or sensor.tendon in winding
        if sensor.kind == "rangefinder" and sensor.cutoff:
            entries["range"] = length(sensor.cutoff["distance"])
        entries |= {
            key: _readings(sensor, numbers, turns) for key, numbers in (("noise", sensor.noise), ("cutoff", sensor.cutoff))
            if numbers and "range" not in entries
        }
        naming.places["sensors", name] = sensor.where
        yield f"  {name}: {flow(entries)}"


def _readings(sensor: SourceSensor, numbers: Mapping[str, float], turns: bool) -> str:
    """Format the noise levels or cutoffs of a sensor.

    The text is one value, or a mapping from readings to values for a sensor with several readings.
    """
    readings = SENSORS[sensor.kind].readings
    units: dict[str, Dimension | str] = {reading.name: reading.unit for reading in readings if reading.unit is not None}
    entries = {}
    for name, value in numbers.items():
        unit = units[name]
        if isinstance(unit, str):
            unit = (TURN if turns else SLIDE)[unit]
        entries[name] = length(value) if unit == LENGTH else angle(value) if unit == ANGLE else quantity(value, si_unit(unit))
    return next(iter(entries.values())) if len(units) == 1 else flow(entries)


def dynamics_words(of: SourceMotion, turns: bool) -> dict[str, str]:
    """Return the keys and values of the mapping `dynamics` of a joint or tendon. Values that are zero are omitted.

    `turns` specifies whether the joint coordinate, or the length of the tendon, is an angle. For a tendon that has stiffness and runs along
    a path, the result always contains `rest`.
    """
    units, keys = TURN if turns else SLIDE, ("damping", "friction", "armature", "stiffness")
    entries = {key: quantity(value, si_unit(units[key])) for key in keys if (value := getattr(of, key))}
    rests = of.rest or isinstance(of, SourceTendon) and of.steps and of.stiffness
    return entries | ({"rest": (angle if turns else length)(of.rest)} if rests else {})


def drive_words(drive: SourceDrive, turns: bool) -> dict[str, str]:
    """Return the keys and values of the mapping `drive` of a joint or tendon: kind, gains and limits."""
    units = dict(TURN if turns else SLIDE)
    command = units[{"position": "lower", "velocity": "velocity", "motor": "effort"}[drive.kind]]
    units |= {"deadband": command, "noise": command}
    keys = ("kp", "kv", "effort", "velocity", "stall", "delay", "deadband", "noise")
    entries = {key: quantity(value, si_unit(units[key])) for key in keys if (value := getattr(drive, key)) is not None}
    return {"kind": drive.kind, **entries}


def tendon_lines(naming: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `tendons`."""
    for tendon in naming.robot.tendons:
        yield naming.entry("tendons", naming.tendons[tendon.name], tendon)
        if tendon.moves:
            factors = {naming.joints[name]: _factor(tendon, name in naming.turning, value) for name, value in tendon.moves}
            yield f"    joints: {flow(factors)}"
        else:
            yield f"    path: [{', '.join(_step(naming, step) for step in tendon.steps)}]"
        if tendon.width:
            yield f"    width: {length(tendon.width)}"
        values = {"dynamics": dynamics_words(tendon, tendon.turns)}
        if tendon.ends.lower is not None and tendon.ends.upper is not None:
            place = angle if tendon.turns else length
            values["limit"] = {"lower": place(tendon.ends.lower), "upper": place(tendon.ends.upper)}
        if tendon.drive is not None:
            values["drive"] = drive_words(tendon.drive, tendon.turns)
            naming.places["tendons", naming.tendons[tendon.name], "drive"] = tendon.drive.where
        for key in ("limit", "dynamics", "drive"):
            if values.get(key):
                yield f"    {key}: {flow(values[key])}"


def transmission_lines(naming: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `transmissions`. The limits of the joints specify the efforts at the joints."""
    for transmission in naming.robot.transmissions:
        word, joints = naming.transmissions[transmission.name], [naming.joints[name] for name in transmission.joints]
        rows = [f"[{', '.join(quantity(value, '') for value in row)}]" for row in transmission.matrix]
        yield naming.entry("transmissions", word, transmission)
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


def _step(naming: DocumentNaming, step: SourceStep) -> str:
    if step.around is not None:
        side = "" if step.around.side is None else f", side: {naming.sites[step.around.side]}"
        centre = f"{naming.links[step.around.link]}.{naming.centres[step.around.name]}"
        return f"{{around: {centre}, {step.around.kind}: {length(step.around.radius)}{side}}}"
    return f"{{pulley: {quantity(step.divisor, '')}}}" if step.divisor is not None else naming.sites[step.site or ""]
