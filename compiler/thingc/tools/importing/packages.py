"""Find the files that a robot description refers to by a URI: `package://NAME/...`, `model://NAME/...`, `file://...`, or a relative path.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from glob import escape, glob
from pathlib import Path
from urllib.parse import unquote

from thingc.base.diagnostics import shown_path
from thingc.base.filesystem import beginning
from thingc.base.suggestions import Hint

MOST_BYTES = 200_000_000
MANIFEST = "package.xml"
VARIABLES = (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share"), ("GZ_SIM_RESOURCE_PATH", ""), ("GAZEBO_MODEL_PATH", ""))
"""Environment variables that list folders, and the subfolder of each folder that contains the packages."""
SUBFOLDERS = ("cfg", "mjcf", "robots", "sdf", "urdf", "xacro", "xml")
"""Usual names of the folders that contain model files. Meshes are usually in sibling folders."""
_NAME_OF = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")


class NotFound(Exception):
    """Raised if a file does not exist, or if the import is not allowed to read the file.

    The exception contains an error message and a hint.
    """

    def __init__(self, message: str, help: Hint | None = None) -> None:
        super().__init__(message)
        self.help = help


class Packages:
    """Finds the ROS packages, Gazebo models and files that a robot description refers to.

    `source` is the absolute path of the robot description. `given` maps package names to folders, and has precedence over environment
    variables. If a file is missing, the method `find` searches the folders `given`, `roots` and `meshes` for a file whose path has the same
    end. After symbolic links are resolved, every file must be below the folder of the source, a known package, or a folder in `given` or
    `roots`.
    """

    def __init__(
        self, source: str, given: Mapping[str, str], environment: Mapping[str, str], roots: Sequence[str] = (), meshes: str | None = None,
    ) -> None:
        self.folder, self.given = os.path.dirname(source), {name: os.path.abspath(folder) for name, folder in given.items()}
        self.searched = [*roots] if meshes is None else [*roots, os.path.join(self.folder, meshes)]
        self.shared = [
            os.path.join(folder, below) for name, below in VARIABLES for folder in environment.get(name, "").split(os.pathsep) if folder
        ]
        above = os.path.dirname(self.folder)
        inner = os.path.basename(self.folder).lower() in SUBFOLDERS and os.path.dirname(above) != os.path.dirname(os.path.dirname(above))
        self.home = next(filter(_is_package, self._above()), above if inner else self.folder)
        self.allowed = (self.home, *self.given.values(), *roots, *self.shared)

    def find(self, uri: str) -> str:
        """Return the absolute path of the file that a URI refers to. Raises `NotFound` if the file is missing or must not be read."""
        scheme, _, rest = uri.rpartition("://")
        if scheme not in ("", "file", "package", "model"):
            raise NotFound(f"`{uri}` is not a local file", "write `package://NAME/...`, or a path relative to the robot's file")
        name, _, inside = rest.lstrip("/").partition("/")  # some URIs have three slashes
        places: list[str] = []
        if scheme in ("package", "model") and inside and name != "..":
            places = self._folders(name)
            fault = self._unknown(name) if not places else NotFound(
                f"the package `{name}` does not contain `{inside}` (searched: {_format_paths(places)})", f"use `--package {name}=DIR`",
            )
            named = [os.path.join(place, inside) for place in places]
        else:
            rest = unquote(rest) if scheme == "file" else rest.lstrip("/") if scheme else rest
            named = [os.path.join(self.folder, rest)]
            fault = NotFound(
                f"there is no file `{uri}` (searched: {_format_paths(named)})", "specify the folder of the file: `--mesh-root DIR`"
            )
        words = [word for word in rest.split("/") if word not in ("", ".", "..")]
        named += [os.path.join(self.given[word], *words[k:]) for k, word in enumerate(words[:-1], 1) if word in self.given]
        named += [os.path.join(root, *words[k:]) for root in self.searched for k in range(len(words))]
        for path in map(os.path.normpath, named):
            if os.path.lexists(path):
                if any(within(path, folder) for folder in (*self.allowed, *filter(_is_package, places))):
                    return _file(path, uri)
                fault = NotFound(
                    f"`{uri}` is outside the robot's folder (`{shown_path(self.home)}`)",
                    "specify the folder of a trusted file: `--mesh-root DIR`, or `--package NAME=DIR`",
                )
        slashed = uri.replace("\\", "/")
        raise fault if slashed == uri else NotFound(str(fault), f"write `/` between folders: `{slashed}`")

    def read(self, uri: str) -> tuple[str, bytes]:
        """Return the absolute path and the content of the file that a URI refers to.

        Raises `NotFound` if the file is missing or cannot be read.
        """
        path = self.find(uri)
        try:
            return path, beginning(path, MOST_BYTES)
        except OSError as fault:
            raise NotFound(f"cannot read `{uri}`: {(fault.strerror or str(fault)).lower()}") from None

    def package(self, name: str) -> str:
        """Return the absolute path of the package with this name. Raises `NotFound` if the package is unknown."""
        for place in self._folders(name):
            return place
        raise self._unknown(name)

    def _unknown(self, name: str) -> NotFound:
        looked = _format_paths([*dict.fromkeys(self._places(name))])
        return NotFound(f"there is no package `{name}` (searched: {looked})", f"specify the folder of the package: `--package {name}=DIR`")

    def _folders(self, name: str) -> list[str]:
        """Return the existing folders that may contain a package, in order of precedence."""
        return [place for place in dict.fromkeys(self._places(name)) if os.path.isdir(place)]

    def _above(self) -> Iterator[str]:
        """Yield the folder of the robot description, followed by all parent folders."""
        folder = Path(self.folder)
        return map(str, (folder, *folder.parents))

    def readable(self) -> list[str]:
        """Return the folders from which expressions in the robot description may read files.

        The result contains the folder of the robot description, all known packages, and packages next to this folder or to one of its
        parent folders.
        """
        beside = (found for folder in self._above() for found in glob(os.path.join(escape(folder), "*", MANIFEST)))
        return [*self.allowed, *map(os.path.dirname, beside)]

    def _places(self, name: str) -> Iterator[str]:
        """Yield the paths at which a package may be located, in order of precedence."""
        if name in self.given:
            yield self.given[name]
            return
        for folder in self._above():
            if os.path.basename(folder) == name or _package_name(folder) == name:
                yield folder
            yield os.path.join(folder, name)
        yield from (os.path.join(folder, name) for folder in self.shared)


def _is_package(folder: str) -> bool:
    """Return whether a folder is a ROS package or a Gazebo model."""
    return any(os.path.isfile(os.path.join(folder, manifest)) for manifest in (MANIFEST, "model.config"))


def _format_paths(paths: Sequence[str]) -> str:
    return ", ".join(f"`{shown_path(path)}`" for path in paths[:6])


def _package_name(folder: str) -> str | None:
    """Return the name of a package according to the manifest in its folder. Return None if the folder has no manifest."""
    try:
        with open(os.path.join(folder, MANIFEST), "rb") as stream:
            match = _NAME_OF.search(stream.read(100_000))
    except OSError:
        return None
    return None if match is None else match[1].decode("utf-8", "replace")


def within(path: str, folder: str) -> bool:
    """Return whether a path is inside a folder. Symbolic links are resolved first."""
    return os.path.realpath(path).startswith(os.path.join(os.path.realpath(folder), ""))


def _file(path: str, uri: str) -> str:
    try:
        state = os.stat(path)
    except (OSError, ValueError):
        raise NotFound(f"there is no file `{uri}` (searched: `{shown_path(path)}`)") from None
    if not stat.S_ISREG(state.st_mode):
        raise NotFound(f"`{uri}` is not a file")
    if state.st_size > MOST_BYTES:
        message = f"the size of `{uri}` ({state.st_size:,} bytes) exceeds the maximum ({MOST_BYTES:,} bytes)"
        raise NotFound(message, "use a mesh with fewer facets")
    return path
