"""The API for part authors: Things, mounts, parameters with units. Does not import any other part of the compiler."""

from __future__ import annotations
