"""A replayed flight is what `getup replay` prints."""

import json
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from flight_recording import record_swing, twin_of
from paths import TINY

from drivers import Twin
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.look.replay import (
    ReplayedFlight,
    ReplayRequest,
    replay_flight,
)
from humanoid_getup.commands.main import main
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.individual import Individual
from robots.storage.encoding import to_json


def replayed(log: Path, **options: object) -> ReplayedFlight:
    return replay_flight(ReplayRequest(log=log, robot=str(TINY), **options))  # pyright: ignore[reportArgumentType]


@pytest.fixture(scope="module")
def flight(swing: Path) -> ReplayedFlight:
    return replayed(swing)


def test_the_function_has_what_the_command_prints_and_writes(
    swing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    flight = replayed(swing, out=tmp_path / "function")
    words = ["replay", str(swing), "--robot", str(TINY), "--out", str(tmp_path / "command")]
    assert main([*words, "--json", "-"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == json.loads(to_json(flight.describe()))
    assert printed.err.startswith(flight.report.headline)
    assert flight.record.describe() in printed.err
    names = [path.name for path in flight.written]
    assert names == ["replay.json", "replay.html"]
    assert flight.describe()["identified"] is None
    for name in names:
        written = tmp_path / "function" / name, tmp_path / "command" / name
        assert written[0].read_bytes() == written[1].read_bytes(), name
    copy = pickle.loads(pickle.dumps(flight))
    assert copy.describe() == flight.describe()


def test_of_an_identified_robot_both_twins_and_the_share_of_the_gap_closed_are_told(
    tiny: Robot, own_robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    true, found = (
        Individual(robot="tiny", friction=factor, supply_resistance=1.0) for factor in (4.0, 3.5)
    )
    log = tmp_path / "f.mcap"
    record_swing(log, tiny, twin_of(tiny.with_individual(true)), tiny.standing)
    as_described = replayed(log).describe()
    found.save(own_robot / "identified.toml", [])
    words = ["replay", str(log), "--robot", str(own_robot), "--out", str(tmp_path / "out")]
    assert main([*words, "--json", str(tmp_path / "r.json")]) == 0
    figures = json.loads((tmp_path / "r.json").read_text())
    identified = figures["identified"]
    assert figures["rms_rad"] == as_described["rms_rad"] > 3.0 * identified["rms_rad"] > 0.0
    assert identified["gap_closed"].keys() == {*figures["phases"], "flight"}
    share = 1.0 - identified["rms_rad"] / figures["rms_rad"]
    assert identified["gap_closed"]["flight"] == pytest.approx(share)
    lines = capsys.readouterr().out.splitlines()
    (row,) = [line.split() for line in lines if line.startswith("flight")]
    assert (row[1], row[-1]) == (f"{1e3 * figures['rms_rad']:.1f}", f"{share:.0%}")
    assert "friction 3.5" in (tmp_path / "out" / "replay.html").read_text()
    twins = replay_flight(ReplayRequest(log=log, robot=str(own_robot))).twins.values()
    sags = [np.ptp(twin.curves["supply [V]"]) for twin in twins]
    assert sags[0] == 0.0 < sags[1], "resistance was identified"


def test_a_log_of_a_flight_without_an_imu_is_refused(tiny: Robot, tmp_path: Path):
    blind = Twin(World(tiny), without_imu=True)
    record_swing(tmp_path / "f", tiny, blind, tiny.standing)
    with pytest.raises(BadInputError, match="it has no orientation, expected an IMU's"):
        replayed(tmp_path / "f")


def test_without_the_extra_one_line_names_the_command_that_installs_it(
    swing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
):
    monkeypatch.delitem(sys.modules, "humanoid_getup.ros.rosbag", raising=False)
    monkeypatch.setitem(sys.modules, "mcap_ros2", None)
    monkeypatch.setitem(sys.modules, "mcap_ros2.writer", None)
    words = ["log", "export", str(swing), "--robot", str(TINY), "--rosbag2", str(tmp_path / "bag")]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'humanoid-getup[ros]'" in line
    assert list(tmp_path.iterdir()) == []
