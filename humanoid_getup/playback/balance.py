"""Balance: the ankles correct the attitude of the torso at the end of a rise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from drivers import State
from humanoid_getup.motions.motion import Motion
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import GravitySense, imu_in_torso, place
from robots.quaternion import Array

TIME_SLACK = 1e-6  # s; clocks that sum up periods differ by their rounding
SETTLING = 0.5  # s after the motion in which its last attitude gives way to that of the stance
LAG = 0.043  # s; an ankle that follows its targets sooner corrects by less
ALIGNED = 0.9  # cosine between the axis of a joint and the one about which the torso turns


@dataclass(frozen=True, kw_only=True)
class BalanceGains:
    """Gains of the ankles on errors of the torso's attitude; (2,) is roll, pitch."""

    attitude: Array
    """Correction of the ankles per error, (2,)."""
    rate: Array
    """Correction of the ankles per error of the angular velocity [s], (2,)."""
    begin: float = math.radians(44.0)
    """Tilt of the recorded torso below which they act, to the end of the motion [rad]."""
    full: float = math.radians(10.0)
    """Tilt of the recorded torso from which they act fully [rad]."""
    largest: float = 0.35
    """Bound of a correction [rad]."""


GAINS = BalanceGains(attitude=np.array([0.15, 0.8]), rate=np.array([0.06, 0.08]))


class Balance:
    """Corrects a motion's targets when the torso deviates from the recorded attitude.

    The error is the rotation by which gravity in the torso differs from that of the recorded
    posture at the same time, and the difference of the angular velocities. It is fed back to the
    ankles once the recorded torso is upright and the feet alone carry the robot, and as long as
    the stand is held. The gains suit servos whose lag, damping over stiffness, is `LAG` or more: a
    stiffer ankle makes more torque of a correction, and rocks the robot as soon as its IMU is late
    by a period. Its gains are as much smaller as its lag is. A motion may end before its last sway
    does, so the attitude that counts thereafter is that of the standing posture. A correction never
    leads out of the joints' ranges and speeds.
    """

    def __init__(self, world: World, motion: Motion, gains: BalanceGains = GAINS) -> None:
        self._robot, self._gains = world.robot, gains
        self._sense_gravity = GravitySense(imu_in_torso(world.robot, world.model))
        self._time = motion.time - motion.time[0]
        self._gravity_b = quaternion.gravity_in_body(motion.orientation)  # (T, 3)
        self._stance_b = quaternion.gravity_in_body(world.robot.standing.orientation)  # (3,)
        self._turn = _differentiate(motion)  # (T, 3)
        self._share = _share(world, motion, gains)  # (T,)
        robot = world.robot  # joints that follow their targets soon are corrected by less
        ease = np.minimum(robot.torque_speed_slope / robot.position_gain / LAG, 1.0)  # (n,)
        self._ankles = find_ankles(world) * ease  # (2, n)
        self._reach = world.robot.max_velocity * world.robot.control_period

    def reset(self, held: Array) -> None:
        """Begin at the targets that the servos follow [rad], (n,)."""
        self._sent = self._target = held

    def correct(self, state: State, time: float, target: Array) -> Array:
        """Correct targets [rad] (n,) that are due at a time [s] of the motion."""
        frame = min(int(np.searchsorted(self._time, time - TIME_SLACK)), len(self._time) - 1)
        sent = target
        if self._share[frame] > 0.0:
            sent = self._bound(target + self._offset(state, frame, time), target)
        self._sent, self._target = sent, target
        return sent

    def _bound(self, corrected: Array, target: Array) -> Array:
        """Bound a corrected target (n,); what is out of bounds by itself is left to the guard."""
        robot, reach = self._robot, self._reach
        beyond_range = target - np.clip(target, robot.lower, robot.upper)
        step = target - self._target
        beyond_reach = step - np.clip(step, -reach, reach)
        wanted = np.clip(corrected, robot.lower, robot.upper) + beyond_range
        change = np.clip(wanted - self._sent - beyond_reach, -reach, reach) + beyond_reach
        return self._sent + change

    def _offset(self, state: State, frame: int, time: float) -> Array:
        gains, share = self._gains, self._share[frame]
        gravity_b = self._sense_gravity(state.orientation)
        settled = float(np.clip((time - self._time[-1]) / SETTLING, 0.0, 1.0))
        wanted = (1.0 - settled) * self._gravity_b[frame] + settled * self._stance_b
        error = share * np.cross(gravity_b, wanted)[:2]
        turn = self._sense_gravity.torso_from_imu @ state.gyro
        rate = share * (turn - self._turn[frame])[:2]
        turn_back = -gains.attitude * error - gains.rate * rate
        return np.clip(turn_back, -gains.largest, gains.largest) @ self._ankles


def make_balance(world: World, motion: Motion) -> Balance | None:
    """Make the balance of a motion; ``None`` if it does not end standing, or without an IMU."""
    has_imu = world.robot.imu_site is not None
    return Balance(world, motion) if motion.rises and has_imu else None


def find_ankles(world: World) -> Array:
    """Find how the ankles turn a robot that stands on both feet.

    The ankle of an axis is the first joint above a foot that turns about it.

    Returns:
        Changes of the joint angles [rad] per rotation of the torso about its x (roll) and y axis
        (pitch), (2, n).
    """
    robot, model = world.robot, world.model
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_kinematics(model, data)
    axes = data.xaxis[[model.joint(name).id for name in robot.joint_names]]  # (n, 3)
    ankles = np.zeros((2, robot.n))
    for site in robot.sole_sites:
        leg = _find_chain(world, int(model.site(site).bodyid[0]))
        for axis in (0, 1):
            ankle = [i for i in leg if abs(axes[i, axis]) > ALIGNED][:1]
            # The foot stays, so the torso turns against the joint.
            ankles[axis, ankle] = -np.sign(axes[ankle, axis])
    return ankles


def _find_chain(world: World, body: int) -> list[int]:
    """List the joints from a body up to the root."""
    model, names = world.model, world.robot.joint_names
    ids = {model.joint(name).id: i for i, name in enumerate(names)}
    chain = []
    while body:
        own = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
        chain += [ids[joint] for joint in reversed(own) if joint in ids]
        body = int(model.body_parentid[body])
    return chain


def _share(world: World, motion: Motion, gains: BalanceGains) -> Array:
    """Compute the share of the gains at each frame, (T,); 1 at the end.

    It is 0 until the torso is upright for the last time, and until only the feet touch the world
    for the last time: a robot that leans on a hand would be pushed off it.
    """
    tilt = quaternion.tilt(motion.orientation)
    share = np.clip((gains.begin - tilt) / (gains.begin - gains.full), 0.0, 1.0)
    first = _after(tilt > gains.begin)
    leans = _find_non_foot_contact(world, motion, first)
    share[: first + _after(leans)] = 0.0
    share[-1] = 1.0
    return share


def _after(flags: np.ndarray) -> int:
    """Return the index after the last flag that is set; 0 if none is."""
    found = np.flatnonzero(flags)
    return int(found[-1]) + 1 if len(found) else 0


def _find_non_foot_contact(world: World, motion: Motion, first: int) -> np.ndarray:
    """Find the frames, from a given one on, in which more than the feet touches the world."""
    data = mujoco.MjData(world.model)
    sensed = []
    for frame in range(first, len(motion.time)):
        data.qpos[:] = place(world.robot, world.model, motion.posture(frame))
        mujoco.mj_forward(world.model, data)
        sensed.append(data.sensordata.copy())
    return world.find_non_foot_contact(np.array(sensed).reshape(-1, world.model.nsensordata))


def _differentiate(motion: Motion) -> Array:
    """Compute the recorded angular velocity of the torso in its own frame [rad/s], (T, 3)."""
    before, after = motion.orientation[:-1], motion.orientation[1:]
    turn = quaternion.multiply(quaternion.inverse(before), after)  # (T - 1, 4)
    small = 2.0 * np.sign(turn[:, :1]) * turn[:, 1:]
    return np.vstack([small / np.diff(motion.time)[:, None], np.zeros(3)])
