"""The benchmarks on the virtual bus: small ones of each, and what they must never count."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from drivers.dynamixel.servo_states import ServoStates
from humanoid_getup.benchmarks.fault_injection import bench_faults, bench_kill
from humanoid_getup.benchmarks.soak import bench_soak
from humanoid_getup.cli.main import main
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot


@pytest.fixture(scope="module")
def motion(op3: Robot) -> Motion:
    return next(m for m in load_database(op3).motions if m.name == "supine_roll_over")


def test_each_fault_ends_safely_or_is_bridged(world: World, motion: Motion):
    names = ("one reply late", "servo dead", "overload latch", "command of NaN", "unplugged")
    table = bench_faults(world, motion, seed=0, each=1, cases=names).cases
    assert list(table) == list(names)
    for name, case in table.items():
        figures = case.beyond_limits, case.believed_wrong, case.never_safe, case.unsaid
        assert figures == (0, 0, 0, 0), name
    assert table["one reply late"].succeeded == 1
    for name in names[1:]:
        silent = name in ("servo dead", "unplugged")
        assert table[name].endings == {"unreleased" if silent else "fault": 1}, name
        # The slowest of them: 12 silent cycles, 96 ms, and the cycle that notices.
        assert table[name].safe_max_s <= 0.13, name


def test_a_wrong_position_would_be_seen(world: World, motion: Motion, monkeypatch):
    """The checked driver is not blind: a driver that repeats old values as fresh is caught."""

    update = ServoStates.update_cyclic

    def pretend(states: ServoStates, replies, now: float) -> None:
        old = states.register.copy()
        update(states, replies, now)
        states.register[:] = old

    monkeypatch.setattr(ServoStates, "update_cyclic", pretend)
    table = bench_faults(world, motion, seed=0, each=1, cases=["none"]).cases
    assert table["none"].believed_wrong > 0


@pytest.mark.slow
def test_servos_stop_by_themselves_when_their_client_is_killed(world: World, motion: Motion):
    (kills,) = bench_kill(world, motion, seed=0, each=2).cases.values()
    assert kills.tripped == 2
    assert (kills.never_safe, kills.beyond_limits) == (0, 0)
    assert kills.safe_max_s < 0.2


@pytest.mark.slow  # half a minute
def test_a_soak_accounts_for_all_its_time(world: World):
    case = bench_soak(PlannedRise(world), seed=1, duration=15.0).cases["soak"]
    assert case.stood == case.n == case.lay_down > 0
    assert abs(case.unexplained_s) < 1e-6
    assert (case.driver_lost, case.driver_damaged, case.holds) == (0, 0, 0)


@pytest.mark.slow
def test_the_command_writes_the_table(tmp_path: Path):
    figures = tmp_path / "soak.json"
    assert main(["bench", "soak", "--duration", "5", "--json", str(figures)]) == 0
    assert json.loads(figures.read_text())["name"] == "soak"
