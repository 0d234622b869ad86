"""PDF files of pages, read by their cross-reference table."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from emit.small_robot import assembly
from thingc.geometry.store.local import Store
from thingc.targets.artifact import Artifacts
from thingc.tools.workshop import pdf
from thingc.tools.workshop.drawing import PRINT_STYLE

needed = pytest.mark.skipif(not any(map(shutil.which, pdf.BROWSERS)), reason="no Chromium is installed")
SHEET = '<img src="data:image/svg+xml,%3Csvg xmlns=%22http://www.w3.org/2000/svg%22 viewBox=%220 0 420 297%22/%3E">'


def printed(page: str, robot: Artifacts, store: Path) -> Artifacts:
    return pdf.with_pdf(robot, "drawing", page.encode(), assembly(Store(str(store))))


@needed
def test_each_sheet_is_one_page_and_the_date_does_not_change_the_file(tmp_path: Path) -> None:
    page = f"<!DOCTYPE html><title>robot</title>{PRINT_STYLE}{SHEET}<table><tr><th>part<th>count<tr><td>plate<td>2</table>"
    first = printed(page, Artifacts(files={"drawing/a.svg": b"svg"}), tmp_path)
    name = f"drawing/{assembly(Store(str(tmp_path))).name}.pdf"
    assert [*first.files] == ["drawing/a.svg", name] and not first.losses
    data = first.files[name]
    assert isinstance(data, bytes) and data.startswith(b"%PDF-") and len(re.findall(rb"/Type /Page\b", data)) == 2
    width, height = map(float, re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", data)[0])
    assert (width / 72 * 25.4, height / 72 * 25.4) == pytest.approx((420.0, 297.0), abs=0.5)
    assert len(re.findall(rb"/\w+Date \(D:19800101000000\+00'00'\)", data)) == len(re.findall(rb"Date \(", data)) == 2
    assert printed(page, Artifacts(files={}), tmp_path).files == {name: data}
    assert b"StructTreeRoot" not in data  # tags of headers contain numbers of nodes, which are not the same each time
    table = data[int(re.findall(rb"startxref\s+(\d+)", data)[-1]):]
    offsets = [int(offset) for offset in re.findall(rb"^(\d{10}) \d{5} n", table, re.MULTILINE)]
    assert len(offsets) > 5 and all(data.startswith(f"{number} 0 obj".encode(), offset) for number, offset in enumerate(offsets, 1))


def test_a_missing_or_broken_browser_is_an_export_loss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for browsers, why in (((), "Chromium is not installed"), (("false",), "Chromium failed: CalledProcessError"),
                          (("true",), "Chromium failed: FileNotFoundError")):
        monkeypatch.setattr(pdf, "BROWSERS", browsers)
        made = printed("<p>page</p>", Artifacts(files={}), tmp_path)
        assert made.files == {} and [loss.what for loss in made.losses] == [f"PDF file ({why})"]
