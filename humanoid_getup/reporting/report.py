"""The report of a rise: report.json, and a printed summary."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from humanoid_getup.execution.result import RiseResult

KEYS = (
    "robot",
    "seed",
    "start",
    "start_class",
    "scene",
    "backend",
    "torque_limit_nm",
    "limit_by",
    "planned",
    "stood",
    "reason",
    "stand_time_s",
    "hold_s",
    "plan_s",
    "filter_s",
    "peak_torque_nm",
    "peak_braking_torque_nm",
    "peak_velocity_rad_s",
    "torque_use",
    "attempts",
    "period_s",
    "overruns",
)
"""Keys of every report; None if the run did not get that far."""


def make_report(rise: RiseResult, settings: dict[str, Any]) -> dict[str, Any]:
    """Collect the figures of a rise and its settings, both under the keys of report.json."""
    report: dict[str, Any] = dict.fromkeys(KEYS)
    report |= {"robot": rise.robot.name} | rise.record() | settings
    report["period_s"] = report["period_s"] or rise.robot.control_period
    return report


def print_summary(report: dict[str, Any], files: list[str], console: Console) -> None:
    """Print the result of a rise in a few lines."""
    console.print(f"[bold {'green' if report['stood'] else 'red'}]{escape(_headline(report))}")
    table = Table.grid(padding=(0, 2))
    for label, text in (
        ("start", f"{report['start_class']}, seed {report['seed']}"),
        ("motion", _describe_motion(report)),
        ("load", _describe_load(report)),
        ("faults", _describe_faults(report)),
        ("then", _describe_after(report)),
        ("files", ", ".join(files)),
        ("no film", report.get("strip_reason")),
    ):
        if text:
            table.add_row(f"[dim]{label}", escape(text))
    console.print(table)


def _headline(report: dict[str, Any]) -> str:
    if report["stood"]:
        return f"stood after {report['stand_time_s']:.2f} s, held {report['hold_s']:.1f} s"
    return f"did not stand: {report['reason']}"


def _describe_motion(report: dict[str, Any]) -> str:
    if report.get("motion"):
        return f"{report['motion']} ({report['strategy']})"
    if report.get("policy"):
        return f"policy {report['policy']}"
    if not report["connection"]:
        return ""
    text = f"{report['connection']} ({report['strategy']})"
    if kept := report.get("plan_cache"):
        apart = math.degrees(kept["joint_rad"])
        took = report["plan_s"] + report["filter_s"]
        return f"{text}, plan kept from a start within {apart:.1f}°, checked in {took:.2f} s"
    text += f", planned in {report['plan_s']:.2f} s" if report.get("planning") else ", not planned"
    if not report.get("filtering"):
        return f"{text}, not filtered"
    return f"{text}, filtered in {report['filter_s']:.2f} s over {report['rollouts']} rollouts"


def _describe_load(report: dict[str, Any]) -> str:
    if report["peak_torque_nm"] is None:
        return ""
    about = "about " if report.get("judged_by") == "sensors" else ""
    return (
        f"peak {about}{report['peak_torque_nm']:.2f} N·m "
        f"({report['torque_use']:.0%} of the limit), "
        f"RMS {report['rms_torque_nm']:.2f} N·m, peak {report['peak_velocity_rad_s']:.1f} rad/s"
    )


def _describe_after(report: dict[str, Any]) -> str:
    after = report.get("after")
    if not after:
        return ""
    left = after["hand_over"]
    return f"{after['reason']}: {left['summary']}" if left else after["reason"]


def _describe_faults(report: dict[str, Any]) -> str:
    touches = ("self_collisions", "ground_penetrations", "limit_violations")
    counted = (*touches, "clips", "holds", "overruns")
    return ", ".join(f"{report[key]} {key.replace('_', ' ')}" for key in counted if report.get(key))
