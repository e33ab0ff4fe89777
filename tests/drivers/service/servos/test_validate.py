"""A sound servo passes all validations; a servo with a fault fails that of its name."""

import time
from collections.abc import Callable
from dataclasses import replace
from itertools import count

import pytest
from bus_stories import Served, serving
from desk import make_desk
from nonempty import nonempty

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.clock import CycleClock
from drivers.errors import UnreleasedError
from drivers.service.servos import validate as module
from drivers.service.servos.guarded_motion import choose_servos
from drivers.service.servos.validate import ServoValidator
from drivers.service.servos.validation import Check, Validation, find_failed
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo
from robots import Joint
from robots.bench import Load, ServoBench
from robots.bus_settings import MAIN_PORT
from robots.servo import TICKS_PER_TURN

Fault = Callable[[VirtualServo], None]
DESK = make_desk((1, "XM430-W350"), (3, "XL430-W250"))


def validate(
    bench: ServoBench = DESK, joint: int = 0, fault: Fault | None = None
) -> tuple[Served, list[Validation]]:
    """Validate a servo of a bench, with a fault."""
    with serving(bench) as served:
        if fault is not None:
            fault(served.virtual.servos[joint])
        servos = choose_servos(served.robot, {MAIN_PORT: served.path})
        validator = ServoValidator(servos, clock=CycleClock(), pause=served.pass_time)
        results = validator.validate(joint)
        assert served.peek("torque_enable")[1 - joint] == 0, "only one servo has torque"
        if fault is not keep_torque and served.virtual.servos[joint].alive:
            assert served.peek("torque_enable") == [0, 0]
        return served, results


# Faults -----------------------------------------------------------------------------------------


def _feel(servo: VirtualServo, change: Callable[[float], float]) -> None:
    """Let a servo measure another position [ticks] than it has."""
    sense = servo.sense

    def sense_wrongly(measured: Measured) -> None:
        sense(measured._replace(ticks=change(measured.ticks)))

    servo.sense = sense_wrongly  # pyright: ignore[reportAttributeAccessIssue]


def _after_writes(servo: VirtualServo, register: str, value: int) -> None:
    """Let a register of a servo have a value after each write."""
    write = servo.write

    def write_wrongly(address: int, data: bytes, **how) -> int:
        error = write(address, data, **how)
        servo.poke(register, value)
        return error

    servo.write = write_wrongly  # pyright: ignore[reportAttributeAccessIssue]


def turn_the_sign(servo: VirtualServo) -> None:
    _feel(servo, lambda ticks: TICKS_PER_TURN - ticks)


def slip(servo: VirtualServo) -> None:
    """Slip by a tick in each measurement while it holds far from the middle."""
    slipped, last = 0.0, 0.0

    def shift(ticks: float) -> float:
        nonlocal slipped, last
        if abs(ticks - last) < 0.01 and abs(ticks - 0.5 * TICKS_PER_TURN) > 100:
            slipped += 1.0
        last = ticks
        return ticks - slipped

    _feel(servo, shift)


def skip_a_part_of_a_turn(servo: VirtualServo) -> None:
    """Lose a part of a turn at the end of the swing; whole ones are found again."""
    end = 0.5 * TICKS_PER_TURN + 225
    _feel(servo, lambda ticks: ticks - 0.4 * TICKS_PER_TURN if ticks > end else ticks)


def race(servo: VirtualServo) -> None:
    sense = servo.sense
    servo.sense = lambda measured: sense(  # pyright: ignore[reportAttributeAccessIssue]
        measured._replace(velocity=2.0 * measured.velocity)
    )


def allow_all_torque(servo: VirtualServo) -> None:
    _after_writes(servo, "goal_pwm", servo.peek("pwm_limit"))


def lose_the_watchdog(servo: VirtualServo) -> None:
    _after_writes(servo, "bus_watchdog", 0)


def keep_torque(servo: VirtualServo) -> None:
    """Keep torque once it is on."""
    write, was_on = servo.write, False

    def write_wrongly(address: int, data: bytes, **how) -> int:
        nonlocal was_on
        error = write(address, data, **how)
        was_on = was_on or servo.torque_on
        if was_on:
            servo.poke("torque_enable", 1)
        return error

    servo.write = write_wrongly  # pyright: ignore[reportAttributeAccessIssue]


# Tests ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("joint", [0, 1], ids=["by current", "by PWM"])
def test_a_sound_servo_passes_all_validations_and_is_limp(joint):
    mode = "current" if joint == 0 else "pwm"
    model = "XM430-W350" if joint == 0 else "XL430-W250"
    desk = make_desk((1, model), (3, model))
    assert desk.limit_by == mode
    _, results = validate(desk, joint)
    assert [result.check for result in results] == list(Check)
    assert find_failed(results) == []
    for result in nonempty(results):
        assert result.measured is not None
        assert 0.0 <= result.measured <= result.limit


@pytest.mark.parametrize("side", [-1, 1])
def test_a_servo_at_an_end_of_its_range_is_validated_inside_of_it(side):
    end = 2.0
    joints = tuple(replace(joint, lower=-end, upper=end) for joint in DESK.joints)
    desk = replace(DESK, joints=joints)
    with serving(desk) as served:
        served.place(servo_1=side * 114.0)  # 2 rad are 114.6°
        servos = choose_servos(served.robot, {MAIN_PORT: served.path})
        results = ServoValidator(servos, clock=CycleClock(), pause=served.pass_time).validate(0)
    assert find_failed(results) == []


@pytest.mark.parametrize(
    ("fault", "check"),
    [
        (turn_the_sign, Check.FOLLOWS),
        (slip, Check.HOLDS),
        (race, Check.VELOCITY_LIMIT),
        (allow_all_torque, Check.TORQUE_LIMIT),
        (skip_a_part_of_a_turn, Check.WRAPAROUND),
        (skip_a_part_of_a_turn, Check.STAYS_WITHIN),
        (lose_the_watchdog, Check.WATCHDOG),
        (keep_torque, Check.TORQUE_OFF),
    ],
)
def test_a_servo_with_a_fault_fails_the_validation_of_its_name(fault, check):
    _, results = validate(fault=fault)
    assert check in find_failed(results)
    assert Check.REPLY_TIME not in find_failed(results)


def test_an_adapter_that_collects_replies_for_16_ms_fails_by_its_time(monkeypatch):
    times = count(0.0, 0.016)
    monkeypatch.setattr(time, "perf_counter", lambda: next(times))
    _, results = validate()
    assert find_failed(results) == [Check.REPLY_TIME]
    # 29 bytes of 10 bits at 1 Mbit/s take 0.29 ms themselves.
    assert results[-1].measured == pytest.approx(16.0 - 0.29)


@pytest.mark.parametrize("model", ["AX-12A", "STS3215-C018"])
def test_a_servo_without_a_watchdog_passes_all_that_applies_to_it(model: str):
    _, results = validate(make_desk((1, model), (3, model)))
    (watchdog,) = (result for result in results if result.passed is None)
    assert watchdog.check is Check.WATCHDOG
    assert "has no bus watchdog" in watchdog.remark
    assert find_failed(results) == []


def test_a_reply_that_never_comes_is_shown_with_the_time_that_was_waited(monkeypatch):
    margin = 0.03  # s

    def fall_silent(bus: DynamixelBus, device: Joint) -> Validation:
        bus.answer_margin = margin
        monkeypatch.setattr(bus, "read_item", lambda *_, **__: None)
        return time_replies(bus, device)

    time_replies = module._time_replies
    monkeypatch.setattr(module, "_time_replies", fall_silent)
    _, results = validate()
    assert (results[-1].check, results[-1].passed) == (Check.REPLY_TIME, False)
    assert (results[-1].limit, results[-1].unit) == (pytest.approx(1000.0 * margin), "ms")
    assert results[-1].remark == "no reply to read 1 of 100"


def test_a_servo_that_falls_silent_under_torque_is_named_with_what_to_do():
    def fall_silent(servo: VirtualServo) -> None:
        def sense(measured: Measured, into=servo.sense) -> None:
            into(measured)
            servo.alive = servo.alive and measured.ticks < 0.5 * TICKS_PER_TURN + 100

        servo.sense = sense  # pyright: ignore[reportAttributeAccessIssue]

    with pytest.raises(UnreleasedError, match=r"\(id 1\): torque off is not confirmed: cut the"):
        validate(fault=fall_silent)


def test_a_stop_ends_the_moves_of_a_servo_and_those_of_the_next():
    with serving(DESK) as served:
        servos = choose_servos(served.robot, {MAIN_PORT: served.path})
        validator = ServoValidator(servos, clock=CycleClock(), pause=served.pass_time)
        first = served.virtual.servos[0]

        def sense(measured: Measured, into=first.sense) -> None:
            into(measured)
            if first.torque_on and measured.ticks > 0.5 * TICKS_PER_TURN + 20:
                validator.stop("a key was pressed")

        first.sense = sense  # pyright: ignore[reportAttributeAccessIssue]
        for joint in (0, 1):
            results = {result.check: result for result in validator.validate(joint)}
            for check in (Check.FOLLOWS, Check.TORQUE_LIMIT, Check.WATCHDOG):
                assert results[check].measured is None
                assert "a key was pressed" in results[check].remark
            assert results[Check.TORQUE_OFF].passed


def test_a_load_that_is_too_heavy_is_not_held():
    desk = replace(DESK, loads=(Load(mass=3.0, arm=0.2), Load()))
    _, results = validate(desk)
    assert Check.HOLDS in find_failed(results)
    assert Check.TORQUE_LIMIT not in find_failed(results)
