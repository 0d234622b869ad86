"""Fixtures for all tests: the repository, and one geometry store, so that parts are built once per test run. A test fails if thingc
reports a defect of its own (TC899), except with `@pytest.mark.defect`."""

from __future__ import annotations

import atexit
import gc
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# Where nothing that was compiled is to be kept (in many containers), each of a thousand processes would compile thingc anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# `python -m pytest` adds the working folder, from which `--no-code` does not allow Python to import.
sys.path[:] = [path for path in sys.path if os.path.abspath(path) != os.getcwd()]

from conformance.harness import once, thingc_here
from thingc.base.diagnostics import Code, Diagnostic, Report
from thingc.geometry import client
from thingc.geometry.client import Workers
from thingc.geometry.key.environment_variables import environment
from thingc.tools.cli import console
from thingc.tools.templates import TEMPLATES

ROOT = Path(__file__).resolve().parent.parent

# Neither chance nor how fast the machine is today decides about a test. `--hypothesis-profile search` looks at other examples every time.
settings.register_profile("search", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("thingc", settings.get_profile("search"), derandomize=True, max_examples=50)
settings.load_profile("thingc")


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def shared_store(tmp_path_factory: pytest.TempPathFactory) -> str:
    """One store for all test processes of a run. Several of them build parts at the same time, which is a test, too."""
    base = tmp_path_factory.getbasetemp()
    if os.environ.get("PYTEST_XDIST_WORKER"):
        base = base.parent
    store = base / "shared-store"
    store.mkdir(exist_ok=True)
    return str(store)


@pytest.fixture
def in_double_precision() -> Iterator[None]:
    """JAX computes with 64-bit numbers."""
    import jax

    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", False)


class _Kept(Workers):
    """Workers that are not stopped by a service."""

    def close(self) -> None:
        """Keep the workers for the next test."""


_KEPT: dict[object, Workers] = {}


def _kept(_: int, *, seed: int = 0) -> Workers:
    """Return the workers that all tests in this process share. They build two parts at a time, regardless of the requested number. The
    CAD kernel is loaded once, not once per test."""
    return _KEPT.setdefault(tuple(environment(seed).items()), _Kept(2, seed=seed))


def _kept_once(request: Mapping[str, Any]) -> Callable[[], dict[str, Any]]:
    """Send a request to the shared workers, instead of to a new process, which would load the CAD kernel."""
    _kept(2).begin([request])
    return lambda: next(answer for _, answer in _kept(2).run([request]))


@pytest.fixture(scope="session", params=TEMPLATES)
def begun(request: pytest.FixtureRequest, shared_store: str) -> Path:
    """The built document of a workspace that `thingc new` has created, one for each template. Its parts are in the shared store."""
    folder = Path(shared_store).parent / f"begun-{request.param}"

    def begin() -> None:
        assert thingc_here("new", "rover", "--template", request.param, cwd=folder).code == 0
        assert thingc_here("build", "--strict", "rover.yaml", cwd=folder / "rover", store=shared_store).code == 0

    return once(folder, begin) / "rover" / "rover.yaml"


def pytest_sessionfinish() -> None:
    """Stop the shared workers. Afterwards, pytest collects garbage twice, which would visit the objects of all tests each time."""
    for workers in _KEPT.values():
        Workers.close(workers)
    gc.freeze()


DEFECTS: list[str] = []
"""The defects that were reported since the last test, in this process or in the output of another one."""
_SAID = re.compile(rb'error\[TC899\]|title=TC899|\\*"(?:code|id|ruleId)\\*": ?\\*"TC899')


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run files with slow tests first, so that no process is busy alone at the end. `make test` tells xdist to keep this order."""
    slow = Counter(item.path for item in items if item.get_closest_marker("slow") is not None)
    items.sort(key=lambda item: -slow[item.path])


def pytest_collection_finish() -> None:
    """Exclude imported and collected objects from garbage collection, because they exist until the end."""
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)  # as in a command
    gc.enable()
    atexit.register(gc.unfreeze)  # otherwise, nanobind would report its objects as leaks; pytest collects garbage before that
    client.Workers, client.begin_once = _kept, _kept_once  # test modules, which have been imported, have the originals


def pytest_configure(config: pytest.Config) -> None:
    """Record the diagnostics of reports and exceptions in this process, and the output of other processes."""
    gc.disable()  # until all is collected
    say, of_exception, communicate = Report.say, console.of_exception, subprocess.Popen.communicate

    def note(diagnostic: Diagnostic) -> Diagnostic:
        if diagnostic.code is Code.INTERNAL:
            DEFECTS.append(f"{diagnostic.message}\n{diagnostic.detail or ''}")
        return diagnostic

    def to_its_end(self: subprocess.Popen[Any], *arguments: Any, **named: Any) -> tuple[Any, Any]:
        streams = communicate(self, *arguments, **named)
        for stream in streams:
            data = stream.encode("utf-8", "replace") if isinstance(stream, str) else stream or b""
            if _SAID.search(data):
                DEFECTS.append(f"{self.args}\n{data[:4000].decode('utf-8', 'replace')}")
        return streams

    Report.say = lambda self, diagnostic: say(self, note(diagnostic))
    console.of_exception = lambda fault: note(of_exception(fault))
    subprocess.Popen.communicate = to_its_end


@pytest.fixture(autouse=True)
def no_defect(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail a test in which thingc reports a defect of its own, or a test with the mark `defect` without such a report."""
    yield
    met, wanted = DEFECTS.copy(), request.node.get_closest_marker("defect") is not None
    DEFECTS.clear()
    assert bool(met) == wanted, "\n".join(met) or "this test is marked `defect`, and none was met"
