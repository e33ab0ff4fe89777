"""Robots of a training: their physics and their differences."""
