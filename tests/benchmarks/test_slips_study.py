"""The study of suspicious documents: its page, and some of its mistakes."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "studies" / "slips.md").read_text()
FOUND = {
    "arm modes/adrift/at/xyz: 0 0 -300 mm": "TC610", "arm joints/elbow/drive: shoulder_servo": "TC519",
    "arm components/bus_board/mass: {value: 12 kg, source: measured}": "TC522", "arm simulation/timestep: 20 ms": "TC523",
    "arm poses/home/wrist: 30 deg": "",
}


@pytest.mark.slow
def test_some_mistakes_are_reported(shared_store: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks" / "mutants"))
    slipping = import_module("slipping")
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.setattr(slipping, "_tested", lambda robot: [])
    slipping.workspace(ROOT, tmp_path)
    monkeypatch.chdir(tmp_path)
    verdicts = {slip.edits[0]: slipping.judge(slip, tmp_path, str) for slip in slipping.MEANING + slipping.SIZES if slip.edits[0] in FOUND}
    assert {edit: verdict.said[:5] for edit, verdict in verdicts.items()} == FOUND


def test_page_has_shares_and_reasons() -> None:
    assert PAGE.startswith((ROOT / "benchmarks" / "mutants" / "slips_page.md").read_text())
    first, second = (100 - int(share) for share in re.findall(r"^\| .*, now \|.*\((\d+)%\) \| \d+ \|$", PAGE, re.MULTILINE))
    assert f"reports {second} % of the mistakes in the second list, but only {first} % of those in the first list" in " ".join(PAGE.split())
    reasons = re.findall(r"^\| (?:arm|minchw|walker) \| `.*?` \| (.*) \|$", PAGE, re.MULTILINE)
    assert len(reasons) == sum(map(int, re.findall(r", now \|.*\| (\d+) \(\d+%\)", PAGE)))
    assert not [one for one in reasons if not one or one.startswith(" ")]
