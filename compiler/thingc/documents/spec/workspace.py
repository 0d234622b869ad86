"""The `workspace/1` document: `thingc.toml`, or the `[tool.thingc]` table of a `pyproject.toml`."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import Field

from thingc.base.package_info import MAINTAINER, MEMORY, VERSION, one_line
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import AngleField, FieldValidator, LengthField, TimeField, fault, found


class SimulationMeshSpec(Model):
    """How finely curved surfaces are meshed for simulators."""

    linear: LengthField | None = None
    """Largest distance between mesh and surface; 0.1 mm unless written, or that of `mesh` where it is larger."""
    angular: AngleField | None = None
    """Largest angle between neighbouring facets; 30 deg unless written, or that of `mesh` where it is larger."""


class MeshSpec(Model):
    """How finely curved surfaces are meshed, to be printed and for checks of clearance."""

    linear: LengthField | None = None
    """Largest distance between mesh and surface; 0.1 mm unless written."""
    angular: AngleField | None = None
    """Largest angle between neighbouring facets; 10 deg unless written."""
    simulation: SimulationMeshSpec | None = Field(default=None, examples=[{"linear": "0.1 mm", "angular": "30 deg"}])
    """The same of what simulators draw and touch."""


def _maintainer(value: Any) -> str:
    if not isinstance(value, str):
        raise fault("type", f"expected a name and a mail address, found {found(value)}", help=_MAINTAINER_HINT)
    person = re.fullmatch(MAINTAINER, value)
    if person is None or not one_line(person[1]):
        raise fault("type", f"expected a name and a mail address in `<>`, found {found(value)}", help=_MAINTAINER_HINT)
    return value


def _license(value: Any) -> str:
    if not isinstance(value, str) or not one_line(value):
        raise fault("type", f"expected a license in one line, found {found(value)}", help="write for example `Apache-2.0`")
    return value


def _version(value: Any) -> str:
    if not isinstance(value, str) or re.fullmatch(VERSION, value) is None:
        raise fault("type", f"expected three whole numbers with dots between, found {found(value)}", help='write for example `"1.0.0"`')
    return value


def _memory(value: Any) -> str:
    if not isinstance(value, str) or re.fullmatch(MEMORY, value) is None:
        raise fault("type", f"expected an amount of memory, found {found(value)}", help="write for example `4 GB`")
    return value


_MAINTAINER_HINT = "write for example `Ada Lovelace <ada@example.org>`"

MemoryField = Annotated[str, FieldValidator(_memory, "an amount of memory", {"type": "string", "pattern": f"^{MEMORY}$"})]
MaintainerField = Annotated[str, FieldValidator(_maintainer, "a name and a mail address", {"type": "string", "pattern": f"^{MAINTAINER}$"})]
LicenseField = Annotated[str, FieldValidator(_license, "a license", {"type": "string", "pattern": r"\S"})]
VersionField = Annotated[str, FieldValidator(_version, "a version", {"type": "string", "pattern": f"^{VERSION}$"})]


class AboutSpec(Model):
    """What the ROS packages of `--emit ros` say of themselves."""

    maintainer: MaintainerField | None = Field(default=None, examples=["Ada Lovelace <ada@example.org>"])
    """Who maintains them: a name and a mail address; `TODO <todo@todo.todo>` unless written."""
    license: LicenseField | None = Field(default=None, examples=["Apache-2.0"])
    """Under which license they are; `TODO: License declaration` unless written."""
    version: VersionField | None = Field(default=None, examples=["1.0.0"])
    """Their version; 0.0.0 unless written."""


class WorkspaceSpec(Model):
    """Where parts are looked for and how they are made."""

    thingc: Literal["workspace/1"]
    """Kind and version of this document."""
    parts: list[str] = Field(default=["parts"], examples=[["parts"]])
    """Folders whose modules may be named in `part:`."""
    packages: list[str] = Field(default=["thingc_stock", "bd_warehouse"], examples=[["thingc_stock", "bd_warehouse"]])
    """Installed packages that may be, too."""
    build: str = Field(default="build", examples=["build"])
    """The folder that builds go to."""
    emit: list[str] = Field(default=[], examples=[["mjcf", "step", "urdf"], ["all"]])
    """What `thingc build` writes unless `--emit` says so; unless written, all that is not only written where it is named."""
    mesh_uri: Literal["relative", "package", "absolute"] = Field(default="relative", examples=["package"])
    """How URDF files name their meshes: relative to the file, in the ROS package of the robot, or where the build lies on this machine."""
    about: AboutSpec | None = Field(default=None, examples=[{"maintainer": "Ada Lovelace <ada@example.org>", "license": "Apache-2.0"}])
    """What the ROS packages of `--emit ros` say of themselves."""
    compat: list[Literal["mjx", "warp", "drake", "pymjcf"]] = Field(default=[], examples=[["mjx"]])
    """The programs besides MuJoCo that read its models, unless `--compat` or `compat=` gives others."""
    part_timeout: TimeField | None = None
    """Longest time for one part; 120 s unless written."""
    part_memory: MemoryField | None = Field(default=None, examples=["4 GB"])
    """Most memory for one part; by default half of the machine's."""
    mesh: MeshSpec | None = Field(default=None, examples=[{"linear": "0.1 mm", "angular": "10 deg"}])
