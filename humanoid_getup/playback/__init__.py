"""Motions and policies on a robot: checked before, played, watched."""
