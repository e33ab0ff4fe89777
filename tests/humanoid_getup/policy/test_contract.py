"""The contract: there and back as JSON, and every mismatch reported at once."""

import json
from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty
from tiny_policies import change

from humanoid_getup.policy.action import build_action_spec
from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.observation import Term, list_terms
from robots import load_robot

OP3 = load_robot("op3")
ACTION = build_action_spec(OP3, OP3.rising_joints, ("l_knee",))
PERIOD = OP3.control_period
CONTRACT = PolicyContract.of(OP3, ACTION, PERIOD, {"recipe": "quick", "seed": 3, "hours": 0.25})


def test_a_contract_fits_the_robot_that_it_was_made_for_to_a_hundredth_of_its_gains():
    assert CONTRACT.find_mismatches(OP3, PERIOD) == []
    assert CONTRACT.rate_hz == pytest.approx(1.0 / 0.048)
    assert CONTRACT.observation_size == sum(term.size for term in list_terms(OP3, ACTION))
    gain, torque = 1.009 * OP3.position_gain, 0.991 * OP3.max_torque
    close = replace(CONTRACT, position_gain=gain, max_torque=torque)
    assert close.find_mismatches(OP3, PERIOD) == []


def test_a_contract_survives_the_trip_through_json_to_the_last_bit():
    back = PolicyContract.from_json(CONTRACT.to_json())
    assert back.to_json() == CONTRACT.to_json()
    assert back.provenance == {"recipe": "quick", "seed": 3, "hours": 0.25}
    for name, value in vars(ACTION).items():
        np.testing.assert_array_equal(getattr(back.action, name), value)


def swapped(names: tuple[str, ...]) -> tuple[str, ...]:
    return (names[1], names[0], *names[2:])


def bent(angles: np.ndarray) -> np.ndarray:
    return angles + np.where(np.arange(len(angles)) == 13, 0.2, 0.0)


WRONG = [
    ({"robot": "nao"}, "robot: made for 'nao', this is 'op3'"),
    ({"mode": "torque"}, "action mode: 'torque', expected absolute, offset, rate"),
    ({"control_period": 0.01}, "rate: 20.83 Hz with a control period of 10 ms, here 20.83 Hz"),
    ({"rate_hz": 50.0}, "rate: 50.00 Hz with a control period of 8 ms, here 20.83 Hz"),
    ({"imu_frame": "z down"}, "IMU frame: 'z down', here 'gravity and gyro in the torso's"),
    ({"joints": swapped(OP3.joint_names)}, "joint order: 'l_sho_pitch' in place of 'r_sho_pitch'"),
    ({"joints": (*OP3.joint_names[1:], "tail")}, "joints: it lacks r_sho_pitch and it has tail"),
    ({"observation": swapped(CONTRACT.observation)}, "observation: gyro[3] gravity[3]"),
    ({"observation": (*CONTRACT.observation, Term("mood", 2))}, "torque_share[1] mood[2], here"),
    ({"scale": np.ones(3)}, "scale: shape (3,), expected (20,)"),
    ({"directions": ACTION.directions[:-1]}, "directions: shape (6, 20), expected (7, 20)"),
    ({"position_gain": 1.02 * OP3.position_gain}, "gains: joint 'r_sho_pitch' 19.25 N·m/rad, here"),
    ({"max_torque": 0.98 * OP3.max_torque}, "torque: joint 'r_sho_pitch' 4.02 N·m, here 4.10 N·m"),
    ({"home": bent(ACTION.home)}, "home angles: joint 'l_knee' +1.090 rad, here +0.890 rad"),
    ({"reach": 0.0 * ACTION.reach}, "reach: joint 'r_sho_pitch' 0 rad, expected > 0 rad"),
    ({"reach": 2.0 * ACTION.reach}, "speed: targets of joint 'r_sho_pitch' move at"),
]


def test_what_does_not_fit_is_reported():
    for changes, message in nonempty(WRONG):
        mismatches = change(CONTRACT, **changes).find_mismatches(OP3, PERIOD)
        assert any(message in line for line in mismatches), mismatches


def test_all_that_is_missing_or_wrong_in_the_text_is_reported_at_once():
    record = json.loads(CONTRACT.to_json())
    del record["joints"], record["max_torque"]
    del record["action"]["home"], record["action"]["calm"]["least"]
    record["rate_hz"] = "often"
    record["action"]["scale"] = [0.1, None]
    record["action"]["directions"] = [[1.0], [1.0, 2.0]]
    record["observation"][2]["size"] = -1
    record["provenance"] = {"log": [1, 2]}
    with pytest.raises(ValueError) as refusal:
        PolicyContract.from_json(json.dumps(record))
    for message in (
        "joints is missing",
        "action.home is missing",
        "action.calm.least is missing",
        "max_torque is missing",
        "rate_hz is 'often'",
        "action.scale is",
        "action.directions is",
        "observation 'joint_pos': size is -1",
        "provenance.log is [1, 2], expected a text or a number",
    ):
        assert message in str(refusal.value)
