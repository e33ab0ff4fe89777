"""Robots of a training: their physics, and how they differ."""
