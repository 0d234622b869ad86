"""Run the validators of usd-core and of UsdPhysics on USD files, as `usdchecker` does: `python ask_usdchecker.py REQUESTS ANSWERS`."""

from __future__ import annotations

import sys
from importlib.metadata import version

from asking import frames_of_usd
from pxr import Usd, UsdPhysics, UsdValidation


def answer(asked):
    stage = Usd.Stage.Open(asked["file"])
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    faults = [fault.GetMessage() for fault in UsdValidation.ValidationContext(validators).Validate(stage)]
    roots = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)]
    joints = {prim.GetName() for prim in stage.Traverse() if prim.IsA(UsdPhysics.Joint)}
    missing = [name for name in asked["joints"] if name not in joints]
    if faults or len(roots) != 1 or missing:
        raise ValueError(f"{faults[:3]}, {len(roots)} articulations, {missing} missing")
    frames_of_usd(asked["file"], asked["frames"])
    links = [prim for prim in stage.GetDefaultPrim().GetChildren() if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    return {"mass": sum(UsdPhysics.MassAPI(link).GetMassAttr().Get() for link in links)}


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("usd-core"), sys.argv)
