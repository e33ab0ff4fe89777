"""The report of a rise: report.json, and a summary for people."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from rich.console import Console
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
    "planned",
    "stood",
    "reason",
    "stand_time_s",
    "hold_s",
    "plan_s",
    "filter_s",
    "peak_torque_nm",
    "peak_velocity_rad_s",
    "torque_use",
    "attempts",
    "period_s",
    "overruns",
)
"""Keys of every report, None where the run did not reach them."""


@dataclass(frozen=True, kw_only=True)
class RunContext:
    """What a rise was run with."""

    robot: str
    period: float
    """Control period [s]."""
    seed: int
    start: str
    """A posture class, a posture file, or the motion's own start."""
    scene: str
    backend: str
    torque_limit: float | None
    """Torque limit of every servo [N·m]."""
    extra: dict[str, Any] = field(default_factory=dict)
    """Further keys of the report."""


def make_report(rise: RiseResult, asked: RunContext) -> dict[str, Any]:
    """Gather the figures of a rise under the keys of report.json."""
    report: dict[str, Any] = dict.fromkeys(KEYS)
    report |= {
        "robot": asked.robot,
        "seed": asked.seed,
        "start": asked.start,
        "scene": asked.scene,
        "backend": asked.backend,
        "torque_limit_nm": asked.torque_limit,
    }
    report |= rise.record() | asked.extra
    report["period_s"] = report["period_s"] or asked.period
    return report


def print_summary(report: dict[str, Any], files: list[str], console: Console) -> None:
    """Print the result of a rise in a few lines."""
    console.print(f"[bold {'green' if report['stood'] else 'red'}]{_headline(report)}")
    table = Table.grid(padding=(0, 2))
    for label, text in (
        ("start", f"{report['start_class']}, seed {report['seed']}"),
        ("way", _describe_way(report)),
        ("load", _describe_load(report)),
        ("faults", _describe_faults(report)),
        ("files", ", ".join(files)),
        ("no film", report.get("strip_reason")),
    ):
        if text:
            table.add_row(f"[dim]{label}", text)
    console.print(table)


def _headline(report: dict[str, Any]) -> str:
    if report["stood"]:
        return f"stood after {report['stand_time_s']:.2f} s, held {report['hold_s']:.1f} s"
    return f"did not stand: {report['reason']}"


def _describe_way(report: dict[str, Any]) -> str:
    if report.get("motion"):
        return f"motion {report['motion']} ({report['strategy']})"
    if report.get("policy"):
        return f"policy {report['policy']}"
    if not report["connection"]:
        return ""
    way = f"{report['connection']} ({report['strategy']})"
    way += f", planned in {report['plan_s']:.2f} s" if report.get("planning") else ", not planned"
    if not report.get("filtering"):
        return f"{way}, not filtered"
    return f"{way}, filtered in {report['filter_s']:.2f} s over {report['rehearsals']} rehearsals"


def _describe_load(report: dict[str, Any]) -> str:
    if report["peak_torque_nm"] is None:
        return ""
    about = "about " if report.get("judged_by") == "sensors" else ""
    return (
        f"peak {about}{report['peak_torque_nm']:.2f} N·m "
        f"({report['torque_use']:.0%} of the limit), "
        f"RMS {report['rms_torque_nm']:.2f} N·m, peak {report['peak_velocity_rad_s']:.1f} rad/s"
    )


def _describe_faults(report: dict[str, Any]) -> str:
    touches = ("self_collisions", "ground_penetrations", "limit_violations")
    counted = (*touches, "clips", "holds", "overruns")
    return ", ".join(f"{report[key]} {key.replace('_', ' ')}" for key in counted if report.get(key))
