"""The control loop, turned by small controllers."""

import os
import signal
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from recording_backend import RecordingBackend

from drivers import Command, Ending, SafetyGuard, control_loop, engaged, run, run_engaged
from drivers.control_loop import Pacer, Timing, TimingSummary
from drivers.errors import DriverError
from drivers.real_time_class import in_real_time_class


class Hold:
    def __init__(self, robot, cycles=10**9, spoil=None):
        self.robot, self.cycles, self.spoil = robot, cycles, spoil
        self.steps = 0

    @property
    def done(self):
        return self.steps >= self.cycles

    def reset(self, state):
        self.angles = state.joint_pos

    def step(self, _state):
        self.steps += 1
        if self.spoil and self.steps == 3:
            return self.spoil()
        return Command.position(self.robot, self.angles)


@pytest.fixture
def backend(tiny):
    return RecordingBackend(tiny)


def test_it_turns_until_the_controller_is_done(tiny, backend):
    report = run(Hold(tiny, cycles=7), SafetyGuard(backend), max_time=1.0)
    assert report.ending is Ending.DONE
    assert report.cycles == len(backend.received) == 7
    assert report.duration == pytest.approx(7 * 0.008)
    assert report.overruns == 0
    assert not backend.connected


@pytest.mark.parametrize("cycles", [0, 7])
def test_a_stop_after_the_last_command_ends_the_run_as_one_before_it(tiny, backend, cycles):
    guard, controller = SafetyGuard(backend), Hold(tiny, cycles=cycles)
    if not cycles:
        guard.stop("a key")
    watch = lambda _: guard.stop("a key") if controller.done else None  # noqa: E731
    report = run(controller, guard, max_time=1.0, on_cycle=watch)
    assert (report.ending, report.cycles) == (Ending.FAULT, cycles)
    assert report.reason == "the robot was stopped: a key"


def test_a_pause_between_two_runs_is_no_fault_and_begins_where_the_joints_are(tiny, backend):
    with engaged(guard := SafetyGuard(backend)):
        run_engaged(Hold(tiny, cycles=3), guard, max_time=1.0)
        backend.state = replace(
            backend.state, time=backend.state.time + 2.0, joint_pos=np.array([0.3, -0.2])
        )
        report = run_engaged(Hold(tiny, cycles=3), guard, max_time=1.0)
    assert report.ending is Ending.DONE
    assert backend.received[3].joint_pos.tolist() == [0.3, -0.2]


@pytest.mark.parametrize("lost", [{"imu_age": 0.5}, {"joint_age": np.array([0.0, 0.5])}])
@pytest.mark.parametrize(("times", "ending"), [(2, Ending.DONE), (99, Ending.FAULT)])
def test_replies_that_are_lost_after_a_pause_are_no_fault_unless_they_stay_lost(
    tiny, backend, monkeypatch, lost, times, ending
):
    sound, stale = backend.state, replace(backend.state, **lost)
    reads = iter([stale] * times)
    monkeypatch.setattr(
        backend, "read", lambda: replace(next(reads, sound), time=backend.state.time)
    )
    report = run(Hold(tiny, cycles=3), SafetyGuard(backend), max_time=1.0)
    assert report.ending is ending


def suspend() -> Command:
    signal.raise_signal(signal.SIGTSTP)
    return Command.limp(2)


def fail(error: BaseException) -> Command:
    raise error


@pytest.mark.parametrize(
    ("spoil", "ending", "reason", "cycles"),
    [
        (lambda: fail(DriverError("port gone")), Ending.FAULT, "port gone", 2),
        (lambda: Command.limp(3), Ending.FAULT, "target has shape (3,)", 3),  # the guard's fault
        (lambda: fail(KeyboardInterrupt()), Ending.INTERRUPTED, "", 2),
        (suspend, Ending.INTERRUPTED, "", 2),  # Ctrl-Z
        (lambda: fail(ZeroDivisionError()), None, "", 0),  # a controller's bug is not swallowed
    ],
    ids=["device", "guard", "Ctrl-C", "Ctrl-Z", "bug"],
)
def test_whatever_ends_a_run_leaves_the_robot_closed(tiny, backend, spoil, ending, reason, cycles):
    before = signal.getsignal(signal.SIGTSTP)
    with nullcontext() if ending else pytest.raises(ZeroDivisionError):
        report = run(Hold(tiny, spoil=spoil), SafetyGuard(backend), max_time=1.0)
        assert (report.ending, report.cycles) == (ending, cycles)
        assert reason in (report.reason or "")
        assert backend.received[-1].is_limp == (cycles == 3)
    assert not backend.connected
    assert signal.getsignal(signal.SIGTSTP) is before


class Clock:
    """A clock that is advanced by the test, and sleeps without waiting."""

    def __init__(self):
        self.now = 100.0
        self.woke = []

    def __call__(self):
        return self.now

    def sleep(self, duration):
        self.now += duration
        self.woke.append(round(self.now - 100.0, 6))


def test_the_pacer_keeps_absolute_deadlines_and_counts_overruns():
    clock = Clock()
    pacer = Pacer(0.01, clock, clock.sleep)
    for work in (0.004, 0.009, 0.013, 0.001):
        clock.now += work
        pacer.wait()
    # Two cycles in time wake at 10 and 20 ms; the third ends 3 ms late, at 33 ms: one
    # overrun, and the next deadline is a whole period after it.
    assert clock.woke == [0.01, 0.02, 0.043]
    assert pacer.overruns == 1


@pytest.mark.parametrize("wake_up", [0.0, 0.0004, 0.002])
def test_deadlines_do_not_drift_however_late_each_cycle_wakes_up(wake_up):
    """A sleep always ends late; over 1000 cycles that must not add up."""
    clock = Clock()

    def oversleep(duration):
        clock.sleep(duration + wake_up)

    pacer = Pacer(0.01, clock, oversleep)
    lates = []
    for _ in range(1000):
        clock.now += 0.003
        pacer.wait()
        lates.append(pacer.late)
    assert clock.woke == pytest.approx([0.01 * k + wake_up for k in range(1, 1001)])
    assert lates == pytest.approx([wake_up] * 1000)
    assert pacer.overruns == 0


def test_each_part_of_a_cycle_is_timed_alone(tiny, backend, monkeypatch):
    """Reading takes 1 ms of the clock, deciding 2 ms, writing 4 ms, watching 8 ms."""
    clock, timings = Clock(), []
    monkeypatch.setattr(control_loop, "time", SimpleNamespace(perf_counter=clock))

    def costing(duration, work):
        def timed(*arguments):
            clock.now += duration
            return work(*arguments)

        return timed

    guard, controller = SafetyGuard(backend), Hold(tiny, cycles=5)
    monkeypatch.setattr(guard, "read", costing(0.001, guard.read))
    monkeypatch.setattr(controller, "step", costing(0.002, controller.step))
    monkeypatch.setattr(guard, "write", costing(0.004, guard.write))
    watch = costing(0.008, lambda cycle: timings.append(cycle.timing))
    report = run(controller, guard, max_time=1.0, on_cycle=watch)
    assert len(timings) == 5
    expected = Timing(late=0.0, read=0.001, step=0.002, write=0.004)
    for timing in timings:
        assert vars(timing) == pytest.approx(vars(expected))
    assert report.pace.busy_median == pytest.approx(0.007)
    assert report.pace.late_max == 0.0


def test_a_bare_backend_is_refused_before_it_moves(tiny, backend):
    with pytest.raises(TypeError, match="SafetyGuard"):
        run(Hold(tiny), backend, max_time=1.0)  # type: ignore[arg-type]
    assert not backend.received and not backend.connected


def test_a_summary_is_of_delays_and_of_the_parts_summed():
    late = np.arange(101) * 1e-4  # 0 to 10 ms
    timings = np.stack([late, late + 1.0, late + 2.0, late + 4.0], axis=1)
    summary = TimingSummary(
        late_median=0.005, late_p99=0.0099, late_max=0.01, busy_median=7.015, busy_p99=7.0297
    )
    assert vars(TimingSummary.of(timings)) == pytest.approx(vars(summary))
    assert set(vars(TimingSummary.of(np.zeros((0, 4)))).values()) == {0.0}


@pytest.mark.parametrize(
    ("realtime", "has_wire", "is_first"),
    [(False, True, False), (True, False, False), (True, True, True)],
)
def test_in_real_time_it_goes_first_while_it_waits_for_a_wire(
    tiny, backend, realtime, has_wire, is_first
):
    with in_real_time_class() as is_permitted:
        pass
    backend.has_wire, found = has_wire, []
    note = lambda *_: found.append(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK)  # noqa: E731
    guard = SafetyGuard(backend)
    run(Hold(tiny, cycles=3), guard, max_time=1.0, realtime=realtime, on_cycle=note)
    assert set(found) == {os.SCHED_FIFO if is_first and is_permitted else os.SCHED_OTHER}
    note()
    assert found[-1] == os.SCHED_OTHER
