"""Discovery: finds motions of a robot in the rises of a learned policy."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter1d

from humanoid_getup.experiments.disturbances import USUAL
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.experiments.judging.outcome import Outcome, compute_share
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.build import SOUND, NoEntryError, lay_down_at_random, with_entries
from humanoid_getup.motions.course import record_motion
from humanoid_getup.motions.keyframes import SPEED_SHARE
from humanoid_getup.motions.motion import Motion, hold_last
from humanoid_getup.motions.motion_database import FOUND_SIDES
from humanoid_getup.motions.optimization import make_scenarios
from humanoid_getup.playback.preflight import preflight_stored
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.posture_chains.rise_kind import KindNamer, label_ways, sample_rows
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place, read_posture
from robots.quaternion import Array
from robots.smooth_step import smooth_step
from sim2real.evaluation import PolicyTrial


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyRise:
    """One rise of a policy that stood, undisturbed."""

    start_class: LyingSide
    start: Array
    """MuJoCo positions of the lying robot, (nq,)."""
    target: Array
    """Targets of the servos at each control period [rad], (T, n); the first are the angles of the
    lying robot, the last ones still balance it."""
    stand_time: float
    """Time at which its held stand began [s]."""


def collect_rises(
    world: World, policy: OnnxPolicy, start_class: LyingSide, count: int, rng: np.random.Generator
) -> list[PolicyRise]:
    """Let a policy rise from postures on one side; return the rises that stood.

    Half of the robots lie as they fell, half as people would lay them: straight, both sides alike.
    """
    fallen = sample_falls(world, {start_class: count // 2}, rng)
    starts = [place(world.robot, world.model, fall.posture) for fall in fallen]
    starts += [lay_down_at_random(world, start_class, rng) for _ in range(count - len(starts))]
    postures = [read_posture(world.robot, world.model, qpos) for qpos in starts]
    found = PolicyTrial(policy=policy, scene=world.scene).run(postures)
    times = found.outcome.stand_time.tolist()
    return [
        PolicyRise(
            start_class=start_class,
            start=start,
            target=_interpolate(posture.joint_pos, target, policy.action.cycles),
            stand_time=time,
        )
        for start, posture, target, time in zip(starts, postures, found.target, times, strict=True)
        if not math.isnan(time)
    ]


def _interpolate(first: Array, target: Array, cycles: int) -> Array:
    """Sample targets of policy steps (S, n) at every control period from angles (n,)."""
    knots = np.arange(len(target) + 1) * cycles
    rows = np.concatenate([first[None], target])
    time = np.arange(knots[-1] + 1)
    return np.stack([np.interp(time, knots, column) for column in rows.T], axis=1)


BALANCING = 1.0  # s of balancing by the policy that belong to a rise, until the robot is steady
HOMING = 0.5  # s, shortest time in which the targets move on to the standing posture
PEAK = 1.5  # highest speed of a smooth step over its mean
SMOOTHINGS = (0.08, 0.05, 0.025, 0.0)
"""Standard deviations of the low-pass filter that are tried, the strongest first [s].

A policy of rates moves targets back and forth in steps of 48 ms; half of that hardly changes them.
"""


def shape(robot: Robot, rise: PolicyRise, smoothing: float) -> Array:
    """Smooth the targets of a rise, and end them in the standing posture, (T, n) [rad].

    Where they are faster than the servos, as those of a policy that turns back from an obstacle,
    they follow as fast as these can.
    """
    period = robot.control_period
    count = min(round((rise.stand_time + BALANCING) / period), len(rise.target))
    fastest = SPEED_SHARE * robot.max_velocity
    target = _limit_steps(_smooth(rise.target[:count], smoothing / period), fastest * period)
    way = robot.standing.joint_pos - target[-1]
    duration = max(HOMING, PEAK * float((np.abs(way) / fastest).max()))
    share = smooth_step(np.linspace(0.0, 1.0, math.ceil(duration / period) + 1))[1:, None]
    return np.concatenate([target, target[-1] + share * way])


def _smooth(target: Array, deviation: float) -> Array:
    """Filter targets (T, n) by a Gaussian with a width in frames; both ends stay."""
    if deviation <= 0.0:
        return target
    smooth = gaussian_filter1d(target, deviation, axis=0, mode="nearest")
    fade = np.clip(np.arange(len(target)) / (3.0 * deviation), 0.0, 1.0)[:, None]
    fade = np.minimum(fade, fade[::-1])
    return target + fade * (smooth - target)


def _limit_steps(target: Array, most: Array) -> Array:
    """Follow targets (T, n) by limited steps, (n,)."""
    followed = target.copy()
    for k in range(1, len(target)):
        followed[k] = followed[k - 1] + np.clip(target[k] - followed[k - 1], -most, most)
    return followed


LIMIT_SHARE = 0.75  # of the strongest servo's torque: the torque limit that a motion must stand
FIRST, MORE, ALL = 2, 12, 48
"""Counts of rollouts: undisturbed alone, for a comparison, and for a final judgment."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Replay:
    """Rollouts of one rise: undisturbed at the torque limit, at full torque, then disturbed."""

    rise: PolicyRise
    target: Array
    """[rad], (T, n)"""
    stood: np.ndarray
    """Of each rollout, (K,)."""
    qpos: Array
    """MuJoCo positions of the first rollout at the end of each control period, (T + hold, nq)."""
    stand_time: float
    """Of the first rollout [s]; nan without a stand."""
    rms_torque: float
    """Of the first rollout [N·m]."""

    @cached_property
    def share(self) -> float:
        """Return the share that stood; 0 if it fell undisturbed."""
        return compute_share(self.stood, FIRST)


def group_rises(world: World, rises: Sequence[Replay]) -> list[list[Replay]]:
    """Group rises that pass the same postures with similar joint angles."""
    groups: dict[tuple[str, int], list[Replay]] = {}
    namer, joints = KindNamer(world), world.robot.layout(world.model).qpos
    labels = label_ways([sample_rows(_until_stand(world, each)[:, joints]) for each in rises])
    for each, label in zip(rises, labels, strict=True):
        groups.setdefault((name_kind(namer, world, each), label), []).append(each)
    return list(groups.values())


def name_kind(namer: KindNamer, world: World, rise: Replay) -> str:
    """Name the postures that a robot passes on its way up."""
    passed = namer.name(_until_stand(world, rise), rise.rise.start_class)
    return "learned" + (f", over {passed}" if passed else "")


def _until_stand(world: World, rise: Replay) -> Array:
    return rise.qpos[: max(round(rise.stand_time / world.robot.control_period), 1)]


FINALISTS = 4  # of each wanted motion: rises that are played in all disturbed worlds


@dataclass(frozen=True, kw_only=True, eq=False)
class Discovery:
    """Motions found from one side, and the counts of rises."""

    start_class: LyingSide
    tried: int
    learned: int
    """Rises of the policy that stood."""
    replayed: int
    """Those that stand open loop, undisturbed."""
    best_share: float
    """Largest share of disturbed worlds in which one of them stands."""
    motions: tuple[Motion, ...]
    """The best of each kind, the most robust first."""


class MotionDiscovery:
    """Finds motions in the rises of a policy.

    Every rise that stands is replayed open loop, as smooth as it still stands, in disturbed worlds;
    the best of each kind becomes a motion.
    """

    def __init__(self, world: World, policy: OnnxPolicy, *, policy_name: str, seed: int) -> None:
        """Prepare to search in a scene; a seed makes it reproducible."""
        self._world, self._policy, self._seed = world, policy, seed
        self._policy_name = policy_name
        self._experiment = Experiment(world)
        self._torque_limit = LIMIT_SHARE * float(world.robot.max_torque.max())  # N·m

    def search(
        self,
        start_class: LyingSide,
        count: int,
        most: int,
        report: Callable[[float], None] = lambda _: None,
    ) -> Discovery:
        """Find motions in rises from a number of postures on one side, up to a count.

        The work done is reported in postures, in steps.
        """
        rng = np.random.default_rng([self._seed, FOUND_SIDES.index(start_class)])
        rises = collect_rises(self._world, self._policy, start_class, count, rng)
        report(count - len(rises))
        replayed: list[Replay] = []
        for rise in rises:
            replayed += self._replay(rise)
            report(1)
        judged = self._judge(replayed, most)
        return Discovery(
            start_class=start_class,
            tried=count,
            learned=len(rises),
            replayed=len(replayed),
            best_share=max((each.share for each in judged), default=0.0),
            motions=tuple(self._record(judged, start_class, most)),
        )

    def _replay(self, rise: PolicyRise) -> list[Replay]:
        """Replay a rise as smooth as it still stands, in more worlds; None if it never stands."""
        for smoothing in SMOOTHINGS:
            tried = self.play(rise, shape(self._world.robot, rise, smoothing), FIRST)
            if tried.stood.all():
                return [self.play(rise, tried.target, MORE)]
        return []

    def play(self, rise: PolicyRise, target: Array, count: int) -> Replay:
        """Replay targets of a rise (T, n) open loop in a number of rollouts.

        All rises are replayed in the same disturbed worlds, for comparison.
        """
        world, period = self._world, self._world.robot.control_period
        held = hold_last(target, len(target) + round((HOLD_TIME + period) / period))
        rng = np.random.default_rng([self._seed, count])
        scenarios = make_scenarios(world, rise.start, self._torque_limit, count, USUAL, rng)
        outcome = Outcome(self._experiment.play(scenarios, [held] * count), world.robot)
        return Replay(
            rise=rise,
            target=target,
            stood=outcome.stood,
            qpos=outcome.qpos[0],
            stand_time=float(outcome.stand_time[0]),
            rms_torque=float(outcome.rms_torque[0]),
        )

    def _judge(self, replayed: Sequence[Replay], most: int) -> list[Replay]:
        """Replay the best of each kind in all disturbed worlds; return the best first."""
        groups = [sorted(group, key=_rank) for group in group_rises(self._world, replayed)]
        turns = max((len(group) for group in groups), default=0)
        in_turn = [group[k] for k in range(turns) for group in groups if k < len(group)]
        finalists = sorted(in_turn[: FINALISTS * most], key=_rank)
        judged = (self.play(each.rise, each.target, ALL) for each in finalists)
        return sorted(judged, key=_rank)

    def _record(self, judged: Sequence[Replay], side: LyingSide, most: int) -> list[Motion]:
        """Record the best robust rise of each kind that passes the preflight."""
        motions: list[Motion] = []
        sound = [each for each in judged if each.share >= SOUND]
        for group in sorted(group_rises(self._world, sound), key=lambda g: _rank(g[0])):
            name = f"{side}_{self._policy_name}_{len(motions) + 1}"
            found = (self._make_motion(each, name) for each in group)
            if motion := next((each for each in found if each is not None), None):
                motions.append(motion)
            if len(motions) == most:
                break
        return motions

    def _make_motion(self, replay: Replay, name: str) -> Motion | None:
        """Make a motion; None if it has no entry frames, or if the preflight refuses it."""
        world = self._world
        motion = record_motion(
            world,
            read_posture(world.robot, world.model, replay.rise.start),
            replay.target,
            replay.qpos,
            name=name,
            start_class=replay.rise.start_class,
            strategy=name_kind(KindNamer(world), world, replay),
            provenance={
                "program": "getup motions discover",
                "policy": self._policy_name,
                "seed": self._seed,
                "disturbed_success": replay.share,
                "torque_limit": self._torque_limit,
                "stand_time_s": replay.stand_time,
            },
        )
        try:
            motion = with_entries(world, motion)
        except NoEntryError:
            return None
        verdict = preflight_stored(world, motion)
        return motion if verdict.passed else None


def _rank(replay: Replay) -> tuple[float, float]:
    """Rank by robustness, in steps of a twelfth, and then by torque."""
    return -round(MORE * replay.share), replay.rms_torque
