"""Starts of runs: sampled falls, drops, settling."""
