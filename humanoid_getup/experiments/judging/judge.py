"""Judges: records of a run on a twin, by ground truth, or on a robot, by its sensors alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from drivers import Cycle, State
from drivers.errors import NoImuError
from drivers.twin.simulation import Simulation
from humanoid_getup.experiments.judging.outcome import JointFigures, Outcome
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import (
    HOLD_TIME,
    MAX_TILT,
    Stance,
    StanceMeter,
    is_upright,
    judge,
)
from humanoid_getup.experiments.judging.torque import estimate_torque
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene, Support
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.kinematics import lowest_point, place_postures, site_positions, torso_orientation
from robots.quaternion import Array
from robots.robot import Layout

DEEP_GROUND = 0.005  # m; more than the soft contact of a resting robot


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
        self._simulation, self._limit = simulation, torque_limit
        robot, model = simulation.robot, simulation.model
        self._deep_ground = DEEP_GROUND + scene.deepest_sink
        self._meter = StanceMeter(robot, model, support or scene.support)
        self._is_foot, self._head = _find_feet_and_head(robot, model)
        self._torso = model.body(robot.torso).id
        self._neck = model.site(robot.neck_site).id
        self._joint_state: list[tuple[Array, Array, Array]] = []
        """Speeds, torques, actuator speeds."""
        self._qpos: list[Array] = []
        self._sites: list[tuple[Array, Array]] = []
        """Positions and axes."""
        self._depth: list[tuple[float, float]] = []
        """Depth of self-penetration and in the ground."""
        self._touch: list[tuple[bool, bool, bool]] = []
        """Contact of anything but the feet, of the head, of the torso."""
        self._speed: list[tuple[float, float]] = []
        """Speed of the head and of the torso."""
        simulation.on_sensor_update.append(self._look)

    def __call__(self, _cycle: Cycle) -> None:
        """Ignore the cycle; samples come from the simulation."""

    def _look(self) -> None:
        if not self._simulation.has_torque:
            return
        truth = self._simulation.truth
        touching, head = truth.touching_bodies, self._head
        self._qpos.append(truth.qpos)
        self._sites.append((truth.site_pos, truth.site_mat))
        self._joint_state.append(
            (truth.joint_vel.copy(), truth.joint_torque.copy(), self._simulation.torque_vel)
        )
        self._depth.append((truth.self_penetration, truth.ground_penetration))
        self._touch.append(
            (
                not self._is_foot[touching].all(),
                bool(np.any(touching == head)),
                bool(np.any(touching == self._torso)),
            )
        )
        ends = truth.measure_speed(self._torso), truth.measure_site_speed(self._neck)
        self._speed.append((0.0 if head is None else truth.measure_speed(head), max(ends)))

    @property
    def is_upright(self) -> bool:
        """Return whether the standing condition holds in the last sample."""
        if not self._qpos or self._touch[-1][0] or not self._simulation.truth.is_erect(MAX_TILT):
            return False
        touch = np.array(False)
        stance = self._meter.measure(self._qpos[-1], *self._sites[-1], touch)
        return bool(is_upright(stance, self._simulation.robot))

    def end(self) -> bool:
        """Stop sampling; return at once whether the run ended in a held stand."""
        if self._look in self._simulation.on_sensor_update:
            self._simulation.on_sensor_update.remove(self._look)
        return bool(self._conclude().stood)

    def conclude(self) -> Outcome:
        """Judge the run; one that ended before its first cycle did not stand."""
        self.end()
        return self._conclude()

    def _conclude(self) -> Outcome:
        return Outcome(self._record(), self._simulation.robot, torque_limit=self._limit)

    def _record(self) -> Record:
        robot, model = self._simulation.robot, self._simulation.model
        n = len(self._speed)  # whole samples: the thread of a virtual bus may be adding one
        qpos = np.array(self._qpos[:n]).reshape(-1, model.nq)
        sites = np.array([pos for pos, _ in self._sites[:n]]).reshape(-1, model.nsite, 3)
        axes = np.array([mat for _, mat in self._sites[:n]]).reshape(-1, model.nsite, 9)
        joints = np.array(self._joint_state[:n]).reshape(-1, 3, robot.n)
        depth, speed = (np.array(rows[:n]).reshape(-1, 2) for rows in (self._depth, self._speed))
        touch = np.array(self._touch[:n], dtype=bool).reshape(-1, 3)
        stance = self._meter.measure(qpos, sites, axes, touch[:, 0])
        return Record(
            layout=robot.layout(model),
            period=self._simulation.period,
            voltage=np.array(self._simulation.voltage),
            upright=is_upright(stance, robot),
            stance=stance,
            qpos=qpos,
            joint_vel=joints[:, 0],
            neck=sites[:, self._neck],
            torque=joints[:, 1],
            actuator_vel=joints[:, 2],
            overlap=depth[:, 0],
            ground_depth=depth[:, 1] - self._deep_ground,
            head_touch=touch[:, 1],
            head_speed=speed[:, 0],
            torso_touch=touch[:, 2],
            torso_speed=speed[:, 1],
            diverged=np.array(False),
            cycles=np.array(len(qpos)),
            settled=np.array(False),
            failed=np.array(False),
        )


# On the twin with sensor noise, 71 disturbed rises ended their stand with the torso turning
# no faster than 0.09 rad/s and no joint faster than 0.4 rad/s. A robot that has just come
# up sways more than that and does stand, so these bounds exclude only robots that do not.
STILL_TURN = 1.0  # rad/s of the torso
STILL_JOINT = 2.0  # rad/s of the fastest joint


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
        self._world, self._period, self._limit = world, period, torque_limit
        self._meter = StanceMeter(world.robot, world.model)
        self._states: list[State] = []
        self._has_ended = False

    def __call__(self, cycle: Cycle) -> None:
        """Record the measurement of a cycle.

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
        return bool(judge(self._measure(newest)[1], self._period).stood)

    def conclude(self) -> Outcome:
        """Judge the run; one that ended before its second cycle did not stand."""
        robot, model = self._world.robot, self._world.model
        states = self._states[1:]  # the first was measured before the first command
        stance, upright = self._measure(states)
        record = record_joints(robot, states, self._period)
        qpos = _place_on_ground(robot, model, _orient(robot, model, states), record.joint_pos)
        record = replace(
            record,
            layout=robot.layout(model),
            upright=upright,
            stance=stance,
            qpos=qpos,
            neck=site_positions(model, qpos, robot.neck_site),
        )
        return Outcome(record, robot, torque_limit=self._limit)

    def _measure(self, states: Sequence[State]) -> tuple[Stance, NDArray[np.bool_]]:
        """Measure stances, and whether they are upright and still."""
        robot, model = self._world.robot, self._world.model
        angles = _column(states, "joint_pos", robot.n)
        stance = self._meter.estimate(_orient(robot, model, states), angles)
        turn = np.linalg.norm(_column(states, "gyro", 3), axis=1)
        speed = np.abs(_column(states, "joint_vel", robot.n))
        still = (turn <= STILL_TURN) & np.all(speed <= STILL_JOINT, axis=1)
        return stance, is_upright(stance, robot) & still


class JointJudge:
    """Judges a run without an orientation: figures of the joints, but no stand."""

    def __init__(self, robot: Robot, torque_limit: float | None) -> None:
        self._robot, self._limit = robot, torque_limit
        self._states: list[State] = []

    def __call__(self, cycle: Cycle) -> None:
        """Record a measurement."""
        self._states.append(cycle.state)

    def end(self) -> None:
        """Return that it is not known whether the run ended in a stand."""

    def conclude(self) -> JointFigures:
        """Return the figures of the run."""
        record = record_joints(self._robot, self._states, self._robot.control_period)
        outcome = Outcome(record, self._robot, torque_limit=self._limit)
        return outcome.figures(JointFigures)


def record_joints(robot: Robot, states: Sequence[State], period: float) -> Record:
    """Record what joints and servos measured by themselves, every period [s].

    The torso is unknown, so no sample counts as upright.
    """
    angles, velocity = (_column(states, name, robot.n) for name in ("joint_pos", "joint_vel"))
    none = np.zeros(len(states), dtype=bool)
    unknown = np.full(len(states), np.nan)
    joints = np.arange(robot.n)
    return Record(
        layout=Layout(qpos=joints, dof=joints, root_qpos=0, root_dof=0, torso=0),
        period=period,
        voltage=np.array(robot.supply_voltage),
        upright=none,
        stance=Stance(neck_height=unknown, tilt=unknown, sole_rise=unknown, non_foot_contact=none),
        qpos=angles,
        joint_vel=velocity,
        neck=np.full((len(states), 3), np.nan),
        torque=estimate_torque(robot, _column(states, "joint_current", robot.n)),
        actuator_vel=robot.transmission.to_actuator(velocity),
        diverged=np.array(False),
        cycles=np.array(len(states)),
        settled=np.array(False),
        failed=np.array(False),
        is_sensed=True,
    )


def _column(states: Sequence[State], name: str, size: int) -> Array:
    """Return a measurement of each state, (T, size)."""
    return np.array([getattr(state, name) for state in states]).reshape(-1, size)


def _orient(robot: Robot, model: mujoco.MjModel, states: Sequence[State]) -> Array:
    """Return the orientations of the torso, (T, 4)."""
    return torso_orientation(robot, model, _column(states, "orientation", 4))


def _place_on_ground(robot: Robot, model: mujoco.MjModel, torso: Array, joint_pos: Array) -> Array:
    """Convert measurements (T, ...) to MuJoCo positions on flat ground, (T, nq)."""
    orientation = quaternion.normalize(torso)
    qpos = place_postures(robot, model, np.zeros(3), orientation, joint_pos)
    qpos[:, robot.layout(model).root_qpos + 2] = [-lowest_point(model, row) for row in qpos]
    return qpos
