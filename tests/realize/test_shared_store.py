"""A store behind a URL: an FTP server in another process, and the `file` and `memory` protocols of fsspec.

A "machine" is a separate cache folder and a separate copy of the workspace."""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from thingc.geometry.store.local import BlobMissing, Store, StoreUnusable
from thingc.geometry.store.shared_store import SharedStore, open_store
from variants.robots import batch_here, tree, workspace

SERVER = """
import sys
from pyftpdlib.authorizers import DummyAuthorizer
from pyftpdlib.handlers import FTPHandler
from pyftpdlib.servers import FTPServer
authorizer = DummyAuthorizer()
authorizer.add_user("robot", "secret", sys.argv[1], perm="elradfmw")
FTPHandler.authorizer = authorizer
server = FTPServer(("127.0.0.1", 0), FTPHandler)
print(server.socket.getsockname()[1], flush=True)
server.serve_forever()
"""

STANDS = """
    thingc: variants/1
    assembly: stand.yaml
    name: stands
    parameters: {side: [30 mm]}
    emit: [mjcf, step]
"""
BATCH = ("batch", "stands.yaml", "--jobs", "1", "--pictures", "none")


@pytest.fixture
def ftp(tmp_path: Path) -> Iterator[tuple[str, Path, subprocess.Popen[str]]]:
    """Yield the URL of a folder on a server, the folder, and the server process."""
    folder = tmp_path / "served"
    folder.mkdir()
    process = subprocess.Popen([sys.executable, "-c", SERVER, str(folder)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        port = int(process.stdout.readline())
        yield f"ftp://robot:secret@127.0.0.1:{port}/parts", folder / "parts", process
    finally:
        process.kill()
        process.wait()


def machine(folder: Path, url: str) -> tuple[Path, dict[str, str]]:
    """Return a workspace and the environment of a machine with an empty cache."""
    env = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache"), "THINGC_STORE": url, "NO_COLOR": "1"}
    return workspace(folder / "work", stands=STANDS), env


@pytest.mark.slow
def test_second_machine_models_nothing(tmp_path: Path, ftp: tuple[str, Path, subprocess.Popen[str]]) -> None:
    url, served, process = ftp
    one, env = machine(tmp_path / "one", url)
    first = batch_here(*BATCH[1:], cwd=one, env=env)
    assert first.returncode == 0 and "1 built; 3 parts modelled" in first.stderr, first.stderr
    blobs = [path for path in (served / "blobs").rglob("*") if path.is_file()]
    assert blobs and all(hashlib.sha256(path.read_bytes()).hexdigest() == path.parent.name + path.name for path in blobs)
    two, env = machine(tmp_path / "two", url)
    second = batch_here(*BATCH[1:], cwd=two, env=env)
    assert second.returncode == 0 and "1 built; 0 parts modelled" in second.stderr, second.stderr
    assert tree(one / "build/stands/variants") == tree(two / "build/stands/variants")

    blobs[0].write_bytes(b"damaged")  # it is made anew, and mended there
    three, env = machine(tmp_path / "three", url)
    third = batch_here(*BATCH[1:], cwd=three, env=env)
    assert third.returncode == 0, third.stderr
    assert tree(one / "build/stands/variants") == tree(three / "build/stands/variants")
    if "0 parts modelled" not in third.stderr:  # a blob that a record needs
        assert hashlib.sha256(blobs[0].read_bytes()).hexdigest() == blobs[0].parent.name + blobs[0].name

    process.kill()
    process.wait()
    four, env = machine(tmp_path / "four", url)
    begun = time.monotonic()
    gone = batch_here(*BATCH[1:], cwd=four, env=env)
    assert time.monotonic() - begun < 60.0
    assert gone.returncode != 0 and "error[TC805]" in gone.stderr and "ftp://127.0.0.1" in gone.stderr, gone.stderr
    assert "secret" not in gone.stderr and "Traceback" not in gone.stderr


@pytest.mark.parametrize("protocol", ["file", "memory"])
def test_entries_are_visible_to_other_machines(tmp_path: Path, protocol: str) -> None:
    url = (tmp_path / "there").as_uri() if protocol == "file" else f"memory://{tmp_path.name}"
    one, two = SharedStore(url, str(tmp_path / "one")), SharedStore(url, str(tmp_path / "two"))
    sha256 = one.put(b"a mesh")
    assert not two.has(sha256)  # nothing speaks of it yet
    one.put_json("record", "a part", {"meshes": [[sha256, 6]], "text": "box"})
    one.put_json("stamp", "this machine", {"of": sha256})
    assert two.get_json("record", "a part") == {"meshes": [[sha256, 6]], "text": "box"}
    assert two.get_json("stamp", "this machine") is None and two.get_json("record", "another") is None
    assert two.has(sha256, 6) and two.read(sha256) == b"a mesh"
    assert Store(str(tmp_path / "two")).read(sha256) == b"a mesh"  # without the URL from now on
    with pytest.raises(BlobMissing):
        two.read("0" * 64)
    two.put_json("record", "a part", {"text": "another box"})
    assert SharedStore(url, str(tmp_path / "three")).get_json("record", "a part") == {"text": "another box"}


def test_damaged_remote_entries_are_absent_and_replaced(tmp_path: Path) -> None:
    there = tmp_path / "there"
    one = SharedStore(there.as_uri(), str(tmp_path / "one"))
    sha256 = one.put(b"a mesh")
    one.put_json("record", "a part", [sha256])
    for path in there.rglob("*"):
        if path.is_file():
            path.write_bytes(path.read_bytes()[:-1] + b"x")
    two = SharedStore(there.as_uri(), str(tmp_path / "two"))
    assert two.get_json("record", "a part") is None and not two.has(sha256)
    two.put(b"a mesh")
    two.put_json("record", "a part", [sha256])
    three = SharedStore(there.as_uri(), str(tmp_path / "three"))
    assert three.get_json("record", "a part") == [sha256] and three.read(sha256) == b"a mesh"


def test_swapped_remote_entries_are_absent(tmp_path: Path) -> None:
    there = tmp_path / "there"
    one = SharedStore(there.as_uri(), str(tmp_path / "one"))
    one.put_json("record", "a part", "box")
    one.put_json("record", "another", "ball")
    first, second = (there / "record").glob("*/*")
    held = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(held)
    two = SharedStore(there.as_uri(), str(tmp_path / "two"))
    assert two.get_json("record", "a part") is None and two.get_json("record", "another") is None
    assert [two.get_json("record", key) for key in ("a part", "another")] == [None, None]  # now from its folder
    two.put_json("record", "a part", "box")
    assert SharedStore(there.as_uri(), str(tmp_path / "three")).get_json("record", "a part") == "box"


def test_blobs_are_uploaded_before_their_entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = SharedStore((tmp_path / "there").as_uri(), str(tmp_path / "one"))
    order: list[str] = []
    send = SharedStore._send
    monkeypatch.setattr(SharedStore, "_send", lambda self, path, data: (order.append(path), send(self, path, data))[1])
    blobs = [store.put(data) for data in (b"one", b"two")]
    store.put_json("record", "a part", {"meshes": blobs})
    assert sorted(order[:2]) == sorted(map(store.path, blobs)) and len(order) == 3
    store.put_json("record", "another", {"meshes": blobs})
    assert len(order) == 4  # the files are sent once


def test_concurrent_folder_creation(tmp_path: Path, ftp: tuple[str, Path, subprocess.Popen[str]]) -> None:
    """Six machines send their first entry to an empty server at the same time. A folder that another machine has just created is not an
    error."""
    url, served, _ = ftp
    processes = multiprocessing.get_context("fork")
    start = processes.Barrier(6, timeout=20)

    def machine(number: int) -> None:
        store = SharedStore(url, str(tmp_path / f"machine{number}"))
        store.has("0" * 64)  # connects
        for turn in range(5):
            start.wait()
            store.put_json("record", f"{turn}{number}".ljust(64, "0"), {"of": number})

    machines = [processes.Process(target=machine, args=(number,)) for number in range(6)]
    for one in machines:
        one.start()
    for one in machines:
        one.join()
    assert [one.exitcode for one in machines] == [0] * 6
    assert len([path for path in served.rglob("*") if path.is_file()]) == 30


@pytest.mark.parametrize(("url", "words"), [("nosuch://host/parts", "nosuch"), ("ftp://127.0.0.1:9/parts", "refused")])
def test_unusable_urls_are_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, url: str, words: str) -> None:
    monkeypatch.setenv("THINGC_STORE", url)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(StoreUnusable, match=words):
        open_store(None).check()


def test_folder_argument_overrides_the_url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THINGC_STORE", "memory://elsewhere")
    found = open_store(str(tmp_path))
    assert type(found) is Store and found.root == str(tmp_path)
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(StoreUnusable, match=r"thingc\[cluster\]"):
        open_store(None)
