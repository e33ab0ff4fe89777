"""Records a golden trace of a policy on the twin."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from drivers import Command, State
from drivers.twin.backend import Twin
from humanoid_getup.policy.golden.replayed import find_record
from humanoid_getup.policy.golden.trace import GoldenTrace
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import Robot, quaternion
from robots.quaternion import Array


@dataclass(kw_only=True)
class _Rows:
    """Values of the policy steps so far, by key."""

    values: dict[str, list[Array]] = field(default_factory=dict)

    def add(self, **values: Array) -> None:
        for key, value in values.items():
            self.values.setdefault(key, []).append(np.array(value))


def record_trace(policy: OnnxPolicy, twin: Twin, steps: int) -> GoldenTrace:
    """Run a policy on a twin for some policy steps; record their beginnings and their torques.

    The policy commands the twin directly, without a guard.
    """
    rows = _Rows()
    with twin:
        policy.reset(twin.read())
        for _ in range(steps):
            state = twin.read()
            rows.add(**_read_truth(twin), **_read_signals(policy, state))
            command = policy.step(state)
            rows.add(sent=command.joint_pos, **_read_decision(policy))
            rows.add(**_drive(policy, twin, command))
    arrays = {key: np.stack(values) for key, values in rows.values.items()}
    return GoldenTrace(robot=policy.robot.name, joints=policy.robot.joint_names, **arrays)


def _read_signals(policy: OnnxPolicy, state: State) -> dict[str, Array]:
    sensed = policy.sense(state)
    turned = quaternion.inverse(policy.imu_in_torso)
    return {
        "time": np.array(state.time),
        "orientation": quaternion.multiply(state.orientation, turned),
        "gyro": sensed.gyro,
        "joint_pos": sensed.joint_pos,
        "joint_vel": sensed.joint_vel,
    }


def _read_truth(twin: Twin) -> dict[str, Array]:
    layout, data = twin.robot.layout(twin.model), twin.data
    root = layout.root_dof
    return {
        "position": data.qpos[layout.root_position],
        "velocity": data.qvel[root : root + 3],
        "true_orientation": data.qpos[layout.root_orientation],
        "true_gyro": data.qvel[root + 3 : root + 6],
        "true_joint_pos": data.qpos[layout.qpos],
        "true_joint_vel": data.qvel[layout.dof],
    }


def _read_decision(policy: OnnxPolicy) -> dict[str, Array]:
    decision = policy.decision
    assert decision is not None
    record = find_record(policy)
    action, observation = decision.action, decision.observation.astype(float)
    if record is not None:  # the memory holds its own ones
        k = len(record.moved)
        action, observation = decision.memory[1 : 1 + k], decision.memory[1 + k :]
    return {"action": action, "observation": observation, "target": decision.target}


def _drive(policy: OnnxPolicy, twin: Twin, command: Command) -> dict[str, Array]:
    """Drive a twin for a policy step; return the torques at its beginning, and in each step."""
    to_actuator = policy.robot.transmission.to_actuator
    torques, speeds = [], [to_actuator(twin.truth.joint_vel)]

    def note() -> None:
        torques.append(twin.truth.joint_torque)
        speeds.append(to_actuator(twin.truth.joint_vel))

    twin.simulation.on_step.append(note)
    try:
        twin.write(command)
        for _ in range(policy.action.cycles - 1):
            twin.write(policy.step(twin.read()))
    finally:
        twin.simulation.on_step.remove(note)
    effort = _average(policy.robot, np.array(torques), np.array(speeds))
    to_joint = policy.robot.transmission.torque_at_joint
    return {"torque": to_joint(torques[0]), "effort": to_joint(effort)}


def _average(robot: Robot, torque: Array, speed: Array) -> Array:
    """Compute mean torques in steps of physics from those at their beginnings, (steps, n).

    A motor loses torque to back-EMF as it turns faster within a step, which the implicit
    integrator counts, unless the servo's largest torque limits it.
    """
    lost = robot.torque_speed_slope * np.diff(speed, axis=0)
    return torque - np.where(np.abs(torque) < robot.max_torque, lost, 0.0)
