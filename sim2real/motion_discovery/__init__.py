"""Motions from a learned policy: its rises, smoothed and replayed open loop."""
