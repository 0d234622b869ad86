"""What ROS packages say of themselves: who maintains them, their license and version."""

from __future__ import annotations

import re
from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct

MAINTAINER = r"([^<>\s][^<>]{0,200}?)\s{0,10}<([A-Za-z0-9_%+-]+(?:\.[A-Za-z0-9_%+-]+)*@[A-Za-z0-9%-]+(?:\.[A-Za-z0-9%-]+)*\.[A-Za-z]{2,})>"
"""Who maintains a package: a name and, as ROS demands it, a mail address."""
MEMORY = r"([1-9][0-9]{0,5}) ?(MB|GB)"
"""An amount of memory."""
VERSION = r"[0-9]+\.[0-9]+\.[0-9]+"
"""The version of a package (REP 149)."""
KEYS = frozenset({"maintainer", "license", "version"})
"""What a workspace file may say of a package."""


class PackageInfo(FrozenStruct):
    """What a ROS package says of itself: the name and `mail` of its `maintainer`, its `license` and its `version`."""

    maintainer: str = "TODO"
    mail: str = "todo@todo.todo"
    license: str = "TODO: License declaration"
    version: str = "0.0.0"

    @staticmethod
    def of(texts: Mapping[str, str]) -> PackageInfo:
        """What a workspace file says of it, by key; what it does not say is what `ros2 pkg create` writes, to be replaced. Raises
        `ValueError` or `TypeError` where a text is not what it should be."""
        if not all(isinstance(text, str) for text in texts.values()):
            raise TypeError
        said = dict(texts)
        if "maintainer" in said:
            person = re.fullmatch(MAINTAINER, said["maintainer"])
            if person is None or not one_line(person[1]):
                raise ValueError
            said |= {"maintainer": person[1], "mail": person[2]}
        if ("license" in said and not one_line(said["license"])) or ("version" in said and re.fullmatch(VERSION, said["version"]) is None):
            raise ValueError
        return PackageInfo(**said)


def one_line(text: str) -> bool:
    """Whether a text has something to read, and nothing that cannot be seen."""
    return bool(text.strip()) and text.isprintable()
