"""Engines that do independent pieces of work: this process, its workers, Dask, Slurm."""
