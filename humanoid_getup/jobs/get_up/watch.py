"""Job that reads a limp robot while a person turns it by hand."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from drivers import Command, Cycle, Ending, State
from drivers.control_loop import RunReport, run
from drivers.safety_limits import GuardLimits
from humanoid_getup.commands.backends import BackendChoice, CancellableGuard, open_backend
from humanoid_getup.commands.inputs import find_start, load_world
from humanoid_getup.commands.viewer import viewing
from humanoid_getup.jobs.requests.rise import WatchRequest
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.reporting.watched_robot import WatchedRobot, WatchReport
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Robot

WATCHING, RELEASED = "watching", "a person ended it"
SUPPORT = "torque goes off now, and stays off: support the robot"


def watch(
    request: WatchRequest,
    report: Report | None = None,
    cancel: Cancel | None = None,
    *,
    is_released: Callable[[], bool] = lambda: False,
    begin: Callable[[WatchedRobot], None] = lambda _: None,
) -> WatchReport:
    """Read a robot, torque off, until its time is up, it is released, or there is a fault.

    Args:
        request: The robot.
        report: Shows progress.
        cancel: Ends it, called in every cycle.
        is_released: Ends it once it returns True; called in every cycle.
        begin: Called before the first cycle with what can be asked for figures meanwhile.

    Raises:
        BadInputError: if the request cannot be done.
        CancelledError: if ``cancel`` ended it.
        DriverError: if the robot cannot be reached.
    """
    WatchRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    world = load_world(request)
    watched = WatchedRobot(world)
    if request.is_real:
        monitor.tell(SUPPORT)
    monitor.begin("opening the backend")
    limit, without_imu = FULL_TORQUE.on(world.robot), _lacks_imu(request, world.robot)
    with open_backend(request, world, limit, without_imu=without_imu) as choice:
        _place(request, world, choice)
        guard = CancellableGuard(choice.backend, GuardLimits.of_limp(world.robot), monitor.check)
        is_paced = request.is_paced or choice.realtime
        with viewing(request, world, realtime=is_paced) as show:

            def see(cycle: Cycle) -> None:
                watched.show(cycle)
                show(cycle)

            monitor.begin(WATCHING)
            begin(watched)
            result = run(
                LimpController(world.robot, is_released),
                guard,
                max_time=math.inf if request.seconds is None else request.seconds,
                realtime=request.is_paced,
                on_cycle=see,
            )
    return _describe(request, world.robot, watched, result)


class LimpController:
    """Keeps every joint limp until the robot is released."""

    def __init__(self, robot: Robot, is_released: Callable[[], bool]) -> None:
        """Prepare; ``is_released`` is called in every cycle."""
        self._limp, self._is_released = Command.limp(robot.n), is_released

    @property
    def done(self) -> bool:
        """Return whether the robot is released."""
        return self._is_released()

    def reset(self, state: State) -> None:
        """Start over."""

    def step(self, state: State) -> Command:
        """Keep every joint limp."""
        del state
        return self._limp


def _lacks_imu(request: WatchRequest, robot: Robot) -> bool:
    """Return whether no orientation is measured; a twin needs no sensor, only its place."""
    return (robot.imu_site if request.backend == "twin" else robot.imu_kind) is None


def _place(request: WatchRequest, world: World, choice: BackendChoice) -> None:
    """Place a simulated robot where it is to lie."""
    if choice.place is not None:
        rng = np.random.default_rng(request.seed)
        choice.place(find_start(world, request.start, rng).posture)


def _describe(
    request: WatchRequest, robot: Robot, watched: WatchedRobot, run: RunReport
) -> WatchReport:
    return WatchReport(
        robot=robot.name,
        backend=request.backend,
        reason=RELEASED if run.ending is Ending.DONE else run.reason,
        by_fault=run.ending is Ending.FAULT,
        watched_s=run.duration,
        cycles=run.cycles,
        period_s=run.period,
        last=watched.look(),
    )
