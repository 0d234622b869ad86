"""Unpack the workspace of a batch on dask workers.

The plugin unpacks the workspace in the folder of the worker, and removes it at the end.
"""

from __future__ import annotations

import asyncio
from typing import Any

from distributed import WorkerPlugin
from msgspec.structs import replace

from thingc.batch.cluster.remote_workers import leave, settle
from thingc.batch.cluster.workspace_archive import WorkspaceArchive


class UnpackedWorkspace(WorkerPlugin):
    """A dask plugin that unpacks a workspace on every worker, including workers that connect later.

    If the workspace cannot be unpacked, `remote_workers.evaluate_there` reports the reason.
    """

    def __init__(self, shipment: str, transfer: WorkspaceArchive) -> None:
        self.shipment = shipment
        self.transfer = transfer

    def setup(self, worker: Any) -> None:
        """Unpack the workspace below the worker's folder. dask removes this folder when the worker ends."""
        settle(self.shipment, self.transfer, worker.local_directory, worker.address)
        self.transfer = replace(self.transfer, data=b"")  # the scheduler keeps the data for later workers

    async def teardown(self, worker: Any) -> None:
        """Remove the unpacked workspace. Idle runners are ended first, which can take a moment."""
        await asyncio.to_thread(leave, self.shipment)
