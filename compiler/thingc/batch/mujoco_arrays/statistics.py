"""`MjModel.stat`, as MuJoCo's compiler works it out: `mj_setConst` leaves it alone."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mujoco
    import numpy as np

    Array = np.ndarray[Any, np.dtype[Any]]
    Places = list[Array]

_LEAST = 1e-5
"""The size [m] of a body, and of a model, that has none."""
_PLANE = 0.1
"""The size [m] of a plane without an end; of a plane a tenth counts."""


class Statistics:
    """Those of one model, again and again: what belongs to what does not change. Those that are `stated` in its text stay as they are."""

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
        self._rbound = model.geom_rbound[self._geoms]
        around = np.maximum(model.geom_rbound, 0.0)
        for g in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE):
            around[g] = 0.1 * (float(max(model.geom_size[g, :2])) or _PLANE)
        self._around = around[:, None, None]

        self._stat, self._stated = model.stat, stated
        self._count, self._nv = len(bodies), int(model.nv)
        self._places = (data.xanchor, data.xipos, data.geom_xpos, data.xpos, data.site_xpos)
        self._inertia = model.dof_M0

    def room(self, variants: int) -> Places:
        """For `note`: where anchors, centres, geoms, bodies and sites of so many variants are, each (number, variants, 3) in m."""
        import numpy as np

        return [np.empty((len(place), variants, 3)) for place in self._places]

    def note(self, places: Places, variant: int) -> None:
        """That `data`, at `qpos0`, has them where they are of a variant."""
        for kind, place in zip(places, self._places):
            kind[:, variant] = place

    def of(self, places: Places, masses: Array) -> dict[str, list[Any]]:
        """The statistics of many variants but `meaninertia`, of their `masses` (variants, bodies) in kg. `places` may be of one, where
        those of all are the same."""
        import numpy as np

        anchors, centres, shapes, bodies, sites = places
        count = bodies.shape[1]
        x, y, z = np.moveaxis(np.concatenate((anchors[self._joints], shapes[self._geoms])) - centres[self._owners], -1, 0)
        sizes = np.sqrt(x * x + y * y + z * z)
        sizes[len(self._joints):] += self._rbound[:, None]
        sizes = np.concatenate((sizes, np.full((self._count, count), _LEAST)))
        meansize, mass = np.zeros(count), np.zeros(len(masses))
        for body, largest in enumerate(np.maximum.reduceat(sizes[self._order], self._starts), start=1):  # in the compiler's order
            meansize += largest / self._count
            mass += masses[:, body]
        box = np.concatenate((bodies[1:], centres[1:], anchors, sites, shapes - self._around, shapes + self._around))
        low, high = box.min(axis=0), box.max(axis=0)
        extent = np.maximum(np.maximum(_LEAST, (high - low).max(axis=1)), 2 * meansize)
        columns = {
            "center": list((low + high) * 0.5), "extent": extent.tolist(), "meansize": meansize.tolist(),
            "meanmass": (mass / self._count).tolist(),
        }
        return {name: values * (len(masses) // len(values)) for name, values in columns.items() if name not in self._stated}

    def write(self, values: Mapping[str, list[Any]], index: int) -> None:
        """Write those of a variant, whose constants are set: with them `meaninertia`."""
        for name, column in values.items():
            setattr(self._stat, name, column[index])
        if self._nv and "meaninertia" not in self._stated:
            inertia = 0.0
            for one in self._inertia.tolist():
                inertia += one
            self._stat.meaninertia = inertia / self._nv
