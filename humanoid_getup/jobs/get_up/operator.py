"""The operator of a robot, who may stop it while it moves, and releases it while it is held."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

from drivers import SafetyGuard
from humanoid_getup.execution.phase import PhaseChange


class Operator(Protocol):
    """Releases a robot that is held, and may stop one that moves, by its guard."""

    def is_released(self) -> bool:
        """Return whether a held robot may sit down; called every cycle of the hold."""
        ...

    def note(self, change: PhaseChange, /) -> None:
        """Note the beginning of a phase."""
        ...

    def watch(self, guard: SafetyGuard, /) -> AbstractContextManager[None]:
        """Watch while a robot moves; its guard can be stopped from any thread."""
        ...


class NoOperator:
    """Stands in where there is no operator: a robot that is held counts as released."""

    def is_released(self) -> bool:
        """Return True."""
        return True

    def note(self, _change: PhaseChange) -> None:
        """Ignore a phase."""

    def watch(self, _guard: SafetyGuard) -> AbstractContextManager[None]:
        """Watch nothing."""
        return nullcontext()
