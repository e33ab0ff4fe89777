"""The cache of plans: solved rises in a folder, and the strategy that reuses the nearest."""
