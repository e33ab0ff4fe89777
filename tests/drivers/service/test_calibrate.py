"""Zeros and signs of servos, measured while a person holds and turns the robot."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paths import TINY
from service_bench import ServiceBench
from tiny_robots import with_types

from drivers.errors import DriverError, SetupError
from drivers.imu.fusion import GRAVITY
from drivers.imu.source import ImuSample
from drivers.service import calibrate
from drivers.service.calibrate import AXES, Calibrator, JointMeasurement
from drivers.virtual_bus.devices.sensors import Measured
from robots import ImuSettings, Joint, Robot, load_robot, quaternion
from robots.description.calibration import Calibration
from robots.imu import SensorAxes
from robots.kinematics import imu_in_torso


@pytest.fixture(autouse=True)
def _without_pauses(monkeypatch):
    monkeypatch.setattr(calibrate, "PAUSE", 0.0)


@pytest.fixture
def bench(tiny: Robot) -> ServiceBench:
    return ServiceBench(tiny)


def turn(bench: ServiceBench, joint: str, ticks: float) -> None:
    bench.servo(joint).sense(Measured(ticks=ticks))


def test_positions_are_those_of_the_registers_and_zeros_follow_from_them(bench: ServiceBench):
    with bench.open() as bus:
        turn(bench, "l_hip", 1234.0)
        turn(bench, "r_hip", 3000.0)
        assert calibrate.read_ticks(bus, bus.robot.actuators) == {"l_hip": 1234, "r_hip": 3000}
        assert calibrate.read_ticks(bus, bus.robot.actuators[1:]) == {"r_hip": 3000}
        # A quarter turn is 1024 ticks, in the direction of the sign.
        calibrator = Calibrator(bus, bus.robot.actuators)
        calibrator.measure_zeros(np.array([np.pi / 2, np.pi / 2]))
        for measured, ticks in zip(calibrator.measured, (1234, 3000), strict=True):
            assert measured.zero_ticks == ticks - measured.joint.servo.sign * 1024
        bench.servo("r_hip").alive = False
        bench.port.sent.clear()
        with pytest.raises(SetupError, match=r"joint 'r_hip' \(id 2\): silent"):
            calibrate.read_ticks(bus, bus.robot.actuators)
        assert len(bench.port.sent) == 3, "so many tries"


def shaking(bench: ServiceBench, ticks: list[int]) -> Callable:
    coming = iter(ticks * 20)

    def spoil(_packet, replies):
        turn(bench, "l_hip", next(coming))
        return replies

    return spoil


def test_of_small_movements_the_median_counts_and_large_ones_are_refused(bench: ServiceBench):
    with bench.open() as bus:
        turn(bench, "l_hip", 2000)
        bench.port.spoil = shaking(bench, [2000, 2001, 2004, 2000])
        assert calibrate.measure_ticks(bus, bus.robot.actuators[:1]) == {"l_hip": 2000}
        bench.port.spoil = shaking(bench, [2000, 2005])
        with pytest.raises(SetupError, match=r"joint 'l_hip' by 0\.4°, expected at most 0\.4°"):
            calibrate.measure_ticks(bus, bus.robot.actuators)


class Person:
    """Turns a joint by some ticks when asked to, then gives answers."""

    def __init__(self, bench: ServiceBench, turns: list[tuple[str, float]], *answers: str) -> None:
        self._bench, self._turns, self._answers = bench, turns, list(answers)

    def tell(self, text: str) -> None: ...

    def ask(self, question: str) -> str:
        if "Enter" in question and self._turns:
            name, ticks = self._turns.pop(0)
            now = self._bench.servo(name).peek("present_position")
            turn(self._bench, name, now + ticks)
        return self._answers.pop(0) if self._answers else ""


@pytest.mark.parametrize("start", [2048.0, 4000.0])
def test_a_sign_is_the_direction_of_the_turn_also_through_the_end_of_it(bench, start: float):
    with bench.open() as bus:
        joint = bus.robot.actuators[0]
        turn(bench, "l_hip", start)
        person = Person(bench, [("l_hip", joint.servo.sign * 230.0)])
        calibrator = Calibrator(bus, [joint])
        calibrator.check_signs(person)
        assert calibrator.measured[0].sign == joint.servo.sign
        assert not calibrator.measured[0].is_reversed
        against = ("l_hip", -joint.servo.sign * 230.0)
        calibrator.check_signs(Person(bench, [against, against], "", "no", "", "yes"))
        assert calibrator.measured[0].sign == -joint.servo.sign, "a person accepts it"
        assert calibrator.measured[0].warnings[-1].startswith("it turns the other way")


def measured(joint: Joint, zero: int) -> JointMeasurement:
    return JointMeasurement(joint, zero, joint.servo.sign)


def test_a_range_that_no_zero_fits_into_one_turn_is_saved_with_a_warning(tiny: Robot, tmp_path):
    """Half a turn to each side has 4097 ticks, and a turn 4096, of a servo that counts no turns."""
    joint, other = with_types(tiny, "STS3215-C018").joints
    wide = replace(joint, lower=-math.pi, upper=math.pi)
    narrow = replace(wide, upper=math.pi - 0.002)
    calibrate.save(tiny, [measured(wide, 2048)], tmp_path / "calibration.toml")
    (warning,) = measured(wide, 2048).warnings
    assert "needs ticks 0 to 4096, beyond one turn of its servo: programs that do not" in warning
    assert measured(narrow, 2048).warnings == []
    with pytest.raises(DriverError, match="zero 2060 needs ticks 12 to 41"):
        calibrate.check_ranges([measured(narrow, 2060)])
    calibrate.check_ranges([measured(tiny.joints[1], 100)])
    with pytest.raises(DriverError, match=r"joint 'r_hip' .*: zero 100 needs ticks -"):
        calibrate.check_ranges([measured(joint, 2048), measured(other, 100)])


def test_joints_that_were_not_measured_keep_their_calibration(tiny: Robot, tmp_path):
    file = tmp_path / "calibration.toml"
    calibrate.save(tiny, [measured(joint, 2040 + i) for i, joint in enumerate(tiny.joints)], file)
    calibrate.save(tiny, [measured(tiny.joints[1], 2060)], file)
    zeros = {name: j.zero_ticks for name, j in Calibration.load(file, tiny).joints.items()}
    assert zeros == {"l_hip": 2040, "r_hip": 2060}
    joint = replace(tiny.joints[0], servo=replace(tiny.joints[0].servo, zero_ticks=2048))
    assert measured(joint, 2048 + 113).warnings == []  # 9.9 degrees
    (warning,) = measured(joint, 2048 + 115).warnings
    assert warning.startswith("its zero moves by +10.1°, more than 10°")


# The IMU --------------------------------------------------------------------------------------

TINY_ROBOT = load_robot(TINY)
MOUNTING = imu_in_torso(TINY_ROBOT, TINY_ROBOT.read_model().compile())


class MountedImu:
    """An IMU whose axes are some, and described as others, in a torso that is held still."""

    name = "IMU"

    def __init__(self, orientation: np.ndarray, own: tuple, described: tuple) -> None:
        up = -quaternion.gravity_in_body(quaternion.multiply(orientation, MOUNTING))
        raw = SensorAxes.of(own).to_sensor(GRAVITY * up)
        self.force = SensorAxes.of(described).to_site(raw)

    def measure(self) -> ImuSample | None:
        return ImuSample(np.zeros(3), self.force, b"")


@settings(max_examples=30)
@given(
    turn=st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1),
    own=st.sampled_from(AXES),
    described=st.sampled_from(AXES),
)
def test_gravity_is_that_of_the_posture_or_the_right_axes_are_among_those_named(
    turn: tuple, own: tuple, described: tuple
):
    assert len({SensorAxes.of(axes).matrix.tobytes() for axes in AXES}) == len(AXES) == 24
    orientation = quaternion.normalize(np.array(turn))
    imu = MountedImu(orientation, own, described)
    robot = replace(TINY_ROBOT, imu=ImuSettings(kind="serial_line", axes=described))
    up = MountedImu(orientation, own, own).force / GRAVITY
    try:
        calibrate.check_tilt(robot, imu, orientation)  # type: ignore[arg-type]
    except SetupError as error:
        assert up @ imu.force < GRAVITY * math.cos(math.radians(19.9))
        assert str(list(own)).replace("'", '"') in str(error)
    else:
        assert up @ imu.force > GRAVITY * math.cos(math.radians(20.1))
