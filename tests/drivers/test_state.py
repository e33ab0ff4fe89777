"""A measurement is sound or not; without an IMU it holds no orientation, not a made-up one."""

from dataclasses import replace

import numpy as np
import pytest
from recording_backend import RecordingBackend, still_state

from drivers import Command, FaultKind, SafetyGuard

NOTHING = np.zeros(0)


def test_a_measurement_without_an_imu_is_sound_and_says_so(tiny):
    state = still_state(tiny, gyro=NOTHING, orientation=NOTHING)
    assert state.is_valid
    assert not state.has_imu
    assert still_state(tiny).has_imu


@pytest.mark.parametrize(
    "changes",
    [
        {"orientation": np.full(4, np.nan)},  # a broken IMU is not a missing one
        {"orientation": np.zeros(4)},
        {"gyro": np.full(3, np.nan)},
        {"orientation": NOTHING},  # a turn rate, but no orientation
        {"gyro": NOTHING, "orientation": NOTHING, "joint_pos": np.array([np.nan, 0.0])},
    ],
)
def test_a_measurement_that_is_broken_is_not_sound_and_the_guard_switches_torque_off(tiny, changes):
    state = still_state(tiny, **changes)
    assert not state.is_valid
    backend = RecordingBackend(tiny)
    guard = SafetyGuard(backend)
    with guard:
        backend.state = replace(state, time=1.0)
        guard.read()
        guard.write(Command.position(tiny, np.zeros(2)))
        assert guard.fault is not None
        assert guard.fault.kind is FaultKind.BAD_MEASUREMENT
    assert backend.received[-1].is_limp
