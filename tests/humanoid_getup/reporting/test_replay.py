"""A flight log that was recorded on the twin replays on the twin to the last bit."""

import json
import resource
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paths import TINY

from drivers import Command, Cycle, Ending, GuardLimits, SafetyGuard, State, Twin, run
from drivers.flight_log.reader import FlightRecord
from drivers.flight_log.writer import FlightLog
from humanoid_getup.cli import commands
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.reporting.replay import ReplayReport, choose_supply, replay
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, load_robot
from robots.quaternion import multiply
from robots.servo import LimitMode
from robots.storage.encoding import to_plain

SECOND = 1.0


class Swing:
    """Swing all joints about where they were."""

    done = False

    def __init__(self, robot: Robot) -> None:
        self.robot = robot

    def reset(self, state: State) -> None:
        self.middle = state.joint_pos

    def step(self, state: State) -> Command:
        angle = 0.5 * np.sin(6.0 * state.time + np.arange(self.robot.n))
        return Command.position(self.robot, self.middle + angle, torque_limit=1.5)


def twin_of(robot: Robot, voltage: float | None = None, limit_by: LimitMode | None = None) -> Twin:
    return Twin(World(robot), voltage=voltage, limit_by=limit_by)


def record_swing(path: Path, robot: Robot, twin: Twin, start: Posture | None, spoil=None) -> None:
    guard = SafetyGuard(twin, GuardLimits.of(robot, torque_limit=1.0))
    with FlightLog(path, robot, start=start) as log:
        see = (lambda cycle: log.log(spoil(cycle))) if spoil else log.log
        report = run(Swing(robot), guard, max_time=SECOND, on_cycle=see)
        log.event(report.duration, "phase", "over")
    assert report.ending is Ending.TIMEOUT


@pytest.fixture(scope="module")
def tiny() -> Robot:
    return load_robot(TINY)


@pytest.fixture(scope="module")
def swing(tiny, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("swing") / "swing.mcap"
    record_swing(path, tiny, twin_of(tiny), tiny.standing)
    return path


def spoiled(record: FlightRecord, name: str, change) -> FlightRecord:
    """Change one column of what was measured."""
    state = record.tracks["state"]
    columns = {**state.columns, name: change(state[name].copy())}
    return replace(record, tracks={**record.tracks, "state": replace(state, columns=columns)})


@pytest.mark.parametrize("name", ["tiny", "op3"])
def test_a_flight_of_the_twin_is_reproduced_exactly(name, tmp_path, tiny, op3):
    robot = {"tiny": tiny, "op3": op3}[name]
    record_swing(tmp_path / "f", robot, twin_of(robot), robot.standing)
    record = FlightRecord.load(tmp_path / "f", robot)
    assert record.start is not None
    assert np.ptp(record.state["joint_pos"], axis=0).min() > 0.02  # something moved
    report = replay(record, twin_of(robot), record.start)
    assert report.is_exact
    assert (report.rms == 0.0).all()
    assert (report.maximum == 0.0).all()
    assert report.divergence is None
    assert (report.time[-1], len(report.time)) == (pytest.approx(0.992), 125)


def test_another_supply_makes_another_flight_and_tells_when(tmp_path, tiny):
    """In position mode, in which the stiffness of servos follows the supply."""
    weak = tiny.supply_voltage - 1.0
    record_swing(tmp_path / "f", tiny, twin_of(tiny, weak, "pwm"), tiny.standing)
    record = FlightRecord.load(tmp_path / "f", tiny)
    report = replay(record, twin_of(tiny, None, "pwm"), tiny.standing, threshold=0.01)
    assert not report.is_exact
    first = report.divergence
    assert first is not None
    values = np.column_stack([report.difference, report.tilt_difference])
    row = int(np.argmax(np.abs(values).max(axis=1) > 0.01))
    assert first.time == report.time[row] > 0.0
    column = (*tiny.joint_names, None).index(first.joint)
    assert first.difference == values[row, column]
    assert choose_supply(record, tiny) == pytest.approx(weak)
    assert replay(record, twin_of(tiny, weak, "pwm"), tiny.standing).is_exact


def test_a_measured_voltage_that_rounds_to_the_nominal_one_is_nominal(swing, tiny):
    record = FlightRecord.load(swing)
    for measured, supply in ((tiny.supply_voltage + 0.05, tiny.supply_voltage), (10.0, 10.0)):
        changed = spoiled(record, "voltage", lambda v, to=measured: np.full_like(v, to))
        assert choose_supply(changed, tiny) == supply


def test_differences_are_worked_out_by_joint(tiny):
    report = ReplayReport(
        robot="tiny",
        joint_names=tiny.joint_names,
        time=np.array([0.0, 0.1, 0.2, 0.3]),
        difference=np.array([[0.0, 0.0], [0.0, 0.3], [-0.2, 0.4], [np.nan, 0.0]]),
        tilt_difference=np.array([0.0, 0.0, 0.2, 0.0]),
        threshold=0.25,
    )
    # sqrt(0.04 / 3 measured), sqrt((0.09 + 0.16) / 4)
    np.testing.assert_allclose(report.rms, [0.2 / np.sqrt(3.0), 0.25])
    np.testing.assert_allclose(report.maximum, [0.2, 0.4])
    assert report.divergence is not None
    assert (report.divergence.time, report.divergence.difference) == (0.1, 0.3)
    figures = report.figures()
    assert (figures.max_joint, figures.tilt_rms_rad) == (tiny.joint_names[1], 0.1)
    assert figures.divergence_part == "joint 'r_hip'"
    json.dumps(to_plain(figures), allow_nan=False)


def test_a_torso_that_leans_differs_in_tilt_alone_and_its_heading_is_free(swing, tiny):
    record = FlightRecord.load(swing, tiny)

    def turn(axis):  # 0.2 rad on the left: in the world
        half = np.array([np.cos(0.1), *(np.sin(0.1) * np.array(axis))])
        return spoiled(record, "orientation", lambda q: multiply(half, q))

    leaning = replay(turn([1.0, 0.0, 0.0]), twin_of(tiny), tiny.standing)
    assert leaning.maximum.max() == 0.0
    assert leaning.divergence is not None
    assert (leaning.divergence.time, leaning.divergence.part) == (0.0, "torso's tilt")
    np.testing.assert_allclose(leaning.tilt_difference, 0.2, atol=1e-9)
    turned = replay(turn([0.0, 0.0, 1.0]), twin_of(tiny), tiny.standing)
    np.testing.assert_allclose(turned.tilt_difference, 0.0, atol=1e-9)


def test_cycles_that_are_missing_are_bridged_by_the_last_command(swing, tiny):
    record = FlightRecord.load(swing, tiny)
    kept = np.r_[0:60, 62:125]  # commands hardly change in 16 ms
    tracks = {
        name: replace(
            track,
            cycle=track.cycle[kept],
            columns={key: values[kept] for key, values in track.columns.items()},
        )
        for name, track in record.tracks.items()
    }
    report = replay(replace(record, tracks=tracks), twin_of(tiny), tiny.standing)
    assert len(report.time) == 123
    assert (report.difference[:60] == 0.0).all()
    assert 0.0 < report.maximum.max() < 0.05


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda time: time[::-1], "-0.008 s pass after cycle 0, expected 0 to 5 s"),
        (lambda time: time + 60.0 * (time > 0.5), r"60\.008 s pass after cycle 62"),
        (lambda time: np.where(time > 0.5, np.nan, time), "nan s pass after cycle 62"),
    ],
)
def test_a_log_whose_clock_jumps_cannot_be_replayed(swing, tiny, change, message):
    record = spoiled(FlightRecord.load(swing), "time", change)
    with pytest.raises(ValueError, match=message):
        replay(record, twin_of(tiny), tiny.standing)


def test_a_log_of_another_robot_or_without_cycles_cannot_be_replayed(swing, tiny, op3, tmp_path):
    with pytest.raises(ValueError, match="it is of robot 'tiny', expected 'op3'"):
        replay(FlightRecord.load(swing), twin_of(op3), op3.standing)
    with FlightLog(tmp_path / "f", tiny):
        pass
    with pytest.raises(ValueError, match="it has no cycles"):
        replay(FlightRecord.load(tmp_path / "f"), twin_of(tiny), tiny.standing)


def parse(*arguments: object) -> commands.Invocation:
    return commands.parse(["replay", *map(str, arguments)])


def test_the_command_tells_that_the_twin_did_the_same(swing, tmp_path, capsys):
    out = tmp_path / "out"
    code = parse(swing, "--robot", TINY, "--out", out, "--json", tmp_path / "figures.json").load()()
    assert code == 0
    assert "the twin moved exactly as logged" in capsys.readouterr().out
    assert sorted(path.name for path in out.iterdir()) == [
        "flight.png",
        "replay.json",
        "replay.png",
    ]
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures == json.loads((out / "replay.json").read_text())
    assert (figures["exact"], figures["cycles"], figures["truncated"]) == (True, 125, False)
    assert figures["events"] == [
        {"time": pytest.approx(1.0), "kind": "phase", "text": "over", "cycle": 125}
    ]


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


def test_without_a_logged_start_the_command_estimates_it_from_the_first_measurement(
    op3, tmp_path, capsys
):
    record_swing(tmp_path / "f.mcap", op3, twin_of(op3), None)
    assert parse(tmp_path / "f.mcap", "--json", "-").load()() == 0
    message = capsys.readouterr()
    figures = json.loads(message.out)
    assert (figures["start"], figures["exact"]) == ("estimated", False)
    assert figures["divergence_s"] is None or figures["divergence_s"] > 0.2
    assert "log" in message.err


def test_a_log_with_a_blind_joint_and_a_fault_is_drawn_and_reported(tiny, tmp_path, capsys):
    def blind(cycle: Cycle) -> Cycle:
        angles = np.where([True, False], cycle.state.joint_pos, np.nan)
        return replace(cycle, state=replace(cycle.state, joint_pos=angles))

    record_swing(tmp_path / "f", tiny, twin_of(tiny), tiny.standing, blind)
    assert parse(tmp_path / "f", "--robot", TINY, "--out", tmp_path / "out").load()() == 0
    assert "no joint and no tilt differed" in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "replay.json").read_text())["exact"] is False


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("gone.mcap",), "flight log gone.mcap: No such file or directory"),
        (("LOG",), "unknown robot 'tiny'"),
        (("LOG", "--robot", "op3"), "it is of robot 'tiny', expected 'op3'"),
        (("LOG", "--robot", TINY, "--scene", "moon"), "unknown scene 'moon'"),
        (
            ("LOG", "--threshold", "0", "--voltage", "nan"),
            "--voltage is nan V, expected 1 to 100 V; --threshold is 0 rad, expected 1e-09 to 10",
        ),
        (("LOG", "--json", "LOG/x"), "is not a folder"),
    ],
)
def test_the_command_refuses_what_it_cannot_use_in_one_line(swing, arguments, message):
    words = [str(word).replace("LOG", str(swing)) for word in arguments]
    with pytest.raises(BadInputError) as error:
        parse(*words).load()()
    assert message in str(error.value)
    assert "\n" not in str(error.value)
