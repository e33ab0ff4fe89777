"""Reads records from the fields of vectorized simulations."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import StanceMeter, is_upright
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

RECORDED = (
    "qpos",
    "qvel",
    "site_xpos",
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
        """Read N robots from MjData fields at T samples, (N, T, ...).

        Args:
            data: The fields of `RECORDED` by name.
            voltage: Supply of each robot [V], (N,).
            diverged: Whose physics diverged, (N,).
        """
        world, contact, sites = self._world, data["sensordata"], data["site_xpos"]
        stance = self._meter.measure(data["qpos"], sites, world.find_non_foot_contact(contact))
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
