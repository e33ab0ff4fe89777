"""What commands become in registers, and in which order they are written."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from memory_rig import Rig
from tiny_robots import with_servos, with_types

from drivers import Command
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.command_writer import CommandConverter, CommandWriter, RegisterCommands
from drivers.dynamixel.configuration import full_scale, goal_range, round_gain, to_slope
from drivers.dynamixel.control_table import OperatingMode, table_named
from drivers.dynamixel.protocol2 import Instruction, Status
from drivers.dynamixel.requests import Replies
from drivers.dynamixel.servo_states import ServoStates
from drivers.dynamixel.wire import PROTOCOL_2
from drivers.errors import SetupError
from drivers.virtual_bus.devices.sensors import Measured
from robots.servo import TICKS_PER_TURN

# Registers of an XM430 (e-manual).
TORQUE, P_GAIN, WATCHDOG, PWM, GOAL = 64, 84, 98, 100, 116
NAMES = {TORQUE: "torque", P_GAIN: "gain", WATCHDOG: "watchdog", PWM: "pwm", GOAL: "goal"}
Write = tuple[str, dict[int, int]]
"""Register, and the value of each servo id."""


class Listener:
    wire = PROTOCOL_2

    def __init__(self) -> None:
        self.writes: list[Write] = []

    def send(self, frame: bytes) -> None:
        body, is_seed = frame[8:-2], frame[7] == Instruction.BULK_WRITE
        assert is_seed or frame[7] == Instruction.SYNC_WRITE
        address, size = struct.unpack_from("<HH", body, is_seed)
        start, head = (0, 5) if is_seed else (4, 1)
        rows = [body[i : i + head + size] for i in range(start, len(body), head + size)]
        values = {row[0]: int.from_bytes(row[head:], "little") for row in rows}
        self.writes.append(("seed" if is_seed else NAMES[address], values))
        assert not is_seed or address == GOAL

    def take(self) -> list[Write]:
        writes, self.writes = self.writes, []
        return writes


@pytest.fixture
def bus() -> Listener:
    return Listener()


@pytest.fixture
def states(tiny) -> ServoStates:
    states = ServoStates(tiny, 0.008)
    ticks = {1: 2000, 2: 1100}
    replies = [Status(i, 0, bytes(6) + ticks[i].to_bytes(4, "little")) for i in ticks]
    states.update_cyclic(Replies.of(replies, 10), 1.0)
    for row in (0, 1):
        states.note_ready(row)
    return states


@pytest.fixture
def writer(tiny, bus) -> CommandWriter:
    return CommandWriter(bus, list(tiny.joints), np.arange(2), 5, "pwm")  # type: ignore[arg-type]


BOTH, NONE = np.array([True, True]), np.array([False, False])


def registers(torque=BOTH, goal=(2048, 1000)):
    return RegisterCommands(*map(np.array, (goal, (800, 800), (885, 885), (855, 855), torque)))


def test_torque_comes_on_after_gain_limit_watchdog_and_present_position(bus, writer, states):
    writer.write(registers(), states, BOTH)
    assert bus.take() == [
        ("gain", {1: 800, 2: 800}),
        ("pwm", {1: 885, 2: 885}),
        ("watchdog", {1: 0, 2: 0}),
        ("seed", {1: 2000, 2: 1100}),
        ("watchdog", {1: 5, 2: 5}),
        ("torque", {1: 1, 2: 1}),
        ("goal", {1: 2048, 2: 1000}),
    ]
    assert states.is_on.all()


def test_torque_goes_off_first_and_a_limp_servos_goal_is_where_it_is(bus, writer, states):
    for _ in range(3):
        writer.write(registers(), states, BOTH)
    bus.take()
    writer.write(registers([True, False]), states, BOTH)
    assert bus.take() == [("torque", {2: 0}), ("goal", {1: 2048, 2: 1100})]
    assert states.is_on.tolist() == [True, False]
    writer.write(registers([True, False]), states, BOTH)
    assert bus.take() == [("goal", {1: 2048, 2: 1100})]
    states.must_release[1] = True
    writer.write(registers(NONE), states, BOTH)
    assert bus.take()[0] == ("torque", {1: 0, 2: 0})
    assert not states.must_release.any()


def test_all_gains_and_all_limits_are_sent_twice_and_again_every_64_cycles(bus, writer, states):
    sent = {"gain": [], "pwm": []}
    for cycle in range(1, 200):
        writer.write(registers(), states, BOTH)
        for name, values in bus.take():
            if name in sent:
                assert set(values) == {1, 2}
                sent[name].append(cycle)
    assert sent == {"gain": [1, 2, 64, 128, 192], "pwm": [1, 2, 32, 96, 160]}


def test_goals_and_seeds_are_in_the_turns_that_the_registers_count(bus, writer, states):
    states.register[:], states.turns[:] = [40, 904], [-4096, 4096]
    writer.write(registers(goal=(-4060, 5005)), states, BOTH)
    writes = bus.take()
    assert ("seed", {1: 40, 2: 904}) in writes
    assert writes[-1] == ("goal", {1: 36, 2: 909})
    writer.write(registers(NONE), states, BOTH)
    assert bus.take()[-1] == ("goal", {1: 40, 2: 904})


def test_a_current_limit_is_rounded_down_to_counts_and_returned_as_it_is(tiny):
    """2.0 N·m are 417.09 counts of 2.69 mA at 4.1 N·m / 2.3 A."""
    converter = CommandConverter(tiny, "current")
    command = Command(
        joint_pos=np.zeros(2),
        gain_scale=np.ones(2),
        torque_limit=np.array([2.0, 9.0]),
        pwm_limit=np.array([1.0, 0.25]),
    )
    found = converter.to_registers(command)
    assert found.current.tolist() == [417, 855], "no more than the stall current"
    assert found.pwm.tolist() == [885, 221]
    sent = converter.to_command(found, command)
    assert sent.torque_limit == pytest.approx(
        [417 * 0.00269 * 4.1 / 2.3, 855 * 0.00269 * 4.1 / 2.3]
    )
    assert sent.pwm_limit == pytest.approx([1.0, 221 / 885])
    again = converter.to_registers(sent)
    assert np.array_equal(again.current, found.current)
    for limit in (0.0, 1e-4):  # which rounds to no count
        found = converter.to_registers(replace(command, torque_limit=np.array([limit, 0.005])))
        assert found.current.tolist() == [0, 1]
        assert found.torque.tolist() == [False, True]


def test_a_command_becomes_registers_of_each_servo(tiny):
    """The right hip turns the other way round, from tick 1000; 0.1 rad are 65.19 ticks."""
    converter = CommandConverter(with_servos(tiny, {}, {"own_p_gain": 2100}), "pwm")
    command = Command(
        joint_pos=np.array([0.1, 0.1]),
        gain_scale=np.array([0.25, 0.5]),
        torque_limit=np.array([2.05, 4.1]),
        pwm_limit=np.array([1.0, 0.25]),
    )
    found = converter.to_registers(command)
    assert found.goal.tolist() == [2048 + 65, 1000 - 65]
    assert found.p_gain.tolist() == [200, 1050], "shares of each joint's own"
    assert found.pwm.tolist() == [442, 221], "half and a quarter of 885, rounded down"
    assert found.torque.tolist() == [True, True]
    assert converter.to_command(found, command).gain_scale == pytest.approx([0.25, 0.5])
    above = converter.to_registers(replace(command, gain_scale=np.array([2.0, 2.0])))
    assert above.p_gain.tolist() == [800, 2100]


def test_the_pwm_limit_of_a_servo_limits_its_torque(tiny):
    converter = CommandConverter(tiny, "pwm")
    converter.pwm_limit = np.array([100, 885])
    command = Command.position(tiny, np.zeros(2))
    found = converter.to_registers(command)
    assert found.pwm.tolist() == [100, 885]
    sent = converter.to_command(found, command)
    assert sent.torque_limit == pytest.approx([4.1 * 100 / 885, 4.1])
    assert sent.pwm_limit == pytest.approx([100 / 885, 1.0])


# Ranges of goals, and the modes of a torque limit ------------------------------------------------

SLOPES = (2, 4, 8, 16, 32, 64, 128)  # those that an AX distinguishes (e-manual)


@given(gain=st.integers(0, 64))
def test_a_gain_becomes_the_next_softer_slope(gain: int):
    rounded, slope = int(round_gain(np.array(gain))), int(to_slope(np.array(gain)))
    assert slope in SLOPES
    assert slope * rounded == 128
    assert rounded <= max(gain, 1) < 2 * rounded


def test_gains_positions_and_supply_have_the_counts_of_the_manual():
    assert to_slope(np.array([4, 2, 1, 0])).tolist() == [32, 64, 128, 128]
    assert table_named("AX-12A")["cw_compliance_slope"].default == 32
    for model, ends, full in (
        ("XM430-W350", (-1_048_575, 1_048_575), 885),  # in extended position mode
        ("AX-12A", (0, 1023), 1023),
        ("XL-320", (0, 1023), 1023),
        ("STS3215", (0, 4095), 1000),
    ):
        table = table_named(model)
        assert (goal_range(table), full_scale(table)) == (ends, full), model


@pytest.mark.parametrize(
    ("by", "mode", "d_gain"),
    [
        ("current", OperatingMode.CURRENT_BASED_POSITION, 4506),
        ("pwm", OperatingMode.EXTENDED_POSITION, 0),
    ],
)
def test_the_mode_and_its_damping_are_set_and_torque_begins_where_a_joint_was_turned_around(
    tiny, by, mode, d_gain
):
    """The servo counts the turn, and a goal without it would be a turn away."""
    with Rig(tiny, limit_by=by) as rig:
        assert rig.backend.limit_by == by
        assert rig.peek("operating_mode") == [mode] * 2
        assert rig.peek("position_d_gain") == [d_gain] * 2
        rig.backend.close()
        before = rig.peek("present_position")[0]
        rig.servo("l_hip").sense(Measured(ticks=before + TICKS_PER_TURN))
        rig.backend.connect()
        angles = rig.backend.read().joint_pos
        assert angles[0] == pytest.approx(tiny.joints[0].servo.to_rad(before), abs=0.002)
        rig.backend.write(Command.position(tiny, angles))
        assert rig.peek("goal_position")[0] == pytest.approx(before + TICKS_PER_TURN, abs=1)
        assert rig.peek("torque_enable") == [1, 1]


def test_servos_without_current_sensor_have_no_current_mode(tiny):
    robot, ports = replace(with_types(tiny, "XL430-W250"), limit_by="pwm"), {"main": "main"}
    assert DynamixelBackend(robot, ports).limit_by == "pwm"
    with pytest.raises(SetupError, match=r"'current', expected 'pwm': the XL430-W250 of joint"):
        DynamixelBackend(robot, ports, limit_by="current")
