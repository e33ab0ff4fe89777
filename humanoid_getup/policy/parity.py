"""Compares an imported policy with a trace of it from the program that trained it.

Each step begins where the trace was: with its signals, its last observation and action.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from scipy.optimize import linear_sum_assignment

from humanoid_getup.policy.foreign.description import FOREIGN_KEY, ForeignRecord, map_joints
from humanoid_getup.policy.observation import Sensed, observe
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import Robot, quaternion
from robots.quaternion import Array
from robots.storage.arrays import ArchiveError, load_arrays, to_numbers

Trace = dict[str, Array]
"""Arrays of a trace by their keys, T rows; the first one is the first step after a reset."""

FEWEST_ROWS = 8  # which still tell one fault from another
SLACK = 2e-3  # of the largest number of a term, at least of 1; networks compute with 7 digits
RATE_SLACK = 0.01  # share
STEP_SLACK = 0.5  # of a policy step, by which distances of rows may differ
NORM_SLACK = 0.01  # of an orientation's length
SAME_SCALE = 0.01  # share by which factors may differ
MOST_NAMED = 6  # joints of another order that are named


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """How a policy and a trace of it compare."""

    part: Literal["observation", "action"]
    agrees: bool | None
    """``None`` if it was not compared."""
    difference: float | None = None
    """Largest difference, in the numbers of the network."""
    cause: str = ""
    """What differs, with the likely cause, or why it was not compared."""

    def describe(self) -> str:
        """Write it in one line."""
        if self.agrees is None:
            return f"{self.part}: not compared: {self.cause}"
        verdict = f"differs: {self.cause}" if self.cause else "agrees"
        return f"{self.part} (largest difference {self.difference:.2g}): {verdict}"


def load_trace(file: Path, robot: Robot) -> Trace:
    """Read an .npz file; its joints are brought into the order of the robot's."""
    shapes = {"time": (), "orientation": (4,), "gyro": (3,), "joint_pos": (robot.n,)}
    shapes |= {"joint_vel": (robot.n,), "observation": (None,), "action": (None,)}
    arrays = load_arrays(file, ("joints", *shapes), optional=("robot",))
    names, rows = arrays["joints"], len(np.atleast_1d(arrays["time"]))
    if names.ndim != 1 or names.dtype.kind != "U":
        raise ArchiveError("joints is not a list of names")
    places = list(map_joints(names.tolist(), robot).values())
    if lacking := [name for i, name in enumerate(robot.joint_names) if i not in places]:
        raise ArchiveError(f"joints lacks {', '.join(lacking)}")
    if rows < FEWEST_ROWS:
        raise ArchiveError(f"it has {rows} rows, expected at least {FEWEST_ROWS}")
    trace = {key: to_numbers(arrays[key], key, (rows, *shape)) for key, shape in shapes.items()}
    if np.any(np.diff(trace["time"]) <= 0.0):
        raise ArchiveError("time does not increase")
    if np.abs(np.linalg.norm(trace["orientation"], axis=1) - 1.0).max() > NORM_SLACK:
        raise ArchiveError("orientation is not of length 1, expected quaternions w x y z")
    order = np.argsort(places)
    return trace | {key: trace[key][:, order] for key in ("joint_pos", "joint_vel")}


def compare_policy(policy: OnnxPolicy, trace: Trace) -> tuple[Comparison, Comparison]:
    """Compare the observations that a policy makes of a trace's signals, then its actions."""
    if FOREIGN_KEY not in policy.metadata:
        raise ArchiveError("the policy is not of `getup policy import`, expected one that is")
    record = msgspec.json.decode(policy.metadata[FOREIGN_KEY], type=ForeignRecord)
    _check_fit(policy, record, trace)
    observation, action = _replay(policy, trace, len(record.moved))
    names = {"last_action": record.moved} | dict.fromkeys(("joint_pos", "joint_vel"), record.joints)
    causes, end = [], 0
    for window in record.windows:
        whole = np.s_[:, end : end + window.size * window.history]
        end += window.size * window.history
        newest = np.s_[:, end - window.size : end]
        if _differ(trace["observation"][whole], observation[whole]):
            known = names.get(window.quantity, [f"entry {i}" for i in range(window.size)])
            cause = _explain(trace["observation"][newest], observation[newest], known)
            causes.append(f"'{window.name}': {cause}")
    difference = float(np.abs(trace["observation"] - observation).max())
    seen = Comparison(
        part="observation", agrees=not causes, difference=difference, cause="; ".join(causes)
    )
    if causes:
        return seen, Comparison(part="action", agrees=None, cause="the observation differs")
    difference = float(np.abs(trace["action"] - action).max())
    differs = _differ(trace["action"], action)
    cause = _explain(trace["action"], action, record.moved) if differs else ""
    return seen, Comparison(part="action", agrees=not differs, difference=difference, cause=cause)


def _check_fit(policy: OnnxPolicy, record: ForeignRecord, trace: Trace) -> None:
    steps, expected = np.diff(trace["time"]), policy.contract.rate_hz
    rate, size = 1.0 / float(np.median(steps)), sum(w.size * w.history for w in record.windows)
    problems = [
        f"{key} has {trace[key].shape[1]} columns, expected {wanted}"
        for key, wanted in (("observation", size), ("action", len(record.moved)))
        if trace[key].shape[1] != wanted
    ]
    if np.ptp(steps) * rate > STEP_SLACK:
        problems.append(
            f"its rows are {steps.min():.3g} to {steps.max():.3g} s apart, expected each policy "
            "step once"
        )
    if abs(rate / expected - 1.0) > RATE_SLACK:
        problems.append(f"its rows are {rate:.4g} Hz, expected {expected:.4g} Hz")
    if problems:
        raise ArchiveError("; ".join(problems))


def _replay(policy: OnnxPolicy, trace: Trace, k: int) -> tuple[Array, Array]:
    """Return what the network observes and what it returns, (T, size) and (T, k)."""
    gravity = quaternion.gravity_in_body(trace["orientation"])
    signals = {key: trace[key] for key in ("gyro", "joint_pos", "joint_vel")}
    ones = np.ones((len(gravity), 1))
    # The memory of a wrapped network: 1, its last action, its last observation; zeros at first.
    memory = np.concatenate((ones, trace["action"], trace["observation"]), axis=1)
    memory = np.concatenate((np.zeros_like(memory[:1]), memory[:-1]))
    sensed, share = Sensed(gravity=gravity, **signals), policy.torque_share * ones
    made = policy.act(observe(policy.robot, sensed, sensed.joint_pos, memory, share))[1]
    return made[:, 1 + k :], made[:, 1 : 1 + k]


def _differ(theirs: Array, mine: Array) -> bool:
    return bool(np.abs(theirs - mine).max() > _limit(mine))


def _limit(values: Array) -> float:
    return SLACK * max(1.0, float(np.abs(values).max()))


def _explain(theirs: Array, mine: Array, names: Sequence[str]) -> str:
    """Explain numbers of a trace by ours, (T, k) each: delay, order, sign, scale or zero."""
    if not _differ(theirs[1:], mine[:-1]):
        return "one policy step late in the trace"
    # Each column i of the trace as a line over each column j of ours, (j, i).
    a, b = mine - mine.mean(axis=0), theirs - theirs.mean(axis=0)
    factors = (a.T @ b) / np.maximum((a * a).sum(axis=0), 1e-12)[:, None]
    left = np.abs(b[:, None] - a[..., None] * factors).max(axis=0)
    if np.diag(left).max() > _limit(mine):
        order = linear_sum_assignment(left.T)[1]
        if left[order, np.arange(len(order))].max() <= _limit(mine):
            return _name_order(names, order.tolist())
        i, j = divmod(int(np.abs(mine - theirs).argmax()), mine.shape[1])
        return f"'{names[j]}' is {theirs[i, j]:.3f} at step {i} of the trace, here {mine[i, j]:.3f}"
    factor = np.where(np.ptp(mine, axis=0) > _limit(mine), np.diag(factors), 1.0)
    for i in np.flatnonzero(np.abs(factor - 1.0) > SAME_SCALE).tolist():
        hint = "the opposite sign" if abs(factor[i] + 1.0) < SAME_SCALE else "another scale"
        return f"'{names[i]}' is {factor[i]:.3g} times as large in the trace: {hint}"
    i = int(np.abs(zero := (theirs - mine).mean(axis=0)).argmax())
    return f"'{names[i]}' is off by {zero[i]:+.3f} in the trace: another zero, as of a posture"


def _name_order(names: Sequence[str], order: Sequence[int]) -> str:
    moved = [i for i, column in enumerate(order) if i != column]
    if len(moved) == 2:
        return f"'{names[moved[0]]}' and '{names[moved[1]]}' are swapped in the trace"
    listed = ", ".join(f"'{names[order[i]]}' for '{names[i]}'" for i in moved[:MOST_NAMED])
    return f"another order in the trace: {listed}{' ...' if len(moved) > MOST_NAMED else ''}"
