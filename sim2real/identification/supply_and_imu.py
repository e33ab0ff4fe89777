"""What sensors tell directly: the resistance of the supply, and the mounting of the IMU."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from drivers import Twin
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.quaternion import Array
from robots.servo import LIMIT_MODES
from sim2real.identification.flight_replay import Excerpt
from sim2real.identification.servo_fit import compute_reach

TURN_SCALE = 0.5  # s, by which rates are multiplied that are aligned beside unit vectors
LEAST_TILT = np.radians(1.5)
SUPPLY_WIDTHS = 0.0, 0.1, 0.2, 0.3, 0.4, 0.6  # s, over which a bus averages voltages
LEAST_CURRENT = 1.0  # A of the supply, by which it has to vary
LEAST_SHARE = 0.5  # of the voltage's variance that it explains


def find_supply_resistance(
    robot: Robot, excerpts: Sequence[Excerpt], part_of: np.ndarray
) -> tuple[float, float] | None:
    """Find the resistance of the supply and half its 95 % interval [Ω] from voltage and currents.

    A bus reads the voltages of all servos in turn, and their mean follows the current late: that
    is averaged over the time that fits best. None where the voltage hardly follows the current.
    """
    fits = [_compare_supply(robot, excerpts, width) for width in SUPPLY_WIDTHS]
    share, i, v = max(fits, key=lambda fit: fit[0])
    if share < LEAST_SHARE:
        return None
    kept = [part_of != part for part in np.unique(part_of)]
    found = np.array([-(i[k] @ v[k]) / (i[k] @ i[k]) for k in kept])
    return float(found.mean()), float(compute_reach(found))


def _compare_supply(
    robot: Robot, excerpts: Sequence[Excerpt], width: float
) -> tuple[float, Array, Array]:
    """Return how well voltage follows current averaged over a time [s], and both about a mean.

    That is the share of the voltage's variance that a straight line explains.
    """
    current, voltage = list[Array](), list[Array]()
    for one in excerpts:
        volts = np.array([state.voltage for state in one.states])
        torque = np.array([s.joint_current for s in one.states]) * robot.torque_per_ampere
        speed = robot.transmission.to_actuator(np.array([s.joint_vel for s in one.states]))
        drawn = robot.find_supply_current(np.maximum(volts, 1.0), torque, speed)
        count = max(round(width / robot.control_period), 1)
        drawn = uniform_filter1d(drawn, count, origin=(count - 1) // 2, mode="nearest")
        current.append(drawn - drawn.mean())
        voltage.append(volts - volts.mean())
    i, v = np.concatenate(current), np.concatenate(voltage)
    if not np.all(np.isfinite(v)) or not np.any(v) or np.ptp(i) < LEAST_CURRENT or i @ v >= 0.0:
        return 0.0, i, v
    return float((i @ v) ** 2 / ((i @ i) * (v @ v))), i, v


def find_imu_tilt(world: World, excerpts: Sequence[Excerpt]) -> Array:
    """Find the rotation vector from the IMU's described mounting to the true one [rad], (3,).

    Directions of gravity and rates that were measured are aligned with those of a twin, whose IMU
    has the same errors while it is accelerated. A turn that flights cannot tell from none is none.
    """
    pairs: list[tuple[Array, Array]] = []
    for one in excerpts:
        voltage, mode = float(one.parameters.voltage[0]), int(one.parameters.limit_by[0])
        twin = Twin(world, voltage=voltage, limit_by=LIMIT_MODES[mode])
        twin.place(one.start)
        with twin:
            for command, state in zip(one.commands, one.states, strict=True):
                twin.write(command)
                ours = twin.read()
                down = quaternion.gravity_in_body(np.array([ours.orientation, state.orientation]))
                pairs += [tuple(down), (TURN_SCALE * ours.gyro, TURN_SCALE * state.gyro)]
    ours, theirs = np.swapaxes(np.array(pairs), 0, 1)
    turned = Rotation.align_vectors(ours, theirs)[0].as_rotvec()
    return turned if np.linalg.norm(turned) > LEAST_TILT else np.zeros(3)
