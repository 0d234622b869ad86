"""Create mirror images of parts in a child process of the worker. Lengths are in mm, but poses are in metres."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.BRepGProp import BRepGProp
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_FACE

from thingc.base.numeric import dist
from thingc.base.pose import Mirror, Pose
from thingc.geometry.worker.kernel.integrals import extent, mass_and_inertia, subshapes

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from OCP.TopoDS import TopoDS_Shape

SAME = 1e-4
"""Tolerance for comparing the integrals of two mirrored faces, relative to the area of a face and the size of the part.

The tolerance is larger than the error of fixed-order integration, which is 1e-5 on a cylinder with a cross hole.
"""
SAME_PLACE = 1e-9
"""Tolerance for the position [m] and the z axis [rad] of a mount that is its own mirror image."""


class SolidMirror(Mirror):
    """A mirror plane that can reflect poses, and also shapes of the CAD kernel."""

    def keeps(self, pose: Pose) -> bool:
        """Return whether the mirror image of a mount has the same position and the same z axis as the mount."""
        image = self.mount(pose)
        return dist(image.translation, pose.translation) <= SAME_PLACE and all(
            abs(new[2] - old[2]) <= SAME_PLACE for new, old in zip(image.rotation, pose.rotation, strict=True)
        )

    def shape(self, shape: TopoDS_Shape) -> TopoDS_Shape:
        """Return the mirror image of a shape of the CAD kernel."""
        reflection = gp_Trsf()
        reflection.SetMirror(gp_Ax2(gp_Pnt(0.0, 0.0, 0.0), gp_Dir(*(1.0 if sign < 0.0 else 0.0 for sign in self.signs))))
        return BRepBuilderAPI_Transform(shape, reflection, True).Shape()

    def is_image_of_itself(self, solid: TopoDS_Shape) -> bool:
        """Return whether a solid is its own mirror image. For each face, some face must have the area, the centroid and the second moments
        of its mirror image.

        A solid with a thread is not its own mirror image. The mirror image of the thread has the opposite hand, which changes the products
        of moments.
        """
        size = extent(solid)
        faces = _integrals(solid, size)
        x, y, z = self.signs
        images = faces * np.array([1.0, x, y, z, 1.0, 1.0, 1.0, x * y, x * z, y * z])
        free = np.ones(len(faces), dtype=bool)
        for image in images:
            matches = np.flatnonzero(free & (np.abs(faces - image).max(axis=1) <= SAME * image[0]))
            if len(matches) == 0:
                return False
            free[matches[0]] = False
        return True


def _integrals(solid: TopoDS_Shape, size: float) -> NDArray[np.float64]:
    """Return ten integrals over each face of a solid about the origin, as an array (faces, 10). The unit of length is the size of the part.

    The columns are the area, three first moments and six second moments (xx, yy, zz, xy, xz, yz).
    """
    rows: list[list[float]] = []
    for face in subshapes(solid, TopAbs_FACE):
        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(face, properties)
        area, *second = mass_and_inertia(properties)
        first = [area * value for value in properties.CentreOfMass().Coord()]
        rows.append([area / size**2, *(value / size**3 for value in first), *(value / size**4 for value in second)])
    return np.array(rows).reshape(-1, 10)
