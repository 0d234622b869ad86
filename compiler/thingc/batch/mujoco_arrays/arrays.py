"""Write other numbers into the arrays of a compiled MuJoCo model, as if its XML had been compiled with these numbers."""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from thingc.batch.mujoco_arrays.entries import INERTIAL, NumberPlaces, Write, affect_constants
from thingc.batch.mujoco_arrays.equality import owner_of, restore

if TYPE_CHECKING:
    import mujoco

Array = np.ndarray[Any, np.dtype[Any]]

_LEAST = 1e-5
"""Size [m] that the statistics assume for a body or model without extent."""
_PLANE = 0.1
"""Default size [m] of an infinite plane. The statistics use a tenth of this size."""


class Statistics:
    """Computes the field `stat` of a MuJoCo model for many variants that differ only in numbers.

    `specified` contains the names of the statistics that the XML specifies. `positions` contains the arrays of `data` for the positions of
    joint anchors, centres of mass, geoms, bodies and sites [m].
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, specified: Collection[str] = ()) -> None:
        import mujoco

        bodies = range(1, model.nbody)
        ends = [(int(body), int(model.body_parentid[body])) for body in model.jnt_bodyid]
        joints = [(body, j) for j, joint_ends in enumerate(ends) for body in joint_ends]
        geoms = [(int(model.geom_bodyid[g]), g) for g in range(model.ngeom) if model.geom_rbound[g] > 0 and model.geom_bodyid[g] > 0]
        joints = [owner_and_joint for owner_and_joint in joints if owner_and_joint[0] > 0]
        owners = np.array([body for body, _ in (*joints, *geoms)] + list(bodies), dtype=int)
        self._order = np.argsort(owners, kind="stable")
        self._starts = np.searchsorted(owners[self._order], np.array(bodies, dtype=int))
        self._joints = np.array([j for _, j in joints], dtype=int)
        self._geoms = np.array([g for _, g in geoms], dtype=int)
        self._owners = owners[: len(joints) + len(geoms)]
        self._rbound = model.geom_rbound[self._geoms]
        radii = np.maximum(model.geom_rbound, 0.0)
        for g in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE):
            radii[g] = 0.1 * (float(max(model.geom_size[g, :2])) or _PLANE)
        self._radii = radii[:, None, None]

        self._stat, self._specified = model.stat, specified
        self._count, self._nv = len(bodies), int(model.nv)
        self.positions = (data.xanchor, data.xipos, data.geom_xpos, data.xpos, data.site_xpos)
        self._inertia = model.dof_M0

    def of(self, positions: list[Array], masses: Array) -> dict[str, list[Any]]:
        """Compute the statistics of many variants, except `meaninertia`. `masses` (variants, bodies) contains the masses of bodies in kg.

        `positions` contains an array (number of elements, variants, 3) for each array in the attribute `positions`, at `qpos0`. If all
        variants have the same positions, the arrays can contain only one variant.
        """
        anchors, centres, shapes, bodies, sites = positions
        count = bodies.shape[1]
        x, y, z = np.moveaxis(np.concatenate((anchors[self._joints], shapes[self._geoms])) - centres[self._owners], -1, 0)
        sizes = np.sqrt(x * x + y * y + z * z)
        sizes[len(self._joints):] += self._rbound[:, None]
        sizes = np.concatenate((sizes, np.full((self._count, count), _LEAST)))
        meansize, mass = np.zeros(count), np.zeros(len(masses))
        for body, largest in enumerate(np.maximum.reduceat(sizes[self._order], self._starts), start=1):  # in the same order as MuJoCo
            meansize += largest / self._count
            mass += masses[:, body]
        box = np.concatenate((bodies[1:], centres[1:], anchors, sites, shapes - self._radii, shapes + self._radii))
        low, high = box.min(axis=0), box.max(axis=0)
        extent = np.maximum(np.maximum(_LEAST, (high - low).max(axis=1)), 2 * meansize)
        columns = {
            "center": list((low + high) * 0.5), "extent": extent.tolist(), "meansize": meansize.tolist(),
            "meanmass": (mass / self._count).tolist(),
        }
        return {name: values * (len(masses) // len(values)) for name, values in columns.items() if name not in self._specified}

    def write(self, values: Mapping[str, list[Any]], index: int) -> None:
        """Write the statistics of the variant with this index to the `stat` field of the model.

        The written statistics include `meaninertia`, which depends on constants that MuJoCo has computed for this variant.
        """
        for name, column in values.items():
            setattr(self._stat, name, column[index])
        if self._nv and "meaninertia" not in self._specified:
            inertia = 0.0
            for element in self._inertia.tolist():
                inertia += element
            self._stat.meaninertia = inertia / self._nv


BOXES = ("bvh_aabb", "bvh_child", "bvh_depth", "bvh_nodeid")
"""Names of the fields that contain the bounding volume tree of a body."""

TOGETHER = 128
"""Number of variants for which arrays are computed in one step."""

PLACING = frozenset(("body_ipos", "body_pos", "body_quat", "jnt_pos", "site_pos"))
"""Names of the fields that move elements on which the statistics depend."""

Compile = Callable[[str], "mujoco.MjModel"]


class Arrays:
    """A compiled MuJoCo model, and the elements of its arrays that depend on varying numbers.

    `text` is an XML text in which a token replaces each varying number, and `tokens` maps each token to the index of its number. `plain` is
    the XML text with numbers, `assets` maps file names to meshes, and `compile` compiles an XML text. `written` contains the names of the
    fields that depend on numbers. Raises `NotAnArrayEntry` if a number does not appear unchanged in an array.
    """

    def __init__(self, text: str, tokens: Mapping[str, int], plain: str, assets: Mapping[str, bytes], compile: Compile) -> None:
        import mujoco

        self._text = plain
        self._assets = assets
        self.model = compile(self._text)
        root = ElementTree.fromstring(text)
        self._numbers = NumberPlaces(root, tokens, self.model)
        self.written = self._numbers.add_mass_fields(self._numbers.writes)
        self._writes: list[tuple[str, Array, Write]] = []
        self._options: list[tuple[Any, str, int]] = []
        for field, write in self._numbers.writes.items():
            owner, name = owner_of(self.model, field)
            if isinstance(target := getattr(owner, name), np.ndarray):
                self._writes.append((field, target.reshape(-1), write))
            else:
                self._options.append((owner, name, int(write.columns[-1])))
        self._recomputes = affect_constants(self.written, self.model)
        self._data = mujoco.MjData(self.model)
        self._first = copy.copy(self.model)  # callers never get this model, so callers cannot modify it
        self._first_data = mujoco.MjData(self._first)
        specified = {name for element in root.iter("statistic") for name in element.attrib}
        self._statistics = Statistics(self.model, self._first_data, specified)
        self._is_shared = False
        self._small: dict[int, Bodies] = {}
        self._geoms = [self._colliding(int(body)) for body in self._numbers.bodies]

    def undo_changes(self) -> None:
        """Undo the modifications of callers to a shared model, so that `put` creates the exact model of a variant."""
        if self._is_shared:
            restore(self.model, self._first)
        self._is_shared = False

    def _colliding(self, body: int) -> Array:
        """Return the indices of the colliding geoms of a body, followed by -1. Return an empty array if the body has no colliding geoms."""
        m = self.model
        geoms = range(int(m.body_geomadr[body]), int(m.body_geomadr[body]) + int(m.body_geomnum[body]))
        colliding = [g for g in geoms if m.geom_contype[g] or m.geom_conaffinity[g]]
        return np.array([*colliding, -1] if colliding else [], dtype=int)

    def prepare(self, values: Sequence[tuple[float, ...]]) -> Prepared:
        """Compute the array elements of many variants. `values` contains a tuple with the numbers of each variant, one per token.

        Raises `ValueError` if MuJoCo rejects a variant.
        """
        import mujoco

        first, count = self._first, len(values)
        numbers = np.array(values, dtype=float).reshape(count, -1)
        writes = [(field, target, write.at, numbers[:, write.columns] * write.signs) for field, target, write in self._writes]
        masses = np.tile(first.body_mass, (count, 1))
        if self._numbers.names:
            constants = np.broadcast_to(self._numbers.constants, (count, len(self._numbers.constants)))
            inertials = np.concatenate([numbers, constants], axis=1)[:, self._numbers.inertials]
            masses[:, self._numbers.bodies] = inertials[:, :, 0]
            writes += self._inertial_writes(inertials)
        options = [(owner, name, numbers[:, column].tolist()) for owner, name, column in self._options]
        plain = [(target, at, block) for _, target, at, block in writes]
        if not self._recomputes:
            return Prepared(plain, options, None)
        placing = [(getattr(first, field).reshape(-1), at, block) for field, _, at, block in writes if field in PLACING]
        distinct = count if placing else 1
        positions = [np.empty((len(elements), distinct, 3)) for elements in self._statistics.positions]
        for index in range(distinct):
            for target, at, block in placing:
                target[at] = block[index]
            mujoco.mj_kinematics(first, self._first_data)
            for copies, elements in zip(positions, self._statistics.positions):
                copies[:, index] = elements
        return Prepared(plain, options, self._statistics.of(positions, masses))

    def _inertial_writes(self, inertials: Array) -> list[tuple[str, Array, Array, Array]]:
        """Compute the array elements that depend on the mass properties `inertials` (variants, bodies, 10) of bodies.

        These elements include the bounding boxes of colliding geoms, which are aligned with the principal axes.
        """
        model, count = self.model, len(inertials)
        copies = 1 if count == 1 else TOGETHER
        small = self._small.get(copies)
        if small is None:
            small = self._small[copies] = Bodies(self._text, self._assets, self._numbers.names, copies)
        moments, axes, boxes_of_bodies = small.compute_inertials(inertials)
        writes = []

        def write(field: str, rows: Array, block: Array) -> None:
            target = getattr(model, field)
            width = target.size // len(target)
            at = (rows[:, None] * width + np.arange(width)).reshape(-1)
            writes.append((field, target.reshape(-1), at, block.reshape(len(block), -1)))

        for field, block in zip(INERTIAL, (inertials[:, :, 0], inertials[:, :, 1:4], moments, axes)):
            write(field, self._numbers.bodies, block)
        for body, boxes, geoms in zip(self._numbers.bodies, boxes_of_bodies, self._geoms):
            if len(geoms):
                rows = int(model.body_bvhadr[body]) + np.arange(int(model.body_bvhnum[body]))
                for field in BOXES:
                    write(field, rows, geoms[boxes[field]] if field == "bvh_nodeid" else boxes[field])
        return writes

    def put(self, prepared: Prepared, index: int, *, share: bool = False, exact: bool = True) -> mujoco.MjModel:
        """Write the array elements of the variant with this index to `model`, and return it.

        With `share`, the caller can modify the returned model. Earlier modifications are undone first, except with `share` and without
        `exact`.
        """
        import mujoco

        if exact or not share:
            self.undo_changes()
        self._is_shared |= share
        model = self.model
        for target, at, block in prepared.writes:
            target[at] = block[index]
        for owner, name, values in prepared.options:
            setattr(owner, name, values[index])
        if prepared.statistics is not None:
            mujoco.mj_setConst(model, self._data)  # does not set the rest lengths of tendon springs
            if relaxed := self._numbers.relaxed:
                model.tendon_lengthspring[relaxed] = self._data.ten_length[relaxed, None]
            self._statistics.write(prepared.statistics, index)
        return model


@dataclass(slots=True)
class Prepared:
    """The array elements of several variants, which can be written into a model.

    For each variant, this object contains a row of array elements and a value for each option. If MuJoCo recomputes constants, the object
    also contains statistics.
    """

    writes: list[tuple[Array, Array, Array]]
    options: list[tuple[Any, str, list[float]]]
    statistics: Mapping[str, list[Any]] | None


class Bodies:
    """A small MuJoCo model that contains many copies of some bodies of a larger model.

    With this model, MuJoCo's compiler computes the principal axes and the aligned bounding boxes of many variants in one call. `text` is
    the XML of the larger model, and `assets` maps file names to its meshes.
    """

    def __init__(self, text: str, assets: Mapping[str, bytes], names: Sequence[str], copies: int) -> None:
        import mujoco

        root = ElementTree.fromstring(text)
        small = Element("mujoco")
        for tag in ("compiler", "default"):
            small.extend(root.findall(tag))
        world = ElementTree.SubElement(small, "worldbody")
        used: set[str] = set()
        top = root.find("worldbody/body")
        assert top is not None
        bodies = {body.get("name"): body for body in root.iter("body")}
        for name in names:
            geoms = [geom for geom in bodies[name].findall("geom") if geom.get("class") != "visual"]
            used.update(geom.get("mesh", "") for geom in geoms)
            for index in range(copies):
                body = ElementTree.SubElement(world, "body", {"name": f"{name}#{index}", "childclass": top.get("childclass", "")})
                body.extend(copy.copy(inertial) for inertial in bodies[name].findall("inertial"))
                for geom in geoms:
                    body.append(Element("geom", {key: value for key, value in geom.attrib.items() if key not in ("name", "material")}))
        meshes = ElementTree.Element("asset")
        meshes.extend(mesh for mesh in root.iterfind("asset/mesh") if mesh.get("name") in used)
        small.insert(len(small) - 1, meshes)
        mesh_files = {file: assets[file] for mesh in meshes if (file := mesh.get("file"))}  # prisms do not have a file
        self.copies = copies
        self._spec = mujoco.MjSpec.from_string(ElementTree.tostring(small, encoding="unicode"), assets=mesh_files)
        self._spec.compiler.usethread = False
        self._bodies = [[self._spec.body(f"{name}#{index}") for index in range(copies)] for name in names]

    def compute_inertials(self, inertials: Array) -> tuple[Array, Array, list[dict[str, Array]]]:
        """Compute the principal axes and the aligned bounding boxes of the bodies of several variants.

        The number of variants must not exceed the number of copies. `inertials` (variants, bodies, 10) contains the mass, the centre of
        mass and the inertia of each body, in the order of `fullinertia`. Raises `ValueError` if MuJoCo rejects a variant.

        Return the principal moments (copies, bodies, 3), the quaternions of the principal axes (copies, bodies, 4), and the fields of the
        bounding volume tree of each body.
        """
        copies, last = self.copies, len(inertials) - 1
        for b, bodies in enumerate(self._bodies):
            for k, body in enumerate(bodies):
                numbers = inertials[min(k, last), b]
                body.mass, body.ipos, body.fullinertia = numbers[0], numbers[1:4], numbers[4:]
        model = self._spec.compile()
        ids = np.arange(1, 1 + copies * len(self._bodies)).reshape(-1, copies)
        boxes: list[dict[str, Array]] = []
        for indices in ids:
            first, count = int(model.body_bvhadr[indices[0]]), int(model.body_bvhnum[indices[0]])
            rows = (first if count else 0) + np.arange(count * copies).reshape(copies, count)
            own = {name: getattr(model, name)[rows] for name in BOXES}
            own["bvh_nodeid"] = np.where(own["bvh_nodeid"] >= 0, own["bvh_nodeid"] - model.body_geomadr[indices][:, None], -1)
            boxes.append(own)
        return model.body_inertia[ids.T], model.body_iquat[ids.T], boxes
