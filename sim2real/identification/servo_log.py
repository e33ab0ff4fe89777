"""Logs of a servo with a mass on a lever: goals and measured angles."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from mcap.writer import MCAP0_MAGIC
from msgspec import Meta
from numpy.typing import NDArray

from drivers.flight_log.reader import FlightRecord
from robots.quaternion import Array
from robots.servo import PWM_FULL_SCALE, ServoModel
from robots.storage.files import read_bounded

PERIOD = 0.005  # s, to which logs are resampled
LONGEST_GAP = 0.1  # s between two samples
SHORTEST = 1.0  # s
LARGEST_ANGLE = 6.0 * math.pi  # rad; a log in degrees is far beyond
LEAST_REACH = 0.3  # rad
LEAST_SLOPE = 0.3  # of PWM by the error, below which no gain divisor explains it
LEAST_DUTY, LEAST_SAMPLES, MOST_SLOPE_ERROR = 0.05, 100, 0.1  # of a comparison of PWM and error
MOST_BYTES = 1 << 26


@dataclass(frozen=True, kw_only=True)
class ServoLog:
    """What one servo was told, and where it went; angle 0 is where the mass hangs down."""

    name: str
    checksum: str
    """SHA-256 of the file."""
    servo: str
    """Type of the servo, as the log names it."""
    period: float
    """Sample time [s]."""
    goal: Array
    """Goal positions [rad], (T,)."""
    joint_pos: Array
    """Measured angles [rad], (T,)."""
    torque_on: NDArray[np.bool_]
    """Whether torque was on, (T,)."""
    start_speed: float
    """[rad/s]"""
    p_gain: float
    """Position P gain, as its register has it."""
    voltage: float
    """Supply [V]."""
    mass: float
    """Mass on the lever [kg]."""
    arm: float
    """Distance of the mass from the horn [m]."""
    trajectory: str = ""
    """What was driven: logs of one trajectory have one name."""
    duty: Array | None = None
    """Measured share of the supply, (T,); None if not logged."""

    @property
    def inertia(self) -> float:
        """Return the inertia of mass and lever about the horn [kg·m²]."""
        return self.mass * self.arm**2


Positive = Annotated[float, Meta(gt=0.0, lt=1e6)]


class _Entry(msgspec.Struct, frozen=True):
    timestamp: float
    position: float
    goal_position: float
    torque_enable: bool
    speed: float = 0.0
    load: float | None = None


class _File(msgspec.Struct, frozen=True, kw_only=True):
    """A log as bam writes it (https://github.com/Rhoban/bam)."""

    mass: Positive
    length: Annotated[float, Meta(gt=0.0, lt=10.0)]
    kp: Positive
    vin: Annotated[float, Meta(gt=0.0, lt=100.0)]
    motor: str
    entries: list[_Entry]
    trajectory: str = ""
    is_held: bool = False
    """Whether each goal holds until the next; otherwise it moves on to that."""


class _About(msgspec.Struct, frozen=True):
    """What a flight log says of the servo and its load."""

    servo: str
    mass: Positive
    arm: Annotated[float, Meta(gt=0.0, lt=10.0)]
    hang: float
    p_gain: Positive
    trajectory: str


def load_servo_log(path: Path) -> ServoLog:
    """Load a flight log of `ServoRecorder`, or a log in bam's JSON, resampled.

    Raises:
        ValueError: if it is no such log, has gaps or other units, or torque was never on.
    """
    content = read_bounded(path, MOST_BYTES)
    if content.startswith(MCAP0_MAGIC):
        file = _read_flight(path)
    else:
        try:
            file = msgspec.json.decode(content, type=_File)
        except msgspec.DecodeError as error:
            raise ValueError(f"{path}: {_explain(str(error))}") from error
    if problem := _find_problem(file):
        raise ValueError(f"{path}: {problem}")
    entries = file.entries
    time = np.array([entry.timestamp for entry in entries])
    at = np.arange(time[0], time[-1], PERIOD)

    def resample(values: list[Any], *, holds: bool = False) -> Array:
        column = np.array(values, dtype=float)
        if holds:
            return column[np.searchsorted(time, at + 0.5 * PERIOD, side="right") - 1]
        return np.interp(at, time, column)

    duty = None
    if all(entry.load is not None for entry in entries):
        counts = np.array([entry.load for entry in entries], dtype=float)
        counts[counts > 1 << 15] -= 1 << 16  # negative ones are wrapped
        duty = resample((counts / PWM_FULL_SCALE).tolist())
    torque_on = resample([entry.torque_enable for entry in entries], holds=file.is_held) > 0.5
    if not torque_on.any():
        raise ValueError(f"{path}: torque was never on: friction and motor cannot be told apart")
    return ServoLog(
        name=path.name,
        checksum=hashlib.sha256(content).hexdigest(),
        servo=file.motor,
        period=PERIOD,
        goal=resample([entry.goal_position for entry in entries], holds=file.is_held),
        joint_pos=resample([entry.position for entry in entries]),
        torque_on=torque_on,
        start_speed=entries[0].speed,
        p_gain=file.kp,
        voltage=file.vin,
        mass=file.mass,
        arm=file.length,
        trajectory=file.trajectory,
        duty=duty,
    )


def _read_flight(path: Path) -> _File:
    """Read a flight log of a servo with a load; angles are from where the mass hangs."""
    record = FlightRecord.load(path)
    try:
        about = msgspec.convert(record.about, _About)
    except msgspec.ValidationError as error:
        expected = "expected one of a servo with a load, of getup identify servo --port"
        raise ValueError(f"flight log {path}: {error}, {expected}") from error
    if not record.cycles:
        raise ValueError(f"flight log {path}: it has no cycle")
    state, sent = record.state, record.sent
    is_on = sent["torque_limit"][:, 0] > 0.0
    goal, angle = sent["joint_pos"][:, 0] - about.hang, state["joint_pos"][:, 0] - about.hang
    rows = (record.time, angle, goal, is_on, state["joint_vel"][:, 0])
    return _File(
        mass=about.mass,
        length=about.arm,
        kp=about.p_gain * float(sent["gain_scale"][0, 0]),
        vin=float(np.mean(state["voltage"])),
        motor=about.servo,
        entries=[_Entry(*row) for row in zip(*(each.tolist() for each in rows), strict=True)],
        trajectory=about.trajectory,
        is_held=True,
    )


def _explain(problem: str) -> str:
    """Say what a log lacks, in the terms of a bench."""
    if "`length`" in problem:
        return f"{problem}: expected the arm of the mass, length [m]"
    return f"{problem}, expected a servo log: mass [kg], length [m], kp, vin [V], motor, entries"


def _find_problem(file: _File) -> str:
    """Find what makes a log unusable; empty if nothing does."""
    time = np.array([entry.timestamp for entry in file.entries])
    if len(time) < 2 or time[-1] - time[0] < SHORTEST:
        length = time[-1] - time[0] if len(time) else 0.0
        return f"{length:.2f} s long, expected {SHORTEST:g} s at least"
    gap = np.diff(time)
    if gap.min() <= 0.0:
        return f"timestamp {1 + int(gap.argmin())} is not after the one before it"
    if gap.max() > LONGEST_GAP:
        where = time[int(gap.argmax())] - time[0]
        return (
            f"no sample for {gap.max():.2f} s at {where:.2f} s, expected {LONGEST_GAP:g} s at most"
        )
    angles = np.array([(entry.position, entry.goal_position) for entry in file.entries])
    if not np.all(np.isfinite(angles)):
        return "an angle is not a finite number, expected rad"
    if np.abs(angles).max() > LARGEST_ANGLE:
        return f"an angle is {np.abs(angles).max():.0f}, expected rad: is it in degrees?"
    return ""


def find_warnings(logs: list[ServoLog], model: ServoModel) -> Iterator[str]:
    """Find what makes logs say little, or that contradicts them; each with what to record."""
    if len({(log.mass, log.arm, log.p_gain) for log in logs}) == 1:
        yield "all logs have one load and one P gain: record others, so that friction shows"
    reach = max(float(np.ptp(log.joint_pos[log.torque_on])) for log in logs)
    if reach < LEAST_REACH:
        yield f"the servo moved by {reach:.2f} rad, expected {LEAST_REACH:g} rad or more"
    for log in logs:
        if log.duty is None:
            continue
        duty_per_rad = model.position_gain(log.p_gain) / model.stall_torque
        expected = (log.goal - log.joint_pos) * duty_per_rad
        free = log.torque_on & (np.abs(expected) < 1.0) & (np.abs(expected) > LEAST_DUTY)
        if free.sum() < LEAST_SAMPLES:
            continue
        slope = float(expected[free] @ log.duty[free] / (expected[free] @ expected[free]))
        if abs(slope - 1.0) > MOST_SLOPE_ERROR:
            cause = "check the sign and the unit of angles and goals"
            if slope > LEAST_SLOPE:
                divisor = model.gain_divisor / slope
                cause = f"expected a gain divisor of {divisor:.0f}, not {model.gain_divisor:g}, "
                cause += "or the clocks of goal and angle differ"
            yield f"{log.name}: PWM is {slope:.2f} of what the P gain makes of the error: {cause}"


def is_of(servo: str, model: ServoModel) -> bool:
    """Return whether a servo's name in a log, such as mx64, can mean a type, such as MX-64(2.0)."""
    named, known = (re.sub(r"[^a-z0-9]", "", name.lower()) for name in (servo, model.name))
    return known.startswith(named)


def check_servo(logs: list[ServoLog], model: ServoModel) -> None:
    """Refuse logs of another servo than a type."""
    if others := [log for log in logs if not is_of(log.servo, model)]:
        listed = ", ".join(f"{log.name} of {log.servo}" for log in others)
        raise ValueError(f"expected logs of a {model.name}, not {listed}")
