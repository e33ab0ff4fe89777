"""Monitors, measurement by measurement: what is borne, what ends a run, and what it says."""

from types import SimpleNamespace

import numpy as np
import pytest
from recording_backend import still_state

from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.monitors import (
    AbortKind,
    MonitorLimits,
    MotionMonitor,
    ServoMonitor,
)
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion

STALL = 2.3  # A of an XM430 at 12 V (e-manual)


@pytest.fixture
def monitor(tiny) -> ServoMonitor:
    monitor = ServoMonitor(tiny, MonitorLimits())
    monitor.reset(still_state(tiny, time=1.0))
    return monitor


def look(monitor: ServoMonitor, tiny, **changes):
    return monitor.check(still_state(tiny, **changes), np.zeros(2))


@pytest.mark.parametrize(("sign", "voltage"), [(1.0, 12.0), (-1.0, 10.5)])
def test_a_load_beyond_nine_tenths_of_stall_is_borne_for_four_seconds(tiny, monitor, sign, voltage):
    """The stall current falls with the supply; the time counts from the run's begin."""
    current = np.array([0.0, sign * 0.91 * STALL * voltage / 12.0])
    for time in (2.0, 4.9, 5.0):
        assert look(monitor, tiny, time=time, joint_current=current, voltage=voltage) is None
    kind, detail = look(monitor, tiny, time=5.01, joint_current=current, voltage=voltage)
    assert kind is AbortKind.LOAD
    assert detail == ("joint 'r_hip' draws 91% of its stall current, expected at most 90% for 4 s")


def test_a_load_just_below_or_with_a_break_is_borne_for_ever(tiny, monitor):
    below, above = np.full(2, 0.89 * STALL), np.full(2, 0.95 * STALL)
    assert look(monitor, tiny, time=100.0, joint_current=below) is None
    for time in np.arange(101.0, 120.0, 3.0):
        assert look(monitor, tiny, time=time, joint_current=above) is None
        assert look(monitor, tiny, time=time + 1.0, joint_current=below) is None


@pytest.mark.parametrize(("temperature", "is_hot"), [(72.0, False), (72.5, True)])
def test_a_servo_beyond_72_degrees_ends_it_at_once(tiny, monitor, temperature, is_hot):
    found = look(monitor, tiny, time=1.1, temperature=np.array([temperature, 30.0]))
    if is_hot:
        expected = "joint 'l_hip' has 72 °C, expected at most 72 °C"
        assert found == (AbortKind.HEAT, expected)
    else:
        assert found is None


def test_a_low_supply_is_warned_of_once_a_run(tiny, monitor):
    look(monitor, tiny, time=1.1, voltage=10.0)
    assert monitor.warnings == []
    for voltage in (9.9, 9.5):
        assert look(monitor, tiny, time=1.2, voltage=voltage) is None
    assert monitor.warnings == [
        "the supply sagged to 9.9 V, the servos need 10.0 V: charge the battery"
    ]
    monitor.reset(still_state(tiny, time=2.0))
    assert monitor.warnings == []


# A motion, and where a robot is in it -------------------------------------------------------------

APPROACH = 0.5  # s until the player is at the first targets
ON_FACE = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.pi / 2)
TIMES, ROLLED, BENT = [0.0, 2.0, 4.0], [0.0, np.pi / 2, np.pi], [0.0, 1.2, -0.4]


def roll(angle: float) -> np.ndarray:
    """Roll a robot that lies on its face about its spine [rad]."""
    about_spine = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), angle)
    return quaternion.multiply(ON_FACE, about_spine)


@pytest.fixture(scope="module")
def rolling(tiny: Robot) -> MotionMonitor:
    """Rolls over in four seconds and bends the left hip meanwhile; its clock begins at 3 s."""
    return monitor_of(tiny, [roll(angle) for angle in ROLLED])


def monitor_of(tiny: Robot, orientations: list[np.ndarray]) -> MotionMonitor:
    angles = np.stack([BENT, np.zeros(3)], axis=1)
    motion = Motion(
        name="roll",
        robot=tiny.name,
        start_class="prone",
        end_class="supine",
        strategy="roll",
        time=np.array(TIMES) + 3.0,
        position=np.zeros((3, 3)),
        orientation=np.array(orientations),
        joint_pos=angles,
        joint_target=angles,
    )
    player = SimpleNamespace(approach_time=APPROACH)
    return MotionMonitor(World(tiny), motion, player)  # type: ignore[arg-type]


def rolled(time: float) -> float:
    """Return how far the torso has rolled [rad]: gravity goes straight from one sample's on."""
    share = np.clip(time - APPROACH, 0.0, 4.0) / 2.0
    quarter = min(int(share), 1)
    return quarter * np.pi / 2 + float(np.arctan2(share - quarter, 1.0 - (share - quarter)))


def follow(monitor: MotionMonitor, tiny: Robot, *, off: float = 0.0, behind: float = 0.0):
    """Roll as the motion does but for an angle, the hip behind it; return when it ends, and why."""
    monitor.reset(still_state(tiny, time=7.0))
    for time in np.arange(0.0, 6.0, 0.02):
        hip = np.interp(time - APPROACH, TIMES, BENT) - behind
        state = still_state(
            tiny,
            time=7.0 + time,
            orientation=roll(rolled(time) + off),
            joint_pos=np.array([hip, 0.0]),
        )
        # The servo's target is far from the joint all the time.
        if found := monitor.check(state, np.array([hip + 3.0, 0.0])):
            return time, found
    return None


@pytest.mark.parametrize("off", [np.radians(59.0), -np.radians(59.0)])
def test_a_robot_that_is_about_where_the_motion_is_is_let_go_on(rolling, tiny, off: float):
    assert follow(rolling, tiny, off=off, behind=0.39) is None


@pytest.mark.parametrize("off", [np.radians(61.0), -np.radians(61.0)])
def test_a_robot_that_rolls_otherwise_for_a_second_is_not(rolling, tiny, off: float):
    time, (kind, detail) = follow(rolling, tiny, off=off)
    assert time == pytest.approx(1.0, abs=0.03)
    assert kind is AbortKind.TILT
    assert detail == "61° off, expected at most 60° for 1 s"


@pytest.mark.parametrize("behind", [0.41, -0.41])
def test_a_joint_that_stays_behind_the_motion_for_a_second_is_stuck(rolling, tiny, behind: float):
    time, (kind, detail) = follow(rolling, tiny, behind=behind)
    assert time == pytest.approx(1.0, abs=0.03)
    assert kind is AbortKind.STUCK
    assert detail.startswith("joint 'l_hip' is 0.41 rad from where it should be, expected at most")


@pytest.mark.parametrize("stands", [True, False])
def test_without_an_imu_a_joint_is_stuck_only_where_the_motion_does_not_stand(tiny, stands: bool):
    orientations = [quaternion.IDENTITY] * 3 if stands else [roll(angle) for angle in ROLLED]
    monitor = monitor_of(tiny, orientations)
    monitor.reset(still_state(tiny, time=7.0))
    found = [
        monitor.check(
            still_state(tiny, time=7.0 + time, orientation=np.zeros(0), joint_pos=np.full(2, -1.5)),
            np.full(2, 1.5),
        )
        for time in np.arange(0.0, 2.0, 0.02)
    ]
    kinds = {each[0] for each in found if each is not None}
    assert kinds == (set() if stands else {AbortKind.STUCK})
