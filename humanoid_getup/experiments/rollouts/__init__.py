"""Plays targets and feedback laws on many robots at a time."""
