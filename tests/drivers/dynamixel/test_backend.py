"""The backend on servos: what reaches them, what is believed, and what happens when they fail."""

from dataclasses import replace

import numpy as np
import pytest
from bus_stories import serving
from hypothesis import given, settings
from hypothesis import strategies as st
from memory_rig import Rig, split

from drivers import Command
from drivers.dynamixel import backend as driver_module
from drivers.dynamixel.command_writer import CommandConverter
from drivers.dynamixel.cyclic_read import GroupKind
from drivers.dynamixel.diagnostics import DiagnosticsError
from drivers.dynamixel.protocol2 import Instruction
from drivers.errors import DriverError, SetupError, UnreleasedError
from drivers.serial_port import SDK, PortError
from drivers.state import HardwareError
from drivers.virtual_bus.devices.device import Quirks, ReadGap
from drivers.virtual_bus.devices.sensors import Measured
from robots.servo import MAX_TICKS

TORQUE = 64


@pytest.fixture
def rig(tiny):
    with Rig(tiny) as rig:
        yield rig


def test_connecting_powers_the_servos_sets_them_up_and_measures_them_limp(op3):
    with Rig(op3) as rig:
        state = rig.backend.read()
        assert state.joint_pos == pytest.approx(rig.true_angles(), abs=1e-12)
        assert np.any(state.joint_pos)
        assert state.joint_age.max() == 0.0 and state.imu_age == 0.0 and not state.alert.any()
        assert state.voltage == pytest.approx(12.0) and np.all(state.temperature == 25.0)
        assert rig.peek("torque_enable") == rig.peek("return_delay_time") == [0] * 20
        assert rig.backend.chains[0].cyclic.kind is GroupKind.FAST
        # Summed as floats, twenty times 14.8 V are 14.800000000000002 V: beyond what servos bear.
        rig.virtual.physics.sag(14.8)
        assert rig.turn(Command.limp(20), cycles=70).voltage == 14.8


def test_all_that_is_wrong_is_reported_at_once(op3, monkeypatch):
    monkeypatch.setattr("drivers.dynamixel.startup.BOOT_TIME", 0.01)

    def break_some(virtual):
        virtual.servos[0].alive = False
        virtual.servos[4].alive = False
        virtual.servos[7].poke("drive_mode", 1)
        virtual.servos[9].poke("secondary_id", 3)

    rig = Rig(op3, prepare=break_some)
    with pytest.raises(DiagnosticsError) as caught:
        rig.backend.connect()
    message = str(caught.value)
    for words in ("'r_sho_pitch' (id 1)", "'r_el' (id 5)", "silent", "'l_hip_yaw'", "reversed"):
        assert words in message
    assert "'l_hip_roll' (id 10): also responds to the secondary id 3" in message
    assert "\n" not in message
    assert not rig.port.is_open, "a failed connection keeps the port"


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_what_is_sent_is_within_what_was_asked_and_the_ranges(tiny, data):
    numbers = st.floats(-1e6, 1e6)
    pos = np.array(data.draw(st.lists(numbers, min_size=2, max_size=2)))
    gain = np.array(data.draw(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2)))
    torque = np.array(data.draw(st.lists(st.floats(0.0, 10.0), min_size=2, max_size=2)))
    translator = CommandConverter(tiny, "pwm")
    share = np.array(data.draw(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2)))
    asked = Command(joint_pos=pos, gain_scale=gain, torque_limit=torque, pwm_limit=share)
    orders = translator.to_registers(asked)
    sent = translator.to_command(orders, asked)
    assert np.all(np.abs(orders.goal) <= MAX_TICKS)
    assert np.all((orders.pwm >= 0) & (orders.pwm <= 885))
    assert np.all((orders.p_gain >= 0) & (orders.p_gain <= 800))
    assert np.all(sent.torque_limit <= torque)
    assert np.all(sent.pwm_limit <= share)
    inside = (pos >= tiny.lower) & (pos <= tiny.upper)
    assert np.all(sent.joint_pos[inside] >= tiny.lower[inside])
    assert np.all(sent.joint_pos[inside] <= tiny.upper[inside])
    again = translator.to_registers(sent)
    assert np.array_equal(again.goal, orders.goal)
    assert np.array_equal(again.pwm, orders.pwm)
    assert np.array_equal(again.p_gain, orders.p_gain)


def test_a_command_that_is_no_command_reaches_no_servo(rig):
    rig.backend.read()
    rig.port.sent.clear()
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(DriverError, match="target is"):
            rig.backend.write(Command.position(rig.robot, np.array([bad, 0.0])))
    with pytest.raises(DriverError, match="torque limit is"):
        rig.backend.write(replace(Command.limp(2), torque_limit=np.array([-1.0, 0.0])))
    assert rig.port.sent == []


@pytest.mark.parametrize(("gap", "firmware"), list(zip(ReadGap, (46, 44), strict=True)))
def test_a_silent_servo_costs_only_itself(op3, gap, firmware):
    with Rig(op3, firmware=firmware, quirks=Quirks(sync_gap=gap, fast_gap=gap)) as rig:
        rig.turn(cycles=3)
        knee = op3.joint_names.index("r_knee")
        others = np.arange(20) != knee
        rig.servo("r_knee").alive = False
        for missed in range(1, 30):
            state = rig.turn(Command.limp(20))
            assert state.joint_age[knee] == pytest.approx(missed * op3.control_period)
            assert np.all(state.joint_age[others] == 0.0)
            assert state.imu_age == 0.0
            assert state.joint_pos[knee] != 0.0, "a value was made up"
        assert rig.backend.chains[0].cyclic.left_out == [13]
        lost = rig.backend.statistics["main"].lost
        rig.turn(Command.limp(20), 20)
        assert rig.backend.statistics["main"].lost - lost <= 2, "it is still waited for"
        rig.servo("r_knee").alive = True
        assert rig.turn(Command.limp(20), 12).joint_age[knee] == 0.0


def test_a_servo_that_restarts_is_set_up_again_and_a_tripped_watchdog_cleared(rig):
    target = np.array([0.15, -0.15])
    command = replace(Command.position(rig.robot, target), gain_scale=np.array([0.5, 0.5]))
    rig.turn(command, 40)
    rig.servo("r_hip").reboot()
    limits = []
    for _ in range(120):
        rig.turn(command)
        limits.append(rig.sent.torque_limit[1])
    assert min(limits) == 0.0, "it was not noticed"
    assert rig.peek("torque_enable") == [1, 1]
    assert rig.peek("position_p_gain") == [400, 400]
    assert rig.peek("bus_watchdog") == [5, 5]
    rig.virtual.physics.advance(rig.virtual.physics.time + 0.2)
    assert rig.peek("bus_watchdog") == [-1, -1], "the test shows nothing"
    rig.turn(cycles=8)
    assert rig.peek("bus_watchdog") == [5, 5]
    assert rig.peek("torque_enable") == [1, 1]


def test_a_reboot_needs_a_limp_joint_and_forgets_the_overload(rig, monkeypatch):
    rig.turn(cycles=3)
    with pytest.raises(SetupError, match=r"joint 'r_hip' \(id 2\): has torque; release it"):
        rig.backend.reboot("r_hip")
    rig.servo("r_hip").trip(HardwareError.OVERLOAD)
    rig.turn(Command.limp(2), 2)
    assert rig.servo("r_hip").peek("torque_enable") == 0
    rig.backend.reboot("r_hip")
    state = rig.turn(Command.limp(2))
    assert not state.alert.any()
    servo = rig.servo("r_hip")
    assert servo.peek("goal_position") == pytest.approx(servo.peek("present_position"), abs=1)
    assert servo.peek("torque_enable") == 0
    rig.turn(cycles=3)
    assert rig.peek("torque_enable") == [1, 1]
    rig.turn(Command.limp(2))
    monkeypatch.setattr("drivers.dynamixel.backend.BOOT_TIME", 0.0)
    servo.alive = False
    with pytest.raises(SetupError, match="joint 'r_hip'"):
        rig.backend.reboot("r_hip")
    servo.alive = True


def test_torque_off_that_was_lost_is_sent_again_in_the_next_cycle(rig, monkeypatch):
    rig.turn(cycles=3)
    handle, lost = rig.port.chain.handle, []

    def lose_once(item, *, baud=None):
        is_torque = item.instruction == Instruction.SYNC_WRITE and item.params[0] == TORQUE
        if is_torque and not lost:
            lost.append(item)
            return []
        return handle(item, baud=baud)

    monkeypatch.setattr(rig.port.chain, "handle", lose_once)
    for left in ([1, 1], [0, 0]):
        rig.turn(Command.limp(2))
        assert rig.peek("torque_enable") == left


@pytest.mark.parametrize(("cycles", "torque"), [(2, 1), (4, 0)])
def test_torque_does_not_begin_from_a_position_that_is_old(rig, cycles, torque):
    """Goals would begin where the joint was: two cycles without a reply are bridged, four not."""
    state = rig.turn(Command.limp(2), 3)
    answer, rig.port.spoil = rig.port.spoil, lambda *_: []
    rig.turn(Command.limp(2), cycles - 1)
    rig.turn(rig.hold(state))
    rig.port.spoil = answer
    assert rig.peek("torque_enable") == [torque] * 2


@pytest.mark.parametrize(("rate", "firmware"), [(1e-2, 46), (1e-1, 44)])
def test_no_wrong_value_is_believed_on_a_noisy_wire(op3, rate, firmware):
    rng = np.random.default_rng(7)

    def flip(_, answers):
        noisy = []
        for answer in answers:
            data = np.frombuffer(answer, np.uint8).copy()
            hit = rng.random(len(data)) < rate
            data[hit] ^= (1 << rng.integers(0, 8, hit.sum())).astype(np.uint8)
            noisy.append(data.tobytes())
        return noisy

    with Rig(op3, firmware=firmware) as rig:
        rig.port.spoil = flip
        rig.port.physics = None
        truth = {0.0: rig.true_angles()}
        believed = 0
        rig.clock.pass_period(op3.control_period)
        for _ in range(200):
            angles = op3.standing.joint_pos + rng.normal(0.0, 0.1, 20)
            for servo, joint, angle in zip(rig.virtual.servos, op3.joints, angles, strict=True):
                servo.sense(Measured(ticks=float(joint.servo.to_ticks(angle))))
            now = rig.clock.now()
            truth[round(now, 6)] = rig.true_angles()
            state = rig.turn(Command.limp(20))
            believed += int((state.joint_age == 0.0).sum())
            for i, age in enumerate(state.joint_age):
                then = truth[round(state.time - age, 6)]
                assert state.joint_pos[i] == pytest.approx(then[i], abs=1e-9)
            assert np.all(state.temperature == 25.0) and state.voltage == pytest.approx(12.0)
        assert believed > (1000 if rate < 0.05 else 0)


def test_a_port_from_which_nothing_comes_any_more_is_opened_again(rig, monkeypatch):
    monkeypatch.setattr("drivers.dynamixel.servo_chain.MUTE_TIME", 0.0)
    monkeypatch.setattr("drivers.dynamixel.servo_chain.REOPEN_EVERY", 0.0)
    rig.turn(cycles=3)
    rig.port.baud = 57_600  # somebody else changed it
    reopen = rig.port.open

    def open_at_its_speed():
        rig.port.baud = 1_000_000
        reopen()

    rig.port.open = open_at_its_speed
    state = rig.turn(cycles=40)
    assert rig.port.opened >= 2
    assert state.joint_age.max() == 0.0
    assert rig.peek("torque_enable") == [0, 0], "it was not requested again"


def test_two_ports_are_asked_together_and_move_one_robot(op3):
    robot = split(op3)
    with Rig(robot) as rig:
        order: list[str] = []
        for name, port in rig.ports.items():

            def note(data, name=name, write=port.write):
                order.append(name)
                write(data)

            port.write = note
        state = rig.turn()
        assert order[:2] == ["left", "right"], "the second waits for the first's answers"
        assert state.joint_pos == pytest.approx(rig.true_angles(), abs=0.2)
        assert rig.turn(cycles=20).joint_age.max() == 0.0
        assert rig.peek("torque_enable") == [1] * 20
        rig.ports["left"].unplugged = True
        state = rig.turn()
        assert state.joint_age.max() > 0.0
        assert np.all(state.joint_age[1::2] == 0.0), "one port's loss costs the other's servos"
        rig.ports["left"].unplugged = False


def test_closing_releases_everybody_and_twice_is_harmless(rig, monkeypatch):
    rig.turn(cycles=3)
    servo = rig.servo("r_hip")
    servo.alive = False
    monkeypatch.setattr(driver_module.time, "sleep", lambda _: setattr(servo, "alive", True))
    rig.backend.close()
    assert rig.peek("torque_enable") == rig.peek("bus_watchdog") == [0, 0], "silent for a moment"
    assert rig.backend.unreleased == ()
    rig.backend.close()


def test_closing_with_half_the_bus_dead_releases_the_rest_and_names_the_dead_until_they_confirm(
    op3, monkeypatch
):
    monkeypatch.setattr(driver_module, "RELEASE_TIME", 0.0)
    with Rig(op3) as rig:
        rig.turn(cycles=3)
        for servo in rig.virtual.servos[::2]:
            servo.alive = False
        with pytest.raises(UnreleasedError, match=r"'r_sho_pitch' \(id 1\), .* cut the supply"):
            rig.backend.close()
        assert rig.peek("torque_enable")[1::2] == [0] * 10
        assert rig.backend.unreleased == op3.joint_names[::2]
        rig.backend.close()
        rig.port.unplugged = True
        with pytest.raises(PortError):
            rig.backend.connect()
        assert rig.backend.unreleased == op3.joint_names[::2]
        rig.port.unplugged = False
        for servo in rig.virtual.servos:
            servo.alive = True
        rig.backend.connect()
    assert rig.backend.unreleased == ()


def test_a_robot_is_left_standing_once_every_servo_confirms_it(rig):
    rig.turn(cycles=3)
    rig.servo("r_hip").alive = False
    assert rig.backend.hand_over() == ("r_hip",)
    rig.servo("r_hip").alive = True
    rig.turn(cycles=3)
    assert rig.peek("bus_watchdog") == [5, 5], "a dead program would leave it under torque"
    assert rig.backend.hand_over() == ()
    rig.backend.close()
    assert rig.peek("torque_enable") == [1, 1]
    assert rig.peek("bus_watchdog") == [0, 0], "it would stop holding after a while"


def test_time_is_taken_to_wait_only_where_a_virtual_buss_clocks_stand_still(rig, monkeypatch):
    """A robot that is driven without deadlines would run at the speed of its bus."""
    assert not rig.backend.waits_for_commands()
    monkeypatch.setattr(driver_module, "is_pseudo_terminal", lambda _: True)
    assert rig.backend.waits_for_commands()
    physics = rig.virtual.physics
    monkeypatch.setattr(
        driver_module.time, "sleep", lambda seconds: physics.advance(physics.time + 8.0 * seconds)
    )
    assert not rig.backend.waits_for_commands()


def test_a_lost_port_keeps_no_other_under_torque(tiny):
    with Rig(split(tiny)) as rig:
        rig.turn(cycles=3)
        first, order = rig.ports["right"], list[str]()
        write = first.write
        first.write = lambda data: order.append("right") or write(data)
        rig.ports["left"].unplugged = True
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(driver_module, "RELEASE_TIME", 0.05)
            patch.setattr(driver_module.time, "sleep", lambda _: order.append("wait"))
            with pytest.raises(UnreleasedError, match="l_hip"):
                rig.backend.close()
        assert order.index("right") < order.index("wait")
        assert rig.peek("torque_enable") == [1, 0]
        rig.ports["left"].unplugged = False


@pytest.mark.parametrize("kind", ["", SDK], ids=["pyserial", "sdk"])
def test_unplugged_under_torque_and_plugged_in_again_the_robot_is_limp_until_told(
    kind, tiny, monkeypatch
):
    monkeypatch.setattr("drivers.dynamixel.servo_chain.REOPEN_EVERY", 0.0)
    with serving(tiny) as served, served.make_driver(kind) as backend:

        def hold(cycles: int):
            for _ in range(cycles):
                state = backend.read()
                sent = backend.write(Command.position(tiny, np.array([0.1, -0.1])))
            return state, sent

        backend.chains[0].bus.answer_margin = 5.0  # for a busy machine
        before, _ = hold(10)
        served.faults.unplug()
        state, _ = hold(10)
        assert backend.chains[0].is_lost
        assert state.joint_age.max() > 0.0
        assert np.all(np.abs(state.joint_pos - before.joint_pos) < 0.1)
        served.faults.replug()
        state, sent = hold(30)
        assert not backend.chains[0].is_lost and not sent.torque_limit.any()
        assert state.joint_age.max() == 0.0
        assert served.peek("torque_enable") == [0, 0]
        backend.write(Command.limp(2))
        hold(3)
        assert served.peek("torque_enable") == [1, 1]
