"""A servo is identified from logs of one that hides its figures, and from those of a real one."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers import Command, Twin
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.robot.identify_servo import IdentifyRequest, identify_servo
from robots.bench import Load, make_bench, make_bench_joint
from robots.description.servo_catalog import read_servo_models, servo_models
from robots.quaternion import Array
from robots.servo import ServoModel
from sim2real.identification.pendulums import Pendulums
from sim2real.identification.servo_fit import MODELS, ServoFitter
from sim2real.identification.servo_log import PERIOD, ServoLog, load_servo_log

SHEET = servo_models()["XM430-W350"]
HIDDEN = np.array([2.0, 6.0, 0.003, 0.01, 0.06, 0.02, 0.25, 0.06, 0.1, 0.4])
REAL = Path(__file__).parents[4] / "shared" / "servo-logs" / "xl330-m288"


def make_log(name: str, goal: Array, p_gain: float, mass: float) -> ServoLog:
    """Make a log of the hidden servo, with encoder rounding."""
    log = ServoLog(
        name=name,
        checksum=name,
        servo="xm430",
        period=PERIOD,
        goal=goal,
        joint_pos=np.zeros(len(goal)),
        torque_on=np.ones(len(goal), dtype=bool),
        start_speed=0.0,
        p_gain=p_gain,
        voltage=12.0,
        mass=mass,
        arm=0.15,
    )
    angle = Pendulums([log], SHEET).run(HIDDEN[None])[0, 0]
    return replace(log, joint_pos=np.round(angle / SHEET.rad_per_tick) * SHEET.rad_per_tick)


@pytest.fixture(scope="module")
def logs() -> list[ServoLog]:
    time = np.arange(0.0, 1.2, PERIOD)
    goals = (np.sin(4.0 * time**2), np.sin(2.0 * np.pi * time) * np.sin(1.5 * time))
    return [
        make_log(f"{k}, {gain}, {mass}", goal, gain, mass)
        for gain, mass in ((100, 1.2), (400, 1.2), (800, 0.6))
        for k, goal in enumerate(goals)
    ]


def test_hidden_figures_are_found(logs: list[ServoLog]):
    fitter, found = ServoFitter(SHEET), None
    errors = []
    for count in MODELS.values():
        found = fitter.fit(logs, count, found)
        errors.append(float(np.mean(list(fitter.measure(logs, found).values()))))
    assert found is not None
    assert found[:3] == pytest.approx(HIDDEN[:3], rel=0.1)
    assert found[4:8] == pytest.approx(HIDDEN[4:8], rel=0.25)
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-3 < 5e-3 < fitter.measure_catalog(logs)


def write_log(path: Path, log: ServoLog, **changes: object) -> Path:
    """Write a log as a bench does."""
    rows = zip(log.goal.tolist(), log.joint_pos.tolist(), strict=True)
    entries = [
        {
            "timestamp": PERIOD * k,
            "goal_position": goal,
            "position": position,
            "speed": 0.0,
            "torque_enable": True,
        }
        for k, (goal, position) in enumerate(rows)
    ]
    file = {
        "mass": log.mass,
        "length": log.arm,
        "kp": log.p_gain,
        "vin": log.voltage,
        "motor": log.servo,
        "entries": entries,
    }
    path.write_text(json.dumps({k: v for k, v in (file | changes).items() if v is not None}))
    return path


def shift(entries: list[dict[str, object]], **fields: object) -> list[dict[str, object]]:
    return [entry | fields for entry in entries]


def test_a_log_that_cannot_be_used_is_refused_in_one_line(logs: list[ServoLog], tmp_path: Path):
    good = json.loads(write_log(tmp_path / "log.json", logs[0]).read_text())["entries"]
    gap = [e for e in good if not 0.3 < e["timestamp"] < 0.8]
    degrees = [e | {"position": np.degrees(e["position"]) * 3.0} for e in good]
    wrong = {
        "expected the arm of the mass": {"length": None},
        "no sample for 0.5": {"entries": gap},
        "expected rad: is it in degrees?": {"entries": degrees},
        "torque was never on": {"entries": shift(good, torque_enable=False)},
        "expected 1 s at least": {"entries": good[:20]},
        "is not after the one before it": {"entries": [*good[:9], good[7], *good[9:]]},
        "Expected `float`": {"vin": "12 V"},
    }
    for expected, change in wrong.items():
        path = write_log(tmp_path / "wrong.json", logs[0], **change)
        with pytest.raises(ValueError, match=expected) as caught:
            load_servo_log(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    (tmp_path / "text.json").write_text("no log")
    with pytest.raises(ValueError, match="expected a servo log"):
        load_servo_log(tmp_path / "text.json")
    other = write_log(tmp_path / "other.json", logs[0], motor="mx-64")
    request = IdentifyRequest(logs=(other,), servo="XM430-W350")
    with pytest.raises(BadInputError, match="expected logs of a XM430-W350, not other"):
        identify_servo(request)


def test_better_figures_are_written_beside_what_is_there(logs: list[ServoLog], tmp_path: Path):
    (tmp_path / "robot.toml").write_text("")
    (tmp_path / "servos.toml").write_text('# ours\n["MX-28(2.0)"]\nmass = 0.5\n')
    files = tuple(write_log(tmp_path / f"{k}.json", log) for k, log in enumerate(logs[::2]))
    request = IdentifyRequest(logs=files, servo="XM430-W350", write=tmp_path)
    found = identify_servo(request)
    assert found.written
    assert found.held_out_mae_mrad < 0.5 * found.catalog_mae_mrad
    text = (tmp_path / "servos.toml").read_text()
    assert text.startswith('# ours\n["MX-28(2.0)"]\nmass = 0.5\n')
    assert all(checksum in text for checksum in found.logs.values())
    models, problems = read_servo_models(tmp_path)
    assert problems == []
    assert models["XM430-W350"].load_friction == pytest.approx(0.25, rel=0.2)
    with pytest.raises(BadInputError, match="nothing is written"):
        identify_servo(replace(request, logs=files))


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


@pytest.mark.skipif(not REAL.exists(), reason="logs of a real servo are not here")
def test_the_twin_follows_a_real_servo():
    """The data sheet alone is off by 104 mrad."""
    real = [load_servo_log(path) for path in sorted(REAL.glob("*.json"))]
    assert len(real) == 16
    errors = [replay(log, servo_models()["XL330-M288"]) for log in real]
    assert np.mean(errors) < 0.025
