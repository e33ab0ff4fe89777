"""`getup sit`, `getup hold` and `--then`: a robot that stands does not drop, and a key ends it."""

from __future__ import annotations

import itertools
import json
import os
import pty
import time
from pathlib import Path

import pytest

from drivers import Command, FaultKind, SafetyGuard, Twin
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.get_up.operator_key import SAME_PRESS, OperatorKey
from humanoid_getup.commands.get_up.options import GetUpOptions
from humanoid_getup.commands.get_up.play import PlayRequest
from humanoid_getup.commands.main import main
from humanoid_getup.execution.session import Phase, PhaseChange
from robots import Robot

SQUAT = "squat_to_stand"


def run(*arguments: str, out: Path) -> tuple[int, dict]:
    figures = out / "figures.json"
    code = main([*arguments, "--json", str(figures)])
    return code, json.loads(figures.read_text())


@pytest.mark.parametrize("backend", ["twin", pytest.param("virtual", marks=pytest.mark.slow)])
@pytest.mark.usefixtures("no_film")
def test_a_robot_sits_and_lies_down(backend: str, tmp_path: Path, op3: Robot):
    arguments = ("sit", "--backend", backend, "--torque-limit", "2.5", "--out", str(tmp_path))
    code, report = run(*arguments, out=tmp_path)
    assert (code, report["succeeded"], report["then"]) == (0, True, "sit")
    assert report["reason"] == "sat and lay down, torque off"
    assert report["head_impact_m_s"] < 0.3
    written = {path.name for path in tmp_path.iterdir()}
    assert {"report.json", "flight.mcap", "torque.png"} <= written
    flight = FlightRecord.load(tmp_path / "flight.mcap", op3)
    assert len(flight.state["joint_pos"]) * op3.control_period > 8.0


def test_a_held_robot_is_judged_and_handed_over(tmp_path: Path):
    code, report = run("hold", "--then", "hand-over", out=tmp_path)
    assert (code, report["reason"][-24:]) == (0, "handed over under torque")
    assert report["held_s"] > 3.0
    assert len(report["hand_over"]["joints"]) == 20
    assert report["hand_over"]["watchdog"] == "off"


def test_without_a_terminal_or_the_clock_of_the_wall_nothing_waits_for_a_key():
    reader, writer = os.pipe()
    for realtime in (True, False):
        assert OperatorKey(realtime=realtime, terminal=reader).is_released()
    os.close(reader)
    os.close(writer)


def test_a_robot_on_servos_is_held_by_default():
    assert GetUpOptions().ending == "limp"
    assert GetUpOptions(backend="virtual").ending == "hold"
    assert GetUpOptions(backend="dynamixel", port=("/dev/ttyUSB0",)).ending == "hold"
    assert PlayRequest(motion=SQUAT, backend="virtual", then="limp").ending == "limp"


def test_a_key_releases_a_robot_that_is_held_and_stops_one_that_moves(op3: Robot):
    master, slave = pty.openpty()
    guard = SafetyGuard(Twin(op3))
    key = OperatorKey(realtime=True, terminal=slave)
    with key.watch(guard), guard:
        key.note(PhaseChange(Phase.HOLDING, 1, ""))
        assert not key.is_released()
        pressed = time.monotonic()
        until = pressed + 5.0
        os.write(master, b" ")
        while not key.is_released() and time.monotonic() < until:
            time.sleep(0.005)
        assert key.is_released()
        assert guard.fault is None
        key.note(PhaseChange(Phase.LYING_DOWN, 1, ""))
        while guard.fault is None and time.monotonic() < until:
            os.write(master, b" ")
            guard.read()
            guard.write(Command.limp(op3.n))
        assert guard.fault is not None
        assert guard.fault.kind is FaultKind.STOPPED
        assert time.monotonic() - pressed > SAME_PRESS, "the key that released it repeats itself"
    os.close(master)
    os.close(slave)


@pytest.mark.usefixtures("no_film")
def test_an_interrupt_of_a_hold_still_writes_report_and_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    calls = itertools.count()

    def interrupt(_key: OperatorKey) -> bool:
        if next(calls) > 50:
            raise KeyboardInterrupt
        return False

    monkeypatch.setattr(OperatorKey, "is_released", interrupt)
    code, report = run("play", SQUAT, "--then", "hold", "--out", str(tmp_path), out=tmp_path)
    assert (code, report["stood"]) == (130, True)
    failed = "holding the stand failed: it was interrupted; torque off"
    assert report["after"]["reason"] == failed
    assert json.loads((tmp_path / "report.json").read_text()) == report
    assert (tmp_path / "torque.png").exists()
