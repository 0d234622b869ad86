"""What part authors write with: Things, mounts, parameters with units. Imports nothing of the rest of the compiler."""

from __future__ import annotations
