"""The build folder is replaced atomically: kills, concurrent builds, unexpected files, links, full disks."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import resource
import signal
import stat
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from thingc.base.diagnostics import Code, Report
from thingc.driver.output import OutputError, UnexpectedFilesError, unexpected_files, verify, write_build
from thingc.geometry.store.local import BlobMissing, Store
from thingc.targets.artifact import Content, StoredArtifact

DRIVER = Path(__file__).with_name("killed_writer.py")


def with_manifest(files: dict[str, bytes], document: str = "arm.yaml") -> dict[str, Content]:
    listed = {path: hashlib.sha256(data).hexdigest() for path, data in files.items()}
    manifest = {"name": "arm", "document": document, "files": listed}
    return {**files, "manifest.json": json.dumps(manifest).encode()}


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


FIRST = with_manifest({"bom.csv": b"one\n", "stl/a.stl": b"A" * 100})
SECOND = with_manifest({"bom.csv": b"two\n", "step/arm.step": b"B" * 50, "mjcf/assets/a.obj": b"v"})


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(str(tmp_path / "store"))


def build(parent: Path, files: dict[str, Content], store: Store, document: str = "arm.yaml", **more: object) -> Path:
    return Path(write_build(str(parent), "arm", files, store, document, **more))  # type: ignore[arg-type]


def driver(*arguments: str) -> dict[str, object]:
    done = subprocess.run([sys.executable, str(DRIVER), *arguments], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    found: dict[str, object] = json.loads(done.stdout)
    return found


class TestWhole:
    def test_second_build_replaces_the_first(self, tmp_path: Path, store: Store) -> None:
        out = tmp_path / "deep" / "build"
        assert build(out, FIRST, store) == out / "arm"
        assert content(out / "arm") == FIRST
        build(out, SECOND, store)
        assert content(out / "arm") == SECOND
        assert os.listdir(out) == ["arm"], "nothing else is left beside the folder"

    def test_stored_files_are_copied(self, tmp_path: Path, store: Store) -> None:
        sha256 = store.put(b"mesh")
        manifest = {"name": "arm", "document": "arm.yaml", "files": {"stl/a.stl": sha256}}
        files: dict[str, Content] = {"stl/a.stl": StoredArtifact(sha256=sha256, size=4), "manifest.json": json.dumps(manifest).encode()}
        folder = build(tmp_path / "build", files, store)
        (folder / "stl" / "a.stl").write_bytes(b"edited by somebody")
        assert store.read(sha256) == b"mesh"
        assert os.stat(folder / "stl" / "a.stl").st_nlink == 1

    def test_damaged_blob_keeps_the_old_build(self, tmp_path: Path, store: Store) -> None:
        folder = build(tmp_path / "build", FIRST, store)
        sha256 = store.put(b"mesh")
        Path(store.path(sha256)).write_bytes(b"mEsh")
        files = {**with_manifest({}), "a.stl": StoredArtifact(sha256=sha256, size=4)}
        with pytest.raises(BlobMissing):
            build(tmp_path / "build", files, store)
        assert content(folder) == FIRST
        assert os.listdir(tmp_path / "build") == ["arm"]

    def test_manifest_is_required(self, tmp_path: Path, store: Store) -> None:
        with pytest.raises(ValueError, match=r"^a build needs a manifest\.json$"):
            build(tmp_path, {"bom.csv": b""}, store)

    @pytest.mark.parametrize("path", ["../x", "/etc/x", "a/../../x", "a//b", "", ".", "a/.", "a\0b", "..\\x"])
    def test_paths_outside_the_folder_are_rejected(self, tmp_path: Path, store: Store, path: str) -> None:
        with pytest.raises(ValueError, match="is not a path inside the folder|a backslash"):
            build(tmp_path / "build", {**FIRST, path: b"bad"}, store)
        assert os.listdir(tmp_path) == []

    @pytest.mark.parametrize("name", ["..", ".", "a/b", "/x", ""])
    def test_names_outside_the_parent_are_rejected(self, tmp_path: Path, store: Store, name: str) -> None:
        with pytest.raises(ValueError, match="is not a path inside the folder|must not contain `/`"):
            write_build(str(tmp_path / "build"), name, FIRST, store, "arm.yaml")
        assert os.listdir(tmp_path) == []

    def test_path_as_file_and_folder_is_rejected(self, tmp_path: Path, store: Store) -> None:
        with pytest.raises(ValueError, match="'stl' is both a file and a folder"):
            build(tmp_path, {**FIRST, "stl": b""}, store)


class TestKilled:
    def test_kill_at_every_step_with_exchange(self, tmp_path: Path) -> None:
        found = driver(str(tmp_path), "every", "exchange")
        assert found["damaged"] == [] and found["litter"] == []
        assert found["absent"] == 0
        assert int(str(found["steps"])) > 30 and "os.rename" not in list(found["events"])  # type: ignore[call-overload]

    def test_kill_at_every_step_with_two_renames(self, tmp_path: Path) -> None:
        found = driver(str(tmp_path), "every", "renames")
        assert found["damaged"] == [] and found["litter"] == []
        assert found["absent"] == 1, "between the two renames, and only there; the next run mends it"

    def test_kill_at_random_times(self, tmp_path: Path) -> None:
        found = driver(str(tmp_path), "random", "7", "40")
        assert found["damaged"] == []
        assert int(str(found["different"])) > 5, "the kills must come at different places"
        assert found["left"] == ["arm"]


    def test_build_interrupted_between_renames_is_restored(self, tmp_path: Path, store: Store) -> None:
        """Also if the next build fails and has no replacement."""
        folder = build(tmp_path, FIRST, store)
        folder.rename(tmp_path / ".arm.thingc-old")
        (tmp_path / ".arm.thingc-new").mkdir()
        with pytest.raises(BlobMissing):
            build(tmp_path, {**SECOND, "a.stl": StoredArtifact(sha256="0" * 64, size=4)}, store)
        assert content(folder) == FIRST
        assert os.listdir(tmp_path) == ["arm"]


class TestTwoAtOnce:
    def test_concurrent_build_waits_and_reports_it(self, tmp_path: Path, store: Store) -> None:
        folder = build(tmp_path, FIRST, store)
        lock = os.open(tmp_path / ".arm.thingc-lock", os.O_RDWR | os.O_CREAT)
        fcntl.flock(lock, fcntl.LOCK_EX)
        said: list[str] = []
        waiting = threading.Event()

        def on_wait(what: str) -> None:
            said.append(what)
            waiting.set()

        second = threading.Thread(target=lambda: build(tmp_path, SECOND, store, on_wait=on_wait))
        second.start()
        assert waiting.wait(20)
        assert content(folder) == FIRST, "nothing happens while the lock is held"
        os.unlink(tmp_path / ".arm.thingc-lock")  # as the first build leaves it
        os.close(lock)
        second.join(20)
        assert said == [str(folder)]
        assert content(folder) == SECOND
        assert os.listdir(tmp_path) == ["arm"]

    def test_single_build_does_not_wait(self, tmp_path: Path, store: Store) -> None:
        said: list[str] = []
        build(tmp_path, FIRST, store, on_wait=said.append)
        assert said == []

    def test_reader_always_sees_a_complete_build(self, tmp_path: Path) -> None:
        code = (
            "import sys; sys.path.insert(0, sys.argv[3]); import killed_writer as w\n"
            "for version in range(int(sys.argv[2]), 100, 2): w.write(sys.argv[1], version)\n"
        )
        writers = [
            subprocess.Popen([sys.executable, "-c", code, str(tmp_path), str(first), str(DRIVER.parent)], stderr=subprocess.PIPE)
            for first in (1, 2)
        ]
        seen: set[int] = set()
        while any(writer.poll() is None for writer in writers):
            try:
                seen.add(json.loads((tmp_path / "arm" / "manifest.json").read_bytes())["version"])
            except FileNotFoundError:
                assert not seen, "once there, the folder is always there"
        assert [writer.communicate()[1] for writer in writers] == [b"", b""]
        assert len(seen) > 5
        last = verify(str(tmp_path / "arm"))
        assert last is not None and last["version"] in (98, 99)
        assert os.listdir(tmp_path) == ["arm"]


class TestStrangers:
    def test_unexpected_files_stop_the_build(self, tmp_path: Path, store: Store) -> None:
        folder = build(tmp_path, FIRST, store)
        (folder / "notes.txt").write_text("mine")
        (folder / "stl" / "extra.stl").write_text("mine")
        before = content(folder)
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, SECOND, store)
        assert raised.value.names == ("notes.txt", "stl/extra.stl")
        assert raised.value.folder == str(folder)
        assert content(folder) == before
        assert os.listdir(tmp_path) == ["arm"]

    def test_diagnostic_of_unexpected_files(self, tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        folder = build(tmp_path, FIRST, store)
        for number in range(10):
            (folder / f"note_{number}").touch()
        report = Report()
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, SECOND, store)
        report.say(raised.value.diagnostic)
        (said,) = report.diagnostics
        assert said.code is Code.UNEXPECTED
        assert said.span is None
        names = ", ".join(f"`note_{number}`" for number in range(8))
        assert said.message == f"`arm` contains unknown files ({names} and 2 more)"
        assert said.help == "move the files, or build into another folder with -o, or use --force"

    def test_build_of_another_document_is_kept(self, tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        folder = build(tmp_path, with_manifest({"bom.csv": b"one"}, "other.yaml"), store, "other.yaml")
        words = r"^`arm` contains the build of another document \(`other.yaml`\)$"
        with pytest.raises(UnexpectedFilesError, match=words):
            build(tmp_path, FIRST, store)
        assert (folder / "bom.csv").read_bytes() == b"one"

    @pytest.mark.parametrize("manifest", [
        b"", b"{", b"[]", b'{"name": "arm"}', b'{"name": 1, "document": "arm.yaml", "files": {}}',
        b'{"name": "arm", "document": "arm.yaml", "files": ["notes.txt"]}', b"[" * 100_000,
    ])
    def test_foreign_manifest_is_an_unexpected_file(self, tmp_path: Path, store: Store, manifest: bytes) -> None:
        (tmp_path / "arm").mkdir()
        (tmp_path / "arm" / "manifest.json").write_bytes(manifest)
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, FIRST, store)
        assert raised.value.names == ("manifest.json",)

    def test_empty_folders_are_removed(self, tmp_path: Path, store: Store) -> None:
        (tmp_path / "arm" / "stl" / "empty").mkdir(parents=True)
        folder = build(tmp_path, FIRST, store)
        assert content(folder) == FIRST
        assert not (folder / "stl" / "empty").exists()

    def test_file_in_place_of_the_folder_is_an_error(self, tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "arm").write_text("mine")
        with pytest.raises(OutputError, match="^the build folder `arm` is a file$"):
            build(tmp_path, FIRST, store)
        assert (tmp_path / "arm").read_text() == "mine"

    def test_edited_files_are_kept_without_force(
        self, tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.chdir(tmp_path)
        folder = build(tmp_path, FIRST, store)
        (folder / "bom.csv").write_text("one\nand a line of mine\n")
        before = content(folder)
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, SECOND, store)
        assert str(raised.value) == "`arm` contains modified files (`bom.csv`)"
        assert raised.value.names == ("bom.csv",) and content(folder) == before
        (folder / "notes.txt").touch()
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, SECOND, store)
        assert str(raised.value) == (
            "`arm` contains unknown files (`notes.txt`) and modified files (`bom.csv`)"
        )
        build(tmp_path, SECOND, store, force=True)
        assert content(folder) == SECOND and os.listdir(tmp_path) == ["arm"]

    def test_edit_with_equal_size_and_time_is_detected(self, tmp_path: Path, store: Store) -> None:
        """Only the content is compared, not sizes or times."""
        folder = build(tmp_path, FIRST, store)
        state = (folder / "stl" / "a.stl").stat()
        (folder / "stl" / "a.stl").write_bytes(b"B" * 100)
        os.utime(folder / "stl" / "a.stl", ns=(state.st_atime_ns, state.st_mtime_ns))
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, SECOND, store)
        assert raised.value.names == ("stl/a.stl",)

    def test_touched_files_without_changes_are_replaced(self, tmp_path: Path, store: Store) -> None:
        folder = build(tmp_path, FIRST, store)
        (folder / "bom.csv").write_bytes(bytes(FIRST["bom.csv"]))  # type: ignore[arg-type]
        os.utime(folder / "stl" / "a.stl", (1, 1))
        build(tmp_path, SECOND, store)
        assert content(folder) == SECOND

    def test_missing_or_emptied_files_are_written_again(self, tmp_path: Path, store: Store) -> None:
        folder = build(tmp_path, FIRST, store)
        (folder / "bom.csv").unlink()
        (folder / "stl" / "a.stl").write_bytes(b"")
        assert verify(str(folder)) is None
        build(tmp_path, SECOND, store)
        assert content(folder) == SECOND

    @pytest.mark.parametrize("name", [
        "thesis.tex", "stl/notes.txt", "mjcf/assets/deep/a.obj", "mjcf/.xml/a", ".git/config", "bom.csv.bak", "STL/a.stl", "a/bom.csv",
    ])
    def test_manifest_cannot_claim_files_no_target_writes(self, tmp_path: Path, store: Store, name: str) -> None:
        """Otherwise, anyone who can edit the manifest could make the next build delete any file by listing its correct hash."""
        folder = build(tmp_path, FIRST, store)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("mine")
        listed = {**json.loads((folder / "manifest.json").read_text())["files"], name: hashlib.sha256(b"mine").hexdigest()}
        (folder / "manifest.json").write_text(json.dumps({"name": "arm", "document": "arm.yaml", "files": listed}))
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, SECOND, store)
        assert raised.value.names == (name,) and (folder / name).read_text() == "mine"

    def test_manifest_cannot_claim_files_outside(self, tmp_path: Path, store: Store) -> None:
        (tmp_path / "precious.stl").write_text("mine")
        folder = build(tmp_path, FIRST, store)
        outside = {"../precious.stl": hashlib.sha256(b"mine").hexdigest(), str(tmp_path / "precious.stl"): "0" * 64}
        listed = {**json.loads((folder / "manifest.json").read_text())["files"], **outside}
        (folder / "manifest.json").write_text(json.dumps({"name": "arm", "document": "arm.yaml", "files": listed}))
        assert verify(str(folder)) is None
        build(tmp_path, SECOND, store, force=True)
        assert content(folder) == SECOND and (tmp_path / "precious.stl").read_text() == "mine"

    def test_files_that_are_rewritten_may_have_any_name(self, tmp_path: Path, store: Store) -> None:
        """A target of another package may use any file name without declaring it."""
        own = with_manifest({"weights.txt": b"1"})
        folder = build(tmp_path, own, store)
        build(tmp_path, with_manifest({"weights.txt": b"2"}), store)
        with pytest.raises(UnexpectedFilesError):
            build(tmp_path, FIRST, store)
        assert (folder / "weights.txt").read_bytes() == b"2"

    @pytest.mark.parametrize("owner", ["other.yaml", None])
    def test_force_does_not_replace_foreign_folders(self, tmp_path: Path, store: Store, owner: str | None) -> None:
        if owner is None:
            (tmp_path / "arm").mkdir()
            (tmp_path / "arm" / "thesis.tex").write_text("years of work")
        else:
            build(tmp_path, with_manifest({"bom.csv": b"one"}, owner), store, owner)
        before = content(tmp_path / "arm")
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, FIRST, store, force=True)
        assert "--force" not in raised.value.diagnostic.help and content(tmp_path / "arm") == before

    def test_force_keeps_files_created_during_the_build(self, tmp_path: Path) -> None:
        class Meddler(Store):
            def read(self, sha256: str) -> bytes:
                (tmp_path / "arm" / "late.txt").write_text("mine")
                return super().read(sha256)

        store = Meddler(str(tmp_path / "store"))
        folder = build(tmp_path, FIRST, store)
        (folder / "early.txt").touch()
        stored = StoredArtifact(sha256=store.put(b"mesh"), size=4)
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, {**SECOND, "stl/late.stl": stored}, store, force=True)
        assert "late.txt" in raised.value.names and (folder / "late.txt").read_text() == "mine"

    @pytest.mark.parametrize("how", ["exchange", "renames"])
    def test_file_created_during_the_build_is_kept(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
        """A file is saved into the old build while the new one is written, which is when the store is read."""

        class Meddler(Store):
            def read(self, sha256: str) -> bytes:
                (tmp_path / "arm" / "thesis.txt").write_text("mine")
                return super().read(sha256)

        if how == "renames":
            def refuse(a: str, b: str) -> None:
                raise NotImplementedError
            monkeypatch.setattr("thingc.driver.output.exchange", refuse)
        store = Meddler(str(tmp_path / "store"))
        folder = build(tmp_path, FIRST, store)
        sha256 = store.put(b"mesh")
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path, {**SECOND, "late.stl": StoredArtifact(sha256=sha256, size=4)}, store)
        assert raised.value.names == ("thesis.txt",)
        assert ".thingc-" not in str(raised.value)
        assert content(folder) == {**FIRST, "thesis.txt": b"mine"}
        assert sorted(os.listdir(tmp_path)) == ["arm", "store"]


class TestLinks:
    def test_link_targets_are_never_deleted(self, tmp_path: Path, store: Store) -> None:
        precious = tmp_path / "precious"
        precious.mkdir()
        (precious / "a.stl").write_text("mine")
        folder = build(tmp_path / "build", FIRST, store)
        os.unlink(folder / "stl" / "a.stl")
        os.rmdir(folder / "stl")
        os.symlink(precious, folder / "stl")
        assert unexpected_files(str(folder), "arm.yaml").names == ("stl",)
        with pytest.raises(UnexpectedFilesError):
            build(tmp_path / "build", SECOND, store)
        os.unlink(folder / "stl")
        os.unlink(folder / "bom.csv")
        os.symlink(precious / "a.stl", folder / "bom.csv")
        with pytest.raises(UnexpectedFilesError) as raised:
            build(tmp_path / "build", SECOND, store)
        assert raised.value.names == ("bom.csv",)
        build(tmp_path / "build", SECOND, store, force=True)
        assert content(folder) == SECOND
        assert (precious / "a.stl").read_text() == "mine"

    def test_linked_folder_is_replaced_at_its_target(self, tmp_path: Path, store: Store) -> None:
        (tmp_path / "big_disk" / "out").mkdir(parents=True)
        (tmp_path / "build").mkdir()
        os.symlink(tmp_path / "big_disk" / "out", tmp_path / "build" / "arm")
        for files in (FIRST, SECOND):
            build(tmp_path / "build", files, store)
            assert (tmp_path / "build" / "arm").is_symlink()
            assert content(tmp_path / "big_disk" / "out") == files
        assert os.listdir(tmp_path / "big_disk") == ["out"]

    def test_linked_parent_is_supported(self, tmp_path: Path, store: Store) -> None:
        (tmp_path / "big_disk").mkdir()
        os.symlink("big_disk", tmp_path / "build")
        build(tmp_path / "build", FIRST, store)
        build(tmp_path / "build", SECOND, store)
        assert content(tmp_path / "big_disk" / "arm") == SECOND
        assert os.listdir(tmp_path / "big_disk") == ["arm"]

    def test_dangling_link_is_created(self, tmp_path: Path, store: Store) -> None:
        os.symlink(tmp_path / "later" / "arm", tmp_path / "arm")
        build(tmp_path, FIRST, store)
        assert content(tmp_path / "later" / "arm") == FIRST


class TestRefused:
    def test_parent_that_is_a_file_is_an_error(self, tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "build").write_text("mine")
        with pytest.raises(OutputError) as raised:
            build(tmp_path / "build", FIRST, store)
        assert str(raised.value) == "cannot write the build to `build/arm`: File exists"
        assert raised.value.diagnostic.help == "move the existing file, or build into another folder with -o"

    def test_too_long_file_name_is_an_error(self, tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        with pytest.raises(OutputError) as raised:
            build(tmp_path, with_manifest({f"{'a' * 300}.stl": b"x"}), store)
        assert str(raised.value) == "cannot write the build to `arm`: File name too long"
        assert raised.value.diagnostic.help == (
            "use shorter names in the document, or build into another folder with -o"
        )

    def test_unwritable_file_system_is_an_error(self, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir("/")
        report = Report()
        with pytest.raises(OutputError) as raised:
            write_build("/proc/self", "arm", FIRST, store, "arm.yaml")
        report.say(raised.value.diagnostic)
        (said,) = report.diagnostics
        assert said.code is Code.OUTPUT
        assert said.message.startswith("cannot write the build to `proc/self/arm`: ")
        assert said.help is not None and said.help.endswith(", or build into another folder with -o")
        assert "space" not in said.help

    def test_full_disk_keeps_the_old_build(self, tmp_path: Path, store: Store) -> None:
        """The operating system fails in the middle of a file, in a separate process with a file size limit (RLIMIT_FSIZE)."""
        folder = build(tmp_path, FIRST, store)
        big = with_manifest({"a.stl": b"x" * 1000, "b.stl": b"x" * 200_000})
        child = os.fork()
        if child == 0:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
            try:
                build(tmp_path, big, store)
            except OutputError as fault:
                os._exit(7 if str(fault).startswith("not enough disk space for the build in `") else 8)
            os._exit(9)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
        assert content(folder) == FIRST
        assert os.listdir(tmp_path) == ["arm"]

    def test_read_only_folder_is_replaced_and_deleted(self, store: Store) -> None:
        """As an unprivileged user, the old build can be moved away; it must be deleted so that it does not block the next build."""
        with tempfile.TemporaryDirectory() as name:
            parent = Path(name)
            folder = build(parent, FIRST, store)
            if os.getuid() == 0:
                for place in (parent, folder, *folder.rglob("*")):
                    os.chown(place, 65534, 65534)
            for place in (folder / "stl", folder):
                place.chmod(stat.S_IRUSR | stat.S_IXUSR)
            child = os.fork()
            if child == 0:
                try:
                    if os.getuid() == 0:
                        os.setgid(65534)
                        os.setuid(65534)
                    build(parent, SECOND, store)
                    build(parent, FIRST, store)
                except BaseException as fault:
                    os.write(2, repr(fault).encode())
                    os._exit(1)
                os._exit(0)
            assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
            assert content(folder) == FIRST
            assert os.listdir(parent) == ["arm"]


class TestVerify:
    def test_complete_build_is_verified(self, tmp_path: Path, store: Store) -> None:
        folder = build(tmp_path, FIRST, store)
        assert verify(str(folder)) == json.loads(bytes(FIRST["manifest.json"]))  # type: ignore[arg-type]

    @pytest.mark.parametrize("damage", ["edit", "delete", "add", "link", "pipe", "manifest", "folder"])
    def test_damaged_build_is_not_verified(self, tmp_path: Path, store: Store, damage: str) -> None:
        folder = build(tmp_path, FIRST, store)
        bom = folder / "bom.csv"
        if damage == "edit":
            bom.write_bytes(b"One\n")
        elif damage == "add":
            (folder / "more").touch()
        elif damage == "manifest":
            (folder / "manifest.json").unlink()
        elif damage == "folder":
            folder.rename(tmp_path / "gone")
        else:
            bom.rename(tmp_path / "bom.csv")
            if damage == "link":
                bom.symlink_to(tmp_path / "bom.csv")
            elif damage == "pipe":
                os.mkfifo(bom)
        assert verify(str(folder)) is None

    def test_additional_empty_folder_is_ignored(self, tmp_path: Path, store: Store) -> None:
        folder = build(tmp_path, FIRST, store)
        (folder / "empty").mkdir()
        assert verify(str(folder)) is not None
