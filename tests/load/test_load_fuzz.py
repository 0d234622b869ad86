"""Fuzzing of `load` and `validate`: for any bytes they never raise, and all errors have a position in the file."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given, settings, strategies as st

from thingc.base.diagnostic_output import as_json, as_text
from thingc.base.diagnostics import Report
from thingc.documents.load.documents import load
from thingc.documents.spec.validation import part_references, validate
from thingc.documents.workspace import Workspace

GOOD = '''thingc: assembly/1
name: arm
parameters:
  reach: {value: 100 mm, min: 60 mm}
  pen: 15 mm
materials: [m.yaml]
defaults: {component: {material: petg}}
components:
  plate: {part: arm:BasePlate, params: {length: "=min(reach, 80 mm)"}}
  hand: {assembly: b.yaml, attach: {back: plate.seat}, repeat: {count: 6, as: i}}
  board:
    frame: true
    mass: {value: 12 g, source: measured}
    at: {in: plate.origin, xyz: 0 0 4 mm, rpy: [0, 90 deg, =angle]}
joints:
  yaw:
    type: revolute
    parent: plate.top
    child: hand.base
    limit: {lower: -150 deg, upper: 150 deg}
    drive: {kind: position, kp: 20 N*m/rad}
poses: {home: {yaw: 30 deg}}
modes: {bench: {root: plate, gravity: floor, contacts: {exclude: [[plate, hand]]}}}
raw: {mjcf: {joint: {yaw: {solreflimit: 0.01 1}}}}
'''


def run(data: bytes, suffix: str = ".yaml") -> Report:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        path.write_bytes(data)
        report = Report()
        workspace = Workspace.find(str(path), report)
        assert workspace is not None
        documents = load(str(path), workspace, report)
        if documents is None:
            assert report.failed
        else:
            specs = validate(documents, report)
            part_references(specs, documents)
            if not report.failed:
                assert set(specs) == set(documents.by_path)
        lines = data.decode("utf-8", "replace").replace("\r\n", "\n").replace("\r", "\n").split("\n")
        for d in report.diagnostics:
            assert d.message
            assert "\n" not in d.message
            assert len(d.message) < 400, d.message
            for span in [d.span, *(note.span for note in d.notes)]:
                if span is not None:
                    assert 1 <= span.line <= len(lines), d
                    assert 1 <= span.column <= len(lines[span.line - 1]) + 2, (d, lines[span.line - 1])
                    assert (span.end_line, span.end_column) >= (span.line, span.column)
        as_text(report.sorted_diagnostics())
        as_json(report.sorted_diagnostics())
        return report


_pieces = st.sampled_from([
    "\n", "  ", "\t", ":", ": ", "- ", "{", "}", "[", "]", ",", "'", '"', "#", " #", "&a ", "*a", "!", "!!int ", "|\n", ">",
    "%", "@", "`", "?",
    "=", "=min(a, 3", "$i", "null", "~", "5", "120 mm", "yes", "é", "\u2028", "\x00", "\r\n", "---\n", "...\n", "<<: ", ".inf",
    "a: ", "a:b", "{}", "[]",
    "thingc: ", "components: ", "part: ", "xyz: ",
])


@settings(max_examples=60)
@given(st.integers(0, len(GOOD) - 1), st.integers(0, 12), st.lists(_pieces, max_size=3).map("".join))
def test_mutations_of_a_valid_document(at: int, cut: int, put: str) -> None:
    run((GOOD[:at] + put + GOOD[at + cut :]).encode())


@settings(max_examples=40)
@given(st.lists(_pieces, max_size=25).map("".join))
def test_random_mixtures_of_yaml_tokens(text: str) -> None:
    run(("thingc: assembly/1\n" + text).encode())


@settings(max_examples=30)
@given(st.binary(max_size=60))
def test_random_bytes(data: bytes) -> None:
    run(data)
    run(b"thingc: assembly/1\n" + data)
    run(b'thingc = "assembly/1"\n' + data, ".toml")


@settings(max_examples=30)
@given(st.integers(0, GOOD.count("\n") - 1), st.integers(0, GOOD.count("\n") - 1))
def test_swapped_lines(first: int, second: int) -> None:
    lines = GOOD.split("\n")
    lines[first], lines[second] = lines[second], lines[first]
    run("\n".join(lines).encode())
