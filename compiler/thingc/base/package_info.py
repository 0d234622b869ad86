"""Metadata of the generated ROS packages and USD files: maintainer, email address, license and version."""

from __future__ import annotations

import re
from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct

MAINTAINER = r"([^<>\s][^<>]{0,200}?)\s{0,10}<([A-Za-z0-9_%+-]+(?:\.[A-Za-z0-9_%+-]+)*@[A-Za-z0-9%-]+(?:\.[A-Za-z0-9%-]+)*\.[A-Za-z]{2,})>"
"""Pattern of a maintainer: a name and an email address, which ROS requires."""
MEMORY = r"([1-9][0-9]{0,5}) ?(MB|GB)"
"""Pattern of an amount of memory."""
VERSION = r"[0-9]+\.[0-9]+\.[0-9]+"
"""Pattern of a package version (REP 149)."""
KEYS = frozenset({"maintainer", "license", "version"})
"""Keys of the package metadata in a workspace file."""


class PackageInfo(FrozenStruct):
    """Metadata of a generated ROS package: the name and email address of its maintainer, its license and its version."""

    maintainer: str = "TODO"
    mail: str = "todo@todo.todo"
    license: str = "TODO: License declaration"
    version: str = "0.0.0"

    @staticmethod
    def of(texts: Mapping[str, str]) -> PackageInfo:
        """Create the package metadata from the strings in the workspace file `thingc.toml`, by key.

        Missing values are replaced by the placeholders that `ros2 pkg create` writes. Raises `ValueError` or `TypeError` for invalid
        strings.
        """
        if not all(isinstance(text, str) for text in texts.values()):
            raise TypeError
        fields = dict(texts)
        if "maintainer" in fields:
            person = re.fullmatch(MAINTAINER, fields["maintainer"])
            if person is None or not one_line(person[1]):
                raise ValueError
            fields |= {"maintainer": person[1], "mail": person[2]}
        info = PackageInfo(**fields)
        if not one_line(info.license) or re.fullmatch(VERSION, info.version) is None:
            raise ValueError
        return info


def one_line(text: str) -> bool:
    """Return whether a string consists of printable characters on a single line and is not blank."""
    return bool(text.strip()) and text.isprintable()
