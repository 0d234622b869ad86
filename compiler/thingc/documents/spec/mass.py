"""Mass, centre of mass and inertia of a component as given in a document, with their sources."""

from __future__ import annotations

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
    """`measured`, `vendor`, `estimated`, or `repaired` (by an import, because the original value is physically impossible)."""


class CentreOfMassSpec(Model):
    """The centre of mass of a component and the source of the value."""

    value: Vector3Length
    """The centre of mass."""
    source: Source
    """`measured`, `vendor`, `estimated`, or `repaired` (by an import, because the original value is physically impossible)."""


class InertiaMatrix(Model):
    """The inertia matrix of a component about its centre of mass, along the axes of the component. Products of inertia are 0 by default."""

    ixx: InertiaField
    """Moment about x."""
    iyy: InertiaField
    """Moment about y."""
    izz: InertiaField
    """Moment about z."""
    ixy: InertiaField | Literal[0] = Field(default=0, examples=["1e-6 kg*m^2", 0])
    """Product of x and y."""
    ixz: InertiaField | Literal[0] = Field(default=0, examples=["1e-6 kg*m^2", 0])
    """Product of x and z."""
    iyz: InertiaField | Literal[0] = Field(default=0, examples=["1e-6 kg*m^2", 0])
    """Product of y and z."""


class InertiaSpec(Model):
    """The inertia of a component and the source of the value."""

    value: InertiaMatrix = Field(examples=[{"ixx": "2e-5 kg*m^2", "iyy": "2e-5 kg*m^2", "izz": "3e-5 kg*m^2"}])
    """The inertia."""
    source: Source
    """`measured`, `vendor`, `estimated`, or `repaired` (by an import, because the original value is physically impossible)."""
