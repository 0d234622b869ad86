"""The code dependencies of a part, found by parsing: all of its module and of every reachable module, and nothing else."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from thingc.geometry.key.build_key import difference
from thingc.geometry.key.module_key import CodeIngredients, ModuleSources, code_of, defined_in, may_have
from thingc.geometry.key.modules import MAX_NAME, Finder
from thingc.geometry.store.local import Store


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))


def code(folder: Path, reference: str) -> CodeIngredients:
    return code_of(reference, ModuleSources(Finder([str(folder)]), str(folder)))


def changed(folder: Path, before: dict[str, str], after: dict[str, str], *references: str) -> set[str]:
    """Return the references whose code differs between two states of the files."""
    write(folder, before)
    first = {reference: code(folder, reference).ingredients for reference in references}
    write(folder, after)
    return {reference for reference in references if code(folder, reference).ingredients != first[reference]}


PART = """
    '''A file of parts.'''
    from build123d import *
    from thingc import Length, Thing
    from shapes import plate

    SIZE = 30

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
        color: "Kind" = "red"
        '''What it is painted in.'''
        def result(self):
            return Box(1, 1, 4)

    Kind = str
"""
SHAPES = "THICKNESS = 2\ndef plate(width): return (width, 10, THICKNESS)\ndef unrelated(): return 1\n"
FILES = {"arm.py": PART, "shapes.py": SHAPES, "legs.py": "from arm import Base\nclass Leg(Base): pass\n", "alone.py": "class Alone: pass\n"}
ARM = {"arm:Base", "arm:Derived", "arm:Other"}
EVERY = ARM | {"legs:Leg", "alone:Alone"}


@pytest.mark.parametrize(
    ("file", "old", "new", "expected"),
    [
        ("arm.py", "# a comment", "# another comment\n\n", set()),
        ("arm.py", "SIZE = 30", "SIZE  =  ( 30 )", set()),
        ("arm.py", '"red"', "u'red'", set()),
        ("arm.py", "'''The base.'''", "'''The very base.'''", set()),
        ("arm.py", "'''The base.'''", "", set()),
        ("arm.py", "'''A file of parts.'''", "'''Parts.'''", set()),
        ("arm.py", "'''What it is painted in.'''", "'''Paint.'''", set()),
        # a script's own part does not run in a module
        ("arm.py", "Kind = str", "Kind = str\n    if __name__ == '__main__':\n        import alone\n        print(Base(), __doc__)", set()),
        (
            "arm.py", "Kind = str", "Kind = str\n    if __name__ == '__main__':\n        pass\n    else:\n        SIZE = 3",
            ARM | {"legs:Leg"},
        ),
        # whatever else is edited, all of the module counts, and whoever imports it
        ("arm.py", "SIZE = 30", "SIZE = 31", ARM | {"legs:Leg"}),
        ("arm.py", "SIZE = 30", "SIZE = 30.0", ARM | {"legs:Leg"}),
        ("arm.py", "Box(1, 1, 4)", "Box(1, 1, 5)", ARM | {"legs:Leg"}),
        ("arm.py", "width=12", "width=13", ARM | {"legs:Leg"}),
        ("arm.py", "Kind = str", "Kind = int", ARM | {"legs:Leg"}),
        ("arm.py", "Kind = str", "Kind = str\n    print('loaded')", ARM | {"legs:Leg"}),
        ("shapes.py", "return 1", "return 2", ARM | {"legs:Leg"}),
        ("legs.py", "pass", "size = 1", {"legs:Leg"}),
        ("alone.py", "pass", "size = 1", {"alone:Alone"}),
        ("unused.py", "", "import arm\narm.Base.width = 3\n", set()),
    ],
)
def test_edit_changes_only_dependent_parts(tmp_path: Path, file: str, old: str, new: str, expected: set[str]) -> None:
    text = FILES.get(file, "")
    assert old in text
    assert changed(tmp_path, FILES, {file: text.replace(old, new)}, *EVERY) == expected


@pytest.mark.parametrize(("old", "new"), [
    ("1, 23", "12, 3"), ("(1, 23)", "[1, 23]"), ("(1, 23)", "((1,), 23)"), ("(1, 23)", "(1, -23)"), ("(1, 23)", "(1, '23')"),
    ("(1, 23)", "(1, 23, None)"), ("f(a, b)", "f(a)(b)"), ("f(a, b)", "f(a, *b)"), ("f(a, b)", "f(a, b=b)"), ("f(a, b)", "f.a(b)"),
    ("a < b", "a <= b"), ("del a", "a"), ("+ 1.0", "+ 1"), ("+ 1.0", "+ 1.0000000000000002"), ("x: a", "x = a"), ("'xy'", "'x' f'{y}'"),
    ("if a:\n    b\n    c", "if a:\n    b\nc"), ("if a:\n    b\n    c", "while a:\n    b\n    c"), ("b\n    c", "c\n    b"),
    ("'xy'", "b'xy'"), ("async def", "def"), ("import a.b", "import a.b as a"),
])
def test_similar_syntax_trees_have_different_keys(tmp_path: Path, old: str, new: str) -> None:
    text = (
        "x = (1, 23)\nf(a, b)\na < b\ndel a\nx = a + 1.0\nx: a\ny = 'xy'\nif a:\n    b\n    c\n"
        "async def g():\n    return ...\nimport a.b\n"
    )
    assert old in text
    assert changed(tmp_path, {"arm.py": text}, {"arm.py": text.replace(old, new)}, "arm:A") == {"arm:A"}


def test_docstrings_change_only_the_description_key(tmp_path: Path) -> None:
    write(tmp_path, FILES)
    before = code(tmp_path, "legs:Leg")
    for text in (PART.replace("'''The base.'''", "'''Another.'''"), PART.replace("'''The base.'''", "").replace(
        "class Derived(Base):", "class Derived(Base):\n        '''The base.'''"
    )):
        write(tmp_path, {"arm.py": text})
        after = code(tmp_path, "legs:Leg")
        assert before.ingredients == after.ingredients
        assert before.documented != after.documented


@pytest.mark.parametrize(
    "imports",
    [
        "import pkg.leg", "import pkg.leg as l", "from pkg import leg", "from pkg.leg import foot", "from pkg.leg import *",
        "from pkg import *", "import pkg",
        "def make():\n    from pkg.leg import foot",
        "class A:\n    def f(self):\n        import pkg.leg",
        "try:\n    from pkg.leg import foot\nexcept ImportError:\n    foot = None",
        "if typing.TYPE_CHECKING:\n    import pkg",
    ],
)
def test_every_import_form_is_followed(tmp_path: Path, imports: str) -> None:
    files = {
        "arm.py": f"{imports}\n\nclass A:\n    pass\n",
        "pkg/__init__.py": "def exported():\n    from .leg import foot\n",
        "pkg/leg.py": "from . import util\nfrom ..arm import nothing\n",
        "pkg/util.py": "from .deep.tables import *\n",
        "pkg/deep/tables.py": "SIZE = 1\n",
        "pkg/other.py": "SIZE = 1\n",
    }
    for file in ("pkg/__init__.py", "pkg/leg.py", "pkg/util.py", "pkg/deep/tables.py"):
        assert changed(tmp_path, files, {file: files[file] + "new = 1\n"}, "arm:A") == {"arm:A"}, file
        write(tmp_path, files)
    assert changed(tmp_path, files, {"pkg/other.py": "SIZE = 2\n"}, "arm:A") == set()
    assert code(tmp_path, "arm:A").plain == {"pkg.deep"}


def test_init_files_of_parent_packages_are_dependencies(tmp_path: Path) -> None:
    files = {"pkg/__init__.py": "A = 1\n", "pkg/sub/__init__.py": "B = 1\n", "pkg/sub/leg.py": "class A: pass\n"}
    for file in ("pkg/__init__.py", "pkg/sub/__init__.py"):
        assert changed(tmp_path, files, {file: "C = 2\n"}, "pkg.sub.leg:A") == {"pkg.sub.leg:A"}


def test_modules_in_an_import_cycle_share_a_key(tmp_path: Path) -> None:
    write(tmp_path, {"a.py": "import b\nclass A: pass\n", "b.py": "import c\nclass B: pass\n", "c.py": "import a\nclass C: pass\n"})
    first = code(tmp_path, "a:A").ingredients
    assert list(first) == ["module a", "module b", "module c"]
    assert code(tmp_path, "b:B").ingredients == first == code(tmp_path, "c:C").ingredients


def test_long_import_chain(tmp_path: Path) -> None:
    write(tmp_path, {f"m{n}.py": f"import m{n + 1}\n" for n in range(3000)})
    before = code(tmp_path, "m0:A").ingredients
    write(tmp_path, {"m2999.py": "A = 1\n"})
    assert [label for label, digest in code(tmp_path, "m0:A").ingredients.items() if before[label] != digest] == ["module m2999"]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        # a table filled by a decorator at another place, and the like: reading classes one by one had to know each of these
        ("def put(c): return c\n@put\nclass C: pass\nclass A: pass\n", "def put(c): return c\nclass C: pass\n@put\nclass A: pass\n"),
        ("class A: pass\nA.size = 1\n", "class A: pass\nA.size = 2\n"),
        ("class A: pass\nsetattr(A, 'si' + 'ze', 1)\n", "class A: pass\nsetattr(A, 'si' + 'ze', 2)\n"),
        ("class A: pass\nvars()['A'].size = 1\n", "class A: pass\nvars()['A'].size = 2\n"),
        ("HIDDEN = 1\nclass A:\n    n = globals()['HID' + 'DEN']\n", "HIDDEN = 2\nclass A:\n    n = globals()['HID' + 'DEN']\n"),
        ("class M(type): pass\nclass A(metaclass=M): pass\n", "class M(type): x = 1\nclass A(metaclass=M): pass\n"),
        ("import shapes\nclass A: pass\nshapes.SIZE = 1\n", "import shapes\nclass A: pass\nshapes.SIZE = 2\n"),
        ("N = 1\ndef f():\n    global N\n    N = 2\nclass A: pass\n", "N = 1\ndef f():\n    global N\n    N = 3\nclass A: pass\n"),
        ("from missing import thing\nclass A: pass\n", "from missed import thing\nclass A: pass\n"),
        ("X = 1\nclass A:\n    size = X\nX = 2\n", "X = 1\nX = 2\nclass A:\n    size = X\n"),
    ],
)
def test_module_statements_that_affect_a_class_count(tmp_path: Path, before: str, after: str) -> None:
    write(tmp_path, {"shapes.py": SHAPES})
    assert changed(tmp_path, {"arm.py": before}, {"arm.py": after}, "arm:A") == {"arm:A"}


@pytest.mark.parametrize(
    "body",
    [
        "return A.__doc__",
        "return __doc__",
        "return getattr(helper, '__doc__')",
        "return inspect.getdoc(helper)",
        "from inspect import getsource as source; return source(B)",
        "import importlib; return importlib.import_module('inspect')",
        "import sys; return sys._getframe().f_lineno",
        "return B.__init__.__code__.co_firstlineno",
        "import traceback; return traceback.extract_stack()[-1].lineno",
        "import lines; return lines.line()",
    ],
)
def test_code_that_inspects_source_depends_on_all_text(tmp_path: Path, body: str) -> None:
    files = {
        "arm.py": f"'A file of parts.'\nfrom shapes import helper\nclass A:\n    def result(self):\n        {body}\n",
        "shapes.py": "def helper():\n    'Helps.'\n",
        "lines.py": "import sys\ndef line():\n    return sys._getframe(1).f_lineno\n",
        "leg.py": "from shapes import helper\nclass Leg: pass\n",
    }
    for file, old, new in (
        ("arm.py", "class A", "# moves the line\nclass A"), ("arm.py", "A file of", "Another file of"), ("shapes.py", "Helps", "Does help"),
    ):
        assert changed(tmp_path, files, {file: files[file].replace(old, new)}, "arm:A", "leg:Leg") == {"arm:A"}, (file, new)


def test_new_and_shadowing_modules_change_the_key(tmp_path: Path) -> None:
    text = "try:\n    import fancy\nexcept ImportError:\n    fancy = None\nclass A: pass\n"
    write(tmp_path, {"arm.py": text, "first/unrelated.py": "", "second/fancy.py": "X = 1\n"})

    def of(*folders: str) -> tuple[dict[str, str], set[str]]:
        found = code_of("arm:A", ModuleSources(Finder([str(tmp_path), *(str(tmp_path / folder) for folder in folders)]), str(tmp_path)))
        return found.ingredients, found.installed

    absent, second = of(), of("second")
    write(tmp_path, {"first/fancy.py": "X = 2\n"})
    first = of("first", "second")
    assert list(absent[0]) == ["module arm"] and not absent[1]
    assert list(second[0]) == list(first[0]) == ["module arm", "module fancy"] and first != second
    # of an installed package only the version counts, until a part folder has a module of its name
    write(tmp_path, {"arm.py": "import hypothesis.errors\nclass A: pass\n"})
    assert of() == (of()[0], {"hypothesis", "hypothesis.errors"}) and list(of()[0]) == ["module arm"]
    write(tmp_path, {"hypothesis/errors.py": "", "hypothesis/__init__.py": ""})
    assert list(of()[0]) == ["module arm", "module hypothesis", "module hypothesis.errors"] and not of()[1]


def test_part_folder_cannot_shadow_the_standard_library(tmp_path: Path) -> None:
    write(tmp_path, {"arm.py": "import random\nclass A: pass\n", "random.py": "def random(): return 4\n"})
    assert list(code(tmp_path, "arm:A").files) == [str(tmp_path / "arm.py")]


def test_parsing_does_not_import_or_run_code(tmp_path: Path) -> None:
    trap = "raise SystemExit('it was run')\n"
    write(tmp_path, {"helper.py": trap, "pkg/__init__.py": trap, "pkg/leg.py": trap})
    write(tmp_path, {"arm.py": "from pkg.leg import *\nimport helper\n" + trap})
    assert list(code(tmp_path, "arm:A").ingredients) == ["module arm", "module helper", "module pkg", "module pkg.leg"]


@pytest.mark.parametrize("text", [
    b"class A:\n  x = (\n", b"x = " + b"-" * 50_000 + b"1\n", b"x = " + b"(" * 100_000 + b"\n", b"x = 1\0\n", b"x = '\xff'\n",
    b"x = 0x" + b"f" * 9000 + b"\n",
])
def test_unparsable_file_counts_by_its_bytes(tmp_path: Path, text: bytes) -> None:
    write(tmp_path, {"leg.py": "import arm\nclass Leg: pass\n"})
    (tmp_path / "arm.py").write_bytes(text)
    before = code(tmp_path, "leg:Leg").ingredients
    assert may_have("arm", "A", ModuleSources(Finder([str(tmp_path)]), str(tmp_path)))  # who can tell
    (tmp_path / "arm.py").write_bytes(text + b"# a comment\n")
    assert code(tmp_path, "leg:Leg").ingredients["module arm"] != before["module arm"]


def test_deep_trees_and_long_names_are_parsed(tmp_path: Path) -> None:
    text = "x = " + "1 + " * 900 + "1\nimport shapes\n" + f"import {'a.' * MAX_NAME}a, {'.'.join('b' * 240)}\n" + "class A: pass\n"
    files = {"arm.py": text, "shapes.py": SHAPES}
    assert changed(tmp_path, files, {"arm.py": text.replace("1 + 1\n", "1 + 2\n")}, "arm:A") == {"arm:A"}
    assert changed(tmp_path, files, {"shapes.py": "\n"}, "arm:A") == {"arm:A"}


def test_impossible_module_names_are_absent(tmp_path: Path) -> None:
    for name in ("a." * 3000 + "a", "a" * (MAX_NAME + 1)):
        assert Finder([str(tmp_path)]).find(name).kind == "absent"


def test_location_in_the_workspace_is_part_of_the_key(tmp_path: Path) -> None:
    """A module may read files next to it. The workspace as a whole may move."""
    write(tmp_path, {"ws/parts/arm.py": "class A: pass\n", "ws/more/leg.py": "class L: pass\n"})

    def of(root: str, *folders: str) -> list[dict[str, str]]:
        sources = ModuleSources(Finder([str(tmp_path / root / folder) for folder in folders]), str(tmp_path / root))
        return [code_of(reference, sources).ingredients for reference in ("arm:A", "leg:L")]

    arm, leg = of("ws", "parts", "more")
    (tmp_path / "ws").rename(tmp_path / "elsewhere")  # the workspace as a whole may move
    assert of("elsewhere", "parts", "more") == [arm, leg] == of("elsewhere", "more", "parts")
    (tmp_path / "elsewhere" / "parts" / "arm").mkdir()
    (tmp_path / "elsewhere" / "parts" / "arm.py").rename(tmp_path / "elsewhere" / "parts" / "arm" / "__init__.py")
    (tmp_path / "elsewhere" / "more" / "leg.py").rename(tmp_path / "elsewhere" / "parts" / "leg.py")
    moved = of("elsewhere", "parts", "more")
    assert moved[0] != arm and moved[1] != leg and difference(arm, moved[0]) == "module `arm` changed"


def test_symlink_cycles_are_handled(tmp_path: Path) -> None:
    write(tmp_path, {"arm.py": "import loop, ring.ring.leg\nclass A: pass\n", "ring/leg.py": "A = 1\n"})
    (tmp_path / "loop.py").symlink_to(tmp_path / "loop.py")
    (tmp_path / "ring" / "ring").symlink_to(tmp_path / "ring")
    assert list(code(tmp_path, "arm:A").ingredients) == ["module arm", "module ring.ring.leg"]


def test_untrusted_code_is_read_within_limits(tmp_path: Path) -> None:
    write(tmp_path, {"arm.py": "import far, large, small\n", "far.py": "A = 1\n", "large.py": "#" * 1_000_000, "small.py": "A = 1\n"})
    sources = ModuleSources(Finder([str(tmp_path)]), str(tmp_path), within=lambda file: not file.endswith("far.py"))
    assert list(code_of("arm:A", sources).ingredients) == ["module arm", "module small"]


def test_class_location_follows_imports(tmp_path: Path) -> None:
    write(tmp_path, {
        "arm.py": "from pkg.leg import Foot as F\nfrom pkg import *\nif True:\n    class Inner: pass\n",
        "pkg/__init__.py": "from .leg import Foot\n", "pkg/leg.py": "\n\n@final\nclass Foot: pass\n",
        "ring.py": "from ring import A\n",
    })
    foot = (str(tmp_path / "pkg/leg.py"), 4)
    assert code(tmp_path, "arm:F").place == code(tmp_path, "arm:Foot").place == code(tmp_path, "pkg:Foot").place == foot
    assert code(tmp_path, "arm:Inner.Deeper").place == (str(tmp_path / "arm.py"), 4)
    assert code(tmp_path, "arm:Gone").place is None and code(tmp_path, "ring:A").place is None


def test_names_defined_by_a_module(tmp_path: Path) -> None:
    write(tmp_path, {
        "arm.py": "from shapes import *\nimport os.path as p\nfrom pkg import leg\n"
                  "class A: pass\ndef make(): n = 1\n_x = 1\nclass _B: pass\n"
                  "for k in (1, 2): pass\nwith open('x') as (a, b): pass\n"
                  "try: pass\nexcept ValueError as fault: pass\nmatch k:\n    case [c, *d]: pass\n    case {**e}: pass\n",
        "shapes.py": "from arm import *\ndef plate(): pass\n",
        "open.py": "from build123d import *\nclass A: pass\n",
        "late.py": "def f():\n    global X\n    X = 1\nf()\n",
    })
    sources = ModuleSources(Finder([str(tmp_path)]), str(tmp_path))
    assert defined_in("arm", sources) == defined_in("shapes", sources) == ("A", "make", "plate")
    names = ("plate", "p", "leg", "_x", "_B", "k", "a", "b", "fault", "c", "d", "e")
    assert [name for name in names if not may_have("arm", name, sources)] == []
    assert not may_have("arm", "plates", sources) and not may_have("arm", "n", sources)
    assert defined_in("open", sources) == ("A",) and may_have("open", "Box", sources)
    assert may_have("late", "X", sources)


def test_stored_facts_give_the_same_key(tmp_path: Path) -> None:
    write(tmp_path / "parts", FILES)
    store = Store(str(tmp_path / "store"))
    fresh = code(tmp_path / "parts", "arm:Derived")
    first = code_of("arm:Derived", ModuleSources(Finder([str(tmp_path / "parts")]), str(tmp_path / "parts"), store))
    kept = code_of("arm:Derived", ModuleSources(Finder([str(tmp_path / "parts")]), str(tmp_path / "parts"), store))
    assert fresh == first == kept and fresh.place is not None
    assert len(list((tmp_path / "store" / "facts").glob("*/*"))) == 2


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("arm.py", "width=12", "width=13", "module `arm` changed"),
        ("shapes.py", "THICKNESS = 2", "THICKNESS = 3", "module `shapes` changed"),
        ("arm.py", "SIZE = 30", "import alone", "module `arm` changed"),
        ("arm.py", "from shapes import plate", "", "module `arm` changed"),
        ("alone.py", "class", "class", "no dependency changed"),
    ],
)
def test_difference_names_the_changed_module(tmp_path: Path, file: str, old: str, new: str, words: str) -> None:
    write(tmp_path, FILES)
    before = code(tmp_path, "arm:Derived").ingredients
    write(tmp_path, {file: textwrap.dedent(FILES[file]).replace(old, new)})
    assert difference(before, code(tmp_path, "arm:Derived").ingredients) == words


def test_difference_lists_modules_first_and_three_at_most() -> None:
    before = {"version numpy": "1", "parameter size": "1", "module b": "1", "module a": "1", "machine": "x"}
    after = {**dict.fromkeys(before, "2"), "module c": "1"}
    assert difference(before, after) == "module `a` changed; module `b` changed; machine changed and 2 more"
    assert difference({}, {"module c": "1"}) == "module `c` is new"
