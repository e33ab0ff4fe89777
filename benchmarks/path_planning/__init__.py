"""Benchmarks of the path planner: beside those of OMPL, and what planning costs."""
