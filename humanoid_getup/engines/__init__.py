"""Engines that run independent pieces of work: this process, processes, Ray, Dask, Slurm."""
