"""`thingc view`: requests that the server answers or refuses, events after saves, and the page in a real browser."""

from __future__ import annotations

import http.client
import json
import math
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from editor.language_server import wait_until
from live.documents import ROBOT, write
from thingc.targets.html.emit import Page
from thingc.tools.cli.main import main
from thingc.tools.live.server import Server
from viewer.browser import chromium, needed, opened, until

WRONG = ROBOT.replace("yaw_0: 30 deg", "yaw_0: 300 deg")


class News:
    """A client for Server-Sent Events."""

    def __init__(self, address: str) -> None:
        url = urlsplit(address)
        self._connection = http.client.HTTPConnection(url.hostname or "", url.port, timeout=60.0)
        self._connection.request("GET", f"{url.path}events")
        self._answer = self._connection.getresponse()
        assert self._answer.headers["Content-Type"] == "text/event-stream"

    def next(self) -> dict[str, Any]:
        """Return the next event."""
        while True:
            line = self._answer.readline().decode()
            assert line, "the server has gone"
            if line.startswith("data: "):
                found: dict[str, Any] = json.loads(line.removeprefix("data: "))
                return found

    def close(self) -> None:
        self._connection.close()


def asked(address: str, path: str | None = None, method: str = "GET", host: str | None = None) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers and content of one request; `path` is sent unchanged, including dots."""
    url = urlsplit(address)
    connection = http.client.HTTPConnection(url.hostname or "", url.port, timeout=20.0)
    connection.putrequest(method, url.path if path is None else path, skip_host=True)
    connection.putheader("Host", url.netloc if host is None else host)
    connection.endheaders()
    answer = connection.getresponse()
    found = answer.status, dict(answer.headers), answer.read()
    connection.close()
    return found


class Viewing:
    """A `thingc view` process that shows a document."""

    def __init__(self, document: Path, store: str, *words: str, cache: Path | None = None) -> None:
        self.document, self.printed = document, document.parent / "printed.txt"
        with open(self.printed, "w") as stream:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "thingc", "view", document.name, "--no-open", *words], cwd=document.parent, stdout=stream,
                stderr=stream, env={**os.environ, "THINGC_STORE": store, "XDG_CACHE_HOME": str(cache or document.parent / "cache")},
            )
        assert wait_until(lambda: "http://" in self.printed.read_text() or self.process.poll() is not None, 60.0), self.printed.read_text()
        self.address = next(line for line in self.printed.read_text().splitlines() if line.startswith("http://"))


    def end(self) -> None:
        self.process.kill()
        self.process.wait()


@contextmanager
def viewing(folder: Path, store: str, *words: str, text: str = ROBOT) -> Iterator[Viewing]:
    document = write(folder)
    document.write_text(text)
    found = Viewing(document, store, *words)
    try:
        yield found
    finally:
        found.end()


@pytest.fixture
def server() -> Iterator[Server]:
    with Server(editor="odd://open?{file}#{line}&\"<") as made:
        made.tell(Page(name="<b>", data='{"name": "one"}', glb=b"glTF"), 0.5, [])
        yield made


def test_urdf_file_is_shown_and_followed(tmp_path: Path, shared_store: str) -> None:
    file = tmp_path / "robot.urdf"
    text = (Path(__file__).parents[1] / "importing/robots/constructs.urdf").read_text()
    file.write_text(text)
    seen = Viewing(file, shared_store)
    try:
        def robot() -> dict[str, Any]:
            found: dict[str, Any] = json.loads(asked(f"{seen.address}robot.json")[2])["robot"]
            return found

        joints = {one["path"]: (one["file"], one["line"]) for one in robot()["joints"]}
        assert joints["elbow"] == ("robot.urdf", text[: text.index('<joint name="elbow"')].count("\n") + 1)
        mass = robot()["mass"]
        file.write_text(text.replace('<mass value="1.25"/>', '<mass value="1.75"/>'))
        assert wait_until(lambda: robot()["mass"] == pytest.approx(mass + 0.5), 20.0)
        file.write_text(text.replace('<mass value="1.25"/>', '<mass value="-1"/>'))
        assert wait_until(lambda: "error[TC952]" in seen.printed.read_text(), 20.0)
        assert robot()["mass"] == pytest.approx(mass + 0.5), "the last good robot stays"
        assert {one.name for one in tmp_path.iterdir()} == {"robot.urdf", "printed.txt", "cache"}
    finally:
        seen.end()


def test_served_pages_and_headers(server: Server) -> None:
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{20,}/", server.address)
    status, headers, page = asked(server.address)
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8") and b"<title>&lt;b&gt;</title>" in page
    assert re.search(rb'<meta name="thingc-live" content="[0-9a-f]{8} 1 0">', page)
    assert b'<meta name="thingc-editor" content="odd://open?{file}#{line}&amp;&quot;&lt;">' in page
    assert "Access-Control-Allow-Origin" not in headers and headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert headers["Referrer-Policy"] == "no-referrer" and headers["X-Frame-Options"] == "DENY" and headers["Cache-Control"] == "no-store"
    assert asked(f"{server.address}robot.json")[::2] == (200, b'{"robot": {"name": "one"}, "geometry": "Z2xURg=="}')
    status, headers, nothing = asked(f"{server.address}robot.json", method="HEAD")
    assert (status, headers["Content-Length"], nothing) == (200, "50", b"")


def test_refused_requests(server: Server) -> None:
    token = urlsplit(server.address).path
    for path in ("/", "/robot.json", "/x/robot.json", f"{token[:-2]}/robot.json", f"{token}../../../../etc/passwd", f"{token}%2e%2e/x",
                 f"{token}/etc/passwd", f"{token}thingc.toml", "//etc/passwd", f"{token}robot.json/", "", f"/é{token}"):
        status, _, content = asked(server.address, path.encode("latin-1").decode("latin-1") if path.isascii() else "/%C3%A9/robot.json")
        assert (status, content) == (404, b""), path
    for host in ("evil.example", f"evil.example:{server.port}", "127.0.0.1", f"127.0.0.1:{server.port + 1}", ""):
        assert asked(server.address, host=host)[::2] == (421, b""), host
    assert asked(server.address, host=f"localhost:{server.port}")[0] == 200
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH"):
        assert asked(server.address, method=method)[0] == 501
    # nobody but this machine can connect: of all interfaces only the loopback one has the port
    addresses = {str(info[4][0]) for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    for address in addresses:
        if not address.startswith("127."):
            with pytest.raises(OSError):
                socket.create_connection((address, server.port), timeout=2.0)


def test_idle_connections_do_not_block_others(server: Server) -> None:
    """An event stream stays open, even if many later connections are idle, some in the middle of a request."""
    news = News(server.address)
    began, threads = news.next(), threading.active_count()
    with ExitStack() as open_ones:
        idle = [open_ones.enter_context(socket.create_connection(("127.0.0.1", server.port))) for _ in range(255)]
        for one in idle[::2]:
            one.sendall(b"GET / HTTP/1.1\r\nHost:")
        assert asked(server.address)[0] == 200
        assert wait_until(lambda: threading.active_count() < threads + 40, 20.0)
        idle[-1].sendall(b" x\r\n\r\n")
        assert idle[-1].recv(100).startswith(b"HTTP/1.1 421 "), "the last ones are not closed"
    server.tell(None, 0.1, [])
    assert news.next() == {**began, "seconds": 0.1}
    news.close()


def test_events_reach_current_and_late_listeners(server: Server) -> None:
    first = News(server.address)
    began = first.next()
    assert re.fullmatch(r"[0-9a-f]{8}", str(began["run"]))
    assert began == {"run": began["run"], "build": 1, "against": 0, "seconds": 0.5, "kernel": 0.0, "findings": []}
    server.tell(None, 0.1, [{"code": "TC601"}])
    assert first.next() == {**began, "seconds": 0.1, "findings": [{"code": "TC601"}]}
    late = News(server.address)
    assert late.next()["findings"] == [{"code": "TC601"}]
    first.close()
    server.tell(Page(name="two", data='{"name": "two"}', glb=b""), 0.2, [])
    assert late.next()["build"] == 2 and asked(f"{server.address}robot.json")[2].startswith(b'{"robot": {"name": "two"}')
    assert asked(f"{server.address}against.json")[0] == 404
    server.tell_against(Page(name="other", data='{"name": "other"}', glb=b""), [{"code": "TC602"}])
    assert late.next() == {**began, "build": 2, "against": 1, "seconds": 0.2, "findings": [{"code": "TC602"}]}
    assert asked(f"{server.address}against.json")[2] == b'{"robot": {"name": "other"}, "geometry": ""}'


def test_other_robot_is_not_announced_first() -> None:
    with Server() as server:
        server.tell_against(Page(name="other", data='{"name": "other"}', glb=b""))
        listening = News(server.address)
        server.tell(None, 0.1, [])
        told = listening.next()
        assert (told["build"], told["against"]) == (0, 1)


def test_address_of_a_document_is_stable(tmp_path: Path) -> None:
    """This requires the same document, port and key; any other combination, or no key, gives another address."""
    def address(document: str, key: bytes | None, port: int = 0) -> tuple[int, str]:
        with Server(port, document=str(tmp_path / document), key=key) as server:
            return server.port, urlsplit(server.address).path

    port, word = address("a.yaml", b"1" * 32)
    assert address("../" + tmp_path.name + "/a.yaml", b"1" * 32, port) == (port, word)
    others = [address("b.yaml", b"1" * 32, port), address("a.yaml", b"2" * 32, port), address("a.yaml", None, port),
              address("a.yaml", None, port), address("a.yaml", b"1" * 32)]
    assert len({word, *(other for _, other in others)}) == 6


def test_save_updates_the_page(tmp_path: Path, shared_store: str) -> None:
    """With its diagnostics, whose files are relative to the workspace, without writing a build, and compared with the document's earlier
    state. Ctrl-C ends it."""
    with viewing(tmp_path, shared_store, "--against", "robot.yaml") as shown:
        news = News(shown.address)
        assert news.next()["build"] == 1
        shown.document.write_text(WRONG)
        wrong = news.next()
        found = wrong["findings"][0]
        assert (wrong["build"], found["code"], found["file"], found["line"]) == (1, "TC601", "robot.yaml", 23)
        assert found["help"] == "write a value within the limits, or widen the limits"
        shown.document.write_text(ROBOT.replace("120 deg", "125 deg"))
        right = news.next()
        assert (right["build"], right["findings"]) == (2, [])
        joint = next(one for one in json.loads(asked(f"{shown.address}robot.json")[2])["robot"]["joints"] if one["path"] == "yaw_0")
        assert joint["upper"] == pytest.approx(math.radians(125.0))
        page = asked(shown.address)[2].decode()
        own, other = (json.loads(page.partition(f'<script id="thingc-{name}robot" type="application/json">')[2].partition("</script>")[0])
                      for name in ("", "against-"))
        assert next(one for one in own["joints"] if one["path"] == "yaw_0") == joint
        before = next(one for one in other["joints"] if one["path"] == "yaw_0")
        assert before == {**joint, "upper": pytest.approx(math.radians(120.0))}
        assert not (tmp_path / "build").exists()
        shown.process.send_signal(2)
        printed = shown.printed.read_text()
        assert shown.process.wait(20.0) == 0 and "Traceback" not in printed and "the last successful build remains" in printed


def test_saves_of_the_compared_document_are_followed(tmp_path: Path, shared_store: str) -> None:
    """Its diagnostics are shown with those of the first document, which is unchanged. The address is the same after a restart on the
    same port."""
    other = tmp_path / "other.yaml"
    other.write_text(ROBOT)
    with viewing(tmp_path, shared_store, "--against", "other.yaml") as shown:
        news = News(shown.address)
        told = news.next()
        while told["against"] == 0:
            told = news.next()
        other.write_text(ROBOT.replace("120 deg", "125 deg"))
        told = news.next()
        assert (told["build"], told["against"], told["findings"]) == (1, 2, [])
        joint = next(one for one in json.loads(asked(f"{shown.address}against.json")[2])["robot"]["joints"] if one["path"] == "yaw_0")
        assert joint["upper"] == pytest.approx(math.radians(125.0))
        other.write_text(WRONG)
        told = news.next()
        assert (told["against"], [(one["code"], one["file"]) for one in told["findings"]]) == (2, [("TC601", "other.yaml")])
        assert wait_until(lambda: " other.yaml: other.yaml, not built" in shown.printed.read_text(), 5.0), shown.printed.read_text()
        assert re.search(r" other\.yaml: other\.yaml, compiled in \d", shown.printed.read_text())
        shown.process.send_signal(2)
        assert shown.process.wait(20.0) == 0 and "Traceback" not in shown.printed.read_text()
        key = tmp_path / "cache/thingc/view.key"
        assert (key.stat().st_mode & 0o777, key.stat().st_size) == (0o600, 32)
        port = str(urlsplit(shown.address).port)
        again = Viewing(shown.document, shared_store, "--port", port)
        again.end()
        assert again.address == shown.address
        key.chmod(0o644)  # others may have read it
        again = Viewing(shown.document, shared_store, "--port", port)
        again.end()
        assert again.address != shown.address


def test_builds_and_invalid_command_lines(
    tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def run(*words: str) -> tuple[int, str]:
        code = main(words)
        return code, "".join(capfd.readouterr())

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write(tmp_path)
    (tmp_path / "wrong.yaml").write_text(WRONG)
    code, said = run("view", "wrong.yaml", "--no-open", "--against", "wrong.yaml")  # as it is now is nothing
    assert code == 1 and "TC601" in said and "wrong.yaml:23:16" in said
    code, said = run("view", ".", "--no-open")
    assert code == 2 and "there is no build in the folder `.`" in said and "`robot.yaml`" in said
    assert run("build", "robot.yaml", "--emit", "bom")[0] == 0
    for folder in ("build/robot", "build"):
        code, said = run("view", folder, "--no-open")
        assert code == 2 and "the build `build/robot` has no HTML page" in said and "--emit html" in said
    assert run("build", "robot.yaml", "--emit", "html")[0] == 0
    for folder in ("build/robot", "build", "build/robot/html/robot.html"):
        assert run("view", folder, "--no-open") == (0, "build/robot/html/robot.html\n")
    for words in (("--mode", "bench"), ("--port", "4000"), ("--against", "robot.yaml"), ("-p", "reach=1 m"), ("--editor", "x:{file}")):
        code, said = run("view", "build/robot", "--no-open", *words)
        assert code == 2 and f"{words[0]} cannot be used with the build folder `build/robot`" in said
    shutil.copytree(tmp_path / "build/robot", tmp_path / "build/again")
    code, said = run("view", "build", "--no-open")
    assert code == 2 and "`build` contains 2 builds" in said and "use one of the builds: known builds: `build/again`, `build/robot`" in said
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, said = run("view", "robot.yaml", "--no-open", "--port", str(port))
        assert code == 2 and f"cannot use port {port}: Address already in use" in said
    code, said = run("view", "robot.yaml", "--port", "0")
    assert code == 2 and "expected a port from 1 to 65535, found `0`" in said


@needed
def test_page_updates_in_a_browser(tmp_path: Path, shared_store: str) -> None:
    """It starts with an invalid document. Later saves update the page, which keeps its mode and camera. When the server ends, the page
    reports it; then it shows the robot of the next server, and the compared robot."""
    with chromium() as browser, viewing(tmp_path, shared_store, text=WRONG) as shown:
        context = browser.new_context(color_scheme="dark")
        page = context.new_page()
        page.goto(shown.address)
        page.wait_for_selector("#findings a")
        assert page.locator("#findings a").first.get_attribute("href") == f"vscode://file{tmp_path}/robot.yaml:23"
        assert page.locator("#title").inner_text() == "robot.yaml" and "Waiting for" in page.locator("#waiting").inner_text()
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(21, 27, 33)"
        shown.document.write_text(ROBOT)
        page.wait_for_function("() => globalThis.thingc?.ready")
        assert page.locator("#waiting").count() == 0
        with opened(browser, shown.address) as own:
            own.evaluate("() => { thingc.viewer.setMode('held'); thingc.viewer.stage.camera.position.set(0.5, -0.4, 0.3); }")
            before = own.evaluate("() => thingc.viewer.stage.camera.position.toArray()")
            shown.document.write_text(WRONG)
            own.wait_for_selector("#findings a")
            assert "outside its limits" in own.locator("#findings").inner_text()
            shown.document.write_text(ROBOT.replace("count: 2", "count: 3"))
            until(own, "() => thingc.viewer.robot.joints.some((joint) => joint.path === 'yaw_2')")
            assert own.locator("#findings").is_hidden()
            # what the page came with is not asked for again
            assert own.evaluate("performance.getEntriesByType('resource').filter(({ name }) => name.endsWith('robot.json')).length") == 1
            assert own.evaluate("() => thingc.viewer.mode.name") == "held"
            assert own.evaluate("() => thingc.viewer.stage.camera.position.toArray()") == pytest.approx(before, abs=1e-6)
        port = urlsplit(shown.address).port
        page.evaluate("() => thingc.viewer.setMode('held')")
        shown.end()
        page.wait_for_selector("#gone")
        assert page.locator("#gone").inner_text() == f"thingc view has stopped. To reconnect, run it again with --port {port}"
        (tmp_path / "other.yaml").write_text(ROBOT)
        shown.document.write_text(ROBOT.replace("count: 2", "count: 4"))
        again = Viewing(shown.document, shared_store, "--port", str(port), "--against", "other.yaml")
        page.wait_for_function("() => thingc.viewer.robot.joints.some((joint) => joint.path === 'yaw_3')")
        page.wait_for_function("() => thingc.viewer.other !== null")
        assert page.locator("#gone").is_hidden() and page.evaluate("() => thingc.viewer.mode.name") == "held"
        again.end()
