"""Parts that fail in different ways: the other parts are modelled, and the failure points to a line of the part file."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import closing
from typing import Any

import pytest

from realize.conftest import modelled_parts
from thingc.geometry.client import Workers
from thingc.geometry.record import PartFailure, PartRecord

BAD = """\
from build123d import *
from thingc import Length, MountPoint, Thing
import helper, time

class Good(Thing):
    def result(self):
        return Box(1, 2, 3)

class Raises(Thing):
    def __init__(self, width: Length = 3):
        super().__init__()
        helper.check(width)

class RaisesInResult(Thing):
    def result(self):
        assert 1 > 2, "one is not above two"

class Hangs(Thing):
    def __init__(self):
        super().__init__()
        while True:
            time.sleep(0.1)

class Segfaults(Thing):
    def __init__(self):
        super().__init__()
        import ctypes
        ctypes.string_at(0)

class Leaves(Thing):
    def __init__(self):
        super().__init__()
        import os
        os._exit(0)

class Exits(Thing):
    def __init__(self):
        super().__init__()
        raise SystemExit(3)

class Flat(Thing):
    def result(self):
        return Rectangle(10, 10)

class Nothing(Thing):
    def result(self):
        return Part()

class Number(Thing):
    def result(self):
        return 5

class Kernel(Thing):
    def result(self):
        return fillet(Box(1, 1, 1).edges(), 5)

class Warns(Thing):
    def result(self):
        import warnings
        warnings.warn("too thin to print")
        print("to nobody")
        return Box(1, 1, 1)

class BadMass(Thing):
    def result(self):
        return Box(1, 1, 1)

    def mass(self):
        return -1

class Recursion(Thing):
    def result(self):
        return self.result()

class Annotated(Thing):
    def __init__(self, *many):
        super().__init__()

class Misses(Thing):
    def result(self):
        return open(__file__.replace(".py", ".txt"))

not_a_part = 5
"""
HELPER = "def check(width):\n    if width > 2:\n        raise ValueError(f'{width} mm is too wide')\n"
NAMES = (
    "Good", "Raises", "RaisesInResult", "Segfaults", "Leaves", "Exits", "Flat", "Nothing", "Number", "Kernel", "Warns", "BadMass",
    "Recursion", "Misses",
)
EXPECTED = {
    # class: kind, message, file, line (None: of no importance)
    "Raises": ("raised", "ValueError: 3.0 mm is too wide", "helper.py", 3),
    "RaisesInResult": ("raised", "AssertionError: one is not above two", "bad.py", 16),
    "Segfaults": ("crashed", "killed by SIGSEGV", "bad.py", 28),
    "Leaves": ("crashed", "exit status 0", None, None),
    "Exits": ("raised", "SystemExit: 3", "bad.py", 39),
    "Flat": ("empty", "result() contains only faces", None, None),
    "Nothing": ("empty", "result() returned an empty Part", None, None),
    "Number": (
        "invalid", "expected a build123d shape, found 5 in result()", None, None,
    ),
    "Kernel": ("raised", None, "bad.py", 55),
    "BadMass": ("raised", "ValueError: mass() of `BadMass` must be positive, found -1", None, None),
    "Misses": ("raised", "FileNotFoundError: [Errno 2] No such file or directory: 'parts/bad.txt'", "bad.py", 81),
    "Recursion": ("raised", "RecursionError: maximum recursion depth exceeded", "bad.py", 73),
}


@pytest.fixture(scope="module")
def failures(module_place: Any, define: Callable[..., Any]) -> dict[str, Any]:
    """Return the answers of all parts, modelled in one run."""
    module_place.write("parts/bad.py", BAD)
    module_place.write("parts/helper.py", HELPER)
    with module_place.service() as service:
        found = service.realize([define(f"bad:{name}") for name in NAMES])
    return {text.partition(":")[2]: answer for text, answer in found.items()}


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_failure_kind_message_and_line(failures: dict[str, Any], module_place: Any, name: str) -> None:
    kind, message, file, line = EXPECTED[name]
    failure = failures[name]
    assert isinstance(failure, PartFailure)
    assert failure.subject == f"bad:{name}"
    assert failure.kind == kind
    assert message is None or failure.message == message
    if file is not None:
        assert failure.file == str(module_place.parts / file)
        assert failure.line == line
    if kind == "raised":
        assert failure.detail is not None
        assert "Traceback" in failure.detail


def test_other_parts_are_modelled(failures: dict[str, Any]) -> None:
    assert isinstance(failures["Good"], PartRecord)
    assert failures["Good"].volume == pytest.approx(6e-9, rel=1e-12)
    assert failures["Good"].warnings == ()


def test_warnings_point_to_their_line(failures: dict[str, Any], module_place: Any) -> None:
    (warning,) = failures["Warns"].warnings
    assert (warning.message, warning.file, warning.line) == ("too thin to print", str(module_place.parts / "bad.py"), 60)


def test_deterministic_failures_are_cached(failures: dict[str, Any], module_place: Any, define: Any) -> None:
    with module_place.service() as service:
        service.realize([define(f"bad:{name}") for name in NAMES])
        assert sorted(modelled_parts(service)) == ["bad:Leaves", "bad:Segfaults"]


def test_line_of_cached_failure_follows_edits(failures: dict[str, Any], module_place: Any, define: Any) -> None:
    module_place.write("parts/bad.py", "# moved\n" + BAD)
    try:
        with module_place.service() as service:
            failure = service.realize([define("bad:RaisesInResult")])["bad:RaisesInResult"]
    finally:
        module_place.write("parts/bad.py", BAD)
    assert isinstance(failure, PartFailure)
    assert failure.line == 17


def test_timeout_stops_only_the_hanging_part(module_place: Any, define: Callable[..., Any]) -> None:
    module_place.write("parts/bad.py", BAD)
    module_place.write("parts/helper.py", HELPER)
    with module_place.service(timeout=4.0) as service:
        found = service.realize([define("bad:Hangs"), define("bad:Good")])
    failure = found["bad:Hangs"]
    assert isinstance(failure, PartFailure)
    assert (failure.kind, failure.message) == ("hung", "more than 4 s")
    assert failure.file == str(module_place.parts / "bad.py")
    assert failure.line in (21, 22)
    assert isinstance(found["bad:Good"], PartRecord)


def test_description_failures(failures: dict[str, Any], module_place: Any) -> None:
    module_place.write("parts/broken.py", "class A:\n    x = (\n")
    text = "import os\nfrom thingc import Thing\nclass A(Thing): pass\nclass B(Thing): pass\nos._exit(1)\n"
    module_place.write("parts/dies.py", text)
    module_place.write("parts/needs.py", "import not_there\nclass A: pass\n")
    asked = [
        "bad:Good", "bad:not_a_part", "bad:Annotated", "bad:Goood", "broken:A", "dies:A", "dies:B", "needs:A", "os:path",
        "nowhere:A", "Good", "bad.py:Good",
    ]
    with module_place.service() as service:
        found = service.describe(asked)
    kinds = {name: answer.kind for name, answer in found.items()}
    assert kinds == {
        "bad:Good": "thing", "bad:not_a_part": "invalid", "bad:Annotated": "invalid", "bad:Goood": "missing",
        "broken:A": "raised",
        "dies:A": "crashed", "dies:B": "crashed", "needs:A": "raised", "os:path": "refused", "nowhere:A": "missing",
        "Good": "invalid", "bad.py:Good": "missing",
    }
    broken = found["broken:A"]
    assert isinstance(broken, PartFailure)
    assert broken.message == "SyntaxError: '(' was never closed"
    assert (broken.file, broken.line) == (str(module_place.parts / "broken.py"), 2)
    needs = found["needs:A"]
    assert isinstance(needs, PartFailure)
    assert needs.message == "ModuleNotFoundError: No module named 'not_there'"
    nowhere = found["nowhere:A"]
    assert isinstance(nowhere, PartFailure)
    assert "bad" in nowhere.candidates


def test_invalid_references_are_refused_before_import(place: Any, define: Callable[..., Any], tmp_path: Any) -> None:
    place.write("elsewhere/evil.py", f"open({str(tmp_path / 'ran')!r}, 'w')\nclass A: pass\n")
    untouched = Workers(1)
    with place.service(workers=untouched) as service:
        found = service.realize([define("subprocess:Popen"), define("evil:A"), define("numpy:ndarray")])
        assert service.describe(["shutil:rmtree"])["shutil:rmtree"].kind == "refused"
    assert [answer.kind for answer in found.values()] == ["refused", "missing", "refused"]
    assert not untouched.running
    assert not (tmp_path / "ran").exists()


def test_kernel_that_does_not_load_is_reported(
    place: Any, define: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    import thingc.geometry.client as client

    (tmp_path / "build123d.py").write_text("raise ImportError('no kernel on this machine')")
    usual = client.environment()
    shadowed = {**usual, "PYTHONPATH": f"{tmp_path}:{usual.get('PYTHONPATH', '')}"}
    monkeypatch.setattr(client, "environment", lambda seed=0: shadowed)
    place.write("parts/arm.py", "from thingc import Thing\nclass A(Thing): pass\n")
    with closing(Workers(1)) as own, place.service(workers=own) as service:
        failure = service.realize([define("arm:A")])["arm:A"]
    assert isinstance(failure, PartFailure)
    assert (failure.kind, failure.message) == (
        "crashed", "the CAD kernel cannot be loaded: ImportError: no kernel on this machine",
    )


def test_failures_without_fork(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/bad.py", BAD)
    place.write("parts/helper.py", HELPER)
    inline = Workers(1, forking=False)
    try:
        with place.service(workers=inline, timeout=3.0) as service:
            names = ("Good", "Raises", "Hangs", "Leaves", "Warns")
            found = service.realize([define(f"bad:{name}") for name in names])
            assert {text.partition(":")[2]: getattr(answer, "kind", "record") for text, answer in found.items()} == {
                "Good": "record", "Raises": "raised", "Hangs": "hung", "Leaves": "crashed", "Warns": "record",
            }
        place.write("parts/bad.py", BAD.replace("Box(1, 2, 3)", "Box(1, 2, 4)"))
        with place.service(workers=inline) as service:
            again = service.realize([define("bad:Good")])["bad:Good"]
        assert isinstance(again, PartRecord)
        assert again.volume == pytest.approx(8e-9, rel=1e-12)
    finally:
        inline.close()


def test_worker_that_cannot_start_is_reported(
    place: Any, define: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    """The Python interpreter is missing here, as if the system could not start another process."""
    place.write("parts/arm.py", "from thingc import Thing\nclass A(Thing): pass\n")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "gone"))
    with closing(Workers(1)) as own, place.service(workers=own) as service:
        failure = service.realize([define("arm:A")])["arm:A"]
    assert isinstance(failure, PartFailure)
    assert (failure.kind, failure.message) == ("crashed", "cannot start a worker process: No such file or directory")


def test_failure_without_line_points_to_the_class(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/weighs.py", """\
        from build123d import Box
        from thingc import Thing

        class Less(Thing):
            def mass(self):
                return -1.0

            def result(self):
                return Box(1, 2, 3)
        """)
    with place.service() as service:
        failure = service.realize([define("weighs:Less")])["weighs:Less"]
    assert isinstance(failure, PartFailure)
    assert failure.kind == "raised" and "mass" in failure.message
    assert failure.file is not None and failure.file.endswith("weighs.py") and failure.line == 4
