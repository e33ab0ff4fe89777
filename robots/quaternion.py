"""Unit quaternions, w x y z, in arrays of shape (..., 4)."""

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def multiply(p: Array, q: Array) -> Array:
    """Multiply quaternions: rotate by ``q`` first, then by ``p``."""
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def inverse(q: Array) -> Array:
    """Invert unit quaternions."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: Array, v: Array) -> Array:
    """Rotate vectors (..., 3) by quaternions (..., 4)."""
    w, u = q[..., :1], q[..., 1:]
    t = 2.0 * np.cross(u, v)
    return v + w * t + np.cross(u, t)


def angle_between(p: Array, q: Array) -> Array:
    """Compute the angle [rad] of the rotation from ``p`` to ``q``, in [0, pi]."""
    d = multiply(inverse(p), q)
    return 2.0 * np.arctan2(np.linalg.norm(d[..., 1:], axis=-1), np.abs(d[..., 0]))


def slerp(p: Array, q: Array, t: Array | float) -> Array:
    """Interpolate from ``p`` to ``q`` along the shorter arc by the share ``t``."""
    dot = np.sum(p * q, axis=-1, keepdims=True)
    q = np.where(dot < 0.0, -q, q)
    half = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    t = np.asarray(t, dtype=float)[..., None]
    sine = np.sin(half)
    near = sine < 1e-9
    safe = np.where(near, 1.0, sine)
    a = np.where(near, 1.0 - t, np.sin((1.0 - t) * half) / safe)
    b = np.where(near, t, np.sin(t * half) / safe)
    return normalize(a * p + b * q)


def normalize(q: Array) -> Array:
    """Scale quaternions to unit length."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def from_yaw(yaw: Array | float) -> Array:
    """Make the rotation about the vertical by ``yaw`` [rad]."""
    half = 0.5 * np.asarray(yaw, dtype=float)
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)


def from_axis_angle(axis: Array, angle: Array | float) -> Array:
    """Make the rotation about a unit ``axis`` (..., 3) by ``angle`` [rad]."""
    half = 0.5 * np.asarray(angle, dtype=float)[..., None]
    return np.concatenate([np.cos(half), np.sin(half) * axis], axis=-1)


def from_matrix(axes: Array) -> Array:
    """Convert axes in columns, (3, 3), to the quaternion that turns to them, (4,)."""
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, axes.ravel())
    return q


def to_matrix(q: Array) -> Array:
    """Convert a quaternion (4,) to the axes to which it turns, in columns, (3, 3)."""
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, q)
    return axes.reshape(3, 3)


def mirror(q: Array) -> Array:
    """Reflect rotations in the robot's x-z plane (left becomes right)."""
    return q * np.array([1.0, -1.0, 1.0, -1.0])


def gravity_in_body(q: Array) -> Array:
    """Compute the direction of gravity in the body frame, shape (..., 3)."""
    return rotate(inverse(q), np.array([0.0, 0.0, -1.0]))


def tilt(q: Array) -> Array:
    """Compute the angle [rad] between the body's z axis and the vertical."""
    return np.arccos(np.clip(-gravity_in_body(q)[..., 2], -1.0, 1.0))
