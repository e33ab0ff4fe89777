"""Rollouts of a policy from settled falls, judged by the shared definition of standing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judge import find_impact
from humanoid_getup.experiments.standing import judge
from humanoid_getup.policy.action import ActionSpec, next_target
from humanoid_getup.policy.observation import (
    Floats,
    StyleInput,
    compute_torque_share,
    observe,
    observe_style,
)
from humanoid_getup.style.curve_tracker import CurveTracker
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.features import COUNT
from humanoid_getup.style.style_errors import StyleErrors
from robots.quaternion import Array
from sim2real.environment.physics.training_simulation import Record, TrainingSim

PolicyFunction = Callable[[Floats], tuple[Array, Array]]
"""Maps observations (N, size) to actions (N, k) and to what it remembers of them (N, m)."""
StyleChoice = Callable[[int, Array], StyleCurves]
"""Chooses curves by the number of a start, and the features (3,) that the robot measures there."""


DURATION = 10.0  # s of a rollout, whose last 3 s must be a stand


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyRollouts(Record):
    """Rollouts of N robots, judged."""

    period: float
    """[s]"""
    style_error: Array
    """Mean error of each feature from the curves that a robot was first given, while they last,
    (N, 3): neck height as a share of standing, angles in rad; NaN without style."""
    restarts: NDArray[np.int_]
    """How often each robot restarted after it had deviated from its curves, (N,)."""

    @property
    def stood(self) -> NDArray[np.bool_]:
        """Return which robots ended in a held stand, (N,)."""
        return np.array([judge(row, self.period).stood for row in self.upright])

    @property
    def stand_time(self) -> Array:
        """Return the start time of each held stand [s]; nan without one, (N,)."""
        return np.array([judge(row, self.period).start_time for row in self.upright])

    @property
    def head_impact(self) -> Array:
        """Return the largest speed at which each head hit the ground [m/s], (N,)."""
        return find_impact(self.head_contact, self.head_speed)

    def peak_torque(self) -> Array:
        """Return the largest torque of each robot, braking or driving [N·m], (N,)."""
        return np.abs(self.torque).max(axis=(1, 2))

    def standing_speed(self) -> Array:
        """Compute the RMS joint speed of the last 2 s [rad/s]; nan without a stand, (N,)."""
        recent = self.joint_vel[:, -round(2.0 / self.period) :]
        return np.where(self.stood, np.sqrt(np.mean(recent**2, axis=(1, 2))), np.nan)

    def rms_torque(self) -> Array:
        """Compute the RMS torque of all joints until the stand [N·m]; nan without one, (N,)."""
        ends = self.stand_time / self.period
        means = [
            np.nan if np.isnan(end) else np.mean(row[: round(end) + 1] ** 2)
            for row, end in zip(self.torque, ends, strict=True)
        ]
        return np.sqrt(np.array(means))


def roll_out_policy(
    sim: TrainingSim,
    action: ActionSpec,
    policy: PolicyFunction,
    starts: Array,
    *,
    style: StyleInput | None = None,
    choose_style: StyleChoice | None = None,
    sees_ground: bool = False,
    duration: float = DURATION,
    rng: np.random.Generator | None = None,
    on_step: Callable[[int], None] = lambda _: None,
) -> PolicyRollouts:
    """Roll out a policy from MuJoCo positions (N, nq) for a duration [s].

    The N robots have the domain parameters of the simulation, and sensor noise from ``rng``. With
    ``style``, what a policy gets to follow curves, each robot follows those that are chosen for
    it; a policy with a height map gets it if it ``sees_ground``. ``on_step`` is called before each
    policy step with its number, to disturb them.
    """
    robot = sim.robot
    sim.place(sim.everyone, starts)
    sensed = sim.sense(rng)
    tracker = CurveTracker(robot, sim.n) if style and choose_style else None
    errors: StyleErrors | None = None
    if tracker is not None and choose_style is not None:
        tracker.measure(sensed.gravity, sensed.joint_pos)
        curves = [choose_style(row, seen) for row, seen in enumerate(tracker.features)]
        tracker.begin(sim.everyone, curves)
        errors = StyleErrors(curves, tracker.features, tracker.time)
    target = sensed.joint_pos
    memory = np.zeros((sim.n, style.memory if style else action.size))
    share = compute_torque_share(robot, action, sim.parameters.torque_limit)
    records: list[Record] = []
    diverged = np.zeros(sim.n, dtype=bool)
    restarts = np.zeros(sim.n, dtype=int)
    for step in range(round(duration / sim.step_time)):
        on_step(step)
        more = list(observe_style(tracker.targets, tracker.features)) if tracker else []
        if style and style.height_map:
            seen = sim.measure_height_map()
            more.append(seen if sees_ground else np.zeros_like(seen))
        outputs, memory = policy(observe(robot, sensed, target, memory, share, more))
        following = next_target(
            robot,
            action,
            target,
            sensed.joint_pos,
            sensed.gravity,
            np.clip(outputs.astype(float), -1.0, 1.0),
        )
        records.append(sim.follow_recorded(target, following))
        diverged |= sim.diverged
        target = following
        sensed = sim.sense(rng)
        if tracker is not None and errors is not None and choose_style is not None:
            tracker.advance(sim.step_time)
            tracker.measure(sensed.gravity, sensed.joint_pos)
            errors.note(records[-1].features[:, -1], sim.step_time)
            again = tracker.restart_deviating(sim.step_time, choose_style)
            memory[again] = 0.0
            restarts[again] += 1
    columns = {
        field.name: np.concatenate([getattr(record, field.name) for record in records], axis=1)
        for field in fields(Record)
    }
    columns["upright"] &= ~diverged[:, None]
    return PolicyRollouts(
        period=robot.control_period,
        style_error=errors.mean if errors else np.full((sim.n, COUNT), np.nan),
        restarts=restarts,
        **columns,
    )
