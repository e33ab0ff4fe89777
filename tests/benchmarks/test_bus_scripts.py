"""Scripts on the virtual bus, and of the filter's speed: small runs, and what must never count."""

import json
from pathlib import Path

import filter_speed
import inject_faults
import kill_client
import numpy as np
import pytest
import sit
import soak
from benchmark_scripts import load_script
from inject_faults import FaultOptions, is_harmed

from drivers.dynamixel.servo_states import ServoStates


@pytest.mark.slow
def test_each_fault_ends_safely_or_is_bridged(tmp_path: Path):
    names = ("one reply late", "servo dead", "overload latch", "command of NaN", "unplugged")
    file = tmp_path / "faults.json"
    result = inject_faults.main(FaultOptions(n=1, cases=names, json=file))
    table = result["cases"]
    assert list(table) == list(json.loads(file.read_text())["cases"]) == list(names)
    assert not is_harmed(result)
    assert table["one reply late"]["succeeded"] == 1
    for name in names[1:]:
        silent = name in ("servo dead", "unplugged")
        assert table[name]["endings"] == {"unreleased" if silent else "fault": 1}, name
        # The slowest of them: 12 silent cycles, 96 ms, and the cycle that notices.
        assert table[name]["safe_max_s"] <= 0.13, name


def test_a_wrong_position_would_be_seen(monkeypatch: pytest.MonkeyPatch):
    """The checked driver is not blind: a driver that repeats old values as fresh is caught."""

    update = ServoStates.update_cyclic

    def pretend(states: ServoStates, replies, now: float) -> None:
        old = states.register.copy()
        update(states, replies, now)
        states.register[:] = old

    monkeypatch.setattr(ServoStates, "update_cyclic", pretend)
    result = inject_faults.main(FaultOptions(n=1, cases=("none",)))
    assert result["cases"]["none"]["believed_wrong"] > 0
    assert is_harmed(result)


@pytest.mark.slow
def test_servos_stop_by_themselves_when_their_client_is_killed():
    result = kill_client.main(kill_client.KillOptions(n=1))
    (case,) = result["cases"].values()
    assert (case["tripped"], case["never_safe"], case["beyond_limits"]) == (1, 0, 0)
    assert case["safe_max_s"] < 0.2


@pytest.mark.slow
def test_a_soak_accounts_for_all_its_time(tmp_path: Path):
    file = tmp_path / "soak.json"
    soak.main(soak.SoakOptions(seed=1, duration=15.0, json=file))
    case = json.loads(file.read_text())["cases"]["soak"]
    assert case["stood"] == case["n"] == case["lay_down"] > 0
    assert abs(case["unexplained_s"]) < 1e-6
    assert (case["driver_lost"], case["driver_damaged"], case["holds"]) == (0, 0, 0)


@pytest.mark.slow
def test_ways_down_are_played_under_each_limit_by_processes_as_by_one(tmp_path: Path):
    files = [tmp_path / f"{workers}.json" for workers in (1, 2)]
    for workers, file in enumerate(files, 1):
        sit.main(sit.SitOptions(n=2, seed=3, engine=f"local:{workers}", json=file))
    here, there = (json.loads(file.read_text()) for file in files)
    assert here == there
    assert [case["succeeded"] for case in here["cases"].values()] == [2, 2, 2]
    assert len({case["peak_torque_nm"]["median"] for case in here["cases"].values()}) == 3


@pytest.mark.slow
def test_the_filter_is_timed_beside_bare_physics(capsys: pytest.CaptureFixture[str]):
    filter_speed.main(filter_speed.FilterOptions(n=1))
    assert "one_thread" in capsys.readouterr().out


def test_a_servo_that_falls_silent_in_a_rise_is_named_while_the_others_go_limp():
    script = load_script("torque_ownership")
    world = script.make_world("X")
    trial = script.try_event(world, "rise", "silent servo", 40, np.random.default_rng(0))
    assert (trial.end, trial.unsaid, trial.beyond_limits) == ("limp but for 1", 0, 0)
    assert trial.safe_s < 0.15
