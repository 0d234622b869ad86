"""Robots of other formats, read and written as documents: a reader per format, one model of what was read, one writer."""

from __future__ import annotations

from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.updating import Earlier, Update, earlier_import, update

__all__ = ["Earlier", "Imported", "Update", "earlier_import", "import_robot", "update"]
