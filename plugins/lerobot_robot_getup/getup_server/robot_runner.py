"""The robot in its own process: it obeys, falls, rises and obeys again."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from drivers import Command, DriverError, Ending, FaultKind, State, engaged, run_engaged
from getup_server.mailbox import Mailbox
from getup_server.messages import Setup
from getup_server.shared_guard import SharedGuard, TorsoSense
from getup_server.target_pilot import FallWatch, TargetPilot
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.phase import Phase, PhaseChange
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.jobs.backends import BackendChoice
from humanoid_getup.progress.callback import CancelledError
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
from robots import Posture

WAITING = "torque off until the first action"


class RobotStoppedError(Exception):
    """The robot does not move any more; the message says why."""


class RobotRunner:
    """Runs a robot behind its guard until it is asked to end, cannot rise, or has a fault.

    Torque comes on with the first action, and is off in the end.
    """

    def __init__(
        self,
        choice: BackendChoice,
        guard: SharedGuard,
        mailbox: Mailbox,
        setup: Setup,
        world: World,
        strategy: Strategy | None,
        start: Posture | None,
    ) -> None:
        """Prepare to run a robot.

        Args:
            choice: The robot's backend.
            guard: Its guard.
            mailbox: Actions and what is known.
            setup: How it follows actions.
            world: Robot and scene.
            strategy: How it gets up; None for not at all.
            start: Where a simulated robot begins.
        """
        self._choice, self._guard, self._mailbox = choice, guard, mailbox
        self._setup, self._world = setup, world
        self._strategy, self._start = strategy, start
        self._realtime = setup.realtime or choice.realtime
        tilt = setup.fallen_tilt if strategy is not None else math.inf
        self._watch = FallWatch(TorsoSense(world), tilt)
        limit = float(guard.limits.torque_limit.max())
        self._pilot = TargetPilot(guard, mailbox, setup, self._watch, limit)
        self._rng = np.random.default_rng(setup.request.seed)

    def run(self, ready: Callable[[], None] = lambda: None) -> None:
        """Wait for the first action, then obey and rise until the end.

        Args:
            ready: Called when the robot was measured for the first time.

        Raises:
            RobotStoppedError: if the robot has a fault or cannot get up.
        """
        try:
            fallen = self._watch.leans(self._wait(ready))
            is_placed = False
            while not self._mailbox.is_stopping():
                if fallen:
                    self._rise()
                else:
                    self._obey(places=not is_placed)
                fallen, is_placed = self._pilot.fallen, True
        except CancelledError:
            pass  # asked to end while it rose
        except DriverError as error:
            raise RobotStoppedError(str(error)) from error

    def _wait(self, ready: Callable[[], None]) -> State:
        """Measure, torque off, until the first action; the time of a simulation stands still."""
        self._mailbox.begin(WAITING, rising=False)
        is_simulated = self._choice.place is not None
        self._place()  # where the filter of the IMU begins
        with self._guard:
            self._place()
            state = self._guard.read()
            ready()
            while not self._mailbox.wait(None if is_simulated else self._guard.period):
                state = self._guard.read()
        return state

    def _place(self) -> None:
        """Place a simulated robot where it begins."""
        if self._choice.place is not None and self._start is not None:
            self._choice.place(self._start)

    def _obey(self, *, places: bool) -> None:
        with engaged(self._guard, realtime=self._realtime):
            if places:  # it fell when its torque was off
                self._place()
                # The first reply of a bus may be of the time before: a cycle later it is not.
                self._guard.write(Command.limp(self._guard.robot.n))
            while True:
                report = run_engaged(
                    self._pilot, self._guard, max_time=math.inf, realtime=self._realtime
                )
                fault = self._guard.fault
                is_paused = fault is not None and fault.kind is FaultKind.PAUSED
                if not is_paused or self._watch.leans(self._guard.read()):
                    break
                self._guard.resume()  # it stands, and its targets begin where its joints are
        if report.ending is not Ending.DONE:
            raise RobotStoppedError(report.reason)

    def _rise(self) -> None:
        """Get up, and obey from the stand on."""
        assert self._strategy is not None  # falls are not looked for without one
        options = SessionOptions(
            pilot=self._pilot,
            then="limp",
            realtime=self._realtime,
            simulation=self._choice.simulation,
            on_phase=self._note,
        )
        self._mailbox.begin(Phase.SETTLING.value, rising=True)
        result = get_up(
            self._guard,
            self._strategy,
            seed=self._rng,
            max_attempts=self._setup.request.attempts,
            options=options,
        )
        after = result.after
        if after is None or not after.succeeded:
            raise RobotStoppedError(result.reason if after is None else after.reason)

    def _note(self, change: PhaseChange) -> None:
        if change.phase not in (Phase.FOLLOWING, Phase.ENDED):
            self._mailbox.begin(change.detail or change.phase.value, rising=True)
