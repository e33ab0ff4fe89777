"""Findings of a robot check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["fault", "warning", "ok"]


@dataclass(frozen=True, kw_only=True)
class CheckFinding:
    """One result of a check, in a line."""

    level: Level
    """"fault": the robot cannot get up as described. "warning": it may fail. "ok": a figure."""
    subject: str
    """Subject, such as "stance" or "joint 'l_knee'"."""
    text: str
    remedy: str = ""
    """What to do; empty if there is nothing to be done."""

    @classmethod
    def ok(cls, subject: str, text: str, remedy: str = "") -> CheckFinding:
        """Make a finding without a problem."""
        return cls(level="ok", subject=subject, text=text, remedy=remedy)

    @classmethod
    def warning(cls, subject: str, text: str, remedy: str) -> CheckFinding:
        """Make a finding that may keep the robot from getting up."""
        return cls(level="warning", subject=subject, text=text, remedy=remedy)

    @classmethod
    def fault(cls, subject: str, text: str, remedy: str) -> CheckFinding:
        """Make a finding that keeps the robot from getting up."""
        return cls(level="fault", subject=subject, text=text, remedy=remedy)

    def __str__(self) -> str:
        """Write the finding in one line."""
        remedy = f" ({self.remedy})" if self.remedy else ""
        return f"{self.subject}: {self.text}{remedy}"
