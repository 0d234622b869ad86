"""Read MJCF, URDF and SDF with Drake: `python ask_drake.py REQUESTS ANSWERS`.

The plant is discrete and uses the contact solver SAP, because Drake ignores mimic joints otherwise. Drake does not report mimic joints, so
the program finds them by simulation. The program pushes the leader for 400 steps, and fits a line to the positions of leader and follower
in the second half of the steps. The line gives multiplier and offset.
"""

from __future__ import annotations

import logging
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.systems.analysis import Simulator

STEP, STEPS, SPEED = 0.001, 400, 0.1
"""Timestep [s], number of steps, and speed of the leader that is pushed [rad/s or m/s]."""

ElementTree.register_namespace("drake", "http://drake.mit.edu")
logging.getLogger("drake").setLevel(logging.ERROR)


def answer(asked):
    refuse(Path(asked["file"]))
    file = without(Path(asked["file"]), asked["without"])
    try:
        plant = MultibodyPlant(STEP)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        shapes = SceneGraph()
        plant.RegisterAsSourceForSceneGraph(shapes)
        Parser(plant).AddModels(str(file))
        plant.Finalize()
    finally:
        if file != Path(asked["file"]):
            file.unlink()
    context = plant.CreateDefaultContext()
    for body in plant.GetFloatingBaseBodies():
        plant.SetFreeBodyPose(context, plant.get_body(body), RigidTransform())
    joints = [(plant.GetJointByName(name), axis) for name, axis in zip(asked["joints"], asked["axes"])]
    dofs = [joint.velocity_start() + axis for joint, axis in joints]
    plant.mutable_gravity_field().set_gravity_vector(asked["gravity"])
    reflected = np.zeros(plant.num_velocities())  # inertia of the armature, which does not belong to a body
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        reflected[actuator.joint().velocity_start()] += actuator.calc_reflected_inertia(context)
    poses, matrices, torques, centres = [], [], [], []
    boxes = []
    for values in asked["q"]:
        q = plant.GetPositions(context)
        for (joint, axis), value in zip(joints, values):
            q[joint.position_start() + axis] = value
        plant.SetPositions(context, q)
        boxes = boxes or [box(plant, context, shapes.model_inspector(), name) for name in asked["meshes"]]
        frames = [plant.GetFrameByName(name) for name in asked["frames"]]
        poses.append([frame.CalcPoseInWorld(context).GetAsMatrix4().tolist() for frame in frames])
        matrices.append((plant.CalcMassMatrix(context) - np.diag(reflected))[np.ix_(dofs, dofs)].tolist())
        torques.append((-plant.CalcGravityGeneralizedForces(context)[dofs]).tolist())
        centres.append(plant.CalcCenterOfMassPositionInWorld(context).tolist())
    limits = [(joint.position_lower_limits()[axis], joint.position_upper_limits()[axis]) for joint, axis in joints]
    answers = {
        "frames": poses, "mass": plant.CalcTotalMass(context), "mass_matrix": matrices, "torque": torques, "centre": centres,
        "meshes": boxes,
        "range": [None if np.isinf(ends).all() else list(ends) for ends in limits],
    }
    if file.suffix != ".xml":  # Drake does not read joint equalities in MJCF
        answers["mimic"] = [leader and [leader, *followed(plant, leader, name)] for name, leader in zip(asked["joints"], asked["leaders"])]
    if asked.get("efforts", True):
        answers["effort"] = efforts(plant, [joint for joint, _ in joints], asked["driven"], called=file.suffix != ".sdf")
    return answers


def efforts(plant, joints, driven, called):
    """Return the effort limit of the drive of each joint, or None if the limit is unknown.

    The limit is unknown for joints with several axes and for screws. Except in SDF, it is also unknown for joints without a drive.
    Set `called` if drives have the names of their joints, as in all formats except SDF.
    """
    actuators = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    found = {actuator.joint().name(): actuator for actuator in actuators}
    if called and any(name != actuator.name() for name, actuator in found.items()):
        raise ValueError(f"drives {sorted(actuator.name() for actuator in actuators)} of joints {sorted(found)}")
    known = [joint.num_velocities() == 1 and joint.type_name() != "screw" and (there or not called) for joint, there in zip(joints, driven)]
    strengths = [found[joint.name()].effort_limit() if joint.name() in found else 0.0 for joint in joints]
    return [strength if one or strength else None for strength, one in zip(strengths, known)]


def box(plant, context, inspector, name):
    """Return the smallest and the largest corner of the bounding box of a mesh in the world. The mesh is given by its name."""
    found = [one for one in inspector.GetAllGeometryIds() if inspector.GetName(one).partition("::")[2] == name]
    if len(found) != 1:
        raise ValueError(f"{len(found)} shapes are called {name}")
    body = plant.GetBodyFromFrameId(inspector.GetFrameId(found[0]))
    X_WG = plant.EvalBodyPoseInWorld(context, body) @ inspector.GetPoseInFrame(found[0])
    hull = inspector.GetConvexHull(found[0])
    points = X_WG @ np.array([hull.vertex(k) for k in range(hull.num_vertices())]).T
    return [*points.min(axis=1), *points.max(axis=1)]


def refuse(file):
    """Raise an exception if the file contains a model that Drake reads incorrectly without an error. If a rotated body has several joints,
    Drake uses the parent's frame for the axes and anchors of all joints except the last.
    """
    bodies = ElementTree.parse(file).iter("body") if file.suffix == ".xml" else ()
    if any(len(body.findall("joint")) > 1 and "quat" in body.attrib for body in bodies):
        raise ValueError("several joints of one body are read differently from MuJoCo if the body is rotated")


def without(file, joints):
    """Return the path of the file, or of a copy without the given joints."""
    if not joints:
        return file
    tree = ElementTree.parse(file)
    model = tree.getroot().find("model")
    for element in [one for one in model.findall("joint") if one.attrib["name"] in joints]:
        model.remove(element)
    other = file.with_name(f"open_{file.name}")
    tree.write(other)
    return other


def followed(plant, leader, follower):
    """Return the multiplier and the offset of a mimic joint, measured in a simulation."""
    context = plant.CreateDefaultContext()
    plant.get_actuation_input_port().FixValue(context, np.zeros(plant.num_actuators()))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    simulator = Simulator(plant, context)
    one, other = plant.GetJointByName(leader), plant.GetJointByName(follower)
    v = np.zeros(plant.num_velocities())
    v[one.velocity_start()] = SPEED
    plant.SetVelocities(simulator.get_mutable_context(), v)
    points = []
    for k in range(STEPS):
        simulator.AdvanceTo(STEP * (k + 1))
        q = plant.GetPositions(simulator.get_context())
        points.append((q[one.position_start()], q[other.position_start()]))
    x, y = np.array(points[STEPS // 2 :]).T
    (multiplier, offset), *_ = np.linalg.lstsq(np.stack([x, np.ones_like(x)], axis=1), y, rcond=None)
    return float(multiplier), float(offset)


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("drake"), sys.argv)
