"""The `workspace/1` document: `thingc.toml`, or the `[tool.thingc]` table of a `pyproject.toml`."""

import re
from typing import Annotated, Literal

from pydantic import Field

from thingc.base.package_info import MAINTAINER, MEMORY, VERSION, one_line
from thingc.documents.spec.base import Model, optional
from thingc.documents.spec.fields import AngleField, LengthField, TimeField, text_field


class SimulationMeshSpec(Model):
    """Tolerances for meshing curved surfaces for simulators."""

    linear: LengthField | None = None
    """Largest distance between mesh and surface; default: 0.1 mm, or the value of `mesh` if it is larger."""
    angular: AngleField | None = None
    """Largest angle between neighbouring facets; default: 30 deg, or the value of `mesh` if it is larger."""


class MeshSpec(Model):
    """Tolerances for meshing curved surfaces for printing and clearance checks."""

    linear: LengthField | None = None
    """Largest distance between mesh and surface; default: 0.1 mm."""
    angular: AngleField | None = None
    """Largest angle between neighbouring facets; default: 10 deg."""
    simulation: SimulationMeshSpec | None = optional({"linear": "0.1 mm", "angular": "30 deg"})
    """Tolerances for the visual and collision meshes of simulators."""


def _is_maintainer(text: str) -> bool:
    person = re.fullmatch(MAINTAINER, text)
    return person is not None and one_line(person[1])


MemoryField = Annotated[str, text_field(re.compile(MEMORY).fullmatch, "an amount of memory", "4 GB", {"pattern": f"^{MEMORY}$"})]
MaintainerField = Annotated[str, text_field(
    _is_maintainer, "a name and a mail address in `<>`", "Ada Lovelace <ada@example.org>", {"pattern": f"^{MAINTAINER}$"},
    description="a name and a mail address",
)]
LicenseField = Annotated[str, text_field(one_line, "a license on one line", "Apache-2.0", {"pattern": r"\S"}, description="a license")]
VersionField = Annotated[str, text_field(
    re.compile(VERSION).fullmatch, "three whole numbers separated by dots", '"1.0.0"', {"pattern": f"^{VERSION}$"}, description="a version",
)]


class AboutSpec(Model):
    """Metadata of the ROS packages of `--emit ros` and of USD files."""

    maintainer: MaintainerField | None = optional("Ada Lovelace <ada@example.org>")
    """Maintainer: a name and a mail address; default: `TODO <todo@todo.todo>`."""
    license: LicenseField | None = optional("Apache-2.0")
    """License; default: `TODO: License declaration`."""
    version: VersionField | None = optional("1.0.0")
    """Version; default: 0.0.0."""


class WorkspaceSpec(Model):
    """The folders in which thingc looks for parts, and the settings of builds."""

    thingc: Literal["workspace/1"]
    """Kind and version of this document."""
    parts: list[str] = Field(default=["parts"], examples=[["parts"]])
    """Folders with the Python modules that `part:` can name."""
    packages: list[str] = Field(default=["thingc_stock", "bd_warehouse"], examples=[["thingc_stock", "bd_warehouse"]])
    """Installed packages that `part:` can name."""
    build: str = Field(default="build", examples=["build"])
    """The folder of build outputs."""
    emit: list[str] = Field(default=[], examples=[["mjcf", "step", "urdf"], ["all"]])
    """Default of the option `--emit` of `thingc build`. Without this key, all targets that need not be named explicitly are written."""
    mesh_uri: Literal["relative", "package", "absolute"] = Field(default="relative", examples=["package"])
    """Paths of meshes in URDF files: relative to the file, in the ROS package of the robot, or absolute on this machine."""
    about: AboutSpec | None = optional({"maintainer": "Ada Lovelace <ada@example.org>", "license": "Apache-2.0"})
    """Metadata of the ROS packages of `--emit ros` and of USD files."""
    compat: list[Literal["mjx", "warp", "drake", "pymjcf"]] = Field(default=[], examples=[["mjx"]])
    """Default of `--compat` and `compat=`: programs besides MuJoCo that must be able to read the MuJoCo models."""
    part_timeout: TimeField | None = None
    """Time limit for building one part; default: 120 s."""
    part_memory: MemoryField | None = optional("4 GB")
    """Memory limit for building one part; default: half of the machine's memory."""
    bed: Annotated[list[LengthField], Field(min_length=3, max_length=3)] | None = optional(["250 mm", "210 mm", "210 mm"])
    """Size of the print bed of `--emit 3mf`, and the largest height of a print; default: 250 mm, 210 mm, 210 mm."""
    mesh: MeshSpec | None = optional({"linear": "0.1 mm", "angular": "10 deg"})
