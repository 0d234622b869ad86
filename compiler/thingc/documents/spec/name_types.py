"""Types of fields and keys that declare a name, or name something that is declared elsewhere.

What a text names is said once, here, by its type: `spec.mentions` finds it in documents, and who follows names (rename, go to the
definition) has no list of keys of its own. A field of text that names nothing is one of the few that `tests/spec/test_mentions.py` lists.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from thingc.base.frozen import dataclass
from thingc.documents.spec.fields import JointValueField, Name, ReferenceField

Declared = Literal[
    "component", "export", "index", "joint", "link", "material", "mode", "mount", "parameter", "pose", "sensor", "tendon", "test",
]
"""What a document declares by a name: `export` is a mount that it shows to a parent assembly, `index` that of a `repeat`."""
Meant = Literal[
    "assembly document", "choice", "component", "coordinate", "coordinate or tendon", "expression", "joint", "joint or nested assembly",
    "material", "materials document", "mode", "modes", "mount", "mount of its own", "mount or export", "parameter of a nested assembly",
    "parameter of a part", "part", "pose", "pose of a nested assembly", "poses", "raw", "root", "rule", "sensor", "setting", "tendon",
]
"""What a text may mean. `coordinate` is one of a joint of the same document; `modes` and `poses` are names, patterns or `all`; `setting` is
a parameter or the path of anything else in an assembly, `choice` what is set at such a path, `rule` a comparison over such and over
results; `raw` is an element of a file that a target writes."""


RESERVED = frozenset({"world", "root", "origin"})
"""Names that nothing in a document may have: they have a meaning."""


@dataclass(frozen=True, slots=True)
class Declares:
    """Of a key or a text: it declares a name."""

    what: Declared


@dataclass(frozen=True, slots=True)
class Means:
    """Of a key or a text: it names something."""

    what: Meant


NewComponent = Annotated[Name, Declares("component")]
NewExport = Annotated[Name, Declares("export")]
NewIndex = Annotated[Name, Declares("index")]
NewJoint = Annotated[Name, Declares("joint")]
NewLink = Annotated[Name, Declares("link")]
NewMaterial = Annotated[Name, Declares("material")]
NewMode = Annotated[Name, Declares("mode")]
NewMount = Annotated[Name, Declares("mount")]
NewParameter = Annotated[Name, Declares("parameter")]
NewPose = Annotated[Name, Declares("pose")]
NewSensor = Annotated[Name, Declares("sensor")]
NewTendon = Annotated[Name, Declares("tendon")]
NewTest = Annotated[Name, Declares("test")]

AssemblyDocument = Annotated[str, Means("assembly document")]
ComponentField = Annotated[ReferenceField, Means("component")]
CoordinateField = Annotated[ReferenceField, Means("coordinate")]
CoordinateKey = Annotated[str, Means("coordinate")]
DrivenKey = Annotated[str, Means("coordinate or tendon")]
JointField = Annotated[ReferenceField, Means("joint")]
JointKey = Annotated[str, Means("joint or nested assembly")]
JointPattern = Annotated[str, Means("joint")]
MaterialField = Annotated[str, Means("material")]
MaterialsDocument = Annotated[str, Means("materials document")]
ModeField = Annotated[Name, Means("mode")]
MountField = Annotated[ReferenceField, Means("mount")]
NestedParameter = Annotated[str, Means("parameter of a nested assembly")]
OwnComponentKey = Annotated[str, Means("component")]
OwnExportKey = Annotated[str, Means("mount or export")]
OwnJointKey = Annotated[str, Means("joint")]
OwnPoseKey = Annotated[str, Means("pose")]
OwnTendonKey = Annotated[str, Means("tendon")]
OwnMountField = Annotated[ReferenceField, Means("mount of its own")]
OwnMountKey = Annotated[str, Means("mount of its own")]
PartField = Annotated[str, Means("part")]
PartParameter = Annotated[str, Means("parameter of a part")]
PoseField = Annotated[Name, Means("pose")]
RootField = Annotated[ReferenceField, Means("root")]
SensorKey = Annotated[str, Means("sensor")]
ShownMountField = Annotated[ReferenceField, Means("mount or export")]
TendonField = Annotated[Name, Means("tendon")]
PoseValueField = Annotated[JointValueField, Means("pose of a nested assembly")]
ModeNames = Annotated[str, Means("modes")] | Annotated[list[Annotated[str, Means("modes")]], Field(min_length=1)]
PoseNames = Annotated[str, Means("poses")] | Annotated[list[Annotated[str, Means("poses")]], Field(min_length=1)]
JointNames = JointPattern | Annotated[list[JointPattern], Field(min_length=1)]
"""Names, patterns or `all`, alone or several."""
