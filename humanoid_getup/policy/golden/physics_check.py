"""Boundary D: do the torques of the trace lead to its next state, by the physics of the twin?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from drivers.twin.simulation import build_flat_world
from humanoid_getup.policy.golden.comparison import Boundary, Comparison
from humanoid_getup.policy.golden.trace import GoldenTrace
from robots import Robot
from robots.kinematics import place_postures
from robots.quaternion import Array

SLACK = 0.25  # share of the change of speeds by which predictions may miss, in the median
QUIET = 0.05  # rad/s; changes below it may be noise
CLEARER = 0.5  # share of a miss to which a cause must reduce it


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenStates:
    """States of a robot and what drives it, T rows."""

    qpos: Array
    qvel: Array
    effort: Array
    """Torques in equal parts of each row [N·m], (T, parts, n)."""
    duration: Array
    """Durations of the rows [s], (T - 1,)."""


def check_physics(trace: GoldenTrace, robot: Robot) -> Comparison:
    """Predict each next state from state and torques on flat ground; compare joint speeds."""
    missing = [name for name in ("position", "velocity") if getattr(trace, name) is None]
    if trace.torque is None and trace.effort is None:
        missing.append("torque")
    if missing:
        cause = f"the trace has no {', '.join(missing)}"
        return Comparison(boundary=Boundary.PHYSICS, agrees=None, cause=cause)
    model = build_flat_world(robot)
    states = _read_states(trace, robot, model)
    miss = _measure_miss(states, robot, model)
    agrees = float(np.median(miss)) <= SLACK
    return Comparison(
        boundary=Boundary.PHYSICS,
        agrees=agrees,
        difference=float(np.median(miss)),
        unit="of the change of joint speeds",
        cause="" if agrees else _explain(states, robot, model, miss),
    )


def _read_states(trace: GoldenTrace, robot: Robot, model: mujoco.MjModel) -> DrivenStates:
    def true(name: str) -> Array:
        value = getattr(trace, f"true_{name}")
        return getattr(trace, name) if value is None else value

    layout = robot.layout(model)
    assert trace.position is not None and trace.velocity is not None
    qpos = place_postures(robot, model, trace.position, true("orientation"), true("joint_pos"))
    qvel = np.zeros((len(trace), model.nv))
    qvel[:, layout.root_dof : layout.root_dof + 3] = trace.velocity
    qvel[:, layout.root_dof + 3 : layout.root_dof + 6] = true("gyro")
    qvel[:, layout.dof] = true("joint_vel")
    effort = trace.effort
    if effort is None:
        assert trace.torque is not None
        effort = trace.torque[:, None]
    return DrivenStates(qpos=qpos, qvel=qvel, effort=effort, duration=np.diff(trace.time))


def _measure_miss(states: DrivenStates, robot: Robot, model: mujoco.MjModel) -> Array:
    """Return by how much each prediction misses, as a share of the change, (T - 1,)."""
    dof, change = robot.layout(model).dof, np.diff(states.qvel, axis=0)
    predicted = _predict(states, robot, model)
    error = np.linalg.norm((predicted - states.qvel[1:])[:, dof], axis=1)
    return error / (np.linalg.norm(change[:, dof], axis=1) + QUIET * np.sqrt(robot.n))


def _predict(states: DrivenStates, robot: Robot, model: mujoco.MjModel) -> Array:
    """Simulate each row from its own state; return the speeds at its end, (T - 1, nv)."""
    model, longest = _without_servos(model), model.opt.timestep
    data, dof = mujoco.MjData(model), robot.layout(model).dof
    ends = np.zeros((len(states.duration), model.nv))
    for row, duration in enumerate(states.duration):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = states.qpos[row], states.qvel[row]
        parts = states.effort[row]
        steps = max(1, round(duration / len(parts) / longest))
        model.opt.timestep = duration / len(parts) / steps
        for torque in parts:
            data.qfrc_applied[dof] = torque
            mujoco.mj_step(model, data, steps)
        ends[row] = data.qvel
    return ends


def _without_servos(model: mujoco.MjModel) -> mujoco.MjModel:
    from copy import copy

    model = copy(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    return model


def _explain(states: DrivenStates, robot: Robot, model: mujoco.MjModel, miss: Array) -> str:
    """Try what would make the states of the trace follow from its torques."""
    tries = {
        "joint speeds are one policy step late in the trace": _advance_speeds(states, robot, model),
        "torques are one policy step late in the trace": _advance_effort(states),
    }
    for text, changed in tries.items():
        own = _measure_miss(changed, robot, model)
        if np.median(own[:-1]) <= CLEARER * np.median(miss[:-1]):
            return text
    dof = robot.layout(model).dof
    error = np.abs(_predict(states, robot, model) - states.qvel[1:])[:, dof]
    i = int(np.median(error, axis=0).argmax())
    return (
        f"the speed of joint '{robot.joint_names[i]}' is off by {np.median(error[:, i]):.2g} rad/s "
        "after a step, in the median: other masses, friction, contacts or torques"
    )


def _advance_speeds(states: DrivenStates, robot: Robot, model: mujoco.MjModel) -> DrivenStates:
    dof, qvel = robot.layout(model).dof, states.qvel.copy()
    qvel[:-1, dof] = states.qvel[1:, dof]
    return replace(states, qvel=qvel)


def _advance_effort(states: DrivenStates) -> DrivenStates:
    return replace(states, effort=np.concatenate((states.effort[1:], states.effort[-1:])))
