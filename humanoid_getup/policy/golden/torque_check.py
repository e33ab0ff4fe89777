"""Boundary C: do actions become the targets, and targets the torques, of the trace?

The law of a servo, ``torque = kp (target - angle) - kd speed``, is fitted to each joint of the
trace; its gains are compared with those that the policy has on this robot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.golden.comparison import Boundary, Comparison
from humanoid_getup.policy.golden.order_search import find_order, name_order
from humanoid_getup.policy.golden.replayed import ReplayedPolicy
from robots.quaternion import Array

ANGLE_SLACK = 5e-3  # rad; a tick of a servo is 1.5e-3
GAIN_SLACK = 0.1  # share of a gain
MISFIT = 0.15  # share of the torques that the law of a servo may leave
DAMPING_SLACK = 0.3  # share of a damping
SATURATED = 0.9  # share of the servos' torque from which on the law does not hold
FEWEST = 6  # rows in which a servo is not saturated
FEWEST_SPEEDS = 0.05  # rad/s by which speeds must vary, to tell a damping
FEWEST_MOVED = 0.02  # rad by which targets must lead the joint somewhere, to tell a gain


@dataclass(frozen=True)
class ServoLaw:
    """Gains of a joint, fitted to a trace."""

    joint: int
    position_gain: float
    """[N·m/rad]"""
    damping: float
    """[N·m·s/rad]"""
    misfit: float
    """Share of the torques that the law leaves."""


def check_torque(replayed: ReplayedPolicy) -> Comparison:
    """Compare targets, then torques of a trace with those that the policy has here."""
    boundary, trace = Boundary.TORQUE, replayed.trace
    if trace.target is None:
        return Comparison(boundary=boundary, agrees=None, cause="the trace has no target")
    share = replayed.step(replayed.signals).share
    slow, fast = replayed.aim(share), replayed.aim(share, unlimited=True)
    error = np.minimum(np.abs(trace.target - slow), np.abs(trace.target - fast))
    difference = float(error.max())
    if difference > ANGLE_SLACK:
        cause = _explain_target(replayed, fast)
        return _compare(difference, "rad", cause)
    if trace.torque is None:
        return Comparison(
            boundary=boundary,
            agrees=True,
            difference=difference,
            unit="rad",
            cause="the trace has no torque",
        )
    angle, speed = replayed.state()
    laws = _fit_laws(replayed, angle, speed)
    if laws and (text := _explain_misfit(replayed, laws)):
        return _compare(_measure_misfit(laws), "of the torques", text)
    if not laws:
        return Comparison(
            boundary=boundary, agrees=None, cause="its servos saturate or do not move"
        )
    off, cause = _compare_gains(replayed, laws)
    return _compare(off, "of a gain", cause)


def _compare(difference: float, unit: str, cause: str) -> Comparison:
    return Comparison(
        boundary=Boundary.TORQUE,
        agrees=not cause,
        difference=difference,
        unit=unit,
        cause=cause,
    )


def _explain_target(replayed: ReplayedPolicy, found: Array) -> str:
    """Find the factor, the zero or the order that makes the trace's targets of ours."""
    recorded, robot = replayed.trace.target, replayed.robot
    assert recorded is not None
    if np.abs(recorded[1:] - found[:-1]).max() <= ANGLE_SLACK:
        return "targets are one policy step late in the trace"
    free = _find_free(replayed, found)
    fits = [_fit_line(found[rows, i], recorded[rows, i]) for i, rows in enumerate(free.T)]
    moved = [i for i, fit in enumerate(fits) if fit is not None]
    made = np.repeat(found.T[:, :, None], robot.n, axis=2)
    if (order := find_order(recorded, made, ANGLE_SLACK)) is not None:
        return name_order(robot.joint_names, order)
    if text := _explain_order(replayed, recorded, free):
        return text
    factors = np.array([fit[0] for fit in fits if fit is not None])
    wrong = [i for i, factor in zip(moved, factors, strict=True) if abs(factor - 1.0) > 0.02]
    if wrong:
        return _name_scale(replayed, wrong[0], float(factors[moved.index(wrong[0])]), len(wrong))
    i = int(np.abs(recorded - found).max(axis=0).argmax())
    offset = float((recorded - found)[:, i].mean())
    name = robot.joint_names[i]
    return f"joint '{name}': targets are {offset:+.3f} rad off in the trace: another zero"


def _find_free(replayed: ReplayedPolicy, found: Array) -> NDArray[np.bool_]:
    """Find the targets that neither a joint's range nor a servo's speed limits, (T, n)."""
    robot, recorded, reach = replayed.robot, replayed.trace.target, replayed.policy.action.reach
    assert recorded is not None
    is_free = np.abs(np.abs(recorded - replayed.last_target()) - reach) > 0.01 * reach
    is_free[0] = False  # the target before it is not in the trace
    for target in (found, recorded):
        is_free &= (target > robot.lower + ANGLE_SLACK) & (target < robot.upper - ANGLE_SLACK)
    return is_free


def _explain_order(replayed: ReplayedPolicy, recorded: Array, free: NDArray[np.bool_]) -> str:
    """Find two joints whose actions are exchanged, each with its own scale and zero."""
    record = replayed.record
    if record is None:
        return ""
    names, robot = record.moved, replayed.robot
    actions, places = replayed.trace.action, [robot.joint_names.index(name) for name in names]
    columns = zip(recorded.T[places], free.T[places], strict=True)
    errors = np.array(
        [[_residual(a[rows], column[rows]) for a in actions.T] for column, rows in columns]
    )
    own = np.diag(errors)
    order = errors.argmin(axis=1)
    wrong = np.flatnonzero((own > ANGLE_SLACK) & (errors.min(axis=1) <= ANGLE_SLACK))
    if not len(wrong) or len(set(order[wrong])) < len(wrong):
        return ""
    whole = np.arange(len(names))
    whole[wrong] = order[wrong]
    return f"{name_order(names, whole.tolist())} in the actions"


def _residual(action: Array, target: Array) -> float:
    """Return the largest distance of targets from a line over actions."""
    if len(action) < FEWEST:
        return np.inf
    line = np.polyfit(action, target, 1) if np.ptp(action) > 1e-9 else np.array([target.mean()])
    return float(np.abs(np.polyval(line, action) - target).max())


def _fit_line(mine: Array, theirs: Array) -> tuple[float, float] | None:
    """Fit factor and offset; None where the targets hardly move."""
    if len(mine) < FEWEST or np.ptp(mine) < FEWEST_MOVED:
        return None
    factor, offset = np.polyfit(mine, theirs, 1)
    return float(factor), float(offset)


def _name_scale(replayed: ReplayedPolicy, joint: int, factor: float, count: int) -> str:
    name, record = replayed.robot.joint_names[joint], replayed.record
    more = f" and {count - 1} more" if count > 1 else ""
    if record is None or not record.scale or name not in record.moved:
        return f"joint '{name}'{more}: {factor:.3g} times the scale in the trace"
    own = record.scale[record.moved.index(name)]
    return (
        f"scale of actions: {own:.3g} rad in the policy, {factor * own:.3g} rad in the trace "
        f"(joint '{name}'{more})"
    )


def _fit_laws(replayed: ReplayedPolicy, angle: Array, speed: Array) -> list[ServoLaw]:
    """Fit the law of each joint that has a servo of its own and moves; NaN is left out."""
    torque, robot = replayed.trace.torque, replayed.robot
    assert torque is not None
    lead = replayed.start() - angle
    laws = []
    for i in np.flatnonzero(~robot.transmission.is_coupled).tolist():
        driven = torque[:, i] + robot.torque_speed_slope[i] * speed[:, i]  # by the voltage
        limit = SATURATED * robot.max_torque[i] * replayed.policy.action.pwm_limit
        rows = np.maximum(np.abs(torque[:, i]), np.abs(driven)) < limit
        if rows.sum() >= FEWEST:
            laws += _fit_law(i, lead[rows, i], speed[rows, i], torque[rows, i])
    return laws


def _fit_law(joint: int, lead: Array, speed: Array, torque: Array) -> list[ServoLaw]:
    """Fit the law of a joint; none if it moves too little to tell."""
    if np.ptp(lead) < FEWEST_MOVED or np.ptp(speed) < FEWEST_SPEEDS:
        return []
    inputs = np.stack((lead, -speed), axis=1)
    gains = np.linalg.lstsq(inputs, torque, rcond=None)[0]
    left = np.linalg.norm(inputs @ gains - torque) / max(np.linalg.norm(torque), 1e-9)
    return [ServoLaw(joint, float(gains[0]), float(gains[1]), float(left))]


def _measure_misfit(laws: list[ServoLaw]) -> float:
    return float(np.median([law.misfit for law in laws]))


def _explain_misfit(replayed: ReplayedPolicy, laws: list[ServoLaw]) -> str:
    """Name what is late where no gains explain the torques; '' where they do."""
    misfit = _measure_misfit(laws)
    if misfit <= MISFIT:
        return ""
    angle, speed = replayed.state()
    tries = {"joint speeds": (angle, _advance(speed)), "joint angles": (_advance(angle), speed)}
    for text, changed in tries.items():
        other = _fit_laws(replayed, *changed)
        if other and _measure_misfit(other) < 0.5 * misfit:
            return f"{text} are one policy step late in the trace"
    return "torques do not follow from targets, angles and speeds by any gains"


def _advance(values: Array) -> Array:
    """Return the values of the step after; NaN for the last one, which has none."""
    return np.concatenate((values[1:], np.full_like(values[:1], np.nan)))


def _compare_gains(replayed: ReplayedPolicy, laws: list[ServoLaw]) -> tuple[float, str]:
    """Return the largest difference as a share, and what differs."""
    robot, shares = replayed.robot, replayed.policy.action.gain_share
    own = robot.position_gain * (np.array(shares) if shares else 1.0)
    stiffness = robot.supply_voltage / robot.nominal_voltage
    ratios = np.array([law.position_gain / (own[law.joint] * stiffness[law.joint]) for law in laws])
    worst = int(np.abs(np.log(np.maximum(ratios, 1e-9))).argmax())
    off = float(abs(ratios[worst] - 1.0))
    if off <= GAIN_SLACK:
        return off, _compare_damping(replayed, laws)
    law = laws[worst]
    mine = own[law.joint] * stiffness[law.joint]
    count = int((np.abs(ratios - 1.0) > GAIN_SLACK).sum())
    more = f" and {count - 1} more" if count > 1 else ""
    return off, (
        f"position gain kp: {mine:.3g} N·m/rad here, {law.position_gain:.3g} N·m/rad in the trace "
        f"(joint '{robot.joint_names[law.joint]}'{more})"
    )


def _compare_damping(replayed: ReplayedPolicy, laws: list[ServoLaw]) -> str:
    """Name a damping that is neither the servos' nor that of the policy's training."""
    robot, record = replayed.robot, replayed.record
    known = dict(zip(record.joints, record.damping, strict=False)) if record else {}
    for law in laws:
        name, own = robot.joint_names[law.joint], float(robot.torque_speed_slope[law.joint])
        expected = [own, known.get(name, own)]
        if min(abs(law.damping - each) / max(each, 1e-3) for each in expected) > DAMPING_SLACK:
            return (
                f"damping kd: {own:.3g} N·m·s/rad here, {law.damping:.3g} N·m·s/rad in the trace "
                f"(joint '{name}')"
            )
    return ""
