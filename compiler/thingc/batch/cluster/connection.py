"""Connect to a cluster: `connect` returns the executor for the address in `--cluster`.

    tcp://host:8786                          a dask scheduler (`dask_executor`)
    slurm  slurm:partition=cpu,cpus=8        jobs of SLURM (`slurm`)

Workers build variants in the same runner processes as on this machine, and write files into the folder of the batch. The folder of the
batch and the documents must have the same paths on all machines. With dask, the workspace can instead be sent to the workers (see
`remote_workers`).
"""

from __future__ import annotations

import re

from thingc.base.diagnostics import Code
from thingc.batch.cluster.protocol import Cluster
from thingc.batch.folder import BatchFault

HELP = "write `tcp://HOST:8786` for a Dask scheduler, or `slurm:partition=NAME,cpus=8`"


def connect(address: str, *, jobs: int = 0, folder: str) -> Cluster:
    """Connect to the cluster at an address, and return an executor that builds variants there.

    `jobs` is the maximum number of chunks that run at the same time. If `jobs` is 0, use the default of the cluster. `folder` is a folder
    for files of the executor, which must be on a shared file system. Raises `BatchFault` if the address is invalid, or if the cluster does
    not respond.
    """
    if re.fullmatch(r"slurm(:.*)?", address):
        from thingc.batch.cluster.slurm import SlurmCluster, settings_of

        return SlurmCluster(settings_of(address.partition(":")[2]), jobs=jobs, folder=folder)
    if re.fullmatch(r"((tcp|tls|ws|wss|ucx)://)?([^\s:/,=\[\]]+|\[[0-9a-fA-F:]+\]):[0-9]+/?", address):
        from thingc.batch.cluster.dask_executor import DaskCluster

        return DaskCluster(address if "://" in address else f"tcp://{address}", jobs=jobs)
    raise BatchFault(Code.COMMAND_LINE, f"`{address}` is not an address of a cluster", HELP)
