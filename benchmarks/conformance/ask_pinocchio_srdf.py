"""Read the URDF and SRDF of a ROS package with pinocchio, with meshes from the package: `python ask_pinocchio_srdf.py REQUESTS ANSWERS`."""

from __future__ import annotations

import math
import os
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio


def answer(asked):
    model = pinocchio.buildModelFromUrdf(asked["file"])
    folders = [os.path.dirname(asked["package"])]
    geometry = pinocchio.buildGeomFromUrdf(model, asked["file"], pinocchio.GeometryType.COLLISION, package_dirs=folders)
    geometry.addAllCollisionPairs()
    apart(model, geometry, asked)
    before = len(geometry.collisionPairs)
    pinocchio.removeCollisionPairs(model, geometry, asked["srdf"], False)
    if asked["never"] and len(geometry.collisionPairs) >= before:
        raise ValueError("takes no pair of links out")
    pinocchio.loadReferenceConfigurations(model, asked["srdf"], False)
    configurations = {one.key(): one.data() for one in model.referenceConfigurations}
    for state in reversed(ElementTree.parse(asked["srdf"]).getroot().findall("group_state")):
        endless(model, configurations[state.attrib["name"]], state)
    return {"frames": [frames(model, configurations[pose], asked) for pose in asked["poses"]]}


def endless(model, q, state):
    """Write the values of unlimited revolute joints into a configuration. Pinocchio represents these joints by cosine and sine, and does
    not read their values from the SRDF.
    """
    for joint in state:
        one = model.joints[model.getJointId(joint.attrib["name"])]
        if one.nq == 2:
            angle = float(joint.attrib["value"])
            q[one.idx_q : one.idx_q + 2] = [math.cos(angle), math.sin(angle)]


def frames(model, q, asked):
    """Return the poses of frames relative to the root link."""
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, followed(model, q, asked))
    root = data.oMf[model.getFrameId(asked["root"])].inverse()
    return [(root * data.oMf[model.getFrameId(name)]).homogeneous.tolist() for name in asked["frames"]]


def followed(model, q, asked):
    """Return the configuration with mimic joints at the values that follow from their leaders. If `mimic` is on, pinocchio rejects mimic
    joints whose leader is in a later branch.
    """
    q = np.array(q)
    place = {name: model.joints[model.getJointId(name)].idx_q for pair in asked["follows"].items() for name in (pair[0], pair[1][0])}
    for name, (leader, multiplier, offset) in asked["follows"].items():
        q[place[name]] = multiplier * q[place[leader]] + offset  # one coordinate each: a leader always has limits
    return q


def apart(model, geometry, asked):
    """Raise an exception if links collide whose collisions the SRDF disables."""
    never = {frozenset(pair) for pair in asked["never"]}
    links = [model.frames[one.parentFrame].name for one in geometry.geometryObjects]
    pairs = [frozenset((links[pair.first], links[pair.second])) for pair in geometry.collisionPairs]
    data, found, rng = model.createData(), geometry.createData(), np.random.default_rng(0)
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    for _ in range(asked["configurations"] if never else 0):
        q = followed(model, lower + (upper - lower) * rng.random(model.nq), asked)
        pinocchio.computeCollisions(model, data, geometry, found, q, False)
        met = [sorted(pair) for pair, result in zip(pairs, found.collisionResults) if pair in never and result.isCollision()]
        if met:
            raise ValueError(f"{met[0][0]} and {met[0][1]} meet")


if __name__ == "__main__":
    from asking import serve

    serve(answer, pinocchio.__version__, sys.argv)
