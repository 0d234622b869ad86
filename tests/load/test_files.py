"""Pipes and devices are rejected without blocking."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from thingc.base.filesystem import NotARegularFile, beginning
from thingc.driver.up_to_date import state_of
from thingc.geometry.key.file_states import state_of as state_of_read


def test_pipe_is_rejected_without_blocking(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(NotARegularFile, match="It is not a regular file"):
        beginning(str(pipe), 1)
    assert state_of(str(pipe)) is None
    assert state_of_read(str(pipe)) == "absent"


def test_infinite_device_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "zero").symlink_to("/dev/zero")
    with pytest.raises(NotARegularFile):
        beginning(str(tmp_path / "zero"), 1)
    assert state_of_read(str(tmp_path / "zero")) == "absent"


def test_beginning_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "words").write_bytes(b"abcdef")
    assert beginning(str(tmp_path / "words"), 4) == b"abcd"
    with pytest.raises(IsADirectoryError):
        beginning(str(tmp_path), 4)
    with pytest.raises(FileNotFoundError):
        beginning(str(tmp_path / "nothing"), 4)
