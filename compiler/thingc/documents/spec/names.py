"""The `names:` block of an `assembly/1` document."""

from typing import Annotated, Any

from pydantic import Field

from thingc.base.export_names import LONGEST, is_file_name
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import FieldValidator, describe, fault
from thingc.documents.spec.name_types import DrivenKey, OwnComponentKey, OwnExportKey, OwnJointKey, OwnPoseKey, OwnTendonKey, SensorKey


def _file_name(value: Any) -> str:
    """Validate a name in output files."""
    if not isinstance(value, str):
        raise fault("type", f"expected a name, found {describe(value)}", help="put the name in quotes")
    if not is_file_name(value):
        raise fault(
            "name", f"expected a name, found {describe(value)}",
            help=f"write a single line of at most {LONGEST} characters, without leading or trailing spaces",
        )
    return value


_FILE_NAME_SCHEMA = {
    "type": "string", "minLength": 1, "maxLength": LONGEST, "examples": ["left-arm"],
    "description": "The name in files: one line of text.",
}

FileName = Annotated[str, FieldValidator(_file_name, "a name in files", _FILE_NAME_SCHEMA)]


class NamesSpec(Model):
    """The names of elements in output files, if they differ from the names in the document.

    For example, an imported robot keeps its original names.
    """

    components: dict[OwnComponentKey, FileName] = Field(default={}, examples=[{"left_arm": "left-arm"}])
    """Names of components, and of the links with the same names."""
    mounts: dict[OwnExportKey, FileName] = Field(default={}, examples=[{"tool": "tool.0"}])
    """Names of mounts that this document exports."""
    joints: dict[OwnJointKey, FileName] = Field(default={}, examples=[{"joint_1": "1"}])
    """Names of joints. For a joint with several coordinates, the index is appended to the name."""
    tendons: dict[OwnTendonKey, FileName] = Field(default={}, examples=[{"cable": "cable.0"}])
    """Names of tendons."""
    actuators: dict[DrivenKey, FileName] = Field(default={}, examples=[{"knee": "knee_motor"}])
    """Names of drives in MuJoCo models, by joint or tendon; default: the name of the joint or tendon."""
    equalities: dict[OwnJointKey, FileName] = Field(default={}, examples=[{"finger": "coupling"}])
    """Names of equalities in MuJoCo models, by the joint that mimics another joint or closes a loop."""
    sensors: dict[SensorKey, FileName] = Field(default={}, examples=[{"imu": "torso-imu", "imu:gyro": "torso_gyro"}])
    """Names of sensors, or of single readings of a sensor in MuJoCo: `imu:gyro`."""
    poses: dict[OwnPoseKey, FileName] = Field(default={}, examples=[{"home": "home pose"}])
    """Names of poses."""
