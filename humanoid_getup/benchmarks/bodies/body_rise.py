"""Rises of the benchmark over bodies, judged by a held stand and by the measure of others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import msgspec
from msgspec import convert

from drivers import Ending
from humanoid_getup.benchmarks.bench_result import KeptRise
from humanoid_getup.benchmarks.bodies.head_gauge import TIME_LIMIT, HeadGauge, is_standing
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.experiments.judging.summary import RiseSummary, wilson_interval


@dataclass(frozen=True, kw_only=True)
class BodyRise(KeptRise):
    """Stored figures of a rise."""

    head_in_time: bool
    """Whether the head was as high as a standing robot's at the time limit of others."""
    head_at_end: bool
    """The same at the end, however late."""
    head_share: float | None
    """Height of the head at the end as a share of the standing one; None if nothing was played."""

    @classmethod
    def of(cls, rise: RiseResult, gauge: HeadGauge, bench_class: str) -> Self:
        """Take the figures of a rise.

        A run that was aborted is none that ends standing; one that ended in a held stand stands on.
        """
        in_time, at_end, share = False, False, None
        outcome, run = rise.outcome, rise.run
        if outcome is not None and run is not None and len(outcome.qpos):
            share = gauge.measure(outcome.qpos[-1])
            is_done = run.ending is Ending.DONE and rise.attempts[-1].abort is None
            at_end = is_done and is_standing(share)
            limit = round(TIME_LIMIT / outcome.record.period)
            in_time = rise.stood and at_end
            if len(outcome.qpos) >= limit:
                in_time = is_standing(gauge.measure(outcome.qpos[limit - 1]))
        kept = convert(rise.figures(), KeptRise, from_attributes=True)
        return cls(
            **vars(replace(kept, bench_class=bench_class)),
            head_in_time=in_time,
            head_at_end=at_end,
            head_share=share,
        )


class BodyRises(msgspec.Struct, frozen=True, kw_only=True):
    """Rises of a body by a method from one kind of starts."""

    classes: tuple[str, ...]
    missing: dict[str, str]
    """Classes in which the body does not come to lie, and why they were left out."""
    rises: list[BodyRise]

    @classmethod
    def join(cls, parts: Sequence[BodyRises]) -> BodyRises:
        """Join the rises of parts."""
        return cls(
            classes=tuple(dict.fromkeys(name for part in parts for name in part.classes)),
            missing={side: why for part in parts for side, why in part.missing.items()},
            rises=[rise for part in parts for rise in part.rises],
        )


class BodySummary(RiseSummary, frozen=True, kw_only=True):
    """Rises by both measures."""

    head_in_time: int
    head_in_time_interval_95: tuple[float, float]
    head_at_end: int
    head_at_end_interval_95: tuple[float, float]

    @classmethod
    def over(cls, rises: Sequence[BodyRise], **others: Any) -> Self:
        """Summarize rises; ``others`` are further fields."""
        n = len(rises)
        in_time = sum(rise.head_in_time for rise in rises)
        at_end = sum(rise.head_at_end for rise in rises)
        return cls.of(
            rises,
            head_in_time=in_time,
            head_in_time_interval_95=wilson_interval(in_time, n),
            head_at_end=at_end,
            head_at_end_interval_95=wilson_interval(at_end, n),
            **others,
        )
