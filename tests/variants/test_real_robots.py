"""The arm and MInchW: sampled variants equal single builds, and their results equal the output of `thingc info`."""

from __future__ import annotations

import csv
import json
import shlex
import shutil
from pathlib import Path

import mujoco
import pytest

from conformance.harness import thingc_here
from thingc.tools.cli.main import main
from variants.robots import batch_here, environment, tree

pytestmark = pytest.mark.slow

MINCHW = """\
thingc: variants/1
assembly: assemblies/minchw/minchw.yaml
name: inchworms
choices:
  components.front.components.hip.material: [petg_white, aluminium]
sample: {method: lhs, count: 2, seed: 5, ranges: {front_leg: [64 mm, 120 mm]}}
keep: ["torque_margin > 0.5", "reach < 1 m", "box.z < 500 mm", "length.front.ankle > 60 mm"]
modes: [front_foot, crawl, bridge]
pose: arched
reach: {of: front_sole, from: rear_sole}
"""

ARM = """\
thingc: variants/1
assembly: assemblies/arm.yaml
name: arms
list:
  - {name: short}
  - {name: strong, choices: {defaults.component.material: petg, components.plate.part: arm:BasePlate}}
modes: [bench]
reach: {of: tip, from: base}
emit: [mjcf, stl, bom, hag]
"""


@pytest.mark.parametrize(("text", "name", "count"), [(MINCHW, "inchworms", 2), (ARM, "arms", 2)], ids=["minchw", "arm"])
def test_variants_equal_single_builds(
    root: Path, tmp_path: Path, shared_store: str, text: str, name: str, count: int, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for folder in ("assemblies", "parts"):
        shutil.copytree(root / folder, tmp_path / folder)
    shutil.copy(root / "thingc.toml", tmp_path)
    (tmp_path / "family.yaml").write_text(text)
    assert thingc_here("check", "family.yaml", cwd=tmp_path, store=shared_store).out == "family.yaml: ok\n"
    words = ("family.yaml", "--jobs", "1", "--pictures", "none")
    done = batch_here(*words, cwd=tmp_path, env=environment(shared_store), runners=name == "arms")
    assert done.returncode == 0, done.stderr
    out = tmp_path / "build" / name
    with (out / "results.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == count and {row["status"] for row in rows} == {"built"}
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("THINGC_STORE", shared_store)
    for row in rows:
        words = shlex.split(row["command"])[1:]
        assert main([*words, "-o", "single"]) == 0
        (single,) = (tmp_path / "single").iterdir()
        assert tree(out / row["path"]) == tree(single)
        shutil.rmtree(single)
        settings = [word for flag, word in zip(words, words[1:]) if flag in ("-p", "--set") for word in (flag, word)]
        capsys.readouterr()
        assert main(["info", words[1], *settings, "--format", "json"]) == 0
        info = json.loads(capsys.readouterr().out)
        assert float(row["mass"]) == pytest.approx(info["mass"], rel=1e-14)
        assert [float(row[f"centre.{axis}"]) for axis in "xyz"] == pytest.approx(info["centre"], abs=1e-15)
        assert float(row["inertia.xx"]) == pytest.approx(info["inertia"][0][0], abs=1e-15)
        assert float(row["inertia.yz"]) == pytest.approx(info["inertia"][1][2], abs=1e-15)
        for model in (out / row["path"] / "mjcf").glob("scene_*.xml"):
            assert mujoco.MjModel.from_xml_path(str(model)).nbody > 1
