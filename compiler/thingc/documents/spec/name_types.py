"""The types of model fields whose keys or values declare a name or refer to a name.

No other types determine to which kind of name a string refers. The module `documents/names/document_names.py` reads the types, so the
editor commands "rename" and "go to definition" do not need lists of keys. The test `tests/spec/test_mentions.py` lists all other string
fields.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from thingc.base.frozen_struct import FrozenStruct
from thingc.documents.spec.fields import JointValueField, Name, ReferenceField

Declared = Literal[
    "component", "export", "index", "joint", "link", "material", "mode", "motion", "mount", "parameter", "pose", "sensor", "tendon", "test",
    "transmission",
]
"""Kinds of names that documents declare. `export` is a mount that is exported to a parent assembly, and `index` is the index of a `repeat`.
"""
ReferenceKind = Literal[
    "assembly document", "choice", "component", "coordinate", "coordinate or tendon", "expression", "joint", "joint or nested assembly",
    "material", "materials document", "mode", "mode of a nested assembly", "modes", "motion", "mount", "mount of its own",
    "mount or export", "parameter of a nested assembly", "parameter of a part", "part", "pose", "pose of a nested assembly",
    "pose of this nested assembly", "poses", "raw", "root", "rule", "sensor", "setting", "tendon",
]
"""Kinds of references in documents.

`coordinate` refers to a coordinate of a joint in the same document. `modes` and `poses` refer to one or several elements by names, patterns
or `all`. `setting` is a parameter or the path of a value in an assembly, `choice` is the value at such a path, and `rule` is a comparison
of settings and results. `raw` refers to an element of an output file.
"""


RESERVED = frozenset({"world", "root", "origin"})
"""Names with a special meaning, which users cannot give to elements."""


class DeclaresName(FrozenStruct, kw_only=False):
    """An annotation for fields of document models whose key or string declares a name."""

    kind: Declared


class RefersTo(FrozenStruct, kw_only=False):
    """An annotation for fields of document models whose key or string refers to a name."""

    kind: ReferenceKind


NewComponent = Annotated[Name, DeclaresName("component")]
NewExport = Annotated[Name, DeclaresName("export")]
NewIndex = Annotated[Name, DeclaresName("index")]
NewJoint = Annotated[Name, DeclaresName("joint")]
NewLink = Annotated[Name, DeclaresName("link")]
NewMaterial = Annotated[Name, DeclaresName("material")]
NewMode = Annotated[Name, DeclaresName("mode")]
NewMotion = Annotated[Name, DeclaresName("motion")]
NewMount = Annotated[Name, DeclaresName("mount")]
NewParameter = Annotated[Name, DeclaresName("parameter")]
NewPose = Annotated[Name, DeclaresName("pose")]
NewSensor = Annotated[Name, DeclaresName("sensor")]
NewTendon = Annotated[Name, DeclaresName("tendon")]
NewTest = Annotated[Name, DeclaresName("test")]
NewTransmission = Annotated[Name, DeclaresName("transmission")]

AssemblyDocument = Annotated[str, RefersTo("assembly document")]
ComponentField = Annotated[ReferenceField, RefersTo("component")]
CoordinateField = Annotated[ReferenceField, RefersTo("coordinate")]
CoordinateKey = Annotated[str, RefersTo("coordinate")]
DrivenKey = Annotated[str, RefersTo("coordinate or tendon")]
JointField = Annotated[ReferenceField, RefersTo("joint")]
JointKey = Annotated[str, RefersTo("joint or nested assembly")]
JointPattern = Annotated[str, RefersTo("joint")]
MaterialField = Annotated[str, RefersTo("material")]
MaterialsDocument = Annotated[str, RefersTo("materials document")]
ModeField = Annotated[Name, RefersTo("mode")]
MotionField = Annotated[Name, RefersTo("motion")]
MountField = Annotated[ReferenceField, RefersTo("mount")]
NestedMode = Annotated[Name, RefersTo("mode of a nested assembly")]
NestedParameter = Annotated[str, RefersTo("parameter of a nested assembly")]
NestedPose = Annotated[Name, RefersTo("pose of this nested assembly")]
OwnComponentKey = Annotated[str, RefersTo("component")]
OwnExportKey = Annotated[str, RefersTo("mount or export")]
OwnJointKey = Annotated[str, RefersTo("joint")]
OwnPoseKey = Annotated[str, RefersTo("pose")]
OwnTendonKey = Annotated[str, RefersTo("tendon")]
OwnMountField = Annotated[ReferenceField, RefersTo("mount of its own")]
OwnMountKey = Annotated[str, RefersTo("mount of its own")]
PartField = Annotated[str, RefersTo("part")]
PartParameter = Annotated[str, RefersTo("parameter of a part")]
PoseField = Annotated[Name, RefersTo("pose")]
RootField = Annotated[ReferenceField, RefersTo("root")]
SensorKey = Annotated[str, RefersTo("sensor")]
ShownMountField = Annotated[ReferenceField, RefersTo("mount or export")]
TendonField = Annotated[Name, RefersTo("tendon")]
PoseValueField = Annotated[JointValueField, RefersTo("pose of a nested assembly")]
ModeNames = Annotated[str, RefersTo("modes")] | Annotated[list[Annotated[str, RefersTo("modes")]], Field(min_length=1)]
PoseNames = Annotated[str, RefersTo("poses")] | Annotated[list[Annotated[str, RefersTo("poses")]], Field(min_length=1)]
JointNames = JointPattern | Annotated[list[JointPattern], Field(min_length=1)]
"""A name, a pattern or `all`, or a list of names and patterns."""
