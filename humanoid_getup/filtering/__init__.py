"""Filtering: from a path to targets that real servos can follow."""
