"""A servo with a mass on a lever, simulated along many logs and for many parameters at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robots.quaternion import Array
from robots.servo import ServoModel
from sim2real.identification.servo_log import ServoLog

GRAVITY = 9.81  # m/s², MuJoCo's own
STEP = 0.0025  # s, at most
FASTEST = 100.0  # rad/s, beyond which a simulation has diverged
PARAMETERS = (
    "motor_constant",  # N·m/A
    "resistance",  # ohm
    "armature",  # kg·m²
    "offset",  # rad, of the encoder: what is added to its angles
    "friction",  # N·m
    "viscous_friction",  # N·m·s/rad
    "load_friction",
    "load_friction_slope",  # 1/(N·m)
    "stiction",
    "stiction_speed",  # rad/s
)


class Pendulums:
    """Simulates one servo along several logs.

    The physics is that of the twin: a motor with back-EMF behind a proportional position loop, and
    dry friction ``c0 + |t| (a + b |t| + c exp(-|v| / vs))`` by the motor's torque t.
    """

    def __init__(self, logs: Sequence[ServoLog], model: ServoModel) -> None:
        """Prepare for logs of one sample time; ``model`` gives the scale of the position gain."""
        self.period, longest = logs[0].period, max(len(log.goal) for log in logs)
        self.valid = np.array([np.arange(longest) < len(log.goal) for log in logs])
        """Whether a log has a sample, (L, T)."""
        self.measured = np.array([_fill(log.joint_pos, longest) for log in logs])
        """Measured angles [rad], (L, T)."""
        self._goal = np.array([_fill(log.goal, longest) for log in logs])
        self._on = np.array([_fill(log.torque_on, longest) for log in logs])
        self._speed = np.array([log.start_speed for log in logs])
        self._volts = np.array([log.voltage for log in logs])
        self._weight = np.array([log.mass * GRAVITY * log.arm for log in logs])
        self._inertia = np.array([log.inertia for log in logs])
        stiffness = np.array([model.position_gain(log.p_gain) for log in logs])
        self._duty_per_rad = stiffness / model.stall_torque

    def run(self, parameters: Array) -> Array:
        """Simulate rows of `PARAMETERS`, (P, 10); return the angles along the logs, (P, L, T)."""
        K, R, armature, offset, c0, viscous, *by_load = parameters.T[:, :, None]
        inertia = self._inertia + armature
        steps = max(1, round(self.period / STEP))
        h = self.period / steps
        q = self.measured[:, 0] + offset
        v = np.broadcast_to(self._speed, q.shape).copy()
        out = np.empty((self.measured.shape[1], *q.shape))
        for k in range(len(out)):
            out[k] = q
            goal, on = self._goal[:, k] + offset, self._on[:, k]
            for _ in range(steps):
                duty = np.minimum(np.maximum((goal - q) * self._duty_per_rad, -1.0), 1.0)
                motor = np.where(on, K * (duty * self._volts - K * v) / R, 0.0)
                weight = self._weight * np.sin(q)
                friction = self.compute_friction(motor, weight, v, (c0, *by_load))
                free = motor - weight - viscous * v
                stop = inertia / h * v + free  # what would bring it to rest
                moving = np.sign(stop) * np.maximum(np.abs(stop) - friction, 0.0)
                v = np.minimum(np.maximum(moving * h / inertia, -FASTEST), FASTEST)
                q = q + v * h
        return np.moveaxis(out, 0, -1) - offset[..., None]

    def compute_friction(
        self,
        motor: Array,
        weight: Array,  # noqa: ARG002  (other forms need it)
        v: Array,
        figures: Sequence[Array],
    ) -> Array:
        """Compute the dry friction by torques of motor and weight, and speed, (P, L)."""
        c0, a, b, c, vs = figures
        load = np.abs(motor)
        return c0 + load * (a + b * load + c * np.exp(-np.abs(v) / vs))


def _fill(values: np.ndarray, length: int) -> np.ndarray:
    """Repeat the last value up to a length."""
    return np.concatenate([values, np.repeat(values[-1:], length - len(values))])
