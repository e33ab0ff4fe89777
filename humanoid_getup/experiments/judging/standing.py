"""Standing: its definition and its measurement, shared by all tests and benchmarks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.scenes.scene import Support, flat_support
from robots import Robot, quaternion
from robots.quaternion import Array

HOLD_TIME = 3.0  # s
HOLD = HOLD_TIME + 1.5  # s after the motion; a robot may sway before its stand begins
MAX_TILT = math.radians(15.0)
MIN_NECK_SHARE = 0.90
MAX_SOLE_RISE = 0.08  # of the standing neck height; of 731 disturbed stands the highest is 0.025
SOLE_REACH = 0.1  # of the same, from the middle of a sole to where its height is measured


@dataclass(frozen=True, kw_only=True, eq=False)
class Stance:
    """Quantities that determine whether a robot stands, per sample."""

    neck_height: Array
    """Height of the neck over what the feet stand on [m], (...)."""
    tilt: Array
    """Angle between the torso's z axis and the vertical [rad], (...)."""
    sole_rise: Array
    """Greatest height over the ground of a place on the soles, near their edges [m], (...)."""
    non_foot_contact: NDArray[np.bool_]
    """Whether anything but the feet touches the world, (...)."""


PLACES = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""On a sole, forward and to the left of its middle, where its height is measured."""


class StanceMeter:
    """Measures stances: on the twin, in vectorized simulations, and from sensors."""

    def __init__(
        self, robot: Robot, model: mujoco.MjModel, support: Support = flat_support
    ) -> None:
        self._robot, self._model, self._support = robot, model, support
        self._data = mujoco.MjData(model)
        self._layout = robot.layout(model)
        self._neck = model.site(robot.neck_site).id
        self._soles = [model.site(site).id for site in robot.sole_sites]
        self._reach = SOLE_REACH * robot.standing_neck_height * PLACES

    def measure(
        self, qpos: Array, site_pos: Array, site_mat: Array, non_foot_contact: NDArray[np.bool_]
    ) -> Stance:
        """Measure from the ground truth of a simulation.

        That is MuJoCo positions (..., nq), the positions of all sites in the world [m],
        (..., nsite, 3), and their axes, (..., nsite, 9), and whether anything but the feet touches
        the world, (...).
        """
        soles = site_pos[..., self._soles, :]
        underfoot = self._support(soles).mean(axis=-1)
        places = soles[..., np.newaxis, :] + self._spread(site_mat)
        over = places[..., 2] - self._support(places)
        return Stance(
            neck_height=site_pos[..., self._neck, 2] - underfoot,
            tilt=quaternion.tilt(qpos[..., self._layout.root_orientation]),
            sole_rise=over.max(axis=(-2, -1)),
            non_foot_contact=non_foot_contact,
        )

    def _spread(self, site_mat: Array) -> Array:
        """Return the ways from the middle of each sole to places on it [m], (..., S, 4, 3)."""
        count = len(self._soles)
        axes = site_mat[..., self._soles, :].reshape(*site_mat.shape[:-2], count, 3, 3)
        return self._reach @ np.swapaxes(axes[..., :2], -1, -2)

    def estimate(self, orientation: Array, joint_pos: Array) -> Stance:
        """Estimate from sensors, by forward kinematics with the lower sole on the ground.

        Measured are the orientation of the torso, (T, 4), and the joint angles [rad], (T, n).
        Sensors do not measure contacts, so none is assumed, nor the slope of the ground, so soles
        are flat that are parallel.
        """
        data, layout = self._data, self._layout
        height, rise = np.zeros((2, len(joint_pos)))
        for k in range(len(joint_pos)):
            data.qpos[layout.root_orientation] = orientation[k]
            data.qpos[layout.qpos] = joint_pos[k]
            mujoco.mj_kinematics(self._model, data)
            z = data.site_xpos[:, 2]
            height[k] = z[self._neck] - z[self._soles].min()
            up = data.site_xmat[self._soles, 2::3]
            rise[k] = np.ptp(self._spread(data.site_xmat) @ up.T, axis=1).max()
        return Stance(
            neck_height=height,
            tilt=quaternion.tilt(orientation),
            sole_rise=rise,
            non_foot_contact=np.zeros(len(joint_pos), dtype=bool),
        )


def is_upright(stance: Stance, robot: Robot) -> NDArray[np.bool_]:
    """Check per sample whether the standing condition holds, (...)."""
    tall = stance.neck_height >= MIN_NECK_SHARE * robot.standing_neck_height
    flat = stance.sole_rise <= MAX_SOLE_RISE * robot.standing_neck_height
    return tall & flat & (stance.tilt <= MAX_TILT) & ~stance.non_foot_contact


def compute_uprightness(stance: Stance, robot: Robot) -> Array:
    """Compute the uprightness of a robot, from 0 to 1, per sample, (...)."""
    height = np.clip(stance.neck_height / robot.standing_neck_height, 0.0, 1.0)
    vertical = np.clip(np.cos(stance.tilt), 0.0, 1.0)
    return height * vertical * np.where(stance.non_foot_contact, 0.8, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stand:
    """Whether and when robots stood, (...)."""

    stood: NDArray[np.bool_]
    """Whether the record ends with a stand held for 3.0 s."""
    start_time: Array
    """First moment of that held stand [s]; nan if it did not stand."""
    hold_time: Array
    """Duration of the last unbroken stand of the record [s]."""


def judge(
    upright: NDArray[np.bool_],
    period: float,
    hold_time: float = HOLD_TIME,
    *,
    cycles: NDArray[np.int_] | int | None = None,
    settled: NDArray[np.bool_] | bool = False,
    failed: NDArray[np.bool_] | bool = False,
) -> Stand:
    """Judge records (..., T) of :func:`is_upright`, sampled at the end of every ``period`` [s].

    Only a stand that lasts to the end of the record counts: a robot that stood and fell again did
    not rise. Only a search whose results are checked again may use a shorter ``hold_time`` [s].
    Records that were stopped early have ``cycles`` samples of their own, (...); they were stopped
    in a ``settled`` stand, or because the robot ``failed``, (...).
    """
    count = upright.shape[-1]
    reverse = np.logical_not(upright[..., ::-1])
    first = np.where(reverse.any(axis=-1), count - reverse.argmax(axis=-1), 0) if count else 0
    last = (count if cycles is None else cycles) - 1
    hold = np.maximum(last - first, 0) * period  # from the first sample to the last
    stood = ((hold >= hold_time - 1e-9) | settled) & np.logical_not(failed)
    return Stand(
        stood=stood[()],
        start_time=np.where(stood, (first + 1) * period, math.nan)[()],
        hold_time=hold + np.zeros(upright.shape[:-1])[()],
    )
