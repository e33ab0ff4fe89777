"""`getup doctor`: what it finds before first torque, and that it only looks."""

import os
import pty
from contextlib import nullcontext
from dataclasses import replace

import pytest
from bus_stories import TINY, run_json, serving
from nonempty import nonempty

from drivers import Command
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.service import doctor, session
from drivers.service.doctor import Latency, PortReport, check_port
from humanoid_getup.commands.main import main
from robots import load_robot

SHIPPED = "all 2 servos: return delay time is 250, 500 µs before each reply"


@pytest.fixture(autouse=True)
def busy_machine(monkeypatch):
    """Let readings take as long as they do where other programs run too."""
    monkeypatch.setattr(doctor, "READ_SHARE", 1000.0)


@pytest.fixture
def patience(monkeypatch):
    """Wait long for answers where none is missing."""
    monkeypatch.setattr(session, "SETUP_MARGIN", 0.5)


def examine(served, capsys, *, robot=TINY) -> tuple[int, dict]:
    return run_json("doctor", "--robot", str(robot), "--port", served.path, capsys=capsys)


# Healthy robots ------------------------------------------------------------------------------


@pytest.mark.usefixtures("patience")
def test_a_healthy_op3_is_healthy_and_tells_all_its_joints_and_figures(capsys):
    with serving("op3") as served:
        served.hold(served.robot.standing.joint_pos)
        code, message = examine(served, capsys, robot="op3")
    assert code == 0
    assert message["healthy"] is True
    assert list(message["joints"]) == list(served.robot.joint_names)
    knee = message["joints"]["r_knee"]
    assert (knee["id"], knee["model"], knee["firmware"]) == (13, "XM430-W350", 46)
    assert (knee["temperature_c"], knee["voltage_v"]) == (25.0, pytest.approx(12.0))
    assert knee["angle_rad"] == pytest.approx(-0.8901, abs=0.001)
    assert knee["lower_rad"] < knee["angle_rad"] < knee["upper_rad"]
    assert knee["return_delay_s"] == pytest.approx(500e-6)
    assert knee["hardware_error"] == 0 and knee["torque_on"] is False
    (port,) = message["ports"]
    assert port["baud"] == 2_000_000 and port["latency_timer"] is None
    latency = port["latency"]
    assert (latency["rounds"], latency["kind"]) == (50, "fast sync read")
    assert latency["lost"] == 0 and latency["damaged"] == 0
    assert 0.0 < latency["group_median"] <= latency["reading_median"] <= latency["reading_p99"]
    # Group: 34 bytes out, 8 + 20 x 14 back. IMU and one slow value: 20 out, 23 + 14 back.
    # Goals: 14 + 20 x 5 out.
    assert port["cycle_bytes"] == 34 + 288 + 20 + 37 + 114
    assert port["cycle_time"] == pytest.approx(port["cycle_bytes"] * 10 / 2e6)
    assert message["accelerometer_m_s2"][2] == pytest.approx(9.81, abs=0.05)


@pytest.fixture
def tiny_served():
    with serving(TINY) as served:
        served.place()
        yield served


def test_the_bytes_of_a_cycle_are_those_that_the_driver_sends(tiny_served, capsys):
    _, message = examine(tiny_served, capsys)
    robot = load_robot(TINY)
    backend = DynamixelBackend(robot, {"main": tiny_served.path}, clock=CycleClock())
    sizes = set()
    with backend:
        for _ in range(12):
            backend.read()
            backend.write(Command.limp(robot.n))
            sizes.add(backend.cycle_bytes)
    # The lengths of questions turn from cycle to cycle, by a few bytes a servo.
    assert min(sizes - {0}) <= message["ports"][0]["cycle_bytes"] <= max(sizes) + 4


@pytest.mark.usefixtures("patience")
def test_a_person_sees_verdict_joints_latency_and_what_was_done(tiny_served, capsys):
    assert main(("doctor", "--robot", str(TINY), "--port", tiny_served.path)) == 0
    out = capsys.readouterr().out
    for words in (
        "tiny: healthy, 3 warnings",
        "operating mode is 3; nothing to do: the driver sets it to 5",
        "torque limits: by current, in current based position mode",
        SHIPPED,
        "l_hip",
        "-90 to +60",
        "fast sync read: median",
        "125 Hz needs at most 6.0 ms",
        "bytes",
        "no calibration: zeros and signs are those of the description",
        "read only: no torque was switched",
    ):
        assert words in out, out


def test_it_says_whether_the_loop_goes_before_other_programs(tiny_served, monkeypatch, capsys):
    for permitted in (True, False):
        monkeypatch.setattr(doctor, "in_real_time_class", lambda on=permitted: nullcontext(on))
        main(("doctor", "--robot", str(TINY), "--port", tiny_served.path))
        said = " ".join(capsys.readouterr().out.split())
        assert ("the control loop goes before other programs" in said) is permitted
        told = "rtprio 60 in /etc/security/limits.d permits it: beside"
        assert (told in said) is not permitted


# Ill ones ------------------------------------------------------------------------------------


def test_a_dead_servo_is_named_and_the_others_are_reported(capsys):
    def cut(virtual):
        virtual.servos[1].alive = False

    with serving(TINY, prepare=cut) as served:
        code, message = examine(served, capsys)
    assert code == 3
    assert message["healthy"] is False
    (error,) = (each for each in message["findings"] if each["severity"] == "error")
    assert (error["device"], error["text"]) == ("joint 'r_hip' (id 2)", "silent")
    assert error["remedy"].startswith("check its cable")
    assert list(message["joints"]) == ["l_hip"]
    assert message["ports"][0]["latency"] is not None


# Ports ---------------------------------------------------------------------------------------

TIMES = {"group_median": 0.001, "group_p99": 0.002, "reading_median": 0.002, "reading_p99": 0.003}
LATENCY = Latency(rounds=50, kind="sync read", return_delays=0.0, lost=0, damaged=0, **TIMES)
WIRE = {"baud": 2_000_000, "latency_timer": 1, "cycle_bytes": 500, "cycle_time": 0.0025}
PORT = PortReport(name="main", path="/dev/ttyUSB7", latency=LATENCY, **WIRE)
SLOW = {
    "error, holds replies back for up to 16 ms, expected 1 ms": {"latency_timer": 16},
    "warning, up to 2 ms, expected 1 ms": {"latency_timer": 2},
    "error, a cycle takes 9.0 ms on the wire, expected 8.0 ms": {"cycle_time": 0.009},
    "error, reading takes 7.0 ms of each cycle, expected at most 6.0 ms": {
        "latency": replace(LATENCY, reading_median=0.007, reading_p99=0.01)
    },
    "warning, reading takes up to 7.0 ms": {"latency": replace(LATENCY, reading_p99=0.007)},
    "warning, in 50 reads 3 replies were lost and 1 damaged": {
        "latency": replace(LATENCY, lost=3, damaged=1)
    },
}


def test_a_line_that_is_too_slow_or_loses_answers_is_reported_with_a_remedy(monkeypatch):
    monkeypatch.setattr(doctor, "READ_SHARE", 0.75)
    for expected, line in nonempty(SLOW.items()):
        (finding,) = check_port(replace(PORT, **line), period=0.008)
        severity, words = expected.split(", ", 1)
        assert finding.severity.value == severity, expected
        assert words in finding.text
        assert finding.device == "port /dev/ttyUSB7"
        assert finding.remedy, expected
    assert check_port(PORT, period=0.008) == []
    assert "usb-serial/devices/ttyUSB7/latency_timer" in doctor.describe_timer_remedy(PORT.path)


def test_a_port_without_devices_says_what_to_check(capsys):
    master, slave = pty.openpty()
    try:
        code = main(("doctor", "--robot", str(TINY), "--port", os.ttyname(slave)))
    finally:
        os.close(master)
        os.close(slave)
    assert code == 3
    out = " ".join(capsys.readouterr().out.split())
    assert "silent: all 2 servos" in out
    assert "check the power switch" in out
