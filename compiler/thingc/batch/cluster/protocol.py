"""What an engine of a batch on other machines is: an executor, and perhaps one that carries files."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Any, TypeVar

from thingc.base.diagnostics import Code
from thingc.batch.folder import BatchFault

if TYPE_CHECKING:
    from thingc.batch.cluster.workspace_archive import WorkspaceArchive

T = TypeVar("T")

PATIENCE = 60.0
"""How long [s] a cluster may be without any worker before the batch ends."""


class WorkerLost(Exception):
    """A worker that is gone, or has not, or no longer, what it is asked for. Its variants are handed out again."""


class Cluster(Executor):
    """An executor on other machines. `ahead` chunks may be under way at once, the first of `first` variants, later ones so large
    that they take about `chunk_seconds` [s] of one runner, and of at most `chunk_most` variants."""

    ahead = 1
    first = 1
    chunk_seconds = 0.5
    chunk_most = 64

    @abstractmethod
    def check(self, files: Mapping[str, str]) -> None:
        """Raise `BatchFault` unless the workers see these files and folders (absolute path: digest, see `up_to_date.state_of`) and have
        the same versions installed."""

    @abstractmethod
    def fault(self) -> BatchFault | None:
        """What keeps it from ever answering, and None as long as nothing does."""


class FileTransferExecutor(Cluster):
    """A cluster that can carry files, so that its workers need not see those of this machine."""

    @abstractmethod
    def ship(self, name: str, transfer: WorkspaceArchive) -> None:
        """Give a workspace to every worker there is and to those that come, once each. Raises `BatchFault` where one cannot take it."""

    @abstractmethod
    def unship(self, name: str) -> None:
        """Let workers remove what they have of that shipment, as far as they can still be reached."""

    @abstractmethod
    def ask(self, worker: str, fn: Callable[..., T], *arguments: Any) -> T:
        """Call `fn` on the worker of that address at once, whatever it is at. Raises `WorkerLost`."""


def missing(package: str) -> BatchFault:
    """What to say where the library of a cluster is not installed."""
    return BatchFault(Code.CLUSTER, f"the package `{package}` is not installed, and `--cluster` needs it", "pip install 'thingc[cluster]'")
