"""Mesh files that links list: what is known of them, read by trimesh and kept by content. The CAD kernel never sees one."""

from __future__ import annotations

from thingc.mesh_bounds import LARGEST, BadMesh, bounded
from thingc.meshes.files import MeshFile, mesh_file
from thingc.meshes.kept import measured, mesh_records
from thingc.meshes.record import MeshPiece, MeshRecord

__all__ = ["LARGEST", "BadMesh", "MeshFile", "MeshPiece", "MeshRecord", "bounded", "measured", "mesh_file", "mesh_records"]
