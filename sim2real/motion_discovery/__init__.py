"""Motions from a learned policy: its rises, made smooth and tried without its feedback."""
