"""What the code of a part depends on, found by reading: what must change the key, and what must not."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from thingc.realize.build_key import difference
from thingc.realize.codekey import Code, Sources, binds, code_of, defined_in
from thingc.realize.modules import Finder
from thingc.realize.store import Store


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))


def code(folder: Path, reference: str) -> Code:
    return code_of(reference, Sources(Finder([str(folder)])))


PART = """
    '''A file of parts.'''
    from build123d import *
    from thingc import Length, Thing
    from shapes import plate
    import shapes as s

    SIZE = 30
    DEPTH: int = 4
    UNUSED = 5

    class Base(Thing):
        '''The base.'''
        def __init__(self, width: Length = SIZE):
            # a comment
            super().__init__()
            self.body = plate(width)

    class Derived(Base):
        def __init__(self):
            super().__init__(width=12)

    class Other(Thing):
        def result(self):
            return s.other(DEPTH)

    @s.decorated
    class Decorated(Thing):
        pass

    class Annotated_(Thing):
        def __init__(self, mode: "Kind" = None):
            pass

    Kind = str
"""
SHAPES = """
    from build123d import *
    THICKNESS = 2
    def plate(width): return Box(width, 10, THICKNESS)
    def other(depth): return Box(1, 1, depth)
    def decorated(family): return family
    def unrelated(): return 1
"""
CLASSES = ("Base", "Derived", "Other", "Decorated", "Annotated_")
FILES = {"arm.py": PART, "shapes.py": SHAPES}


def changed(folder: Path, before: dict[str, str], after: dict[str, str], classes: tuple[str, ...] = CLASSES) -> set[str]:
    """The classes of `arm` whose realize key differs between two states of the files."""
    write(folder, before)
    first = {name: code(folder, f"arm:{name}").ingredients for name in classes}
    write(folder, after)
    second = {name: code(folder, f"arm:{name}").ingredients for name in classes}
    return {name for name in classes if first[name] != second[name]}


@pytest.mark.parametrize(
    ("file", "old", "new", "expected"),
    [
        ("arm.py", "# a comment", "# another comment\n\n", set()),
        ("arm.py", "SIZE = 30", "SIZE  =  ( 30 )", set()),
        ("arm.py", "'''The base.'''", "'''The very base.'''", set()),
        ("arm.py", "'''A file of parts.'''", "'''Parts.'''", set()),
        ("arm.py", "UNUSED = 5", "UNUSED = 6", set()),
        ("arm.py", "SIZE = 30", "SIZE = 31", {"Base", "Derived"}),
        ("arm.py", "SIZE = 30", "SIZE = 30.0", {"Base", "Derived"}),
        ("arm.py", "DEPTH: int = 4", "DEPTH: int = 5", {"Other"}),
        ("arm.py", "DEPTH: int = 4", "DEPTH: float = 4", {"Other"}),
        ("arm.py", "self.body = plate(width)", "self.body = plate(width + 1)", {"Base", "Derived"}),
        ("arm.py", "width=12", "width=13", {"Derived"}),
        ("arm.py", "class Derived(Base)", "class Derived(Thing)", {"Derived"}),
        ("arm.py", "Kind = str", "Kind = int", {"Annotated_"}),
        ("arm.py", "from shapes import plate", "from shapes import other as plate", {"Base", "Derived"}),
        ("shapes.py", "THICKNESS = 2", "THICKNESS = 3", {"Base", "Derived"}),
        ("shapes.py", "Box(1, 1, depth)", "Box(2, 1, depth)", {"Other"}),
        ("shapes.py", "def unrelated(): return 1", "def unrelated(): return 2", set()),
        ("shapes.py", "return family", "family.x = 1; return family", {"Decorated"}),
        ("shapes.py", "def unrelated(): return 1", "def unrelated(): return 1\n    def added(): pass", set()),
        # something that happens when a module is loaded counts for everything in it and for everything that loads it
        ("shapes.py", "def unrelated(): return 1", "print('loaded')", set(CLASSES)),
        ("arm.py", "UNUSED = 5", "s.THICKNESS = 5", set(CLASSES)),
        ("arm.py", "UNUSED = 5", "assert SIZE", set(CLASSES)),
        # a script's own part does not run in a module
        ("arm.py", "Kind = str", "Kind = str\n    if __name__ == '__main__':\n        print(Base())", set()),
    ],
)
def test_one_edit(tmp_path: Path, file: str, old: str, new: str, expected: set[str]) -> None:
    assert old in FILES[file]
    assert changed(tmp_path, FILES, {file: FILES[file].replace(old, new)}) == expected


def test_documentation_counts_for_the_description_only(tmp_path: Path) -> None:
    write(tmp_path, FILES)
    before = code(tmp_path, "arm:Base")
    write(tmp_path, {"arm.py": PART.replace("'''The base.'''", "'''Another.'''")})
    after = code(tmp_path, "arm:Base")
    assert before.ingredients == after.ingredients
    assert before.documented != after.documented


@pytest.mark.parametrize(
    "imports",
    [
        "import pkg.leg\n    make = lambda: pkg.leg.foot()",
        "import pkg.leg as l\n    make = lambda: l.foot()",
        "from pkg import leg\n    make = lambda: leg.foot()",
        "from pkg.leg import foot\n    make = lambda: foot()",
        "from pkg.leg import foot as f\n    make = lambda: f()",
        "from pkg.leg import *\n    make = lambda: foot()",
        "from pkg import *\n    make = lambda: exported()",
        "import pkg\n    make = lambda: pkg.exported()",
        "def make():\n        from pkg.leg import foot\n        return foot()",
        "def make():\n        import pkg.leg\n        return pkg.leg.foot()",
        "try:\n        from pkg.leg import foot\n    except ImportError:\n        foot = None\n    make = lambda: foot()",
    ],
)
def test_every_form_of_import(tmp_path: Path, imports: str) -> None:
    files = {
        "arm.py": f"""
    {imports}
    class A:
        part = make()
    class B:
        pass
    """,
        "pkg/__init__.py": "from .leg import foot as exported\n",
        "pkg/leg.py": "from . import util\nfrom .util import g as unused\ndef foot(): return util.f()\ndef hand(): return 1\n",
        "pkg/util.py": "def f(): return 1\ndef g(): return 2\n",
    }
    deep = {"pkg/util.py": "def f(): return 3\ndef g(): return 2\n"}
    beside = {"pkg/util.py": "def f(): return 1\ndef g(): return 4\n"}
    assert changed(tmp_path, files, deep, ("A", "B")) == {"A"}
    write(tmp_path, files)
    assert changed(tmp_path, files, beside, ("A", "B")) == set()


@pytest.mark.parametrize(
    "body",
    [
        "exec('x = HIDDEN')",
        "return eval('HIDDEN')",
        "return globals()['HIDDEN']",
        "import sys\n            return sys.modules[__name__].HIDDEN",
        "import importlib\n            return importlib.import_module('arm').HIDDEN",
    ],
)
def test_where_reading_cannot_be_sure_the_whole_file_counts(tmp_path: Path, body: str) -> None:
    text = f"""
    HIDDEN = 1
    class A:
        def result(self):
            {body}
    class B:
        pass
    """
    after = {"arm.py": text.replace("HIDDEN = 1", "HIDDEN = 2")}
    assert changed(tmp_path, {"arm.py": text}, after, ("A", "B")) == {"A"}


@pytest.mark.parametrize(
    "body",
    [
        "return A.__doc__",
        "return __doc__",
        "return getattr(helper, '__doc__')",
        "return inspect.getdoc(helper)",
        "from inspect import getsource as source; return source(B)",
        "import sys; return sys._getframe().f_lineno",
        "return B.__init__.__code__.co_firstlineno",
        "import traceback; return traceback.extract_stack()[-1].lineno",
        "return lines.line()",
    ],
)
def test_code_that_looks_at_docstrings_or_lines_depends_on_every_text(tmp_path: Path, body: str) -> None:
    text = f"""
    'A file of parts.'
    import inspect
    import lines
    from shapes import helper
    class A:
        def result(self):
            {body}
    class B:
        def __init__(self):
            'A docstring.'
    """
    files = {
        "arm.py": text,
        "shapes.py": "def helper():\n    'Helps.'\n",
        "lines.py": "import sys\ndef line():\n    return sys._getframe(1).f_lineno\n",
    }
    for file, old, new in (
        ("arm.py", "class A", "# moves the line\n    class A"), ("arm.py", "docstring", "text"), ("shapes.py", "Helps", "Does help"),
        ("arm.py", "A file of", "Another file of"),
    ):
        assert changed(tmp_path, files, {file: files[file].replace(old, new)}, ("A", "B")) == {"A"}, (file, new)


TABLE = """\
T = {}
def put(c):
    T[c.__name__] = c
    return c
class A:
    def result(self): return T
"""


@pytest.mark.parametrize(
    ("before", "after"),
    [
        # a name bound twice: which of them a class means depends on the order
        ("X = 1\nclass A:\n    size = X\nX = 2\n", "X = 1\nX = 2\nclass A:\n    size = X\n"),
        # a table filled by a decorator at another place
        (
            TABLE + "@put\nclass C: pass\n",
            TABLE + "@put\nclass D: pass\n",
        ),
        ("L = []\nL.append(1)\nclass A:\n    n = len(L)\n", "L = []\nL.append(2)\nclass A:\n    n = len(L)\n"),
        ("L = [1]\nL[0] = 2\nclass A:\n    n = L\n", "L = [1]\nL[0] = 3\nclass A:\n    n = L\n"),
        ("class A: pass\nA.size = 1\n", "class A: pass\nA.size = 2\n"),
        ("class A: pass\nsetattr(A, 'size', 1)\n", "class A: pass\nsetattr(A, 'size', 2)\n"),
        ("N = 1\nN += 1\nclass A:\n    n = N\n", "N = 1\nN += 2\nclass A:\n    n = N\n"),
        (
            "N = 1\ndef f():\n    global N\n    N = 2\nclass A:\n    n = N\n",
            "N = 1\ndef f():\n    global N\n    N = 3\nclass A:\n    n = N\n",
        ),
        (
            "for k in range(3):\n    last = k\nclass A:\n    n = last\n",
            "for k in range(4):\n    last = k\nclass A:\n    n = last\n",
        ),
        ("class A:\n    n = [x for x in x]\nx = [1]\n", "class A:\n    n = [x for x in x]\nx = [2]\n"),
        ("def f(a=S): pass\nclass A:\n    n = f\nS = 1\n", "def f(a=S): pass\nclass A:\n    n = f\nS = 2\n"),
        ("from missing import thing\nclass A:\n    n = thing\n", "from missed import thing\nclass A:\n    n = thing\n"),
    ],
)
def test_statements_that_bind_or_change_a_used_name(tmp_path: Path, before: str, after: str) -> None:
    assert changed(tmp_path, {"arm.py": before}, {"arm.py": after}, ("A",)) == {"A"}


def test_locals_are_no_uses(tmp_path: Path) -> None:
    text = """
    body = 1
    class A:
        def result(self, width):
            body = width
            return [body for width in range(3)], (lambda body: body)(1)
    """
    assert changed(tmp_path, {"arm.py": text}, {"arm.py": text.replace("body = 1", "body = 2")}, ("A",)) == set()


def test_a_module_used_as_an_object_counts_whole(tmp_path: Path) -> None:
    files = {"arm.py": "import shapes\nclass A:\n    n = getattr(shapes, 'pl' + 'ate')\n", "shapes.py": SHAPES}
    edited = {"shapes.py": SHAPES.replace("return 1", "return 2")}
    assert changed(tmp_path, files, edited, ("A",)) == {"A"}


def test_a_module_that_appears(tmp_path: Path) -> None:
    files = {"arm.py": "try:\n    import fancy\nexcept ImportError:\n    fancy = None\nclass A:\n    n = fancy\n"}
    assert changed(tmp_path, files, {"fancy.py": "X = 1\n"}, ("A",)) == {"A"}


def test_a_star_that_begins_to_provide_a_name(tmp_path: Path) -> None:
    text = "from build123d import *\nfrom shapes import *\nclass A:\n    n = Box\n"
    files = {"arm.py": text, "shapes.py": "def plate(): pass\n"}
    edited = {"shapes.py": "def plate(): pass\ndef Box(): pass\n"}
    assert changed(tmp_path, files, edited, ("A",)) == {"A"}


def test_a_file_that_cannot_be_parsed_counts_by_its_bytes(tmp_path: Path) -> None:
    assert changed(tmp_path, {"arm.py": "class A:\n  x = (\n"}, {"arm.py": "class A:\n  y = (\n"}, ("A",)) == {"A"}


def test_cyclic_imports_end(tmp_path: Path) -> None:
    write(tmp_path, {"arm.py": "import other\nclass A:\n    n = other.f\n", "other.py": "import arm\ndef f(): return arm.A\n"})
    assert set(code(tmp_path, "arm:A").ingredients) >= {"class arm:A", "function other:f"}


def test_installed_packages_count_by_name_and_thingc_not_at_all(tmp_path: Path) -> None:
    write(tmp_path, FILES)
    found = code(tmp_path, "arm:Base")
    assert "build123d" in found.installed
    assert not any("thingc." in label for label in found.ingredients)


def test_the_place_of_a_class_follows_imports(tmp_path: Path) -> None:
    write(tmp_path, {"arm.py": "from pkg.leg import Foot as F\n", "pkg/__init__.py": "", "pkg/leg.py": "\n\nclass Foot: pass\n"})
    assert code(tmp_path, "arm:F").place == (str(tmp_path / "pkg/leg.py"), 3)


def test_a_part_folder_cannot_take_names_of_the_standard_library(tmp_path: Path) -> None:
    write(tmp_path, {"arm.py": "import random\nclass A:\n    n = random.random\n", "random.py": "def random(): return 4\n"})
    assert code(tmp_path, "arm:A").modules == {"arm": str(tmp_path / "arm.py")}


def test_what_a_module_defines(tmp_path: Path) -> None:
    files = {"arm.py": "from shapes import *\nclass A: pass\ndef make(): pass\n_x = 1\n", "shapes.py": "def plate(): pass\n"}
    write(tmp_path, files)
    sources = Sources(Finder([str(tmp_path)]))
    assert defined_in("arm", sources) == (("A", "make", "plate"), False)
    assert binds("arm", "plate", sources)
    assert not binds("arm", "plates", sources)
    write(tmp_path, {"open.py": "from build123d import *\nclass A: pass\n"})
    assert defined_in("open", sources) == (("A",), True)


def test_facts_kept_in_a_store_give_the_same_key(tmp_path: Path) -> None:
    write(tmp_path / "parts", FILES)
    store = Store(str(tmp_path / "store"))
    fresh = code(tmp_path / "parts", "arm:Derived")
    first = code_of("arm:Derived", Sources(Finder([str(tmp_path / "parts")]), store))
    kept = code_of("arm:Derived", Sources(Finder([str(tmp_path / "parts")]), store))
    assert fresh == first == kept
    assert len(list((tmp_path / "store" / "facts").glob("*/*"))) == 2


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("arm.py", "width=12", "width=13", "class arm:Derived changed"),
        ("shapes.py", "THICKNESS = 2", "THICKNESS = 3", "helper module `shapes` changed: value `THICKNESS`"),
        ("arm.py", "SIZE = 30", "SIZE = 31", "value arm:SIZE changed"),
        ("arm.py", "class Derived(Base)", "class Derived(Thing)", "class arm:Derived changed"),
        ("shapes.py", "def unrelated(): return 1", "print(1)", "a statement of module `shapes` is new"),
    ],
)
def test_what_changed_in_words(tmp_path: Path, file: str, old: str, new: str, words: str) -> None:
    write(tmp_path, FILES)
    before = code(tmp_path, "arm:Derived").ingredients
    write(tmp_path, {file: FILES[file].replace(old, new)})
    assert difference(before, code(tmp_path, "arm:Derived").ingredients, "arm") == words
