"""A flight log that was recorded on the twin replays on the twin to the last bit."""

import json
from dataclasses import replace

import numpy as np
import pytest
from flight_recording import record_swing, twin_of

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.reporting.replay import ReplayReport, choose_supply, replay
from robots.quaternion import IDENTITY, multiply
from robots.storage.encoding import to_plain


def spoiled(record: FlightRecord, name: str, change) -> FlightRecord:
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
    values = np.column_stack([report.difference, report.tilt_difference])
    row = int(np.argmax(np.abs(values).max(axis=1) > 0.01))
    assert first.time == report.time[row] > 0.0
    column = (*tiny.joint_names, None).index(first.joint)
    assert first.difference == values[row, column]
    assert choose_supply(record, tiny) == pytest.approx(weak)
    assert replay(record, twin_of(tiny, weak, "pwm"), tiny.standing).is_exact


def test_differences_are_worked_out_by_joint(tiny):
    report = ReplayReport(
        robot="tiny",
        joint_names=tiny.joint_names,
        time=np.array([0.0, 0.1, 0.2, 0.3]),
        difference=np.array([[0.0, 0.0], [0.0, 0.3], [-0.2, 0.4], [np.nan, 0.0]]),
        tilt_difference=np.array([0.0, 0.0, 0.2, 0.0]),
        threshold=0.25,
        curves={},
        phase=np.array([0, 1, 1, 1]),
    )
    # Of the rise: sqrt(0.04 / 2 measured), sqrt((0.09 + 0.16) / 3).
    assert report.gaps.keys() == {"lying", "rising", "flight"}
    rising = [0.2 / np.sqrt(2.0), np.sqrt(0.25 / 3.0), 0.2 / np.sqrt(3.0)]  # the last of the tilt
    np.testing.assert_allclose(report.gaps["rising"], rising)
    # sqrt(0.04 / 3 measured), sqrt((0.09 + 0.16) / 4)
    np.testing.assert_allclose(report.rms, [0.2 / np.sqrt(3.0), 0.25])
    np.testing.assert_allclose(report.maximum, [0.2, 0.4])
    assert (report.divergence.time, report.divergence.difference) == (0.1, 0.3)
    figures = report.describe()
    assert (figures["max_joint"], figures["tilt_rms_rad"]) == (tiny.joint_names[1], 0.1)
    assert figures["divergence_part"] == "joint 'r_hip'"
    json.dumps(to_plain(figures), allow_nan=False)


def test_a_torso_that_leans_differs_in_tilt_alone_and_its_heading_is_free(swing, tiny):
    record = FlightRecord.load(swing, tiny)

    def turn(axis):  # 0.2 rad on the left: in the world
        half = np.array([np.cos(0.1), *(np.sin(0.1) * np.array(axis))])
        return spoiled(record, "orientation", lambda q: multiply(half, q))

    leaning = replay(turn([1.0, 0.0, 0.0]), twin_of(tiny), tiny.standing)
    assert leaning.maximum.max() == 0.0
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
        (lambda time: time + 60.0 * (time > 0.5), r"60\.008 s pass after cycle 62"),
        (lambda time: np.where(time > 0.5, np.nan, time), "nan s pass after cycle 62"),
    ],
)
def test_a_log_whose_clock_jumps_cannot_be_replayed(swing, tiny, change, message):
    record = spoiled(FlightRecord.load(swing), "time", change)
    with pytest.raises(ValueError, match=message):
        replay(record, twin_of(tiny), tiny.standing)


def test_phases_are_lying_rising_the_longest_time_upright_and_what_follows(swing, tiny):
    record = FlightRecord.load(swing, tiny)
    place = np.arange(record.cycles)
    stands = ((place == 30) | ((place >= 50) & (place < 90)))[:, None]
    leaning = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
    record = spoiled(record, "orientation", lambda _: np.where(stands, IDENTITY, leaning))
    sent = record.tracks["sent"]
    torque = np.where(place[:, None] < 10, 0.0, 1.0) * np.ones(tiny.n)
    sent = replace(sent, columns={**sent.columns, "torque_limit": torque})
    driven = replace(record, tracks={**record.tracks, "sent": sent})
    phase = replay(driven, twin_of(tiny), tiny.standing).phase
    expected = np.select([place < 10, place < 50, place < 90], [0, 1, 2], 3)
    np.testing.assert_array_equal(phase, expected)
