"""Most tests of the workshop do not print PDF files, which takes seconds."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from thingc.tools.workshop import pdf


@pytest.fixture(scope="module", autouse=True)
def _no_browser(request: pytest.FixtureRequest) -> Iterator[None]:
    """Chromium is not installed, except for the tests of PDF files."""
    with pytest.MonkeyPatch.context() as patch:
        if "test_pdf" not in request.module.__name__:
            patch.setattr(pdf, "BROWSERS", ())
        yield
