"""Judges: what happened in a run, from ground truth or from sensors alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from drivers import Cycle, State
from drivers.errors import NoImuError
from drivers.twin.simulation import Simulation
from humanoid_getup.experiments.rise_figures import DEEP_OVERLAP, compute_delta_v
from humanoid_getup.experiments.standing import (
    HOLD_TIME,
    StanceMeter,
    Stand,
    is_upright,
    judge,
)
from humanoid_getup.experiments.torque import split_torque
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene, Support
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.kinematics import lowest_point, place_postures, torso_orientation
from robots.quaternion import Array

DEEP_GROUND = 0.005  # m; more than the soft contact of a resting robot
APART = 0.1  # s after which a collision or violation counts again
LIMIT_SLACK = np.radians(1.0)  # a soft joint stop yields this much


@dataclass(frozen=True, kw_only=True)
class RunOutcome:
    """Figures of a run, and whether it ended in a stand."""

    stand: Stand
    peak_torque: float
    """Greatest torque with which a servo drove its joint [N·m]."""
    peak_braking_torque: float
    """Greatest torque with which a servo was turned from outside [N·m]."""
    peak_velocity: float
    """[rad/s]"""
    torque_use: float
    """Largest driving torque of any servo as a share of its limit."""
    rms_torque: float
    """RMS over all joints, up to the stand [N·m]."""
    self_collisions: int | None
    """Number of collisions of the robot with itself; None if not observable."""
    ground_penetrations: int | None
    """Number of times it pressed deeper into the ground than at rest; None if not observable."""
    limit_violations: int
    """Number of times a joint left its range."""
    head_impact: float | None
    """Greatest speed at which the head hit the ground [m/s]; None if not observable."""
    torso_impact: float | None
    """Greatest speed of the torso's faster end as it hit the ground [m/s]; None likewise."""
    neck_delta_v: float | None
    """Largest change of the neck's velocity within a control period, up to the stand [m/s]; None
    if not observable."""
    torque: Array
    """Servo torques [N·m], (T, n)."""
    torque_vel: Array
    """Actuator speeds at which they were made [rad/s], (T, n)."""
    qpos: Array
    """MuJoCo positions, (T, nq)."""
    is_sensed: bool = False
    """Judged by sensors alone: torques are estimated from currents, contacts unknown."""


def count_episodes(present: np.ndarray, apart: int) -> list[int]:
    """Count the episodes in each column of (T, k) flags, more than ``apart`` rows apart."""
    rows = [np.flatnonzero(column) for column in present.T]
    return [int(len(r) > 0) + int(np.sum(np.diff(r) > apart)) for r in rows]


def count_left_ranges(robot: Robot, joint_pos: Array, period: float) -> int:
    """Count how often a joint left its range, by angles (T, n), one row every period [s]."""
    beyond = np.maximum(robot.lower - joint_pos, joint_pos - robot.upper) > LIMIT_SLACK
    return count_episodes(beyond.any(axis=1)[:, None], round(APART / period))[0]


def limit_torque(robot: Robot, torque_limit: float | None) -> Array:
    """Return the torque limits of the servos [N·m], (n,)."""
    return robot.max_torque if torque_limit is None else np.minimum(robot.max_torque, torque_limit)


def _make_outcome(
    stand: Stand, torque: Array, velocity: Array, limit: Array, period: float, **others: Any
) -> RunOutcome:
    """Make an outcome of torques [N·m] and the speeds [rad/s] at which they were made, (T, n)."""
    shares = split_torque(torque, velocity)
    rising = torque[: round(stand.start_time / period) + 1] if stand.stood else torque
    return RunOutcome(
        stand=stand,
        torque=torque,
        torque_vel=velocity,
        peak_torque=float(shares.driving.max(initial=0.0)),
        peak_braking_torque=float(shares.braking.max(initial=0.0)),
        torque_use=float((shares.driving / limit).max(initial=0.0)),
        rms_torque=float(np.sqrt(np.mean(rising**2))) if len(rising) else 0.0,
        **others,
    )


def find_impact(touch: np.ndarray, speed: Array) -> Array:
    """Find the greatest speed (..., T) [m/s], one sample before, at which contacts began.

    A contact at the start is not an impact.
    """
    begins = touch[..., 1:] & ~touch[..., :-1]
    return np.where(begins, speed[..., :-1], 0.0).max(axis=-1, initial=0.0)


class GroundTruthJudge:
    """Judges a run by ground truth, sampled every period in which a servo has torque.

    It samples when the sensors do, on the thread that steps the simulation, so it judges the
    twin and the robot behind a virtual bus alike.
    """

    def __init__(
        self,
        simulation: Simulation,
        torque_limit: float | None,
        scene: Scene = FLAT_SCENE,
        support: Support | None = None,
    ) -> None:
        self._simulation = simulation
        self._limit = limit_torque(simulation.robot, torque_limit)
        self._deep_ground = DEEP_GROUND + scene.deepest_sink
        self._meter = StanceMeter(simulation.robot, simulation.model, support or scene.support)
        self._is_foot, self._head = _find_feet_and_head(simulation.robot, simulation.model)
        self._site_pos: list[Array] = []
        self._non_foot_contact: list[bool] = []
        self._torque: list[Array] = []
        self._velocity: list[Array] = []
        self._torque_vel: list[Array] = []
        self._qpos: list[Array] = []
        self._torso = simulation.model.body(simulation.robot.torso).id
        self._neck = simulation.model.site(simulation.robot.neck_site).id
        self._impacts: list[tuple[bool, float, bool, float]] = []
        self._faults: list[tuple[bool, bool, bool]] = []
        simulation.on_sensor_update.append(self._look)

    def __call__(self, _cycle: Cycle) -> None:
        """Ignore the cycle; samples come from the simulation."""

    def _look(self) -> None:
        if not self._simulation.has_torque:
            return
        truth, robot = self._simulation.truth, self._simulation.robot
        touching = truth.touching_bodies
        self._site_pos.append(truth.site_pos)
        self._non_foot_contact.append(not self._is_foot[touching].all())
        self._torque.append(truth.joint_torque.copy())
        self._velocity.append(truth.joint_vel.copy())
        self._torque_vel.append(self._simulation.torque_vel)
        self._qpos.append(truth.qpos)
        self._impacts.append((*self._measure_head(touching), *self._measure_torso(touching)))
        angles = truth.posture.joint_pos
        beyond = np.maximum(robot.lower - angles, angles - robot.upper).max()
        self._faults.append(
            (
                truth.self_penetration > DEEP_OVERLAP,
                truth.ground_penetration > self._deep_ground,
                bool(beyond > LIMIT_SLACK),
            )
        )

    def _measure_head(self, touching: NDArray[np.integer]) -> tuple[bool, float]:
        """Return whether the head touches the world, and its speed [m/s]."""
        if self._head is None:
            return False, 0.0
        speed = self._simulation.truth.measure_speed(self._head)
        return bool(np.any(touching == self._head)), speed

    def _measure_torso(self, touching: NDArray[np.integer]) -> tuple[bool, float]:
        """Return whether the torso touches the world, and the speed of its faster end [m/s]."""
        truth = self._simulation.truth
        ends = truth.measure_speed(self._torso), truth.measure_site_speed(self._neck)
        return bool(np.any(touching == self._torso)), max(ends)

    def end(self) -> bool:
        """Stop sampling; return at once whether the run ended in a held stand."""
        if self._look in self._simulation.on_sensor_update:
            self._simulation.on_sensor_update.remove(self._look)
        return self._judge_stand().stood

    def _judge_stand(self) -> Stand:
        robot, model = self._simulation.robot, self._simulation.model
        stance = self._meter.measure(
            np.array(self._qpos).reshape(-1, model.nq),
            np.array(self._site_pos).reshape(-1, model.nsite, 3),
            np.array(self._non_foot_contact, dtype=bool),
        )
        return judge(is_upright(stance, robot), self._simulation.period)

    def conclude(self) -> RunOutcome:
        """Judge the run; one that ended before its first cycle did not stand."""
        self.end()
        robot, period = self._simulation.robot, self._simulation.period
        qpos = np.array(self._qpos).reshape(-1, self._simulation.model.nq)
        stand = self._judge_stand()
        faults = count_episodes(
            np.array(self._faults, dtype=bool).reshape(-1, 3), round(APART / period)
        )
        impacts = np.array(self._impacts, dtype=float).reshape(-1, 4)
        touches, speeds = impacts[:, ::2].T.astype(bool), impacts[:, 1::2].T
        head_impact, torso_impact = find_impact(touches, speeds).tolist()
        return _make_outcome(
            stand,
            np.array(self._torque).reshape(-1, robot.n),
            np.array(self._torque_vel).reshape(-1, robot.n),
            self._limit,
            period,
            peak_velocity=float(np.abs(self._velocity).max(initial=0.0)),
            self_collisions=faults[0],
            ground_penetrations=faults[1],
            limit_violations=faults[2],
            head_impact=head_impact,
            torso_impact=torso_impact,
            neck_delta_v=self._measure_neck(stand),
            qpos=qpos,
        )

    def _measure_neck(self, stand: Stand) -> float:
        """Measure the largest change of the neck's velocity in a period, up to the stand [m/s]."""
        period = self._simulation.period
        neck = np.array(self._site_pos).reshape(-1, self._simulation.model.nsite, 3)[:, self._neck]
        rising = neck[: round(stand.start_time / period) + 1] if stand.stood else neck
        return float(compute_delta_v(rising, period).max(initial=0.0))


# On the twin with sensor noise, 71 disturbed rises ended their stand with the torso turning
# no faster than 0.09 rad/s and no joint faster than 0.4 rad/s. A robot that has just come
# up sways more than that and does stand, so these bounds exclude only robots that do not.
STILL_TURN = 1.0  # rad/s of the torso
STILL_JOINT = 2.0  # rad/s of the fastest joint


def estimate_torque(robot: Robot, current: Array) -> Array:
    """Estimate torques [N·m] from motor currents [A], (..., n).

    The datasheet's stall point gives the ratio; gear friction is not in it.
    """
    return current * robot.torque_per_ampere


def _find_feet_and_head(
    robot: Robot, model: mujoco.MjModel
) -> tuple[NDArray[np.bool_], int | None]:
    """Find which bodies are feet, (nbody,), and the body of the head if there is one."""
    feet = [model.site_bodyid[model.site(site).id] for site in robot.sole_sites]
    is_foot = np.isin(model.body_weldid, model.body_weldid[feet])
    heads = [model.joint(j.name).bodyid[0] for j in robot.joints if j.segment == "head"]
    return is_foot, int(heads[-1]) if heads else None


class SensorJudge:
    """Judges a run by the measurements of each cycle: for robots without ground truth.

    Sensors do not measure contacts, so a robot that leans on something, upright, at full height
    and still, counts as standing. Contacts and penetrations are unknown, torques are estimated
    from currents, and positions are those in which the lowest point touches flat ground.
    """

    def __init__(self, world: World, period: float, torque_limit: float | None) -> None:
        self._world, self._period = world, period
        self._limit = limit_torque(world.robot, torque_limit)
        self._meter = StanceMeter(world.robot, world.model)
        self._states: list[State] = []
        self._has_ended = False

    def __call__(self, cycle: Cycle) -> None:
        """Keep the measurement of a cycle.

        Raises:
            NoImuError: if the orientation was not measured: no stand can be judged without it.
        """
        if not cycle.state.has_imu:
            raise NoImuError(self._world.robot.name)
        if not self._has_ended:
            self._states.append(cycle.state)

    def end(self) -> bool:
        """Stop observing; return at once whether the run ended in a held stand."""
        self._has_ended = True
        newest = self._states[1:][-round(HOLD_TIME / self._period) - 2 :]
        return self._judge_stand(newest).stood

    def _judge_stand(self, states: Sequence[State]) -> Stand:
        robot, model = self._world.robot, self._world.model
        velocity = np.array([s.joint_vel for s in states]).reshape(-1, robot.n)
        turn = np.linalg.norm(np.array([s.gyro for s in states]).reshape(-1, 3), axis=1)
        angles = np.array([s.joint_pos for s in states]).reshape(-1, robot.n)
        measured = np.array([s.orientation for s in states]).reshape(-1, 4)
        stance = self._meter.estimate(torso_orientation(robot, model, measured), angles)
        still = (turn <= STILL_TURN) & np.all(np.abs(velocity) <= STILL_JOINT, axis=1)
        return judge(is_upright(stance, robot) & still, self._period)

    def conclude(self) -> RunOutcome:
        """Judge the run; one that ended before its second cycle did not stand."""
        robot, model = self._world.robot, self._world.model
        states = self._states[1:]  # the first was measured before the first command
        angles = np.array([s.joint_pos for s in states]).reshape(-1, robot.n)
        velocity = np.array([s.joint_vel for s in states]).reshape(-1, robot.n)
        current = np.array([s.joint_current for s in states]).reshape(-1, robot.n)
        measured = np.array([s.orientation for s in states]).reshape(-1, 4)
        torso = torso_orientation(robot, model, measured)
        stand = self._judge_stand(states)
        return _make_outcome(
            stand,
            estimate_torque(robot, current),
            robot.transmission.to_actuator(velocity),
            self._limit,
            self._period,
            peak_velocity=float(np.abs(velocity).max(initial=0.0)),
            self_collisions=None,
            ground_penetrations=None,
            limit_violations=count_left_ranges(robot, angles, self._period),
            head_impact=None,
            torso_impact=None,
            neck_delta_v=None,
            qpos=_place_on_ground(robot, model, torso, angles),
            is_sensed=True,
        )


def _place_on_ground(robot: Robot, model: mujoco.MjModel, torso: Array, joint_pos: Array) -> Array:
    """Convert measurements (T, ...) to MuJoCo positions on flat ground, (T, nq)."""
    orientation = quaternion.normalize(torso)
    qpos = place_postures(robot, model, np.zeros(3), orientation, joint_pos)
    qpos[:, robot.layout(model).root_qpos + 2] = [-lowest_point(model, row) for row in qpos]
    return qpos
