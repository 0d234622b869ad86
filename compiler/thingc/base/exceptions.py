"""The base class of exceptions that processes can send to each other."""

from __future__ import annotations

import copyreg
from typing import Any


class PicklableError(Exception):
    """Base class of exceptions whose constructor does not have the message as its only argument.

    By default, unpickling calls the constructor with the message. A process pool then breaks if a task raises such an exception.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling: create the exception without its constructor, and copy all attributes."""
        return copyreg.__newobj__, (type(self), *self.args), self.__dict__  # type: ignore[attr-defined]
