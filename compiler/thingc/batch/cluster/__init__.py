"""Build the variants of a batch on other machines, with dask or SLURM."""
