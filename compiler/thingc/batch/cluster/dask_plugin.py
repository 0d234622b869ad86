"""What a worker of dask does with a shipped workspace: unpacks it in its own folder when it comes, removes it when it goes."""

from __future__ import annotations

import asyncio
from typing import Any

from distributed import WorkerPlugin
from msgspec.structs import replace

from thingc.batch.cluster.remote_workers import leave, settle
from thingc.batch.cluster.workspace_archive import WorkspaceArchive


class UnpackedWorkspace(WorkerPlugin):
    """A shipment on its way. dask hands one to each worker, also to those that come later; where it cannot be unpacked, variants are
    told why (`shipping.evaluate_there`)."""

    def __init__(self, shipment: str, transfer: WorkspaceArchive) -> None:
        self.shipment = shipment
        self.transfer = transfer

    def setup(self, worker: Any) -> None:
        """Unpack it below the worker's folder, which dask removes when the worker ends."""
        settle(self.shipment, self.transfer, worker.local_directory, worker.address)
        self.transfer = replace(self.transfer, data=b"")  # the scheduler has it for those that come

    async def teardown(self, worker: Any) -> None:
        """Remove it; runners that are idle end first, which may take a moment."""
        await asyncio.to_thread(leave, self.shipment)
