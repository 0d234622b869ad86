"""Shared code of the programs that run a reader. Each program reads requests from a JSON file, and writes its answers and the version of
the reader to another JSON file.
"""

from __future__ import annotations

import json


def serve(answer, version, arguments):
    """Answer all requests and write the answers. If a reader raises an exception, its message is the answer."""
    with open(arguments[1]) as stream:
        requests = json.load(stream)
    answers = []
    for asked in requests:
        try:
            answers.append(answer(asked))
        except Exception as fault:  # any error of the reader is an answer
            answers.append({"cannot": f"{type(fault).__name__}: {fault}"})
    with open(arguments[2], "w") as stream:
        json.dump({"version": version, "answers": answers}, stream)


def started(asked):
    """Return the MuJoCo model of an MJCF file without contacts, and the initial state that `stepped` in `reference.py` also uses.

    The model uses pyramidal friction cones, because MJX only supports elliptic cones if the model has contacts.
    """
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
    """Return the link of each frame in a USD file, and the pose of the frame in the link as a matrix.

    A link is also a frame, and other frames are prims below the link.
    """
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
