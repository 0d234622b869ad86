"""Record which files a part reads while its code runs.

Python's audit hook reports files that Python opens and folders that it lists. Wrappers of the kernel's readers report files that C++ opens.
A wrapper of `os.stat` reports searches for files that do not exist. `thingc.asset` reports its own files. For each file, its state at the
first use is recorded (`key/file_states.py`).

Paths inside the workspace are stored relative to the workspace. Other paths, such as the path of a font, are stored as absolute paths.
Files of installed packages, of Python and of thingc are not recorded, because the key contains their versions. Files that the part wrote
itself are not recorded. For any other module, the source file is recorded, even if Python read the compiled file. A code file that is
already part of the key is only recorded if the part reads it as text.

Two kinds of reads are not recorded, because they would make a record valid on only one machine. The first kind are searches for modules by
Python and thingc. The results of these searches are already part of the key. The second kind are checks whether the folders above the
workspace exist.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import itertools
import os
import sys
from collections.abc import Callable, Container, Iterable
from types import FrameType
from typing import Any

from thingc.geometry.key.file_states import state_of
from thingc.geometry.key.modules import OWN_FOLDER, installed_roots
from thingc.geometry.record_json import relative_path
from thingc.geometry.worker import audit

_PYTHONS_OWN = ("<", os.path.join(os.path.dirname(os.__file__), ""))
_ON_THE_WAY = (__name__, audit.__name__)
_NOT_FILES = ("/dev/", "/proc/", "/sys/")


class FileReadRecorder:
    """Records which files are read between `start` and `stop`. In each process, at most one recorder is active.

    Paths are stored relative to the absolute folder `workspace`. Files in the folders `excluded` (absolute paths) are not recorded. The
    code files `keyed` (absolute paths) are part of the key. The files in `keyed` are not recorded when Python loads them.
    """

    def __init__(self, workspace: str, excluded: Iterable[str] = (), keyed: Container[str] = ()) -> None:
        self.workspace = os.path.join(os.path.abspath(workspace), "")
        self.keyed = keyed
        self.states: dict[str, str] = {}
        self._excluded = (*_with_versions(), *{os.path.join(folder, "") for folder in (*excluded, *map(os.path.realpath, excluded))})
        self._around = (self.workspace, os.path.join(os.path.realpath(workspace), ""), *self._excluded)
        self._written: set[str] = set()
        self._busy = False

    def start(self) -> None:
        """Begin to record which files are read."""
        global _current
        _install_hook()
        _current = self

    def stop(self) -> None:
        """Stop all recording."""
        global _current
        _current = None

    def note(self, path: Any, *, listed: bool = False, opened: bool = True) -> None:
        """Record that the part read a file. If `opened` is False, the part only checked whether the file exists.

        If `listed` is True, the part listed the names in a folder.
        """
        if _current is not self or self._busy:
            return
        full = _absolute(path)
        if full is None or full.startswith(_NOT_FILES):
            return
        if full.endswith(".pyc"):
            with contextlib.suppress(ValueError):
                full = importlib.util.source_from_cache(full)
        if self._is_own(full) or self.leaves_out(full) or full in self.keyed and (not opened or _loads()):
            return
        if not listed and any(folder.startswith(os.path.join(full, "")) for folder in self._around):
            return
        known_state = self.states.get(full)
        if known_state is not None and not (listed and known_state == "folder"):
            return
        self._busy = True  # do not record the lookups of this method
        try:
            if os.path.realpath(full).startswith(self._excluded):
                return
            state = state_of(full, listed=listed)
            if state != "folder" or full.startswith(self.workspace):  # the existence of other folders does not count
                self.states[full] = state
        finally:
            self._busy = False

    def leaves_out(self, path: str) -> bool:
        """Return whether the recorder ignores a file, for example because a version covers it.

        The path must be absolute. Symbolic links are not resolved.
        """
        return (path + os.sep).startswith(self._excluded)

    def note_written(self, path: Any) -> None:
        """Record that the part is about to write a file or create a folder. Later reads of this file or folder are not recorded."""
        full = _absolute(path)
        if full is None or self.states.get(full, "absent") != "absent":
            return
        self.states.pop(full, None)  # the file was recorded as absent, because the part had not written it yet
        self._written.add(full)

    def _is_own(self, path: str) -> bool:
        """Return whether the part wrote this file, or created a folder that contains it."""
        while path not in self._written:
            path, below = os.path.dirname(path), path
            if path == below:
                return False
        return True

    def reads(self) -> list[tuple[str, str]]:
        """Return sorted pairs `(path, state)` of the files and folders that the part has read."""
        return sorted((self.relative(path), state) for path, state in self.states.items())

    def relative(self, path: str) -> str:
        """Convert an absolute path to a path relative to the workspace, with `/` as separator.

        A path outside of the workspace is unchanged.
        """
        return "." if os.path.join(path, "") == self.workspace else relative_path(path, self.workspace)


def _absolute(path: Any) -> str | None:
    if isinstance(path, int) or path is None:
        return None
    try:
        return os.path.abspath(os.fsdecode(path))
    except (TypeError, ValueError):
        return None


def _with_versions() -> tuple[str, ...]:
    """Return the folders whose files are covered by versions: the folders of Python, of installed packages, and of thingc."""
    archives = [entry for entry in sys.path if entry and not os.path.isdir(entry)]  # Python's own archives, even if they do not exist
    return tuple({os.path.join(folder, "") for folder in (*installed_roots(), *archives, OWN_FOLDER, os.path.realpath(OWN_FOLDER))})


_loaded_before: set[str] = set()
_last_before = ""


def remember_loaded() -> None:
    """Record the modules that this process has loaded so far.

    Call this function before a fork, because reading the modules in a child would copy memory pages.
    """
    global _last_before
    _loaded_before.update(_loaded_since())
    _last_before = next(reversed(sys.modules))


def loaded_files() -> list[str]:
    """Return the sorted files of all modules that this process has loaded, except files that are covered by versions."""
    return sorted(_loaded_before | _loaded_since())


def _loaded_since() -> set[str]:
    """Return the files of modules that were loaded after the last call of `remember_loaded`."""
    fresh = [sys.modules[name] for name in itertools.takewhile(lambda name: name != _last_before, reversed(sys.modules))]
    specifications = [getattr(module, "__dict__", {}).get("__spec__") for module in fresh]
    files = {one.origin for one in specifications if one is not None and one.has_location and one.origin is not None}
    folders = _with_versions()
    return {file for file in files if not (file + os.sep).startswith(folders)}


_current: FileReadRecorder | None = None


@functools.cache
def _install_hook() -> None:
    """Observe file accesses by audit events, and wrap functions of `os` that check whether files exist but raise no audit event.

    These checks are recorded because a missing file may appear later.
    """
    audit.listen(("open", "os.listdir", "os.scandir", "os.mkdir", "sqlite3.connect"), _handle_event)
    for name in ("stat", "lstat", "access"):
        setattr(os, name, _recording_check(getattr(os, name)))


def _handle_event(event: str, arguments: tuple[Any, ...]) -> None:
    if _current is None:
        return
    path = arguments[0]
    if event in ("os.listdir", "os.scandir"):
        if not _looks_for_modules():
            _current.note(path if path is not None else ".", listed=True)
    elif event == "os.mkdir" or event == "open" and audit.writes(*arguments[1:]):
        _current.note_written(path)
    else:
        _current.note(path)


def _recording_check(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def wrapped(path: Any, *arguments: Any, **options: Any) -> Any:
        if _current is not None and options.get("dir_fd") is None and not _looks_for_modules():
            _current.note(path, opened=False)
        return function(path, *arguments, **options)

    return wrapped


def _looks_for_modules() -> bool:
    """Return whether Python's import system or thingc itself called the caller of this function (possibly through `os.path`)."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__") in ("posixpath", "ntpath", "genericpath", "os", *_ON_THE_WAY):
        frame = frame.f_back
    return frame is not None and str(frame.f_globals.get("__name__")).startswith(("importlib.", "thingc."))


def _loads() -> bool:
    """Return whether a file is read by Python or thingc, and not by the part.

    The result depends on the nearest stack frame outside of Python's own code.
    """
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        name = str(frame.f_globals.get("__name__"))
        if name not in _ON_THE_WAY:
            if name == "importlib._bootstrap_external" or name.startswith("thingc."):
                return True
            if not frame.f_code.co_filename.startswith(_PYTHONS_OWN):
                return False
        frame = frame.f_back
    return True


# --- the kernel's readers ---------------------------------------------------------------------------------------------

_IMPORTERS = ("import_brep", "import_step", "import_stl", "import_svg", "import_svg_as_buildline_code", "import_dxf")
_EXPORTERS = ("export_brep", "export_gltf", "export_obj", "export_step", "export_stl")
_KERNEL_READERS = (
    ("OCP.STEPControl", "STEPControl_Reader", "ReadFile"),
    ("OCP.STEPCAFControl", "STEPCAFControl_Reader", "ReadFile"),
    ("OCP.IGESControl", "IGESControl_Reader", "ReadFile"),
    ("OCP.IGESCAFControl", "IGESCAFControl_Reader", "ReadFile"),
    ("OCP.StlAPI", "StlAPI_Reader", "Read"),
    ("OCP.BRepTools", "BRepTools", "Read_s"),
    ("OCP.BinTools", "BinTools", "Read_s"),
    ("OCP.RWStl", "RWStl", "ReadFile_s"),
)
"""Readers of the CAD kernel that part code can use without build123d, as module, class and method. Each string argument of such a method
may be the path of a file.
"""


def wrap_importers() -> None:
    """Wrap all functions that read files into the CAD kernel, and the exporters of build123d.

    The wrapped readers report files to the active recorder. The wrapped exporters raise the same audit event as opening a file. Call this
    function once per process, before part modules are loaded, because these modules may contain `from build123d import *`. Child processes
    inherit the wrapped functions.
    """
    import importlib

    import build123d

    modules = [
        module for name, module in list(sys.modules.items())
        if (name == "build123d" or name.startswith("build123d.")) and module is not None
    ]
    for name in (*_IMPORTERS, *_EXPORTERS):
        original = getattr(build123d, name, None)
        if original is None:
            continue
        wrapped = _recording_read(original, slice(0, 1)) if name in _IMPORTERS else _announcing(original)
        for module in modules:
            if vars(module).get(name) is original:
                setattr(module, name, wrapped)
    mesher = build123d.Mesher
    mesher.read = _recording_read(mesher.read, slice(1, 2))  # type: ignore[method-assign]
    for module_name, class_name, method in _KERNEL_READERS:
        try:
            owner = getattr(importlib.import_module(module_name), class_name)
            wrapped = _recording_read(getattr(owner, method), slice(None))
            setattr(owner, method, staticmethod(wrapped) if method.endswith("_s") else wrapped)
        except (ImportError, AttributeError, TypeError):  # the kernel does not have this method, or it cannot be wrapped
            continue


def _recording_read(function: Callable[..., Any], positions: slice) -> Callable[..., Any]:
    """Wrap a function that reads a file, so that the read is recorded before each call.

    The file is a path among the keyword arguments and the positional arguments at `positions`.
    """

    @functools.wraps(function)
    def wrapped(*arguments: Any, **options: Any) -> Any:
        for value in (*arguments[positions], *options.values()):
            if isinstance(value, (str, bytes, os.PathLike)) and _current is not None:
                _current.note(value)
        return function(*arguments, **options)

    return wrapped


def _announcing(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap `function` so that it first raises the audit event of opening a file. The second argument of `function` is the path of the file
    to write, or a stream.
    """

    @functools.wraps(function)
    def announcing(*arguments: Any, **options: Any) -> Any:
        for value in (*arguments[1:2], options.get("file_path")):
            if isinstance(value, (str, bytes, os.PathLike)):
                sys.audit("open", os.fspath(value), "wb", 0)
        return function(*arguments, **options)

    return announcing
