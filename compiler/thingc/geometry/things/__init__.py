"""The API for part authors: Things, mounts, parameters with units. This package does not import other packages of the compiler."""

from __future__ import annotations
