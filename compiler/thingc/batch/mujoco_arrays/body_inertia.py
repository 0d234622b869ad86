"""What MuJoCo's compiler makes of the mass properties of bodies: principal axes, and the boxes around what collides, which stand along
them. It is asked: one small model holds the bodies of many variants side by side.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

if TYPE_CHECKING:
    import mujoco
    import numpy as np

    Array = np.ndarray[Any, np.dtype[Any]]

BOXES = ("bvh_aabb", "bvh_child", "bvh_depth", "bvh_nodeid")
"""The fields of a body's tree of boxes."""


class Bodies:
    """Bodies of a model, each `copies` times in a model of their own. `text` is the model's, `assets` its meshes by the names of their
    files; only what collides goes along."""

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
        own = {body.get("name"): body for body in root.iter("body")}
        for name in names:
            geoms = [geom for geom in own[name].findall("geom") if geom.get("class") != "visual"]
            used.update(geom.get("mesh", "") for geom in geoms)
            for index in range(copies):
                body = ElementTree.SubElement(world, "body", {"name": f"{name}#{index}", "childclass": top.get("childclass", "")})
                body.extend(copy.copy(one) for one in own[name].findall("inertial"))
                for geom in geoms:
                    body.append(Element("geom", {key: value for key, value in geom.attrib.items() if key not in ("name", "material")}))
        meshes = ElementTree.Element("asset")
        meshes.extend(mesh for mesh in root.iterfind("asset/mesh") if mesh.get("name") in used)
        small.insert(len(small) - 1, meshes)
        kept = {mesh.get("file", ""): assets[mesh.get("file", "")] for mesh in meshes}
        self.names = tuple(names)
        self.copies = copies
        self._spec = mujoco.MjSpec.from_string(ElementTree.tostring(small, encoding="unicode"), assets=kept)
        self._spec.compiler.usethread = False
        self._bodies = [self._spec.body(f"{name}#{index}") for name in names for index in range(copies)]

    def work_out(self, inertials: Array) -> BodyArrays:
        """Of as many variants as there are copies, or fewer: `inertials` (variants, bodies, 10) are masses, centres and inertias as
        `fullinertia` has them. Raises `ValueError` where MuJoCo refuses one."""
        count = len(inertials)
        for b in range(len(self.names)):
            for k in range(self.copies):
                body, numbers = self._bodies[b * self.copies + k], inertials[min(k, count - 1), b]
                body.mass, body.ipos, body.fullinertia = numbers[0], numbers[1:4], numbers[4:]
        return BodyArrays(self._spec.compile(), self.copies, len(self.names))


class BodyArrays:
    """What came of it, of all copies: `inertia` (copies, bodies, 3) are principal moments, `axes` (copies, bodies, 4) the quaternions of
    their axes; `boxes` of each body the fields of its tree of boxes."""

    def __init__(self, model: mujoco.MjModel, copies: int, bodies: int) -> None:
        import numpy as np

        ids = np.arange(1, 1 + copies * bodies).reshape(bodies, copies)
        self.inertia = model.body_inertia[ids.T]
        self.axes = model.body_iquat[ids.T]
        self.boxes: list[dict[str, Array]] = []
        for b in range(bodies):
            first, count = int(model.body_bvhadr[ids[b][0]]), int(model.body_bvhnum[ids[b][0]])
            rows = (first if count else 0) + np.arange(count * copies).reshape(copies, count)
            own = {name: getattr(model, name)[rows] for name in BOXES}
            geoms = model.body_geomadr[ids[b]]
            own["bvh_nodeid"] = np.where(own["bvh_nodeid"] >= 0, own["bvh_nodeid"] - geoms[:, None], -1)
            self.boxes.append(own)
