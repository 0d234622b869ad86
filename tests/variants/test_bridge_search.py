"""The search in the documentation: the robot behaves as its page describes, and both drivers are reproducible."""

from __future__ import annotations

import contextlib
import csv
import io
import re
import runpy
import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import thingc.batch
from conformance.harness import thingc_here
from thingc.batch import batch
from thingc.driver.environment import Options
from variants.robots import InThisProcess

MARGIN = 1.3


def standing(folder: Path) -> tuple[float, float]:
    """Return the distance of the soles [m] and the smallest torque margin of a built robot, by MuJoCo's inverse dynamics."""
    model = mujoco.MjModel.from_xml_path(str(folder / "mjcf" / "minchw_probe_reaching.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stretched").id)
    mujoco.mj_inverse(model, data)
    efforts = {model.actuator(k).name: model.actuator(k).forcerange[1] for k in range(model.nu)}
    torques = {model.joint(k).name: abs(data.qfrc_inverse[model.joint(k).dofadr[0]]) for k in range(model.njnt)}
    assert len(torques) == 6
    margin = min(efforts[name] / torque for name, torque in torques.items() if torque > 0.0)
    return float(np.linalg.norm(data.site("front_sole").xpos - data.site("rear_sole").xpos)), float(margin)


def search(root: Path, output: Path, store: str) -> str:
    """Return the output of a search of a few robots in this process, which also builds the robots."""
    words = ["-o", str(output), "--store", store, "--jobs", "1", "--count", "4", "--docs", str(output / "docs")]
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()) as out:
        patch.chdir(root)
        patch.syspath_prepend(str(root / "examples"))
        patch.setattr(sys, "argv", [str(root / "examples" / "longest_bridge.py"), *words])
        patch.setattr(batch, "LocalExecutor", InThisProcess)
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(sys.argv[0], run_name="__main__")
    assert ended.value.code == 0
    return out.getvalue()


@pytest.mark.slow
def test_robot_on_the_page_stands(root: Path, tmp_path: Path, shared_store: str) -> None:
    page = (root / "docs" / "variants_search.md").read_text()
    command = re.search(r"^thingc build .*$", page, re.MULTILINE)
    row = re.search(r"^\| `bridge_search_\d+` \|[^|]*\|[^|]*\| (\S+) mm \| (\S+) \|", page, re.MULTILINE)
    assert command and row
    assert thingc_here(*shlex.split(command[0])[1:], "-o", tmp_path, cwd=root, store=shared_store).code == 0
    bridge, margin = standing(tmp_path / "minchw_probe")
    assert f"{1e3 * bridge:.1f}" == row[1] and f"{margin:.3f}" == row[2] and margin >= MARGIN


@pytest.mark.slow
def test_table_of_the_search_agrees_with_mujoco(root: Path, tmp_path: Path, shared_store: str) -> None:
    page = search(root, tmp_path, shared_store)
    folder = tmp_path / "bridge_search_random"
    with (folder / "results.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["status"] for row in rows].count("built") in range(1, 4)  # some do, some do not
    for row in rows:
        assert (row["status"] == "built") == (float(row["torque_margin"]) >= MARGIN)
        if row["path"]:
            assert standing(folder / row["path"]) == pytest.approx((float(row["reach"]), float(row["torque_margin"])), rel=1e-9)
    best = max((row for row in rows if row["path"]), key=lambda row: float(row["reach"]))
    assert f"| `{best['name']}` |" in page and best["command"] in page
    assert (tmp_path / "docs" / "variants_search.md").read_text() == page
    picture = (tmp_path / "docs" / "pictures" / "bridge_search.png").read_bytes()
    assert search(root, tmp_path, shared_store) == page
    assert (tmp_path / "docs" / "pictures" / "bridge_search.png").read_bytes() == picture


def test_optuna_requests_are_reproducible_and_improve(
    root: Path, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A formula replaces the builds. The requests are variants documents within the ranges, equal in every run."""
    for name in ("assemblies", "parts", "thingc.toml"):
        (shutil.copytree if (root / name).is_dir() else shutil.copy)(root / name, tmp_path / name)
    monkeypatch.syspath_prepend(str(root / "examples"))
    from bridge_drivers import Optuna
    from bridge_report import Tried

    options = Options(store=shared_store)

    def run() -> list[list[Any]]:
        driver = Optuna(tmp_path / "assemblies" / "minchw" / "bridge_search.yaml", 60, options)
        rounds = []
        while (document := driver.ask()) is not None:
            asked = [(one.values["leg_length"], one.values["body_length"]) for one in thingc.batch.plan(str(document), options=options)]
            rounds.append([tried(leg, body) for leg, body in asked])
            driver.tell(rounds[-1])
        return rounds

    def tried(leg: float, body: float) -> Any:
        bridge = 0.2 + 2.0 * leg + body
        return Tried(
            name="", leg=leg, body=body, bridge=bridge, margin=0.7 / bridge, mass=2.0, feasible=0.7 / bridge >= MARGIN, command="",
            folder=None,
        )

    first, second = run(), run()
    assert first == second and [len(one) for one in first] == [8] * 7 + [4]
    rows: Sequence[Any] = [row for one in first for row in one]
    assert all(0.064 <= row.leg <= 0.140 and 0.090 <= row.body <= 0.220 for row in rows) and len(rows) == 60
    away = [abs(row.bridge - 0.7 / MARGIN) for row in rows]
    assert np.mean(away[-20:]) < 0.8 * np.mean(away[:16])
    assert max(row.bridge for row in rows if row.feasible) > 0.99 * 0.7 / MARGIN
