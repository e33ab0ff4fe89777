"""Clips of motion capture: read for their style features alone."""
