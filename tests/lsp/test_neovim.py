"""The Neovim configuration of the documentation works in Neovim."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from conformance.harness import ROOT

pytestmark = pytest.mark.slow

DOCUMENT = """\
thingc: assembly/1
name: crane
components:
  mast: {frame: true, mass: 2 kg, mounts: {head: {xyz: 0 0 500 mm}}}
  hook: {frame: true, mass: 120 g, attach: {origin: mast.head}}
"""

SESSION = """
local function findings() return #vim.diagnostic.get(0) end
local said = io.open("said.txt", "w")
vim.cmd("edit crane.yaml")
vim.cmd("5s/mast.head/mast.haed/")
vim.wait(20000, function() return findings() > 0 end)
for _, one in ipairs(vim.diagnostic.get(0)) do said:write(one.lnum + 1, ":", one.col + 1, " ", one.code, " ", one.message, "\\n") end
vim.cmd("undo")
vim.wait(20000, function() return findings() == 0 end)
said:write(findings(), " findings\\n")
said:close()
vim.cmd("qa!")
"""


@pytest.mark.skipif(shutil.which("nvim") is None, reason="Neovim is not installed")
def test_edits_are_answered_in_neovim(tmp_path: Path) -> None:
    *_, configuration = re.findall(r"```lua\n(.*?)```", (ROOT / "docs" / "editor.md").read_text(), re.DOTALL)
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "crane.yaml").write_text(DOCUMENT)
    (tmp_path / "session.lua").write_text(f'vim.cmd("filetype on")\n{configuration}{SESSION}')
    env = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "THINGC_STORE": str(tmp_path / "store")}
    command = ["nvim", "--headless", "-u", "NONE", "-S", "session.lua"]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=90)
    first, *more = (tmp_path / "said.txt").read_text().splitlines()
    assert first == "5:53 TC303 frame `mast` has no mount `haed`" and more[0] == "did you mean `head`?", (first, more, done.stderr)
    assert more[-1] == "0 findings"
