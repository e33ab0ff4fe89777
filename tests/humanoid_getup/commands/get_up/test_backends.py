"""The backend of a request, and whose time it keeps."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest
from bus_stories import Served, serving
from paths import TINY

from drivers import Command, Twin
from drivers.flight_log.writer import FlightLog
from drivers.virtual_bus.serving.server import TimeMode
from humanoid_getup.commands.backends import BackendChoice, open_backend
from humanoid_getup.commands.get_up.recording import recording
from humanoid_getup.commands.get_up.session_hooks import NoOperator, SessionHooks
from humanoid_getup.commands.get_up.stand import SitRequest
from humanoid_getup.commands.inputs import load_world
from humanoid_getup.commands.robot.watch import WatchRequest
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE

STALL = 0.05  # s, many times the margin of a reply in wall time


def open_served(served: Served, *, realtime: bool = False):
    """Open the backend of a bus that another program serves."""
    request = WatchRequest(
        robot=str(TINY), backend="dynamixel", port=(served.path,), realtime=realtime
    )
    world = load_world(request)
    return open_backend(request, world, FULL_TORQUE.on(world.robot))


@pytest.mark.parametrize("realtime", [False, True])
def test_behind_a_bus_in_lock_step_a_cycle_takes_a_period_and_no_reply_is_late(realtime: bool):
    with serving(TINY) as served, open_served(served, realtime=realtime) as choice:
        assert choice.realtime is realtime
        with choice.backend as backend:
            robot, times, ages = backend.robot, list[float](), list[float]()
            for _ in range(4):
                busy = threading.Thread(target=served.stall, args=(STALL,))
                busy.start()
                state = backend.read()
                backend.write(Command.limp(robot.n))
                busy.join()
                times.append(state.time)
                ages.append(float(state.joint_age.max()))
    np.testing.assert_allclose(np.diff(times), backend.period)
    assert max(ages) == 0.0


def test_behind_a_bus_in_real_time_the_clock_of_the_wall_counts():
    with (
        serving(TINY, time_mode=TimeMode.REAL_TIME) as served,
        open_served(served) as choice,
    ):
        assert choice.realtime
        with choice.backend as backend:
            before = backend.read().time
            time.sleep(STALL)
            assert backend.read().time >= before + STALL


def test_what_the_driver_finds_that_forbids_no_motion_is_kept():
    with serving(TINY) as served:
        served.poke("l_hip", "homing_offset", 5)
        with open_served(served) as choice:
            (warning,) = choice.warnings
    assert warning.startswith("joint 'l_hip' (id 1): homing offset is 5 ticks")


def test_what_the_driver_found_is_shown_before_torque_comes_on(world: World, tmp_path: Path):
    """Such as a joint that may be a whole turn from where it is taken to be."""
    warning, shown = "joint 'l_el' (id 6): may be at -3.14 rad", list[Progress]()
    choice = BackendChoice(backend=Twin(world), realtime=False, warnings=(warning,))
    monitor, key = ProgressMonitor(shown.append), NoOperator()
    with recording(FlightLog(tmp_path / "flight.mcap", world.robot), monitor.tell) as recorder:
        hooks = SessionHooks(SitRequest(), choice, recorder, monitor, key)
        hooks.begin(world, FULL_TORQUE, SessionOptions())
    assert [progress.message for progress in shown] == [warning]
