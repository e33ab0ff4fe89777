"""Boundary A: does the policy observe what the trace says, and if not, what would explain it?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.policy.golden.comparison import Boundary, Comparison
from humanoid_getup.policy.golden.order_search import find_order, name_order
from humanoid_getup.policy.golden.replayed import ObservedPart, ReplayedPolicy
from humanoid_getup.policy.observation import Sensed
from robots import quaternion
from robots.quaternion import Array

SLACK = 2e-3  # of a term's largest entry, at least of 1; networks compute with 7 digits
JOINT_TERMS = ("joint_pos", "joint_vel")
DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Hypothesis:
    """A mistake in the making of an observation, and the signals that it would make of ours."""

    text: str
    change: Callable[[ReplayedPolicy], Sensed]


def check_observation(replayed: ReplayedPolicy) -> Comparison:
    """Compare the observations of a trace with those that the policy makes of its signals."""
    trace, signals = replayed.trace, replayed.signals
    found = replayed.step(signals).observation
    limits = [_limit(found[:, part.whole]) for part in replayed.parts]
    errors = [_error(trace.observation, found, part) for part in replayed.parts]
    wrong = [
        part
        for part, error, limit in zip(replayed.parts, errors, limits, strict=True)
        if error > limit
    ]
    causes = [f"'{part.name}': {_explain(replayed, part, found)}" for part in wrong]
    return Comparison(
        boundary=Boundary.OBSERVATION,
        agrees=not wrong,
        difference=max(errors),
        cause="; ".join(causes),
    )


def _explain(replayed: ReplayedPolicy, part: ObservedPart, found: Array) -> str:
    """Find the mistake that makes the trace's numbers of ours."""
    recorded, limit = replayed.trace.observation, _limit(found[:, part.whole])
    for hypothesis in _list_hypotheses(part):
        changed = replayed.step(hypothesis.change(replayed)).observation
        if _error(recorded[1:], changed[1:], part) <= limit:  # the first row has no step before
            return hypothesis.text
    mine, theirs = found[:, part.newest], recorded[:, part.newest]
    if part.quantity in JOINT_TERMS and (text := _explain_order(replayed, part)):
        return text
    return _explain_numbers(mine, theirs, limit, _name_entries(replayed, part))


def _name_entries(replayed: ReplayedPolicy, part: ObservedPart) -> list[str]:
    """Name the newest entries of a term: by their joints, or by their numbers."""
    if part.quantity in JOINT_TERMS:
        names = replayed.record.joints if replayed.record else replayed.robot.joint_names
        return [f"joint '{name}'" for name in names]
    return [f"entry {number}" for number in range(part.newest.stop - part.newest.start)]


def _list_hypotheses(part: ObservedPart) -> Iterator[Hypothesis]:
    for field in ("joint_vel", "joint_pos", "gyro", "gravity"):
        if field == part.quantity:
            yield Hypothesis("one policy step late", lambda r, f=field: _shift(r, f))
    if part.quantity == "gravity":
        yield Hypothesis(
            "gravity in the world frame, expected the torso's",
            lambda r: replace(r.signals, gravity=np.tile(DOWN, (len(r.trace), 1))),
        )
        yield Hypothesis(
            "gravity turned from torso to world, expected from world to torso",
            lambda r: replace(r.signals, gravity=quaternion.rotate(r.trace.orientation, DOWN)),
        )
        yield Hypothesis(
            "gravity points up, expected down",
            lambda r: replace(r.signals, gravity=-r.trace.gravity),
        )
        for shift, order in ((-1, "x y z w"), (1, "z w x y")):
            yield Hypothesis(
                f"the orientation is read as {order}, expected w x y z",
                lambda r, s=shift: replace(
                    r.signals,
                    gravity=quaternion.gravity_in_body(np.roll(r.trace.orientation, s, axis=1)),
                ),
            )
    if part.quantity == "gyro":
        yield Hypothesis(
            "angular velocity in the world frame, expected the torso's",
            lambda r: replace(r.signals, gyro=quaternion.rotate(r.trace.orientation, r.trace.gyro)),
        )


def _shift(replayed: ReplayedPolicy, field: str) -> Sensed:
    values = getattr(replayed.signals, field)
    return replace(replayed.signals, **{field: np.concatenate((values[:1], values[:-1]))})


def _explain_order(replayed: ReplayedPolicy, part: ObservedPart) -> str:
    """Find the order of joints that makes the trace's numbers of ours; '' if there is none."""
    recorded, robot = replayed.trace.observation[:, part.newest], replayed.robot
    joints = replayed.record.joints if replayed.record else robot.joint_names
    values = getattr(replayed.signals, part.quantity)
    made = []
    for name in joints:  # every entry as if it were of this joint
        own = values[:, [robot.joint_names.index(name)]]
        changed = replace(replayed.signals, **{part.quantity: np.repeat(own, robot.n, axis=1)})
        made.append(replayed.step(changed).observation[:, part.newest])
    order = find_order(recorded, np.stack(made), _limit(recorded))
    return "" if order is None else name_order(joints, order)


def _explain_numbers(mine: Array, theirs: Array, limit: float, names: list[str]) -> str:
    """Explain a difference by a factor or by constants."""
    factor = float((mine * theirs).sum() / max((mine * mine).sum(), 1e-12))
    if np.abs(factor * mine - theirs).max() <= limit:
        return f"{factor:.3g} times as large in the trace: another scale"
    offset = (theirs - mine).mean(axis=0)
    if np.abs(mine + offset - theirs).max() <= limit:
        i = int(np.abs(offset).argmax())
        return f"{names[i]} is off by {offset[i]:+.3f} in the trace: another zero, as of a posture"
    i, j = np.unravel_index(np.abs(mine - theirs).argmax(), mine.shape)
    return f"{names[j]} is {theirs[i, j]:.3f} at step {i} of the trace, here {mine[i, j]:.3f}"


def _limit(values: Array) -> float:
    return SLACK * max(1.0, float(np.abs(values).max(initial=0.0)))


def _error(recorded: Array, found: Array, part: ObservedPart) -> float:
    return float(np.abs(recorded[:, part.whole] - found[:, part.whole]).max())
