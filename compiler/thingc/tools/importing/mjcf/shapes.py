"""Convert the geoms of a MuJoCo model to visual and collision shapes of the source model."""

from __future__ import annotations

import os
from typing import Any

from msgspec.structs import replace

from thingc.base.pose import IDENTITY, Pose, Vector, rotate, transpose
from thingc.tools.importing.meshes import READ
from thingc.tools.importing.mjcf.compiled_source import SOLIMP, SOLREF, CompiledSource, differing, floats, numbers, pose_of
from thingc.tools.importing.source_model import Raw, ShapeKind, SourceShape

KINDS: dict[int, ShapeKind] = {0: "plane", 2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box", 7: "mesh"}
HIDDEN = 3
"""Lowest geom group that MuJoCo hides by default."""
FRICTION = (1.0, 0.005, 0.0001)
USUAL = {
    "solref": SOLREF, "solimp": SOLIMP, "margin": "0", "gap": "0", "solmix": "1", "contype": "1", "conaffinity": "1",
    "friction": numbers(FRICTION), "condim": "3", "priority": "0",
}
"""MuJoCo's default values of geom attributes."""
SPHERE, CYLINDER = 4, 5
"""Values of `mjtWrap` for a tendon that wraps around a geom. A hidden geom around which a tendon wraps has no other purpose."""
GREY = (0.5, 0.5, 0.5, 1.0)


class Geoms:
    """Converts the geoms of a MuJoCo model to visual and collision shapes.

    `files` maps the URIs of meshes from the compiled MuJoCo model to file contents. `shown` contains the indices of imported geoms.
    """

    def __init__(self, original: CompiledSource) -> None:
        self.original, self.model = original, original.model
        self.files: dict[str, bytes] = {}
        self.shown: set[int] = set()
        wraps = zip(self.model.wrap_type, self.model.wrap_objid, strict=True)
        self.wrapped = {int(geom) for kind, geom in wraps if int(kind) in (SPHERE, CYLINDER)}

    def of(self, body: int) -> tuple[SourceShape, ...]:
        """Return the visual and collision shapes of a body in source order, without planes of the world."""
        geoms = (geom for geom in self.original.geoms_of[body] if body or self.model.geom_type[geom])
        return tuple(shape for geom in geoms for shape in self._shapes(geom))

    def _shapes(self, geom: int) -> list[SourceShape]:
        """Return a visual shape for a visible geom, and a collision shape for a geom that can collide."""
        model, where = self.model, self.original.where("geom", geom)
        kind = KINDS.get(int(model.geom_type[geom]))
        if kind is None:
            self.original.losses.note("a geom with a signed distance field", "documents support only meshes and primitive shapes", where)
            return []
        touches = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
        color = self._color(geom)
        drawn = (model.geom_group[geom] < HIDDEN or not touches and geom not in self.wrapped) and (color is None or color[3] > 0.0)
        centred = pose_of(model.geom_pos[geom], model.geom_quat[geom])
        size, pose, mesh = self._mesh(geom, centred) if kind == "mesh" else (sizes_of(kind, model.geom_size[geom]), centred, None)
        friction = self._friction(geom) if touches else ()
        name = self.original.geoms[geom] if self.original.written["geom"][geom].name else None
        visual = SourceShape(kind=kind, use="visual", size=size, pose=pose, where=where, mesh=mesh, color=color, name=name)
        touching = replace(visual, use="collision", color=None, friction=friction, raw=self._raw(geom, friction))
        self.shown |= {geom} if drawn or touches else set()
        return [one for one, exists in ((visual, drawn), (touching, touches)) if exists]

    def _color(self, geom: int) -> tuple[float, float, float, float] | None:
        """Return the RGBA colour of a geom or of its material, or None for MuJoCo's default colour."""
        material = int(self.model.geom_matid[geom])
        r, g, b, a = floats(self.model.geom_rgba[geom])
        if (r, g, b, a) == GREY and material >= 0:
            r, g, b, a = floats(self.model.mat_rgba[material])
        return None if (r, g, b, a) == GREY else (r, g, b, a)

    def _mesh(self, geom: int, centred: Pose) -> tuple[Vector, Pose, str]:
        """Return the scale, the pose and the URI of the mesh of a geom.

        In the compiled model, the vertices are in the principal axes of the mesh. In the source, a vertex `v` of the file is transformed to
        `scale R^T (v - p)` with the reference pose `(R, p)`.
        """
        written = self.original.written["geom"][geom]
        mesh = self.original.spec.mesh(written.meshname)
        uri = self.original.flat.meshes.get(mesh.file, "")
        (x, y, z), scale = floats(mesh.scale), floats(mesh.scale)
        p, turn = floats(mesh.refpos), transpose(pose_of(mesh.refpos, mesh.refquat).rotation)
        if os.path.splitext(uri)[1].lower() not in READ or turn != IDENTITY and not (x == y == z):
            return (1.0, 1.0, 1.0), centred, self._anew(int(self.model.geom_dataid[geom]), mesh.name or "mesh", geom)
        u, v, w = rotate(turn, (p[0], p[1], p[2]))
        at = Pose(rotation=turn, translation=(-scale[0] * u, -scale[1] * v, -scale[2] * w))
        return (x, y, z), self.original.frame(written) @ at, uri

    def _anew(self, mesh: int, name: str, geom: int) -> str:
        """Write a mesh of the compiled MuJoCo model to a new file, and return the URI of this file.

        This method is for mesh formats that thingc cannot read.
        """
        file = f"mujoco://{name}.obj"
        if file not in self.files:
            model = self.model
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            faces, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
            lines = ["v {:.9g} {:.9g} {:.9g}".format(*row) for row in model.mesh_vert[first : first + count].tolist()]
            lines += ["f {} {} {}".format(*(1 + one for one in row)) for row in model.mesh_face[faces : faces + number].tolist()]
            self.files[file] = "\n".join([*lines, ""]).encode()
            why = "replaced by the mesh of MuJoCo in single precision"
            self.original.losses.note(f"the original file of mesh `{name}`", why, self.original.where("geom", geom, "mesh"))
        return file

    def _friction(self, geom: int) -> tuple[float, ...]:
        """Return the friction coefficients of a geom that affect contacts, or an empty tuple for MuJoCo's defaults."""
        slide, torsion, roll = floats(self.model.geom_friction[geom])
        dimensions = int(self.model.geom_condim[geom])
        effective = (slide, torsion, roll) if dimensions == 6 else (slide, torsion) if dimensions == 4 else (slide,)
        return () if effective == (FRICTION[0],) or dimensions == 1 else effective

    def _raw(self, geom: int, friction: tuple[float, ...]) -> Raw:
        """Return the attributes of a geom, other than friction, that affect contacts.

        The default values include the priority that thingc sets for a geom with friction, so that its friction applies on any floor.
        """
        attributes = self.original.texts(geom, {name: f"geom_{name}" for name in USUAL})
        otherwise = dict(USUAL)
        if friction:
            otherwise |= {
                "friction": numbers((*friction, *FRICTION[len(friction) :])), "condim": {1: "3", 2: "4", 3: "6"}[len(friction)],
                "priority": "1",
            }
        return differing(attributes, otherwise)


def sizes_of(kind: ShapeKind, sizes: Any) -> tuple[float, ...]:
    """Return those of the three size parameters of a MuJoCo geom [m] that its kind has."""
    return floats(sizes)[: {"sphere": 1, "cylinder": 2, "capsule": 2, "plane": 2}.get(kind, 3)]
