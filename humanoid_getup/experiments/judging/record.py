"""Records of runs: samples from a twin, a vectorized simulation or sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.standing import Stance, StanceMeter, is_upright
from humanoid_getup.simulation.world import World
from robots.quaternion import Array
from robots.robot import Layout

Bools = NDArray[np.bool_]
Columns = Sequence[NDArray[Any]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """Runs of robots, sampled at the end of every control period.

    The leading axes (...) are those of the robots; there is none for a single run. Fields that
    could not be observed are None. In a vectorized simulation, sites and contacts are those of one
    physics step before the sample; in a twin, those of the sample.
    """

    layout: Layout
    """Where a robot's joints and root are in MuJoCo's arrays."""
    period: float
    """Time between two samples [s]."""
    voltage: Array
    """Supply of the servos [V], (...)."""
    upright: Bools
    """Whether the standing condition holds, (..., T); nowhere if the physics diverged."""
    stance: Stance
    """(..., T)"""
    qpos: Array
    """MuJoCo positions, (..., T, nq)."""
    joint_vel: Array
    """Joint speeds [rad/s], (..., T, n)."""
    neck: Array
    """Position of the neck [m], (..., T, 3)."""
    torque: Array
    """Servo torques [N·m], (..., T, n)."""
    actuator_vel: Array
    """Actuator speeds at which these torques were made [rad/s], (..., T, n)."""
    target: Array | None = None
    """Targets that the servos were sent [rad], (..., T, n)."""
    overlap: Array | None = None
    """Greatest depth of self-penetration [m], (..., T)."""
    ground_depth: Array | None = None
    """Depth in the world beyond that of a robot at rest [m], (..., T)."""
    head_touch: Bools | None = None
    """Whether the head touches the world, (..., T)."""
    head_speed: Array | None = None
    """[m/s], (..., T)"""
    torso_touch: Bools | None = None
    """Whether the torso touches the world, (..., T)."""
    torso_speed: Array | None = None
    """Speed of the torso's faster end [m/s], (..., T)."""
    diverged: Bools
    """Whether the physics diverged: a run says nothing from there on, (...)."""
    cycles: NDArray[np.int_]
    """Samples until the run was stopped, (...); later ones repeat the last."""
    settled: Bools
    """Whether it was stopped because the robot stands at rest, (...)."""
    failed: Bools
    """Whether it was stopped because the robot fell, or a servo was overloaded, (...)."""
    is_sensed: bool = False
    """Whether it is from sensors alone: torques estimated from currents, contacts unknown."""

    @property
    def duration(self) -> float:
        """Return the simulated time of all robots together [s]."""
        return float(self.cycles.sum()) * self.period

    @property
    def joint_pos(self) -> Array:
        """Return the joint angles [rad], (..., T, n)."""
        return self.qpos[..., self.layout.qpos]

    @property
    def orientation(self) -> Array:
        """Return the orientation of the torso, (..., T, 4)."""
        return self.qpos[..., self.layout.root_orientation]

    def take(self, rows: NDArray[np.int_] | slice | int) -> Record:
        """Return some of the runs, or one, by the first axis."""
        return self._change(lambda array: array[rows])

    def reshape(self, *shape: int) -> Record:
        """Arrange N runs in the order of rows, (N, ...) to (*shape, ...)."""
        return self._change(lambda array: array.reshape(*shape, *array.shape[1:]))

    def _change(self, change: Callable[[NDArray[Any]], NDArray[Any]]) -> Record:
        """Change every array."""
        return combine_arrays([self], lambda arrays: change(arrays[0]))


def combine_arrays(parts: Sequence[Any], combine: Callable[[Columns], NDArray[Any]]) -> Any:
    """Combine every array of some records with those of the others; the rest is the last one's."""
    combined = {}
    for name in [field.name for field in fields(parts[-1])]:
        values = [getattr(part, name) for part in parts]
        if isinstance(values[0], np.ndarray):
            combined[name] = combine(values)
        elif is_dataclass(values[0]) and not isinstance(values[0], Layout):
            combined[name] = combine_arrays(values, combine)
    return replace(parts[-1], **combined)


def join_records(parts: Sequence[Record]) -> Record:
    """Join records of the same N robots in time; robots with diverged physics are not upright."""
    diverged = np.any([part.diverged for part in parts], axis=0)
    count = sum(part.upright.shape[1] for part in parts)
    joined = combine_arrays(
        parts,
        lambda arrays: np.concatenate(arrays, axis=1) if arrays[0].ndim > 1 else arrays[-1],
    )
    return replace(
        joined,
        diverged=diverged,
        cycles=np.full(len(diverged), count),
        upright=joined.upright & ~diverged[:, np.newaxis],
        stance=replace(
            joined.stance,
            non_foot_contact=joined.stance.non_foot_contact | diverged[:, np.newaxis],
        ),
    )


RECORDED = (
    "qpos",
    "qvel",
    "site_xpos",
    "site_xmat",
    "sensordata",
    "actuator_force",
    "actuator_velocity",
)
"""MjData fields from which a record is read."""


class Recorder:
    """Reads records of robots in one world."""

    def __init__(self, world: World) -> None:
        """Prepare for a world; quantities without a sensor are not recorded."""
        self._world, model = world, world.model
        self._layout = world.robot.layout(model)
        self._meter = StanceMeter(world.robot, model, world.scene.support)
        self._neck = model.site(world.robot.neck_site).id
        self._servos = np.array([model.actuator(name).id for name in world.robot.joint_names])
        self._overlap, self._head_contact, self._head_velocity = (
            _find_sensor(model, name) for name in ("overlap", "head_contact", "head_velocity")
        )

    def read(
        self, data: Mapping[str, Array], voltage: Array, diverged: NDArray[np.bool_]
    ) -> Record:
        """Read N robots from the fields of `RECORDED` at T samples, (N, T, ...).

        The supply of each robot [V] is (N,), and whether its physics diverged.
        """
        world, contact, sites = self._world, data["sensordata"], data["site_xpos"]
        touch = world.find_non_foot_contact(contact)
        stance = self._meter.measure(data["qpos"], sites, data["site_xmat"], touch)
        count, samples = stance.tilt.shape
        return Record(
            layout=self._layout,
            period=world.robot.control_period,
            voltage=voltage,
            upright=is_upright(stance, world.robot) & ~diverged[:, np.newaxis],
            stance=stance,
            qpos=np.ascontiguousarray(data["qpos"]),
            joint_vel=_pick(data["qvel"], self._layout.dof),
            torque=_pick(data["actuator_force"], self._servos),
            actuator_vel=_pick(data["actuator_velocity"], self._servos),
            neck=np.ascontiguousarray(sites[..., self._neck, :]),
            overlap=None if self._overlap is None else -contact[..., self._overlap.start],
            head_touch=_find_touch(contact, self._head_contact),
            head_speed=_measure_speed(contact, self._head_velocity),
            diverged=diverged,
            cycles=np.full(count, samples),
            settled=np.zeros(count, dtype=bool),
            failed=np.zeros(count, dtype=bool),
        )


def _pick(values: Array, columns: NDArray[np.integer]) -> Array:
    """Copy columns (..., k) of values, in memory as they are in shape."""
    return np.ascontiguousarray(values[..., columns])


def _find_touch(contact: Array, sensor: slice | None) -> NDArray[np.bool_] | None:
    return None if sensor is None else contact[..., sensor].sum(axis=-1) > 0


def _measure_speed(contact: Array, sensor: slice | None) -> Array | None:
    return None if sensor is None else np.linalg.norm(contact[..., sensor], axis=-1)


def _find_sensor(model: mujoco.MjModel, name: str) -> slice | None:
    """Find the values of a sensor in MuJoCo's sensor data; None if there is no such sensor."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)
    if number < 0:
        return None
    first = int(model.sensor_adr[number])
    return slice(first, first + int(model.sensor_dim[number]))
