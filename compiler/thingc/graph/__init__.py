"""Linking: the resolved model and the part records to occurrences, mates and links, before any root is chosen."""

from __future__ import annotations

from thingc.graph.kinematics import balls, coordinates, in_cones, joints_of, leaders, on_loops, poses
from thingc.graph.linking import link
from thingc.graph.mesh_records import mesh_records
from thingc.graph.own_images import with_own_images
from thingc.graph.prints import likely_slicings, slicings_of

__all__ = [
    "balls", "coordinates", "in_cones", "joints_of", "leaders", "likely_slicings", "link", "mesh_records", "on_loops", "poses",
    "slicings_of", "with_own_images",
]
