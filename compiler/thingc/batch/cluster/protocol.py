"""The interface of executors that build variants on other machines."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from concurrent.futures import Executor

from thingc.base.diagnostics import Code
from thingc.batch.folder import BatchFault

PATIENCE = 60.0
"""Time [s] after which a batch ends with an error if its cluster does not have any workers."""


class WorkerLost(Exception):
    """Raised if a worker has ended, or if a worker does not have the requested data.

    The batch then submits the variants of this worker again.
    """


class Cluster(Executor):
    """An executor that runs calls on other machines.

    At most `ahead` chunks run at the same time. Each of the first chunks contains `first` variants. Later chunks contain at most
    `chunk_most` variants, and are sized so that building a chunk takes about `chunk_seconds` seconds.
    """

    ahead = 1
    first = 1
    chunk_seconds = 0.5
    chunk_most = 64

    def check(self, files: Mapping[str, str]) -> None:
        """Raise `BatchFault` unless all workers can read the given files and have the same package versions installed.

        `files` maps absolute paths of files and folders to their digests (see `up_to_date.state_of`). By default, nothing is checked. Jobs
        that cannot access the files then report errors.
        """

    @abstractmethod
    def fault(self) -> BatchFault | None:
        """Return an error if the cluster can no longer return results. Return None if the cluster can still return results."""


def missing(package: str) -> BatchFault:
    """Return the error for a required Python package that is not installed."""
    return BatchFault(Code.CLUSTER, f"`--cluster` requires the package `{package}`", "run `pip install 'thingc[cluster]'`")
