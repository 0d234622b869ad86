"""`MjModel.stat`, as MuJoCo's compiler works it out: `mj_setConst` leaves it alone."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mujoco
    import numpy as np

    Array = np.ndarray[Any, np.dtype[Any]]

_LEAST = 1e-5
"""The size [m] of a body, and of a model, that has none."""
_PLANE = 0.1
"""The size [m] of a plane without an end; of a plane a tenth counts."""


class Statistics:
    """Those of one model, again and again: what belongs to what does not change. `data` is of the model at `qpos0` when they are
    written. Those that are `stated` in its text stay as they are."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, stated: Collection[str] = ()) -> None:
        import mujoco
        import numpy as np

        bodies = range(1, model.nbody)
        ends = [(int(body), int(model.body_parentid[body])) for body in model.jnt_bodyid]
        joints = [(body, j) for j, both in enumerate(ends) for body in both]
        geoms = [(int(model.geom_bodyid[g]), g) for g in range(model.ngeom) if model.geom_rbound[g] > 0 and model.geom_bodyid[g] > 0]
        joints = [one for one in joints if one[0] > 0]
        owners = np.array([body for body, _ in (*joints, *geoms)] + list(bodies), dtype=int)
        self._order = np.argsort(owners, kind="stable")
        self._starts = np.searchsorted(owners[self._order], np.array(bodies, dtype=int))
        self._joints = np.array([j for _, j in joints], dtype=int)
        self._geoms = np.array([g for _, g in geoms], dtype=int)
        self._owners = owners[: len(joints) + len(geoms)]
        self._least = np.full(len(bodies), _LEAST)
        self._rbound = model.geom_rbound[self._geoms]
        around = np.maximum(model.geom_rbound, 0.0)
        for g in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE):
            around[g] = 0.1 * (float(max(model.geom_size[g, :2])) or _PLANE)
        self._around = around[:, None]

        self._stat, self._stated = model.stat, stated
        self._count, self._nv = len(bodies), int(model.nv)
        self._anchors, self._centres, self._shapes = data.xanchor, data.xipos, data.geom_xpos
        self._points = (data.xpos[1:], data.xipos[1:], data.xanchor, data.site_xpos)
        self._mass, self._inertia = model.body_mass[1:], model.dof_M0

    def write(self) -> None:
        """Write them."""
        import numpy as np

        points = np.concatenate((self._anchors[self._joints], self._shapes[self._geoms]))
        x, y, z = (points - self._centres[self._owners]).T
        sizes = np.sqrt(x * x + y * y + z * z)
        sizes[len(self._joints):] += self._rbound
        largest = np.maximum.reduceat(np.concatenate((sizes, self._least))[self._order], self._starts).tolist()
        meansize = 0.0
        for size in largest:
            meansize += size / self._count
        box = np.concatenate((*self._points, self._shapes - self._around, self._shapes + self._around))
        low, high = box.min(axis=0), box.max(axis=0)
        values = {"center": (low + high) * 0.5, "extent": max(_LEAST, float((high - low).max()), 2 * meansize), "meansize": meansize}
        mass = 0.0
        for one in self._mass.tolist():
            mass += one
        values["meanmass"] = mass / self._count
        if self._nv:
            inertia = 0.0
            for one in self._inertia.tolist():
                inertia += one
            values["meaninertia"] = inertia / self._nv
        for name, value in values.items():
            if name not in self._stated:
                setattr(self._stat, name, value)
