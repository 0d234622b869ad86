"""Build batches on other machines, with dask or SLURM."""
