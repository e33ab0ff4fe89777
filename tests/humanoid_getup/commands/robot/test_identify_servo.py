"""`getup identify servo --port`: a virtual servo with hidden figures is recorded and identified."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from bus_stories import Served, run_json, serving
from nonempty import nonempty

from drivers.dynamixel import backend
from drivers.dynamixel import bus as bus_module
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.errors import DriverError, SetupError
from drivers.safety_guard import SafetyGuard
from drivers.service import moved_servo, recorded_servo
from drivers.service.moved_servo import find_bench
from drivers.service.recorded_servo import Excitation, ServoRecorder
from drivers.state import Command, State
from humanoid_getup.commands.main import main
from robots.bench import Load, ServoBench, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models
from sim2real.identification import servo_fit
from sim2real.identification.servo_log import load_servo_log

SHEET = servo_models()["XM430-W350"]
LOAD = Load(mass=1.0, arm=0.18)
HANGING = 2048 + 300
HIDDEN = {
    "motor_constant": 2.1,
    "resistance": 6.2,
    "armature": 0.0035,
    "friction": 0.15,
    "viscous_friction": 0.02,
    "load_friction": 0.2,
    "load_friction_slope": 0.05,
}


@pytest.fixture(autouse=True)
def hurry(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Record shorter motions with two gains."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(bus_module, "PING_SLOT", 0.001)
    monkeypatch.setattr(backend, "STILL", 0.001)
    for name, value in {"LENGTH": 1.5, "P_GAINS": (0.4, 1.0), "REST_TIME": 0.25}.items():
        monkeypatch.setattr(recorded_servo, name, value)


@contextmanager
def serving_lever(baud: int = 1_000_000) -> Iterator[Served]:
    """Serve a servo that hides its figures; its lever is mounted off the middle, and hangs not."""
    figures = dict(HIDDEN)
    motor, ohms, volts = figures.pop("motor_constant"), figures.pop("resistance"), 12.0
    model = replace(
        SHEET,
        stall_torque=motor * volts / ohms,
        stall_current=volts / ohms,
        no_load_speed=volts / motor,
        **figures,
    )
    joint = make_bench_joint(model, 1)
    joint = replace(joint, servo=replace(joint.servo, zero_ticks=HANGING))
    bench = make_bench([joint], baud=baud, loads=[LOAD])
    with serving(bench) as served, pytest.MonkeyPatch.context() as patch:

        def make_driver(robot: ServoBench, *_: object) -> DynamixelBackend:
            options = DriverOptions(make_port=served.make_port)
            ports = {"main": served.path}
            return DynamixelBackend(
                robot, ports, clock=CycleClock(), without_imu=True, options=options
            )

        patch.setattr("drivers.service.loose_servo.SerialPort", served.make_port)
        patch.setattr(moved_servo, "make_driver", make_driver)
        served.place(servo_1=20.0)
        yield served


def line(served: Served, *more: str, load: str = "1.0:0.18") -> tuple[str, ...]:
    where = ("--port", served.path, "--id", "1", "--load", load)
    return ("identify", "servo", *where, "--out", "logs", *more)


def test_a_servo_is_recorded_and_its_hidden_figures_are_found(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """Its offset is that of where friction holds the mass."""
    monkeypatch.setattr(servo_fit, "MODELS", {"friction by load": 8})
    monkeypatch.setattr(servo_fit, "TRIED", 1)
    monkeypatch.delitem(recorded_servo.TRAJECTORIES, "slow_sine")
    with serving_lever() as served:
        code, found = run_json(*line(served, "--yes"), capsys=capsys)
        assert served.peek("torque_enable") == [0]
    assert (code, found["servo"], len(found["logs"])) == (0, "XM430-W350", 6)
    for name in ("motor_constant", "resistance", "armature", "friction"):
        assert found["parameters"][name] == pytest.approx(HIDDEN[name], rel=0.15), name
    covered = [
        low <= HIDDEN[name] <= high
        for name, (low, high) in found["intervals"].items()
        if name in HIDDEN
    ]
    assert sum(covered) >= 6
    assert abs(found["parameters"]["offset"]) < 0.03
    assert found["held_out_mae_mrad"] < 15.0 < 30.0 < found["catalog_mae_mrad"]

    files = nonempty(sorted(Path("logs").iterdir()))
    logs = [load_servo_log(path) for path in files]
    assert {log.trajectory for log in logs} == set(recorded_servo.TRAJECTORIES)
    assert {log.p_gain for log in logs} == {320.0, 800.0}
    assert {log.trajectory for log in logs if not log.torque_on.all()} == {"drop"}


def test_what_cannot_be_recorded_is_refused_before_anything_is_written(
    capsys: pytest.CaptureFixture[str],
):
    with serving_lever() as served:
        wrong = {
            "3 N·m, expected 0.82 to 2.73 N·m for a XM430-W350": line(served, load="1.7:0.18"),
            "0.0177 N·m, expected 0.82 to 2.73 N·m": line(served, load="0.018:0.1"),
            "--servo is MX-28(2.0), expected XM430-W350": line(served, "--servo", "MX-28(2.0)"),
            "has to keep return_delay_time = 0 without power: --yes writes that": line(served),
        }
        for expected, words in wrong.items():
            assert main(words) == 2
            error = capsys.readouterr().err
            assert expected in error
            assert error.count("\n") == 1
        assert served.peek("return_delay_time") == [250]
    with serving_lever(baud=57_600) as slow:
        assert main(line(slow, "--yes")) == 2
        assert "a cycle takes 42 ms, expected 20 ms at most" in capsys.readouterr().err
    assert not Path("logs").exists()


def test_a_servo_without_room_or_one_that_the_guard_stops_leaves_no_log(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    step = Excitation.step
    with serving_lever() as served:
        served.poke("servo_1", "max_position_limit", HANGING + 400)
        assert main(line(served, "--yes")) == 2
        assert "range is -180° to +62° and the mass hangs at" in capsys.readouterr().err
        served.poke("servo_1", "max_position_limit", 4095)
        served.poke("servo_1", "pwm_limit", 700)
        assert main(line(served, "--yes")) == 3
        assert "PWM is limited to 79%, expected 100%" in capsys.readouterr().err
        served.poke("servo_1", "pwm_limit", 885)

        def heat(controller: Excitation, state: State) -> Command:
            served.heat(1, 78.0)
            return step(controller, state)

        monkeypatch.setattr(Excitation, "step", heat)
        assert main(line(served, "--yes")) == 3
        error = capsys.readouterr().err
        assert "a servo is too hot: joint 'servo_1' has 78 °C" in error
        assert error.count("\n") == 1
        assert served.peek("torque_enable") == [0]
    assert not list(Path().iterdir())


def test_a_hot_servo_pauses_until_it_is_cool_or_ends_the_recording(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """It cools by 0.06 °C a second; after the pause its range is found too narrow."""
    told: list[str] = []
    monkeypatch.setattr(recorded_servo, "LONGEST_PAUSE", 1.0)
    with serving_lever() as served:
        served.poke("servo_1", "max_position_limit", HANGING + 400)
        bench, _ = find_bench(served.path, 1, None, None, limit_by="pwm")
        guard = SafetyGuard(moved_servo.make_driver(bench, {}))
        recorder = ServoRecorder(guard=guard, load=LOAD, realtime=False, tell=told.append)
        served.heat(1, 57.52)
        with pytest.raises(SetupError, match="range is"):
            recorder.record(tmp_path, lambda _: None)
        assert told == ["pause: it has 58 °C, and goes on at 57 °C"]
        served.heat(1, 70.0)
        with pytest.raises(DriverError, match="still has 70 °C after 1 s without torque"):
            recorder.record(tmp_path, lambda _: None)
