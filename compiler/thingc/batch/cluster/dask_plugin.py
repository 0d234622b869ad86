"""A dask plugin that unpacks the workspace of a batch on each worker, and removes the workspace when the batch has ended."""

from __future__ import annotations

import asyncio
from typing import Any

from distributed import WorkerPlugin
from msgspec.structs import replace

from thingc.batch.cluster.remote_workers import remove_workspace, unpack_workspace
from thingc.batch.cluster.workspace_archive import WorkspaceArchive


class UnpackedWorkspace(WorkerPlugin):
    """A dask plugin that unpacks a workspace on every worker, including workers that connect later.

    If the plugin cannot unpack the workspace, `remote_workers.evaluate_on_worker` reports the reason.
    """

    def __init__(self, shipment: str, transfer: WorkspaceArchive) -> None:
        self.shipment = shipment
        self.transfer = transfer

    def setup(self, worker: Any) -> None:
        """Unpack the workspace into the folder of a worker. When the worker ends, dask deletes this folder."""
        unpack_workspace(self.shipment, self.transfer, worker.local_directory, worker.address)
        self.transfer = replace(self.transfer, data=b"")  # the scheduler keeps the data for later workers

    async def teardown(self, worker: Any) -> None:
        """End the idle runner processes on a worker, and remove the unpacked workspace. Ending the processes can take a moment."""
        await asyncio.to_thread(remove_workspace, self.shipment)
