"""A limp robot is moved by hand; keys of the terminal take its postures."""

import os
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from recording_backend import RecordingBackend, still_state

from drivers import Ending, SafetyGuard, run
from humanoid_getup.commands.motions.record_motion import HandRecorder, Press, open_presses

TAKE, UNDO, FINISH, LEAVE = Press.TAKE, Press.UNDO, Press.FINISH, Press.LEAVE


class Script:
    def __init__(self, *presses: Press | None) -> None:
        self.left = deque(presses)

    def poll(self) -> Press | None:
        return self.left.popleft() if self.left else None


@pytest.mark.parametrize(
    ("presses", "count", "done", "is_kept"),
    [
        ((TAKE, TAKE, None, TAKE, FINISH, TAKE), 3, True, True),
        ((TAKE, TAKE, UNDO, FINISH), 1, True, True),
        ((UNDO, FINISH), 0, True, True),
        ((TAKE, LEAVE), 1, True, False),
        ((TAKE,), 1, False, True),
    ],
)
def test_each_key_does_what_it_says(presses, count, done, is_kept, tiny):
    message: list[int] = []
    recorder = HandRecorder(tiny, Script(*presses).poll, message.append)
    backend = RecordingBackend(tiny)
    report = run(recorder, SafetyGuard(backend), max_time=0.1)
    assert (len(recorder.keys), recorder.done, recorder.is_kept) == (count, done, is_kept)
    assert report.ending is (Ending.DONE if done else Ending.TIMEOUT)
    assert message[-1] == count


def test_the_robot_stays_limp_throughout(tiny):
    backend = RecordingBackend(tiny)
    run(HandRecorder(tiny, Script(TAKE).poll), SafetyGuard(backend), max_time=0.1)
    assert len(backend.received) > 5
    assert all(command.is_limp for command in backend.received)


def test_a_key_waits_for_a_fresh_measurement(tiny):
    recorder, fresh = HandRecorder(tiny, Script(TAKE).poll), still_state(tiny)
    recorder.step(replace(fresh, joint_age=np.array([0.0, 0.2])))
    assert recorder.keys == []
    recorder.step(fresh)
    assert len(recorder.keys) == 1


def await_press(poll: Callable[[], Press | None]) -> Press:
    for _ in range(2500):
        if press := poll():
            return press
        time.sleep(0.002)
    raise AssertionError("no press")


def test_a_terminals_keys_are_presses():
    master, slave = os.openpty()
    with open_presses(slave) as poll:
        found = []
        for sent in (b"\n", b" ", b"\x7f", b"q"):
            os.write(master, sent)
            found.append(await_press(poll))
        assert poll() is None
        os.close(master)
        found.append(await_press(poll))
    assert found == [TAKE, TAKE, UNDO, FINISH, LEAVE]
    os.close(slave)
