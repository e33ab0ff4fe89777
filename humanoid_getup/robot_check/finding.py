"""Findings of a robot check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["fault", "warning", "ok"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One result of a check, in a line."""

    level: Level
    """"fault": it will not get up so. "warning": it may not. "ok": a figure to know."""
    subject: str
    """What it is about, such as "stance" or "joint 'l_knee'"."""
    text: str
    remedy: str = ""
    """What to do; empty if there is nothing to be done."""

    def __str__(self) -> str:
        """Write the finding in one line."""
        remedy = f" ({self.remedy})" if self.remedy else ""
        return f"{self.subject}: {self.text}{remedy}"
