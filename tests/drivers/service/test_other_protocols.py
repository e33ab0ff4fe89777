"""AX, XL-320 and Feetech servos on a port: found, set up and refused as their kind needs."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from bus_stories import Served
from desk import BAUD, make_desk, opening, serving_desk
from memory_rig import Rig

from drivers.dynamixel import startup
from drivers.dynamixel.bus import TRIES, DynamixelBus
from drivers.dynamixel.protocol2 import Reset, Status
from drivers.dynamixel.robot_ports import find_bus
from drivers.errors import DriverError, SetupError
from drivers.service import sweep as sweep_module
from drivers.service.loose_servo import LooseServo, find_servo, find_servos, open_bus
from drivers.service.moved_servo import find_bench
from drivers.service.scan import scan_port
from drivers.service.servo_address import change_baud, change_id, reset_servo
from drivers.service.sweep import sweep
from drivers.state import Command
from drivers.virtual_bus.devices.device import Quirks

KINDS = {"AX-12A": "1.0", "MX-28(1.0)": "1.0", "XL-320": "2.0", "STS3215-C018": "feetech"}


@pytest.fixture(autouse=True)
def _few_ids(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_module, "SWEPT", range(6))


@pytest.mark.parametrize(("model", "protocol"), KINDS.items())
def test_a_servo_is_found_whatever_it_speaks_and_written_for_good(model: str, protocol: str):
    with serving_desk((1, model), (3, model)) as desk:
        (joint, *_) = find_bench(desk.path, 1, BAUD, None)[0].joints
        assert joint.servo.model.name == model
        assert (joint.lower, joint.upper) == pytest.approx(joint.servo.model.ends)
        found = scan_port(desk.make_port(desk.path), (57_600, BAUD)).found
        assert [(d.id, d.baud, d.protocol) for d in found] == [(i, BAUD, protocol) for i in (1, 3)]
        assert found[0].model is not None and found[0].model in model
        other = "feetech" if protocol != "feetech" else "2.0"
        if protocol != "1.0":  # which shares its frame with Feetech's
            with opening(desk, other) as bus, pytest.raises(SetupError):
                find_servo(bus, 1, (BAUD,))
        with opening(desk, protocol) as bus:
            assert find_servo(bus, 1, (BAUD,)).id == 1
        with opening(desk) as bus:
            assert [servo.id for servo in find_servos(bus, (57_600, BAUD))] == [1, 3]
            assert bus.wire.name == protocol
            servo = change_id(find_servo(bus, 1, (BAUD,)), 5)
            servo.write("temperature_limit", 60)
            desk.restart()
            assert (desk.peek("id"), desk.peek("temperature_limit")[0]) == ([5, 3], 60)
    with pytest.raises(SetupError, match=r"protocol is '3.0', expected 2\.0, 1\.0"):
        open_bus("none", BAUD, "3.0").__enter__()


# The lock of a Feetech ---------------------------------------------------------------------------


@pytest.fixture
def feetech() -> Iterator[tuple[Served, LooseServo]]:
    with serving_desk((1, "STS3215-C018")) as desk, opening(desk) as bus:
        yield desk, find_servo(bus, 1, (BAUD,))


def test_a_feetech_changes_its_baud_rate_by_its_own_codes(feetech):
    desk, servo = feetech
    servo = change_baud(servo, 500_000)
    assert servo.bus.port.baud == 500_000
    assert (desk.peek("baud_rate"), desk.peek("eeprom_lock")) == ([1], [1])
    with pytest.raises(SetupError, match="baud rate is 2000000 bit/s, expected 19200, 38400"):
        change_baud(servo, 2_000_000)
    with pytest.raises(SetupError, match="knows no reset"):
        reset_servo(servo, Reset.ALL)


def test_it_is_locked_after_a_change_that_cannot_be_verified(feetech, monkeypatch):
    desk, servo = feetech
    ping = DynamixelBus.ping
    monkeypatch.setattr(
        DynamixelBus, "ping", lambda bus, i, n=1: None if n == TRIES else ping(bus, i, n)
    )
    for change, value in ((change_baud, 500_000), (change_id, 5)):
        with pytest.raises(DriverError, match="silent at"):
            change(servo, value)
        assert (desk.peek("eeprom_lock"), servo.bus.port.baud) == ([1], BAUD)
        desk.poke("servo_1", "baud_rate", 0)


def test_nothing_changes_where_it_does_not_confirm_that_it_is_unlocked(feetech, monkeypatch):
    desk, servo = feetech
    set_lock = LooseServo.set_lock
    monkeypatch.setattr(LooseServo, "set_lock", lambda servo, on: set_lock(servo, on) and on != 0)
    with pytest.raises(DriverError, match="eeprom_lock = 0 is not confirmed: nothing is writ"):
        change_id(servo, 5)
    assert (desk.peek("id"), desk.peek("eeprom_lock")) == ([1], [1])
    monkeypatch.setattr(LooseServo, "set_lock", lambda servo, on: on == 0 and set_lock(servo, on))
    with pytest.raises(DriverError, match="its settings stay unlocked"):
        change_id(servo, 5)
    with pytest.raises(DriverError, match="its settings stay unlocked"):
        replace(servo, id=5).write("temperature_limit", 60)


# Servos that reply to little ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "level"),
    [("AX-12A", 0), ("XL-320", 0), ("AX-12A", 1), ("XL-320", 1), ("STS3215-C018", 0)],
)
def test_a_servo_that_does_not_confirm_what_is_written_is_set_up(model, level, monkeypatch):
    monkeypatch.setattr(startup, "BOOT_TIME", 0.1)
    with serving_desk((1, model)) as desk:
        desk.poke("servo_1", "status_return_level", level)
        backend = desk.make_driver(without_imu=True)
        backend.connect()
        table = backend.diagnostics.servos[0].table
        assert desk.peek("status_return_level") == [table.all_answered]
        assert desk.peek("return_delay_time") == [0]
        backend.close()
        assert backend.unreleased == ()
        desk.poke("servo_1", "status_return_level", level)
        if level or model == "STS3215-C018":  # it replies to reads
            with opening(desk) as bus:
                servo = find_servo(bus, 1, (BAUD,))
                servo.write("status_return_level", servo.table.all_answered)
                servo.write("temperature_limit", 60)
            assert desk.peek("temperature_limit") == [60]


def test_a_servo_whose_goal_switches_torque_on_stays_limp_after_its_restart():
    quirks = Quirks(goal_switches_torque_on=True)
    with Rig(make_desk((1, "XL-320")), quirks=quirks, without_imu=True) as rig:
        rig.backend.read()
        rig.backend.reboot("servo_1")
        assert rig.peek("torque_enable") == [0]


@pytest.mark.parametrize("model", ["AX-12A", "XL-320", "STS3215-C018"])
def test_a_limp_servo_that_a_goal_would_switch_on_gets_none_beside_a_driven_one(model: str):
    quirks = Quirks(goal_switches_torque_on=True)
    with Rig(make_desk((1, model), (2, model)), quirks=quirks, without_imu=True) as rig:
        state = rig.turn(Command.limp(2), 2)
        for driven in ([True, False], [False, True], [False, False], [True, True]):
            command = replace(rig.hold(state), torque_limit=np.array(driven) * 1.0)
            for _ in range(3):
                rig.turn(command)
                assert rig.peek("torque_enable") == driven
        rig.turn(Command.limp(2), 2)
        rig.poke("torque_enable", 1)
        rig.turn(Command.limp(2))
        assert rig.peek("torque_enable") == [0, 0], "where all are limp it is switched off again"


def test_an_ax_with_a_gain_of_0_has_no_torque():
    with Rig(make_desk((1, "AX-12A")), without_imu=True) as rig:
        start = rig.backend.read().joint_pos
        for gain, sent_gain, has_torque in ((0.1, 0.25, 1), (0.0, 0.0, 0), (1.0, 1.0, 1)):
            command = replace(Command.position(rig.robot, start, 1.0), gain_scale=np.array([gain]))
            rig.turn(command)
            assert rig.sent.gain_scale.tolist() == [sent_gain]
            assert (rig.sent.torque_limit > 0.0).tolist() == [bool(has_torque)]
            assert rig.peek("torque_enable") == [has_torque]


def test_what_a_servo_cannot_is_refused_with_what_to_do():
    with serving_desk((1, "AX-12A")) as desk, opening(desk) as bus:
        servo = find_servo(bus, 1, (BAUD,))
        with pytest.raises(SetupError, match="knows no restart over its bus: switch its power off"):
            servo.reboot()
        with pytest.raises(SetupError, match="--keep nothing"):
            reset_servo(servo, Reset.ALL_BUT_ID)
        with pytest.raises(SetupError, match="id is 254, expected 0 to 253"):
            change_id(servo, 254)
        with pytest.raises(SetupError, match="no register 'bus_watchdog'"):
            servo.read("bus_watchdog")
        with pytest.raises(SetupError, match="no register 'operating_mode'"):
            servo.check_write("operating_mode", 3)
        servo.write("temperature_limit", 60)
        assert reset_servo(servo, Reset.ALL).id == 1
        assert desk.peek("temperature_limit") == [70]
    with pytest.raises(SetupError, match=r"AX-12A, XL430-W250 speak different protocols \(1.0, 2"):
        find_bus(make_desk((1, "AX-12A"), (2, "XL430-W250")))


def test_a_scan_lists_a_servo_of_an_unknown_model_and_one_whose_protocol_is_unclear(monkeypatch):
    with serving_desk((1, "AX-12A"), (3, "AX-12A"), (4, "AX-12A")) as desk:
        desk.poke("servo_3", "model_number", 300)  # an AX-12W
        read = sweep_module._read_first
        unclear = Status(4, 0, bytes((44, 1, 9, 4, 3, 4)))  # an AX-12W, or a Feetech 772
        monkeypatch.setattr(
            sweep_module, "_read_first", lambda bus, i: unclear if i == 4 else read(bus, i)
        )
        found = scan_port(desk.make_port(desk.path), (BAUD,)).found
        assert [(d.id, d.number, d.model, d.protocol) for d in found] == [
            (1, 12, "AX-12A", "1.0"),
            (3, 300, None, "1.0"),
            (4, None, None, "1.0 or feetech"),
        ]
        assert not found[2].doubled
        with opening(desk) as bus:
            with pytest.raises(SetupError, match=r"id 4 may be .*--protocol 1\.0 or --"):
                sweep(bus, bus.searched, (4,))
            assert sweep(bus, [sweep_module.FEETECH], (4,)) == [4]
            assert bus.wire is sweep_module.FEETECH


def test_no_id_is_swept_where_a_servo_speaks_protocol_2_at_another_rate(monkeypatch):
    monkeypatch.setattr(sweep_module, "_hear", lambda *_: pytest.fail("an id is swept"))
    with serving_desk((1, "XL430-W250")) as desk:
        rates = (57_600, BAUD)
        with opening(desk) as bus:
            assert [servo.id for servo in find_servos(bus, rates)] == [1]
            assert find_servo(bus, 1, rates).id == 1
        found = scan_port(desk.make_port(desk.path), rates).found
        assert [(device.id, device.baud) for device in found] == [(1, BAUD)]
