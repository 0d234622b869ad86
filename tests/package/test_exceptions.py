"""Exceptions arrive from other processes with their message and attributes."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import thingc
from thingc.base.diagnostics import Code
from thingc.batch import PlanError
from thingc.batch.engine import RunnersBroken
from thingc.batch.folder import BatchFault
from thingc.batch.results import UnknownVariant
from thingc.batch.shared_model import StructuresDiffer
from thingc.driver.output import UnexpectedFilesError
from thingc.driver.pipeline import UnknownChoice
from thingc.geometry.client import WorkerBroken
from thingc.geometry.store.local import BlobMissing, StoreUnusable
from thingc.modes.errors import BaseElsewhere, BaseMoves, UnknownMode


@pytest.mark.parametrize("error", [
    UnknownChoice("there is no mode `a`", "use `b`"), UnexpectedFilesError("build", ("a", "b"), "two files", ours=True),
    BatchFault(Code.OUTPUT, "the disk is full", "delete files"), RunnersBroken("no process", "a traceback"),
    WorkerBroken("no kernel", "a traceback"), StoreUnusable("/cache", "read-only"), BlobMissing("0" * 64),
    UnknownVariant("no variant `a`", "use `b`"), StructuresDiffer("geom_type", "the shapes differ"),
    UnknownMode("there is no mode `a`"), BaseMoves("standing", "foot", np.array([3.0, 0.0, 4.0, 0.0, 0.0, 0.0])),
    BaseElsewhere("standing", "foot", 0.1, 0.2, 1e-6),
], ids=lambda error: type(error).__name__)
def test_exceptions_can_be_pickled(error: Exception) -> None:
    for again in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert type(again) is type(error) and str(again) == str(error) and again.args == error.args
        assert repr(vars(again)) == repr(vars(error))


def test_errors_of_documents_arrive_from_a_process_pool(tmp_path: Path) -> None:
    document = tmp_path / "arm.yaml"
    document.write_text("thingc: assembly/1\nname: arm\n")
    (tmp_path / "arms.yaml").write_text("thingc: variants/1\nassembly: arm.yaml\nparameters: 3\n")
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        with pytest.raises(thingc.CompileError, match=r"\n *--> .*arm.yaml:1:1") as caught:
            pool.submit(thingc.compile, document).result()
        assert [found.code for found in caught.value.diagnostics] == [Code.MISSING_KEY]
        with pytest.raises(PlanError, match="arms.yaml:3") as refused:
            pool.submit(thingc.batch.plan, str(tmp_path / "arms.yaml")).result()
        assert refused.value.diagnostics
