"""What all readers have in common: requests are read from one file of JSON, answers and the reader's version are written to another."""

from __future__ import annotations

import json


def serve(answer, version, arguments):
    """Answer every request; what a reader cannot take is its own words."""
    with open(arguments[1]) as stream:
        requests = json.load(stream)
    answers = []
    for asked in requests:
        try:
            answers.append(answer(asked))
        except Exception as fault:  # whatever the reader raises is its answer
            answers.append({"cannot": f"{type(fault).__name__}: {fault}"})
    with open(arguments[2], "w") as stream:
        json.dump({"version": version, "answers": answers}, stream)


def started(asked):
    """MuJoCo's model of an MJCF file, without contacts, and its state as `stepped` of `reference.py` begins with it. Their cones are none
    of MJX's elliptic ones, which need a contact."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(asked["file"])
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qvel = asked["qvel"]
    return model, data


def frames_of_usd(file, names):
    """Of each frame in a USD file the link that it is on, and its pose there as a matrix: a link is its own, others are prims below one."""
    import numpy as np
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.Open(file)
    links = [prim for prim in stage.GetDefaultPrim().GetChildren() if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    frames = {
        frame.GetName(): (link.GetName(), np.array(UsdGeom.Xformable(frame).GetLocalTransformation()).T)
        for link in links for frame in link.GetChildren() if frame.IsA(UsdGeom.Xform)
    }
    frames |= {link.GetName(): (link.GetName(), np.eye(4)) for link in links}
    return {name: frames[name] for name in names}
