"""Rollouts of a policy from settled falls, judged by the shared definition of standing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.outcome import (
    Outcome,
    compute_rms,
    count_rising,
    find_impact,
)
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import judge
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.policy.action import ActionSpec, next_target
from humanoid_getup.policy.observation import (
    Floats,
    Sensed,
    StyleInput,
    compute_torque_share,
    observe,
)
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.policy.style_follower import StyleChoice, StyleFollower
from humanoid_getup.style.features import COUNT
from robots import Robot
from robots.quaternion import Array
from sim2real.environment.training_simulation import TrainingSim

RECENT = 2.0  # s at the end, over which the speed of a stand is measured


@dataclass(frozen=True, kw_only=True, eq=False)
class RunFigures:
    """Figures of N runs of T samples, as :class:`Outcome` defines them."""

    upright: NDArray[np.bool_]
    """Whether the standing condition holds, (N, T); nowhere if the physics diverged."""
    stood: NDArray[np.bool_]
    """(N,)"""
    stand_time: Array
    """[s], nan without a stand, (N,)"""
    peak_torque: Array
    """[N·m], (N,)"""
    peak_braking_torque: Array
    """[N·m], (N,)"""
    rms_torque: Array
    """[N·m], (N,)"""
    head_impact: Array | None
    """[m/s], (N,)"""
    standing_speed: Array
    """RMS joint speed of the last 2 s [rad/s]; nan without a stand, (N,)."""


class RunningOutcome:
    """Takes the records of N runs piece by piece, and stores only the data of their figures."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._period = robot, robot.control_period
        self._peak, self._braking = np.zeros(1), np.zeros(1)
        self._upright: list[NDArray[np.bool_]] = []
        self._square: list[Array] = []
        """Mean square of the torques of a robot [(N·m)²]."""
        self._touch: list[NDArray[np.bool_]] = []
        self._head_speed: list[Array] = []
        self._joint_vel: list[Array] = []
        """Joint speeds of the last pieces."""
        self._diverged: NDArray[np.bool_] = np.zeros(1, dtype=bool)

    def add(self, record: Record) -> None:
        """Add the next piece of all runs."""
        outcome, self._period = Outcome(record, self._robot), record.period
        self._peak = np.maximum(self._peak, outcome.peak_torque)
        self._braking = np.maximum(self._braking, outcome.peak_braking_torque)
        self._upright.append(record.upright)
        self._square.append(np.mean(record.torque**2, axis=-1))
        if record.head_touch is not None and record.head_speed is not None:
            self._touch.append(record.head_touch)
            self._head_speed.append(record.head_speed)
        self._diverged = self._diverged | record.diverged
        self._joint_vel.append(record.joint_vel)
        while sum(piece.shape[1] for piece in self._joint_vel[1:]) >= self._recent:
            del self._joint_vel[0]

    def conclude(self) -> RunFigures:
        """Judge the runs."""
        upright = np.concatenate(self._upright, axis=1) & ~self._diverged[:, np.newaxis]
        stand = judge(upright, self._period)
        rising = count_rising(stand, self._period, upright.shape[1])
        impact = None
        if self._touch:
            touch = np.concatenate(self._touch, axis=1)
            impact = find_impact(touch, np.concatenate(self._head_speed, axis=1))
        recent = np.concatenate(self._joint_vel, axis=1)[:, -self._recent :]
        speed = np.sqrt(np.mean(recent**2, axis=(1, 2)))
        return RunFigures(
            upright=upright,
            stood=stand.stood,
            stand_time=stand.start_time,
            peak_torque=self._peak,
            peak_braking_torque=self._braking,
            rms_torque=compute_rms(np.concatenate(self._square, axis=1), rising),
            head_impact=impact,
            standing_speed=np.where(stand.stood, speed, np.nan),
        )

    @property
    def _recent(self) -> int:
        """Return how many samples are recent."""
        return round(RECENT / self._period)


PolicyFunction = Callable[[Floats], tuple[Array, Array]]
"""Maps observations (N, size) to actions (N, k) and to the memory (N, m)."""

DURATION = 10.0  # s of a rollout, whose last 3 s must be a stand


@dataclass(frozen=True, kw_only=True)
class PolicyDriver:
    """A policy, and its inputs besides sensors."""

    action: ActionSpec
    act: PolicyFunction
    memory: int | None = None
    """Size of the network's memory; ``None`` for its last action."""
    style: StyleInput | None = None
    """Inputs with which the policy follows style curves."""
    choose_style: StyleChoice | None = None
    """Chooses the curves that each robot follows."""
    sees_ground: bool = False
    """Whether a policy with a height map gets the true one instead of a flat one."""

    @staticmethod
    def of(
        policy: OnnxPolicy, choose_style: StyleChoice | None = None, *, sees_ground: bool = False
    ) -> PolicyDriver:
        """Take a policy from a file."""
        return PolicyDriver(
            action=policy.action,
            act=policy.act,
            memory=policy.contract.memory_size,
            style=policy.contract.style,
            choose_style=choose_style,
            sees_ground=sees_ground,
        )

    def skip(self, count: int) -> PolicyDriver:
        """Leave out the first starts."""
        choose = self.choose_style
        if choose is None:
            return self
        return replace(self, choose_style=lambda row, features: choose(count + row, features))


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyFigures:
    """Figures of rollouts of N robots."""

    outcome: RunFigures
    """(N,)"""
    style_error: Array
    """Mean error of each feature from the curves that a robot was first given, while they last,
    (N, 3): neck height as a share of standing, angles in rad; NaN without style."""
    restarts: NDArray[np.int_]
    """How often each robot restarted after it had deviated from its curves, (N,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyRollouts(PolicyFigures):
    """Rollouts of N robots in S policy steps, judged."""

    qpos: Array
    """MuJoCo positions at the end of each policy step, (N, S, nq)."""
    target: Array
    """Targets of the servos at the end of each policy step [rad], (N, S, n)."""
    features: Array
    """Style features at the end of each policy step, (N, S, 3)."""

    @property
    def figures(self) -> PolicyFigures:
        """Return the figures alone, which are smaller by far."""
        return PolicyFigures(
            outcome=self.outcome, style_error=self.style_error, restarts=self.restarts
        )


def join_rollouts(parts: Sequence[Any]) -> Any:
    """Join rollouts, or figures of them, along the robots: every array by its first axis."""
    joined = {}
    for field in fields(parts[0]):
        values = [getattr(part, field.name) for part in parts]
        if is_dataclass(values[0]):
            joined[field.name] = join_rollouts(values)
        elif values[0] is not None:
            joined[field.name] = np.concatenate(values)
    return replace(parts[0], **joined)


class PolicySource:
    """Sends robots the targets of a policy, one policy step after the other."""

    def __init__(
        self,
        sim: TrainingSim,
        policy: PolicyDriver,
        *,
        duration: float,
        rng: np.random.Generator | None,
        on_step: Callable[[int], None],
    ) -> None:
        """Prepare for a duration [s]; see :func:`roll_out_policy`."""
        self._sim, self._policy, self._rng, self._on_step = sim, policy, rng, on_step
        self._steps = round(duration / sim.step_time)
        style, choose = policy.style, policy.choose_style
        self.follower = StyleFollower(sim.robot, choose, sim.n) if style and choose else None
        self._memory = np.zeros((sim.n, policy.memory or policy.action.size))
        self.targets: list[Array] = []
        """Targets at the end of each policy step [rad], (N, n)."""
        self.features: list[Array] = []
        """Style features at the end of each policy step, (N, 3)."""

    def __call__(self) -> Array | None:
        """Return the targets of the next policy step, (N, cycles, n); None after the last."""
        sensed = self._sense()
        if len(self.targets) == self._steps:
            return None
        self._on_step(len(self.targets))
        target = self.targets[-1] if self.targets else sensed.joint_pos
        following = self._decide(sensed, target)
        self.targets.append(following)
        return self._sim.make_targets(target, following, self._policy.action.hold_reach)

    def _sense(self) -> Sensed:
        """Read the sensors; clear the memory of robots that restart on other style curves."""
        if self.targets:
            self.features.append(self._sim.measure_features())
        sensed = self._sim.sense(self._rng)
        if self.follower is not None:
            true_features = self.features[-1] if self.features else None
            again = self.follower.update(sensed, self._sim.step_time, true_features)
            self._memory[again] = 0.0
        return sensed

    def _decide(self, sensed: Sensed, target: Array) -> Array:
        """Let the policy act on measurements and the last targets [rad], (N, n)."""
        sim, policy, robot = self._sim, self._policy, self._sim.robot
        more = self.follower.observe() if self.follower else []
        if policy.style and policy.style.height_map:
            seen = sim.measure_height_map()
            more.append(seen if policy.sees_ground else np.zeros_like(seen))
        share = compute_torque_share(robot, policy.action, sim.parameters.torque_limit)
        observation = observe(robot, sensed, target, self._memory, share, more)
        outputs, self._memory = policy.act(observation)
        action = outputs.astype(float)
        return next_target(robot, policy.action, target, sensed.joint_pos, sensed.gravity, action)


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
    source = PolicySource(sim, policy, duration=duration, rng=rng, on_step=on_step)
    scenarios = Scenarios(starts=starts, parameters=sim.parameters)
    outcome, qpos = RunningOutcome(sim.robot), list[Array]()
    for record in Experiment(sim.world, sim=sim).play_pieces(scenarios, source):
        outcome.add(record)
        qpos.append(record.qpos[:, -1].copy())
    follower = source.follower
    return PolicyRollouts(
        outcome=outcome.conclude(),
        qpos=np.stack(qpos, axis=1),
        target=np.stack(source.targets, axis=1),
        features=np.stack(source.features, axis=1),
        style_error=follower.mean_error if follower else np.full((sim.n, COUNT), np.nan),
        restarts=follower.restarts if follower else np.zeros(sim.n, dtype=int),
    )
