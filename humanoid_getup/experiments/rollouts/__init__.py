"""Rollouts: targets and feedback laws played on many robots at once."""
