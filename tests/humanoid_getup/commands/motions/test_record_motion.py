"""`getup motions record`: a person moves a limp robot from key to key."""

from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_getup import Run

from drivers import DriverError
from humanoid_getup.commands.motions import record_motion
from humanoid_getup.commands.motions.record_motion import Press, RecordMotion
from humanoid_getup.motions.keyframes_file import KEYFRAMES, load_keyframes
from robots import Robot, load_robot


class Hand:
    """Moves a simulated robot, and presses a key some cycles later."""

    place: Any

    def __init__(self, robot: Robot, postures: list[np.ndarray], last: Press | None) -> None:
        self._robot, self._postures, self._last, self._calls = robot, postures, last, 0

    def poll(self) -> Press | None:
        number, cycle = divmod(self._calls, 4)
        self._calls += 1
        if number == len(self._postures):
            if self._last is None:
                raise DriverError("the cable is loose")
            return self._last
        if cycle == 0:
            self.place(replace(self._robot.standing, joint_pos=self._postures[number]))
        return Press.TAKE if cycle == 2 else None


@pytest.fixture
def record(run: Run, own_robot: Path, monkeypatch: pytest.MonkeyPatch):
    """Record the smallest robot in simulated time; return exit code and output."""
    open_backend = record_motion.open_backend

    def record(
        postures: list[np.ndarray], backend: str = "twin", last: Press | None = Press.FINISH
    ) -> tuple[int, str]:
        hand = Hand(load_robot(own_robot), postures, last)

        @contextmanager
        def open_unpaced(options: RecordMotion, *rest: Any):
            assert options.realtime  # a person takes time
            is_paced = options.backend == "virtual"
            with open_backend(replace(options, realtime=is_paced), *rest) as choice:
                hand.place = choice.place
                yield choice

        monkeypatch.setattr(record_motion, "open_backend", open_unpaced)
        monkeypatch.setattr(record_motion, "open_presses", lambda: nullcontext(hand.poll))
        wanted = ("--robot", str(own_robot), "--start", "squat", "--backend", backend)
        code, out, _ = run("motions", "record", "bow", *wanted)
        return code, " ".join(out.split())

    return record


@pytest.mark.parametrize(
    ("backend", "degrees"),
    # On the bus, simulated time goes on by itself while no goals are sent.
    [("twin", 2.0), pytest.param("virtual", 8.0, marks=(pytest.mark.realtime, pytest.mark.slow))],
)
def test_a_robot_moved_by_hand_is_recorded(backend, degrees, record, own_robot: Path):
    postures = [np.radians(angles) for angles in ([0.0, 0.0], [-60.0, -60.0], [-30.0, -30.0])]
    code, out = record(postures, backend)
    assert code == 0, out
    assert "bow: 4 keys" in out
    (read,) = load_keyframes(own_robot / KEYFRAMES, load_robot(own_robot))
    assert read.start_class == "squat"
    # Limp legs fall a little in the cycles before the key is pressed.
    taken = [*np.degrees(postures), [0.0, 0.0]]
    np.testing.assert_allclose(np.degrees(read.keys), taken, atol=degrees)
    # Times are those of the ways, at 1.5 rad/s.
    ways = np.array([np.pi / 3, np.pi / 6, np.pi / 6])
    assert read.duration == pytest.approx(ways / 1.5, abs=0.1)


def test_a_fault_keeps_the_keys_that_were_taken(record, own_robot: Path):
    code, out = record([np.zeros(2), np.radians([-30.0, -30.0])], last=None)
    assert code == 3
    assert "the cable is loose" in out
    (read,) = load_keyframes(own_robot / KEYFRAMES, load_robot(own_robot))
    assert len(read.keys) == 3
