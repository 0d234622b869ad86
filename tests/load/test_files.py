"""What is no plain file is not waited for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from thingc.base.filesystem import NotARegularFile, beginning
from thingc.driver.up_to_date import state_of
from thingc.geometry.key.file_states import state_of as state_of_read


def test_nobody_waits_for_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(NotARegularFile, match="It is not a regular file"):
        beginning(str(pipe), 1)
    assert state_of(str(pipe)) is None
    assert state_of_read(str(pipe)) == "absent"


def test_a_device_without_end_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "zero").symlink_to("/dev/zero")
    with pytest.raises(NotARegularFile):
        beginning(str(tmp_path / "zero"), 1)
    assert state_of_read(str(tmp_path / "zero")) == "absent"


def test_the_beginning_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "words").write_bytes(b"abcdef")
    assert beginning(str(tmp_path / "words"), 4) == b"abcd"
    with pytest.raises(IsADirectoryError):
        beginning(str(tmp_path), 4)
    with pytest.raises(FileNotFoundError):
        beginning(str(tmp_path / "nothing"), 4)
