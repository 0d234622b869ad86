"""Mirror images of parts: in a child of the worker. Lengths in mm, but for those of poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thingc.base.numeric import dist
from thingc.base.pose import Mirror, Pose
from thingc.geometry.worker.kernel.integrals import explored, extent

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from OCP.TopoDS import TopoDS_Shape

SAME = 1e-4
"""How far the integrals of two faces that are mirror images may lie apart, relative to the area of a face and the size of the part:
plain integration errs by 1e-5 on a cylinder with a cross hole."""
SAME_PLACE = 1e-9
"""How far a mount may move [m], or its z turn [rad], and still be where it was."""


class SolidMirror(Mirror):
    """A mirror that also knows solids."""

    def keeps(self, pose: Pose) -> bool:
        """Whether the image of a mount is at the same place and looks the same way."""
        image = self.mount(pose)
        return dist(image.translation, pose.translation) <= SAME_PLACE and all(
            abs(new[2] - old[2]) <= SAME_PLACE for new, old in zip(image.rotation, pose.rotation, strict=True)
        )

    def shape(self, shape: TopoDS_Shape) -> TopoDS_Shape:
        """The image of a shape."""
        from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
        from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf

        reflection = gp_Trsf()
        reflection.SetMirror(gp_Ax2(gp_Pnt(0.0, 0.0, 0.0), gp_Dir(*(1.0 if sign < 0.0 else 0.0 for sign in self.signs))))
        return BRepBuilderAPI_Transform(shape, reflection, True).Shape()

    def is_image_of_itself(self, solid: TopoDS_Shape) -> bool:
        """Whether a solid is unchanged: each face has an image of its area, centroid and second moments among the faces. A thread
        has not: its faces wind the other way, which the products of moments tell."""
        size = extent(solid)
        faces = _integrals(solid, size)
        x, y, z = self.signs
        images = faces * np.array([1.0, x, y, z, 1.0, 1.0, 1.0, x * y, x * z, y * z])
        free = np.ones(len(faces), dtype=bool)
        for image in images:
            near = np.flatnonzero(free & (np.abs(faces - image).max(axis=1) <= SAME * image[0]))
            if len(near) == 0:
                return False
            free[near[0]] = False
        return True


def _integrals(solid: TopoDS_Shape, size: float) -> NDArray[np.float64]:
    """Of each face, in units of the part's size: area, first moments (3) and second moments (xx, yy, zz, xy, xz, yz) about the origin;
    (faces, 10)."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.TopAbs import TopAbs_FACE

    rows: list[list[float]] = []
    for face in explored(solid, TopAbs_FACE):
        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(face, properties)
        area, centre, inertia = properties.Mass(), properties.CentreOfMass(), properties.MatrixOfInertia()
        about = [inertia.Value(i, j) for i, j in ((1, 1), (2, 2), (3, 3), (1, 2), (1, 3), (2, 3))]
        first = [area * value for value in (centre.X(), centre.Y(), centre.Z())]
        rows.append([area / size**2, *(value / size**3 for value in first), *(value / size**4 for value in about)])
    return np.array(rows).reshape(-1, 10)
