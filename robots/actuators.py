"""Actuators of a robot's model: a motor in position mode for each servo, on a joint or a tendon."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco

if TYPE_CHECKING:
    from robots.robot import Robot
    from robots.transmission import Coupling


def add_actuator(spec: mujoco.MjSpec, robot: Robot, i: int) -> None:
    """Add a joint's servo: its friction and rotor, and a motor in position mode.

    All figures are those behind its gear. The servo drives voltage from the position error without
    compensating its back-EMF. A ``dcmotor`` compensates it, so a derivative gain of K²/R takes the
    compensation out again.
    """
    joint = robot.joints[i]
    motor, constant = joint.servo.model, float(robot.motor_constant[i])
    gear = joint.servo.gear
    actuator = spec.add_actuator(name=joint.name, target=joint.name)
    coupling = next((c for c in robot.couplings if i in c.joints), None)
    if coupling is None:
        turned = spec.joint(joint.name)
        actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
    else:
        turned = _add_tendon(spec, robot, i, coupling)
        actuator.trntype = mujoco.mjtTrn.mjTRN_TENDON
    turned.armature = motor.armature * gear**2
    turned.frictionloss = motor.friction * gear
    actuator.set_to_dcmotor(
        motorconst=[constant, constant],
        resistance=motor.resistance,
        saturation=[float(robot.max_torque[i]), 0.0, 0.0],
        controller=[
            float(robot.position_gain[i]),
            0,
            float(robot.torque_speed_slope[i]),
            0,
            0,
            motor.nominal_voltage,
        ],
        ctrlspec=mujoco.mjtCtrlInput.mjINPUT_POS,
    )


def _add_tendon(spec: mujoco.MjSpec, robot: Robot, i: int, coupling: Coupling) -> mujoco.MjsTendon:
    """Add a fixed tendon whose length is the angle that a coupled servo turns."""
    tendon = spec.add_tendon(name=robot.joints[i].name)
    row = coupling.matrix[coupling.joints.index(i)]
    for k, turns in zip(coupling.joints, row, strict=True):
        tendon.wrap_joint(robot.joints[k].name, float(turns))
    return tendon
