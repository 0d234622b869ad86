"""The options for reading a robot file of another format. This module is fast to import."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base.frozen_struct import FrozenStruct

ENDINGS = (".urdf", ".xml", ".sdf", ".xacro")
"""Suffixes of robot files."""


class SourceOptions(FrozenStruct):
    """How to read a robot file: the folders of ROS packages and of meshes, the arguments of xacro, and whether meshes are read."""

    packages: Mapping[str, str] = {}
    arguments: Mapping[str, str] = {}
    mesh_roots: Sequence[str] = ()
    meshes: bool = True
