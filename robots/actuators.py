"""Actuators of a robot's model: a motor in position mode for each servo, on a joint or a tendon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco

from robots.servo import Servo


@dataclass(frozen=True, kw_only=True)
class PositionActuator:
    """A servo in position mode; its figures hold behind its gear."""

    name: str
    """Of its joint."""
    servo: Servo
    motor_constant: float
    """[N·m/A] or [V·s/rad]"""
    stall_torque: float
    """At nominal voltage [N·m]."""
    position_gain: float
    """[N·m/rad]"""
    torque_speed_slope: float
    """Torque lost to back-EMF per speed [N·m·s/rad]."""
    turns: Mapping[str, float]
    """Turns of the actuator per turn of each joint, by name, where joints are coupled; or none."""

    def add(self, spec: mujoco.MjSpec) -> None:
        """Add it to a model: friction and rotor of the servo, and a motor in position mode.

        The servo drives voltage from the position error without compensating its back-EMF. A
        ``dcmotor`` compensates it, so a derivative gain of K²/R takes the compensation out again.
        """
        motor, gear = self.servo.model, self.servo.gear
        actuator = spec.add_actuator(name=self.name, target=self.name)
        if self.turns:
            turned = self._add_tendon(spec)
            actuator.trntype = mujoco.mjtTrn.mjTRN_TENDON
        else:
            turned = spec.joint(self.name)
            actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
        turned.armature = motor.armature * gear**2
        turned.frictionloss = motor.friction * gear
        actuator.set_to_dcmotor(
            motorconst=[self.motor_constant, self.motor_constant],
            resistance=motor.resistance,
            saturation=[self.stall_torque, 0.0, 0.0],
            controller=[
                self.position_gain,
                0,
                self.torque_speed_slope,
                0,
                0,
                motor.nominal_voltage,
            ],
            ctrlspec=mujoco.mjtCtrlInput.mjINPUT_POS,
        )

    def _add_tendon(self, spec: mujoco.MjSpec) -> mujoco.MjsTendon:
        """Add a fixed tendon whose length is the angle that a coupled servo turns."""
        tendon = spec.add_tendon(name=self.name)
        for joint, turns in self.turns.items():
            tendon.wrap_joint(joint, turns)
        return tendon
