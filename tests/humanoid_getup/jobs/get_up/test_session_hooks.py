"""Hooks of a session: each phase reaches progress, the flight log and the operator's key."""

import os
import pty
from collections.abc import Callable
from pathlib import Path

from drivers import Command, SafetyGuard, Twin
from drivers.control_loop import Ending, run
from drivers.flight_log.reader import FlightRecord
from drivers.flight_log.writer import FlightLog
from humanoid_getup.cli.get_up.operator_key import OperatorKey
from humanoid_getup.execution.after_stand import AfterStand, Step
from humanoid_getup.execution.phase import Phase, PhaseChange
from humanoid_getup.execution.session import Session, SessionOptions
from humanoid_getup.jobs.backends import BackendChoice
from humanoid_getup.jobs.get_up.recording import recording
from humanoid_getup.jobs.get_up.session_hooks import NoOperator, SessionHooks
from humanoid_getup.jobs.requests.rise import SitRequest
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Robot


class Patience:
    """Keeps torque off until the robot is released; presses the key in its first cycle."""

    def __init__(self, robot: Robot, terminal: int, is_released: Callable[[], bool]) -> None:
        self._limp, self._terminal, self._is_released = Command.limp(robot.n), terminal, is_released
        self._is_pressed = False

    def reset(self, state) -> None:
        del state

    def step(self, state) -> Command:
        del state
        if not self._is_pressed:
            self._is_pressed = os.write(self._terminal, b" ") == 1
        return self._limp

    @property
    def done(self) -> bool:
        return self._is_released()


def test_a_phase_reaches_progress_log_and_key(op3: Robot, world: World, tmp_path: Path):
    master, slave = pty.openpty()
    path, shown, guard = tmp_path / "flight.mcap", list[Progress](), SafetyGuard(Twin(op3))
    choice = BackendChoice(backend=guard, realtime=True)
    monitor, key = ProgressMonitor(shown.append), OperatorKey(realtime=True, terminal=slave)
    with recording(FlightLog(path, op3), monitor.tell) as recorder:
        hooks = SessionHooks(SitRequest(), choice, recorder, monitor, key)
        options = hooks.join(SessionOptions())

        def hold() -> AfterStand:
            options.on_phase(PhaseChange(Phase.HOLDING, 1, ""))
            assert not options.is_released()
            patience = Patience(op3, master, options.is_released)
            report = run(patience, guard, max_time=5.0, realtime=True, on_cycle=options.on_cycle)
            return AfterStand(hold=Step(run=report))

        held = hooks.work(Session.on(guard, world), hold).hold
    os.close(master)
    os.close(slave)
    assert held is not None
    assert held.run.ending is Ending.DONE, "the key releases a robot that is held, and stops none"
    assert shown == [Progress(phase="holding the stand, until a key is pressed")]
    assert [event.kind for event in FlightRecord.load(path, op3).events] == ["holding"]


def test_what_the_driver_found_is_shown_before_torque_comes_on(world: World, tmp_path: Path):
    """Such as a joint that may be a whole turn from where it is taken to be."""
    warning, shown = "joint 'l_el' (id 6): may be at -3.14 rad", list[Progress]()
    choice = BackendChoice(backend=Twin(world), realtime=False, warnings=(warning,))
    monitor, key = ProgressMonitor(shown.append), NoOperator()
    with recording(FlightLog(tmp_path / "flight.mcap", world.robot), monitor.tell) as recorder:
        hooks = SessionHooks(SitRequest(), choice, recorder, monitor, key)
        hooks.begin(world, FULL_TORQUE, SessionOptions())
    assert [progress.message for progress in shown] == [warning]
