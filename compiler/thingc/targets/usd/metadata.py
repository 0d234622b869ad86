"""Metadata of USD files for libraries of assets: the author and the license of a robot, its size, its mass, and the date of the build.

The date is that of the environment variable `SOURCE_DATE_EPOCH`, so that the same input always gives the same file.
"""

from __future__ import annotations

import os
from datetime import UTC, datetime

from thingc.base.numeric import maximum, sum_of
from thingc.base.package_info import PackageInfo
from thingc.model.robot.types import Robot
from thingc.targets.geometry import bounds, placements
from thingc.targets.usd.stage import LEAST_MASS
from thingc.targets.usd.usda import INDENT, Prim, dictionary, format_vector, quote
from thingc.targets.xml_writer import number

ROBOT = "Q11012"
"""The item of robots in Wikidata."""


def prim_metadata(name: str, file: str, about: PackageInfo) -> list[str]:
    """Return the metadata of the default prim of a file: its kind, its name and its version."""
    info = {"asset identifier": f"@./{file}@", "string name": quote(name), "string version": quote(about.version)}
    return ['kind = "component"', *dictionary("assetInfo", info)]


def layer_metadata(robot: Robot, model: Prim, about: PackageInfo) -> list[str]:
    """Return the metadata of the file of a mode, with the fields that SimReady requires (`SR.004`). `model` is the default prim."""
    assembly = robot.assembly
    low, high = bounds(*placements(robot)) or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    mass = sum_of(assembly.links[body.link].properties.mass for body in robot.bodies)
    entries = dictionary("dictionary SimReady_Metadata", {
        "float3 asset_extents": format_vector(b - a for a, b in zip(low, high, strict=True)), "string asset_license": quote(about.license),
        "string asset_name": quote(assembly.name), "string asset_type": quote("robot"), "string author": quote(about.maintainer),
        "string category": quote("robot"), "double mass": number(maximum(mass, LEAST_MASS)), "string qcode": quote(ROBOT),
        "int rigid_body_count": str(sum("PhysicsRigidBodyAPI" in prim.schemas for prim in model.children)),
        "string source_file": quote(assembly.definition.document), "string usd_date_generated": quote(build_date()),
    })
    return ["customLayerData = {", *(f"{INDENT}{line}" for line in entries), "}"]


def build_date() -> str:
    """Return the date of the build in ISO 8601: `SOURCE_DATE_EPOCH` [s], or 1970-01-01 if this variable is not set to a valid number."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(epoch) if epoch.isdecimal() and len(epoch) < 12 else 0, UTC).date().isoformat()
