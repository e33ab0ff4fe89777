"""Rollouts of a policy from settled falls, judged by the shared definition of standing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.running_outcome import RunFigures, RunningOutcome
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
from sim2real.environment.physics.training_simulation import TrainingSim

PolicyFunction = Callable[[Floats], tuple[Array, Array]]
"""Maps observations (N, size) to actions (N, k) and to what it remembers of them (N, m)."""
StyleChoice = Callable[[int, Array], StyleCurves]
"""Chooses curves by the number of a start, and the features (3,) that the robot measures there."""


DURATION = 10.0  # s of a rollout, whose last 3 s must be a stand


@dataclass(frozen=True, kw_only=True)
class PolicyDriver:
    """A policy, and what it is given besides what sensors measure."""

    action: ActionSpec
    act: PolicyFunction
    style: StyleInput | None = None
    """What the policy gets to follow style curves."""
    choose_style: StyleChoice | None = None
    """Chooses the curves that each robot follows."""
    sees_ground: bool = False
    """Whether a policy with a height map gets one that is not flat."""

    def skip(self, count: int) -> PolicyDriver:
        """Leave out the first starts, of which others took care."""
        choose = self.choose_style
        if choose is None:
            return self
        return replace(self, choose_style=lambda row, features: choose(count + row, features))


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyRollouts:
    """Rollouts of N robots in S policy steps, judged."""

    outcome: RunFigures
    """(N,)"""
    qpos: Array
    """MuJoCo positions at the end of each policy step, (N, S, nq)."""
    target: Array
    """Targets of the servos at the end of each policy step [rad], (N, S, n)."""
    features: Array
    """Style features at the end of each policy step, (N, S, 3)."""
    style_error: Array
    """Mean error of each feature from the curves that a robot was first given, while they last,
    (N, 3): neck height as a share of standing, angles in rad; NaN without style."""
    restarts: NDArray[np.int_]
    """How often each robot restarted after it had deviated from its curves, (N,)."""


def roll_out_policy(
    sim: TrainingSim,
    policy: PolicyDriver,
    starts: Array,
    *,
    duration: float = DURATION,
    rng: np.random.Generator | None = None,
    on_step: Callable[[int], None] = lambda _: None,
) -> PolicyRollouts:
    """Roll out a policy from MuJoCo positions (N, nq) for a duration [s].

    The N robots have the domain parameters of the simulation, and sensor noise from ``rng``.
    ``on_step`` is called before each policy step with its number, to disturb them.
    """
    robot, action, style = sim.robot, policy.action, policy.style
    choose_style = policy.choose_style
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
    outcome, qpos = RunningOutcome(robot), list[Array]()
    targets: list[Array] = []
    features: list[Array] = []
    restarts = np.zeros(sim.n, dtype=int)
    for step in range(round(duration / sim.step_time)):
        on_step(step)
        more = list(observe_style(tracker.targets, tracker.features)) if tracker else []
        if style and style.height_map:
            seen = sim.measure_height_map()
            more.append(seen if policy.sees_ground else np.zeros_like(seen))
        outputs, memory = policy.act(observe(robot, sensed, target, memory, share, more))
        following = next_target(
            robot,
            action,
            target,
            sensed.joint_pos,
            sensed.gravity,
            np.clip(outputs.astype(float), -1.0, 1.0),
        )
        record = sim.follow_recorded(target, following)
        outcome.add(record)
        qpos.append(record.qpos[:, -1].copy())
        targets.append(following)
        features.append(sim.measure_features())
        target = following
        sensed = sim.sense(rng)
        if tracker is not None and errors is not None and choose_style is not None:
            tracker.advance(sim.step_time)
            tracker.measure(sensed.gravity, sensed.joint_pos)
            errors.note(features[-1], sim.step_time)
            again = tracker.restart_deviating(sim.step_time, choose_style)
            memory[again] = 0.0
            restarts[again] += 1
    return PolicyRollouts(
        outcome=outcome.conclude(),
        qpos=np.stack(qpos, axis=1),
        target=np.stack(targets, axis=1),
        features=np.stack(features, axis=1),
        style_error=errors.mean if errors else np.full((sim.n, COUNT), np.nan),
        restarts=restarts,
    )
