"""Execute `examples/thingc.ipynb` in a new environment, in which the notebook installs the wheel in `dist/` (`make notebook`).

uv creates the environment, with Jupyter's kernel and pip. The executed notebook is written to `build/notebook.ipynb`. The script exits with
1 if a cell fails, or if the outputs do not contain two pictures and the result of the last computation.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXECUTE = """\
import sys, nbformat
from nbclient import NotebookClient
source, target, folder = sys.argv[1:]
notebook = nbformat.read(source, as_version=4)
nbformat.validate(notebook)
NotebookClient(notebook, timeout=1800, kernel_name="python3", resources={"metadata": {"path": folder}}).execute()
nbformat.write(notebook, target)
"""


def main() -> int:
    """Execute the notebook, and compare its outputs with the expected ones."""
    (wheel,) = (ROOT / "dist").glob("*.whl")
    target = ROOT / "build" / "notebook.ipynb"
    target.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        programs = Path(folder) / "venv" / "bin"
        subprocess.run(["uv", "venv", "--quiet", "--seed", "--python", sys.executable, programs.parent], check=True)
        subprocess.run(["uv", "pip", "install", "--quiet", "--python", programs / "python", "ipykernel", "nbclient"], check=True)
        environment = os.environ | {"THINGC_PACKAGE": str(wheel), "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
        command = [programs / "python", "-c", EXECUTE, ROOT / "examples" / "thingc.ipynb", target, folder]
        if subprocess.run(command, env=environment).returncode != 0:
            return 1
    text = target.read_text(encoding="utf-8")
    found = text.count('"image/png"'), "links moved by less than 1e-9 m: True" in text, "cm ahead" in text
    print(f"{target.relative_to(ROOT)}: {found[0]} pictures; the mode was switched: {found[1]}; the robot walked: {found[2]}")
    return 0 if found == (2, True, True) else 1


if __name__ == "__main__":
    sys.exit(main())
