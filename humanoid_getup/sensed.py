"""The judge without truth: what sensors alone tell of how a robot stands."""

from __future__ import annotations

import mujoco
import numpy as np

from drivers import Cycle, State
from humanoid_getup.ground import lowest_point
from humanoid_getup.stage import Stage, place
from humanoid_getup.standing import is_upright, judge
from humanoid_getup.watch import APART, LIMIT_SLACK, Watched, count_episodes
from robots import Posture, Robot, rotation
from robots.rotation import Array

# On the twin with sensor noise, 71 disturbed rises ended their stand with the torso turning
# no faster than 0.09 rad/s and no joint faster than 0.4 rad/s. A robot that has just come
# up sways more than that and does stand, so these are what no standing robot does.
STILL_TURN = 1.0  # rad/s of the torso
STILL_JOINT = 2.0  # rad/s of the fastest joint


def torso_orientation(stage: Stage, orientation: Array) -> Array:
    """Compute the torso's orientation from the IMU's (..., 4), by how it sits in the torso."""
    imu_in_torso = stage.model.site(stage.robot.imu_site).quat
    return rotation.multiply(orientation, rotation.inverse(imu_in_torso))


class GravitySense:
    """The direction of gravity in the torso, cycle by cycle: `torso_orientation` in haste."""

    def __init__(self, imu_in_torso: Array) -> None:
        """Prepare for an IMU that sits in the torso as a quaternion says, (4,)."""
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, imu_in_torso)
        self.torso_from_imu = matrix.reshape(3, 3)

    def __call__(self, orientation: Array) -> Array:
        """Turn the IMU's orientation (4,) into a unit vector in the torso, (3,)."""
        w, x, y, z = orientation.tolist()
        length = w * w + x * x + y * y + z * z
        # The last row of the rotation matrix is the world's z axis in the IMU's frame.
        down = np.array(
            [2.0 * (w * y - x * z), -2.0 * (y * z + w * x), x * x + y * y - w * w - z * z]
        )
        return self.torso_from_imu @ down / length


def estimate_torque(robot: Robot, current: Array) -> Array:
    """Estimate torques [N·m] from motor currents [A], (..., n).

    The datasheet's stall point gives the ratio; gear friction is not in it.
    """
    models = [joint.servo.model for joint in robot.joints]
    return current * np.array([m.stall_torque / m.stall_current for m in models])


class NeckHeight:
    """How high the neck is over the feet, by forward kinematics."""

    def __init__(self, stage: Stage) -> None:
        robot, model = stage.robot, stage.model
        self._model, self._data = model, mujoco.MjData(model)
        self._layout = robot.layout(model)
        self._neck = model.site(robot.neck_site).id
        self._soles = [model.site(site).id for site in robot.sole_sites]

    def __call__(self, orientation: Array, joint_pos: Array) -> float:
        """Measure the neck's height over the lower sole [m].

        Args:
            orientation: Torso to world, (4,).
            joint_pos: Joint angles [rad], (n,).
        """
        root = self._layout.root_qpos
        self._data.qpos[root + 3 : root + 7] = orientation
        self._data.qpos[self._layout.qpos] = joint_pos
        mujoco.mj_kinematics(self._model, self._data)
        height = self._data.site_xpos[:, 2]
        return float(height[self._neck] - height[self._soles].min())


class SensedWatch:
    """Looks at the measurement of each cycle; the judge of a robot without truth.

    It cannot feel whether anything but the feet touches the world, so a robot that leans
    on something, upright, at full height and still, passes for a standing one. Touches and
    penetrations are unknown, torques are estimated from currents, and the place is where
    the lowest point touches flat ground.
    """

    def __init__(self, stage: Stage, period: float, torque_limit: float | None) -> None:
        self._stage, self._period = stage, period
        limit = stage.robot.max_torque
        self._limit = limit if torque_limit is None else np.minimum(limit, torque_limit)
        self._seen: list[State] = []

    def __call__(self, cycle: Cycle) -> None:
        """Look once."""
        self._seen.append(cycle.state)

    def conclude(self) -> Watched:
        """Judge what was measured; a run that ended before its second cycle did not stand."""
        robot = self._stage.robot
        seen = self._seen[1:]  # the first measurement is of before the first command
        angles = np.array([s.joint_pos for s in seen]).reshape(-1, robot.n)
        velocity = np.array([s.joint_vel for s in seen]).reshape(-1, robot.n)
        current = np.array([s.joint_current for s in seen]).reshape(-1, robot.n)
        turn = np.linalg.norm(np.array([s.gyro for s in seen]).reshape(-1, 3), axis=1)
        measured = np.array([s.orientation for s in seen]).reshape(-1, 4)
        torso = torso_orientation(self._stage, measured)
        neck = NeckHeight(self._stage)
        height = np.array([neck(q, v) for q, v in zip(torso, angles, strict=True)])
        still = (turn <= STILL_TURN) & np.all(np.abs(velocity) <= STILL_JOINT, axis=1)
        upright = is_upright(height, rotation.tilt(torso), np.zeros(len(seen), dtype=bool), robot)
        stand = judge(upright & still, self._period)
        torque = estimate_torque(robot, current)
        rising = torque[: round(stand.start_time / self._period) + 1] if stand.stood else torque
        beyond = np.maximum(robot.lower - angles, angles - robot.upper) > LIMIT_SLACK
        left = count_episodes(beyond.any(axis=1)[:, None], round(APART / self._period))
        return Watched(
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
        stage = self._stage
        root = stage.robot.layout(stage.model).root_qpos
        rows = np.zeros((len(torso), stage.model.nq))
        for row, orientation, joint_pos in zip(rows, torso, angles, strict=True):
            posture = Posture(
                position=np.zeros(3),
                orientation=rotation.normalise(orientation),
                joint_pos=joint_pos,
            )
            row[:] = place(stage.robot, stage.model, posture)
            row[root + 2] = -lowest_point(stage.model, row)
        return rows
