"""The study of conformance: what it asks of every reader, and that it would see a file that says something else."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from thingc.cli.main import main

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "conformance"
SEEDS = (0, 3, 20)
"""Of the last a turn without limits follows one with limits."""


@pytest.fixture(scope="module", autouse=True)
def on_path():
    sys.path.insert(0, str(FOLDER))
    yield
    sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory, shared_store: str):
    """Questions to all modes of two random robots."""
    from reference import question
    from robots import document

    base = tmp_path_factory.mktemp("conformance")
    questions = []
    for seed in SEEDS:
        path = base / f"random_{seed}.yaml"
        path.write_text(document(seed))
        assert main(["build", str(path), "--emit", "mjcf,urdf", "-o", str(base / "out"), "--store", shared_store]) == 0
        folder = base / "out" / path.stem
        questions += [question(file, folder / "mjcf" / f"{file.stem}.xml") for file in sorted((folder / "urdf").glob("*.urdf"))]
    assert len(questions) == 3 * len(SEEDS)
    return questions


def judged(asked, change: Callable[[str], str] = str):
    """What the study makes of MuJoCo's answers to files that were changed."""
    from ask_mujoco import answer
    from study import Judged

    verdict = Judged()
    for one in asked:
        file = Path(one.request["file"])
        text = file.read_text()
        changed = file.with_name(f"changed_{file.name}")
        changed.write_text(change(text))
        assert change is str or changed.read_text() != text, "something was changed"
        verdict.add(one.name, answer({**one.request, "file": str(changed)}), one.answer, one.request["joints"])
        changed.unlink()
    return verdict


def test_what_thingc_writes_is_one_robot(asked) -> None:
    verdict = judged(asked)
    assert verdict.faults == [] and verdict.files == len(asked)
    assert {*verdict.worst} == {"frames", "mass", "centre", "mass_matrix", "torque", "range"}
    assert 0.0 < verdict.worst["frames"] < 1e-12


def flipped(text: str) -> str:
    """The last axis the other way round."""
    before, _, after = text.rpartition('<axis xyz="')
    values, _, rest = after.partition('"')
    return f'{before}<axis xyz="{" ".join(str(-float(x)) for x in values.split())}"{rest}'


def turned(text: str) -> str:
    """Every inertia a quarter turn about z: as if the frame of it had been turned, or that turn forgotten."""
    def quarter(match: re.Match[str]) -> str:
        xx, xy, xz, yy, yz, zz = (float(one) for one in re.findall(r'="(\S+?)"', match[0]))
        values = {"ixx": yy, "ixy": -xy, "ixz": -yz, "iyy": xx, "iyz": xz, "izz": zz}
        return "<inertia " + " ".join(f'{name}="{value!r}"' for name, value in values.items()) + "/>"

    return re.sub(r"<inertia .*?/>", quarter, text)


def shifted(text: str) -> str:
    """The first centre of mass a millimetre away."""
    return re.sub(r'(<inertial>\s*<origin xyz=")(\S+)', lambda match: f"{match[1]}{float(match[2]) + 0.001!r}", text, count=1)


def heavier(text: str) -> str:
    """A link of other mass."""
    return re.sub(r'<mass value="0\.', '<mass value="1.', text, count=1)



@pytest.mark.parametrize(("change", "seen"), [
    (flipped, {"frames"}), (turned, {"mass matrix"}), (shifted, {"centre of mass"}), (heavier, {"total mass"}),
], ids=lambda one: one.__name__ if callable(one) else "")
def test_a_file_that_says_something_else_is_seen(asked, change: Callable[[str], str], seen: set[str]) -> None:
    """A flipped axis, a turned inertia, a moved centre, another mass."""
    faults = judged(asked, change).faults
    assert {one.name for one in asked} == {fault.partition(":")[0] for fault in faults}, "in every file"
    assert any(word in fault for fault in faults for word in seen)


def test_a_mimic_that_is_left_out_is_seen(asked) -> None:
    """By readers that say what they follow."""
    from study import difference

    expected = [one for question in asked for one in question.answer["mimic"]]
    assert any(expected)
    assert difference("mimic", expected, expected, []) == 0.0
    assert difference("mimic", [None] * len(expected), expected, []) > 1.0
    other = [one and (one[0], one[1], one[2] + 0.01) for one in expected]
    assert difference("mimic", other, expected, []) == pytest.approx(0.01)


def test_what_a_reader_cannot_take_is_a_fault_in_its_words() -> None:
    from study import Judged

    verdict = Judged()
    verdict.add("arm_bench", {"cannot": "ValueError: no such joint"}, {}, [])
    assert verdict.faults == ["arm_bench: reader cannot: ValueError: no such joint"]
