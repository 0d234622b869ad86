"""Spanning trees: one robot per mode, a tree of bodies whose joints mean the same whatever its root."""

from __future__ import annotations

from thingc.model.robot.kinematics import body_poses, link_names, mass_properties, occurrence_poses, placed_bodies
from thingc.model.robot.spanning_tree import root
from thingc.model.robot.standing import stand
from thingc.model.robot.starting import check_starts
from thingc.model.robot.tree import in_link

__all__ = [
    "body_poses", "check_starts", "in_link", "link_names", "mass_properties", "occurrence_poses", "placed_bodies", "root",
    "stand",
]
