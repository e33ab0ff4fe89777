"""`getup replay`, as a person uses it."""

import json
import resource

import pytest
from flight_recording import SECOND, Swing, twin_of
from paths import TINY

from drivers import Cycle, Ending, GuardLimits, SafetyGuard, run
from drivers.flight_log.writer import FlightLog
from humanoid_getup.cli import commands
from humanoid_getup.jobs.errors import BadInputError


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
