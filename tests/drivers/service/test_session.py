"""A robot's buses opened for service: what is written at the start, and what stays as it is."""

from dataclasses import replace

import pytest
from service_bench import ServiceBench

from drivers.dynamixel.diagnostics import DiagnosticsError
from drivers.dynamixel.protocol2 import Instruction
from robots import Robot


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


def test_a_board_that_is_silent_is_a_finding_and_no_imu(tiny: Robot):
    bench = ServiceBench(tiny)
    bench.virtual.board.alive = False
    with bench.open() as bus:
        assert (bus.board, bus.imu) == (None, None)
        assert [finding.text for finding in bus.findings] == ["silent"]


def test_a_robot_without_imu_or_with_an_id_twice_has_findings(tiny: Robot):
    twice = replace(
        tiny,
        joints=tuple(replace(j, servo=replace(j.servo, id=1)) for j in tiny.joints),
        bus=replace(tiny.bus, board=None),
    )
    with ServiceBench(twice).open() as bus:
        assert [(finding.device, finding.text) for finding in bus.findings] == [
            ("id 1", "belongs to l_hip and r_hip"),
            ("robot.toml", "names no IMU"),
        ]
