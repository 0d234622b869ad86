"""Write `usd/<name>_<mode>.usda`, a UsdPhysics stage for each chosen mode. The stage contains the meshes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import UTC, datetime

from thingc.base import numeric
from thingc.base.generated_header import heading
from thingc.base.package_info import PackageInfo
from thingc.base.source import Origin
from thingc.model.assembly.kinematics import joints_of, leaders
from thingc.model.assembly.types import JointEdge
from thingc.model.robot.loop_solver import Loops, SolverState
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.artifact import Artifacts, Content, Loss
from thingc.targets.capabilities import losses
from thingc.targets.connections import connections
from thingc.targets.geometry import bounds, collect_geometry, placements
from thingc.targets.request import EmitRequest
from thingc.targets.usd import raw
from thingc.targets.usd.capabilities import CAPABILITIES
from thingc.targets.usd.chain import chain, followers
from thingc.targets.usd.stage import LEAST_MASS, identifiers, model, prototypes
from thingc.targets.usd.usda import FLOAT_MAX, INDENT, Prim, dictionary, format_prim, format_vector, quote, write
from thingc.targets.xml_writer import number

ROBOT = "Q11012"
"""The item of robots in Wikidata."""


def emit(request: EmitRequest) -> Artifacts:
    """Write a USD file for each chosen mode. Each file contains all meshes.

    The USD text of the meshes is generated only once.
    """
    assembly = request.assembly
    geometry, flat = collect_geometry(assembly, "usd", "usd", request.report)
    scope = f"{assembly.name}_meshes"
    names = identifiers({asset.name: asset.name for asset in geometry.meshes})
    meshes = format_prim(prototypes(geometry, request.store, scope, names)) if names else ""
    files: dict[str, Content] = {}
    all_losses = dict.fromkeys((*flat, *losses("usd", CAPABILITIES, assembly, request.robots, cut=True)))
    paths = {name: f"/{scope}/{prim_name}" for name, prim_name in names.items()}
    models = [model(robot, geometry.in_mode(robot.mode.name), paths, request.report) for robot in request.robots]
    raw.apply(assembly, models, request.report)
    for robot, prim in zip(request.robots, models, strict=True):
        comment, file = heading(assembly.definition.document, robot.mode.name), f"{assembly.name}_{robot.mode.name}.usda"
        prim.metadata += prim_metadata(assembly.name, file, request.workspace.about)
        header = layer_metadata(robot, prim, request.workspace.about)
        files[f"usd/{file}"] = write([format_prim(prim), meshes], assembly.name, comment, header).encode()
        all_losses |= dict.fromkeys(_losses_of_mode(robot))
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(all_losses))


def prim_metadata(name: str, file: str, about: PackageInfo) -> list[str]:
    """Return the metadata of the default prim of a file: its kind, its name and its version."""
    info = {"asset identifier": f"@./{file}@", "string name": quote(name), "string version": quote(about.version)}
    return ['kind = "component"', *dictionary("assetInfo", info)]


def layer_metadata(robot: Robot, default_prim: Prim, about: PackageInfo) -> list[str]:
    """Return the metadata of the file of a mode, with the fields that SimReady requires (`SR.004`), for libraries of assets."""
    assembly = robot.assembly
    low, high = bounds(*placements(robot)) or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    mass = numeric.sum_of(assembly.links[body.link].properties.mass for body in robot.bodies)
    entries = dictionary("dictionary SimReady_Metadata", {
        "float3 asset_extents": format_vector(b - a for a, b in zip(low, high, strict=True)), "string asset_license": quote(about.license),
        "string asset_name": quote(assembly.name), "string asset_type": quote("robot"), "string author": quote(about.maintainer),
        "string category": quote("robot"), "double mass": number(numeric.maximum(mass, LEAST_MASS)), "string qcode": quote(ROBOT),
        "int rigid_body_count": str(sum("PhysicsRigidBodyAPI" in prim.schemas for prim in default_prim.children)),
        "string source_file": quote(assembly.definition.document), "string usd_date_generated": quote(build_date()),
    })
    return ["customLayerData = {", *(f"{INDENT}{line}" for line in entries), "}"]


def build_date() -> str:
    """Return the date of the build in ISO 8601: `SOURCE_DATE_EPOCH` [s], or 1970-01-01 if this variable is not set to a valid number."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(epoch) if epoch.isdecimal() and len(epoch) < 12 else 0, UTC).date().isoformat()


def _losses_of_mode(robot: Robot) -> Iterator[Loss]:
    """Yield the export losses of one mode that do not follow from `CAPABILITIES`.

    If an export loss is common to all modes, its `mode` is None.
    """
    mode = robot.mode
    for connection in connections(robot, CAPABILITIES["loops"]):
        if (count := len(chain(connection))) > 1:
            what = f"the motion: written as {count} joints, with links of 1e-9 kg between the joints"
            yield Loss("usd", mode.name, connection.path, what, "approximated", connection.origin)
        for joint in connection.joints:
            if joint.limit.effort is not None and joint.actuator is None:
                unit = "N m" if joint.twist.turns else "N"
                what = f"the effort limit of {joint.limit.effort:.6g} {unit}: only drives have an effort limit"
                yield Loss("usd", None, joint.path, what, "omitted", joint.origin)
            yield from _of_floats(joint)
    for body in robot.bodies:
        link = robot.assembly.links[body.link]
        for what, value, unit in (
            ("mass", link.properties.mass, "kg"), ("inertia", numeric.maximum(map(numeric.maximum, link.properties.inertia)), "kg m^2"),
            ("centre of mass", numeric.maximum(map(abs, link.properties.centre)), "m"),
        ):
            yield from _infinite(link.name, what, value, unit, link.origin)
    joints, mimic_joints = joints_of(robot.assembly), followers(robot)
    for joint, (leader, _, _) in zip(joints, leaders(joints).values(), strict=True):
        if joint.mimic is not None and joint.path not in mimic_joints:
            what = f"the mimic of `{leader}`: a hinge cannot mimic a slide, nor a slide a hinge"
            yield Loss("usd", None, joint.path, what, "omitted", joint.mimic.origin)
    if not _is_closed(robot):
        what = "the start pose: the file has q = 0, where loops and holds are open"
        yield Loss("usd", mode.name, mode.name, what, "approximated", mode.origin)
    for occurrence in robot.assembly.occurrences:
        if occurrence.material is not None and occurrence.material.torsion is not None:
            what = "the torsional friction: only read by Newton"
            yield Loss("usd", None, occurrence.material.name, what, "carried as custom data", occurrence.material.origin)


def _of_floats(joint: TreeJoint | JointEdge) -> Iterator[Loss]:
    """Yield an export loss for each number of a joint that is too large for a float in USD."""
    turns, drive, dynamics = joint.twist.turns, joint.actuator, joint.dynamics
    q, push = ("rad", "N m") if turns else ("m", "N")
    for what, value, unit in (
        ("velocity limit", joint.limit.velocity, f"{q}/s"), ("effort limit", joint.limit.effort, push),
        ("damping", dynamics.damping, f"{push} s/{q}"), ("dry friction", dynamics.friction, push),
        ("armature", dynamics.armature, "kg m^2" if turns else "kg"),
        ("kp", drive and drive.kp, f"{push}/{q}"), ("kv", drive and drive.kv, f"{push} s/{q}"),
    ):
        yield from _infinite(joint.path, what, value or 0.0, unit, joint.origin, degrees=turns and what == "velocity limit")


def _infinite(path: str, what: str, value: float, unit: str, origin: Origin, *, degrees: bool = False) -> Iterator[Loss]:
    """Yield an export loss if a number is too large for a float in USD. If `degrees` is True, the value is an angle that is converted to
    degrees.
    """
    if value > (numeric.radians(FLOAT_MAX) if degrees else FLOAT_MAX):
        description = f"the {what} of {value:.6g} {unit}: infinite in the file (above {FLOAT_MAX:.2g})"
        yield Loss("usd", None, path, description, "approximated", origin)


def _is_closed(robot: Robot) -> bool:
    """Return whether the loops and holds of a mode are closed at q = 0, if the base has the pose that the mode specifies."""
    if not robot.closures:
        return True
    joints, base = joints_of(robot.assembly), robot.bodies[0].X_PL
    state = SolverState(q={joint.path: 0.0 for joint in joints}, base=base)
    return Loops(robot.bodies, robot.closures, joints, base).are_closed(state)

