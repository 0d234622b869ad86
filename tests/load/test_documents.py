"""`load`: referenced documents are followed, found, restricted to the workspace and read once."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from thingc.base.diagnostics import Code, Report
from thingc.documents.load.discovery import MOST_FILES, MOST_FOLDERS, documents_in
from thingc.documents.load.documents import Documents, load
from thingc.documents.workspace import Workspace

HEAD = "thingc: assembly/1\nname: x\n"

NO_FILE = "write the path relative to this document"


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def read(folder: Path, files: dict[str, str], root: str = "a.yaml") -> tuple[Documents | None, Report]:
    write(folder, files)
    report = Report()
    workspace = Workspace.find(str(folder / root), report)
    assert workspace is not None
    return load(str(folder / root), workspace, report), report


def said(report: Report) -> list[tuple[Code, str, str | None, tuple[str, int, int] | None]]:
    return [
        (d.code, d.message, d.help, None if d.span is None else (Path(d.span.file).name, d.span.line, d.span.column))
        for d in report.diagnostics
    ]


def test_documents_are_followed_and_read_once(tmp_path: Path) -> None:
    documents, report = read(tmp_path, {
        "thingc.toml": 'thingc = "workspace/1"\n',
        "robots/a.yaml": HEAD + "materials: [../m.yaml]\ncomponents:\n"
        "  l: {assembly: sub/b.toml}\n  r: {assembly: sub/b.toml}\n  t: {assembly: c.yml}\n",
        "robots/sub/b.toml": 'thingc = "assembly/1"\nname = "b"\nmaterials = ["../../m.yaml"]\n'
        '[components.x]\nassembly = "../c.yml"\n',
        "robots/c.yml": HEAD + "components: {p: {part: a:B}}\n",
        "m.yaml": "thingc: materials/1\nmaterials: {}\n",
    }, "robots/a.yaml")
    assert not report.diagnostics
    assert documents is not None
    assert list(documents.by_path) == ["robots/a.yaml", "m.yaml", "robots/sub/b.toml", "robots/c.yml"]
    root = documents.root
    assert root.path == str(tmp_path / "robots/a.yaml")
    assert root.sha256 == hashlib.sha256((tmp_path / "robots/a.yaml").read_bytes()).hexdigest()
    nested = documents.find_referenced(root, "sub/b.toml")
    assert nested is documents.by_path["robots/sub/b.toml"]
    assert documents.find_referenced(nested, "../c.yml") is documents.by_path["robots/c.yml"]
    assert documents.find_referenced(root, "nowhere.yaml") is None


def test_paths_are_relative_to_the_referring_document(tmp_path: Path) -> None:
    documents, report = read(tmp_path, {
        "a.yaml": HEAD + "components: {s: {assembly: sub/b.yaml}}\n",
        "sub/b.yaml": HEAD + "components: {s: {assembly: c.yaml}}\n",
        "c.yaml": HEAD + "components: {s: {part: a:B}}\n",
    })
    assert documents is not None
    assert said(report) == [(Code.MISSING_FILE, "there is no file `c.yaml`", NO_FILE, ("b.yaml", 3, 28))]


@pytest.mark.parametrize(("line", "code", "message", "help", "place"), [
    ("materials: [material.yaml]", Code.MISSING_FILE, "there is no file `material.yaml`", "did you mean `materials.yaml`?",
     (3, 13)),
    ("components: {x: {assembly: nest/b.yaml}}", Code.MISSING_FILE, "there is no file `nest/b.yaml`",
     "the folder `nest/` does not exist", (3, 28)),
    ("components: {x: {assembly: /etc/b.yaml}}", Code.OUTSIDE_WORKSPACE, "`/etc/b.yaml` is an absolute path",
     "write a path relative to this document", (3, 28)),
    ("components: {x: {assembly: ~/b.yaml}}", Code.OUTSIDE_WORKSPACE, "`~/b.yaml` is an absolute path",
     "write a path relative to this document", (3, 28)),
    ("components: {x: {assembly: 'C:\\b.yaml'}}", Code.OUTSIDE_WORKSPACE, "`C:\\b.yaml` is an absolute path",
     "write a path relative to this document", (3, 28)),
    ("components: {x: {assembly: ../b.yaml}}", Code.OUTSIDE_WORKSPACE, "`../b.yaml` is outside the workspace",
     "move the file into the folder of `thingc.toml`", (3, 28)),
    ("components: {x: {file: ../motor.step}}", Code.OUTSIDE_WORKSPACE, "`../motor.step` is outside the workspace",
     "move the file into the folder of `thingc.toml`", (3, 24)),
    ("components: {x: {file: link/motor.step}}", Code.OUTSIDE_WORKSPACE, "`link/motor.step` is outside the workspace",
     "move the file into the folder of `thingc.toml`", (3, 24)),
    ("components: {x: {file: motr.step}}", Code.MISSING_FILE, "there is no file `motr.step`", "did you mean `motor.step`?",
     (3, 24)),
    ("components: {x: {file: motor.iges}}", Code.FILE_TYPE,
     "expected a part file (.step, .stp, .brep, .stl, .3mf, .obj, .ply, .off, .glb, .gltf), found `motor.iges`", None, (3, 24)),
    ("components: {x: {assembly: motor.step}}", Code.FILE_TYPE,
     "expected an assembly document (.yaml, .yml, .toml), found `motor.step`", None, (3, 28)),
    ("components: {x: {assembly: folder.yaml}}", Code.MISSING_FILE, "`folder.yaml` is a folder, not a file", None, (3, 28)),
    ("components: {x: {assembly: ''}}", Code.MISSING_FILE,
     "expected the path of an assembly document, found an empty string", None, (3, 28)),
    ("components: {x: {assembly: materials.yaml}}", Code.WRONG_KIND,
     "expected an assembly document, found `materials.yaml` of kind `materials`", None, (3, 28)),
    ("materials: [other.yaml]", Code.WRONG_KIND, "expected a materials document, found `other.yaml` of kind `assembly`", None,
     (3, 13)),
])
def test_invalid_paths_are_reported(
    tmp_path: Path, line: str, code: Code, message: str, help: str | None, place: tuple[int, int],
) -> None:
    outside, inside = tmp_path / "outside", tmp_path / "inside"
    write(outside, {"motor.step": "x"})
    (inside / "folder.yaml").mkdir(parents=True)
    (inside / "link").symlink_to(outside)
    _, report = read(inside, {
        "a.yaml": HEAD + line + "\n", "materials.yaml": "thingc: materials/1\nmaterials: {}\n", "motor.step": "x",
        "motor.iges": "x",
        "other.yaml": HEAD + "components: {p: {part: a:B}}\n",
    })
    found = said(report)
    assert len(found) == 1
    assert found[0][:2] == (code, message)
    assert found[0][3] == ("a.yaml", *place)
    if help is not None:
        assert found[0][2] == help


def test_link_inside_the_workspace_is_one_document(tmp_path: Path) -> None:
    write(tmp_path, {"b.yaml": HEAD + "components: {p: {part: a:B}}\n"})
    (tmp_path / "l.yaml").symlink_to(tmp_path / "b.yaml")
    documents, report = read(tmp_path, {"a.yaml": HEAD + "components: {x: {assembly: l.yaml}, y: {assembly: b.yaml}}\n"})
    assert not report.diagnostics
    assert documents is not None
    assert list(documents.by_path) == ["a.yaml", "b.yaml"]
    assert documents.find_referenced(documents.root, "l.yaml") is documents.find_referenced(documents.root, "b.yaml")


def test_cycle_is_reported_with_every_step(tmp_path: Path) -> None:
    documents, report = read(tmp_path, {
        "a.yaml": HEAD + "components:\n  x: {assembly: b.yaml}\n",
        "b.yaml": HEAD + "components:\n  part: {part: a:B}\n  y: {assembly: c.yaml}\n",
        "c.yaml": HEAD + "components:\n  z:\n    assembly: b.yaml\n",
    })
    assert said(report) == [
        (Code.DOCUMENT_CYCLE, "`b.yaml` contains itself: b.yaml -> c.yaml -> b.yaml", "remove one of the components that form the cycle",
         ("b.yaml", 5, 17)),
    ]
    notes = report.diagnostics[0].notes
    assert [(n.message, n.span and (Path(n.span.file).name, n.span.line, n.span.column)) for n in notes] == [
        ("`c.yaml` contains `b.yaml` here", ("c.yaml", 5, 15)),
    ]
    assert documents is not None
    assert documents.broken == {"b.yaml", "c.yaml"}
    assert list(documents.by_path) == ["a.yaml", "b.yaml", "c.yaml"]


def test_document_that_contains_itself(tmp_path: Path) -> None:
    documents, report = read(tmp_path, {"a.yaml": HEAD + "components: {x: {assembly: a.yaml}}\n"})
    assert [entry[1] for entry in said(report)] == ["`a.yaml` contains itself: a.yaml -> a.yaml"]
    assert documents is not None
    assert documents.broken == {"a.yaml"}


def test_nesting_depth_is_limited(tmp_path: Path) -> None:
    files = {f"d{n}.yaml": HEAD + f"components: {{x: {{assembly: d{n + 1}.yaml}}}}\n" for n in range(110)}
    _, report = read(tmp_path, files, "d0.yaml")
    assert [entry[:2] for entry in said(report)] == [(Code.TOO_LARGE, "more than 100 levels of nested assemblies")]


@pytest.mark.parametrize(("text", "code", "message", "help", "place"), [
    ("", Code.NOT_A_MAPPING, "the document is empty", "start the document with `thingc: assembly/1`", (1, 1)),
    ("# nothing\n", Code.NOT_A_MAPPING, "the document is empty", "start the document with `thingc: assembly/1`", (1, 1)),
    ("---\n", Code.NOT_A_MAPPING, "the document is empty", "start the document with `thingc: assembly/1`", (1, 1)),
    ("- a\n", Code.NOT_A_MAPPING, "a document must be a mapping, found a list", "start the document with `thingc: assembly/1`", (1, 1)),
    ("words\n", Code.NOT_A_MAPPING, "a document must be a mapping, found a string", "start the document with `thingc: assembly/1`", (1, 1)),
    ('thingc = "assembly/1"\n[components]\n', Code.NOT_A_MAPPING, "a document must be a mapping, found a string",
     "rename the TOML document to `a.toml`, or start the document with `thingc: assembly/1`", (1, 1)),
    ("thingc:assembly/1\n", Code.NOT_A_MAPPING, "a document must be a mapping, found a string",
     "add a space after the colon: `thingc: assembly/1`", (1, 1)),
    ("name: x\n", Code.HEADER, "the key `thingc` is missing",
     "start the document with `thingc: assembly/1`", (1, 1)),
    ("{}\n", Code.HEADER, "the key `thingc` is missing",
     "start the document with `thingc: assembly/1`", (1, 1)),
    ("thing: assembly/1\n", Code.HEADER, "expected the key `thingc`, found `thing`", "did you mean `thingc`?", (1, 1)),
    ("thingc: asembly/1\n", Code.HEADER, "unknown kind of document `asembly`", "did you mean `assembly`?", (1, 9)),
    ("thingc: foo/1\n", Code.HEADER, "unknown kind of document `foo`",
     "known kinds: `assembly`, `calibration`, `materials`, `variants`, `workspace`", (1, 9)),
    ("thingc: assembly\n", Code.HEADER, "the version of `assembly` is missing", "write `thingc: assembly/1`", (1, 9)),
    ("thingc: assembly/2\n", Code.HEADER, "unknown version `2` of `assembly`", "write `thingc: assembly/1`", (1, 9)),
    ("thingc: 1\n", Code.HEADER, "expected a kind and a version in `thingc`, found `1`", "write, for example, `thingc: assembly/1`",
     (1, 9)),
    ("thingc:\n", Code.HEADER, "expected a kind and a version in `thingc`, found nothing",
     "write, for example, `thingc: assembly/1`", (1, 1)),
    ("thingc: materials/1\nmaterials: {}\n", Code.WRONG_KIND, "expected a document of kind `assembly`, found `materials`",
     "use the assembly that lists this document", (1, 9)),
    ("thingc: variants/1\nassembly: b.yaml\n", Code.WRONG_KIND,
     "expected an assembly document, found a variants document",
     "use `thingc batch` to build variants, or use an assembly document", (1, 9)),
])
def test_invalid_headers(tmp_path: Path, text: str, code: Code, message: str, help: str | None, place: tuple[int, int]) -> None:
    documents, report = read(tmp_path, {"a.yaml": text})
    assert documents is None
    assert said(report) == [(code, message, help, ("a.yaml", *place))]


def test_unreadable_files_are_reported(tmp_path: Path) -> None:
    workspace = Workspace.find(str(tmp_path / "a.yaml"), Report())
    assert workspace is not None
    for name, code, message in (
        ("none.yaml", Code.UNREADABLE, "cannot read `none.yaml`: no such file or directory"),
        ("arm.txt", Code.FILE_TYPE, "expected a document (.yaml, .yml, .toml), found `arm.txt`"),
    ):
        report = Report()
        assert load(str(tmp_path / name), workspace, report) is None
        assert said(report) == [(code, message, None, None)]


def test_other_document_kinds_are_loaded_on_request(tmp_path: Path) -> None:
    write(tmp_path, {"m.yaml": "thingc: materials/1\nmaterials: {}\n"})
    report = Report()
    workspace = Workspace.find(str(tmp_path / "m.yaml"), report)
    assert workspace is not None
    documents = load(str(tmp_path / "m.yaml"), workspace, report, kinds=("assembly", "materials"))
    assert documents is not None
    assert documents.root.kind == "materials"


def test_errors_of_all_documents_are_reported_in_one_run(tmp_path: Path) -> None:
    _, report = read(tmp_path, {
        "a.yaml": HEAD + "materials: [m.yaml, n.yaml]\ncomponents: {x: {assembly: b.yaml}, y: {assembly: c.yaml}}\n",
        "b.yaml": HEAD + "name: y\n", "c.yaml": "a:\n\tb\n", "m.yaml": "thingc: materials/3\n",
    })
    assert [(entry[0], entry[3]) for entry in said(report)] == [
        (Code.HEADER, ("m.yaml", 1, 9)), (Code.MISSING_FILE, ("a.yaml", 3, 21)), (Code.DUPLICATE_KEY, ("b.yaml", 3, 1)),
        (Code.SYNTAX, ("c.yaml", 2, 1)),
    ]


def test_documents_are_recognized_by_their_key(tmp_path: Path) -> None:
    """The key `thingc` must be at the top level: a script of that name in a table of pyproject.toml does not count."""
    write(tmp_path, {
        "a.toml": '# first\nthingc = "assembly/1"\n[components]\n', "b.yaml": "# first\n\nthingc: assembly/one\n",
        "pyproject.toml": '[project]\nname = "robots"\n[project.scripts]\nthingc = "thingc.__main__:entry"\n',
        "thingc.toml": 'thingc = "workspace/1"\n',
    })
    assert [Path(path).name for path in documents_in(str(tmp_path))] == ["a.toml", "b.yaml"]


def test_search_without_workspace_file_is_limited(tmp_path: Path) -> None:
    """A single document may be in a home folder: its editor must not wait for a search of everything below."""
    for number in range(MOST_FOLDERS + 20):
        (tmp_path / f"d{number:03}" / "inner").mkdir(parents=True)
        (tmp_path / f"d{number:03}" / "a.yaml").write_text("thingc: assembly/1\n")
        (tmp_path / f"d{number:03}" / "inner" / "b.yaml").write_text("thingc: assembly/1\n")
    loose = Workspace.find(str(tmp_path / "robot.yaml"), Report())
    assert len(documents_in(str(tmp_path), loose)) == MOST_FOLDERS - 1, "this folder, and those nearest to it"
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    whole = Workspace.find(str(tmp_path / "robot.yaml"), Report())
    assert len(documents_in(str(tmp_path), whole)) == 2 * (MOST_FOLDERS + 20)


def test_number_of_files_without_workspace_file_is_limited(tmp_path: Path) -> None:
    for number in range(MOST_FILES + 10):
        (tmp_path / f"{number:04}.yaml").write_text("thingc: assembly/1\n")
    loose = Workspace.find(str(tmp_path / "robot.yaml"), Report())
    assert len(documents_in(str(tmp_path), loose)) == MOST_FILES
