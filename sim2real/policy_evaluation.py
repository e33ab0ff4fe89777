"""Rollouts of a policy from settled falls, judged by the shared definition of standing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.falls import Fall
from humanoid_getup.experiments.judging.outcome import (
    Outcome,
    compute_rms,
    count_rising,
    find_impact,
)
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import judge
from humanoid_getup.experiments.judging.summary import (
    PolicyClasses,
    PolicySummary,
    summarize,
    wilson_interval,
)
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.policy.action import next_target
from humanoid_getup.policy.observation import Sensed, compute_torque_share, observe
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.policy.slope_legs import SlopeLegs
from humanoid_getup.policy.style_follower import StyleChoice, StyleFollower
from humanoid_getup.style.features import COUNT
from humanoid_getup.style.followed_style import MOST_DISTANCE, weigh
from robots import Robot
from robots.quaternion import Array
from sim2real.environment.style_task import STAND_TIME
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


DURATION = 10.0  # s of a rollout, whose last 3 s must be a stand


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
    stood_paper: NDArray[np.bool_] | None = None
    """Whether each stood as [Frezzato22], section 6.3, counts, (N,); ``None`` without style."""
    nearest: NDArray[np.str_] | None = None
    """Named style to which each came nearer than to these curves, "" for none, (N,)."""
    planned: NDArray[np.bool_] | None = None
    """Whether these were the curves of a plan, (N,); ``None`` if none was asked for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyRollouts(PolicyFigures):
    """Rollouts of N robots in S policy steps, judged."""

    qpos: Array
    """MuJoCo positions at the end of each policy step, (N, S, nq)."""
    target: Array
    """Targets of the servos at the end of each policy step [rad], (N, S, n)."""
    features: Array
    """Style features at the end of each policy step, (N, S, 3)."""


@dataclass(kw_only=True, eq=False)
class PolicyRun:
    """A run of a policy on N robots, which have the domain parameters of a simulation."""

    sim: TrainingSim
    policy: OnnxPolicy
    choose_style: StyleChoice | None = None
    """Chooses the curves that each robot follows, for a policy with style curves."""
    sees_ground: bool = False
    """Whether a policy with a height map gets the true one instead of a flat one."""
    duration: float = DURATION
    """[s]"""
    rng: np.random.Generator | None = None
    """Source of sensor noise; ``None`` for none."""
    on_step: Callable[[int], None] = lambda _: None
    """Called before each policy step with its number, to disturb the robots."""
    targets: list[Array] = field(default_factory=list, init=False)
    """Targets at the end of each policy step [rad], (N, n)."""
    features: list[Array] = field(default_factory=list, init=False)
    """Style features at the end of each policy step, (N, 3)."""

    def __post_init__(self) -> None:
        sim, contract, choose = self.sim, self.policy.contract, self.choose_style
        self._follower = StyleFollower(sim.robot, choose, sim.n) if choose else None
        self._memory = np.zeros((sim.n, contract.memory_size or contract.action.size))
        slope = sim.world.scene.slope
        self._legs = SlopeLegs(sim.robot, sim.n, slope) if choose and slope else None

    def run(self, starts: Array) -> PolicyRollouts:
        """Roll out the policy from MuJoCo positions (N, nq)."""
        sim, follower = self.sim, self._follower
        scenarios = Scenarios(starts=starts, parameters=sim.parameters)
        outcome, qpos = RunningOutcome(sim.robot), list[Array]()
        for record in Experiment(sim.world, sim=sim).play_pieces(scenarios, self._send):
            outcome.add(record)
            qpos.append(record.qpos[:, -1].copy())
        figures = outcome.conclude()
        return PolicyRollouts(
            outcome=figures,
            qpos=np.stack(qpos, axis=1),
            target=np.stack(self.targets, axis=1),
            features=np.stack(self.features, axis=1),
            style_error=follower.mean_error if follower else np.full((sim.n, COUNT), np.nan),
            restarts=follower.restarts if follower else np.zeros(sim.n, dtype=int),
            stood_paper=follower
            and judge_given(
                figures.upright,
                sim.robot.control_period,
                follower.duration,
                follower.followed_for,
            ),
            nearest=follower and follower.find_nearest(),
        )

    def _send(self) -> Array | None:
        """Return the targets of the next policy step, (N, cycles, n); None after the last."""
        sensed = self._sense()
        if len(self.targets) == round(self.duration / self.sim.step_time):
            return None
        self.on_step(len(self.targets))
        target = self._target if self.targets else sensed.joint_pos
        sent = target, self._decide(sensed, target)
        _, self._target = sent
        if self._legs is not None and self._follower is not None:
            torso = self.sim.read("qpos")[:, self.sim.robot.layout(self.sim.model).root_orientation]
            wanted = self._legs.compute(torso, self._follower.measured[:, 0])
            reach = self.policy.action.reach
            sent = self._legs.send(*sent, wanted, reach, self.sim.step_time)
        self.targets.append(sent[1])
        return self.sim.make_targets(*sent, self.policy.action.hold_reach)

    def _sense(self) -> Sensed:
        """Read the sensors; clear the memory of robots that restart on other style curves."""
        if self.targets:
            self.features.append(self.sim.measure_features())
        sensed = self.sim.sense(self.rng)
        if self._legs is not None:
            sensed = self._legs.level(sensed)
        if self._follower is not None:
            true_features = self.features[-1] if self.features else None
            again = self._follower.update(sensed, self.sim.step_time, true_features)
            self._memory[again] = 0.0
        return sensed

    def _decide(self, sensed: Sensed, target: Array) -> Array:
        """Let the policy act on measurements and the last targets [rad], (N, n)."""
        sim, policy, robot = self.sim, self.policy, self.sim.robot
        more = self._follower.observe() if self._follower else []
        if policy.contract.style and policy.contract.style.height_map:
            seen = sim.measure_height_map()
            more.append(seen if self.sees_ground else np.zeros_like(seen))
        share = compute_torque_share(robot, policy.action, sim.parameters.torque_limit)
        observation = observe(robot, sensed, target, self._memory, share, more)
        outputs, self._memory = policy.act(observation)
        action = outputs.astype(float)
        return next_target(robot, policy.action, target, sensed.joint_pos, sensed.gravity, action)


def judge_given(
    upright: NDArray[np.bool_], period: float, duration: Array, followed_for: Array
) -> NDArray[np.bool_]:
    """Judge rises by the curves that they were given, (N,), as [Frezzato22], section 6.3.

    A robot stands all the 3 s after its first curves, and has not restarted. Curves have durations
    [s] and are followed until a first restart [s], (N,); samples are (N, T).
    """
    time, end = period * np.arange(1, upright.shape[1] + 1), (duration + STAND_TIME)[:, np.newaxis]
    counts = (time > end - STAND_TIME) & (time <= end)
    is_over = time[-1] >= end[:, 0] - period
    return is_over & (followed_for > end[:, 0]) & np.all(upright | ~counts, axis=1)


def summarize_rollouts(
    starts: Sequence[Fall], rollouts: PolicyFigures, classes: Sequence[str]
) -> PolicyClasses:
    """Summarize by class and over all: counts, intervals, times [s], load, impact."""
    kinds = np.array([fall.start_class for fall in starts])
    outcome, error, nearest = rollouts.outcome, rollouts.style_error, rollouts.nearest
    unknown = np.full(len(kinds), np.nan)
    columns = {
        "stand_time_s": outcome.stand_time,
        "rms_torque_nm": np.where(outcome.stood, outcome.rms_torque, np.nan),
        "peak_torque_nm": outcome.peak_torque,
        "peak_braking_torque_nm": outcome.peak_braking_torque,
        "head_impact_m_s": unknown if outcome.head_impact is None else outcome.head_impact,
        "height_error": error[:, 0],
        "angle_error_deg": np.degrees(error[:, 1:].mean(axis=1)),
        "restarts": rollouts.restarts.astype(float),
        "standing_joint_speed_rad_s": outcome.standing_speed,
    }
    counts: dict[str, NDArray[np.bool_]] = {}
    if nearest is not None and rollouts.stood_paper is not None:
        is_near = (weigh(error) <= MOST_DISTANCE) & (nearest == "") & (rollouts.restarts == 0)
        counts = {"stood_paper": rollouts.stood_paper, "followed": outcome.stood & is_near}

    def summarize_rows(rows: NDArray[np.bool_]) -> PolicySummary:
        n, stood = int(rows.sum()), int(outcome.stood[rows].sum())
        names = Counter[str]() if nearest is None else Counter(nearest[rows & outcome.stood])
        figures: dict[str, Any] = {key: int(each[rows].sum()) for key, each in counts.items()}
        figures |= {name: summarize(values[rows]) for name, values in columns.items()}
        return PolicySummary(
            n=n,
            stood=stood,
            stood_interval_95=wilson_interval(stood, n),
            nearest={str(name) or "given": names[name] for name in sorted(names)},
            **figures,
        )

    return PolicyClasses(
        classes={name: summarize_rows(kinds == name) for name in classes},
        all=summarize_rows(np.ones(len(kinds), dtype=bool)),
    )
