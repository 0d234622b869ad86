"""The catalogue of bought parts, which is a CSV file with these columns."""

from typing import Annotated

from thingc.base.bom_values import QUANTITY
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import CostField, LinkField, text_field

_QUANTITY_SCHEMA = {"pattern": f"^{QUANTITY.pattern}$", "description": "A number of pieces.", "examples": ["10"]}
QuantityText = Annotated[str, text_field(QUANTITY.fullmatch, "a positive whole number", "10", _QUANTITY_SCHEMA)]


class CatalogRow(Model):
    """A part of the catalogue, or its price from a larger quantity."""

    number: str
    """The order number, by which components and parts refer to the row."""
    supplier: str | None = None
    """Supplier."""
    cost: CostField | None = None
    """Price per piece."""
    quantity: QuantityText = "1"
    """The smallest quantity for which the price applies; default: 1."""
    link: LinkField | None = None
    """Web page of the part."""
    picture: str | None = None
    """Picture of the part, relative to the catalogue."""


class CatalogSpec(Model):
    """A catalogue of bought parts."""

    rows: list[CatalogRow]
