"""Logs of a servo on a lever: what is read, what is refused, and what is warned of."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from servo_logs import SHEET, record_servo, write_servo_log

from drivers.flight_log.writer import FlightLog
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.robot.identify_servo import FitServoRequest, identify_servo
from robots.bench import make_bench, make_bench_joint
from robots.quaternion import Array
from robots.servo import PWM_FULL_SCALE
from sim2real.identification.servo_log import ServoLog, find_warnings, load_servo_log


@pytest.fixture(scope="module")
def logs() -> list[ServoLog]:
    return record_servo()


def test_a_log_is_read_as_it_was_written(logs: list[ServoLog], tmp_path: Path):
    """Counts of PWM are unsigned: -100 was written as 65436."""
    entries = json.loads(write_servo_log(tmp_path / "log.json", logs[1]).read_text())["entries"]
    loaded = [entry | {"load": 65436} for entry in entries]
    log = load_servo_log(write_servo_log(tmp_path / "log.json", logs[1], entries=loaded))
    last = len(log.goal) - 1
    assert last >= len(logs[1].goal) - 2
    np.testing.assert_allclose(log.goal[:last], logs[1].goal[:last], atol=1e-9)
    np.testing.assert_allclose(log.joint_pos[:last], logs[1].joint_pos[:last], atol=1e-9)
    assert log.duty == pytest.approx(np.full(len(log.goal), -100 / PWM_FULL_SCALE))
    assert (log.trajectory, log.inertia) == ("waves", pytest.approx(1.2 * 0.15**2))


def test_a_log_that_cannot_be_used_is_refused_in_one_line(logs: list[ServoLog], tmp_path: Path):
    good = json.loads(write_servo_log(tmp_path / "log.json", logs[0]).read_text())["entries"]
    wrong = {
        "expected the arm of the mass": {"length": None},
        "no sample for 0.5": {"entries": [e for e in good if not 0.3 < e["timestamp"] < 0.8]},
        "expected rad: is it in degrees?": {"entries": [e | {"position": 57.3} for e in good]},
        "torque was never on": {"entries": [e | {"torque_enable": False} for e in good]},
        "expected 1 s at least": {"entries": good[:20]},
        "0.00 s long": {"entries": []},
        "is not after the one before it": {"entries": [*good[:9], good[7], *good[9:]]},
        "Expected `float`": {"vin": "12 V"},
        "`float` > 0.0": {"mass": 0.0},
    }
    for expected, change in wrong.items():
        path = write_servo_log(tmp_path / "wrong.json", logs[0], **change)
        with pytest.raises(ValueError, match=expected) as caught:
            load_servo_log(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    for content in (b"no log", b"\xff\xfe", b"[]", b'{"mass": NaN}', b""):
        (tmp_path / "text.json").write_bytes(content)
        with pytest.raises(ValueError, match="expected a servo log"):
            load_servo_log(tmp_path / "text.json")


def test_a_flight_log_without_a_load_or_a_cycle_is_refused(tmp_path: Path):
    bench = make_bench([make_bench_joint(SHEET, 1)], baud=1_000_000)
    load = {"servo": SHEET.name, "mass": 1.0, "arm": 0.1, "hang": 0.0, "p_gain": 800}
    for about, expected in (
        ({"scene": "flat"}, "missing required field `servo`, expected one of a servo with a load"),
        (load | {"trajectory": "drop"}, "it has no cycle"),
    ):
        with FlightLog(tmp_path / "flight.mcap", bench, about=about) as log:
            pass
        with pytest.raises(ValueError, match=expected):
            load_servo_log(log.path)


def test_the_command_refuses_what_it_cannot_identify(logs: list[ServoLog], tmp_path: Path):
    files = tuple(write_servo_log(tmp_path / f"{k}.json", log) for k, log in enumerate(logs[:4]))
    other = write_servo_log(tmp_path / "other.json", logs[0], motor="mx64")
    (tmp_path / "robot.toml").write_text("")
    request = FitServoRequest(logs=files, write=tmp_path)
    wrong = {
        "expected logs of a XM430-W350, not other.json of mx64": {"hold_out": (other,)},
        r"choose --servo among MX-64\(2.0\), MX-64\(1.0\)": {"logs": (other, *files)},
        "logs to fit are 2, expected 3 or more": {"logs": files[:2]},
        "is the same as .*, expected other logs": {"hold_out": files[:1]},
        "Is a directory": {"logs": (tmp_path, *files)},
        "--servo is XM, expected one of": {"servo": "XM"},
        "expected the folder of a robot": {"write": tmp_path / "none"},
    }
    for expected, change in wrong.items():
        with pytest.raises((BadInputError, OSError), match=expected) as caught:
            identify_servo(replace(request, **change))
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "servos.toml").exists()


def drive(log: ServoLog, divisor: float) -> Array:
    """Compute the PWM that a servo with a gain divisor logs."""
    error = (log.goal - log.joint_pos) / SHEET.rad_per_tick
    return np.clip(error * log.p_gain / divisor / PWM_FULL_SCALE, -1.0, 1.0)


def test_logs_that_say_little_or_contradict_the_servo_are_named(logs: list[ServoLog]):
    sound = [replace(log, duty=drive(log, SHEET.gain_divisor)) for log in logs]
    assert not list(find_warnings(logs, SHEET))
    assert not list(find_warnings(sound, SHEET))
    (one_load,) = find_warnings(sound[:3], SHEET)
    assert one_load.startswith("all logs have one load and one P gain: record others")
    still = [replace(log, joint_pos=0.1 * log.joint_pos, duty=None) for log in logs]
    (no_reach,) = find_warnings(still, SHEET)
    assert no_reach.startswith("the servo moved by 0.")
    halved = replace(logs[4], duty=drive(logs[4], 2.0 * SHEET.gain_divisor))
    (divisor,) = find_warnings([*sound, halved], SHEET)
    assert divisor.startswith("waves 400: PWM is 0.50")
    assert "expected a gain divisor of 256, not 128" in divisor
