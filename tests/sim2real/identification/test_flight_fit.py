"""A robot that was altered in secret is identified from a flight."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_recording import make_cycle, record_swing, write_flight
from identify_robots import FITTED
from identify_robots import fly as fly_rise
from paths import TINY

from drivers import Cycle, Twin
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.main import main
from humanoid_getup.commands.robot.identify_robot import FitRobotRequest, identify_robot
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot
from robots.individual import AS_DESCRIBED, IDENTIFIED_FILE, Individual
from sim2real.identification import flight_fit
from sim2real.identification.flight_fit import find_warnings, identify
from sim2real.identification.flight_replay import FIGURES, PLAIN, Excerpt, Replayer
from sim2real.identification.supply_and_imu import find_supply_resistance

TRUTH = Individual(
    strength=0.9, friction=1.4, mass=1.05, delay=0.007, com=0.004, imu_tilt=(0.05, -0.1, 0.03)
)


def fly(path: Path, robot: Robot, rate: float = 6.0, truth: Individual = AS_DESCRIBED) -> Path:
    twin = Twin(World(replace(robot, individual=truth)))
    record_swing(path, robot, twin, robot.standing, rate=rate)
    return path


def cut(path: Path, robot: Robot) -> Excerpt:
    return Excerpt.of(FlightRecord.load(path), World(robot))


def nominal() -> np.ndarray:
    return np.array([FIGURES[name].nominal for name in PLAIN])


def test_the_flight_of_a_robot_as_described_is_replayed_within_a_tick(tiny: Robot, swing: Path):
    gap = Replayer(World(tiny), PLAIN).measure([cut(swing, tiny)], nominal())
    assert 0.0 < gap < 0.5


def test_an_altered_robot_is_identified(tiny: Robot, tmp_path: Path):
    flown = cut(fly(tmp_path / "a.mcap", tiny, truth=TRUTH), tiny)
    other = cut(fly(tmp_path / "b.mcap", tiny, 9.0, TRUTH), tiny)
    advanced: list[float] = []
    fit = identify(World(tiny), [flown], [other], steps=80, advance=advanced.append)
    assert sum(advanced) == 80
    assert fit.gap_mrad < 0.1 * fit.catalog_gap_mrad
    for name, off in {"strength": 0.02, "friction": 0.25, "delay": 0.0015}.items():
        assert getattr(fit.individual, name) == pytest.approx(getattr(TRUTH, name), abs=off), name
        assert name not in fit.not_identified
    assert fit.individual.imu_tilt == pytest.approx(TRUTH.imu_tilt, abs=0.02)


def test_a_robot_on_the_virtual_bus_is_replayed_and_its_wires_are_found(op3: Robot):
    truth = Individual(strength=0.9, delay=0.008, supply_resistance=0.1)
    flown = fly_rise(World(op3), truth, FITTED, bus=True)
    quarter = np.arange(len(flown.last)) * 4 // len(flown.last)
    found = find_supply_resistance(op3, [flown], quarter)
    assert found is not None and found[0] == pytest.approx(0.1, abs=0.03)
    known = World(op3.with_individual(Individual(supply_resistance=0.1)))
    row = np.array([0.9, 1.0, 1.0, 0.008, 0.0])
    gap = Replayer(known, PLAIN).measure([flown], row)
    assert gap < 1.0 < 10.0 < Replayer(World(op3), PLAIN).measure([flown], nominal())


def test_friction_by_load_is_found(tiny: Robot, tmp_path: Path):
    truth = Individual(load_friction=0.2, strength=0.95, delay=0.004)
    flown = cut(fly(tmp_path / "a.mcap", tiny, truth=truth), tiny)
    fit = identify(World(tiny), [flown], steps=80)
    assert fit.individual.load_friction == pytest.approx(0.2, abs=0.08)
    assert fit.gap_mrad < 0.2 * fit.catalog_gap_mrad


def test_the_command_writes_what_is_better_beside_the_calibration(
    swing: Path,
    tiny: Robot,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(flight_fit, "STEPS", 32)
    own = Path(shutil.copytree(TINY, tmp_path / "own"))
    flown, other = (
        fly(tmp_path / f"{rate:g}.mcap", tiny, rate, Individual(strength=0.8, delay=0.02))
        for rate in (6.0, 9.0)
    )
    words = ["--hold-out", str(other), "--robot", str(own), "--write", str(own), "--json", "-"]
    assert main(["identify", "robot", str(flown), *words]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert set(PLAIN) <= found["parameters"].keys() and found["written"]
    assert found["robot"] == "tiny" and set(found["flights"]) == {str(flown), str(other)}
    assert "center of mass, mm forward" in printed.err and "along those held out " in printed.err
    assert any(" ms late: check the latency" in each for each in found["warnings"])
    loaded = load_robot(own).individual
    assert (loaded.strength, loaded.delay) == pytest.approx((0.8, 0.02), abs=0.01)
    assert loaded.intervals["strength"] == pytest.approx(found["intervals"]["strength"], rel=1e-4)
    (own / IDENTIFIED_FILE).unlink()
    assert main(["identify", "robot", str(swing), "--robot", str(own), "--write", str(own)]) == 1
    assert "not to be used" in capsys.readouterr().out
    assert not (own / IDENTIFIED_FILE).exists()


def test_a_joint_with_another_servo_is_named(tiny: Robot, tmp_path: Path):
    first, second = tiny.joints
    other = replace(second.servo, own_p_gain=second.servo.p_gain // 3)
    robot = replace(tiny, joints=(first, replace(second, servo=other)))
    flown = cut(fly(tmp_path / "a.mcap", robot), tiny)
    gaps = Replayer(World(tiny), PLAIN).measure_joints([flown], nominal())
    problems = list(find_warnings(World(tiny), Individual(mass=0.5, delay=0.02), gaps))
    expected = f"joint '{second.name}' is ", "of the model's: weigh the robot", "20 ms late: check"
    assert all(part in text for part, text in zip(expected, problems, strict=True)), problems


def test_flights_that_show_no_rise_are_refused(tiny: Robot, swing: Path, tmp_path: Path):
    def limp(cycle: Cycle) -> Cycle:
        none = np.zeros(tiny.n)
        return replace(cycle, sent=replace(cycle.sent, torque_limit=none))

    def still(cycle: Cycle) -> Cycle:
        return replace(cycle, state=replace(cycle.state, joint_pos=np.zeros(tiny.n)))

    logs = {}
    for name, spoil in (("limp", limp), ("still", still)):
        logs[name] = tmp_path / f"{name}.mcap"
        record_swing(logs[name], tiny, Twin(World(tiny)), tiny.standing, spoil)
    write_flight(tmp_path / "one.mcap", tiny, [make_cycle(tiny, 0)])
    for flight, robot, held_out, problem in (
        (logs["limp"], str(TINY), (), "no cycle has torque at full gain, expected a rise"),
        (logs["still"], str(TINY), (), "no joint moves by 0.3 rad"),
        (tmp_path / "one.mcap", str(TINY), (), "expected a rise"),
        (swing, "op3", (), "it is of robot 'tiny', expected 'op3'"),
        (swing, str(TINY), (swing,), "is the same as .*, expected other logs"),
    ):
        request = FitRobotRequest(flights=(flight,), hold_out=held_out, robot=robot)
        with pytest.raises(BadInputError, match=problem) as refused:
            identify_robot(request)
        assert len(refused.value.problems) == 1 and "\n" not in str(refused.value)
