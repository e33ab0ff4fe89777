"""The walk through the steps: one question before each, one command at a time."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from drivers.service.calibrate import Prompt
from humanoid_getup.cli.robot.first_steps.finished_steps import FinishedSteps
from humanoid_getup.cli.robot.first_steps.step import FirstStep
from humanoid_getup.cli.shared.exit_codes import DID_IT, INTERRUPTED


class Walk:
    """Leads a person from step to step; each that is done is kept at once."""

    def __init__(
        self,
        list_steps: Callable[[], Sequence[FirstStep]],
        folder: Path,
        finished: FinishedSteps,
        *,
        prompt: Prompt,
        console: Console,
        is_virtual: bool,
        run: Callable[[Sequence[str]], int],
    ) -> None:
        """Prepare to walk.

        Args:
            list_steps: Lists the steps, with what is known by then.
            folder: Keeps what is done.
            finished: Steps that are done already.
            prompt: The person.
            console: Shows where the walk is.
            is_virtual: Whether the port is that of a virtual robot.
            run: Runs a command line without "getup"; returns its exit code.
        """
        self._list_steps, self._folder, self._finished = list_steps, folder, finished
        self._prompt, self._console, self._run = prompt, console, run
        self._is_virtual = is_virtual

    def go(self, first: str | None = None) -> int:
        """Walk until the last step is done, or the person leaves.

        Args:
            first: Name of the step to begin with; None for the first that is not done.

        Returns:
            0 after the last step, else the exit code of the step that is not done.
        """
        steps = self._list_steps()
        step = next((each for each in steps if each.name == first), None)
        step = step or self._finished.find_next(steps)
        while step is not None:
            code = self._take(step)
            if code is not None:
                return code
            step = _find_next(self._list_steps(), step.name, self._finished)
        self._console.print("[bold green]all steps are done[/]; --step NAME repeats one")
        return DID_IT

    def _take(self, step: FirstStep) -> int | None:
        """Take a step, as often as the person wants; None to go on, else the exit code."""
        self._introduce(step)
        code = DID_IT
        while True:
            words = self._ask_for_words(step)
            if words is None:
                return code if code else DID_IT
            if not words:
                self._keep(step, skipped=True)
                return None
            code = self._run(words)
            if code == DID_IT:
                self._keep(step, skipped=False)
                return None
            if code == INTERRUPTED:
                return code
            self._console.print(
                f"[bold red]{step.name} is not done[/]: it ended with exit code {code}, see above"
            )

    def _introduce(self, step: FirstStep) -> None:
        steps = [each.name for each in self._list_steps()]
        place = f"{steps.index(step.name) + 1} of {len(steps)}"
        self._console.print(f"\n[bold]step {place}, {step.name}[/]: {escape(step.aim)}")
        if step.before:
            self._console.print(f"  {escape(step.before)}")
        if self._is_virtual and step.at_bus:
            self._console.print(f"  virtual robot: type at getup bus: [bold]{escape(step.at_bus)}")
        self._console.print(f"  [dim]{escape(shlex.join(['getup', *step.words]))}")

    def _ask_for_words(self, step: FirstStep) -> tuple[str, ...] | None:
        """Ask whether to run a step; return its words, () to skip it, None to leave."""
        if step.asks:
            answer = self._prompt.ask(f"  {step.asks}").strip()
            if answer.lower() == "q":
                return None
            return (*step.words, answer) if answer else ()
        may_skip = step.is_optional or self._finished.has(step)
        skips = ", s skips it" if may_skip else ""
        while True:
            answer = self._prompt.ask(f"  Enter runs it{skips}, q leaves:").strip().lower()
            if answer in ("", "y", "yes"):
                return step.words
            if answer == "q":
                return None
            if answer == "s" and may_skip:
                return ()

    def _keep(self, step: FirstStep, *, skipped: bool) -> None:
        command = shlex.join(["getup", *step.words])
        self._finished = self._finished.add(step, command, skipped=skipped)
        self._finished.save(self._folder)


def _find_next(steps: Sequence[FirstStep], last: str, finished: FinishedSteps) -> FirstStep | None:
    """Return the step after one; after one that is gone, the first that is not done."""
    names = [step.name for step in steps]
    if last not in names:
        return finished.find_next(steps)
    after = steps[names.index(last) + 1 :]
    return after[0] if after else None
