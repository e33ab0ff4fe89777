"""A robot's buses opened for service, and its health: no wire, no clock of the machine."""

from dataclasses import replace

import pytest
from service_bench import ServiceBench
from tiny_robots import with_servos

from drivers.dynamixel.diagnostics import DiagnosticsError, Severity
from drivers.dynamixel.protocol2 import Instruction
from drivers.service.doctor import HealthCheck, examine
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
    # As shipped 0.5 ms: of the first servo of a fast read or of both, and in the background.
    for firmware, delays in ((46, 2), (40, 3)):
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


def test_findings_come_by_severity_and_an_imu_that_is_shaken_is_a_warning(tiny: Robot):
    bench = ServiceBench(tiny)
    bench.virtual.board.frozen = True
    bench.virtual.board.registers["acc_z"] = 8192
    text = "the accelerometer shows 4.9 m/s², expected at rest 7.8 to 11.8 m/s²"
    bench.virtual.physics.heat(2, 78.0)
    bench.servo("l_hip").poke("drive_mode", 1)
    health = check(bench)
    assert texts(health, "IMU") == [(Severity.WARNING, text)]
    order = [list(Severity).index(finding.severity) for finding in health.findings]
    assert order == sorted(order) and set(order) == {0, 1, 2}, "faults first, then errors"


# What a session writes at the start, and what stays as it is -------------------------------------


def test_servos_without_power_get_it_and_nothing_else_is_written(tiny: Robot):
    bench = ServiceBench(tiny, powered=False)
    with bench.open() as bus:
        assert all(servo.powered for servo in bench.virtual.servos)
        assert len(bus.written) == 1
        assert bus.written[0].startswith("the servos' power was off: switched on at the board")
        assert [packet.id for packet in bench.port.frames(Instruction.WRITE)] == [bus.board.id]
        assert bus.findings == []
    assert not bench.port.is_open


def test_torque_stays_until_it_is_released_and_a_servo_that_keeps_it_is_named(tiny: Robot):
    bench = ServiceBench(tiny)
    bench.servo("r_hip").write(64, b"\x01")
    with bench.open() as bus:
        assert [joint.name for joint in bus.find_torque()] == ["r_hip"]
        assert bus.written == []
        bench.port.spoil = lambda packet, replies: (
            [] if packet.instruction == Instruction.WRITE else replies
        )
        with pytest.raises(DiagnosticsError, match=r"'r_hip' .*does not confirm torque"):
            bus.release()
        bench.servo("r_hip").poke("torque_enable", 1)
        bench.port.spoil = lambda _, replies: replies
        bus.release()
        assert bus.find_torque() == ()
    assert bench.servo("r_hip").peek("torque_enable") == 0


def test_a_servo_that_answers_pings_alone_is_made_to_answer_reads(tiny: Robot):
    bench = ServiceBench(tiny)
    bench.servo("l_hip").poke("status_return_level", 0)
    with bench.open() as bus:
        assert bench.servo("l_hip").peek("status_return_level") == 2
        assert len(bus.written) == 1 and "joint 'l_hip' (id 1) ignored reads" in bus.written[0]
        assert bus.diagnose().errors == () and len(bus.diagnose().servos) == 2
        (found,) = bus.diagnose((bus.robot.actuators[1],)).servos
        assert found.joint.name == "r_hip"


def test_a_robot_with_a_silent_board_without_imu_or_with_an_id_twice_has_findings(tiny: Robot):
    twice = replace(with_servos(tiny, {"id": 1}), bus=replace(tiny.bus, board=None))
    with ServiceBench(twice).open() as bus:
        assert [(finding.device, finding.text) for finding in bus.findings] == [
            ("id 1", "belongs to l_hip and r_hip"),
            ("robot.toml", "names no IMU"),
        ]
    bench = ServiceBench(tiny)
    bench.virtual.board.alive = False
    with bench.open() as bus:
        assert (bus.board, bus.imu) == (None, None)
        assert [finding.text for finding in bus.findings] == ["silent"]
