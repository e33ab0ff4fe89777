"""Takes of rollouts that followed style curves."""

from __future__ import annotations

import numpy as np

from humanoid_getup.studio.follow_style import StyledRollout
from humanoid_getup.studio.takes.take import Mark, Plot, Take
from robots.quaternion import Array

TITLES = ("Neck height [share of standing]", "Side angle [deg]", "Front angle [deg]")


def make_take(rollout: StyledRollout) -> Take:
    """Make the take of a rollout."""
    wanted, followed = (
        _in_units(np.append(features, features[-1:], axis=0))
        for features in (rollout.wanted, rollout.measured)
    )
    plots = [
        Plot(title=title, curves={"wanted": wanted[:, k], "followed": followed[:, k]})
        for k, title in enumerate(TITLES)
    ]
    stand = rollout.stand_time
    return Take(
        name=f"{rollout.request.style.name}, {rollout.request.policy}",
        time=np.concatenate([[0.0], rollout.time]),
        qpos=_prepend(rollout.begin, rollout.outcome.record.qpos),
        joint_torque=_prepend(np.zeros(rollout.outcome.robot.n), rollout.joint_torque),
        plots=tuple(plots),
        marks=() if stand is None else (Mark(time=stand, text="stands"),),
        facts=(describe(rollout), str(rollout.followed)),
    )


def describe(rollout: StyledRollout) -> str:
    """Describe how a rollout ended, in one line."""
    stand = rollout.stand_time
    if stand is not None:
        return f"Stands at {stand:.2f} s"
    return f"Does not stand within {rollout.time[-1]:.1f} s: {rollout.reason}"


def _in_units(features: Array) -> Array:
    return features * np.array([1.0, 180.0 / np.pi, 180.0 / np.pi])


def _prepend(first: Array, rows: Array) -> Array:
    return np.concatenate([first[np.newaxis], rows])
