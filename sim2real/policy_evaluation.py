"""Evaluation: a policy on settled falls that it never saw, judged by the shared definition."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.evaluation.judge import find_impact
from humanoid_getup.evaluation.standing import is_upright, judge
from humanoid_getup.policy.action import ActionSpec, next_target
from humanoid_getup.policy.observation import Floats, compute_torque_share, observe
from robots import quaternion
from robots.quaternion import Array
from sim2real.environment.vectorized_simulation import Herd

Policy = Callable[[Floats], Array]
"""Maps observations (N, size) to actions (N, k)."""

DURATION = 10.0  # s from the fall to the end of the record, whose last 3 s must be a stand


@dataclass(frozen=True, kw_only=True, eq=False)
class Rises:
    """What N robots went through, a sample a control cycle."""

    period: float
    """[s]"""
    upright: NDArray[np.bool_]
    """Whether the standing condition held, (N, T); never where physics went wrong."""
    qpos: Array
    """MuJoCo positions at the end of each policy step, (N, steps, nq)."""
    torque: Array
    """Servo torques [N·m], (N, T, n)."""
    joint_vel: Array
    """[rad/s], (N, T, n)"""
    head_impact: Array
    """Fastest that the head came upon the ground [m/s], (N,)."""

    @property
    def stood(self) -> NDArray[np.bool_]:
        """Tell who ended in a held stand, (N,)."""
        return np.array([judge(row, self.period).stood for row in self.upright])

    @property
    def stand_time(self) -> Array:
        """Return when each held stand began [s]; nan for who did not stand, (N,)."""
        return np.array([judge(row, self.period).start_time for row in self.upright])

    def peak_torque(self) -> Array:
        """Return the largest torque of each robot [N·m], (N,)."""
        return np.abs(self.torque).max(axis=(1, 2))

    def standing_speed(self) -> Array:
        """Compute the joint speed over the last two seconds [rad/s]; nan for who fell, (N,)."""
        recent = self.joint_vel[:, -round(2.0 / self.period) :]
        return np.where(self.stood, np.sqrt(np.mean(recent**2, axis=(1, 2))), np.nan)

    def rms_torque(self) -> Array:
        """Compute the torque over all joints and the way up [N·m]; nan for who fell, (N,)."""
        ends = self.stand_time / self.period
        means = [
            np.nan if np.isnan(end) else np.mean(row[: round(end) + 1] ** 2)
            for row, end in zip(self.torque, ends, strict=True)
        ]
        return np.sqrt(np.array(means))


def rise_all(
    herd: Herd,
    action: ActionSpec,
    policy: Policy,
    starts: Array,
    *,
    duration: float = DURATION,
    rng: np.random.Generator | None = None,
    on_step: Callable[[int], None] = lambda _: None,
) -> Rises:
    """Let a policy get robots up, each under the herd's conditions.

    Args:
        herd: As many robots as there are starts.
        action: What actions mean.
        policy: Acts.
        starts: MuJoCo positions, (N, nq).
        duration: How long [s].
        rng: Source of sensor noise; ``None`` for none.
        on_step: Called before each policy step with its number, to disturb the robots.
    """
    robot, everyone = herd.robot, np.arange(herd.n)
    layout = robot.layout(herd.model)
    herd.place(everyone, starts)
    sensed = herd.sense(rng)
    target, last_action = sensed.joint_pos, np.zeros((herd.n, action.size))
    share = compute_torque_share(robot, action, herd.conditions.torque_limit)
    steps = round(duration / (robot.control_period * action.cycles))
    seen: dict[str, list[Array]] = {}
    diverged = np.zeros(herd.n, dtype=bool)
    for step in range(steps):
        on_step(step)
        observation = observe(robot, sensed, target, last_action, share)
        last_action = np.clip(policy(observation).astype(float), -1.0, 1.0)
        following = next_target(action, target, sensed.joint_pos, sensed.gravity, last_action)
        recorded = herd.advance(target, following, record=herd.judged)
        diverged |= herd.diverged
        for name, values in herd.judge(recorded).items():
            seen.setdefault(name, []).append(values)
        target = following
        sensed = herd.sense(rng)
    joined = {name: np.concatenate(values, axis=1) for name, values in seen.items()}
    root = layout.root_qpos
    upright = is_upright(
        joined["neck_height"],
        quaternion.tilt(joined["qpos"][..., root + 3 : root + 7]),
        joined["foreign"].astype(bool),
        robot,
    )
    return Rises(
        period=robot.control_period,
        upright=upright & ~diverged[:, None],
        qpos=joined["qpos"][:, action.cycles - 1 :: action.cycles],
        torque=joined["torque"],
        joint_vel=joined["joint_vel"],
        head_impact=find_impact(joined["head_touch"].astype(bool), joined["head_speed"]),
    )
