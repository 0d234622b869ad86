"""Other machines as the executor of a batch: dask and SLURM."""
