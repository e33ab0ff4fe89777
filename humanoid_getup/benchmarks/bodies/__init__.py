"""Benchmark over the bodies of others, from their start states and from falls."""
