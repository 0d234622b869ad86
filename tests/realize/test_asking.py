"""Impure inputs of parts (environment, time, randomness and so on) are reported with their line; harmless calls are not."""

from __future__ import annotations

import contextlib
import io
import json
import os
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from thingc.geometry.record import ImpureInputs, PartRecord
from thingc.tools.cli.main import main

HEAD = """\
import datetime, logging, os, random, secrets, socket, subprocess, tempfile, time, uuid, warnings
from datetime import date, datetime as moment
from random import shuffle
from time import time as now
from build123d import *
from helper import shuffled
"""
HELPER = "import random\n\n\ndef shuffled(values):\n    random.shuffle(values)\n    return values\n"

ASKS = {
    "os.environ['SIZE'] if 'SIZE' in os.environ else 1": ImpureInputs.ENVIRONMENT,
    "os.environ.get('SIZE')": ImpureInputs.ENVIRONMENT,
    "os.getenv('SIZE', '3')": ImpureInputs.ENVIRONMENT,
    "os.environb.get(b'SIZE')": ImpureInputs.ENVIRONMENT,
    "os.path.expandvars('$SIZE')": ImpureInputs.ENVIRONMENT,
    "time.time()": ImpureInputs.CLOCK,
    "now()": ImpureInputs.CLOCK,
    "time.strftime('%Y')": ImpureInputs.CLOCK,
    "time.localtime()": ImpureInputs.CLOCK,
    "moment.now()": ImpureInputs.CLOCK,
    "datetime.datetime.now(datetime.timezone.utc)": ImpureInputs.CLOCK,
    "date.today()": ImpureInputs.CLOCK,
    "type('Own', (moment,), {}).utcnow()": ImpureInputs.CLOCK,
    "random.random()": ImpureInputs.CHANCE,
    "shuffle([1, 2])": ImpureInputs.CHANCE,
    "random.seed()": ImpureInputs.CHANCE,
    "random.Random().random()": ImpureInputs.CHANCE,
    "random.SystemRandom().random()": ImpureInputs.CHANCE,
    "secrets.token_hex()": ImpureInputs.CHANCE,
    "os.urandom(8)": ImpureInputs.CHANCE,
    "uuid.uuid4()": ImpureInputs.CHANCE,
    "uuid.uuid1()": ImpureInputs.CHANCE,
    "__import__('numpy').random.default_rng()": ImpureInputs.CHANCE,
    "__import__('numpy').random.rand()": ImpureInputs.CHANCE,
    "__import__('numpy').random.RandomState()": ImpureInputs.CHANCE,
    "subprocess.run(['true'])": ImpureInputs.PROCESS,
    "subprocess.run('true', shell=True)": ImpureInputs.PROCESS,
    "os.system('true')": ImpureInputs.PROCESS,
    "os.waitpid(os.fork() or os._exit(0), 0)": ImpureInputs.PROCESS,
    "os.waitpid(os.posix_spawn('/bin/true', ['true'], {}), 0)": ImpureInputs.PROCESS,
    "socket.getaddrinfo('localhost', 9)": ImpureInputs.NETWORK,
    "logging.getLogger('x').warning('%s', now())": ImpureInputs.CLOCK,
}
"""An expression of a part, and the kind of impure input that it reads."""

SILENT = (
    "os.environ['PATH'] + os.environ['HOME'] + tempfile.gettempdir()",
    "os.environ.setdefault and os.environ.__setitem__('MINE', '1') or os.environ['MINE']",
    "dict(os.environ)",
    "tempfile.mkstemp()",
    "logging.getLogger('x').warning('a remark')",
    "time.strftime('%Y', time.gmtime(0)), time.localtime(0), time.sleep(0)",
    "moment(2020, 1, 1), moment.fromtimestamp(0), moment.strptime('2020', '%Y'), date.fromisoformat('2020-01-01')",
    "random.Random(7).random()",
    "random.seed(7), random.random(), shuffle([1, 2]), shuffled([1, 2])",
    "random.setstate(random.Random(7).getstate()), random.random()",
    "__import__('numpy').random.default_rng(7).random(), __import__('numpy').random.RandomState(7).rand()",
    "__import__('numpy').random.seed(7), __import__('numpy').random.rand()",
    "uuid.uuid5(uuid.NAMESPACE_DNS, 'thingc')",
    "__import__('asyncio'), __import__('multiprocessing')",
    "extrude(Text('a', 10), 1)",
)
"""Expressions without impure inputs, or whose result is always the same."""


def module(expressions: Any) -> str:
    """Return a module with functions `part_0`, `part_1`, ... that each evaluate one expression on its own line."""
    return HEAD + "".join(f"def part_{k}():\n    {text}\n    return Box(1, 1, 1)\n" for k, text in enumerate(expressions))


@pytest.fixture(scope="module")
def records(module_place: Any, define: Callable[..., Any]) -> dict[str, PartRecord]:
    """Return the records of all parts, modelled once."""
    module_place.write("parts/asks.py", module(ASKS))
    module_place.write("parts/silent.py", module(SILENT))
    module_place.write("parts/helper.py", HELPER)
    definitions = [define(f"asks:part_{k}") for k in range(len(ASKS))] + [define(f"silent:part_{k}") for k in range(len(SILENT))]
    with module_place.service() as service:
        found = service.realize(definitions)
    failed = {text: answer for text, answer in found.items() if not isinstance(answer, PartRecord)}
    assert failed == {}
    return found


@pytest.mark.parametrize("number", range(len(ASKS)), ids=list(ASKS))
def test_impure_input_is_reported_at_its_line(records: dict[str, PartRecord], module_place: Any, number: int) -> None:
    text = list(ASKS)[number]
    (warning,) = (one for one in records[f"asks:part_{number}"].warnings if one.asked)  # Python itself warns of some
    assert warning.asked is ASKS[text]
    assert warning.file == str(module_place.parts / "asks.py")
    assert (module_place.parts / "asks.py").read_text().splitlines()[(warning.line or 0) - 1].strip() == text


@pytest.mark.parametrize("number", range(len(SILENT)), ids=SILENT)
def test_pure_expressions_are_not_reported(records: dict[str, PartRecord], number: int) -> None:
    assert records[f"silent:part_{number}"].warnings == ()


def test_impure_input_in_helper_module_is_reported_there(place: Any, define: Callable[..., Any]) -> None:
    """A helper module in the part folder is code of the author, so the warning points into the helper."""
    place.write("parts/helper.py", HELPER)
    place.write("parts/arm.py", HEAD + "def part():\n    shuffled([1, 2])\n    return Box(1, 1, 1)\n")
    with place.service() as service:
        (warning,) = service.realize([define("arm:part")])["arm:part"].warnings
    assert (warning.file, warning.line) == (str(place.parts / "helper.py"), 5)


def test_impure_input_in_library_is_reported_at_the_caller(place: Any, define: Callable[..., Any]) -> None:
    """`networkx.random_layout` uses randomness; the warning points to the line of the part that calls it."""
    text = """
        from build123d import Box
        def part():
            import networkx
            x, y = networkx.random_layout(networkx.path_graph(2))[0]
            return Box(1 + x, 1 + y, 1)
    """
    place.write("parts/arm.py", text)
    with place.service() as service:
        (warning,) = service.realize([define("arm:part")])["arm:part"].warnings
    assert (warning.asked, warning.line) == (ImpureInputs.CHANCE, 5)


ROBOT = """\
thingc: assembly/1
name: robot
materials: {pla: {density: 1240 kg/m^3}}
defaults: {component: {material: pla}}
components:
  block: {part: arm:Block}
  other: {part: arm:Other, at: {in: block.origin, xyz: 0 0 100 mm}}
"""
ARM = """\
import os
from build123d import Box
from thingc import Thing
SIZE = float(os.environ.get("SIZE", 30))
class Block(Thing):
    def result(self):
        return Box(SIZE, 1, 1)
class Other(Thing):
    def result(self):
        assert "SIZE" not in os.environ
        return Box(SIZE, SIZE, 1)
"""


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, Any]]:
    """Return a function that runs a command on a robot whose parts read a variable, and returns the exit code and the diagnostics as
    JSON."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/arm.py").write_text(ARM)
    (tmp_path / "robot.yaml").write_text(ROBOT)
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("THINGC_STORE", str(tmp_path / "store"))
    monkeypatch.setenv("SIZE", "5")

    def run(*words: str) -> tuple[int, Any]:
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            code = main([*words, "robot.yaml", "--format", "json"])
        return code, json.loads(out.getvalue())

    return run


def test_impure_input_is_reported_when_part_is_cached(robot: Callable[..., tuple[int, Any]]) -> None:
    said = []
    for words in (("check",), ("build",), ("build", "--emit", "bom")):
        code, answer = robot(*words)
        assert code == 0
        said.append([(one["code"], one["message"], [note["line"] for note in one["notes"]]) for one in answer["diagnostics"]])
    wanted = "reads the environment variable `SIZE`, which parts cannot use"
    first = [("TC408", f"`arm:Block` {wanted}", [4]), ("TC408", f"`arm:Other` {wanted}", [10])]
    assert said == [first, first, first]
    assert answer["modelled"] == []
    assert robot("check", "--strict")[0] == 1
    assert robot("build", "--strict")[0] == 1


def test_lock_file_reports_impure_inputs(robot: Callable[..., tuple[int, Any]]) -> None:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        assert main(["lock"]) == 0
        assert main(["lock", "--check"]) == 0
    os.environ["THINGC_STORE"] = os.path.abspath("empty")
    code, answer = robot("check", "--no-code")
    assert code == 0 and [one["code"] for one in answer["diagnostics"]] == ["TC408", "TC408"]
    lock = Path("parts.lock.json")
    lock.write_text(lock.read_text().replace('"environment", "reads', '"weather", "reads'))
    assert {one["code"] for one in robot("check", "--no-code")[1]["diagnostics"]} == {"TC342"}


def test_missing_environment_variable_is_named(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/arm.py", textwrap.dedent("""
        import os
        from build123d import Box
        def part():
            return Box(float(os.environ["WIDTH"]), 1, 1)
    """))
    with place.service() as service:
        failure = service.realize([define("arm:part")])["arm:part"]
    assert failure.message == "KeyError: 'WIDTH'; the environment of parts does not contain `WIDTH`"
