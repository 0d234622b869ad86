"""Documents with schema errors: later passes check the valid rest, and report no consequences of the schema error."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest

from resolve.resolving import run
from thingc.base.diagnostics import Report
from thingc.base.joints.kinds import KINDS
from thingc.base.source import Document, ScalarNode, Span, walk
from thingc.documents.load.documents import load
from thingc.documents.spec.validation import validate
from thingc.documents.workspace import Workspace

ROBOT = """\
thingc: assembly/1
name: robot
description: everything once
parameters:
  reach: {value: 100 mm, min: 60 mm, max: 200 mm, doc: how far}
  legs: 3
  spread: =reach / 2
materials: [stuff.yaml]
defaults:
  component: {collision: hull, material: pla}
  joint: {limit: {lower: -1 deg, upper: 1 deg, effort: 1 N*m, velocity: 1 rad/s}, dynamics: {damping: 0.1 N*m*s/rad}}
components:
  plate: {part: arm:Plate, mass: {value: 12 g, source: measured}, mounts: {top: {xyz: 0 0 10 mm, rpy: [0, 0, 90 deg]}}}
  board: {frame: true, mass: 1 g, at: {in: plate.top, xyz: 0 0 1 mm}, mounts: {pin: {xyz: 0 0 1 mm}}}
  brace: {part: arm:Brace, params: {length: =spread, holes: 4}, bom: {number: B1, cost: 3 EUR, make: print}}
  rod: {part: arm:Rod, params: {length: =reach}, attach: {end: brace.tip}, process: {kind: fdm, infill: 20 %}}
  clip: {part: arm:Plate, material: abs, attach: {mount: back, to: board.pin, turn: 90 deg, gap: 1 mm}}
  hand: {assembly: hand.yaml, parameters: {width: =reach / 4}, at: {in: rod.tip}}
  servo: {part: arm:Servo, attach: {back: plate.origin}}
  leg: {part: arm:Plate, repeat: {count: =legs, as: k}, at: {in: plate.top, rpy: [0, 0, =k * 30 deg]}}
joints:
  turn: {type: revolute, parent: plate.top, child: brace.seat, drive: servo}
  slide: {type: prismatic, parent: rod.side, child: cart.seat, limit: {lower: 1 mm, upper: 20 mm}, offset: 1 mm}
  spin: {type: continuous, parent: cart.top, child: wheel.hub, drive: {kind: position, kp: 20 N*m/rad}}
  follow: {type: revolute, parent: wheel.rim, child: flag.seat, mimic: {joint: turn, multiplier: 2, offset: 1 deg}}
links: {base_link: plate}
mounts: {base: plate.top}
poses:
  home: {turn: 0 deg, slide: 5 mm, hand: open}
  away: {turn: =1 deg / 2, slide: 2 mm, "s?in": 3 deg, hand.finger: 1 deg}
modes:
  stand: {root: plate, base: fixed, pose: home, poses: [home, away], actuators: [turn, "s?in"], gravity: floor}
  walk: {extends: stand, root: base, contacts: {exclude: [[plate, leg_0]], adhesion: {base: 3 N}}}
simulation: {timestep: 2 ms, integrator: implicitfast}
raw: {mjcf: {joint: {turn: {solreflimit: 0.01 1}}}}
sensors:
  imu: {type: imu, at: board.pin}
  turn: {type: joint}
  eye: {type: camera, at: leg_1.top, fovy: 40 deg}
""".replace("joints:\n", """\
  cart: {part: arm:Plate}
  wheel: {part: arm:Plate}
  flag: {part: arm:Plate}
joints:
""")

HAND = """\
thingc: assembly/1
name: hand
parameters: {width: {value: 20 mm, min: 1 mm}, count: 2}
components:
  palm: {part: arm:Plate}
  tip: {part: arm:Rod, params: {length: =width}}
  pad: {part: arm:Plate, repeat: {count: =count}, at: {in: palm.top}}
joints:
  finger: {type: revolute, parent: palm.top, child: tip.seat, limit: {lower: -9 deg, upper: 9 deg}}
mounts: {seat: palm.bottom}
poses:
  open: {finger: 1 deg}
"""

STUFF = """\
thingc: materials/1
materials:
  pla: {density: 1240 kg/m^3, color: red, friction: {slide: 0.5}}
  abs: {density: 1040 kg/m^3}
"""

FILES = {"robot.yaml": ROBOT, "hand.yaml": HAND, "stuff.yaml": STUFF}
SCALARS = ("7 kg", "true", "[1, 2]", "{a: 1}", "nonsense", "~", "3 blub", "'=1 +'", "1,5 mm")
STRIDE = 47
"""Every n-th of thousands of faults is tried; 1 tries all of them, which takes a minute and a half."""
SECTIONS = ("7 kg", "true", "[1, 2]", "nonsense", "~")


def test_documents_without_faults_are_valid(tmp_path: Path) -> None:
    assert run(tmp_path, FILES).said == []


def of_shape(folder: Path, files: dict[str, str]) -> list[str]:
    """Return the diagnostics of loading and validation, in the order of positions."""
    for name, text in files.items():
        (folder / name).write_text(text)
    report = Report()
    workspace = Workspace.find(str(folder / "robot.yaml"), report)
    assert workspace is not None
    documents = load(str(folder / "robot.yaml"), workspace, report)
    if documents is not None:
        validate(documents, report)
    return [d.message for d in report.sorted_diagnostics()]


def document(folder: Path, name: str) -> Document:
    report = Report()
    workspace = Workspace.find(str(folder / name), report)
    assert workspace is not None
    documents = load(str(folder / name), workspace, report, kinds=("assembly", "materials"))
    assert documents is not None
    return documents.root


def place(text: str, span: Span) -> tuple[int, int]:
    starts = [0, *(found.end() for found in re.finditer("\n", text))]
    return starts[span.line - 1] + span.column - 1, starts[span.end_line - 1] + span.end_column - 1


def faulty(source: Document) -> Iterator[tuple[str, str]]:
    """Yield the text with one fault each: a key misspelled, missing or with an unknown one next to it, or a value replaced."""
    text = source.text
    for path, node in walk(source.tree):
        if not path:
            continue
        shown = ".".join(map(str, path))
        if isinstance(path[-1], str):
            key = source.span(path, key=True)
            begin, end = place(text, key)
            if text[begin] == '"':
                continue
            word = text[begin:end]
            for other in (f"{word}_", f"{word[:-1]}", "zzzzz", f"1{word}"):
                yield f"{shown} -> {other}", text[:begin] + other + text[end:]
            flow = "{" in text[text.rfind("\n", 0, begin) + 1 : begin]
            beside = "zzzzz: 1, " if flow else "zzzzz: 1\n" + " " * (key.column - 1)
            yield f"zzzzz beside {shown}", text[:begin] + beside + text[begin:]
        begin, end = place(text, node.span)
        tail = "\n" if text[end - 1 : end] == "\n" else ""
        for value in SCALARS if isinstance(node, ScalarNode) else SECTIONS:
            yield f"{shown}: {value}", text[:begin] + value + tail + text[end:]


@pytest.mark.parametrize("name", FILES)
def test_schema_error_has_no_follow_up_errors(name: str, tmp_path: Path) -> None:
    run(tmp_path, FILES)
    followed, tried = [], 0
    for what, text in islice(faulty(document(tmp_path, name)), 0, None, STRIDE):
        files = {**FILES, name: text}
        before = of_shape(tmp_path, files)
        if not before:
            continue
        tried += 1
        said = [d.message for d in run(tmp_path, files).report.sorted_diagnostics()]
        if said != before:
            followed.append((what, [message for message in said if message not in before]))
    assert tried > (20 if name == "robot.yaml" else 2)
    assert followed == []


SEVERAL = """\
thingc: assembly/1
name: several
parameters: {reach: 3 blub, width: =raech}
components:
  plate: {part: arm:Plate, colour: red}
  rod: {part: arm:Rod, params: {lenght: 3 mm}, attach: {end: plate.top}}
  brace: {part: arm:Brace, params: {length: 900 mm}, atach: {end: plate.top}}
  servo: {part: arm:Servo, attach: {back: plaet.top}}
  hand: {assembly: inner.yaml, at: {in: plate.top}}
joints:
  turn: {type: revolut, parent: plate.top, child: servo.back}
poses:
  home: {turn: 1 deg, trun: 2 deg}
modes:
  stand: {root: plate, pose: hmoe}
"""


def test_other_errors_are_reported_in_the_same_run(tmp_path: Path) -> None:
    outcome = run(tmp_path, {
        "several.yaml": SEVERAL,
        "inner.yaml": HAND.replace("tip.seat", "tpi.seat").replace("part: arm:Plate}", "part: arm:Plate, mas: 1 g}"),
    })
    assert outcome.said == [
        'TC201 inner.yaml:5:27 unknown key `mas` in `components.palm` | did you mean `mass`?',
        'TC302 inner.yaml:9:53 this document has no component `tpi` | did you mean `tip`?',
        'TC206 several.yaml:3:23 unknown unit `blub`; did you mean `lb`?',
        'TC313 several.yaml:3:37 unknown name `raech` | did you mean `reach`?',
        'TC201 several.yaml:5:28 unknown key `colour` in `components.plate`'
        ' | set `material`, and define `density` and `color` under `materials`',
        'TC317 several.yaml:6:15 `arm:Rod` requires the parameter `length`'
        ' | write `params: {length: 120 mm}`',
        'TC305 several.yaml:6:33 `arm:Rod` has no parameter `lenght` | did you mean `length`?',
        'TC315 several.yaml:7:45 parameter `length` of `arm:Brace` must be at most 500 mm, found `900 mm`',
        'TC201 several.yaml:7:54 unknown key `atach` in `components.brace` | did you mean `attach`?',
        'TC302 several.yaml:8:43 this document has no component `plaet` | did you mean `plate`?',
        f'TC204 several.yaml:11:16 expected {" or ".join(", ".join(f"`{name}`" for name in KINDS).rsplit(", ", 1))}, '
        'found the string `revolut` | did you mean `revolute`?',
        'TC304 several.yaml:13:23 there is no joint `trun` | did you mean `turn`?',
        'TC307 several.yaml:15:30 there is no pose `hmoe` | did you mean `home`?',
    ]
