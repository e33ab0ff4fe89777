"""The watch: what a judge sees of a run on the twin, cycle by cycle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers import Cycle, State
from drivers.twin.simulation import Simulation
from humanoid_getup.evaluation.standing import Stand, is_upright, judge
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import NeckHeight, lowest_point, place, torso_orientation
from robots.quaternion import Array

DEEP_SELF_CONTACT = 0.0001  # m; contacts are stiff: a touch this deep is firm, a collision
DEEP_GROUND = 0.005  # m; deeper than soft contact of a resting robot ever is
APART = 0.1  # s without it, before a fault counts anew
LIMIT_SLACK = np.radians(1.0)  # a soft joint stop gives this much


@dataclass(frozen=True, kw_only=True)
class RunOutcome:
    """What happened in a run."""

    stand: Stand
    peak_torque: float
    """[N·m]"""
    peak_velocity: float
    """[rad/s]"""
    torque_use: float
    """Largest share of its limit that any servo used."""
    rms_torque: float
    """Over all joints and the way up [N·m]."""
    self_collisions: int | None
    """Times that the robot began to press into itself; None where nobody can tell."""
    ground_penetrations: int | None
    """Times that it began to press deeper into the ground than it rests; None as above."""
    limit_violations: int
    """Times that a joint left its range."""
    head_impact: float | None
    """Fastest that the head came upon the ground [m/s]; None where nobody can tell."""
    torque: Array
    """Servo torques [N·m], (T, n)."""
    qpos: Array
    """Where the robot went, MuJoCo positions (T, nq)."""
    is_sensed: bool = False
    """Seen by sensors alone: torques are estimates from currents, touches unknown."""


def count_episodes(present: np.ndarray, apart: int) -> list[int]:
    """Count how often each column of (T, k) flags rises after ``apart`` rows without it."""
    counts = []
    for column in present.T:
        rows = np.flatnonzero(column)
        counts.append(int(len(rows) > 0) + int(np.sum(np.diff(rows) > apart)))
    return counts


def find_impact(touch: np.ndarray, speed: Array) -> Array:
    """Find the fastest speed, one sample before, with which touches began.

    Args:
        touch: Whether it touches, (..., T); what touches from the start on has not come there.
        speed: How fast it moves [m/s], (..., T).
    """
    begins = touch[..., 1:] & ~touch[..., :-1]
    return np.where(begins, speed[..., :-1], 0.0).max(axis=-1, initial=0.0)


class GroundTruthJudge:
    """Looks at the truth of a simulation, period by period, while a servo has torque.

    It looks when the sensors do, from whatever thread lets time pass, so it judges the
    twin and the robot behind a virtual bus alike.
    """

    def __init__(self, simulation: Simulation, torque_limit: float | None) -> None:
        self._simulation = simulation
        limit = simulation.robot.max_torque
        self._limit = limit if torque_limit is None else np.minimum(limit, torque_limit)
        self._neck: list[float] = []
        self._tilt: list[float] = []
        self._foreign: list[bool] = []
        self._torque: list[Array] = []
        self._velocity: list[float] = []
        self._qpos: list[Array] = []
        self._head: list[tuple[bool, float]] = []
        self._faults: list[tuple[bool, bool, bool]] = []
        simulation.on_look.append(self._look)

    def __call__(self, _cycle: Cycle) -> None:
        """Take note that a cycle has passed; what is to be seen is seen in the simulation."""

    def _look(self) -> None:
        if not self._simulation.has_torque:
            return
        truth, robot = self._simulation.truth, self._simulation.robot
        self._neck.append(truth.neck_height)
        self._tilt.append(truth.tilt)
        self._foreign.append(truth.foreign_contact)
        self._torque.append(truth.joint_torque.copy())
        self._velocity.append(float(np.abs(truth.joint_vel).max()))
        self._qpos.append(truth.qpos)
        self._head.append((truth.head_contact, truth.head_speed))
        angles = truth.posture.joint_pos
        beyond = np.maximum(robot.lower - angles, angles - robot.upper).max()
        self._faults.append(
            (
                truth.self_penetration > DEEP_SELF_CONTACT,
                truth.ground_penetration > DEEP_GROUND,
                bool(beyond > LIMIT_SLACK),
            )
        )

    def conclude(self) -> RunOutcome:
        """Judge what was seen; a run that ended before its first cycle did not stand."""
        if self._look in self._simulation.on_look:
            self._simulation.on_look.remove(self._look)
        robot, period = self._simulation.robot, self._simulation.period
        upright = is_upright(
            np.array(self._neck), np.array(self._tilt), np.array(self._foreign, dtype=bool), robot
        )
        stand = judge(upright, period)
        torque = np.array(self._torque).reshape(-1, robot.n)
        rising = torque[: round(stand.start_time / period) + 1] if stand.stood else torque
        faults = count_episodes(
            np.array(self._faults, dtype=bool).reshape(-1, 3), round(APART / period)
        )
        head = np.array(self._head, dtype=float).reshape(-1, 2)
        return RunOutcome(
            stand=stand,
            peak_torque=float(np.abs(torque).max(initial=0.0)),
            peak_velocity=max(self._velocity, default=0.0),
            torque_use=float((np.abs(torque) / self._limit).max(initial=0.0)),
            rms_torque=float(np.sqrt(np.mean(rising**2))) if len(rising) else 0.0,
            self_collisions=faults[0],
            ground_penetrations=faults[1],
            limit_violations=faults[2],
            head_impact=float(find_impact(head[:, 0].astype(bool), head[:, 1])),
            torque=torque,
            qpos=np.array(self._qpos),
        )


# On the twin with sensor noise, 71 disturbed rises ended their stand with the torso turning
# no faster than 0.09 rad/s and no joint faster than 0.4 rad/s. A robot that has just come
# up sways more than that and does stand, so these are what no standing robot does.
STILL_TURN = 1.0  # rad/s of the torso
STILL_JOINT = 2.0  # rad/s of the fastest joint


def estimate_torque(robot: Robot, current: Array) -> Array:
    """Estimate torques [N·m] from motor currents [A], (..., n).

    The datasheet's stall point gives the ratio; gear friction is not in it.
    """
    models = [joint.servo.model for joint in robot.joints]
    return current * np.array([m.stall_torque / m.stall_current for m in models])


class SensorJudge:
    """Looks at the measurement of each cycle; the judge of a robot without truth.

    It cannot feel whether anything but the feet touches the world, so a robot that leans
    on something, upright, at full height and still, passes for a standing one. Touches and
    penetrations are unknown, torques are estimated from currents, and the place is where
    the lowest point touches flat ground.
    """

    def __init__(self, world: World, period: float, torque_limit: float | None) -> None:
        self._stage, self._period = world, period
        limit = world.robot.max_torque
        self._limit = limit if torque_limit is None else np.minimum(limit, torque_limit)
        self._seen: list[State] = []

    def __call__(self, cycle: Cycle) -> None:
        """Look once."""
        self._seen.append(cycle.state)

    def conclude(self) -> RunOutcome:
        """Judge what was measured; a run that ended before its second cycle did not stand."""
        robot = self._stage.robot
        seen = self._seen[1:]  # the first measurement is of before the first command
        angles = np.array([s.joint_pos for s in seen]).reshape(-1, robot.n)
        velocity = np.array([s.joint_vel for s in seen]).reshape(-1, robot.n)
        current = np.array([s.joint_current for s in seen]).reshape(-1, robot.n)
        turn = np.linalg.norm(np.array([s.gyro for s in seen]).reshape(-1, 3), axis=1)
        measured = np.array([s.orientation for s in seen]).reshape(-1, 4)
        torso = torso_orientation(self._stage.robot, self._stage.model, measured)
        neck = NeckHeight(self._stage.robot, self._stage.model)
        height = np.array([neck(q, v) for q, v in zip(torso, angles, strict=True)])
        still = (turn <= STILL_TURN) & np.all(np.abs(velocity) <= STILL_JOINT, axis=1)
        upright = is_upright(height, quaternion.tilt(torso), np.zeros(len(seen), dtype=bool), robot)
        stand = judge(upright & still, self._period)
        torque = estimate_torque(robot, current)
        rising = torque[: round(stand.start_time / self._period) + 1] if stand.stood else torque
        beyond = np.maximum(robot.lower - angles, angles - robot.upper) > LIMIT_SLACK
        left = count_episodes(beyond.any(axis=1)[:, None], round(APART / self._period))
        return RunOutcome(
            stand=stand,
            peak_torque=float(np.abs(torque).max(initial=0.0)),
            peak_velocity=float(np.abs(velocity).max(initial=0.0)),
            torque_use=float((np.abs(torque) / self._limit).max(initial=0.0)),
            rms_torque=float(np.sqrt(np.mean(rising**2))) if len(rising) else 0.0,
            self_collisions=None,
            ground_penetrations=None,
            limit_violations=left[0],
            head_impact=None,
            torque=torque,
            qpos=self._lay_out(torso, angles),
            is_sensed=True,
        )

    def _lay_out(self, torso: Array, angles: Array) -> Array:
        """Draw where the robot went, on flat ground, (T, nq)."""
        world = self._stage
        root = world.robot.layout(world.model).root_qpos
        rows = np.zeros((len(torso), world.model.nq))
        for row, orientation, joint_pos in zip(rows, torso, angles, strict=True):
            posture = Posture(
                position=np.zeros(3),
                orientation=quaternion.normalize(orientation),
                joint_pos=joint_pos,
            )
            row[:] = place(world.robot, world.model, posture)
            row[root + 2] = -lowest_point(world.model, row)
        return rows
