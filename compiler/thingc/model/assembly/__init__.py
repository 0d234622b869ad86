"""Linking: the resolved model and the part records to occurrences, mates and links, before any root is chosen."""

from __future__ import annotations

from thingc.model.assembly.kinematics import balls, bent, coordinates, in_cones, joints_of, leaders, on_loops, poses
from thingc.model.assembly.linking import link
from thingc.model.assembly.mesh_files import listed_meshes
from thingc.model.assembly.own_images import with_own_images
from thingc.model.assembly.prints import likely_slicings, slicings_of

__all__ = [
    "balls", "bent", "coordinates", "in_cones", "joints_of", "leaders", "likely_slicings", "link", "listed_meshes", "on_loops", "poses",
    "slicings_of", "with_own_images",
]
