"""The preflight: a verdict with reasons before any torque is on."""

import json
import math
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from stored_motions import MOTIONS, OWN, one_of_each_kind

from drivers import SafetyGuard, Twin
from drivers.twin.device_models import Windings
from humanoid_getup.commands.command import load_command
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback import preflight_rollout
from humanoid_getup.playback.estimation import estimate_posture, settle
from humanoid_getup.playback.preflight import ReasonKind, Verdict, preflight
from humanoid_getup.playback.preflight_rollout import predict_heat
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, TorqueLimit
from robots.body.overlap import overlaps_at
from robots.kinematics import place

COMMAND = load_command("preflight")
Preflight: Any = COMMAND.options
QUICK = "prone_wide_push_up"
KNEE = "l_knee"


@pytest.fixture(scope="module")
def motion() -> Motion:
    return MOTIONS[QUICK]


@pytest.fixture(scope="module")
def knee(op3: Robot) -> int:
    return op3.joint_names.index(KNEE)


@pytest.fixture(scope="module")
def rollout(world: World, motion: Motion) -> tuple[Outcome, np.ndarray]:
    rest = find_rest(world, motion.posture(0))
    return preflight_rollout._roll_out(world, motion, rest, 12.0, TorqueLimit(None), None)


@pytest.fixture
def no_rollout(monkeypatch: pytest.MonkeyPatch, rollout: object) -> None:
    """Take one rollout for all, where something else is judged: half a second each."""
    monkeypatch.setattr(preflight_rollout, "_roll_out", lambda *_: rollout)


@pytest.fixture(scope="module")
def lying(world: World, motion: Motion) -> Posture:
    """Measure a twin that lies, limp, where the motion begins."""
    twin = Twin(world)
    first = motion.posture(0)
    twin.place(replace(first, position=first.position + np.array([0.0, 0.0, 0.01])))
    return estimate_posture(world, settle(SafetyGuard(twin)))


def refusals(verdict: Verdict) -> list[str]:
    assert not verdict.passed
    return [str(reason) for reason in verdict.refusals]


@pytest.mark.parametrize("name", one_of_each_kind(OWN))
def test_every_stored_motion_passes_on_a_3s_battery(world: World, name: str):
    verdict = preflight(world, MOTIONS[name], voltage=11.1)
    assert verdict.passed, str(verdict)
    assert verdict.figures.succeeded
    assert 0.3 < verdict.figures.torque_use.max() < 1.2
    assert verdict.figures.end_temperature.max() < 27.0


@pytest.mark.usefixtures("no_rollout")
@pytest.mark.parametrize(
    ("voltage", "message"),
    [
        (9.9, "the supply is 9.9 V, expected 10.0 to 14.8 V: charge the battery"),
        (16.8, "the supply is 16.8 V, expected 10.0 to 14.8 V: use a battery that"),
    ],
)
def test_a_supply_that_the_servos_are_not_made_for_is_refused(world, motion, voltage, message):
    assert message in refusals(preflight(world, motion, voltage=voltage))[0]


def test_a_servo_that_pushes_with_all_it_has_for_long_is_refused(world: World):
    verdict = preflight(world, MOTIONS["supine_sit_up_fast"], voltage=9.0)
    assert verdict.figures.longest_saturation.max() > 1.5
    assert any("hip_roll" in text and "at a time" in text for text in refusals(verdict))


@pytest.mark.usefixtures("no_rollout")
def test_targets_beyond_a_joint_are_named_with_their_time(world, motion, op3, knee):
    target = motion.joint_target.copy()
    target[10, knee] = op3.upper[knee] + 0.2
    message = refusals(preflight(world, replace(motion, joint_target=target), voltage=12.0))
    (text,) = [text for text in message if text.startswith(f"joint '{KNEE}': target ")]
    assert f"target {op3.upper[knee] + 0.2:+.3f} rad at {motion.time[10]:.2f} s" in text
    assert f"outside [{op3.lower[knee]:+.3f}, {op3.upper[knee]:+.3f}] rad" in text


@pytest.mark.usefixtures("no_rollout")
def test_a_servo_that_will_lag_on_this_supply_is_a_warning(world: World):
    verdict = preflight(world, MOTIONS["supine_sit_up_fast"], voltage=11.1)
    assert verdict.passed
    (warning,) = verdict.warnings
    assert warning.kind is ReasonKind.WARN
    assert "targets move at 4.48 rad/s, the servo does 4.46 rad/s" in warning.text
    assert str(verdict).startswith("preflight passed, with warnings: joint '")
    assert preflight(world, MOTIONS["supine_sit_up_fast"], voltage=12.0).reasons == ()


@pytest.fixture(scope="module")
def folded(world: World, lying: Posture) -> Posture:
    """Fold the left forearm 8 mm into the torso, as thick shapes show it."""
    data = mujoco.MjData(world.model)
    roll = world.robot.joint_names.index("l_sho_roll")
    for angle in np.arange(lying.joint_pos[roll], world.robot.lower[roll], -0.01):
        joint_pos = lying.joint_pos.copy()
        joint_pos[roll] = angle
        posture = replace(lying, joint_pos=joint_pos)
        qpos = place(world.robot, world.model, posture)
        if overlaps_at(world.model, qpos, data).max() > 0.008:
            return posture
    raise AssertionError("the arm does not reach the torso")


def test_a_robot_that_lies_in_an_overlap_may_leave_it(world, motion, folded):
    verdict = preflight(world, motion, voltage=12.0, start=folded)
    assert 0.008 < verdict.figures.start_overlap < 0.014
    assert verdict.figures.overlap_growth < 0.002
    assert verdict.passed, str(verdict)


@pytest.mark.usefixtures("no_rollout")
def test_an_overlap_of_other_links_is_not_excused_by_how_it_lies(world, motion, op3, folded):
    crossed = motion.joint_pos.copy()
    left, right = (op3.joint_names.index(f"{side}_hip_roll") for side in "lr")
    crossed[:, left], crossed[:, right] = 0.5 * op3.upper[left], 0.5 * op3.lower[right]
    verdict = preflight(world, replace(motion, joint_pos=crossed), voltage=12.0, start=folded)
    assert any("into itself, beyond how it lies" in text for text in refusals(verdict))


@pytest.mark.usefixtures("no_rollout")
def test_a_measured_posture_that_no_robot_can_have_is_refused(world, motion, op3, lying):
    crossed = lying.joint_pos.copy()
    left, right = (op3.joint_names.index(f"{side}_hip_roll") for side in "lr")
    crossed[left], crossed[right] = op3.upper[left], op3.lower[right]
    message = refusals(
        preflight(world, motion, voltage=12.0, start=replace(lying, joint_pos=crossed))
    )
    assert any("inside itself, expected at most 25 mm: check the zeros" in text for text in message)


@pytest.mark.usefixtures("no_rollout")
def test_a_hot_servo_is_refused_by_name(world: World, motion: Motion, op3: Robot, knee: int):
    heat = np.full(op3.n, 30.0)
    heat[knee] = 78.0
    message = refusals(preflight(world, motion, voltage=12.0, temperature=heat))
    assert message == [f"joint '{KNEE}': has 78 °C, expected at most 75 °C: let it cool down"]


def test_heat_adds_up_as_one_rise_after_another_would(op3: Robot):
    """The law that skips the cycles against the model that steps through them."""
    rng = np.random.default_rng(0)
    torque = rng.uniform(-3.5, 3.5, (600, op3.n))
    start = rng.uniform(25.0, 60.0, op3.n)
    windings = Windings(op3)
    windings.temperature = start.copy()
    rises = 0
    ends: list[np.ndarray] = []
    while windings.temperature.max() <= 75.0:
        for row in torque:
            windings.heat(windings.compute_current(row), op3.control_period)
        ends.append(windings.temperature.copy())
        rises += windings.temperature.max() <= 75.0
    first, counted = predict_heat(op3, torque, start)
    np.testing.assert_allclose(first, ends[0], atol=1e-6)
    assert counted == rises > 1


@pytest.mark.usefixtures("no_rollout")
def test_the_robot_must_lie_as_the_motion_begins(world: World, motion: Motion, lying: Posture):
    verdict = preflight(world, motion, voltage=12.0, start=lying)
    assert verdict.passed, str(verdict)
    assert not any("lies" in reason.text for reason in verdict.reasons)
    other = preflight(world, MOTIONS["supine_sit_up_fast"], voltage=12.0, start=lying)
    (message,) = [text for text in refusals(other) if "lies" in text]
    assert "it lies prone, the motion begins supine" in message
    assert "° from where the motion begins, expected at most 45°" in message


def test_all_that_is_wrong_is_reported_at_once_refusals_first(world, motion, op3, knee):
    target = motion.joint_target.copy()
    target[10, knee] = op3.upper[knee] + 0.02
    spoiled = replace(motion, joint_target=target)
    heat = np.full(op3.n, 80.0)
    verdict = preflight(
        world, spoiled, voltage=9.5, torque_limit=TorqueLimit(0.4, "pwm"), temperature=heat
    )
    message = "; ".join(refusals(verdict))
    falls = (
        "rolled out at 9.5 V with 0.4 N·m, it does not end in a held stand: raise --torque-limit"
    )
    for part in ("the supply is 9.5 V", f"'{KNEE}': target", falls, "has 80 °C"):
        assert part in message
    assert verdict.figures.peak_torque.max() <= 0.4 + 1e-9
    kinds = [reason.kind for reason in verdict.reasons]
    assert kinds == sorted(kinds, key=lambda s: s is ReasonKind.WARN)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"voltage": math.nan}, "voltage is nan V"),
        ({"voltage": 0.0}, "voltage is 0 V"),
        ({"voltage": math.inf}, "voltage is inf V"),
        ({"voltage": 12.0, "temperature": math.nan}, "temperature is not finite"),
    ],
)
def test_what_is_no_measurement_is_bad_input(world, motion, options, message):
    with pytest.raises(ValueError, match=message):
        preflight(world, motion, **options)


@pytest.mark.usefixtures("no_rollout")
def test_the_command_passes_refuses_and_writes_its_figures(tmp_path, capsys, op3):
    file = tmp_path / "verdict.json"
    assert COMMAND.run(Preflight(motion=QUICK, voltage=11.1, json=str(file))) == 0
    record = json.loads(file.read_text())
    assert (record["motion"], record["passed"], record["voltage_v"]) == (QUICK, True, 11.1)
    assert list(record["joints"]) == list(op3.joint_names)
    assert record["joints"][KNEE]["end_temperature_c"] >= 25.0
    assert f"{QUICK}: passed at 11.1 V" in capsys.readouterr().out

    assert COMMAND.run(Preflight(motion=QUICK, voltage=9.0, json="-")) == 1
    out, error = capsys.readouterr()
    record = json.loads(out)  # JSON alone
    assert record["passed"] is False
    assert record["reasons"][0]["kind"] == "refused"
    assert "charge the battery" in error
