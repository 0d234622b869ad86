"""Somebody else's machines as the engine of a batch: `connect` makes an executor of the address that `--cluster` states.

    tcp://host:8786                          a dask scheduler (`dask_cluster`)
    slurm  slurm:partition=cpu,cpus=8        jobs of SLURM (`slurm_cluster`)

Workers build variants with the same runners as here, and write them into the batch's folder: they see it, and the documents, under
the same paths. Those of dask need not: the workspace may be shipped to them (`shipping`).
"""

from __future__ import annotations

import re

from thingc.base.diagnostics import Code
from thingc.batch.cluster.protocol import Cluster
from thingc.batch.folder import BatchFault

HELP = "write `tcp://HOST:8786` for the scheduler of dask there, or `slurm:partition=NAME,cpus=8`"


def connect(address: str, *, jobs: int = 0, folder: str) -> Cluster:
    """The executor at an address. `jobs` chunks at once (0: as suits the cluster); `folder` is one that all machines see, for
    files of the executor's own. Raises `BatchFault` in words for an address that is none, or where nobody answers."""
    if re.fullmatch(r"slurm(:.*)?", address):
        from thingc.batch.cluster.slurm import SlurmCluster, settings_of

        return SlurmCluster(settings_of(address.partition(":")[2]), jobs=jobs, folder=folder)
    if re.fullmatch(r"((tcp|tls|ws|wss|ucx)://)?([^\s:/,=\[\]]+|\[[0-9a-fA-F:]+\]):[0-9]+/?", address):
        from thingc.batch.cluster.dask_executor import DaskCluster

        return DaskCluster(address if "://" in address else f"tcp://{address}", jobs=jobs)
    raise BatchFault(Code.COMMAND_LINE, f"`{address}` is no address of a cluster", HELP)
