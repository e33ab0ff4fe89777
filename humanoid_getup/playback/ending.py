"""The end of a motion: how long it is held, and whether it is what the motion should end in."""

from __future__ import annotations

from humanoid_getup.experiments.judge import RunOutcome
from humanoid_getup.experiments.lying import LYING_TIME, MAX_HEAD_IMPACT, judge_run
from humanoid_getup.experiments.standing import HOLD
from humanoid_getup.motions.motion import NO_END, STANDING, Motion
from humanoid_getup.simulation.world import World

REST = LYING_TIME + 0.5  # s; a robot may move on for a moment before it lies still


def hold_time(motion: Motion) -> float:
    """Return how long the end of a motion is held, to be judged [s]."""
    if motion.end_class == NO_END:
        return 0.0
    return HOLD if motion.rises else REST


def ends_as_meant(world: World, motion: Motion, outcome: RunOutcome) -> bool:
    """Return whether a run of a motion ended in a held stand, or lying softly on its side.

    A path is not meant to end in either.
    """
    if motion.end_class == STANDING:
        return outcome.stand.stood
    if motion.end_class == NO_END:
        return True
    lying = judge_run(world.robot, world.model, outcome.qpos, motion.end_class)
    is_soft = outcome.head_impact is None or outcome.head_impact <= MAX_HEAD_IMPACT
    return bool(lying.lies) and is_soft


def describe_end(motion: Motion) -> str:
    """Say what a motion is meant to end in."""
    if motion.end_class == NO_END:
        return "anywhere"
    return "in a held stand" if motion.rises else f"lying {motion.end_class}, softly and still"
