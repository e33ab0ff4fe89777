"""The thread that owns the robot: it waits, obeys, falls, rises and obeys again."""

from __future__ import annotations

import logging
import math
import sys
import threading
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from drivers import (
    Backend,
    Command,
    Ending,
    FaultKind,
    GuardLimits,
    SafetyGuard,
    State,
    engaged,
    run_engaged,
)
from humanoid_getup.commands.backends import BackendChoice, open_backend
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import find_start, load_world, make_torque_limit
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.session import Phase, PhaseChange, SessionOptions
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.playback.monitors import DOWN, Persistence, vector_angle
from humanoid_getup.progress.callback import CancelledError, ProgressMonitor
from humanoid_getup.strategies.choice import choose_strategy
from humanoid_getup.strategies.plan import Strategy
from lerobot_robot_getup.config_getup_robot import GetupRobotConfig
from robots.kinematics import GravitySense, imu_in_torso
from robots.quaternion import Array

logger = logging.getLogger(__name__)

LONGEST_CYCLE = 10.0  # s that an action may wait for the cycle that sends it
LONGEST_END = 30.0  # s; the steps of a plan, between which it can be ended, take a few seconds
POLL = 1e-3  # s
# s after which a busy thread of Python lets another one run. At Python's own 5 ms, a busy thread of
# LeRobot left this loop 25 Hz, with gaps of 0.3 s; at 0.5 ms 63 Hz and 0.04 s (OP3, virtual bus).
SWITCH_INTERVAL = 5e-4
FALLEN_TIME = 0.2  # s beyond the tilt: a push that the robot survives is shorter
HANG_TIME = 0.1  # s without a call, after which LeRobot's program may hang: joints are held
AWAY_TIME = 1.0  # s, after which the next action is approached slowly


class RobotStoppedError(RuntimeError):
    """The robot does not move any more; the message says why."""


class WatchedGuard(SafetyGuard):
    """A safety guard that keeps what it measured and sent, and ends the work on request."""

    measured: State
    answer: Array
    """Targets with which the last action was sent [rad], (n,)."""

    def __init__(self, backend: Backend, limits: GuardLimits, check: Callable[[], None]) -> None:
        """Guard a backend; ``check`` raises an error if the work is to end."""
        super().__init__(backend, limits)
        self._check, self._last = check, Command.limp(self.robot.n)
        self.action: Array | None = None
        """Target angles from LeRobot until they are sent [rad], (n,), NaN to keep one."""
        self.taken: Array | None = None
        """Action that the next command obeys."""

    @property
    def targets(self) -> Array:
        """Return the last targets; the measured angles of joints without torque [rad], (n,)."""
        last = self._last
        return np.where(last.torque_limit > 0.0, last.joint_pos, self.measured.joint_pos)

    def read(self) -> State:
        """Measure the robot; if it is to end, an error is raised, and torque goes off with it."""
        self._check()
        self.measured = super().read()
        return self.measured

    def write(self, command: Command) -> Command:
        """Send a command within the limits; return what was sent."""
        self._last = super().write(command)
        if self.action is self.taken:
            self.answer, self.action = self.targets, None
        return self._last


class RobotThread:
    """Opens a robot and moves it behind its guard, until it is closed or the robot has a fault.

    It moves joints to the newest targets of LeRobot's actions until the robot has fallen. After the
    start, a rise and a long silence, joints go to the first targets at the speed of the approach.
    While LeRobot's program is silent, they stay where they are.
    """

    def __init__(self, config: GetupRobotConfig) -> None:
        """Open the robot, and wait until it was measured.

        Raises:
            BadInputError: if the configuration cannot be used.
            DriverError: if the robot cannot be reached.
        """
        self._config, self._request = config, config.make_request()
        self._world = load_world(self._request)
        self._limit = make_torque_limit(self._request, self._world.robot)
        robot, model = self._world.robot, self._world.model
        has_imu = robot.imu_kind is not None
        self.sense = GravitySense(imu_in_torso(robot, model)) if has_imu else None
        self._fallen_tilt = math.radians(config.fallen_tilt) if config.rises else math.inf
        self._heard_at = time.monotonic()  # when LeRobot called last
        self.done = False
        """Whether the robot has fallen."""
        self.rising = False
        """Whether the robot has fallen and does not obey until it stands."""
        self._failure: Exception | None = None
        self._unreleased: tuple[str, ...] = ()
        self._opened, self._stop = threading.Event(), threading.Event()
        self._monitor = ProgressMonitor(cancel=self._stop.is_set)
        self._thread = threading.Thread(target=self._run, name="getup robot", daemon=True)
        sys.setswitchinterval(min(SWITCH_INTERVAL, sys.getswitchinterval()))
        self._thread.start()
        try:
            self._opened.wait()
        except BaseException:
            self.close()
            raise
        if self._failure is not None:
            raise self._failure

    # Called by LeRobot's thread -------------------------------------------------------------------

    def observe(self) -> State:
        """Return the newest measurement; raise `RobotStoppedError` if the robot has stopped."""
        if not self._thread.is_alive():
            reason = self._failure or "it belongs to the process that connected it"
            raise RobotStoppedError(f"the robot has stopped: {reason}") from self._failure
        self._heard_at = time.monotonic()
        return self._guard.measured

    def act(self, targets: Array) -> Array:
        """Move joints to targets [rad], (n,), NaN to keep one; return what was sent.

        While the robot rises, targets are dropped.

        Raises:
            RobotStoppedError: if the robot has stopped, or its thread hangs.
        """
        self.observe()
        self._guard.action, end = targets, time.monotonic() + LONGEST_CYCLE
        while self._guard.action is targets and not self.rising:
            if time.monotonic() > end:
                raise RobotStoppedError(
                    f"no control cycle within {LONGEST_CYCLE:g} s: support the robot, disconnect"
                )
            time.sleep(POLL)
            self.observe()
        return self._guard.targets if self.rising else self._guard.answer

    def close(self) -> None:
        """End, torque off; harmless if it has ended, and in a forked process.

        Raises:
            RobotStoppedError: if torque off is not confirmed; the message names the joints.
        """
        self._stop.set()
        self._thread.join(LONGEST_END)
        if self._thread.is_alive():
            raise RobotStoppedError(
                f"the robot did not end within {LONGEST_END:g} s: support it, and switch the power "
                "of its servos off"
            )
        if self._unreleased:
            raise RobotStoppedError(str(self._failure)) from self._failure

    # In the robot's thread ------------------------------------------------------------------------

    def _run(self) -> None:
        """Move the robot until the end; torque is off then, or joints are named."""
        request, world, limit = self._request, self._world, self._limit
        try:
            strategy = None
            if self._config.rises:
                with refusing():
                    strategy = choose_strategy(
                        world,
                        request.method,
                        PlannerSettings(torque_limit=limit),
                        policy=request.policy,
                        monitor=self._monitor,
                    )
            with open_backend(request, world, limit, without_imu=self.sense is None) as choice:
                try:
                    self._move(choice, strategy)
                finally:
                    self._unreleased = choice.backend.unreleased
        except CancelledError:
            pass
        except Exception as error:
            self._failure = error
            if self._opened.is_set():
                logger.error("robot '%s' has stopped: %s", self._world.robot.name, error)
        finally:
            self._opened.set()

    def _move(self, choice: BackendChoice, strategy: Strategy | None) -> None:
        place = None
        if choice.place is not None:
            rng, origin = np.random.default_rng(self._request.seed), self._config.start
            start = (
                find_start(self._world, origin, rng, logger.warning).posture
                if origin
                else find_rest(self._world, self._world.robot.standing)
            )
            place = partial(choice.place, start)
        limits = GuardLimits.of(self._world.robot, self._limit.value)
        self._guard = WatchedGuard(choice.backend, limits, self._monitor.check)
        fastest = math.inf if self._config.max_speed is None else self._config.max_speed
        speeds = np.radians([fastest, min(self._config.approach_speed, fastest)])
        self._step, self._approach_step = (speeds * self._guard.period).tolist()
        realtime = self._config.realtime or choice.realtime
        options = SessionOptions(
            pilot=self,
            then="limp",
            realtime=realtime,
            simulation=choice.simulation,
            on_phase=self._note,
        )
        if not self.leans(self._wait(place)):
            self._obey(place, realtime=realtime)
        rng = np.random.default_rng(self._request.seed)
        while strategy is not None:  # until the guard raises an error
            self.rising = True
            attempts = self._request.attempts
            rise = get_up(self._guard, strategy, seed=rng, max_attempts=attempts, options=options)
            if rise.after is None or not rise.after.succeeded:
                raise RobotStoppedError((rise.after or rise).reason)

    def _wait(self, place: Callable[[], None] | None) -> State:
        """Measure, torque off, until the first action; the time of a simulation stands still."""
        if place is not None:
            place()  # where the filter of the IMU begins
        with self._guard:
            if place is not None:
                place()
            state = self._guard.read()
            self._opened.set()
            while self._guard.action is None:
                time.sleep(self._guard.period)
                self._monitor.check()
                state = state if place else self._guard.read()
        return state

    def _obey(self, place: Callable[[], None] | None, *, realtime: bool) -> None:
        """Follow actions until the robot falls; after a pause it goes on if it stands."""
        guard = self._guard
        with engaged(guard, realtime=realtime):
            if place is not None:  # it fell when its torque was off
                place()
                # The first reply of a bus may be of the time before: a cycle later it is not.
                guard.write(Command.limp(guard.robot.n))
            while True:
                report = run_engaged(self, guard, max_time=math.inf, realtime=realtime)
                is_paused = guard.fault is not None and guard.fault.kind is FaultKind.PAUSED
                if not is_paused or self.leans(guard.read()):
                    break
                guard.resume()  # its targets begin where its joints are
        if report.ending is not Ending.DONE:
            raise RobotStoppedError(report.reason)

    def _note(self, change: PhaseChange) -> None:
        """Note a phase of a rise; actions of the time before its end are dropped."""
        if change.phase is Phase.FOLLOWING:
            self._guard.answer, self._guard.action = self._guard.targets, None
            self.rising = False
        logger.info("robot '%s': %s", self._world.robot.name, change.detail or change.phase.value)

    # The pilot, in the robot's thread ------------------------------------------------------------

    def leans(self, state: State) -> bool:
        """Return whether the torso leans beyond the tilt of a fallen robot now."""
        if self.sense is None:
            return False
        return bool(vector_angle(self.sense(state.orientation), DOWN) > self._fallen_tilt)

    def reset(self, state: State) -> None:
        """Hold the targets that the servos have, and begin to obey."""
        self._target = self._goal = self._guard.targets
        self._leaning = Persistence(1, state.time)
        self._has_arrived = self._is_away = self.done = False

    def step(self, state: State) -> Command:
        """Move towards the newest targets."""
        self.done = self._leaning.update(self.leans(state), state.time).item() > FALLEN_TIME
        silence = time.monotonic() - self._heard_at
        if (action := self._guard.action) is not None:
            self._guard.taken = action
            self._goal = np.where(np.isnan(action), self._goal, action)
            self._has_arrived &= not self._is_away
            self._is_away = False
        elif silence > AWAY_TIME and not self._is_away:
            self._is_away = True
            logger.warning("no call from LeRobot for %g s: joints are held", AWAY_TIME)
        if silence > HANG_TIME or self._is_away:
            self._target = self._guard.targets
        else:
            self._target = self._approach()
        torque_limit = float(self._guard.limits.torque_limit.max())
        return Command.position(self._guard.robot, self._target, torque_limit)

    def _approach(self) -> Array:
        """Return the next targets on the way to the goal [rad], (n,)."""
        step = self._step if self._has_arrived else self._approach_step
        moved = self._goal - self._target
        self._has_arrived |= bool(np.all(np.abs(moved) <= step))
        return self._goal if math.isinf(step) else self._target + np.clip(moved, -step, step)
