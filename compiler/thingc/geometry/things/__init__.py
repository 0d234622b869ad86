"""The API for part authors: Things, mounts, parameters with units. Imports no other part of the compiler."""

from __future__ import annotations
