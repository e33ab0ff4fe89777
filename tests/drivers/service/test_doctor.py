"""The health of a robot, measured in memory: no wire, no clock of the machine."""

import math

import numpy as np
import pytest
from service_bench import ServiceBench

from drivers.dynamixel.diagnostics import Severity
from drivers.imu.source import ImuSample
from drivers.service.doctor import HealthCheck, examine, measure_rate
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots import Robot


@pytest.fixture(autouse=True)
def _on_a_busy_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the machine takes to answer itself is no finding."""
    monkeypatch.setattr("drivers.service.doctor.READ_SHARE", 1000.0)


def check(bench: ServiceBench) -> HealthCheck:
    with bench.open() as bus:
        return examine(bus, rounds=3)


def texts(health: HealthCheck, device: str) -> list[tuple[Severity, str]]:
    """List the findings of a device whose name begins so."""
    found = [f for f in health.findings if f.device.startswith(device)]
    return [(finding.severity, finding.text) for finding in found]


def test_a_sound_robot_has_nothing_but_the_settings_that_the_driver_makes(tiny: Robot):
    health = check(ServiceBench(tiny))
    assert health.errors == ()
    assert {finding.text for finding in health.warnings} == {
        "no calibration: zeros and signs are those of the description",
        "return delay time is 250, 500 µs before each reply",
        "operating mode is 3",
    }
    assert [servo.joint.name for servo in health.servos] == ["l_hip", "r_hip"]
    assert (health.torque, health.written) == ((), ())
    assert health.imu is not None and health.imu.accelerometer[2] == pytest.approx(9.81, abs=0.01)
    assert health.imu_rate is None, "a board is read with the servos"


def test_the_bytes_of_a_cycle_are_counted_by_hand(tiny: Robot):
    (report,) = check(ServiceBench(tiny)).ports
    # Fast sync read of two servos: 10 + 4 + 2 sent, 8 + 2 (10 + 4) received. Bulk read of board
    # and servo: 10 + 2 x 5 sent, twice 11 and the board's 12 and the servo's 3 received. Goals:
    # 10 + 4 + 2 x 5.
    assert report.cycle_bytes == 16 + 36 + 20 + 37 + 24
    assert report.cycle_time == pytest.approx(report.cycle_bytes * 10 / 1_000_000)
    assert report.latency is not None
    assert (report.latency.kind, report.latency.rounds) == ("fast sync read", 3)
    assert (report.latency.lost, report.latency.damaged) == (0, 0)
    assert report.latency.group_median <= report.latency.reading_median


@pytest.mark.parametrize(("firmware", "delays"), [(46, 2), (40, 3)])
def test_the_return_delays_of_a_cycle_are_counted_by_hand(tiny: Robot, firmware: int, delays: int):
    """As shipped 0.5 ms: of the first servo of a fast read or of both, and in the background."""
    bench = ServiceBench(tiny)
    bench.virtual = VirtualRobot(Simulation(tiny), firmware=firmware, powered=True)
    (report,) = check(bench).ports
    assert report.latency is not None
    assert report.latency.return_delays == pytest.approx(delays * 0.0005)


def test_heat_is_judged_by_the_type_of_a_servo_or_the_limit_inside_it_if_that_is_lower(tiny: Robot):
    for limit, degrees, severity in (
        (None, 65.0, []), (None, 66.0, [Severity.WARNING]), (None, 75.0, [Severity.WARNING]),
        (None, 76.0, [Severity.FAULT]), (60, 46.0, [Severity.WARNING]),
        (60, 56.0, [Severity.FAULT]), (95, 66.0, [Severity.WARNING]), (95, 76.0, [Severity.FAULT]),
    ):  # fmt: skip
        bench = ServiceBench(tiny)
        if limit is not None:
            bench.servo("l_hip").poke("temperature_limit", limit)
        bench.virtual.physics.heat(1, degrees)
        found = texts(check(bench), "joint 'l_hip'")
        assert [s for s, text in found if text.startswith("has ")] == severity, (limit, degrees)


def test_torque_is_named_and_stays(tiny: Robot):
    bench = ServiceBench(tiny)
    bench.servo("l_hip").write(64, b"\x01")
    health = check(bench)
    assert (Severity.WARNING, "has torque") in texts(health, "joint 'l_hip' (id 1)")
    assert [joint.name for joint in health.torque] == ["l_hip"]
    assert bench.servo("l_hip").peek("torque_enable") == 1


def test_faults_come_before_warnings_and_errors_before_both(tiny: Robot):
    bench = ServiceBench(tiny)
    bench.virtual.physics.heat(2, 78.0)
    bench.servo("l_hip").poke("drive_mode", 1)
    order = [list(Severity).index(finding.severity) for finding in check(bench).findings]
    assert order == sorted(order) and set(order) == {0, 1, 2}


def test_an_imu_that_is_shaken_is_a_warning(tiny: Robot):
    bench = ServiceBench(tiny)
    bench.virtual.board.frozen = True
    bench.virtual.board.registers["acc_z"] = 8192
    text = "the accelerometer shows 4.9 m/s², expected at rest 7.8 to 11.8 m/s²"
    assert texts(check(bench), "IMU") == [(Severity.WARNING, text)]


class Counting:
    """An IMU that has a sample at every third look, and the clock of who looks."""

    def __init__(self) -> None:
        self.now, self.looks = 0.0, 0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration

    def request(self, now: float) -> None:
        assert now == self.now

    def poll(self) -> ImuSample | None:
        self.looks += 1
        return None if self.looks % 3 else ImuSample(np.zeros(3), np.zeros(3), b"")


def test_the_rate_of_an_imu_is_its_samples_over_the_time(monkeypatch):
    imu = Counting()
    monkeypatch.setattr("drivers.service.doctor.time", imu)
    rate = measure_rate(imu)  # type: ignore[arg-type]
    assert imu.now == pytest.approx(0.5, abs=0.003)
    assert rate == math.floor(imu.looks / 3) / 0.5
