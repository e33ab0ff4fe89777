"""The plan cache: solved rises in a folder, and a strategy that reuses the nearest one."""
