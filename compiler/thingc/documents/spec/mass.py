"""Mass, centre of mass and inertia of a component in a document, each with the source of the value."""

from typing import Literal

from pydantic import Field

from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import InertiaField, MassField, Vector3Length

Source = Literal["measured", "vendor", "estimated", "repaired"]


class MassSpec(Model):
    """The mass of a component and the source of the value."""

    value: MassField
    """The mass."""
    source: Source
    """`measured`, `vendor`, `estimated`, or `repaired` (an import replaced a physically impossible value)."""


class CentreOfMassSpec(Model):
    """The centre of mass of a component and the source of the value."""

    value: Vector3Length
    """The centre of mass."""
    source: Source
    """`measured`, `vendor`, `estimated`, or `repaired` (an import replaced a physically impossible value)."""


class InertiaMatrix(Model):
    """The inertia matrix of a component about its centre of mass, along the axes of the component. Products of inertia are 0 by default."""

    ixx: InertiaField
    """Moment of inertia about the x axis."""
    iyy: InertiaField
    """Moment of inertia about the y axis."""
    izz: InertiaField
    """Moment of inertia about the z axis."""
    ixy: InertiaField | Literal[0] = Field(default=0, examples=["1e-6 kg*m^2", 0])
    """Product of inertia for x and y."""
    ixz: InertiaField | Literal[0] = Field(default=0, examples=["1e-6 kg*m^2", 0])
    """Product of inertia for x and z."""
    iyz: InertiaField | Literal[0] = Field(default=0, examples=["1e-6 kg*m^2", 0])
    """Product of inertia for y and z."""


class InertiaSpec(Model):
    """The inertia of a component and the source of the value."""

    value: InertiaMatrix = Field(examples=[{"ixx": "2e-5 kg*m^2", "iyy": "2e-5 kg*m^2", "izz": "3e-5 kg*m^2"}])
    """The inertia."""
    source: Source
    """`measured`, `vendor`, `estimated`, or `repaired` (an import replaced a physically impossible value)."""
