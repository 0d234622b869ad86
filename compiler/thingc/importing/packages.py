"""Where the files of a robot are that its file names: `package://NAME/...`, `model://NAME/...`, `file://...`, or beside it."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator, Mapping
from urllib.parse import unquote

from thingc.diagnostics import shown_path

MOST_BYTES = 200_000_000
MANIFEST = "package.xml"
_NAME_OF = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")


class NotFound(Exception):
    """A file that is not there, or may not be read: why, and what to do, in words."""

    def __init__(self, message: str, help: str | None = None) -> None:
        super().__init__(message)
        self.help = help


class Packages:
    """Finds files for the file at `source`, an absolute path. `given` are folders of packages by name, which are looked in first; what is
    nowhere may be in `meshes`, a folder seen from that of the file, under its name alone."""

    def __init__(self, source: str, given: Mapping[str, str], environment: Mapping[str, str], meshes: str | None = None) -> None:
        self.folder, self.meshes = os.path.dirname(source), meshes
        self.given, self.environment = given, environment

    def find(self, uri: str) -> str:
        """The absolute path of the file that is meant. Raises `NotFound`."""
        try:
            return self._named(uri)
        except NotFound as fault:
            if (slashed := uri.replace("\\", "/")) != uri:
                raise NotFound(str(fault), f"write `/` between folders: `{slashed}`") from None
            if self.meshes is None:
                raise
            path = os.path.normpath(os.path.join(self.folder, self.meshes, os.path.basename(uri)))
            if os.path.isabs(self.meshes) or not _within(path, self._home()) or not os.path.isfile(path):
                raise
            return _file(path, uri)

    def _named(self, uri: str) -> str:
        scheme, colon, rest = uri.partition("://")
        if not colon:
            path = os.path.normpath(os.path.join(self.folder, uri))
            if os.path.isabs(uri) or not _within(path, self._home()):
                raise NotFound(f"`{uri}` leads out of the robot's folder, `{shown_path(self._home())}`", "write `package://NAME/...`")
            return _file(path, uri)
        if scheme == "file":
            return _file(os.path.normpath(unquote(rest)), uri)
        if scheme not in ("package", "model"):
            raise NotFound(f"`{uri}` is no file of this machine", "write `package://NAME/...`, or a path beside the robot's file")
        name, _, inside = rest.lstrip("/").partition("/")  # some files have three slashes
        if not inside:  # which is how some name a file of no package
            return self._named(name)
        there = self._folders(name)
        for place in there:
            path = os.path.normpath(os.path.join(place, inside))
            if not _within(path, place):
                raise NotFound(f"`{uri}` leads out of its package, `{shown_path(place)}`")
            if os.path.lexists(path):
                return _file(path, uri)
        raise NotFound(
            f"the package `{name}` has no `{inside}`; looked in {', '.join(f'`{shown_path(place)}`' for place in there[:6])}",
            f"say where it is: `--package {name}=DIR`",
        )

    def package(self, name: str) -> str:
        """The absolute path of a package. Raises `NotFound`."""
        return self._folders(name)[0]

    def _folders(self, name: str) -> list[str]:
        """The folders that are a package of that name, the best first; at least one. Raises `NotFound`."""
        looked = [*dict.fromkeys(self._places(name))]
        there = [place for place in looked if os.path.isdir(place)]
        if not there:
            raise NotFound(
                f"there is no package `{name}`; looked for {', '.join(f'`{shown_path(place)}`' for place in looked[:6])}",
                f"say where it is: `--package {name}=DIR`",
            )
        return there

    def _above(self) -> Iterator[str]:
        folder = self.folder
        while True:
            yield folder
            parent = os.path.dirname(folder)
            if parent == folder:
                return
            folder = parent

    def _home(self) -> str:
        """The folder that relative paths stay in: that of the package around the file, else the one above its own."""
        packaged = next((folder for folder in self._above() if os.path.isfile(os.path.join(folder, MANIFEST))), None)
        return packaged or os.path.dirname(self.folder)

    def _places(self, name: str) -> Iterator[str]:
        """Where a package may be, the best first."""
        if name in self.given:
            yield os.path.abspath(self.given[name])
            return
        for folder in self._above():
            if os.path.basename(folder) == name or _called(folder) == name:
                yield folder
            yield os.path.join(folder, name)
        for variable, below in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
            for folder in filter(None, self.environment.get(variable, "").split(os.pathsep)):
                yield os.path.join(folder, below, name)


def _called(folder: str) -> str | None:
    """The name of the package whose manifest lies in a folder."""
    try:
        with open(os.path.join(folder, MANIFEST), "rb") as stream:
            match = _NAME_OF.search(stream.read(100_000))
    except OSError:
        return None
    return None if match is None else match[1].decode("utf-8", "replace")


def _within(path: str, folder: str) -> bool:
    return os.path.realpath(path).startswith(os.path.join(os.path.realpath(folder), ""))


def _file(path: str, uri: str) -> str:
    try:
        state = os.stat(path)
    except (OSError, ValueError):
        raise NotFound(f"there is no file `{uri}`; looked for `{shown_path(path)}`") from None
    if not stat.S_ISREG(state.st_mode):
        raise NotFound(f"`{uri}` is no file")
    if state.st_size > MOST_BYTES:
        raise NotFound(f"`{uri}` has {state.st_size:,} bytes, and {MOST_BYTES:,} are read at most", "use a mesh with fewer facets")
    return path
