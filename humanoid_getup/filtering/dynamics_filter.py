"""The dynamics filter: turns a planned rise into targets that real servos can follow."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.evaluation.standing import HOLD_TIME, Stance, is_upright, judge, measure_stance
from humanoid_getup.filtering.reference import Reference, compose
from humanoid_getup.filtering.virtual_actuator import LimbMap, compute_force, compute_torque
from humanoid_getup.motions.motion import Trajectory, hold_last
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.rollout import (
    Feedback,
    Rollout,
    RolloutRandomization,
    Trace,
    randomize_rollouts,
)
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Posture, TorqueLimit
from robots.kinematics import place
from robots.quaternion import Array

FADE_CYCLES = 40  # in which the virtual actuator fades out before the targets stand still
FIRST_HOLD = 1.0  # s of stand that a rollout must show to be checked
FULL_HOLD = HOLD_TIME + 0.3  # s of stand that a check must show
CHECKS = 16  # disturbed rollouts of a motion before it is returned
CHECK_DISTURBANCE = RolloutRandomization(
    joints=np.radians(1.5), root=np.radians(3.0), friction=(0.6, 1.1), supply=(0.96, 1.04)
)


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A path and a motion to be rolled out."""

    path: Trajectory
    """From the lying posture to the connecting one."""
    connection: Connection
    tempo: float = 1.0
    """Speed of the path as a share of the planned one."""
    assistance: float = 1.0
    """Share of the virtual actuator's torques that is used; 0 is plain tracking."""
    before: Array | None = None
    """Targets to send first [rad], (T, n): those of an earlier rollout, at whose end the path
    begins."""


@dataclass(frozen=True, kw_only=True)
class CandidateRollout:
    """Rollout of a candidate."""

    candidate: Candidate
    stood: bool
    """Whether it ended upright for `FIRST_HOLD`; a check asks for more."""
    stand_time: float
    """Start to the first moment of the stand [s]; nan if it did not stand."""
    target: Array
    """Targets that the servos were sent [rad], (T, n)."""
    qpos: Array
    """MuJoCo positions, (T, nq)."""
    peak_neck: float
    """Greatest neck height reached [m]."""
    moving: int
    """Cycles before the targets stand still."""


class DynamicsFilter:
    """Tracks references in forward simulation, many at a time.

    Velocity-driven tracking and the virtual actuator are both written as targets of
    position servos, so the result can be sent to the robot as it is: the targets never
    leave the joints' ranges nor move faster than the servos, and the torques stay within
    the servos' limits because the simulated servos have the same.
    """

    def __init__(
        self,
        world: World,
        *,
        torque_limit: TorqueLimit = FULL_TORQUE,
        threads: int = 0,
    ) -> None:
        self.world, self.torque_limit = world, torque_limit
        self.count = 0
        self._threads = threads
        self._limbs = LimbMap.of(world)
        self._simulations: dict[int, Rollout] = {}

    def roll_out(self, start: Posture, candidates: list[Candidate]) -> list[CandidateRollout]:
        """Track every candidate from the start posture, at rest."""
        world, robot = self.world, self.world.robot
        references = [self._refer(c) for c in candidates]
        moving = [len(r.target) for r in references]
        length = max(moving) + round(FIRST_HOLD / robot.control_period)
        target = np.array([hold_last(r.target, length) for r in references])
        assistance = np.array([c.assistance for c in candidates])
        feedback = _Assistance(world, self._limbs, start, references, length, assistance)
        starts = np.tile(place(robot, world.model, start), (len(candidates), 1))
        limit = self.torque_limit.value
        limits = DomainParameters.nominal(world, len(candidates), torque_limit=limit)
        trace = self._play(starts, target, limits, feedback)
        stance = measure_stance(world, trace)
        return [self._read(trace, stance, i, c, moving[i]) for i, c in enumerate(candidates)]

    def _refer(self, c: Candidate) -> Reference:
        reference = compose(self.world, c.path, c.connection.motion, c.connection.frame, c.tempo)
        return reference if c.before is None else reference.after(c.before)

    def check(self, start: Posture, target: Array, rng: np.random.Generator) -> float:
        """Replay targets (T, n) without feedback, from the start and from disturbed ones.

        Returns the share that ended in a held stand; 0 if the undisturbed one did not.
        """
        world, robot = self.world, self.world.robot
        limit = self.torque_limit.largest(robot)
        starts, parameters = randomize_rollouts(
            world, place(robot, world.model, start), CHECKS, CHECK_DISTURBANCE, limit, rng
        )
        more = round((FULL_HOLD - FIRST_HOLD) / robot.control_period)
        longer = hold_last(target, len(target) + more)
        trace = self._play(starts, np.tile(longer, (CHECKS, 1, 1)), parameters, None)
        upright = is_upright(measure_stance(world, trace), robot)
        stood = [judge(u, trace.period).stood for u in upright]
        return float(np.mean(stood)) if stood[0] else 0.0

    def _play(
        self,
        starts: Array,
        target: Array,
        parameters: DomainParameters,
        feedback: _Assistance | None,
    ) -> Trace:
        n = len(starts)
        pwm_limited = np.full(n, self.torque_limit.by_pwm)
        parameters = replace(parameters, pwm_limited=pwm_limited)
        self.count += n
        if n not in self._simulations:
            self._simulations[n] = Rollout(self.world, n, threads=self._threads)
        return self._simulations[n].play(starts, target, parameters, feedback=feedback)

    def _read(
        self, trace: Trace, stance: Stance, i: int, candidate: Candidate, moving: int
    ) -> CandidateRollout:
        upright = is_upright(stance, self.world.robot)[i]
        stand = judge(upright, trace.period, hold_time=FIRST_HOLD - 0.1)
        return CandidateRollout(
            candidate=candidate,
            stood=stand.stood,
            stand_time=stand.start_time,
            target=trace.target[i],
            qpos=trace.qpos[i],
            peak_neck=float(stance.neck_height[i].max()),
            moving=moving,
        )


class _Assistance:
    """Adds the virtual actuator to the planned targets, within the limits of the guard."""

    def __init__(
        self,
        world: World,
        limbs: LimbMap,
        start: Posture,
        references: list[Reference],
        length: int,
        assistance: Array,
    ) -> None:
        robot = world.robot
        self._limbs, self._robot = limbs, robot
        self._torso = robot.layout(world.model).torso
        self._period = robot.control_period
        self._assistance = assistance[:, None]
        self._com = np.array([hold_last(r.com, length) for r in references])  # (N, T, 3)
        self._velocity = np.gradient(self._com, self._period, axis=1)
        self._joined = np.array([r.joined for r in references])
        self._begins = np.array([r.begins for r in references])
        self._moving = np.array([len(r.target) for r in references])
        self._last = np.tile(start.joint_pos, (len(references), 1))
        self._last_com: Array | None = None
        self._shift = np.zeros((len(references), 3))

    def __call__(self, state: Feedback, planned: Array) -> Array:
        com = state.com[:, self._torso]
        velocity = np.zeros_like(com)
        if self._last_com is not None:
            velocity = (com - self._last_com) / self._period
        self._last_com = com.copy()
        target = planned + self._assist(state, com, velocity) / self._robot.position_gain
        target = np.clip(target, self._robot.lower, self._robot.upper)
        reach = self._robot.max_velocity * self._period * 0.999
        self._last = np.clip(target, self._last - reach, self._last + reach)
        return self._last

    def _assist(self, state: Feedback, com: Array, velocity: Array) -> Array:
        k = state.step
        # Here the reference is shifted over the ground to the robot.
        anchored = (k == self._begins) | (k == self._joined)
        self._shift[anchored, :2] = (com - self._com[:, k])[anchored, :2]
        reference = self._com[:, k] + self._shift
        force = compute_force(com, velocity, reference, self._velocity[:, k], self._limbs.mass)
        left = np.clip((self._moving - 1 - k) / FADE_CYCLES, 0.0, 1.0)
        active = ((k >= self._begins) * left)[:, None]
        return active * self._assistance * compute_torque(state, force, self._limbs)
