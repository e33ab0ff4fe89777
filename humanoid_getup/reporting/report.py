"""The report of a rise: report.json, and a printed summary."""

from __future__ import annotations

from dataclasses import dataclass

from msgspec import UNSET, UnsetType
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from humanoid_getup.execution.after_stand import AfterFigures
from humanoid_getup.execution.rise import RiseFigures
from humanoid_getup.execution.session import Then
from robots.servo import LimitMode

TRADED = (
    ("RMS", "rms_torque_nm", "N·m"),
    ("peak", "peak_torque_nm", "N·m"),
    ("neck Δv", "neck_delta_v_m_s", "m/s"),
    ("stand after", "stand_time_s", "s"),
)
"""Figures affected by a preference: label, key and unit."""


@dataclass(frozen=True, kw_only=True)
class ReportHead:
    """Robot, scene and backend of a report, by report.json's keys."""

    robot: str
    body: str
    load: str | None
    """Masses [kg] that the robot holds: NAME:KG,..."""
    identified: str
    """What sets the robot apart from its description; empty if nothing is identified."""
    seed: int
    start: str | UnsetType = UNSET
    """Start of the robot; unset for a stand."""
    scene: str
    backend: str
    torque_limit_nm: float | None
    limit_by: LimitMode
    then: Then | None
    unreleased_joints: tuple[str, ...]
    """Joints that did not confirm that their torque is off."""


@dataclass(frozen=True, kw_only=True)
class RiseReport(RiseFigures, ReportHead):
    """The content of report.json after a rise; settings are unset where there are none."""

    method: str | UnsetType = UNSET
    planning: bool | UnsetType = UNSET
    filtering: bool | UnsetType = UNSET
    motion: str | UnsetType = UNSET
    """Name of the motion to play; unset if none was chosen."""
    strip_reason: str | UnsetType | None = UNSET
    """Reason why there is no film strip; unset if no files are written."""


@dataclass(frozen=True, kw_only=True)
class StandReport(AfterFigures, ReportHead):
    """The content of report.json after a stand."""

    strip_reason: str | UnsetType | None = UNSET


def print_summary(report: RiseReport, files: list[str], console: Console) -> None:
    """Print the result of a rise in a few lines."""
    color = "green" if report.stood else "yellow" if report.played else "red"
    console.print(f"[bold {color}]{escape(_headline(report))}")
    table = Table.grid(padding=(0, 2))
    for label, text in (
        ("start", f"{_describe_start(report)}, seed {report.seed}"),
        ("robot", report.identified and f"as identified: {report.identified}"),
        ("attempts", _describe_attempts(report)),
        ("motion", _describe_motion(report)),
        ("style", _describe_style(report)),
        ("moves", _describe_moves(report)),
        ("keys", _describe_keys(report)),
        ("prefers", _describe_preference(report)),
        ("load", _describe_load(report)),
        ("impact", _describe_impact(report)),
        ("faults", _describe_faults(report)),
        ("then", _describe_after(report)),
        ("files", ", ".join(files)),
        ("no film", report.strip_reason),
        ("warnings", "; ".join(report.warnings)),
    ):
        if text:
            table.add_row(f"[dim]{label}", escape(text))
    console.print(table)


def _headline(report: RiseReport) -> str:
    if report.stood:
        tries = len(report.attempt_reasons)
        attempt = f" of attempt {tries}" if tries > 1 else ""
        return f"stood after {report.stand_time_s:.2f} s{attempt}, held {report.hold_s:.1f} s"
    return report.reason if report.played else f"did not stand: {report.reason}"


def _describe_start(report: RiseReport) -> str:
    """Name the class of the start, and where it is from if that is another word."""
    side, start = report.start_class, report.start
    return f"{side} ({start})" if side and start and start != side else str(side or start)


def _describe_motion(report: RiseReport) -> str:
    if report.motion:
        return f"{report.motion} ({report.strategy})"
    if report.policy:
        return f"policy {report.policy}"
    if not report.connection:
        return ""
    text = f"{report.connection} ({report.strategy})"
    text += f", planned in {report.plan_s:.2f} s" if report.planning else ", not planned"
    if not report.filtering:
        return f"{text}, not filtered"
    text += f", filtered in {report.filter_s:.2f} s over {report.rollouts} rollouts"
    robust = report.robust
    return text if robust is None else f"{text}, stands in {robust:.0%} of the disturbed ones"


def _describe_attempts(report: RiseReport) -> str:
    """Describe how each attempt ended, if a later one stood."""
    reasons = report.attempt_reasons
    if len(reasons) < 2 or not report.stood:  # the headline names them all
        return ""
    return "; ".join(f"{number}. {reason}" for number, reason in enumerate(reasons, start=1))


def _describe_style(report: RiseReport) -> str:
    """Describe the style, and how well it was followed."""
    if not report.style:
        return ""
    summary = report.style_summary
    return f"{report.style}: {summary}" if summary else report.style


def _describe_moves(report: RiseReport) -> str:
    """Describe the moves before the rise."""
    if not report.moves:
        return ""
    text = f"{report.moves} to where there is room to rise, before it"
    text += f": {report.moves_s:.1f} s, peak {report.moves_peak_torque_nm:.2f} N·m"
    head = report.moves_head_impact_m_s
    return text if head is None else f"{text}, head {head:.2f} m/s"


def _describe_keys(report: RiseReport) -> str:
    """Describe how each key posture was passed, one line each."""
    return "\n".join(
        f"{key.name} at {key.time_s:.2f} s, within {key.largest_joint_error_rad:.3f} rad"
        if key.kept
        else f"{key.name} dropped: {key.reason}"
        for key in report.keys
    )


def _describe_preference(report: RiseReport) -> str:
    """Describe the gain of a preference, by the rollouts before and after the improvement."""
    if report.prefer in (None, "time") or report.rollout is None:
        return ""
    spent = f"{report.searched_s:.0f} s simulated"
    before, after = report.rollout_before_improvement, report.rollout
    if before is None:
        return f"{report.prefer}: nothing better than the first rise found, {spent}"
    changes = [
        f"{label} {getattr(before, key):.2f} → {getattr(after, key):.2f} {unit}"
        for label, key, unit in TRADED
    ]
    return f"{report.prefer}: {', '.join(changes)}; {spent}"


def _describe_impact(report: RiseReport) -> str:
    if report.head_impact_m_s is None:
        return ""
    return (
        f"head {report.head_impact_m_s:.2f} m/s, "
        f"neck Δv {report.neck_delta_v_m_s:.2f} m/s in a cycle"
    )


def _describe_load(report: RiseReport) -> str:
    if report.peak_torque_nm is None:
        return ""
    about = "" if report.judged_by == "truth" else "about "
    return (
        f"peak {about}{report.peak_torque_nm:.2f} N·m "
        f"({report.torque_use:.0%} of the limit), "
        f"braking {report.peak_braking_torque_nm:.2f} N·m, "
        f"RMS {report.rms_torque_nm:.2f} N·m, peak {report.peak_velocity_rad_s:.1f} rad/s"
    )


def _describe_after(report: RiseReport) -> str:
    after = report.after
    if not after:
        return ""
    left = after.hand_over
    return f"{after.reason}: {left.summary}" if left else after.reason


def _describe_faults(report: RiseReport) -> str:
    touches = ("self_collisions", "ground_penetrations", "limit_violations")
    counted = (*touches, "clips", "holds", "overruns")
    numbers = {key: getattr(report, key) for key in counted}
    return ", ".join(_count(number, key) for key, number in numbers.items() if number)


def _count(number: int, key: str) -> str:
    """Write a number of faults, such as "1 self-collision"."""
    name = key.replace("self_", "self-").replace("_", " ")
    return f"{number} {name.removesuffix('s') if number == 1 else name}"
