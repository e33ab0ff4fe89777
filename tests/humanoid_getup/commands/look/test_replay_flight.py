"""A replayed flight is what `getup replay` prints, with the postures of robot and twin."""

import json
import pickle
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_recording import record_swing, twin_of
from paths import TINY

from drivers import Cycle, Twin
from drivers.flight_log.writer import FlightLog
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.look.replay import (
    ReplayedFlight,
    ReplayRequest,
    replay_flight,
)
from humanoid_getup.commands.main import main
from humanoid_getup.reporting.measured_flight import CutKind
from humanoid_getup.scenes.named_scenes import FOLDER
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.individual import Individual
from robots.kinematics import lowest_points
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
    np.testing.assert_array_equal(copy.measured.qpos, flight.measured.qpos)
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


def test_the_measured_robot_lies_over_its_twin_where_both_moved_the_same(flight: ReplayedFlight):
    """All but the encoders' steps, the filter's small errors and the height, which is a guess."""
    world = flight.world
    layout = world.robot.layout(world.model)
    measured, twin = flight.measured.qpos, flight.twin.qpos
    np.testing.assert_allclose(measured[:, layout.qpos], twin[:, layout.qpos], atol=0.001)
    apart = quaternion.angle_between(
        measured[:, layout.root_orientation], twin[:, layout.root_orientation]
    )
    assert apart.max() < 0.1
    np.testing.assert_allclose(flight.measured.height, flight.twin.height, atol=0.02)
    np.testing.assert_allclose(lowest_points(world.model, measured), -0.0005, atol=1e-9)
    assert np.ptp(flight.twin.tilt) > 0.1
    np.testing.assert_allclose(flight.measured.tilt, flight.twin.tilt, atol=0.1)


def test_a_robot_that_stands_still_does_not_slide_with_a_twin_that_falls(
    tiny: Robot, tmp_path: Path
):
    """It is placed as its twin until that leans by more than 0.3 rad."""

    def stand(cycle: Cycle) -> Cycle:
        upright = np.array([1.0, 0.0, 0.0, 0.0])
        state = replace(cycle.state, joint_pos=tiny.standing.joint_pos, orientation=upright)
        return replace(cycle, state=state)

    record_swing(tmp_path / "f", tiny, twin_of(tiny), tiny.standing, stand)
    flight = replayed(tmp_path / "f")
    apart = flight.report.tilt_difference > 0.3
    assert 10 < apart.argmax() < len(apart) - 10
    place = flight.world.robot.layout(flight.world.model).root_position
    measured, twin = flight.measured.qpos[:, place], flight.twin.qpos[:, place]
    np.testing.assert_array_equal(
        measured[: apart.argmax(), :2], twin[: apart.argmax(), :2], "together"
    )
    assert np.ptp(twin[apart.argmax() :, :2], axis=0).max() > 0.01
    assert np.ptp(measured[apart.argmax() :], axis=0).max() < 1e-9
    assert np.ptp(measured[:, 2]) < 1e-9


def test_torque_is_estimated_from_current_and_a_limit_that_was_cut_is_one_episode_of_both_joints(
    flight: ReplayedFlight,
):
    """1.5 N·m were asked for, 1.0 N·m is the guard's limit."""
    model = flight.world.robot.joints[0].servo.model
    current = flight.record.state["joint_current"]
    np.testing.assert_allclose(flight.torque, current * model.stall_torque / model.stall_current)
    assert np.abs(flight.torque).max() > 0.1
    (cut,) = [each for each in flight.cuts if each.kind is CutKind.TORQUE]
    assert cut.joints == flight.record.joint_names
    assert (cut.begin, cut.end) == (0.0, flight.report.time[-1])
    assert cut.largest == pytest.approx(0.5, abs=0.03)
    assert str(cut).startswith("2 joints: torque limit cut by up to 0.5")


def test_a_target_that_is_too_fast_is_cut_in_the_cycles_in_which_the_guard_counts_it(
    tiny: Robot, tmp_path: Path
):
    record_swing(tmp_path / "f", tiny, twin_of(tiny), tiny.standing, rate=60.0)
    flight = replayed(tmp_path / "f")
    counted = np.diff(flight.record.tracks["clips"]["velocity"], axis=0, prepend=0) > 0  # (T, n)
    assert counted.any()
    cuts = [each for each in flight.cuts if each.kind is CutKind.TARGET]
    for joint, name in enumerate(tiny.joint_names):
        mine = [each for each in cuts if name in each.joints]
        first, last = np.flatnonzero(counted[:, joint])[[0, -1]]
        assert mine[0].begin == flight.report.time[first]
        assert mine[-1].end == flight.report.time[last]
        assert all(each.begin <= each.end for each in mine)


def test_a_log_of_a_flight_without_an_imu_is_refused(tiny: Robot, tmp_path: Path):
    blind = Twin(World(tiny), without_imu=True)
    record_swing(tmp_path / "f", tiny, blind, tiny.standing)
    with pytest.raises(BadInputError, match="it has no orientation, expected an IMU's"):
        replayed(tmp_path / "f")


def test_a_scene_file_that_a_log_names_is_read_within_folders_alone(tiny: Robot, tmp_path: Path):
    scene = FOLDER / "ice.toml"
    path = tmp_path / "f"
    with FlightLog(path, tiny, about={"scene": str(scene)}, start=tiny.standing) as log:

        def copy(cycle: Cycle) -> Cycle:
            log.log(cycle)
            return cycle

        record_swing(tmp_path / "other", tiny, twin_of(tiny), tiny.standing, copy)
    request = ReplayRequest(log=path, robot=str(TINY))
    assert replay_flight(request).scene == replay_flight(request, folders=[FOLDER]).scene
    with pytest.raises(BadInputError, match=f"its scene is {scene}, expected a file in"):
        replay_flight(request, folders=[tmp_path])
    assert replay_flight(replace(request, scene="flat"), folders=[tmp_path]).scene == "flat"


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
