"""`getup` run in the process of a test."""

from collections.abc import Callable

Run = Callable[..., tuple[int, str, str]]
"""Runs `getup` with arguments; returns exit code, standard output, standard error."""
