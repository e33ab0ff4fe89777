"""The figures of a preflight: load and heat of a rollout at the present supply."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from drivers import Cycle, GuardLimits, SafetyGuard, Twin
from drivers.safety_limits import find_max_temperature
from drivers.twin.device_models import AMBIENT_TEMPERATURE, Windings
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.torque import find_longest, find_saturation
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.balance import Balance, make_balance
from humanoid_getup.playback.play import MotionPlayer, hold_time
from humanoid_getup.playback.simulated_play import has_succeeded, play_in_simulation
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, TorqueLimit
from robots.body.overlap import measure_pair_overlaps, overlaps_at
from robots.kinematics import place
from robots.quaternion import Array

MOST_RISES = 100  # in a row, after which temperatures are steady
OVERLAP_STRIDE = 3  # frames


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Figures of a preflight; arrays have shape (n,), in the robot's joint order."""

    voltage: float
    """[V]"""
    duration: float
    """Duration of the motion [s]."""
    succeeded: bool
    """Whether the rollout at this supply ends as the motion should: in a held stand, or lying."""
    stand_time: float
    """Start to stand in the rollout [s]; nan without one."""
    target_speed: Array
    """Fastest change of the targets [rad/s]."""
    peak_torque: Array
    """Greatest torque with which a servo drives its joint [N·m]."""
    rms_torque: Array
    """[N·m]"""
    torque_use: Array
    """Peak torque over the torque at standstill, within supply and limit."""
    saturation: Array
    """Total time on the torque-speed line of this supply [s]; not at a torque limit below it."""
    longest_saturation: Array
    """Longest time without a break on that line [s]."""
    end_temperature: Array
    """Temperature after one rise and its held stand [°C]."""
    rises_in_a_row: int | None
    """Rises without a pause until the first servo is too hot; None if that never happens."""
    start_overlap: float
    """Greatest depth of self-overlap at the start [m]."""
    overlap_growth: float
    """Greatest depth by which two links overlap more than at the start [m]."""


def measure(
    world: World,
    motion: Motion,
    voltage: float,
    torque_limit: TorqueLimit,
    temperature: Array,
    start: Posture | None,
    balanced: bool = True,
) -> Figures:
    """Roll a motion out and compute the figures of a verdict; arguments as of `preflight`."""
    robot = world.robot
    at_rest = find_rest(world, motion.posture(0)) if start is None else start
    balance = make_balance(world, motion) if balanced else None
    outcome, overlap = _roll_out(world, motion, at_rest, voltage, torque_limit, balance)
    data, frames = mujoco.MjData(world.model), range(0, len(motion.time), OVERLAP_STRIDE)
    at_start = _find_overlap(world, at_rest, data)
    own = [_find_overlap(world, motion.posture(k), data) for k in frames]
    deepest = np.max([overlap, *own], axis=0)
    stall = robot.find_stall(voltage)
    limit = np.minimum(stall, np.inf if torque_limit.value is None else torque_limit.value)
    torque = outcome.record.torque
    saturated = find_saturation(robot, torque, outcome.record.actuator_vel, voltage)
    peak_torque = outcome.torques.driving.max(axis=0, initial=0.0)
    period = robot.control_period
    end, rises = predict_heat(robot, torque, temperature)
    steps = np.diff(motion.joint_target, axis=0) / np.diff(motion.time)[:, None]
    return Figures(
        voltage=voltage,
        duration=motion.duration,
        succeeded=bool(has_succeeded(motion, outcome)),
        stand_time=float(outcome.stand_time),
        target_speed=np.abs(steps).max(axis=0, initial=0.0),
        peak_torque=peak_torque,
        rms_torque=np.sqrt(np.mean(torque**2, axis=0)),
        torque_use=peak_torque / limit,
        saturation=saturated.sum(axis=0) * period,
        longest_saturation=period * find_longest(saturated).astype(float),
        end_temperature=end,
        rises_in_a_row=rises,
        start_overlap=float(at_start.max()),
        overlap_growth=float(np.max(deepest - at_start, initial=0.0)),
    )


def _roll_out(
    world: World,
    motion: Motion,
    start: Posture,
    voltage: float,
    torque_limit: TorqueLimit,
    balance: Balance | None,
) -> tuple[Outcome, Array]:
    """Play the motion on a twin, without the guard's limit of temperature.

    That of the supply judges dips behind a resistance; a supply at rest is judged by `preflight`.
    """
    robot = world.robot
    twin = Twin(
        world,
        voltage=voltage,
        limit_by=torque_limit.by,
        without_imu=robot.imu_site is None,  # only balance needs one
    )
    twin.place(start)
    limits = GuardLimits.of(robot, torque_limit.value)
    judged = limits.min_voltage if robot.supply_resistance else 0.0
    limits = replace(limits, min_voltage=judged, max_temperature=math.inf)
    overlap = np.zeros((world.model.nbody, world.model.nbody))

    def measure_overlaps(_cycle: Cycle) -> None:
        np.maximum(overlap, measure_pair_overlaps(twin.truth.model, twin.truth.data), out=overlap)

    player = MotionPlayer(
        robot, motion, hold=hold_time(motion), torque_limit=torque_limit.value, balance=balance
    )
    _, outcome = play_in_simulation(
        player,
        SafetyGuard(twin, limits),
        twin.simulation,
        world.scene,
        torque_limit=torque_limit.value,
        on_cycle=measure_overlaps,
    )
    return outcome, overlap


def predict_heat(robot: Robot, torque: Array, temperature: Array) -> tuple[Array, int | None]:
    """Predict the temperature after one rise, and the number of rises until a servo is too hot.

    Heating is linear in the temperature, so one pass is enough: a rise keeps a share of the
    servo's excess over the ambient temperature and adds a fixed amount.
    """
    period = robot.control_period
    windings = Windings(robot)
    for row in torque:
        windings.heat(windings.compute_current(row), period)
    added = windings.temperature - AMBIENT_TEMPERATURE
    time_constant = windings.heat_capacity * windings.heat_resistance
    kept = (1.0 - period / time_constant) ** len(torque)
    above = temperature - AMBIENT_TEMPERATURE
    first = kept * above + added
    for rises in range(MOST_RISES):
        above = kept * above + added
        if np.any(above + AMBIENT_TEMPERATURE > find_max_temperature(robot)):
            return first + AMBIENT_TEMPERATURE, rises
    return first + AMBIENT_TEMPERATURE, None


def _find_overlap(world: World, posture: Posture, data: mujoco.MjData) -> Array:
    """Find the overlap of each pair of links in a posture [m], (nbody, nbody)."""
    return overlaps_at(world.model, place(world.robot, world.model, posture), data)
