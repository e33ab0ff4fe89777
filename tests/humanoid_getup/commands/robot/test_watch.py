"""`getup watch`: a limp robot is read and never driven, whoever turns it, until q or Ctrl-C."""

import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from bus_stories import serving
from paths import TINY
from recording_backend import RecordingBackend
from run_getup import Run
from waiting import LONGEST_WAIT, wait_until

from drivers import DriverError, State
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.virtual_bus.devices.servo import VirtualServo
from humanoid_getup.commands.backends import BackendChoice
from humanoid_getup.commands.prompt import QuitKey
from humanoid_getup.commands.robot import watch as jobs
from humanoid_getup.commands.robot.watch import WatchRequest, watch
from humanoid_getup.progress.callback import CancelledError
from humanoid_getup.reporting.watched_robot import WatchedRobot, WatchFigures
from robots import Posture, Robot, quaternion

TIMEOUT = 60.0  # s; a wait ends with its event
X, Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
HELD = 5  # cycles; what a virtual servo senses is read one or two later
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class Hand:
    """Holds a robot in one posture after the other, some cycles each, and looks at each."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._postures = robot, list[Posture]()
        self._cycle = 0
        self.seen = list[WatchFigures]()
        self.place: Callable[[Posture], None] = lambda _: None

    def hold(self, *, degrees: tuple[float, ...] = (0.0, 0.0), torso: Any = UPRIGHT) -> None:
        posture = replace(
            self._robot.standing, joint_pos=np.radians(degrees), orientation=np.array(torso)
        )
        self._postures.append(posture)

    def begin(self, watched: WatchedRobot) -> None:
        self._watched = watched

    def is_done(self) -> bool:
        number, cycle = divmod(self._cycle, HELD)
        self._cycle += 1
        if cycle == 0 and number and (figures := self._watched.look()):
            self.seen.append(figures)
        if cycle == 0 and number < len(self._postures):
            self.place(self._postures[number])
        return number == len(self._postures)


@pytest.fixture
def hand(tiny: Robot, monkeypatch: pytest.MonkeyPatch) -> Hand:
    """A hand for the robot that the job simulates."""
    found, open_backend = Hand(tiny), jobs.open_backend

    @contextmanager
    def open_and_note(*arguments: Any, **options: Any) -> Iterator[BackendChoice]:
        with open_backend(*arguments, **options) as choice:
            assert choice.place is not None
            found.place = choice.place
            yield choice

    monkeypatch.setattr(jobs, "open_backend", open_and_note)
    return found


def make_request(**options: Any) -> WatchRequest:
    return WatchRequest(robot=str(TINY), seconds=30.0, **options)


@pytest.fixture
def torque(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Every value that is written to a servo's Torque Enable."""
    written, switch = list[int](), VirtualServo._switch_torque

    def note(servo: VirtualServo, value: int) -> None:
        written.append(value)
        switch(servo, value)

    monkeypatch.setattr(VirtualServo, "_switch_torque", note)
    return written


@pytest.mark.parametrize("backend", ["twin", "virtual"])
def test_joints_turned_by_hand_are_seen_and_get_no_torque(
    backend: str, hand: Hand, torque: list[int]
):
    hand.hold(degrees=(-60.0, 0.0))
    hand.hold(degrees=(0.0, 30.0))
    done = watch(make_request(backend=backend), is_released=hand.is_done, begin=hand.begin)
    assert not done.by_fault
    assert done.cycles == 2 * HELD
    first, last = hand.seen
    assert done.last is not None
    assert np.degrees(first.joints["l_hip"].angle_rad) == pytest.approx(-60.0, abs=3.0)
    assert np.degrees(last.joints["r_hip"].angle_rad) == pytest.approx(30.0, abs=3.0)
    assert np.degrees(done.last.joints["l_hip"].lowest_rad) == pytest.approx(-60.0, abs=3.0)
    assert not last.torque_on
    assert last.findings == ()
    assert (set(torque) == {0}) is (backend == "virtual"), "on the bus it is switched off"


def test_a_robot_turned_by_hand_says_how_it_is_held(hand: Hand):
    turns = {
        "upright": UPRIGHT,
        "head down": quaternion.from_axis_angle(Y, np.pi),
        "on its belly": quaternion.from_axis_angle(Y, np.pi / 2),
        "on its back": quaternion.from_axis_angle(Y, -np.pi / 2),
        "on its right side": quaternion.from_axis_angle(X, np.pi / 2),
        "on its left side": quaternion.from_axis_angle(X, -np.pi / 2),
    }
    for torso in turns.values():
        hand.hold(torso=torso)
    watch(make_request(), is_released=hand.is_done, begin=hand.begin)
    assert [seen.torso and seen.torso.lies for seen in hand.seen] == list(turns)


def test_a_sign_that_is_wrong_is_found_where_the_joint_leaves_its_range(
    tiny: Robot, torque: list[int], monkeypatch: pytest.MonkeyPatch
):
    left, right = tiny.joints
    turned = replace(left, servo=replace(left.servo, sign=-left.servo.sign))
    with serving(replace(tiny, joints=(turned, right))) as served:
        hand = Hand(tiny)
        hand.place = lambda posture: served.hold(posture.joint_pos)
        hand.hold(degrees=(-85.0, 20.0))  # measured as +85, of a range up to +60
        driver = DynamixelBackend(tiny, served.path, clock=CycleClock())
        choice = BackendChoice(backend=driver, realtime=False)
        monkeypatch.setattr(jobs, "open_backend", lambda *_, **__: nullcontext(choice))
        done = watch(make_request(), is_released=hand.is_done, begin=hand.begin)
    assert done.last is not None
    (finding,) = done.last.findings
    assert "joint 'l_hip' was seen from" in finding
    assert "its zero or its sign is wrong (getup calibrate)" in finding
    assert any("beyond its range" in remark for remark in done.last.joints["l_hip"].remarks)
    assert set(torque) == {0}


def test_a_simulation_that_is_looked_at_is_no_faster_than_real_time(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("humanoid_getup.commands.viewer.has_display", lambda: True)
    monkeypatch.setattr("humanoid_getup.commands.viewer._Window", lambda _: Mock())
    begun = list[float]()
    done = watch(
        WatchRequest(robot=str(TINY), view=True, seconds=0.5),
        begin=lambda _: begun.append(time.monotonic()),
    )
    assert time.monotonic() - begun[0] >= done.watched_s > 0.4


def test_a_fault_ends_it_with_its_exit_code(tiny: Robot, monkeypatch, capsys):
    class Loose(RecordingBackend):
        def read(self) -> Any:
            if len(self.received) > 3:
                raise DriverError("the cable is loose")
            return super().read()

    backend = Loose(tiny)
    choice = BackendChoice(backend=backend, realtime=False)
    monkeypatch.setattr(jobs, "open_backend", lambda *_, **__: nullcontext(choice))
    assert watch.run(make_request()) == 3
    assert "in 4 cycles: the cable is loose" in capsys.readouterr().out
    assert all(command.is_limp for command in backend.received)
    assert not backend.connected


@pytest.mark.parametrize(("silence", "by_fault"), [(2.9, False), (3.1, True)])
def test_a_silence_of_seconds_is_harmless_without_torque(
    silence: float, by_fault: bool, tiny: Robot, monkeypatch: pytest.MonkeyPatch
):
    backend = RecordingBackend(tiny)
    backend.state = replace(backend.state, joint_age=np.array([0.0, silence]), imu_age=silence)
    choice = BackendChoice(backend=backend, realtime=False)
    monkeypatch.setattr(jobs, "open_backend", lambda *_, **__: nullcontext(choice))
    done = watch(WatchRequest(robot=str(TINY), seconds=0.1))
    assert done.by_fault is by_fault
    assert done.last is not None
    assert done.last.joints["r_hip"].remarks == (f"silent for {silence:.1f} s",)


def test_it_is_cancelled():
    with pytest.raises(CancelledError):
        watch(make_request(), cancel=iter([False] * 5 + [True] * 9).__next__)


@pytest.mark.parametrize(
    ("left_out", "backend", "has_torso"),
    [("", "virtual", False), ("", "twin", True), ('imu_site = "imu"\n', "twin", False)],
)
def test_a_robot_without_an_imu_is_watched(
    left_out: str, backend: Any, has_torso: bool, own_robot: Path
):
    path = own_robot / "robot.toml"
    text = path.read_text("utf-8").split("[bus.board]")[0]
    path.write_text(text.replace(left_out, ""), "utf-8")
    done = watch(WatchRequest(robot=str(own_robot), seconds=0.05, backend=backend))
    assert done.last is not None
    assert (done.last.torso is not None) is has_torso


def test_a_servo_that_misses_reads_is_named(tiny: Robot, monkeypatch: pytest.MonkeyPatch):
    class Tired(RecordingBackend):
        def read(self) -> State:
            is_silent = len(self.received) % 4 == 3
            return replace(super().read(), joint_age=np.array([0.0, 0.008 * is_silent]))

    choice = BackendChoice(backend=Tired(tiny), realtime=False)
    monkeypatch.setattr(jobs, "open_backend", lambda *_, **__: nullcontext(choice))
    done = watch(WatchRequest(robot=str(TINY), seconds=0.8))
    assert done.last is not None
    assert [joint.missed for joint in done.last.joints.values()] == [0, 25]
    assert done.last.findings == (
        "joint 'r_hip' did not answer 25 of 100 reads: check its cable and plug (getup doctor)",
    )


# At the terminal -------------------------------------------------------------------------------

LYING = ("watch", "--robot", str(TINY), "--from", "prone")
SHORT = (*LYING, "--seconds", "0.2")


@pytest.mark.parametrize("backend", ["twin", "virtual"])
def test_what_was_seen_is_printed_at_the_end(backend: str, run: Run):
    code, out, _ = run(*SHORT, "--backend", backend)
    text = " ".join(out.split())
    assert code == 0
    assert "tiny: watched for 0.2 s in 25 cycles: 0.2 s were up" in text
    assert "torque off, 12.0 V torso on its belly: pitch +8" in text
    assert "l_hip" in out
    assert "-90 to +60" in out, "the range of its joints"
    assert text.endswith("backward"), "which way is positive"


@pytest.mark.parametrize(("sent", "is_over"), [(b"x", False), (b"q", True), (b"Q", True)])
def test_only_q_ends_it(sent: bytes, is_over: bool):
    master, slave = pty.openpty()
    key, noted = QuitKey(slave), list[bytes]()
    note = key._on_press
    key._on_press = lambda pressed: (note(pressed), noted.append(pressed))[0]
    with key:
        os.write(master, sent)
        wait_until(lambda: noted == [sent])
        assert key.is_pressed() is is_over
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize("end", ["q", "interrupt", "hang-up"])
def test_in_a_terminal_a_table_follows_the_robot_until_a_person_ends_it(end: str, tmp_path: Path):
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "humanoid_getup.commands.main", *LYING]
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "120", "LINES": "40"}
    with subprocess.Popen(
        command, stdin=slave, stdout=slave, stderr=slave, env=environment, cwd=tmp_path
    ) as watching:
        os.close(slave)
        assert "q ends it" in _read(master, "torso on its belly")
        if end == "hang-up":
            os.close(master)
            watching.wait(LONGEST_WAIT)
            return
        if end == "q":
            os.write(master, b"q")
        else:
            watching.send_signal(signal.SIGINT)
        shown = _read(master)
        reason = "a person ended it" if end == "q" else "it was interrupted"
        assert reason in shown
        os.close(master)
        assert watching.wait(LONGEST_WAIT) == 0


def _read(terminal: int, until: str | None = None) -> str:
    """Read what a program shows until it shows a text, or to its end."""
    shown = ""
    while until is None or until not in shown:
        try:
            shown += os.read(terminal, 65536).decode(errors="replace")
        except OSError:  # of a terminal that no program has
            return shown
    return shown
