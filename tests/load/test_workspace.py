"""Finding and parsing the workspace of a document."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from thingc.base.diagnostics import Code, Report
from thingc.base.package_info import PackageInfo
from thingc.documents.workspace import Tessellation, Workspace, _parse_workspace, _validate_located


def find(document: Path) -> tuple[Workspace | None, Report]:
    report = Report()
    return Workspace.find(str(document), report), report


def test_default_workspace_is_the_document_folder(tmp_path: Path) -> None:
    workspace, report = find(tmp_path / "a.yaml")
    assert not report.diagnostics
    assert workspace is not None
    assert workspace == Workspace(
        root=str(tmp_path), parts=(), packages=("thingc_stock", "bd_warehouse"), build=str(tmp_path / "build"),
        part_timeout=120.0, mesh=Tessellation(linear=1e-4, angular=math.radians(10)),
        simulation=Tessellation(linear=1e-4, angular=math.radians(30)), origin=None,
    )
    (tmp_path / "parts").mkdir()
    again, _ = find(tmp_path / "a.yaml")
    assert again is not None
    assert again.parts == (str(tmp_path / "parts"),)


def test_nearest_workspace_file_is_used(tmp_path: Path) -> None:
    for folder in ("p/q/deep", "p/q/models", "p/parts"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "p/thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "p/pyproject.toml").write_text("[tool.thingc\n")  # not looked at: thingc.toml is nearer
    outer, report = find(tmp_path / "p/q/deep/a.yaml")
    assert not report.diagnostics
    assert outer is not None
    assert outer.root == str(tmp_path / "p")
    assert outer.parts == (str(tmp_path / "p/parts"),)
    (tmp_path / "p/q/pyproject.toml").write_text(
        '[project]\nname = "x"\n[tool.thingc]\nthingc = "workspace/1"\nparts = ["models", "."]\npackages = []\nbuild = "out/b"\n'
        'part_timeout = "2 min"\nmesh = {linear = "0.5 mm", angular = "20 deg"}\n'
    )
    inner, report = find(tmp_path / "p/q/deep/a.yaml")
    assert not report.diagnostics
    assert inner is not None
    assert (inner.root, inner.parts, inner.packages) == (
        str(tmp_path / "p/q"), (str(tmp_path / "p/q/models"), str(tmp_path / "p/q")), (),
    )
    assert (inner.build, inner.part_timeout, inner.mesh.linear) == (str(tmp_path / "p/q/out/b"), 120.0, 0.0005)
    assert inner.mesh.angular == pytest.approx(math.radians(20), rel=1e-15)
    assert inner.simulation == Tessellation(linear=inner.mesh.linear, angular=math.radians(30))  # never finer unless it is written


def test_simulation_mesh_settings(tmp_path: Path) -> None:
    (tmp_path / "thingc.toml").write_text(HEAD + 'mesh = {linear = "20 um", simulation = {angular = "0.5 rad"}}\n')
    workspace, report = find(tmp_path / "a.yaml")
    assert not report.diagnostics
    assert workspace is not None
    assert workspace.mesh == Tessellation(linear=pytest.approx(2e-5), angular=math.radians(10))
    assert workspace.simulation == Tessellation(linear=1e-4, angular=0.5)


def test_package_maintainer_settings(tmp_path: Path) -> None:
    unsaid, _ = find(tmp_path / "a.yaml")
    assert unsaid is not None
    assert unsaid.about == PackageInfo(maintainer="TODO", mail="todo@todo.todo", license="TODO: License declaration", version="0.0.0")
    said = 'maintainer = "Ada L. <ada@example.org>", license = "MIT", version = "1.2.3"'
    (tmp_path / "thingc.toml").write_text(f"{HEAD}about = {{{said}}}\n")
    workspace, report = find(tmp_path / "a.yaml")
    assert not report.diagnostics and workspace is not None
    assert workspace.about == PackageInfo(maintainer="Ada L.", mail="ada@example.org", license="MIT", version="1.2.3")


def test_pyproject_without_our_table_is_ignored(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    for text in ("[project]\n", "broken = = toml\n", "# thingc\n[tool.other]\n", "broken = = thingc\n"):
        (tmp_path / "sub/pyproject.toml").write_text(text)
        workspace, report = find(tmp_path / "sub/a.yaml")
        assert not report.diagnostics
        assert workspace is not None
        assert workspace.root == str(tmp_path)


def test_inputs_contain_all_examined_files(tmp_path: Path) -> None:
    (tmp_path / "p/q").mkdir(parents=True)
    text = b'thingc = "workspace/1"\n'
    (tmp_path / "p/thingc.toml").write_bytes(text)
    (tmp_path / "p/q/pyproject.toml").write_bytes(b"[project]\n")
    workspace, _ = find(tmp_path / "p/q/a.yaml")
    assert workspace is not None
    assert workspace.inputs == {
        str(tmp_path / "p/q/thingc.toml"): None, str(tmp_path / "p/q/pyproject.toml"): hashlib.sha256(b"[project]\n").hexdigest(),
        str(tmp_path / "p/thingc.toml"): hashlib.sha256(text).hexdigest(), str(tmp_path / "p/parts"): None,
    }


def test_relative_and_contains_resolve_links(tmp_path: Path) -> None:
    (tmp_path / "real/in").mkdir(parents=True)
    (tmp_path / "out").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    (tmp_path / "real/escape").symlink_to(tmp_path / "out")
    workspace, _ = find(tmp_path / "link/a.yaml")
    assert workspace is not None
    assert workspace.root == str(tmp_path / "link")
    assert workspace.relative(str(tmp_path / "link/in/x.yaml")) == "in/x.yaml"
    assert workspace.relative(str(tmp_path / "real/in/x.yaml")) == "in/x.yaml"
    assert workspace.contains(str(tmp_path / "real/in/new.yaml"))
    assert workspace.contains(str(tmp_path / "link"))
    assert not workspace.contains(str(tmp_path / "link/escape/x"))
    assert not workspace.contains(str(tmp_path / "link/../out"))
    assert not workspace.contains(str(tmp_path / "real-too"))


HEAD = 'thingc = "workspace/1"\n'


def test_default_part_folder_must_not_link_outside(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "in").mkdir()
    (tmp_path / "in/parts").symlink_to(tmp_path / "out")
    (tmp_path / "in/thingc.toml").write_text(HEAD)
    workspace, report = find(tmp_path / "in/a.yaml")
    assert workspace is None
    assert [(one.code, one.message) for one in report.diagnostics] == [(Code.OUTSIDE_WORKSPACE, "`parts` is outside the workspace")]


@pytest.mark.parametrize(("text", "code", "message", "help", "place"), [
    ("parts = []\n", Code.HEADER, "the key `thingc` is missing",
     'start the document with `thingc = "workspace/1"`', (1, 1)),
    ('thingc = "workspace/2"\n', Code.HEADER, "unknown version `2` of `workspace`", 'write `thingc = "workspace/1"`', (1, 10)),
    ('thingc = "assembly/1"\n', Code.WRONG_KIND, "expected a document of kind `workspace`, found `assembly`",
     'write `thingc = "workspace/1"`', (1, 10)),
    (HEAD + 'part = ["parts"]\n', Code.UNKNOWN_KEY, "unknown key `part`", "did you mean `parts`?", (2, 1)),
    (HEAD + 'parts = "parts"\n', Code.WRONG_TYPE, "expected a list, found the string `parts`", "write `[parts]`", (2, 9)),
    (HEAD + "parts = [3]\n", Code.WRONG_TYPE, "expected a string, found the number `3`", 'write `"3"`', (2, 10)),
    (HEAD + 'parts = ["prts"]\n', Code.WORKSPACE_FOLDER, "the workspace has no folder `prts`", "did you mean `parts`?", (2, 10)),
    (HEAD + 'parts = ["../x"]\n', Code.OUTSIDE_WORKSPACE, "`../x` is outside the workspace",
     "use a folder inside the folder of `thingc.toml`",
     (2, 10)),
    (HEAD + 'parts = ["/x"]\n', Code.OUTSIDE_WORKSPACE, "`/x` is an absolute path", "write a path relative to `thingc.toml`", (2, 10)),
    (HEAD + 'build = "/tmp/x"\n', Code.OUTSIDE_WORKSPACE, "`/tmp/x` is an absolute path", "write a path relative to `thingc.toml`",
     (2, 9)),
    (HEAD + "part_timeout = 120\n", Code.BAD_UNIT, "a time needs a unit, found `120`", "write `120 s` or `120 ms`", (2, 16)),
    (HEAD + 'part_timeout = "2 mm"\n', Code.WRONG_DIMENSION, "expected a time (such as 2 ms), found a length (`2 mm`)", None,
     (2, 16)),
    (HEAD + 'part_timeout = "-2 s"\n', Code.BAD_QUANTITY, "expected a value above 0, found `-2 s`", None, (2, 16)),
    (HEAD + 'part_timeout = "=2 s"\n', Code.BAD_EXPRESSION, "a workspace has no parameters: write a plain value", None, (2, 16)),
    (HEAD + 'mesh = {liner = "1 mm"}\n', Code.UNKNOWN_KEY, "unknown key `liner` in `mesh`", "did you mean `linear`?", (2, 9)),
    (HEAD + 'mesh = {linear = "1 mmm"}\n', Code.BAD_UNIT, "unknown unit `mmm`; did you mean `mm`?", None, (2, 21)),
    (HEAD + "mesh = 3\n", Code.WRONG_TYPE, "expected a mapping with `linear`, `angular`, `simulation`, found the number `3`", None,
     (2, 8)),
    (HEAD + "mesh = []\n", Code.WRONG_TYPE, "expected a mapping with `linear`, `angular`, `simulation`, found an empty list", None,
     (2, 8)),
    (HEAD + 'mesh = ["simulation"]\n', Code.WRONG_TYPE, "expected a mapping with `linear`, `angular`, `simulation`, found a list of 1 item",
     None, (2, 8)),
    (HEAD + "mesh = {simulation = []}\n", Code.WRONG_TYPE, "expected a mapping with `linear`, `angular`, found an empty list", None,
     (2, 22)),
    (HEAD + 'mesh = {simulation = {angular = "10 mm"}}\n', Code.WRONG_DIMENSION,
     "expected an angle (such as 30 deg), found a length (`10 mm`)", None, (2, 33)),
    (HEAD + 'mesh = {simulation = {linear = "0 mm"}}\n', Code.BAD_QUANTITY, "expected a value above 0, found `0 mm`", None, (2, 32)),
    (HEAD + "a b\n", Code.SYNTAX, "expected `=` after the key", "write `key = value`", (2, 3)),
])
def test_invalid_settings(tmp_path: Path, text: str, code: Code, message: str, help: str | None, place: tuple[int, int]) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "thingc.toml").write_text(text)
    workspace, report = find(tmp_path / "a.yaml")
    assert workspace is None
    assert [(d.code, d.message, d.help, d.span and (d.span.line, d.span.column)) for d in report.diagnostics] == [
        (code, message, help, place)
    ]


def test_errors_in_pyproject_have_their_position(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text('[project]\n\n[tool.thingc]\nthingc = "workspace/1"\nbild = "x"\n')
    workspace, report = find(tmp_path / "a.yaml")
    assert workspace is None
    (found,) = report.diagnostics
    assert found.span is not None
    assert (found.message, found.span.line, found.span.column) == ("unknown key `bild`", 5, 1)
    (tmp_path / "pyproject.toml").write_text("[tool.thingc]\nthingc = workspace/1\n")
    assert find(tmp_path / "a.yaml")[1].diagnostics[0].code is Code.SYNTAX


_texts = st.sampled_from(["parts", ".", "none", "../x", "/x", "", "parts/../parts"])
_times = st.sampled_from(["120 s", "2 min", "0 s", "-1 s", "=3 s", "5", "2 mm", "x"])
_abouts = st.fixed_dictionaries({}, optional={
    "maintainer": st.sampled_from(["Ada <ada@example.org>", "Ada", "ada@example.org", "<ada@example.org>", "A\tB <a@b.org>", 3]),
    "license": st.sampled_from(["Apache-2.0", "", "a\nb", 3]), "version": st.sampled_from(["1.0.0", "1.0", 3]), "name": st.just("x"),
})
_compats = st.sampled_from([[], ["mjx"], ["pymjcf", "mjx"], ["MJX"], "mjx", [3]])
_uris = st.sampled_from(["relative", "package", "absolute", "packages", 3, []])


@settings(max_examples=60)
@given(
    parts=st.none() | st.lists(_texts, max_size=2) | st.just("parts"), build=st.none() | _texts | st.just(3),
        timeout=st.none() | _times | st.just(5), mesh_uri=st.none() | _uris, about=st.none() | _abouts | st.just(["license"]),
    compat=st.none() | _compats,
    mesh=st.none() | st.fixed_dictionaries({},
        optional={"linear": st.sampled_from(["1 mm", "1 deg"]), "angular": st.sampled_from(["5 deg", "0 deg"]),
            "x": st.just("1"), "simulation": st.sampled_from([{}, {"linear": "1 mm"}, {"angular": "0 rad"}, {"y": "1"}, "1 mm"])}),
)
def test_fast_parser_and_model_agree(
    tmp_path_factory: pytest.TempPathFactory, parts: object, build: object, timeout: object, mesh_uri: object,
    about: object, compat: object, mesh: object,
) -> None:
    """The fast parser and the document model accept the same files and read the same values."""
    import tomlkit

    table = {"parts": parts, "build": build, "part_timeout": timeout, "mesh_uri": mesh_uri, "about": about}
    table |= {"compat": compat, "mesh": mesh}
    text = HEAD + tomlkit.dumps({key: value for key, value in table.items() if value is not None})
    folder = tmp_path_factory.mktemp("w")
    (folder / "parts").mkdir()
    path = str(folder / "thingc.toml")
    quick, exact = Report(), Report()
    first = _parse_workspace(path, text.encode(), str(folder), {}, quick)
    second = _validate_located(path, text.encode(), str(folder), (), {}, exact)
    assert (first is None) == (second is None), text
    assert quick.diagnostics == exact.diagnostics
    if first is not None and second is not None:
        assert replace(first, origin=second.origin) == second


def test_valid_file_is_read_without_heavy_imports(tmp_path: Path) -> None:
    (tmp_path / "thingc.toml").write_text(HEAD + 'part_timeout = "60 s"\n')
    program = (
        "import sys; from thingc.documents.workspace import Workspace; from thingc.base.diagnostics import Report; "
        f"assert Workspace.find({str(tmp_path / 'a.yaml')!r}, Report()).part_timeout == 60.0; "
        "print(sorted({'pydantic', 'yaml', 'tree_sitter'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.strip() == "[]"
