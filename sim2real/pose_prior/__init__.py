"""The pose prior: what postures a robot takes while it rises, and rises to learn them from."""
