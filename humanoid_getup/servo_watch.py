"""The servo watch: are the servos overloaded, or too hot?"""

from __future__ import annotations

import numpy as np

from drivers import State
from humanoid_getup.supervision import AbortKind, Lasting, Supervision
from robots import Robot


class ServoWatch:
    """Watches, each cycle, what the servos tell of their load, heat and supply.

    ``warnings`` tells what was odd but no reason to stop.
    """

    def __init__(self, robot: Robot, limits: Supervision) -> None:
        self._robot, self._limits = robot, limits
        models = [joint.servo.model for joint in robot.joints]
        self._stall_per_volt = np.array([m.stall_current / m.nominal_voltage for m in models])
        self._min_voltage = max(m.min_voltage for m in models)
        self.warnings: list[str] = []

    def reset(self, state: State) -> None:
        """Begin anew from a measurement."""
        self.warnings = []
        self._loaded = Lasting(self._robot.n, state.time)

    def judge(self, state: State) -> tuple[AbortKind, str] | None:
        """Tell why to give up, if there is a reason."""
        self._warn(state)
        return self._judge_load(state) or self._judge_heat(state)

    def _judge_load(self, state: State) -> tuple[AbortKind, str] | None:
        limits = self._limits
        stall = self._stall_per_volt * max(state.voltage, 1.0)
        load = np.abs(state.joint_current) / stall
        lasting = self._loaded.update(load > limits.load, state.time)
        if lasting.max() > limits.load_time:
            worst = int(lasting.argmax())
            return AbortKind.LOAD, (
                f"joint '{self._robot.joint_names[worst]}' draws {load[worst]:.0%} of its stall "
                f"current, allowed {limits.load:.0%} for {limits.load_time:g} s"
            )
        return None

    def _judge_heat(self, state: State) -> tuple[AbortKind, str] | None:
        worst = int(state.temperature.argmax())
        if state.temperature[worst] > self._limits.temperature:
            return AbortKind.HEAT, (
                f"joint '{self._robot.joint_names[worst]}' has {state.temperature[worst]:.0f} °C, "
                f"allowed {self._limits.temperature:.0f} °C"
            )
        return None

    def _warn(self, state: State) -> None:
        if state.voltage < self._min_voltage and not self.warnings:
            self.warnings.append(
                f"the supply sagged to {state.voltage:.1f} V, the servos need "
                f"{self._min_voltage:.1f} V: charge the battery"
            )
