"""Benchmarks that users can run: `getup bench NAME`."""
