"""A servo is identified from logs of one that hides its figures, and from those of a real one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paths import SHARED
from scipy.stats import t as student
from servo_logs import HIDDEN, SHEET, record_servo, write_servo_log

from drivers import Command, Twin
from humanoid_getup.commands.robot.identify_servo import FitServoRequest, identify_servo
from robots.bench import Load, make_bench, make_bench_joint
from robots.description.servo_catalog import read_servo_models, servo_models
from robots.servo import ServoModel
from sim2real.identification.pendulums import PARAMETERS
from sim2real.identification.servo_fit import (
    Estimate,
    ServoFit,
    ServoFitter,
    compute_reach,
    split,
)
from sim2real.identification.servo_log import ServoLog, load_servo_log

REAL = SHARED / "servo-logs" / "xl330-m288"
STIFF = "friction by load, and stiction"


@pytest.fixture(scope="module")
def logs() -> list[ServoLog]:
    return record_servo()


def describe(figures: np.ndarray) -> ServoFit:
    """Make a result of figures."""
    values = zip(PARAMETERS, figures.tolist(), strict=True)
    exact = {name: Estimate(value=value, lower=value, upper=value) for name, value in values}
    return ServoFit(model=STIFF, parameters=exact, errors=np.zeros(1), held_out_error=0.0)


def test_hidden_figures_are_found_and_better_ones_written(
    logs: list[ServoLog], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "robot.toml").write_text("")
    (tmp_path / "servos.toml").write_text('# ours\n["MX-28(2.0)"]\nmass = 0.5\n')
    files = [write_servo_log(tmp_path / f"{k}.json", log) for k, log in enumerate(logs)]
    request = FitServoRequest(
        logs=(*files[:3], *files[6:]), hold_out=tuple(files[3:6]), write=tmp_path
    )
    found = identify_servo(request)
    assert (found.servo, found.model, found.warnings) == (SHEET.name, STIFF, ())
    figures: dict[str, float] = dict(zip(PARAMETERS, HIDDEN.tolist(), strict=True))
    for name, value in found.parameters.items():
        assert value == pytest.approx(figures[name], rel=0.1), name
    covered = [lower <= figures[name] <= upper for name, (lower, upper) in found.intervals.items()]
    assert sum(covered) >= 8
    assert found.mae_mrad < found.held_out_mae_mrad < 1.0 < 10.0 < found.catalog_mae_mrad
    assert found.mae_mrad == pytest.approx(np.mean(list(found.log_mae_mrad.values())))
    text = (tmp_path / "servos.toml").read_text()
    assert text.startswith('# ours\n["MX-28(2.0)"]\nmass = 0.5\n')
    assert all(f"{name}: {checksum}" in text for name, checksum in found.logs.items())
    models, problems = read_servo_models(tmp_path)
    assert problems == []
    written = models["XM430-W350"]
    assert written.motor_constant == pytest.approx(found.parameters["motor_constant"], rel=1e-4)
    assert written.resistance == pytest.approx(found.parameters["resistance"], rel=1e-4)
    assert written.stiction == pytest.approx(found.parameters["stiction"], rel=1e-4)

    same = replace(
        describe(HIDDEN), errors=np.zeros(6), held_out_error=1e-3 * found.held_out_mae_mrad
    )
    monkeypatch.setattr(ServoFitter, "identify", lambda *_: same)
    again = identify_servo(request)
    assert not again.written
    assert "keep those, or record more" in again.doubt
    absurd = replace(same, held_out_error=0.5)
    monkeypatch.setattr(ServoFitter, "identify", lambda *_: absurd)
    assert "check sign, zero and unit of the angles" in identify_servo(request).doubt
    bounded = replace(same, held_out_error=0.0, at_bounds=("armature",))
    monkeypatch.setattr(ServoFitter, "identify", lambda *_: bounded)
    assert "ask for more or less armature than any" in identify_servo(request).doubt
    halved = HIDDEN * np.where(np.array(PARAMETERS) == "resistance", 2.5, 1.0)
    wrong = replace(describe(halved), errors=np.zeros(6))
    monkeypatch.setattr(ServoFitter, "identify", lambda *_: wrong)
    assert "check mass and length of the lever" in identify_servo(request).doubt
    assert (tmp_path / "servos.toml").read_text() == text


def test_a_servo_without_friction_by_load_gets_the_small_model():
    plain = np.concatenate([HIDDEN[:6], np.zeros(3), [0.1]])
    fit = ServoFitter(SHEET).identify(record_servo(plain, 1.0)[::2])
    assert fit.model == "constant friction"
    assert len(fit.parameters) == 6
    assert fit.parameters["friction"].value == pytest.approx(0.06, rel=0.05)


def test_parts_are_trajectories_or_run_diagonally(logs: list[ServoLog]):
    parts = split(logs)
    assert [{log.trajectory for log in part} for _, part in parts] == [{"chirp"}, {"up"}, {"waves"}]
    assert all(len(rest) == 6 and len(part) == 3 for rest, part in parts)
    unnamed = [replace(log, trajectory="") for log in [*logs, *logs[:7]]]
    for rest, part in split(unnamed):
        assert (len(rest), len(part)) == (12, 4)
        assert len({log.p_gain for log in part}) > 1


def test_an_interval_of_refits_is_that_of_a_mean():
    """The mean of six numbers without each of them in turn: t of 5 times their standard error."""
    x = np.array([1.0, 4.0, 2.0, 8.0, 5.0, 7.0])
    without_each = (x.sum() - x) / 5.0
    expected = student.ppf(0.975, 5) * x.std(ddof=1) / np.sqrt(6.0)
    assert compute_reach(without_each[:, None]) == pytest.approx([expected])


def test_a_value_with_a_wide_interval_is_left_open():
    assert Estimate(value=-1.0, lower=-1.4, upper=-0.6).is_identified
    assert not Estimate(value=1.0, lower=0.4, upper=1.6).is_identified


def replay(log: ServoLog, model: ServoModel) -> float:
    """Replay a log on the twin; return the mean absolute error of the angle [rad]."""
    joint = make_bench_joint(model, 1)
    joint = replace(joint, servo=replace(joint.servo, own_p_gain=round(log.p_gain)))
    load = Load(mass=log.mass, arm=log.arm)
    bench = make_bench([joint], baud=1_000_000, loads=[load], control_period=log.period)
    start = replace(bench.standing, joint_pos=log.joint_pos[:1])
    twin = Twin(bench, start, voltage=log.voltage, limit_by="pwm", without_imu=True)
    errors = []
    with twin:
        for goal, angle, is_on in zip(log.goal, log.joint_pos, log.torque_on, strict=True):
            errors.append(abs(twin.truth.qpos[-1] - angle))
            torque = np.array([100.0 if is_on else 0.0])
            twin.write(
                Command(
                    joint_pos=np.array([goal]),
                    gain_scale=np.ones(1),
                    torque_limit=torque,
                    pwm_limit=np.ones(1),
                )
            )
    return float(np.mean(errors))


def test_the_simulation_that_is_fitted_is_that_of_the_twin():
    centered = HIDDEN * (np.arange(len(HIDDEN)) != PARAMETERS.index("offset"))
    model = describe(centered).apply(SHEET)
    for log in record_servo(centered):
        assert replay(log, model) < 4e-3, log.name
        assert replay(log, SHEET) > 4e-3, log.name


@pytest.mark.skipif(not REAL.exists(), reason="logs of a real servo are not here")
def test_the_twin_follows_a_real_servo():
    """The data sheet alone is off by 104 mrad."""
    real = [load_servo_log(path) for path in sorted(REAL.glob("*.json"))]
    assert len(real) == 16
    errors = [replay(log, servo_models()["XL330-M288"]) for log in real]
    assert np.mean(errors) < 0.025
