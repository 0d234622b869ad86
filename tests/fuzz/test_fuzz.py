"""A short run of the fuzzer with a fixed seed. It runs in a separate process, because its audit hook cannot be removed."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

INPUTS = 40


def test_short_run_has_no_failures(tmp_path: Path, root: Path, shared_store: str) -> None:
    robots = tmp_path / "robots"
    robots.mkdir()
    for name in ("assemblies", "parts"):
        shutil.copytree(root / name, robots / name, ignore=shutil.ignore_patterns("__pycache__", "thingc_stock"))
    shutil.copy(root / "thingc.toml", robots)
    thingc = Path(sys.executable).with_name("thingc")
    subprocess.run([thingc, "lock", str(robots), "--store", shared_store], check=True, capture_output=True)
    done = subprocess.run(
        [
            sys.executable, str(root / "tests" / "fuzz" / "fuzz.py"), "--minutes", "9", "--most", str(INPUTS), "--seed", "4", "--keep",
            str(tmp_path / "kept"),
            "--lock", str(robots / "parts.lock.json"),
        ],
        capture_output=True, text=True, timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    told = done.stdout.splitlines()[-1]
    assert "0 failures (0 kinds)" in told and told.endswith("opened outside 0, written 0, executed 0")
    inputs, accepted, codes = map(int, re.findall(r"(\d+) (?:inputs|without errors|codes said)", told))
    # It has to reach further than the reader: some inputs pass, and many different faults are told.
    assert inputs == INPUTS and accepted >= 1 and codes >= 15
    peak = re.search(r"peak (\d+) MB", told)
    slowest = re.search(r"slowest ([\d.]+) s", told)
    assert peak is not None and int(peak.group(1)) < 1000
    assert slowest is not None and float(slowest.group(1)) < 5.0


def test_fuzzer_detects_forbidden_events(tmp_path: Path, root: Path) -> None:
    """The fuzzer runs code that does what its checks forbid."""
    program = (
        f"import sys; sys.path.insert(0, {str(root / 'tests' / 'fuzz')!r})\n"
        "import fuzz, pathlib\n"
        "def evil(document, options, *, strict):\n"
        "    folder = pathlib.Path(document).parent\n"
        "    kind = evil.kinds.pop()\n"
        "    if kind == 'open': open('/etc/hostname').close()\n"
        "    if kind == 'write': (folder / 'x').write_text('')\n"
        "    if kind == 'crash': raise KeyError('x')\n"
        "    if kind == 'import':\n"
        "        sys.path.insert(0, str(folder)); import evil as module\n"
        "    if kind == 'process':\n"
        "        import subprocess; subprocess.run(['true'])\n"
        "    if kind == 'hang':\n"
        "        while True: pass\n"
        "    return []\n"
        "evil.kinds = ['open', 'write', 'crash', 'import', 'process', 'hang']\n"
        "fuzz.without_code = evil\nfuzz.HANG = 0.5\n"
        f"result = fuzz.run(60.0, 1, pathlib.Path({str(tmp_path)!r}), '{{}}', most=6)\n"
        "print(sorted(failure['fault'].split()[0] for failure in result.failures))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.strip() == "['KeyError', 'code', 'hang', 'open', 'subprocess.Popen', 'write']"
