"""Policies by the names that a request gave them, wherever a worker has their files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from humanoid_getup.benchmarks.bench_result import MeasuredRise

Names = tuple[str, ...]


def rename_policies(
    rises: Sequence[MeasuredRise], files: Names, names: Names
) -> list[MeasuredRise]:
    """Name the policies of rises as they were given, where a worker has their files."""
    given = dict(zip(files, names, strict=True))
    return [
        rise if rise.policy is None else replace(rise, policy=given.get(rise.policy, rise.policy))
        for rise in rises
    ]
