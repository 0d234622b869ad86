"""After an edit, exactly the parts that executed changed code are modelled again, whatever the call path."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import Any

import pytest

from realize.conftest import modelled_parts
from thingc.geometry.record import PartFailure

PARTS = """
    import functools
    import pathlib
    from build123d import Box
    from thingc import Length, Thing, asset
    from sizes import HEIGHT, deep, unused

    def table():
        return {"a": 3}

    TABLE = table()
    square = lambda x: x * x

    @functools.lru_cache
    def cached(x):
        return x + 1

    def high(width):
        return deep(width) + 2

    def endless():
        while True:
            break

    class Plate(Thing):
        def __init__(self, width: Length = 30, kind: str = "flat", more: bool = False):
            super().__init__()
            self.width = width
            self.more = more and square(cached(2))
            self.height = getattr(self, f"of_{kind}")()

        def of_flat(self):
            return 2

        def of_high(self):
            return high(self.width)

        @property
        def never(self):
            return 1

        def result(self):
            return Box(self.width, 10, self.height)

    class Pair(Thing):
        def __init__(self, gap: Length = 4, wide: bool = False):
            super().__init__()
            self.body = Plate(20) if wide else None
            self.gap = gap

        def result(self):
            def inner():
                return 7
            return Box(inner(), 10, self.gap)


    class Lazy(Thing):
        def result(self):
            return Box(8, 8, 8 if endless() is None else 9)

    class Reader(Thing):
        def result(self):
            return Box(6, 6, 2 if asset("data.txt").read_text() == "2" else self.other())

        def other(self):
            return 3
"""
SIZES = "HEIGHT = 4\ndef deep(width):\n    import deeper\n    return deeper.value(width)\ndef unused():\n    return 1\n"
DEEPER = "def value(width):\n    return width / 10\n"
FILES = {"things": PARTS, "sizes": SIZES, "deeper": DEEPER}
FLAT, HIGH, MORE, PAIR, WIDE, LAZY, READER = "flat", "high", "more", "pair", "wide", "lazy", "reader"
ALL = {FLAT, HIGH, MORE, PAIR, WIDE, LAZY, READER}


@pytest.fixture(scope="module")
def parts(define: Callable[..., Any]) -> dict[str, Any]:
    plate = {"width": 0.03, "kind": "flat", "more": False}
    return {
        FLAT: define("things:Plate", **plate), HIGH: define("things:Plate", **{**plate, "kind": "high"}),
        MORE: define("things:Plate", **{**plate, "more": True}), PAIR: define("things:Pair", gap=0.004, wide=False),
        WIDE: define("things:Pair", gap=0.004, wide=True), LAZY: define("things:Lazy"), READER: define("things:Reader"),
    }


def modelled(place: Any, parts: dict[str, Any], files: dict[str, str]) -> set[str]:
    """Return the parts that are modelled with these files by a process whose only state is the store."""
    place.write("data.txt", "2")
    for name, text in files.items():
        place.write(f"parts/{name}.py", text)
    with place.service() as service:
        found = service.realize(list(parts.values()))
        assert [one.message for one in found.values() if isinstance(one, PartFailure)] == []
        return {name for name, definition in parts.items() if definition.text in modelled_parts(service)}


@pytest.mark.parametrize(("file", "old", "new", "expected"), [
    # bodies of functions: those for which they ran
    ("things", "return 2\n", "return 2.5\n", {FLAT, MORE, WIDE}),
    ("things", "deep(width) + 2", "deep(width) + 3", {HIGH}),
    ("things", "return 7", "return 6", {PAIR, WIDE}),
    ("things", "return 1\n\n        def result", "return 2\n\n        def result", set()),
    ("things", "return 3\n", "return 4\n", set()),
    ("deeper", "width / 10", "width / 9", {HIGH}),
    ("sizes", "return 1", "return 2", set()),
    ("sizes", "import deeper", "import deeper as d\n    import deeper", {HIGH}),
    # defaults: those that are made of what has them, whatever they were given
    ("things", "gap: Length = 4", "gap: Length = 5", {PAIR, WIDE}),
    ("things", "width: Length = 30", "width: Length = 31", {FLAT, HIGH, MORE, WIDE}),
    # what runs when a module is loaded: all
    ("things", '"a": 3', '"a": 4', ALL),
    ("things", "x * x", "x * 2", ALL),
    ("sizes", "HEIGHT = 4", "HEIGHT = 5", ALL),
    ("things", "class Lazy(Thing):", "class Lazy(Thing):\n        size = 1", ALL),
    ("things", "def of_flat", "def new(self):\n            return 1\n\n        def of_flat", ALL),
    # what a decorator may have looked at, and what a call alone does not run: all
    ("things", "return x + 1", "return x + 2", ALL),
    ("things", "break", "yield", ALL),
    ("things", "def never", "async def never", ALL),
    # comments, and code that looks at functions without calling them
    ("things", "def high", "# high\n    def high", set()),
    ("things", "TABLE = table()", "TABLE = table()\n    size = len(table.__code__.co_names)", ALL),
])
def test_parts_that_ran_changed_code_are_modelled_again(
    module_place: Any, parts: dict[str, Any], file: str, old: str, new: str, expected: set[str],
) -> None:
    modelled(module_place, parts, FILES)
    assert modelled(module_place, parts, FILES) == set()
    assert FILES[file].count(old) == 1
    edited = {**FILES, file: FILES[file].replace(old, new)}
    assert modelled(module_place, parts, edited) == expected
    assert modelled(module_place, parts, edited) == set(), "what was reused is kept as it is"


def test_code_that_inspects_functions_depends_on_everything(place: Any, parts: dict[str, Any]) -> None:
    looking = {**FILES, "sizes": SIZES + "def size(function):\n    return len(function.__code__.co_code)\n"}
    assert modelled(place, parts, looking) == ALL
    assert modelled(place, parts, {**looking, "things": looking["things"].replace("deep(width) + 2", "deep(width) + 3")}) == ALL


def test_code_run_in_child_processes_counts(place: Any, define: Callable[..., Any]) -> None:
    text = """
        import os
        from build123d import Box
        from thingc import Thing

        class Split(Thing):
            def result(self):
                child = os.fork()
                if child == 0:
                    self.there()
                    os._exit(0)
                os.waitpid(child, 0)
                return Box(1, 1, 1)

            def there(self):
                return 1
    """
    parts = {"split": define("split:Split")}
    assert modelled(place, parts, {"split": text}) == {"split"}
    assert modelled(place, parts, {"split": text.replace("return 1\n", "return 2\n")}) == {"split"}


def test_trace_of_other_input_files_is_not_used(place: Any, parts: dict[str, Any]) -> None:
    """With another data file other code ran. An edit of the code that ran with the first file must still be noticed."""
    one = {READER: parts[READER]}
    place.write("parts/things.py", FILES["things"])

    def made(data: str, text: str) -> Any:
        for name, content in {**FILES, "things": text}.items():
            place.write(f"parts/{name}.py", content)
        place.write("data.txt", data)
        with place.service() as service:
            return next(iter(service.realize(list(one.values())).values())).volume, modelled_parts(service) != []

    text = FILES["things"]
    assert made("3", text) == (pytest.approx(6 * 6 * 3e-9), True)
    assert made("2", text) == (pytest.approx(6 * 6 * 2e-9), True)
    edited = text.replace("return 3\n", "return 4\n")
    assert made("3", edited) == (pytest.approx(6 * 6 * 4e-9), True)
    assert made("2", edited)[0] == pytest.approx(6 * 6 * 2e-9)


def test_reading_defaults_depends_only_on_the_parameters(place: Any, define: Callable[..., Any]) -> None:
    """A part that reads the parameters of another class depends on them, but not on other members of that class."""
    text = textwrap.dedent("""
        from build123d import Box
        from thingc import Length, Thing
        from thingc.geometry.things.inspection import parameters_of

        class Motor(Thing):
            def __init__(self, width: Length = 30):
                super().__init__()

            def result(self):
                return Box(1, 1, 1)

        class Seat(Thing):
            def result(self):
                (width,) = parameters_of(Motor)
                return Box(width.default, 1, 1)
    """)
    parts = {"seat": define("motors:Seat")}
    assert modelled(place, parts, {"motors": text}) == {"seat"}
    assert modelled(place, parts, {"motors": text.replace("return Box(1, 1, 1)", "return Box(1, 1, 2)")}) == set()
    assert modelled(place, parts, {"motors": text.replace("= 30", "= 40")}) == {"seat"}
