"""`MjModel.stat`, as MuJoCo's compiler works it out: `mj_setConst` leaves it alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mujoco
    import numpy as np

    Array = np.ndarray[Any, np.dtype[Any]]

_LEAST = 1e-5
"""The size [m] of a body, and of a model, that has none."""


class Statistics:
    """Those of one model, again and again: what belongs to what does not change."""

    def __init__(self, model: mujoco.MjModel) -> None:
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
        self._around = np.maximum(model.geom_rbound, 0.0)[:, None]

    def write(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write them; `data` is as `mj_setConst` leaves it: the model at rest."""
        import numpy as np

        points = np.concatenate((data.xanchor[self._joints], data.geom_xpos[self._geoms]))
        x, y, z = (points - data.xipos[self._owners]).T
        sizes = np.sqrt(x * x + y * y + z * z)
        sizes[len(self._joints):] = self._rbound + sizes[len(self._joints):]
        largest = np.maximum.reduceat(np.concatenate((sizes, self._least))[self._order], self._starts).tolist()
        count = model.nbody - 1
        meansize = 0.0
        for size in largest:
            meansize += size / count
        shapes = data.geom_xpos
        box = np.concatenate((data.xpos[1:], data.xipos[1:], data.xanchor, data.site_xpos))
        low = np.minimum(box.min(axis=0), (shapes - self._around).min(axis=0)) if len(shapes) else box.min(axis=0)
        high = np.maximum(box.max(axis=0), (shapes + self._around).max(axis=0)) if len(shapes) else box.max(axis=0)
        stat = model.stat
        stat.center = (low + high) * 0.5
        stat.extent = max(max(_LEAST, float((high - low).max())), 2 * meansize)
        stat.meansize = meansize
        mass = 0.0
        for one in model.body_mass[1:].tolist():
            mass += one
        stat.meanmass = mass / count
        if model.nv:
            inertia = 0.0
            for one in model.dof_M0.tolist():
                inertia += one
            stat.meaninertia = inertia / model.nv
