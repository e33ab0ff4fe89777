"""`getup watch`: a limp robot is read and never driven, whoever turns it, until q or Ctrl-C."""

import os
import pty
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
from terminal import in_terminal
from waiting import wait_until

from drivers import DriverError, State
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.virtual_bus.devices.servo import VirtualServo
from humanoid_getup.commands.backends import BackendChoice
from humanoid_getup.commands.prompt import QuitKey
from humanoid_getup.commands.robot import watch as jobs
from humanoid_getup.commands.robot.watch import WatchRequest, watch
from humanoid_getup.reporting.watched_robot import WatchedRobot, WatchFigures
from robots import Posture, Robot, quaternion

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
def watching(monkeypatch: pytest.MonkeyPatch) -> Callable[[RecordingBackend], None]:
    """Let the command open a backend of the test."""

    def use(backend: Any) -> None:
        choice = BackendChoice(backend=backend, realtime=False)
        monkeypatch.setattr(jobs, "open_backend", lambda *_, **__: nullcontext(choice))

    return use


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
    tiny: Robot, torque: list[int], watching
):
    left, right = tiny.joints
    turned = replace(left, servo=replace(left.servo, sign=-left.servo.sign))
    with serving(replace(tiny, joints=(turned, right))) as served:
        hand = Hand(tiny)
        hand.place = lambda posture: served.hold(posture.joint_pos)
        hand.hold(degrees=(-85.0, 20.0))  # measured as +85, of a range up to +60
        watching(DynamixelBackend(tiny, served.path, clock=CycleClock()))
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


def test_a_fault_ends_it_with_its_exit_code(tiny: Robot, watching, capsys):
    class Loose(RecordingBackend):
        def read(self) -> Any:
            if len(self.received) > 3:
                raise DriverError("the cable is loose")
            return super().read()

    backend = Loose(tiny)
    watching(backend)
    assert watch.run(make_request()) == 3
    assert "in 4 cycles: the cable is loose" in capsys.readouterr().out
    assert all(command.is_limp for command in backend.received)
    assert not backend.connected


@pytest.mark.parametrize(("silence", "by_fault"), [(2.9, False), (3.1, True)])
def test_a_silence_of_seconds_is_harmless_without_torque(
    silence: float, by_fault: bool, tiny: Robot, watching
):
    backend = RecordingBackend(tiny)
    backend.state = replace(backend.state, joint_age=np.array([0.0, silence]), imu_age=silence)
    watching(backend)
    done = watch(WatchRequest(robot=str(TINY), seconds=0.1))
    assert done.by_fault is by_fault
    assert done.last is not None
    assert done.last.joints["r_hip"].remarks == (f"silent for {silence:.1f} s",)


def test_a_robot_without_an_imu_is_watched(own_robot: Path):
    path = own_robot / "robot.toml"
    text = path.read_text("utf-8").split("[bus.board]")[0]
    on_bus = WatchRequest(robot=str(own_robot), seconds=0.05, backend="virtual")
    for request, left_out, has_torso in (
        (on_bus, "", False),
        (replace(on_bus, backend="twin"), "", True),
        (replace(on_bus, backend="twin"), 'imu_site = "imu"\n', False),
    ):
        path.write_text(text.replace(left_out, ""), "utf-8")
        done = watch(request)
        assert done.last is not None
        assert (done.last.torso is not None) is has_torso


def test_a_servo_that_misses_reads_is_named(tiny: Robot, watching):
    class Tired(RecordingBackend):
        def read(self) -> State:
            is_silent = len(self.received) % 4 == 3
            return replace(super().read(), joint_age=np.array([0.0, 0.008 * is_silent]))

    watching(Tired(tiny))
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


def test_q_or_the_end_of_the_terminal_ends_it_and_no_other_key():
    master, slave = pty.openpty()
    for sent in (b"x", b"q", b"Q", b""):
        key, noted = QuitKey(slave), list[bytes]()
        note = key._on_press
        key._on_press = lambda pressed, note=note, noted=noted: noted.append(note(pressed))
        with key:
            os.write(master, sent) if sent else os.close(master)
            wait_until(lambda noted=noted: noted != [])
            assert key.is_pressed() is (sent != b"x")
    os.close(slave)


@pytest.mark.parametrize("end", ["interrupt", pytest.param("q", marks=pytest.mark.slow)])
def test_in_a_terminal_a_table_follows_the_robot_until_a_person_ends_it(end: str):
    with in_terminal(*LYING) as terminal:
        terminal.see("torso on its belly")
        terminal.see("q ends it")
        if end == "q":
            terminal.type("q")
        else:
            terminal.interrupt()
        terminal.see("a person ended it" if end == "q" else "it was interrupted")
        assert terminal.wait() == 0
