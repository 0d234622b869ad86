"""The model of a position and an orientation, which other document models use."""

from typing import Annotated

from pydantic import ConfigDict, Field

from thingc.documents.spec.base import Model, optional, rule
from thingc.documents.spec.fields import NumberField, Vector3Angle, Vector3Length


class PoseSpec(Model):
    """A position and an orientation in a frame."""

    model_config = ConfigDict(json_schema_extra={"not": {"required": ["rpy", "quat"]}})

    xyz: Vector3Length = (0, 0, 0)  # type: ignore[assignment]
    """Position along x, y and z of the frame."""
    rpy: Vector3Angle = (0, 0, 0)  # type: ignore[assignment]
    """Extrinsic roll, pitch, yaw, as in URDF."""
    quat: Annotated[list[NumberField], Field(min_length=4, max_length=4)] | None = optional([0.5, 0.5, 0.5, 0.5])
    """Instead of `rpy`, the unit quaternion w, x, y, z, as in MJCF."""

    def _check_rules(self) -> None:
        if self.quat is not None and "rpy" in self.model_fields_set:
            raise rule("an orientation cannot have both `rpy` and `quat`", "remove `rpy` or `quat`", "quat")
