"""Servos of an imported robot: by what its model states, what the user says, or its weight."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.description.servo_catalog import servo_models
from robots.model_import.servo_choice import choose_servos
from robots.model_import.source import ActuatorFigures, ModelImportError

JOINTS = ("l_knee", "r_knee", "l_elbow", "r_elbow")
SMALL = {"weight": 3.0, "leg_length": 0.25}  # kg, m
TORQUES = st.floats(0.5, 150.0)


def choose(stated: dict[str, float] | None = None, *asked: str, **size: float):
    figures = {name: ActuatorFigures(effort=effort) for name, effort in (stated or {}).items()}
    return choose_servos(JOINTS, figures, asked, **SMALL | size)


def test_the_speed_decides_among_types_of_about_one_torque():
    """Of 3.0, 4.1 and 3.4 N·m: 3.5 N·m fit the last one best, but for its speed."""
    for speed, kind in ((8.06, "XM430-W210"), (4.82, "XM430-W350"), (3.14, "XH430-W350")):
        figures = dict.fromkeys(JOINTS, ActuatorFigures(effort=3.5, speed=speed))
        assert set(choose_servos(JOINTS, figures, (), **SMALL).types) == {kind}


def test_type_and_supply_are_those_that_have_the_stated_torque():
    """At 14.8 V a motor for 12 V has 14.8 / 12 of its torque."""
    for torque, kind, supply in (
        *((4.1, "XM430-W350", 12.0), (10.6, "XM540-W270", 12.0)),
        *((13.07, "XM540-W270", 14.8), (1.4, "XL430-W250", 11.1)),
    ):
        choice = choose(dict.fromkeys(JOINTS, torque))
        assert (set(choice.types), choice.supply) == ({kind}, supply)
        assert not choice.own


def test_what_the_user_says_counts_more_and_the_last_pattern_most():
    choice = choose(dict.fromkeys(JOINTS, 4.1), "XM540-W270", "XM430-W210=*elbow")
    assert choice.types == (*["XM540-W270"] * 2, *["XM430-W210"] * 2)
    assert not choice.guesses


def test_without_limits_the_weakest_type_that_lifts_the_robot_is_taken():
    choice = choose()
    # By hand: twice a quarter of 3 kg x 9.81 m/s² x 0.25 m are 3.7 N·m.
    (kind,) = set(choice.types)
    assert choice.supply == 12.0
    model = servo_models()[kind]
    torque = model.stall_torque * choice.supply / model.nominal_voltage
    assert torque >= 3.68
    weaker = [
        m
        for m in servo_models().values()
        if m.accepts_supply(choice.supply)
        and 3.68 <= m.stall_torque * choice.supply / m.nominal_voltage < torque
    ]
    assert not weaker
    assert "3.7 N·m" in choice.guesses[0]


def test_a_robot_that_no_servo_lifts_has_motors_of_its_own_up_to_a_limit():
    choice = choose(weight=50.0, leg_length=0.8)
    (kind,) = set(choice.types)
    assert choice.own[kind]["stall_torque"] == pytest.approx(200.0, rel=0.05)  # 2 x 98 N·m
    assert choice.supply == 48.0
    with pytest.raises(ModelImportError, match="torque limit of 300 N·m, expected at most 200"):
        choose({"l_knee": 300.0}, weight=80.0, leg_length=1.0)


def test_a_lighter_type_is_guessed_if_the_others_would_outweigh_the_robot():
    """OP3 has 20 servos and weighs 3.1 kg; 20 XH540 that its weight asks for would be 3.3 kg."""
    joints, size = [f"joint_{k}" for k in range(20)], {"weight": 3.1, "leg_length": 0.28}
    choice = choose_servos(joints, {}, (), **size)
    assert set(choice.types) == {"XM430-W350"}  # which OP3 has
    (guess,) = choice.guesses
    assert "4.3 N·m" in guess
    assert guess.endswith("set the types with --servo TYPE=PATTERN")


def test_motors_of_its_own_weigh_no_more_than_their_share_of_the_robot():
    """A person's 49 joints of 200 N·m: by their torque alone they would weigh 153 kg."""
    joints = [f"joint_{k}" for k in range(49)]
    choice = choose_servos(joints, {}, (), weight=65.0, leg_length=0.85)
    mass = sum(choice.own[kind]["mass"] for kind in choice.types)
    assert mass == pytest.approx(0.75 * 65.0, rel=0.01)


@given(weight=st.floats(0.5, 30.0), effort=TORQUES)
def test_only_servos_that_the_driver_speaks_to_are_guessed(weight: float, effort: float):
    chosen = {*choose(weight=weight).types, *choose(dict.fromkeys(JOINTS, effort)).types}
    assert not [kind for kind in chosen if kind.startswith("STS")]
    assert set(choose(None, "STS3250-C001").types) == {"STS3250-C001"}
