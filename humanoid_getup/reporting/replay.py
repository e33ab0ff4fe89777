"""Replays: send the commands of a flight log to a twin, and find where the twin diverges."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from drivers import State, Twin
from drivers.flight_log.reader import FlightRecord
from drivers.state import Integers
from drivers.twin.device_models import VOLTAGE_STEP
from humanoid_getup.experiments.judging.standing import MAX_TILT
from humanoid_getup.experiments.judging.torque import count_runs
from robots import Posture, Robot, quaternion
from robots.quaternion import Array
from robots.servo import LIMIT_MODES, LimitMode

THRESHOLD = 0.05  # rad, 3 degrees: above the effect of encoders, backlash and one late cycle
PHASES = ("lying", "rising", "standing", "lowering")
FLIGHT = "flight"
TWINS = DESCRIBED, IDENTIFIED = "as described", "as identified"
CYCLES_EACH = 100  # after which progress is reported
LONGEST_GAP = 5.0  # s without a cycle, for which the twin holds the last command


@dataclass(frozen=True, kw_only=True)
class Divergence:
    """Where a replay diverged from its log."""

    time: float
    """Since the first cycle [s]."""
    joint: str | None
    """None for the tilt of the torso."""
    difference: float
    """Measured minus replayed angle, or angle between the verticals [rad]."""

    @property
    def part(self) -> str:
        """Return the name of the part that differed."""
        return f"joint '{self.joint}'" if self.joint else "torso's tilt"


@dataclass(frozen=True, kw_only=True, eq=False)
class ReplayReport:
    """Differences between a flight log and its replay, as far as both were measured."""

    robot: str
    joint_names: tuple[str, ...]
    time: Array
    """Times since the first cycle [s], shape (T,)."""
    difference: Array
    """Measured minus replayed joint angles [rad], NaN where none was measured, (T, n)."""
    tilt_difference: Array
    """Angles between the measured and the replayed vertical in the torso [rad], (T,)."""
    threshold: float
    """Difference of a joint or of the tilt from which it counts as divergence [rad]."""
    curves: Mapping[str, Array]
    """Tilt, current and supply of the twin, each (T,); see `read_curves`."""
    phase: Integers
    """Place in `PHASES` of each cycle, (T,)."""

    @property
    def rms(self) -> Array:
        """Return each joint's root mean square difference [rad], shape (n,)."""
        return _rms(self.difference)

    @property
    def maximum(self) -> Array:
        """Return each joint's largest difference [rad], shape (n,)."""
        return np.nan_to_num(np.abs(self.difference)).max(axis=0)

    @property
    def ranking(self) -> Integers:
        """Return the places of all joints, that of the largest difference first, (n,)."""
        return np.argsort(-self.maximum, kind="stable")

    @property
    def gaps(self) -> dict[str, Array]:
        """Return the RMS of joints, then of the tilt, in each phase and in all [rad], (n + 1,)."""
        values = np.column_stack([self.difference, self.tilt_difference])
        rows = {name: self.phase == k for k, name in enumerate(PHASES)}
        gaps = {name: _rms(values[row]) for name, row in rows.items() if row.any()}
        return gaps | {FLIGHT: _rms(values)}

    @property
    def is_exact(self) -> bool:
        """Return whether the replay reproduced every angle and the tilt to the last bit."""
        return not np.any(self.difference) and not np.any(self.tilt_difference)

    @property
    def divergence(self) -> Divergence | None:
        """Return where a joint or the tilt first differed by more than the threshold."""
        values = np.column_stack([self.difference, self.tilt_difference])  # (T, n + 1)
        size = np.nan_to_num(np.abs(values))
        rows = np.flatnonzero(size.max(axis=1) > self.threshold)
        if not len(rows):
            return None
        row, column = int(rows[0]), int(size[rows[0]].argmax())
        return Divergence(
            time=float(self.time[row]),
            joint=(*self.joint_names, None)[column],
            difference=float(values[row, column]),
        )

    @property
    def headline(self) -> str:
        """Return the finding in one line."""
        if self.is_exact:
            return "the twin moved exactly as logged"
        if (first := self.divergence) is None:
            return f"no joint and no tilt differed by more than {self.threshold:g} rad"
        return f"{first.part} differed by {first.difference:+.3f} rad after {first.time:.2f} s"

    def describe(self) -> dict[str, Any]:
        """Describe the replay for JSON, with None where nothing diverged."""
        first, largest = self.divergence, self.maximum
        rows = zip(self.joint_names, self.rms.tolist(), largest.tolist(), strict=True)
        return {
            "robot": self.robot,
            "cycles": len(self.time),
            "duration_s": float(self.time[-1]),
            "exact": self.is_exact,
            "rms_rad": float(_rms(self.difference.ravel())),
            "max_rad": float(largest.max()),
            "max_joint": self.joint_names[int(self.ranking[0])],
            "tilt_rms_rad": float(_rms(self.tilt_difference)),
            "tilt_max_rad": float(np.nan_to_num(self.tilt_difference).max()),
            "threshold_rad": self.threshold,
            "divergence_s": first and first.time,
            "divergence_part": first and first.part,
            "joints": {name: {"rms_rad": rms, "max_rad": most} for name, rms, most in rows},
            "phases": {
                phase: {
                    "rms_rad": float(np.sqrt(np.mean(np.square(gap)))),
                    "tilt_rms_rad": float(tilt),
                    "joints": dict(zip(self.joint_names, map(float, gap), strict=True)),
                }
                for phase, (*gap, tilt) in self.gaps.items()
                if phase != FLIGHT
            },
        }


def replay(
    record: FlightRecord,
    twin: Twin,
    start: Posture,
    *,
    threshold: float = THRESHOLD,
    advance: Callable[[float], None] = lambda _: None,
) -> ReplayReport:
    """Send the commands of a log to a twin, and compare both measurements.

    A twin is deterministic: a log that was recorded on an equal twin, from its first cycle
    at rest in ``start``, is reproduced to the last bit. Where a log lacks cycles, the twin
    continues with the last command.

    Args:
        twin: A fresh twin of the robot, in its scene, with its supply.
        start: Posture of the robot at the first cycle, at rest.
        threshold: Difference of a joint or of the tilt that counts as divergence [rad].
        advance: Called with numbers of cycles that are done; what it raises ends the replay.
    """
    record.check_robot(twin.robot)
    periods = _count_periods(record, twin.period)
    if record.state["orientation"].shape != (record.cycles, 4):
        raise ValueError(f"flight log {record.path}: it has no orientation, expected an IMU's")
    twin.place(start)
    replayed: list[State] = []
    with twin:
        for cycle, count in enumerate(periods):
            if cycle and cycle % CYCLES_EACH == 0:
                advance(CYCLES_EACH)
            replayed.append(twin.read())
            command = record.command(cycle)
            for _ in range(count):
                twin.write(command)
    names = ("joint_pos", "orientation", "joint_current", "voltage")
    twins = {name: np.array([getattr(state, name) for state in replayed]) for name in names}
    return ReplayReport(
        robot=record.robot,
        joint_names=record.joint_names,
        time=record.time - record.time[0],
        difference=record.state["joint_pos"] - twins["joint_pos"],
        tilt_difference=_angle_between_verticals(record.state["orientation"], twins["orientation"]),
        threshold=threshold,
        curves=read_curves(twins),
        phase=_find_phases(record),
    )


def read_curves(states: Mapping[str, Array]) -> dict[str, Array]:
    """Read tilt, current of all servos and supply from fields of states, (T, ...)."""
    return {
        "tilt [°]": np.degrees(quaternion.tilt(states["orientation"])),
        "current of all servos [A]": np.nansum(np.abs(states["joint_current"]), axis=1),
        "supply [V]": states["voltage"],
    }


def write_gaps(twins: Mapping[str, ReplayReport]) -> Iterator[tuple[str, ...]]:
    """Write headings, and a row for each phase and for the flight [mrad]."""
    first, *others = twins.values()
    closed = [find_closed(first, other) for other in others]
    of_twins = (cell for name in twins for cell in (name, "most in", "tilt"))
    yield "RMS, mrad", *of_twins, *["gap closed" for _ in others]
    for span in first.gaps:
        cells = (cell for twin in twins.values() for cell in _write_gap(twin, span))
        yield span, *cells, *(f"{each[span]:.0%}" for each in closed)


def _write_gap(report: ReplayReport, span: str) -> tuple[str, str, str]:
    *joints, tilt = 1e3 * report.gaps[span]
    worst = int(np.argmax(joints))
    rms = np.sqrt(np.mean(np.square(joints)))
    return f"{rms:.1f}", f"{report.joint_names[worst]} {joints[worst]:.1f}", f"{tilt:.1f}"


def find_closed(described: ReplayReport, identified: ReplayReport) -> dict[str, float]:
    """Compute the share of each gap of joints that the second twin lacks; negative for more."""
    pairs = {k: (gap[:-1], identified.gaps[k][:-1]) for k, gap in described.gaps.items()}
    sizes = {k: np.linalg.norm(pair, axis=1) for k, pair in pairs.items()}
    return {k: float(1.0 - after / gap) if gap else 0.0 for k, (gap, after) in sizes.items()}


def _find_phases(record: FlightRecord) -> Integers:
    """Tell cycles before the first torque, up to the longest time upright, in it, and after it."""
    driven = np.any(record.sent["torque_limit"] > 0.0, axis=1)
    upright = driven & (quaternion.tilt(record.state["orientation"]) <= MAX_TILT)
    since = count_runs(upright[:, None])[:, 0]  # cycles for which it has been upright
    end, place = int(since.argmax()), np.arange(record.cycles)
    if not since[end]:
        return np.where(driven.cumsum() == 0, 0, 1)
    after = np.where(place <= end, 2, 3)
    return np.where(driven.cumsum() == 0, 0, np.where(place <= end - since[end], 1, after))


def choose_supply(record: FlightRecord, robot: Robot) -> float:
    """Return the voltage at which to replay a log [V]: the one measured at its start.

    Within the resolution of the measurement, the robot's nominal voltage is used.
    """
    voltage = record.state["voltage"] if record.cycles else np.zeros(0)
    measured = voltage[voltage > 0.0]  # not NaN either
    if not len(measured) or abs(measured[0] - robot.supply_voltage) <= 0.5 * VOLTAGE_STEP + 1e-9:
        return robot.supply_voltage
    return float(measured[0])


def find_limit_mode(record: FlightRecord) -> LimitMode | None:
    """Find what the flight's torque limit acted on; a log that does not say it flew as usual."""
    return next((mode for mode in LIMIT_MODES if mode == record.about.get("limit_by")), None)


def _count_periods(record: FlightRecord, period: float) -> np.ndarray:
    """Count the control periods for which each command was held."""
    owner = f"flight log {record.path}"
    if not record.cycles:
        raise ValueError(f"{owner}: it has no cycles to replay")
    gap = np.diff(record.time)
    if not np.isfinite(gap).all() or np.any(gap < 0.0) or np.any(gap > LONGEST_GAP):
        cycle = int(np.argmax(~(np.isfinite(gap) & (gap >= 0.0) & (gap <= LONGEST_GAP))))
        raise ValueError(
            f"{owner}: {gap[cycle]:.3f} s pass after cycle {cycle}, "
            f"expected 0 to {LONGEST_GAP:g} s for a replay"
        )
    return np.append(np.maximum(np.rint(gap / period), 1), 1).astype(int)


def _angle_between_verticals(p: Array, q: Array) -> Array:
    """Compute the angle between the verticals of two orientations (T, 4) [rad], free of yaw."""
    a, b = quaternion.gravity_in_body(p), quaternion.gravity_in_body(q)
    across = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.arctan2(across, np.sum(a * b, axis=-1))


def _rms(values: Array) -> Array:
    """Compute the root mean square of each column, without its NaN."""
    count = np.maximum(np.isfinite(values).sum(axis=0), 1)
    return np.sqrt(np.nansum(values**2, axis=0) / count)
