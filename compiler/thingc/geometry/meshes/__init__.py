"""Mesh files that links list: what is known of them, read by trimesh and kept by content. The CAD kernel never sees one."""

from __future__ import annotations

from thingc.geometry.mesh_bounds import LARGEST, BadMesh, bounded
from thingc.geometry.meshes.files import MeshFile, mesh_file
from thingc.geometry.meshes.kept import measured, mesh_records
from thingc.geometry.meshes.record import MeshPiece, MeshRecord

__all__ = ["LARGEST", "BadMesh", "MeshFile", "MeshPiece", "MeshRecord", "bounded", "measured", "mesh_file", "mesh_records"]
