"""Print pages to PDF with Chromium, if it is installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from msgspec.structs import replace

from thingc.model.assembly.types import Assembly
from thingc.targets.artifact import Artifacts, Loss

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
TIMEOUT = 120.0
"""Time limit [s] for printing a page."""
_DATE = re.compile(rb"(?<=Date \(D:)\d{14}(?=\+00'00'\))")
_SAME_DATE = b"19800101000000"
"""The date in all PDF files. It replaces the current date with as many bytes, so the offsets in the file remain valid."""


def with_pdf(artifacts: Artifacts, target: str, page: bytes, assembly: Assembly) -> Artifacts:
    """Add the PDF file of an HTML page to the files of a target: `TARGET/NAME.pdf`. If the page cannot be printed, add an export loss."""
    printed = _print(page)
    if isinstance(printed, bytes):
        return replace(artifacts, files={**artifacts.files, f"{target}/{assembly.name}.pdf": printed})
    loss = Loss(target, None, assembly.name, f"PDF file ({printed})", "omitted", assembly.definition.origin)
    return replace(artifacts, losses=(*artifacts.losses, loss))


def _print(page: bytes) -> bytes | str:
    """Return the PDF file of an HTML page, or the reason why there is none."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        return "Chromium is not installed"
    # Chromium's sandbox does not support root
    flags = ["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []
    with tempfile.TemporaryDirectory(prefix="thingc-pdf-") as folder:
        source, printed = Path(folder, "page.html"), Path(folder, "page.pdf")
        source.write_bytes(page)
        # Tags of headers of tables contain numbers that Chromium assigns in another order each time.
        command = [
            browser, "--headless", "--disable-gpu", "--disable-background-networking", *flags, f"--user-data-dir={folder}/profile",
            "--no-pdf-header-footer", "--disable-pdf-tagging", f"--print-to-pdf={printed}", source.as_uri(),
        ]
        try:
            nothing = subprocess.DEVNULL  # processes that Chromium starts could keep a pipe open after the time limit
            subprocess.run(command, timeout=TIMEOUT, check=True, stdin=nothing, stdout=nothing, stderr=nothing)
            return _DATE.sub(_SAME_DATE, printed.read_bytes())
        except (OSError, subprocess.SubprocessError) as fault:
            return f"Chromium failed: {type(fault).__name__}"
