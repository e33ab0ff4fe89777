"""`getup replay` and `getup log export`, as a person uses them."""

import resource
import sys
from pathlib import Path

import pytest
from flight_recording import SECOND, Swing, twin_of
from paths import TINY

from drivers import Cycle, Ending, GuardLimits, SafetyGuard, run
from drivers.flight_log.writer import FlightLog
from humanoid_getup.commands import command_line as commands
from humanoid_getup.commands.main import main


def parse(*arguments: object) -> commands.Invocation:
    return commands.parse(["replay", *map(str, arguments)])


def test_the_command_replays_what_a_full_disk_has_of_a_flight(tiny, tmp_path, capsys):
    path = tmp_path / "f"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    guard = SafetyGuard(twin_of(tiny), GuardLimits.of(tiny, torque_limit=1.0))

    def see(cycle: Cycle) -> None:
        log.log(cycle)
        if log.cycles == 50:
            log.event(cycle.state.time, "phase", "on disk")
            resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 100, hard))

    log = FlightLog(path, tiny, start=tiny.standing)
    try:
        with log:
            report = run(Swing(tiny), guard, max_time=SECOND, on_cycle=see)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert report.ending is Ending.TIMEOUT
    assert log.fault is not None
    assert log.fault.endswith(
        "File too large, recording stopped; at least its first 50 cycles can be replayed"
    )
    assert parse(path, "--robot", TINY).load()() == 0
    message = " ".join(capsys.readouterr().out.split())
    assert "the twin moved exactly as logged" in message
    assert "tiny: 50 cycles, 0.39 s, 1 events, cut off: 100 bytes lost" in message


def test_without_the_extra_one_line_names_the_command_that_installs_it(
    swing: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.delitem(sys.modules, "humanoid_getup.ros.rosbag", raising=False)
    monkeypatch.setitem(sys.modules, "mcap_ros2", None)
    monkeypatch.setitem(sys.modules, "mcap_ros2.writer", None)
    words = ["log", "export", str(swing), "--robot", str(TINY), "--rosbag2", str(tmp_path / "bag")]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'humanoid-getup[ros]'" in line
    assert list(tmp_path.iterdir()) == []
