"""Speculative modelling: parts that start before their parameters are confirmed are used if they match, and stopped otherwise."""

from __future__ import annotations

import time
from typing import Any

import psutil
import pytest

from realize.conftest import modelled_parts
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.geometry.service import GeometryService

BLOCK = """
    from build123d import Box
    from thingc import Length, Thing

    class Block(Thing):
        def __init__(self, width: Length = 30, height: Length = 5):
            super().__init__()
            self.body = Box(width, 10, height)

        def result(self):
            return self.body
"""


@pytest.fixture
def sent(place: Any, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the requests that the workers of a place receive, in order."""
    found: list[str] = []
    send = place.workers._send
    monkeypatch.setattr(place.workers, "_send", lambda worker, request: (found.append(request["op"]), send(worker, request))[1])
    return found


def made(service: GeometryService, *, like: PartDefinition | None = None) -> PartRecord | PartFailure:
    """Return the service's answer for the block with its defaults, or for a given definition."""
    schema = service.describe(["blocks:Block"])["blocks:Block"]
    assert isinstance(schema, PartSchema), schema
    definition = like or schema.default
    assert definition is not None
    return service.realize([definition])[definition.text]


@pytest.mark.parametrize(("old", "new"), [("width: Length = 30", "width: Length = 31.7"), ("Box(width, 10", "Box(width, 11.3")])
def test_matching_speculative_part_is_modelled_once(place: Any, sent: list[str], old: str, new: str) -> None:
    place.write("parts/blocks.py", BLOCK)
    before = place.service()
    made(before)
    sent.clear()
    place.write("parts/blocks.py", BLOCK.replace(old, new))
    service = place.service()
    service.expect(before)
    found = made(service)
    assert sent == ["model", "describe"]
    assert modelled_parts(service) == ["blocks:Block"] and service.decisions["blocks:Block"].reason.startswith("module `blocks` changed")
    place.store = type(place.store)(f"{place.store.root}-empty")
    assert isinstance(found, PartRecord) and found == made(place.service())


def test_unchanged_parts_are_not_started(place: Any, sent: list[str]) -> None:
    place.write("parts/blocks.py", BLOCK)
    before = place.service()
    made(before)
    sent.clear()
    place.write("parts/blocks.py", BLOCK.replace("class Block(Thing):", 'class Block(Thing):\n        """Words."""\n'))
    service = place.service()
    service.expect(before)
    assert isinstance(made(service), PartRecord) and sent == ["describe"]


def test_unneeded_speculative_part_is_stopped(place: Any, define: Any, sent: list[str]) -> None:
    """The part may hang, or it may take a parameter that no longer exists."""
    place.write("parts/blocks.py", BLOCK)
    before = place.service()
    made(before, like=define("blocks:Block", width=0.02, height=0.005))
    sent.clear()
    place.write("parts/blocks.py", BLOCK.replace("            self.body", "            while width == 20: pass\n            self.body"))
    service = place.service()
    service.expect(before)
    [worker] = place.workers._processes
    last = time.monotonic() + 60.0
    while not psutil.Process(worker.process.pid).children() and time.monotonic() < last:
        time.sleep(0.01)
    found = made(service)
    assert isinstance(found, PartRecord) and sent == ["model", "describe", "model"]
    while (left := psutil.Process(worker.process.pid).children()) and time.monotonic() < last:
        time.sleep(0.01)
    assert left == [] and worker.unanswered == {} and place.workers._begun == {}


def test_speculative_failure_is_reported_as_usual(place: Any, sent: list[str]) -> None:
    place.write("parts/blocks.py", BLOCK)
    before = place.service()
    made(before)
    sent.clear()
    place.write("parts/blocks.py", BLOCK.replace("Box(width", "Box(width / 0"))
    service = place.service()
    service.expect(before)
    found = made(service)
    assert isinstance(found, PartFailure) and (found.kind, found.message, found.line) == (
        "raised", "ZeroDivisionError: float division by zero", 8,
    )
    assert sent == ["model", "describe"]


def test_early_answer_is_used(place: Any, sent: list[str]) -> None:
    """The answer arrives before it is requested, while the service waits for another one."""
    place.write("parts/blocks.py", BLOCK)
    before = place.service()
    made(before)
    place.write("parts/blocks.py", BLOCK.replace("30", "32"))
    service = place.service()
    service.expect(before)
    last = time.monotonic() + 60.0
    service.describe(["blocks:Block"])
    number = 0
    while not place.workers._early and time.monotonic() < last:  # it comes while something else is waited for
        number += 1
        place.write(f"parts/others_{number}.py", BLOCK)
        place.service().describe([f"others_{number}:Block"])
    sent.clear()
    assert isinstance(made(service), PartRecord) and sent == []


@pytest.mark.parametrize("saved_again", [False, True])
def test_prepared_child_is_used_unless_the_file_changed(place: Any, sent: list[str], saved_again: bool) -> None:
    """The child loaded the code as it was when it started. If the file was saved again later, the child is not used."""
    place.write("parts/blocks.py", BLOCK)
    made(place.service())
    path = place.write("parts/blocks.py", BLOCK.replace("30", "33"))
    place.workers.prepare([str(path)])
    [worker] = place.workers._processes
    last = time.monotonic() + 60.0
    while not (ready := psutil.Process(worker.process.pid).children()) and time.monotonic() < last:
        time.sleep(0.01)
    [child] = ready
    if saved_again:
        place.write("parts/blocks.py", BLOCK.replace("30", "34"))
    found = made(place.service())
    assert isinstance(found, PartRecord) and found.box is not None
    assert found.box[1][0] - found.box[0][0] == pytest.approx(0.034 if saved_again else 0.033, abs=1e-9)
    while (left := psutil.Process(worker.process.pid).children()) and time.monotonic() < last:
        time.sleep(0.01)
    assert left == [] and not child.is_running()


def test_workers_get_requests_before_the_callback_runs(place: Any, sent: list[str]) -> None:
    """This also holds for more requests than the workers process at the same time."""
    references = [f"blocks_{number}:Block" for number in range(6)]
    for reference in references:
        place.write(f"parts/{reference.partition(':')[0]}.py", BLOCK)
    meanwhile: list[list[str]] = []
    found = place.service().describe(references, lambda: meanwhile.append([*sent]))
    assert all(isinstance(found[reference], PartSchema) for reference in references)
    assert meanwhile == [["describe"] * 6] and sent == ["describe"] * 6
    place.service().describe(references, lambda: meanwhile.append([]))
    assert meanwhile[1:] == [[]], "it is done where nothing has to be asked, too"


def test_cleanup_of_finished_parts_does_not_delay_others(place: Any, define: Any) -> None:
    """Processes that a part leaves running have one second to end."""
    place.write("parts/leaving.py", """
        import subprocess, time
        from build123d import Box
        from thingc import Thing

        class Leaves(Thing):
            def result(self):
                subprocess.Popen(["sleep", "600"], start_new_session=True)
                return Box(10, 10, 10)

        class Takes(Thing):
            def result(self):
                time.sleep(0.3)
                return Box(10, 10, 11)

        class Follows(Thing):
            def result(self):
                return Box(10, 10, 12)
    """)
    place.workers._spans.clear()
    place.service().realize([define(f"leaving:{name}") for name in ("Leaves", "Takes", "Follows")])
    *first, (begun, _) = sorted(place.workers._spans)
    assert begun - min(end for _, end in first) < 0.9
